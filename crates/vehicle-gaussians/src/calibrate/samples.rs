//! The pixels that are asked: those on the silhouettes' edges, for there the cones touch the vehicle.

use glam::{DVec3, Vec3};
use vg_scene::View;
use vg_scene::mask::{Label, Mask};

/// Edge pixels per view that are asked, at most; a view of a car has 800 to 1500 at 512 x 384.
const MOST_PER_VIEW: usize = 320;

/// Edge pixels of all views, at most: each asks all cones.
const MOST: usize = 2400;

/// How far inside the other cones an edge pixel's ray is asked to come, pixels. Its centre is half a pixel inside its
/// own cone; the other half makes up for sampling, and for a correction that would otherwise stop at the first that
/// misses nothing, short of the true one: known yaws are found to 0.3 degrees instead of 0.8.
const MARGIN_PX: f64 = 1.0;

/// Pixels inside the masks per view whose coverage is reported, at most.
const MOST_INSIDE: usize = 1000;

/// A ray of one view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Index of the view.
    pub(super) view: usize,
    /// Unit, camera axes.
    pub(super) direction: Vec3,
    /// How far inside the other cones the ray is asked to come, metres.
    pub(super) margin: f32,
    /// The correction is not fitted to this one: it judges the fit.
    pub(super) held_out: bool,
}

/// Edge pixels of all views, spread evenly. Squares of a sixteenth of the picture's width take turns in fitting and
/// judging: pixels beside one another say the same, pixels a square apart do not.
pub(super) fn edges(views: &[View], middle: DVec3) -> Vec<Sample> {
    let most = MOST_PER_VIEW.min(MOST / views.len().max(1)).max(16);
    let of_view = |(view, v): (usize, &View)| {
        let mask = v.mask.as_ref().expect("calibrated views have masks");
        let square = (v.camera.width / 16).max(1);
        let pixels = edge_pixels(mask);
        let i = v.camera.intrinsics;
        let margin = MARGIN_PX * (middle - v.camera.center()).length() / i.smaller_focal();
        thinned(&pixels, most)
            .map(|[x, y]| Sample {
                view,
                direction: direction(v, x, y),
                margin: margin as f32,
                held_out: (x / square + y / square) % 2 == 1,
            })
            .collect::<Vec<_>>()
    };
    views.iter().enumerate().flat_map(of_view).collect()
}

/// Pixels of the masks, spread evenly over each.
pub(super) fn insides(views: &[View]) -> Vec<Sample> {
    let of_view = |(view, v): (usize, &View)| {
        let mask = v.mask.as_ref().expect("calibrated views have masks");
        let pixels: Vec<[u32; 2]> = pixels(mask).filter(|&[x, y]| mask.is_vehicle(x, y)).collect();
        thinned(&pixels, MOST_INSIDE)
            .map(|[x, y]| Sample { view, direction: direction(v, x, y), margin: 0.0, held_out: false })
            .collect::<Vec<_>>()
    };
    views.iter().enumerate().flat_map(of_view).collect()
}

fn pixels(mask: &Mask) -> impl Iterator<Item = [u32; 2]> {
    let (width, height) = (mask.width(), mask.height());
    (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
}

/// Vehicle pixels beside background. Beside the border of the picture or an unknown pixel there is no edge.
fn edge_pixels(mask: &Mask) -> Vec<[u32; 2]> {
    let (width, height) = (mask.width(), mask.height());
    let labels = mask.labels();
    let background = |x: u32, y: u32| labels[(y * width + x) as usize] == Label::Background;
    pixels(mask)
        .filter(|&[x, y]| {
            mask.is_vehicle(x, y)
                && ((x > 0 && background(x - 1, y))
                    || (x + 1 < width && background(x + 1, y))
                    || (y > 0 && background(x, y - 1))
                    || (y + 1 < height && background(x, y + 1)))
        })
        .collect()
}

/// About `most` of them, evenly.
fn thinned(pixels: &[[u32; 2]], most: usize) -> impl Iterator<Item = [u32; 2]> {
    let n = pixels.len().min(most);
    (0..n).map(move |k| pixels[k * pixels.len() / n])
}

fn direction(view: &View, x: u32, y: u32) -> Vec3 {
    let [x, y] = view.camera.intrinsics.normalized_from_pixel([f64::from(x) + 0.5, f64::from(y) + 0.5]);
    DVec3::new(x, y, 1.0).normalize().as_vec3()
}
