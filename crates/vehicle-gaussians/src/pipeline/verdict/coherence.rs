//! The agreement of the silhouettes with one another and with the depth.
//!
//! The ray of a mask's pixel hits the vehicle, so some point on it lies inside all other silhouettes and their mirror
//! images. Where a single silhouette excludes every such point, that one is to blame. A pixel's lifted depth lies
//! inside all silhouettes.

use crate::prior::Geometry;
use crate::prior::volume::silhouette::central_ray;
use crate::prior::volume::{Silhouette, whereabouts};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use vg_geometry::{Intrinsics, MIRROR_Y};
use vg_scene::mask::Label;
use vg_scene::{Mask, View};

/// The most silhouettes that rays are tested against; of more views, an even selection is used.
const MOST_CARVERS: usize = 32;

/// The most pixels of all of them: a silhouette takes four bytes per pixel.
const MOST_CARVER_PIXELS: usize = 64_000_000;

/// The most rays per view, and of all views; enough to detect a share of 1 %.
const MOST_RAYS_PER_VIEW: usize = 400;
const MOST_RAYS: usize = 6400;

/// Points along each ray through a ball around the vehicle: 5 cm apart for a car.
const STEPS: usize = 96;

/// A point farther outside a silhouette is outside, pixels: edges are exact to a pixel, and steps miss the best point.
const SLACK_PX: f64 = 3.0;

/// Pixels with depth that a share of them needs to be meaningful.
const LEAST_DEPTHS: usize = 20;

/// The agreement of all views.
pub(super) struct Coherence {
    pub(super) views: Vec<ViewCoherence>,
    pub(super) depth_scale: Option<f64>,
}

/// The agreement of one view with the others; the fields are those of [`super::ViewEvidence`].
pub(super) struct ViewCoherence {
    pub(super) coherent: Option<f64>,
    pub(super) coherent_mirrored: f64,
    pub(super) blamed: Option<f64>,
    pub(super) depth_inside: Option<f64>,
}

/// Measures the agreement; `None` where a view has no mask or the views do not show a common place.
pub(super) fn measure(views: &[View], geometry: Option<&Geometry>) -> Option<Coherence> {
    if views.iter().any(|view| view.mask.as_ref().is_none_or(|mask| mask.vehicle_pixels() == 0)) {
        return None;
    }
    let (middle, radius) = ball(views)?;
    let pixels = views.iter().map(|view| view.image.pixels().len()).max().unwrap_or(1);
    let every = views.len().div_ceil((MOST_CARVER_PIXELS / pixels).clamp(2, MOST_CARVERS));
    let carver = |(index, view): (usize, &View)| Carver {
        index,
        silhouette: Silhouette::new(view),
        slack: (SLACK_PX * (middle - view.camera.center()).length() / view.camera.intrinsics.smaller_focal())
            as f32,
    };
    let chosen: Vec<(usize, &View)> = views.iter().enumerate().step_by(every).collect();
    let carvers: Vec<Carver> = chosen.into_par_iter().map(carver).collect();
    let most = MOST_RAYS_PER_VIEW.min(MOST_RAYS / views.len()).max(16);
    let rays: Vec<Vec<Ray>> = views
        .par_iter()
        .enumerate()
        .map(|(i, view)| {
            let depth = geometry.map(|geometry| geometry.depths[i].depth());
            let along =
                |pixel: usize| Ray::new(view, i, pixel, depth, &carvers, middle.as_vec3(), radius as f32);
            thinned(view, most).map(along).collect()
        })
        .collect();
    let all = || rays.iter().flatten();
    let of_view = |i: usize| {
        let own = &rays[i];
        let share = |n: usize, whole: usize| n as f64 / whole.max(1) as f64;
        let count = |test: &dyn Fn(&&Ray) -> bool| own.iter().filter(test).count();
        let carves = carvers.iter().position(|c| c.index == i);
        let has_others = carvers.iter().any(|c| c.index != i);
        let others: Vec<&Ray> = all().filter(|ray| ray.view != i).collect();
        let healed = |k: usize| others.iter().filter(|ray| ray.alone & (1 << k) != 0 && !ray.meets).count();
        let depths = count(&|ray| ray.depth_inside.is_some());
        let inside = count(&|ray| ray.depth_inside == Some(true));
        ViewCoherence {
            coherent: has_others.then(|| share(count(&|ray| ray.meets), own.len())),
            coherent_mirrored: share(count(&|ray| ray.meets_mirrored), own.len()),
            // With two silhouettes that contradict each other, either may be wrong.
            blamed: carves.filter(|_| carvers.len() > 2).map(|k| share(healed(k), others.len())),
            depth_inside: (has_others && depths >= LEAST_DEPTHS).then(|| share(inside, depths)),
        }
    };
    let mut scales: Vec<f64> = all().filter_map(|ray| ray.scale).collect();
    let middle_of = scales.len() / 2;
    let depth_scale =
        (scales.len() >= LEAST_DEPTHS).then(|| *scales.select_nth_unstable_by(middle_of, f64::total_cmp).1);
    Some(Coherence { views: (0..views.len()).map(of_view).collect(), depth_scale })
}

