//! A cap on the size of the model, enforced before the work is done: the masks give the number of Gaussians to expect.
//! Where it exceeds [`Options::max_gaussians`], the views are resampled.
//!
//! Every vehicle pixel can become a Gaussian, and each Gaussian can get a mirror image. But views overlap: a place
//! becomes one Gaussian, of the view that shows it best. The surface of a convex body is four times the mean area of
//! its shadows (Cauchy), so the whole vehicle takes about four times the pixels of its largest mask, whatever the
//! number of views.

use super::options::Options;
use super::plan;
use super::report::LeftOut;
use super::undistort::undistorted;
use crate::symmetry::SymmetryMode;
use vg_geometry::progress::Context;
use vg_geometry::{Error, Result};
use vg_scene::{Mask, Scene, View};

/// The default: a PLY file of 2 GB, at 164 bytes per Gaussian of SH degree 2. Any number of photographs of 1920 x 1080
/// pixels stays below, up to a vehicle that fills 96 % of one.
pub const DEFAULT_MAX_GAUSSIANS: usize = 12_000_000;

/// Steps per unit in which the resolution is lowered, so that it can be written and requested exactly.
const STEPS: f64 = 1000.0;

/// Surface in units of the largest mask: four for a convex body, and half as much again for concave parts. Measured on
/// vehicles seen from 40 sides: 3.5 and 3.8.
const SURFACE: usize = 6;

/// Largest factor from one resolution to the next one tried. Undistortion and rounded image sizes add pixels.
const LOWER: f64 = 0.98;

/// The views to work with, at the resolution of the options or at a lower one that keeps the cap.
pub(super) fn fitted(
    scene: &Scene,
    used: &[usize],
    options: &Options,
    left_out: &mut Vec<LeftOut>,
    context: &Context,
) -> Result<Vec<View>> {
    let requested = options.resolution;
    let at = |resolution: f64, notes: &mut Vec<LeftOut>| undistorted(scene, used, resolution, notes, context);
    let Some(cap) = options.max_gaussians else { return at(requested, left_out) };
    let given = used.iter().map(|&i| &scene.views[i]);
    let most = (most_gaussians(given, options) as f64 * requested * requested) as usize;
    let mut resolution = if most > cap { lowered(requested, cap, most) } else { requested };
    loop {
        let too_few = || {
            let found = format!("{cap}, where the masks allow for {most}");
            Error::argument("options.max_gaussians", found, "enough that some pixel shows the vehicle")
        };
        if resolution <= 0.0 {
            return Err(too_few());
        }
        let mut notes = Vec::new();
        let views = at(resolution, &mut notes).map_err(|e| match e {
            Error::Argument { .. } if resolution < requested => too_few(),
            other => other,
        })?;
        let now = most_gaussians(&views, options);
        if now > cap {
            resolution = lowered(resolution, cap, now).min(in_steps(LOWER * resolution));
            continue;
        }
        left_out.append(&mut notes);
        if resolution < requested {
            let why = format!(
                "the masks allow for {most}, more than max_gaussians, {cap}: the views are resampled to {resolution} of \
                 their width and height"
            );
            plan::note(left_out, GAUSSIANS, &why, most.saturating_sub(cap).max(1));
        }
        return Ok(views);
    }
}

/// The name of what the cap leaves out, in the report.
pub const GAUSSIANS: &str = "Gaussians";

/// Upper estimate of the number of Gaussians from these views.
fn most_gaussians<'a>(views: impl IntoIterator<Item = &'a View>, options: &Options) -> usize {
    let all = |view: &View| view.camera.width as usize * view.camera.height as usize;
    let vehicle = |view: &View| view.mask.as_ref().map_or_else(|| all(view), Mask::vehicle_pixels);
    let pixels: Vec<usize> = views.into_iter().map(vehicle).collect();
    let sides = match options.symmetry {
        SymmetryMode::Never => 1,
        SymmetryMode::Auto | SymmetryMode::Always | SymmetryMode::Flip => 2,
    };
    let all = sides * pixels.iter().sum::<usize>();
    match options.keep.overlap {
        true => all,
        false => all.min(SURFACE * pixels.iter().copied().max().unwrap_or(0)),
    }
}

/// The resolution at which `most` Gaussians become `cap`.
fn lowered(resolution: f64, cap: usize, most: usize) -> f64 {
    in_steps(resolution * (cap as f64 / most as f64).sqrt())
}

fn in_steps(resolution: f64) -> f64 {
    (resolution * STEPS).floor() / STEPS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resolution_is_lowered_in_steps_and_never_above_the_cap() {
        assert_eq!(lowered(1.0, 12_000_000, 48_000_000), 0.5);
        assert_eq!(lowered(0.5, 1, 3), 0.288);
        for (cap, most) in [(1, 2), (5, 7), (999, 1000), (1_000_000, 38_000_000)] {
            let share = lowered(1.0, cap, most);
            assert!(share * share * most as f64 <= cap as f64, "{cap} of {most}: {share}");
        }
    }
}
