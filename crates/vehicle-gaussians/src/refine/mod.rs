//! Per-scene optimisation: the Gaussians of one pass are optimised until their pictures match the photographs.
//!
//! One step renders one view, computes the gradient of its error, and moves every parameter by Adam. Clones have no
//! parameters of their own (`tie`): views of one side also move the other side. Photographs differ in
//! exposure, which is estimated too (`exposure`). Gaussians can be cloned, split and pruned (`densify`). A view can be
//! held out to decide when to stop: pictures of the optimised views always get better, the vehicle does not.
//! [`baseline`] is another method on the same code.

mod adam;
pub mod baseline;
mod chance;
mod densify;
mod exposure;
mod model;
mod options;
mod parameters;
mod plan;
mod target;
mod tie;
mod work;

pub use densify::{Densified, Densify};
pub use model::{model, model_on};
pub use options::{Amount, RefineOptions};
pub use parameters::Rates;

use crate::symmetry::MirrorClone;
use exposure::Exposure;
use parameters::Parameters;
use plan::Plan;
use serde::Serialize;
use std::collections::VecDeque;
use std::time::Instant;
use vg_geometry::progress::Context;
use vg_geometry::{Result, choices};
use vg_scene::View;
use vg_splat::Gaussians;
use work::{Measures, Work};

choices! {
    /// Why a refinement ended.
    pub enum Stop as "refine_stop" {
        /// All steps are done.
        Done = 0 "done",
        /// The view that took no part got no better any more.
        HeldOut = 1 "held_out",
        /// The error grew far beyond where it began; the best of the states before is returned.
        Diverged = 2 "diverged",
        /// No view sees anything of the model: it is as it was.
        Unseen = 3 "unseen",
    }
}

/// Report of a refinement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Refinement {
    /// The number of planned steps: `Amount::Iterations` with this number gives the same result.
    pub iterations: u32,
    /// The number of steps made.
    pub made: u32,
    /// The number of steps that led to the result; 0 if no state was better than the initial one.
    pub kept: u32,
    /// Reason for the end.
    pub stop: Stop,
    /// Loss of the first step, and the mean of the last round over the views.
    pub loss: [f64; 2],
    /// Mean PSNR of the optimised views, each in its exposure, before and after, dB.
    pub psnr_db: [f64; 2],
    /// The view that was held out, if any.
    pub held_out: Option<HeldOut>,
    /// Factors of the views' exposures, RGB, in the order of the views.
    pub exposures: Vec<[f32; 3]>,
    /// Totals of density control, if it was enabled.
    pub densified: Option<Densified>,
    /// The renderer that was used, and the reason.
    pub drawn_by: String,
}

/// The view that was held out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// Name of the view.
    pub view: String,
    /// PSNR of the view before and after, dB.
    pub psnr_db: [f64; 2],
}

/// The number of evaluations of the held-out view, or of the mean loss, in the course of a refinement.
const EVALUATIONS: u32 = 20;
/// The number of evaluations in a row without improvement after which a refinement stops.
const PATIENCE: u32 = 4;
/// Ratio of the mean loss to the first from which a refinement does not recover.
const DIVERGED: f64 = 3.0;
/// Size of gradients that are noise of single pixels: a loss is a mean over all pixels.
const NOISE: f32 = 1e-9;
/// Final step sizes as a share of the initial ones.
const LAST_RATE: f32 = 0.1;