/// Middle and radius of a ball around the vehicle, which need not be on the plane of symmetry, metres.
fn ball(views: &[View]) -> Option<(DVec3, f64)> {
    /// Views with less spread do not determine the distance of the vehicle.
    const LEAST_SPREAD: f64 = 0.01;
    let rays: Vec<(DVec3, DVec3)> = views
        .iter()
        .filter_map(|view| Some(central_ray(&view.camera, view.mask.as_ref().and_then(Mask::bounds)?)))
        .collect();
    let across = |d: DVec3| DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    let n = rays.len() as f64;
    let normal = rays.iter().fold(DMat3::ZERO, |sum, (_, d)| sum + across(*d) * n.recip());
    if normal.determinant() < LEAST_SPREAD {
        return whereabouts(views);
    }
    let right = rays.iter().fold(DVec3::ZERO, |sum, (o, d)| sum + across(*d) * *o / n);
    let middle = normal.inverse() * right;
    let radius = views.iter().fold(0.0f64, |radius, view| radius.max(reach(view, middle)));
    (middle.is_finite() && radius.is_finite() && radius > 0.0).then_some((middle, radius))
}

/// Radius of the vehicle around `middle` from the size of a view's silhouette, metres, times 1.5.
fn reach(view: &View, middle: DVec3) -> f64 {
    const MARGIN: f64 = 0.75;
    let Some([u0, v0, u1, v1]) = view.mask.as_ref().and_then(Mask::bounds) else { return 0.0 };
    let Intrinsics { fx, fy, .. } = view.camera.intrinsics;
    let angle = (f64::from(u1 - u0 + 1) / fx).hypot(f64::from(v1 - v0 + 1) / fy);
    MARGIN * angle * (middle - view.camera.center()).length()
}

/// An even selection of the mask's pixels.
fn thinned(view: &View, most: usize) -> impl Iterator<Item = usize> {
    let labels = view.mask.as_ref().expect("checked above").labels();
    let pixels = move || (0..labels.len()).filter(|&pixel| labels[pixel] == Label::Vehicle);
    pixels().step_by(pixels().count().div_ceil(most).max(1))
}

/// A silhouette that rays are tested against.
struct Carver {
    /// Index of its view.
    index: usize,
    silhouette: Silhouette,
    /// Metres.
    slack: f32,
}

impl Carver {
    fn excludes(&self, p: Vec3) -> bool {
        self.silhouette.inside(p) < -self.slack
    }
}

/// How one pixel's ray meets the silhouettes of the other views.
struct Ray {
    view: usize,
    /// Whether a point of it lies inside all other silhouettes.
    meets: bool,
    /// Whether a point of it lies inside all other silhouettes and all mirrored ones.
    meets_mirrored: bool,
    /// Bit k: at some point of it the k-th carver is the only one that excludes the point.
    alone: u32,
    /// Whether the lifted pixel lies inside the other silhouettes; `None` without depth.
    depth_inside: Option<bool>,
    /// Depth of the first point inside all silhouettes, mirrored ones too, divided by the pixel's own depth.
    scale: Option<f64>,
}

impl Ray {
    fn new(
        view: &View,
        index: usize,
        pixel: usize,
        depth: Option<&[f32]>,
        carvers: &[Carver],
        middle: Vec3,
        radius: f32,
    ) -> Self {
        let width = view.camera.width as usize;
        let at = |z: f32| view.lift((pixel % width) as u32, (pixel / width) as u32, z);
        let center = view.camera.center().as_vec3();
        let step = at(1.0) - center;
        let around = (middle - center).dot(step) / step.length_squared();
        let reach = radius / step.length();
        let others = || carvers.iter().enumerate().filter(|(_, carver)| carver.index != index);
        let excluding = |p: Vec3| others().fold(0u32, |bits, (k, c)| bits | (u32::from(c.excludes(p)) << k));
        let is_excluded_mirrored = |p: Vec3| carvers.iter().any(|carver| carver.excludes(p * MIRROR_Y));
        let (mut meets, mut first, mut alone) = (false, None, 0);
        for k in 0..STEPS {
            let z = around + reach * (2.0 * (k as f32 + 0.5) / STEPS as f32 - 1.0);
            if z <= 0.0 {
                continue;
            }
            match excluding(at(z)) {
                0 => {
                    meets = true;
                    if first.is_none() && !is_excluded_mirrored(at(z)) {
                        first = Some(z);
                    }
                }
                one if one.is_power_of_two() => alone |= one,
                _ => {}
            }
        }
        let depth = depth.map(|depth| depth[pixel]).filter(|z| *z > 0.0);
        Self {
            view: index,
            meets,
            meets_mirrored: first.is_some(),
            alone,
            depth_inside: depth.map(|z| excluding(at(z)) == 0),
            scale: first.zip(depth).map(|(first, z)| f64::from(first) / f64::from(z)),
        }
    }
}
