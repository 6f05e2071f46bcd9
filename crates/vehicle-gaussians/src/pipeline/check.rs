//! The error that a reconstruction can know: that of its pictures of what it was made from.

use super::report::{CheckedView, InputError};
use crate::metrics;
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::View;
use vg_splat::Gaussians;
use vg_splat::render::{CpuRenderer, RenderOptions, Renderer};

/// The model drawn into the views it came from: by the cameras that were used, and by those that the caller gave.
/// `used` and `given` differ in their cameras' poses alone.
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
