//! Points on the surface of a model that is visible to cameras outside and above, without its inside and underside.

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use vg_geometry::progress::Watch;
use vg_geometry::{Camera, Error, Intrinsics, Pose, Result};
use vg_splat::Gaussians;
use vg_splat::render::{CpuRenderer, RenderOptions, Rendered, Renderer};

/// Elevation of each ring of cameras, degrees, and its number of cameras. A lower camera would look under the vehicle.
const RINGS: [(f64, u32); 3] = [(10.0, 8), (35.0, 8), (70.0, 4)];

/// Angle from the middle of the picture to its edge, degrees.
const HALF_VIEW_DEGREES: f64 = 15.0;

/// Alpha from which a pixel shows a surface.
const ALPHA: f32 = 0.5;

/// Difference in depth between neighbouring pixels, in pixel widths, above which they lie at an edge (or on a surface
/// seen at less than 11 degrees), where depth mixes foreground and background.
const STEEP: f32 = 5.0;

/// Fraction of centres that may lie outside the box in view, on each side.
const BEYOND: f64 = 0.002;

/// Pixels across a cell: every cell of a surface is hit by cameras that see it at 40 degrees and less.
const PIXELS: f64 = 1.3;

/// Points on the surface, vehicle frame, metres, at a spacing below `cell` where a camera sees it frontally.
pub(super) fn points(gaussians: &Gaussians, cell: f64, watch: &Watch) -> Result<Vec<[f32; 3]>> {
    if gaussians.is_empty() {
        return Err(Error::argument("gaussians", "none", "at least one"));
    }
    let (middle, radius) = ball(gaussians);
    let cameras = RINGS.iter().flat_map(|&(elevation, count)| {
        (0..count).map(move |i| (elevation, 360.0 * f64::from(i) / f64::from(count)))
    });
    let cameras: Result<Vec<Camera>> =
        cameras.map(|(elevation, azimuth)| camera(middle, radius, cell, elevation, azimuth)).collect();
    // Colour is not used.
    let options = RenderOptions { sh_degree: 0, ..RenderOptions::default() };
    let cpu = CpuRenderer::new();
    let renderer = cpu.watched(watch);
    let seen = |camera: &Camera| Ok(lifted(&renderer.render(gaussians, camera, &options)?, camera));
    let seen: Result<Vec<Vec<[f32; 3]>>> = cameras?.par_iter().map(seen).collect();
    Ok(seen?.concat())
}

/// The ball around the box of the centres, except for a few outliers.
fn ball(gaussians: &Gaussians) -> (DVec3, f64) {
    let side = |k: usize| {
        let mut along: Vec<f32> = gaussians.means().iter().map(|m| m[k]).collect();
        let beyond = (BEYOND * along.len() as f64) as usize;
        let last = along.len() - 1;
        let low = *along.select_nth_unstable_by(beyond, f32::total_cmp).1;
        let high = *along.select_nth_unstable_by(last - beyond, f32::total_cmp).1;
        (f64::from(low), f64::from(high))
    };
    let sides = [0, 1, 2].map(side);
    let low = DVec3::from_array(sides.map(|s| s.0));
    let high = DVec3::from_array(sides.map(|s| s.1));
    let mut sizes: Vec<f32> = gaussians.scales().iter().map(|s| s[0].max(s[1]).max(s[2])).collect();
    let middle = sizes.len() / 2;
    let size = f64::from(*sizes.select_nth_unstable_by(middle, f32::total_cmp).1);
    // A Gaussian reaches three standard deviations from its centre.
    (0.5 * (low + high), (0.5 * (high - low).length() + 3.0 * size) * 1.02)
}

/// A camera whose square picture just contains the ball.
fn camera(middle: DVec3, radius: f64, cell: f64, elevation: f64, azimuth: f64) -> Result<Camera> {
    let half_view = HALF_VIEW_DEGREES.to_radians();
    let pixels = (PIXELS * 2.0 * radius / cell).ceil().clamp(64.0, 1024.0);
    let (up, across) = elevation.to_radians().sin_cos();
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let out = DVec3::new(cos * across, sin * across, up);
    let z = -out;
    let x = z.cross(DVec3::Z).normalize();
    let eye = middle + out * (radius / half_view.sin());
    let pose = Pose { rotation: DMat3::from_cols(x, z.cross(x), z), translation: eye };
    let f = 0.5 * pixels / half_view.tan();
    let intrinsics = Intrinsics { fx: f, fy: f, cx: 0.5 * pixels, cy: 0.5 * pixels };
    Camera::pinhole(pixels as u32, pixels as u32, intrinsics, pose)
}

/// The points at pixels that show a surface, not an edge.
fn lifted(drawn: &Rendered, camera: &Camera) -> Vec<[f32; 3]> {
    let (w, h) = (drawn.width as usize, drawn.height as usize);
    let steep = STEEP / camera.intrinsics.fx as f32;
    // Blur extends a surface by one pixel beyond its edge, so the outermost pixel is left out.
    let is_smooth = |i: usize, other: usize| {
        drawn.alpha[other] >= ALPHA && (drawn.depth[other] - drawn.depth[i]).abs() <= steep * drawn.depth[i]
    };
    let mut points = Vec::new();
    for v in 1..h - 1 {
        for u in 1..w - 1 {
            let i = v * w + u;
            if drawn.alpha[i] < ALPHA || ![i - 1, i + 1, i - w, i + w].iter().all(|&o| is_smooth(i, o)) {
                continue;
            }
            let p = camera.intrinsics.pixel_ray(u as u32, v as u32) * f64::from(drawn.depth[i]);
            points.push(camera.vehicle_from_camera.transform_point(p).as_vec3().to_array());
        }
    }
    points
}
