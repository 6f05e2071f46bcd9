//! The stage `undistort`: the used views as pinholes, at the resolution to work at.

use super::frame::{Given, InFrame};
use super::report::LeftOut;
use super::run::Run;
use super::{cap, plan};
use rayon::prelude::*;
use vg_geometry::progress::Context;
use vg_geometry::{Camera, Error, Result};
use vg_scene::{Scene, View, resize, undistort};

/// Removes the lens distortion and resamples the views, to fewer pixels where the model would exceed its cap.
pub(super) fn undistort(run: &mut Run) -> Result<()> {
    let plan = &*run.plan;
    let views = cap::fitted(&plan.scene, &plan.used, &plan.options, &mut run.left_out, run.context)?;
    run.pinholes.set(InFrame::<Given, _>::new(views));
    Ok(())
}

/// The views at `resolution`, a share of their width and height, as pinholes. Views that show no vehicle there are left
/// out.
pub(super) fn undistorted(
    scene: &Scene,
    used: &[usize],
    resolution: f64,
    left_out: &mut Vec<LeftOut>,
    context: &Context,
) -> Result<Vec<View>> {
    let one = |&i: &usize| undistort::undistorted(&resize::resized(&scene.views[i], resolution)?);
    let mut views: Vec<View> = context.parallel(|| used.par_iter().map(one).collect::<Result<_>>())?;
    if resolution < 1.0 {
        let pixels = |camera: &Camera| camera.width as usize * camera.height as usize;
        let all: usize = used.iter().map(|&i| pixels(&scene.views[i].camera)).sum();
        let left: usize = views.iter().map(|v| pixels(&v.camera)).sum();
        let why = format!("averaged into fewer: the working resolution is {resolution}");
        plan::note(left_out, "pixels", &why, all.saturating_sub(left));
        views.retain(|v| v.mask.as_ref().is_none_or(|m| m.vehicle_pixels() > 0));
        let why = "at the working resolution no pixel shows the vehicle";
        plan::note(left_out, "views", why, used.len() - views.len());
        if views.is_empty() {
            let found = resolution.to_string();
            let allowed = "a share at which some pixel shows the vehicle";
            return Err(Error::argument("options.resolution", found, allowed));
        }
    }
    Ok(views)
}