/// Optimises the Gaussians until their pictures match the views. The last ones are `clones`, mirror images of earlier
/// ones, which follow their originals. Views are pinholes in the frame whose plane of symmetry is y = 0.
pub(crate) fn refine(
    mut gaussians: Gaussians,
    clones: &[MirrorClone],
    views: &[View],
    options: &RefineOptions,
    context: &Context,
) -> Result<(Gaussians, Refinement)> {
    let start = Instant::now();
    gaussians.truncate(gaussians.len() - clones.len());
    let initial = State::new(&gaussians, clones, views.len());
    let measures = Measures { noise: NOISE, extent_m: half_diagonal_m(&gaussians), seed: 0 };
    let mut work = Work::new(&initial, views, options, measures)?;
    let mut state = initial.clone();
    drop(gaussians);
    let held_out = (options.hold_out && views.len() >= 3).then_some(views.len() / 2);
    let shown: Vec<usize> = (0..views.len()).filter(|v| Some(*v) != held_out).collect();
    let round = shown.len() as u32;
    let (before, seen) = work.begin(&state, context)?;

    let amount = if seen { options.amount } else { Amount::Iterations(0) };
    let mut plan = Plan::new(amount, round, start);
    let mut course = Course::default();
    let mut best = Best { error: f64::INFINITY, step: 0, state: state.clone() };
    if let Some(v) = held_out {
        best.error = -before[v];
    }
    let (mut made, mut stop) = (0, if seen { Stop::Done } else { Stop::Unseen });
    let mut without_gain = 0;
    while plan.goes_on(made) {
        // As in 3DGS, step sizes fall exponentially.
        let rates = options.rates.times(LAST_RATE.powf(plan.part(made)));
        let view = shown[(made % round) as usize];
        course.push(work.step(view, &mut state, &rates, context)?, round);
        made += 1;
        plan.note(made);
        if let Some(planned) = plan.planned_at(made) {
            work.densify(&mut state, made, planned, context);
        }
        let Some(planned) = plan.planned() else { continue };
        context.report_loss("refine", f64::from(made) / f64::from(planned), course.last)?;
        let every = (planned / EVALUATIONS).max(round);
        if made % every != 0 && made != planned {
            continue;
        }
        let error = match held_out {
            Some(v) => -work.psnr_of(v, &state, context)?,
            None => course.last,
        };
        if error < best.error {
            best = Best { error, step: made, state: state.clone() };
            without_gain = 0;
        } else {
            without_gain += 1;
        }
        if course.has_diverged() {
            stop = Stop::Diverged;
            break;
        }
        if held_out.is_some() && without_gain >= PATIENCE && made < planned {
            stop = Stop::HeldOut;
            break;
        }
    }
    let after = work.psnr_db(&best.state, context)?;
    // Without a held-out view, the initial state may have been better than all later ones.
    let shown_mean = |psnr: &[f64]| shown.iter().map(|&v| psnr[v]).sum::<f64>() / f64::from(round);
    let (best, after) = match held_out.is_none() && shown_mean(&after) < shown_mean(&before) {
        true => (Best { error: 0.0, step: 0, state: initial }, before.clone()),
        false => (best, after),
    };
    let report = Refinement {
        iterations: plan.planned().unwrap_or(made),
        made,
        kept: best.step,
        stop,
        loss: [course.first.unwrap_or_default(), course.last],
        psnr_db: [shown_mean(&before), shown_mean(&after)],
        held_out: held_out.map(|v| HeldOut { view: views[v].name.clone(), psnr_db: [before[v], after[v]] }),
        exposures: (0..views.len()).map(|v| best.state.exposure.factor(v)).collect(),
        densified: work.densified(),
        drawn_by: work.drawn_by(),
    };
    Ok((work.finished(&best.state, context), report))
}

/// Half the diagonal of the bounding box of all centres, metres.
fn half_diagonal_m(gaussians: &Gaussians) -> f32 {
    let diagonal =
        |(low, high): ([f32; 3], [f32; 3])| (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f32>().sqrt();
    gaussians.bounds().map_or(1.0, |bounds| 0.5 * diagonal(bounds)).clamp(1e-3, 1e3)
}

/// The state that steps change.
#[derive(Clone, Debug)]
struct State {
    /// Parameters of the originals.
    parameters: Parameters,
    /// Clones that follow the originals.
    clones: Vec<MirrorClone>,
    exposure: Exposure,
}

impl State {
    fn new(originals: &Gaussians, clones: &[MirrorClone], views: usize) -> Self {
        let parameters = Parameters::from_gaussians(originals);
        Self { parameters, clones: clones.to_vec(), exposure: Exposure::new(views) }
    }
}

/// The best state so far, and the number of steps that led to it.
struct Best {
    error: f64,
    step: u32,
    state: State,
}

/// The first loss, and the mean of the last round.
#[derive(Debug, Default)]
struct Course {
    recent: VecDeque<f64>,
    first: Option<f64>,
    last: f64,
}

impl Course {
    fn push(&mut self, loss: f64, round: u32) {
        self.first.get_or_insert(loss);
        self.recent.push_back(loss);
        if self.recent.len() > round as usize {
            self.recent.pop_front();
        }
        self.last = self.recent.iter().sum::<f64>() / self.recent.len() as f64;
    }

    fn has_diverged(&self) -> bool {
        self.first.is_some_and(|first| self.last > DIVERGED * first)
    }
}
