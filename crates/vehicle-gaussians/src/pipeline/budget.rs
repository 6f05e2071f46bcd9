//! The best reconstruction within the caller's time: of candidates in order of expected quality, the first whose
//! predicted time fits. The choice is ordinary options, so a run can be repeated exactly without a budget.

use super::cost::{self, Load};
use super::machine::Machine;
use super::options::{Calibrate, Options, PriorChoice};
use super::plan::note;
use super::report::{LeftOut, Stage};
use crate::relight::Relight;
use serde::Serialize;
use std::time::Duration;
use vg_geometry::progress::Context;
use vg_scene::Scene;

/// Part of the budget that predictions may fill; the rest covers their error.
const FILLED: f64 = 0.85;

/// How a budget was resolved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BudgetPlan {
    /// The caller's budget, seconds.
    pub budget_s: f64,
    /// Predicted time of the chosen settings, from the start of the call, seconds.
    pub predicted_s: f64,
    /// Whether the prediction leaves enough room in the budget; if not, the fastest settings were chosen.
    pub fits: bool,
    /// Time that the call took without a refinement, seconds.
    pub took_s: f64,
    /// Whether that time is within the budget.
    pub kept: bool,
    /// The measured speed of this machine.
    pub machine: Machine,
    /// The chosen settings, as in the report's `settings`.
    pub chosen: Chosen,
}

impl BudgetPlan {
    /// The plan with the time of a run, from its stages; a refinement is not part of the budget.
    pub(super) fn after(self, stages: &[Stage]) -> Self {
        let took_s: f64 = 1e-3 * stages.iter().filter(|s| s.name != "refine").map(|s| s.ms).sum::<f64>();
        Self { took_s, kept: took_s <= self.budget_s, ..self }
    }

    /// A sentence for the caller where the budget was exceeded.
    pub fn warning(&self) -> Option<String> {
        let Self { budget_s, took_s, .. } = self;
        let why = if self.fits { "" } else { ", though all was left out that can be" };
        (!self.kept).then(|| format!("budget: {budget_s} s was not kept: the call took {took_s:.2} s{why}"))
    }
}

/// The options that a budget can change.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Chosen {
    /// Depth source.
    pub prior: PriorChoice,
    /// Share of the views' width and height.
    pub resolution: f64,
    /// Most views.
    pub max_views: Option<usize>,
    /// Correction of the cameras.
    pub calibrate: Calibrate,
    /// Photo-consistency.
    pub photo: bool,
    /// Light of the unseen side.
    pub relight: Relight,
    /// Error on the input views.
    pub check: bool,
}

impl Chosen {
    fn of(options: &Options) -> Self {
        Self {
            prior: options.prior,
            resolution: options.resolution,
            max_views: options.max_views,
            calibrate: options.calibrate,
            photo: options.photo,
            relight: options.relight,
            check: options.check,
        }
    }
}

/// The options to work with, which have no budget, and how a budget was resolved.
pub(super) fn resolved(
    scene: &Scene,
    options: &Options,
    context: &Context,
    spent: impl Fn() -> Duration,
    left_out: &mut Vec<LeftOut>,
) -> (Options, Option<BudgetPlan>) {
    let Some(budget_s) = options.budget_s else { return (options.clone(), None) };
    let machine = Machine::measured(context);
    let load = load(scene);
    let mut candidates = candidates(options, &load, machine);
    let spent = spent().as_secs_f64();
    let fit = candidates.iter().position(|(_, seconds)| spent + seconds <= FILLED * budget_s);
    let (chosen, seconds) = candidates.swap_remove(fit.unwrap_or(candidates.len() - 1));
    note_differences(options, &chosen, &load, budget_s, left_out);
    let plan = BudgetPlan {
        budget_s,
        predicted_s: spent + seconds,
        fits: fit.is_some(),
        took_s: 0.0,
        kept: true,
        machine,
        chosen: Chosen::of(&chosen),
    };
    (chosen, Some(plan))
}

/// The size of a scene, for the cost model.
pub(super) fn load(scene: &Scene) -> Load {
    let shows = |v: &&vg_scene::View| v.mask.as_ref().is_none_or(|m| m.vehicle_pixels() > 0);
    let views: Vec<_> = scene.views.iter().filter(shows).collect();
    let mean = |sum: f64| 1e-6 * sum / views.len().max(1) as f64;
    let size = |v: &vg_scene::View| f64::from(v.camera.width) * f64::from(v.camera.height);
    Load {
        views: views.len(),
        pixels: mean(views.iter().map(|v| size(v)).sum()),
        vehicle: mean(
            views.iter().map(|v| v.mask.as_ref().map_or(size(v), |m| m.vehicle_pixels() as f64)).sum(),
        ),
        distorted: views.iter().any(|v| !v.camera.distortion.is_none()),
        has_depth: views.iter().all(|v| v.depth.is_some()),
        has_masks: views.iter().all(|v| v.mask.is_some()),
        cloud: 1e-6 * scene.cloud.as_ref().map_or(0.0, |c| c.points().len() as f64),
    }
}

/// One step to less work; an option that the caller set lower stays there.
type Step = fn(&mut Options);

fn coarser(options: &mut Options, share: f64) {
    options.resolution = options.resolution.min(share);
}

fn fewer(options: &mut Options, most: usize) {
    options.max_views = Some(options.max_views.map_or(most, |views| views.min(most)));
}

