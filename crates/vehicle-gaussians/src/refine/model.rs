//! Refinement of a model that is there already, from wherever it is.

use super::{RefineOptions, Refinement, refine};
use rayon::prelude::*;
use vg_geometry::progress::{Context, Course, ProgressCallback, Threads};
use vg_geometry::{Error, Result};
use vg_scene::{Scene, View, undistort};
use vg_splat::Gaussians;

/// Moves the Gaussians of any model, in the scene's frame, until their pictures are the scene's photographs. Nothing is
/// known of which mirrors which: each goes its own way. [`crate::pipeline::reconstruct`] with `Options::refine` keeps
/// clones what they are.
///
/// Standard deviations come back within 1e-7 and 3 m and opacities within 6e-6 of 0 and 1, wherever they were before.
/// The order is kept.
///
/// # Errors
/// A model without Gaussians, options and scenes that are not valid; `Error::Cancelled` where `progress` breaks off.
pub fn model<'a>(
    gaussians: &Gaussians,
    scene: &Scene,
    options: &RefineOptions,
    threads: usize,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<(Gaussians, Refinement)> {
    model_on(&Threads::new(threads)?, gaussians, scene, options, progress)
}

/// The same on threads that are there already.
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
    // Shorter-lived than the callback it borrows.
    let mut progress = |at| progress(at);
    let context = Context::new(threads, &mut progress);
    context.follow(Course::new(vec![("refine", 1.0)]));
    let straight = || scene.views.par_iter().map(undistort::undistorted).collect::<Result<Vec<View>>>();
    let views = context.parallel(straight)?;
    let refined = refine(gaussians.clone(), &[], &views, options, &context)?;
    context.report_end()?;
    Ok(refined)
}
