//! 3D Gaussian splatting (Kerbl et al. 2023) as it is, for comparison: Gaussians from a sparse or random start, moved,
//! divided and removed until their pictures match the input photographs. It uses no prior and no symmetry.
//!
//! The loss is 0.8 |colour| + 0.2 (1 - SSIM) of the masked photograph on white, a mean over pixels and channels as the
//! original's; unknown pixels have no weight. Each step uses one view, in a new order each round. All numbers are the
//! original's for 30,000 steps; a shorter run shortens its schedule by the same factor.

mod options;
mod spacing;
mod start;

pub use options::BaselineOptions;
pub(crate) use start::Start;

use super::chance::shuffled;
use super::densify::scaled;
use super::plan::Plan;
use super::work::{Measures, Work};
use super::{Course, Refinement, State, Stop};
use std::time::Instant;
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::View;
use vg_splat::Gaussians;

/// Adam's epsilon in the original: smaller than any gradient.
const NOISE: f32 = 1e-15;

/// Steps of a full run between one SH degree and the next.
const DEGREE_EVERY: u32 = 1_000;

/// Fits Gaussians to the views, which are pinholes with masks.
pub(crate) fn fit(
    start: &Gaussians,
    views: &[View],
    options: &BaselineOptions,
    context: &Context,
) -> Result<(Gaussians, Refinement)> {
    let began = Instant::now();
    let settings = options.settings();
    let extent_m = start::extent_m(views, start);
    let mut state = State::new(start, &[], views.len());
    let mut work =
        Work::new(&state, views, &settings, Measures { noise: NOISE, extent_m, seed: options.seed })?;
    work.show_degree(0);
    let (before, _) = work.begin(&state, context)?;
    let round = views.len() as u32;
    let mut plan = Plan::new(options.amount, round, began);
    let mut course = Course::default();
    let (mut made, mut order) = (0, Vec::new());
    while plan.goes_on(made) {
        if made.is_multiple_of(round) {
            order = shuffled(views.len(), options.seed, (made / round).into());
        }
        let view = order[(made % round) as usize];
        let rates = options.rates_at(plan.part(made));
        course.push(work.step(view, &mut state, &rates, context)?, round);
        made += 1;
        plan.note(made);
        if let Some(planned) = plan.planned_at(made) {
            work.densify(&mut state, made, planned, context);
            work.show_degree(degree(made, planned, options.sh_degree));
        }
        let part = plan.planned().map_or(0.0, |planned| f64::from(made) / f64::from(planned));
        context.report_loss("refine", part, course.last)?;
    }
    let after = work.psnr_db(&state, context)?;
    let mean = |psnr: &[f64]| psnr.iter().sum::<f64>() / f64::from(round);
    let report = Refinement {
        iterations: plan.planned().unwrap_or(made),
        made,
        kept: made,
        stop: Stop::Done,
        loss: [course.first.unwrap_or_default(), course.last],
        psnr_db: [mean(&before), mean(&after)],
        held_out: None,
        exposures: vec![[1.0; 3]; views.len()],
        densified: work.densified(),
        drawn_by: work.drawn_by(),
    };
    Ok((work.finished(&state, context), report))
}

/// The SH degree after `made` of `planned` steps.
fn degree(made: u32, planned: u32, most: u8) -> u8 {
    let every = scaled(DEGREE_EVERY, planned).max(1);
    (made / every).min(most.into()) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_degree_rises_by_one_in_steps_of_a_thirtieth_of_the_run() {
        let of = |planned: u32| [0, 999, 1_000, 2_999, 3_000, 29_999].map(|made| degree(made, planned, 3));
        assert_eq!(of(30_000), [0, 0, 1, 2, 3, 3]);
        assert_eq!(of(3_000), [0, 3, 3, 3, 3, 3]);
        assert_eq!([99, 100, 299, 300].map(|made| degree(made, 3_000, 2)), [0, 1, 2, 2]);
        assert_eq!(degree(5, 1, 3), 3);
    }
}
