//! The run of the baseline: plan -> undistort -> start -> refine -> check. Cameras are taken as they are.

use super::check::input_error;
use super::options::Options;
use super::plan;
use super::report::{Clock, Report, peak_rss_bytes};
use super::run::{Reconstruction, chosen_views, undistorted};
use crate::error::Result;
use crate::progress::Context;
use crate::refine::baseline::{self, BaselineOptions, Start};
use crate::scene::Scene;
use crate::symmetry::{self, SymmetryMode};

/// 3D Gaussian splatting of the scene's views.
pub(super) fn reconstruct(
    scene: &Scene,
    options: &Options,
    how: &BaselineOptions,
    mut clock: Clock,
    context: &Context,
) -> Result<Reconstruction> {
    context.report("plan", 0.0)?;
    let mut left_out = Vec::new();
    let used = plan::views(scene, &options.keep, &mut left_out)?;
    let used = chosen_views(scene, used, options, &mut left_out);
    clock.lap("plan");

    context.report("undistort", 0.0)?;
    let views = undistorted(scene, &used, options.resolution, &mut left_out, context)?;
    clock.lap("undistort");

    context.report("start", 0.0)?;
    let cloud = scene.cloud.as_ref();
    let Start { gaussians, filled, strays } =
        context.parallel(|| Start::new(&views, cloud, options.vehicle_size, how))?;
    plan::note(&mut left_out, "points", "in no picture", strays);
    clock.lap("start");

    let (gaussians, refinement) = baseline::fit(&gaussians, &views, how, context)?;
    clock.lap("refine");

    let input_error = match options.check {
        true => Some(input_error(&gaussians, &views, context)?),
        false => None,
    };
    clock.lap("check");

    let cameras: Vec<_> = views.iter().map(|v| v.camera).collect();
    let (gaussians, completion, _) =
        symmetry::complete(gaussians, SymmetryMode::Never, &cameras, |_| Vec::new());
    let (stages, total_ms) = clock.finish();
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        prior: "none",
        head: "3dgs",
        stages,
        total_ms,
        peak_rss_bytes: peak_rss_bytes(),
        threads: context.threads(),
        gaussians: gaussians.len(),
        sh_degree: gaussians.sh_degree(),
        extent_m: gaussians.bounds(),
        views_used: views.iter().map(|v| v.name.clone()).collect(),
        calibration: None,
        vehicle_box: filled.map(Into::into),
        cloud: None,
        photo: None,
        masks: None,
        network: None,
        plan: None,
        left_out,
        symmetry: completion,
        relight: None,
        refinement: Some(refinement),
        input_error,
        settings: options.clone(),
    };
    Ok(Reconstruction { gaussians, points: None, report })
}
