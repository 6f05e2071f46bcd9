//! Refinement of an existing model from any source.

use super::{RefineOptions, Refinement, refine};
use rayon::prelude::*;
use vg_geometry::progress::{Context, Course, ProgressCallback, Threads};
use vg_geometry::{Error, Result};
use vg_scene::{Scene, View, undistort};
use vg_splat::Gaussians;

/// Optimises the Gaussians of any model, in the scene's frame, until their pictures match the scene's photographs. All
/// Gaussians are optimised independently, since mirror pairs are not known. [`crate::pipeline::reconstruct`] with
/// `Options::refine` keeps clones tied to their originals.
///
/// Standard deviations are clamped to 1e-7 to 3 m, and opacities to 6e-6 from 0 and 1. The order is kept.
///
/// # Errors
/// A model without Gaussians, invalid options or scenes; `Error::Cancelled` if `progress` cancels.
pub fn model<'a>(
    gaussians: &Gaussians,
    scene: &Scene,
    options: &RefineOptions,
    threads: usize,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<(Gaussians, Refinement)> {
    model_on(&Threads::new(threads)?, gaussians, scene, options, progress)
}

/// [`model()`] on an existing thread pool.
pub fn model_on<'a>(
    threads: &Threads,
    gaussians: &Gaussians,
    scene: &Scene,
    options: &RefineOptions,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<(Gaussians, Refinement)> {
    threads.check_process()?;
    if gaussians.is_empty() {
        return Err(Error::argument("gaussians", "none", "at least one"));
    }
    options.validate()?;
    scene.validate()?;
    // A closure with a shorter lifetime than the callback that it borrows.
    let mut progress = |at| progress(at);
    let context = Context::new(threads, &mut progress);
    context.follow(Course::new(vec![("refine", 1.0)]));
    let straight = || scene.views.par_iter().map(undistort::undistorted).collect::<Result<Vec<View>>>();
    let views = context.parallel(straight)?;
    let refined = refine(gaussians.clone(), &[], &views, options, &context)?;
    context.report_end()?;
    Ok(refined)
}
