//! The stage `check`: the model in the caller's frame, drawn into its input views, and judged.

use super::frame::{Given, InFrame};
use super::report::{CheckedView, InputError};
use super::run::{PointCloud, Run};
use super::size::VehicleSize;
use super::verdict::{self, Evidence, Examined, Judged, Reason};
use crate::metrics;
use crate::symmetry::SymmetryMode;
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::View;
use vg_splat::Gaussians;
use vg_splat::render::{CpuRenderer, RenderOptions, Renderer};

/// The finished model and how far it can be trusted.
pub(super) struct Checked {
    pub(super) gaussians: InFrame<Given, Gaussians>,
    pub(super) points: Option<InFrame<Given, PointCloud>>,
    /// Length, width and height of the vehicle.
    pub(super) size: Option<VehicleSize>,
    /// How far masks, depth and photographs agree with one another.
    pub(super) evidence: Evidence,
    /// The errors in each used view; empty where the check was switched off.
    pub(super) input_views: Vec<CheckedView>,
    /// Why the verdict is not good.
    pub(super) reasons: Vec<Reason>,
}

/// Moves the model to the caller's frame, measures it there against the photographs, and judges it.
pub(super) fn check(run: &mut Run) -> Result<()> {
    let (gaussians, points) = (run.gaussians.take(), run.points.take());
    let (plan, views, surface) = (&*run.plan, &*run.views, &*run.surface);
    let size = VehicleSize::measured(&gaussians, &surface.geometry);
    let originals: Vec<&View> = plan.used.iter().map(|&i| &plan.scene.views[i]).collect();
    let examined = Examined { given: &originals, used: &views.working, geometry: Some(&surface.geometry) };
    let evidence = match plan.options.check {
        true => verdict::compare(&examined, run.context),
        false => verdict::glance(&examined),
    };

    let gaussians = views.given_from_working.gaussians(gaussians, run.context)?;
    let points = points.map(|points| views.given_from_working.points(points));
    let evidence = evidence.with_model(&gaussians, views.in_given_frame());
    let input_views = match plan.options.check {
        true => checked(&gaussians, views.in_given_frame(), &run.pinholes, run.context)?,
        false => Vec::new(),
    };
    let reasons = verdict::judge(&Judged {
        evidence: &evidence,
        checked: &input_views,
        calibration: views.report.as_ref(),
        has_depth: plan.source.is_per_pixel(),
        is_completed: plan.options.symmetry != SymmetryMode::Never,
    });
    run.checked.set(Checked { gaussians, points, size, evidence, input_views, reasons });
    Ok(())
}

/// The error of the model in the views it was made of, drawn by the cameras that were used and by those that the caller
/// gave. `used` and `given` differ in the poses of their cameras only.
pub(super) fn checked(
    gaussians: &Gaussians,
    used: &[View],
    given: &[View],
    context: &Context,
) -> Result<Vec<CheckedView>> {
    let renderer = CpuRenderer::new();
    let error = |view: &View| -> Result<InputError> {
        let drawn =
            context.parallel(|| renderer.render(gaussians, &view.camera, &RenderOptions::default()))?;
        Ok(InputError {
            psnr_db: metrics::psnr(&drawn.color, &metrics::on_white(view)),
            silhouette_iou: metrics::silhouette_iou(&drawn.alpha, view),
            mask_covered: metrics::mask_covered(&drawn.alpha, view),
        })
    };
    let n = used.len() as f64;
    let one = |(i, (used, given)): (usize, (&View, &View))| {
        context.report("check", i as f64 / n)?;
        let errors = error(used)?;
        let by_given_camera = if given.camera == used.camera { errors } else { error(given)? };
        Ok(CheckedView { name: used.name.clone(), errors, by_given_camera })
    };
    used.iter().zip(given).enumerate().map(one).collect()
}