/// The steps in order of quality lost per time saved, see docs/PLAN.md.
const STEPS: &[Step] = &[
    |_| {},
    |o| o.check = false,
    |o| fewer(o, 24),
    |o| coarser(o, 0.75),
    |o| fewer(o, 12),
    |o| o.photo = false,
    |o| coarser(o, 0.5),
    |o| fewer(o, 8),
    |o| {
        if o.prior == PriorChoice::Auto {
            o.prior = PriorChoice::Hull;
        }
    },
    |o| coarser(o, 0.35),
    |o| coarser(o, 0.25),
    |o| fewer(o, 4),
    |o| o.calibrate = Calibrate::Off,
    |o| o.relight = Relight::Never,
    |o| fewer(o, 3),
    |o| fewer(o, 2),
    |o| coarser(o, 0.15),
    |o| fewer(o, 1),
];

/// All settings worth trying, best first, with their predicted seconds, which fall.
fn candidates(options: &Options, load: &Load, machine: Machine) -> Vec<(Options, f64)> {
    let mut now = Options { budget_s: None, ..options.clone() };
    let mut out: Vec<(Options, f64)> = Vec::new();
    for step in STEPS {
        step(&mut now);
        // Measured depth is faster and better than the hull.
        if load.has_depth && now.prior == PriorChoice::Hull && options.prior == PriorChoice::Auto {
            now.prior = PriorChoice::Auto;
        }
        if now.max_views.is_some_and(|most| most >= load.views) {
            now.max_views = options.max_views;
        }
        let seconds = cost::seconds(load, &now, machine);
        if out.last().is_none_or(|(_, before)| seconds < *before) {
            out.push((now.clone(), seconds));
        }
    }
    out
}

/// Notes what the budget left out. Resolution and views are noted by the stages that reduce them.
fn note_differences(
    requested: &Options,
    chosen: &Options,
    load: &Load,
    budget_s: f64,
    left_out: &mut Vec<LeftOut>,
) {
    let why = format!("no time for it in a budget of {budget_s} s");
    let shape = matches!(requested.prior, PriorChoice::Auto | PriorChoice::Shape) && !load.has_depth;
    for (what, gone) in [
        ("check", requested.check && !chosen.check),
        ("photo-consistency", shape && requested.photo && !chosen.photo),
        ("shape prior", requested.prior != chosen.prior),
        ("calibration", requested.calibrate != chosen.calibrate),
        ("light of the unseen side", requested.relight != chosen.relight),
    ] {
        note(left_out, what, &why, usize::from(gone));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: Machine = Machine { serial: 1.0, parallel: 2.0 };

    fn car(views: usize, has_depth: bool) -> Load {
        Load { views, pixels: 0.2, vehicle: 0.08, has_depth, has_masks: true, ..Load::default() }
    }

    #[test]
    fn predicted_time_falls_along_the_candidates_to_a_small_part() {
        for (views, has_depth, least) in [(4, false, 8), (40, false, 12), (4, true, 6), (1, false, 6)] {
            let all = candidates(&Options::default(), &car(views, has_depth), MACHINE);
            assert!(all.len() >= least, "{views} views: {}", all.len());
            assert!(all.windows(2).all(|pair| pair[1].1 < pair[0].1));
            assert!(all[all.len() - 1].1 < 0.25 * all[0].1, "{views} {has_depth}");
            assert_eq!(all[0].0, Options::default());
            assert!(all.iter().all(|(options, _)| options.validate().is_ok() && options.budget_s.is_none()));
        }
    }

    #[test]
    fn settings_of_the_caller_are_never_raised() {
        let requested = Options {
            check: false,
            resolution: 0.3,
            max_views: Some(2),
            prior: PriorChoice::Shape,
            ..Options::default()
        };
        for (options, _) in candidates(&requested, &car(9, false), MACHINE) {
            assert!(!options.check && options.resolution <= 0.3 && options.prior == PriorChoice::Shape);
            assert!(options.max_views.is_some_and(|most| most <= 2));
        }
        let given = candidates(&Options::default(), &car(4, true), MACHINE);
        assert!(given.iter().all(|(options, _)| options.prior == PriorChoice::Auto));
    }

    #[test]
    fn a_run_that_exceeded_its_budget_without_the_refinement_gives_a_warning() {
        let stage = |name, ms| Stage { name, ms };
        let stages = [stage("prior", 700.0), stage("refine", 9000.0), stage("check", 400.0)];
        let plan = |budget_s, fits| BudgetPlan {
            budget_s,
            predicted_s: 1.0,
            fits,
            took_s: 0.0,
            kept: true,
            machine: MACHINE,
            chosen: Chosen::of(&Options::default()),
        };
        let told = |plan: BudgetPlan| plan.after(&stages).warning();
        assert_eq!(told(plan(1.2, true)), None);
        let said = told(plan(0.5, false)).unwrap();
        assert_eq!(
            said,
            "budget: 0.5 s was not kept: the call took 1.10 s, though all was left out that can be"
        );
        assert!(told(plan(1.0, true)).unwrap().ends_with("took 1.10 s"));
    }

    #[test]
    fn a_faster_machine_is_predicted_to_take_less() {
        let seconds = |serial, parallel| {
            cost::seconds(&car(4, false), &Options::default(), Machine { serial, parallel })
        };
        assert!(seconds(1.0, 4.0) < seconds(1.0, 1.0));
        assert!((seconds(2.0, 2.0) - 0.5 * seconds(1.0, 1.0)).abs() < 1e-12);
    }
}
