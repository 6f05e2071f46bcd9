//! The error that a reconstruction can know: that of its pictures of what it was made from.

use super::report::InputError;
use crate::error::Result;
use crate::gaussians::Gaussians;
use crate::metrics;
use crate::progress::Context;
use crate::render::{CpuRenderer, RenderOptions, Renderer};
use crate::scene::View;

/// The model drawn into the views it came from.
pub(super) fn input_error(gaussians: &Gaussians, views: &[View], context: &Context) -> Result<InputError> {
    let renderer = CpuRenderer::new();
    let mut error = InputError { psnr_db: 0.0, silhouette_iou: 0.0, mask_covered: 1.0 };
    for (i, view) in views.iter().enumerate() {
        context.report("check", i as f64 / views.len() as f64)?;
        let rendered =
            context.parallel(|| renderer.render(gaussians, &view.camera, &RenderOptions::default()))?;
        error.psnr_db += metrics::psnr(&rendered.color, &metrics::on_white(view)) / views.len() as f64;
        error.silhouette_iou += metrics::silhouette_iou(&rendered.alpha, view) / views.len() as f64;
        error.mask_covered = error.mask_covered.min(metrics::mask_covered(&rendered.alpha, view));
    }
    Ok(error)
}
