//! Per-scene optimisation: the Gaussians of one pass are moved until their pictures are the photographs.
//!
//! One step draws one view, takes the gradient of its error, and moves every parameter by Adam. Clones have no
//! parameters of their own ([`tie`]): what a view of one side says, the other side follows. Photographs differ in
//! exposure, which is solved for as well ([`exposure`]). One view takes no part and tells when to stop: pictures of the
//! views that do take part always get better, the vehicle does not.

mod adam;
mod exposure;
mod parameters;
mod target;
pub(crate) mod tie;

pub use parameters::Rates;

use crate::error::{Error, Result};
use crate::gaussians::Gaussians;
use crate::progress::Context;
use crate::render::{Background, CpuRenderer, Gradients, PictureGradient, RenderOptions, Rendered};
use crate::scene::View;
use exposure::Exposure;
use parameters::{Optimizer, Parameters};
use serde::Serialize;
use std::time::Instant;
use target::Target;
use tie::Clone as Tied;

/// How long to refine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Amount {
    /// So many steps.
    Iterations(u32),
    /// About so many seconds: a number of steps that is found by timing the first ones. The report tells it, and the
    /// same number gives the same bytes.
    Seconds(f64),
}

/// Settings of a refinement; `RefineOptions::default()` is what everything is measured with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RefineOptions {
    /// How long.
    pub amount: Amount,
    /// Step sizes.
    pub rates: Rates,
    /// Weight of 1 - SSIM beside that of the mean absolute difference of colours, which is the rest to 1.
    pub ssim: f32,
    /// Weight of the mean absolute difference of alpha and mask.
    pub silhouette: f32,
    /// Whether each view has an exposure of its own.
    pub exposure: bool,
    /// Whether one of three or more views takes no part and tells when to stop.
    pub hold_out: bool,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            amount: Amount::Iterations(300),
            rates: Rates {
                means: 1.6e-4,
                rotations: 1e-3,
                scales: 5e-3,
                opacities: 2.5e-2,
                colors: 2.5e-3,
                view_dependence: 1.25e-4,
            },
            ssim: 0.2,
            silhouette: 0.1,
            exposure: true,
            hold_out: true,
        }
    }
}

impl RefineOptions {
    /// Each field in its range.
    pub fn validate(&self) -> Result<()> {
        let refuse = |field: &str, found: String, allowed: &str| {
            Err(Error::argument(format!("options.refine.{field}"), found, allowed))
        };
        match self.amount {
            Amount::Iterations(n) if n > MOST_ITERATIONS => {
                return refuse("iterations", n.to_string(), "at most 1000000");
            }
            Amount::Seconds(s) if !(s > 0.0 && s <= 86400.0) => {
                return refuse("seconds", s.to_string(), "above 0, at most 86400");
            }
            _ => {}
        }
        for (name, weight) in [("ssim", self.ssim), ("silhouette", self.silhouette)] {
            if !(0.0..=1.0).contains(&weight) {
                return refuse(name, weight.to_string(), "0 to 1");
            }
        }
        for (name, rate) in self.rates.named() {
            if !(0.0..=10.0).contains(&rate) {
                return refuse(&format!("rates.{name}"), rate.to_string(), "0 to 10");
            }
        }
        Ok(())
    }
}

/// More steps are a mistake: 3DGS takes 30,000.
const MOST_ITERATIONS: u32 = 1_000_000;

/// Why a refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// All steps are done.
    Done,
    /// The view that took no part got no better any more.
    HeldOut,
    /// The error grew far beyond where it began: the steps are too large.
    Diverged,
}

/// What a refinement did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Refinement {
    /// Steps that were planned: with `Amount::Iterations` of this number another call does the same.
    pub iterations: u32,
    /// Steps that the result has seen; 0 if nothing was better than the beginning.
    pub kept: u32,
    /// Steps that were made.
    pub made: u32,
    /// Why it ended.
    pub stop: Stop,
    /// Mean PSNR of the views that took part, before and after, dB.
    pub psnr_db: [f64; 2],
    /// The view that did not, and its PSNR before and after, dB.
    pub held_out: Option<HeldOut>,
    /// Factors of the views' exposures, RGB, in the order of the views.
    pub exposures: Vec<[f32; 3]>,
}

