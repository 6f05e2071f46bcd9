//! Sampled pixels: those on the silhouettes' edges, where the cones touch the vehicle.

use glam::{DVec3, Vec3};
use vg_scene::View;
use vg_scene::mask::{Label, Mask};

/// Maximum of sampled edge pixels per view; a view of a car has 800 to 1500 at 512 x 384.
const MOST_PER_VIEW: usize = 320;

/// Maximum of sampled edge pixels of all views: each is compared with all cones.
const MOST: usize = 2400;

/// Required distance of an edge pixel's ray inside the other cones, pixels. Its centre is half a pixel inside its
/// own cone. The other half makes up for sampling, and keeps the solver from stopping at the first correction without
/// a deficit, short of the true one: known yaws are found to 0.3 degrees instead of 0.8.
const MARGIN_PX: f64 = 1.0;

/// Maximum of pixels inside the mask of a view whose coverage is measured.
const MOST_INSIDE: usize = 1000;

/// A ray of one view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Index of the view.
    pub(super) view: usize,
    /// Unit direction, camera axes.
    pub(super) direction: Vec3,
    /// Required distance of the ray inside the other cones, metres.
    pub(super) margin: f32,
    /// Whether the sample validates the correction instead of fitting it.
    pub(super) held_out: bool,
}

/// Edge pixels of all views, spread evenly. Squares of a sixteenth of the picture's width alternate between fitting and
/// validation: adjacent pixels are correlated, pixels a square apart are not.
pub(super) fn edges(views: &[View], middle: DVec3) -> Vec<Sample> {
    let most = MOST_PER_VIEW.min(MOST / views.len().max(1)).max(16);
    let edges_in = |(view, v): (usize, &View)| {
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
    views.iter().enumerate().flat_map(edges_in).collect()
}

/// Pixels of the masks, spread evenly over each.
pub(super) fn insides(views: &[View]) -> Vec<Sample> {
    let insides_in = |(view, v): (usize, &View)| {
        let mask = v.mask.as_ref().expect("calibrated views have masks");
        let pixels: Vec<[u32; 2]> = pixels(mask).filter(|&[x, y]| mask.is_vehicle(x, y)).collect();
        thinned(&pixels, MOST_INSIDE)
            .map(|[x, y]| Sample { view, direction: direction(v, x, y), margin: 0.0, held_out: false })
            .collect::<Vec<_>>()
    };
    views.iter().enumerate().flat_map(insides_in).collect()
}

fn pixels(mask: &Mask) -> impl Iterator<Item = [u32; 2]> {
    let (width, height) = (mask.width(), mask.height());
    (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
}

/// Vehicle pixels next to background. The border of the picture and unknown pixels make no edge.
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

/// At most `most` of the pixels, evenly.
fn thinned(pixels: &[[u32; 2]], most: usize) -> impl Iterator<Item = [u32; 2]> {
    let n = pixels.len().min(most);
    (0..n).map(move |k| pixels[k * pixels.len() / n])
}

fn direction(view: &View, x: u32, y: u32) -> Vec3 {
    view.camera.intrinsics.pixel_ray(x, y).normalize().as_vec3()
}
