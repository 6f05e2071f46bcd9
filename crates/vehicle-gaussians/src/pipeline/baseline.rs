//! The run of the baseline: plan -> undistort -> start -> refine -> check. Cameras are taken as they are.

use super::check::checked;
use super::options::Options;
use super::report::{Clock, InputError, Report, peak_rss_bytes};
use super::run::{Reconstruction, chosen_views, undistorted};
use super::verdict::{self, Examined, Judged};
use super::{budget, cost, plan};
use crate::prior::volume::KnownBox;
use crate::refine::baseline::{self, BaselineOptions, Start};
use crate::symmetry::{self, SymmetryMode};
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::Scene;

/// 3D Gaussian splatting of the scene's views.
pub(super) fn reconstruct(
    scene: &Scene,
    options: &Options,
    how: &BaselineOptions,
    mut clock: Clock,
    context: &Context,
) -> Result<Reconstruction> {
    context.report("plan", 0.0)?;
    context.follow(cost::course_of_baseline(&budget::load(scene), options, how, context.threads()));
    let mut left_out = Vec::new();
    let used = plan::views(scene, &options.keep, &mut left_out)?;
    let used = chosen_views(scene, used, options, &mut left_out);
    clock.lap("plan");

    context.report("undistort", 0.0)?;
    let views = undistorted(scene, &used, options.resolution, &mut left_out, context)?;
    clock.lap("undistort");

    context.report("start", 0.0)?;
    let cloud = scene.cloud.as_ref();
    let known_box = options.vehicle_box(scene).map(|known| KnownBox::in_working_frame(&known, false));
    let Start { gaussians, filled, strays } =
        context.parallel(|| Start::new(&views, cloud, known_box.as_ref(), how))?;
    plan::note(&mut left_out, "points", "in no picture", strays);
    clock.lap("start");

    let (gaussians, refinement) = baseline::fit(&gaussians, &views, how, context)?;
    clock.lap("refine");

    let originals: Vec<_> = used.iter().map(|&i| &scene.views[i]).collect();
    let examined = Examined { given: &originals, used: &views, geometry: None };
    let (evidence, input_views) = match options.check {
        true => (verdict::compare(&examined, context), checked(&gaussians, &views, &views, context)?),
        false => (verdict::glance(&examined), Vec::new()),
    };
    let evidence = evidence.with_model(&gaussians, &views);
    let reasons = verdict::judge(&Judged {
        evidence: &evidence,
        checked: &input_views,
        calibration: None,
        has_depth: true,
        is_completed: false,
    });
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
        vehicle: None,
        working_box: filled.map(Into::into),
        cloud: None,
        photo: None,
        masks: None,
        network: None,
        plan: None,
        left_out,
        warnings: Vec::new(),
        symmetry: completion,
        relight: None,
        refinement: Some(refinement),
        input_error: InputError::over(input_views.iter().map(|view| view.errors)),
        input_error_by_given_cameras: InputError::over(input_views.iter().map(|view| view.by_given_camera)),
        input_views,
        verdict: verdict::verdict(&reasons, options.check),
        verdict_reasons: reasons,
        evidence,
        settings: options.clone(),
    };
    context.report_end()?;
    Ok(Reconstruction { gaussians, points: None, report })
}