/// The view that took no part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// Its name.
    pub view: String,
    /// Before and after, dB.
    pub psnr_db: [f64; 2],
}

/// What one vehicle's refinement works with.
struct Work<'a> {
    views: &'a [View],
    targets: Vec<Target>,
    clones: &'a [Tied],
    options: &'a RefineOptions,
    radius_m: f32,
    renderer: CpuRenderer,
    render: RenderOptions,
    // Reused from step to step.
    gaussians: Gaussians,
    picture: Rendered,
    of_picture: PictureGradient,
    gradients: Gradients,
}

/// Moves the Gaussians until their pictures are those of the views. The last ones are `clones`, mirror images of those
/// before; they follow. Views are pinholes in the frame whose plane of symmetry is y = 0.
pub(crate) fn refine(
    mut gaussians: Gaussians,
    clones: &[Tied],
    views: &[View],
    options: &RefineOptions,
    context: &Context,
) -> Result<(Gaussians, Refinement)> {
    let mut knobs = *options;
    for (name, field) in [("VGR_MEANS", &mut knobs.rates.means), ("VGR_ROT", &mut knobs.rates.rotations), ("VGR_SCALE", &mut knobs.rates.scales), ("VGR_OP", &mut knobs.rates.opacities), ("VGR_COL", &mut knobs.rates.colors), ("VGR_VIEW", &mut knobs.rates.view_dependence), ("VGR_SIL", &mut knobs.silhouette)] {
        if let Ok(v) = std::env::var(name) { *field = v.parse().unwrap(); }
    }
    if std::env::var_os("VGR_NOEXP").is_some() { knobs.exposure = false; }
    if std::env::var_os("VGR_NOHOLD").is_some() { knobs.hold_out = false; }
    let options = &knobs;
    gaussians.truncate(gaussians.len() - clones.len());
    let mut parameters = Parameters::of(&gaussians);
    let mut work = Work::new(&gaussians, clones, views, options);
    let mut optimizer = Optimizer::new(&parameters, NOISE);
    let mut exposure = Exposure::new(views.len());
    let held_out = (options.hold_out && views.len() >= 3).then_some(views.len() / 2);
    let shown: Vec<usize> = (0..views.len()).filter(|v| Some(*v) != held_out).collect();

    let before = work.psnr_of_all(&parameters, &exposure, context)?;
    let judged = |psnr: &[f64]| held_out.map_or_else(|| mean(shown.iter().map(|&v| psnr[v])), |v| psnr[v]);
    let mut best = (0u32, judged(&before), before.clone(), parameters.clone(), exposure.clone());
    let mut planned = match options.amount {
        Amount::Iterations(n) => n,
        Amount::Seconds(_) => u32::MAX,
    };
    let (mut made, mut stop) = (0, Stop::Done);
    let start = Instant::now();
    let mut worse = 0;
    while made < planned {
        let view = shown[made as usize % shown.len()];
        let rates = options.rates.times(decay(made, planned));
        work.step(view, &mut parameters, &mut optimizer, &mut exposure, &rates, context)?;
        made += 1;
        if planned == u32::MAX && made as usize == TIMED_ROUNDS * shown.len() {
            planned = fitting(options.amount, made, start.elapsed().as_secs_f64());
        }
        context.report("refine", f64::from(made) / f64::from(planned))?;
        let every = (planned / EVALUATIONS).max(1);
        if made % every == 0 || made == planned {
            let psnr = work.psnr_of_all(&parameters, &exposure, context)?;
            let now = judged(&psnr);
            if now > best.1 {
                best = (made, now, psnr, parameters.clone(), exposure.clone());
                worse = 0;
            } else {
                worse += 1;
            }
            if now < judged(&before) - DIVERGED_DB {
                stop = Stop::Diverged;
                break;
            }
            if worse >= PATIENCE && made < planned {
                stop = Stop::HeldOut;
                break;
            }
        }
    }
    let (kept, _, after, parameters, exposure) = best;
    tie::made(&parameters, clones, &mut work.gaussians);
    let report = Refinement {
        iterations: planned,
        kept,
        made,
        stop,
        psnr_db: [&before, &after].map(|psnr| mean(shown.iter().map(|&v| psnr[v]))),
        held_out: held_out.map(|v| HeldOut { view: views[v].name.clone(), psnr_db: [before[v], after[v]] }),
        exposures: (0..views.len()).map(|v| exposure.factor(v)).collect(),
    };
    Ok((work.gaussians, report))
}

