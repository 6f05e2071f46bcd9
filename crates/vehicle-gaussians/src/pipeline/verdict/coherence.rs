//! How far the silhouettes, and the depth with them, agree with one another.
//!
//! The ray of a mask's pixel hits the vehicle, so somewhere along it all other silhouettes have room for it, and so
//! have their mirror images. Where only one silhouette has not, that one is to blame. A pixel's depth, lifted, lies
//! inside all silhouettes.

use crate::prior::Geometry;
use crate::prior::volume::silhouette::central_ray;
use crate::prior::volume::{Silhouette, whereabouts};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use vg_geometry::{Intrinsics, MIRROR_Y};
use vg_scene::mask::Label;
use vg_scene::{Mask, View};

/// Silhouettes that are asked, at most: those of more views are thinned evenly.
const MOST_CARVERS: usize = 32;

/// Pixels of all of them, at most: a silhouette takes four bytes a pixel.
const MOST_CARVER_PIXELS: usize = 64_000_000;

/// Rays per view, and of all views: a share of 1 % is told from none.
const MOST_RAYS_PER_VIEW: usize = 400;
const MOST_RAYS: usize = 6400;

/// Places along each ray, through a ball around the vehicle: 5 cm apart for a car.
const STEPS: usize = 96;

/// A place this far outside a silhouette is outside, pixels: edges are drawn to a pixel, and steps miss the best place.
const SLACK_PX: f64 = 3.0;

/// Pixels with depth of one view that are needed before its share means something.
const LEAST_DEPTHS: usize = 20;

/// What is found of all views.
pub(super) struct Coherence {
    pub(super) views: Vec<ViewCoherence>,
    pub(super) depth_scale: Option<f64>,
}

/// What is found of one view; the fields are those of [`super::ViewEvidence`].
pub(super) struct ViewCoherence {
    pub(super) coherent: Option<f64>,
    pub(super) coherent_mirrored: f64,
    pub(super) blamed: Option<f64>,
    pub(super) depth_inside: Option<f64>,
}

/// `None` where a view has no mask or nothing that is seen lies in a common place.
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
    let asked: Vec<Vec<Ray>> = views
        .par_iter()
        .enumerate()
        .map(|(i, view)| {
            let depth = geometry.map(|geometry| geometry.depths[i].depth());
            let along =
                |pixel: usize| Ray::new(view, i, pixel, depth, &carvers, middle.as_vec3(), radius as f32);
            thinned(view, most).map(along).collect()
        })
        .collect();
    let all = || asked.iter().flatten();
    let of_view = |i: usize| {
        let own = &asked[i];
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
            // Of two silhouettes that contradict each other, either may be wrong.
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

/// Where the vehicle is, whether or not that is on the plane of symmetry: middle and radius, metres.
fn ball(views: &[View]) -> Option<(DVec3, f64)> {
    /// Views this nearly parallel do not tell how far away the vehicle is.
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

/// How far from `middle` the vehicle reaches by the size of a view's silhouette, metres, with half as much again.
fn reach(view: &View, middle: DVec3) -> f64 {
    const MARGIN: f64 = 0.75;
    let Some([u0, v0, u1, v1]) = view.mask.as_ref().and_then(Mask::bounds) else { return 0.0 };
    let Intrinsics { fx, fy, .. } = view.camera.intrinsics;
    let angle = (f64::from(u1 - u0 + 1) / fx).hypot(f64::from(v1 - v0 + 1) / fy);
    MARGIN * angle * (middle - view.camera.center()).length()
}

/// Some of the mask's pixels, spread evenly.
fn thinned(view: &View, most: usize) -> impl Iterator<Item = usize> {
    let labels = view.mask.as_ref().expect("looked at before").labels();
    let pixels = move || (0..labels.len()).filter(|&pixel| labels[pixel] == Label::Vehicle);
    pixels().step_by(pixels().count().div_ceil(most).max(1))
}

/// A silhouette that others are held against.
struct Carver {
    /// Of its view.
    index: usize,
    silhouette: Silhouette,
    /// Metres.
    slack: f32,
}

impl Carver {
    fn denies(&self, p: Vec3) -> bool {
        self.silhouette.inside(p) < -self.slack
    }
}

/// How one pixel's ray meets the silhouettes of the other views.
struct Ray {
    view: usize,
    /// Somewhere no other silhouette denies it.
    meets: bool,
    /// Somewhere no other silhouette and no mirrored one does.
    meets_mirrored: bool,
    /// Bit k: somewhere the k-th carver alone denies it.
    alone: u32,
    /// Whether the lifted pixel lies inside the other silhouettes; `None` without depth.
    depth_inside: Option<bool>,
    /// The distance at which all silhouettes, mirrored ones too, first have room, by the pixel's own.
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
        let denied = |p: Vec3| others().fold(0u32, |bits, (k, c)| bits | (u32::from(c.denies(p)) << k));
        let denied_mirrored = |p: Vec3| carvers.iter().any(|carver| carver.denies(p * MIRROR_Y));
        let (mut meets, mut first, mut alone) = (false, None, 0);
        for k in 0..STEPS {
            let z = around + reach * (2.0 * (k as f32 + 0.5) / STEPS as f32 - 1.0);
            if z <= 0.0 {
                continue;
            }
            match denied(at(z)) {
                0 => {
                    meets = true;
                    if first.is_none() && !denied_mirrored(at(z)) {
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
            depth_inside: depth.map(|z| denied(at(z)) == 0),
            scale: first.zip(depth).map(|(first, z)| f64::from(first) / f64::from(z)),
        }
    }
}