/// Gradients below this of a mean over pixels are noise of single pixels.
const NOISE: f32 = 1e-9;
/// Times that the views are looked at, about.
const EVALUATIONS: u32 = 20;
/// So often may the view that takes no part be worse than at its best.
const PATIENCE: u32 = 4;
/// Views that are worse than at the beginning by this never come back.
const DIVERGED_DB: f64 = 3.0;
/// Rounds over the views that tell how long a step takes.
const TIMED_ROUNDS: usize = 2;
/// Step sizes at the end, as a share of those at the beginning.
const LAST_RATE: f32 = 0.1;

/// Share of the step size at a step: falls exponentially, as in 3DGS.
fn decay(step: u32, of: u32) -> f32 {
    LAST_RATE.powf(step as f32 / of as f32)
}

/// Steps that fit into the time, of which `made` took `seconds`.
fn fitting(amount: Amount, made: u32, seconds: f64) -> u32 {
    match amount {
        Amount::Iterations(n) => n,
        Amount::Seconds(budget) => ((budget / (seconds / f64::from(made))) as u32).max(made),
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), v| (sum + v, n + 1));
    sum / n.max(1) as f64
}

impl<'a> Work<'a> {
    fn new(originals: &Gaussians, clones: &'a [Tied], views: &'a [View], options: &'a RefineOptions) -> Self {
        let radius_m = originals
            .bounds()
            .map_or(1.0, |(low, high)| 0.5 * (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f32>().sqrt());
        Self {
            views,
            targets: views.iter().map(Target::of).collect(),
            clones,
            options,
            radius_m: radius_m.clamp(1e-3, 1e3),
            renderer: CpuRenderer::new(),
            render: RenderOptions { background: Background::Transparent, ..RenderOptions::default() },
            gaussians: Gaussians::default(),
            picture: Rendered::default(),
            of_picture: PictureGradient::default(),
            gradients: Gradients::default(),
        }
    }

    fn step(
        &mut self,
        view: usize,
        parameters: &mut Parameters,
        optimizer: &mut Optimizer,
        exposure: &mut Exposure,
        rates: &Rates,
        context: &Context,
    ) -> Result<()> {
        let Self {
            views,
            targets,
            clones,
            options,
            radius_m,
            renderer,
            render,
            gaussians,
            picture,
            of_picture,
            gradients,
            ..
        } = self;
        context.parallel(|| {
            tie::made(parameters, clones, gaussians);
            let mut loss = target::Loss::default();
            let of_loss = |picture: &Rendered, of_picture: &mut PictureGradient| {
                loss = targets[view].loss(picture, exposure.factor(view), options, Some(of_picture));
                Ok(())
            };
            renderer.render_with_gradients_into(
                gaussians,
                &views[view].camera,
                render,
                (picture, of_picture, gradients),
                of_loss,
            )?;
            tie::gather(gradients, clones, parameters.len(), parameters.sh_degree);
            optimizer.step(parameters, gradients, rates, *radius_m);
            if options.exposure {
                exposure.step(view, loss.of_exposure, rates.colors);
            }
            Ok(())
        })
    }

    fn psnr_of_all(
        &mut self,
        parameters: &Parameters,
        exposure: &Exposure,
        context: &Context,
    ) -> Result<Vec<f64>> {
        let Self { views, targets, clones, options, renderer, render, gaussians, picture, .. } = self;
        context.parallel(|| {
            tie::made(parameters, clones, gaussians);
            (0..views.len())
                .map(|v| {
                    renderer.render_into(gaussians, &views[v].camera, render, picture)?;
                    Ok(targets[v].loss(picture, exposure.factor(v), options, None).psnr_db())
                })
                .collect()
        })
    }
}
