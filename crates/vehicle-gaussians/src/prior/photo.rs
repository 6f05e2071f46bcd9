//! Photo-consistency: moves the surface to where views, and the mirrored twins of views, agree.
//!
//! A small patch of the present surface is moved along its normal to where two views' pictures of it agree best, by
//! zero-mean normalised cross-correlation at two scales. Gloss, repetition and plain paint make this wrong more
//! often than right, so a match counts only if the agreement, summed over both scales, is high and far better than
//! elsewhere on the path.

use super::Geometry;
use super::normals::normals;
use super::volume::points::median_distance;
use super::volume::relax::{Ceiling, HULL_SLACK_M, Pull, PullKind, Relaxation, relax};
use super::volume::{Field, march};
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;
use vg_geometry::{MIRROR_Y, Result};
use vg_scene::View;
use vg_scene::visibility::{Observer, Sight};

/// Distance between patches along rows and columns, pixels.
const EVERY_PX: usize = 5;

/// Patches are this many samples wide and high.
const SIDE: usize = 7;
const SAMPLES: usize = SIDE * SIDE;

/// Length of the search along the normal to either side, and its step, metres.
const REACH_M: f32 = 0.09;
const STEP_M: f32 = 0.01;
const STEPS: usize = 19;

/// Spacing of a patch's samples at each scale, in pixel footprints.
const SPACING: [f32; 2] = [1.2, 2.6];

/// Lowest correlation of a match.
const AGREEMENT: f32 = 0.8;

/// Margin by which the best place must beat all places farther away than [`NEAR_STEPS`].
const MARGIN: f32 = 0.06;
const NEAR_STEPS: usize = 3;

/// Lowest contrast of a patch (standard deviation of brightness from 0 to 1).
const CONTRAST: f32 = 0.02;

/// Cosine of the flattest angle at which a surface is sampled.
const LEAST_COS: f32 = 0.35;

/// A place counts as visible up to this far behind a view's surface, metres: the surface is not exact yet.
const THICKNESS_M: f32 = 0.10;

/// Short-range pulls: a match on a wheel's rim must not move the doors.
const RELAXATION: Relaxation =
    Relaxation { coarsest: 0.24, finest: 0.06, pulls_per_cell: 0.0, scale: 0.02, stiffness: 0.3, fade: 0.2 };

/// Result of the photo-consistency search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PhotoFit {
    /// Patches that were searched for in other views.
    pub patches: usize,
    /// Patches that were found.
    pub found: usize,
    /// Median distance of the found places to the surface before it was moved, metres.
    pub before_m: f64,
    /// The distance after it was moved.
    pub after_m: f64,
}

/// Moves the surface of `field` to where the photographs agree, inside `hull`. All views have masks.
pub(crate) fn fit_photographs(field: &mut Field, hull: &Field, views: &[View]) -> Result<PhotoFit> {
    let depths = views.iter().map(|view| march::march(view, field)).collect::<Result<Vec<_>>>()?;
    let normals = views.iter().zip(&depths).map(|(view, depth)| normals(&view.camera, depth)).collect();
    let geometry = Geometry { normals, ..Geometry::new(depths, None) };
    let (patches, pulls) = pulls(views, &geometry);
    let before_m = median_distance(field, &pulls);
    relax(field, Some(Ceiling { hull, slack: HULL_SLACK_M }), &pulls, &RELAXATION);
    Ok(PhotoFit { patches, found: pulls.len(), before_m, after_m: median_distance(field, &pulls) })
}

/// The number of patches searched for, and the pulls to where the surface should be by those that were found.
fn pulls(views: &[View], geometry: &Geometry) -> (usize, Vec<Pull>) {
    let observers = geometry.observers(views);
    let pictures: Vec<Picture> = views.par_iter().map(Picture::new).collect();
    let (mut patches, mut pulls) = (0, Vec::new());
    for (i, view) in views.iter().enumerate() {
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        let places: Vec<usize> = (EVERY_PX / 2..height)
            .step_by(EVERY_PX)
            .flat_map(|v| (EVERY_PX / 2..width).step_by(EVERY_PX).map(move |u| v * width + u))
            .collect();
        let rotation = view.camera.vehicle_from_camera.rotation.as_mat3();
        let found: Vec<Option<Pull>> = places
            .par_iter()
            .map(|&pixel| {
                let (u, v) = ((pixel % width) as u32, (pixel / width) as u32);
                let z = geometry.depths[i].get(u, v)?;
                let normal = rotation * geometry.normals[i][pixel];
                let footprint = z / view.camera.intrinsics.smaller_focal() as f32;
                let patch = Patch::new(view.lift(u, v, z), normal, footprint);
                sweep(&patch, i, &observers, &pictures)
            })
            .collect();
        patches += places.iter().filter(|&&pixel| geometry.depths[i].depth()[pixel] > 0.0).count();
        pulls.extend(found.into_iter().flatten());
    }
    (patches, pulls)
}

/// A square on the surface, vehicle frame.
#[derive(Clone, Copy)]
struct Patch {
    center: Vec3,
    normal: Vec3,
    /// From sample to sample at the finest spacing, metres.
    across: Vec3,
    up: Vec3,
}

impl Patch {
    fn new(center: Vec3, normal: Vec3, footprint: f32) -> Self {
        let across = normal.cross(Vec3::Z).try_normalize().unwrap_or(Vec3::X);
        Self { center, normal, across: across * footprint, up: across.cross(normal) * footprint }
    }

    fn moved(&self, way: f32) -> Self {
        Self { center: self.center + way * self.normal, ..*self }
    }

    fn mirrored(&self) -> Self {
        Self {
            center: self.center * MIRROR_Y,
            normal: self.normal * MIRROR_Y,
            across: self.across * MIRROR_Y,
            up: self.up * MIRROR_Y,
        }
    }
}

fn sweep(patch: &Patch, own: usize, observers: &[Observer], pictures: &[Picture]) -> Option<Pull> {
    let own_resolution = observers[own].resolution(patch.center, patch.normal);
    let to_camera = (observers[own].center - patch.center).normalize();
    if to_camera.dot(patch.normal) < LEAST_COS {
        return None;
    }
    // Observers of the patch: the other views as they are, all views as mirrored twins.
    let twin = patch.mirrored();
    let others: Vec<(usize, bool)> = (0..observers.len())
        .flat_map(|j| [(j, false), (j, true)])
        .filter(|&(j, mirrored)| (j, mirrored) != (own, false))
        .filter(|&(j, mirrored)| {
            let p = if mirrored { &twin } else { patch };
            let other = &observers[j];
            other.resolution(p.center, p.normal) > 0.4 * own_resolution
                && (other.center - p.center).normalize().dot(p.normal) > LEAST_COS
                && other.sight(p.center, THICKNESS_M) == Sight::Surface
        })
        .collect();
    if others.is_empty() {
        return None;
    }
    let mut scores = [0.0f32; STEPS];
    for (k, score) in scores.iter_mut().enumerate() {
        let moved = patch.moved(k as f32 * STEP_M - REACH_M);
        let twin = moved.mirrored();
        for scale in 0..2 {
            let reference = pictures[own].samples(&moved, scale)?;
            let mut best = -1.0f32;
            for &(j, mirrored) in &others {
                let there = pictures[j].samples(if mirrored { &twin } else { &moved }, scale);
                if let Some(there) = there {
                    let agreement: f32 = reference.iter().zip(&there).map(|(a, b)| a * b).sum();
                    best = best.max(agreement);
                }
            }
            *score += 0.5 * best;
        }
    }
    let best = (0..STEPS).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
    let elsewhere = (0..STEPS).filter(|k| k.abs_diff(best) > NEAR_STEPS).map(|k| scores[k]);
    let margin = scores[best] - elsewhere.fold(-1.0, f32::max);
    if best == 0 || best == STEPS - 1 || scores[best] < AGREEMENT || margin < MARGIN {
        return None;
    }
    // The top of the parabola through the best place and its neighbours.
    let (a, b, c) = (scores[best - 1], scores[best], scores[best + 1]);
    let between = 0.5 * (a - c) / (a - 2.0 * b + c).min(-1e-6);
    let way = (best as f32 + between.clamp(-0.5, 0.5)) * STEP_M - REACH_M;
    let weight = ((scores[best] - AGREEMENT) / (1.0 - AGREEMENT)).clamp(0.1, 1.0);
    Some(Pull { point: patch.moved(way).center, target: 0.0, kind: PullKind::Exact, weight })
}

/// Brightness of a view at full and at half size.
struct Picture {
    levels: [(usize, usize, Vec<f32>); 2],
    rotation: glam::Mat3,
    translation: Vec3,
    intrinsics: [f32; 4],
}

impl Picture {
    fn new(view: &View) -> Self {
        let (w, h) = (view.camera.width as usize, view.camera.height as usize);
        let gray: Vec<f32> = view
            .image
            .pixels()
            .iter()
            .map(|[r, g, b]| (0.299 * f32::from(*r) + 0.587 * f32::from(*g) + 0.114 * f32::from(*b)) / 255.0)
            .collect();
        let (w2, h2) = ((w / 2).max(1), (h / 2).max(1));
        let at = |u: usize, v: usize| gray[v.min(h - 1) * w + u.min(w - 1)];
        let half = (0..w2 * h2)
            .map(|i| {
                let (u, v) = (2 * (i % w2), 2 * (i / w2));
                0.25 * (at(u, v) + at(u + 1, v) + at(u, v + 1) + at(u + 1, v + 1))
            })
            .collect();
        let camera_from_vehicle = view.camera.vehicle_from_camera.inverse();
        let i = view.camera.intrinsics;
        Self {
            levels: [(w, h, gray), (w2, h2, half)],
            rotation: camera_from_vehicle.rotation.as_mat3(),
            translation: camera_from_vehicle.translation.as_vec3(),
            intrinsics: [i.fx as f32, i.fy as f32, i.cx as f32, i.cy as f32],
        }
    }

    /// The patch as this view shows it, normalised to mean 0 and length 1; `None` if it leaves the picture or lacks
    /// contrast. Perspective within the patch is approximated as linear.
    fn samples(&self, patch: &Patch, scale: usize) -> Option<[f32; SAMPLES]> {
        let (width, height, level) = &self.levels[scale];
        let p = self.rotation * patch.center + self.translation;
        if p.z < 0.1 {
            return None;
        }
        let [fx, fy, cx, cy] = self.intrinsics;
        let shrink = if scale == 0 { 1.0 } else { 0.5 };
        let inverse = p.z.recip();
        let (u, v) = ((fx * p.x * inverse + cx) * shrink - 0.5, (fy * p.y * inverse + cy) * shrink - 0.5);
        let slope = |along: Vec3| {
            let d = self.rotation * along * SPACING[scale];
            let du = fx * (d.x - p.x * inverse * d.z) * inverse * shrink;
            let dv = fy * (d.y - p.y * inverse * d.z) * inverse * shrink;
            (du, dv)
        };
        let (across, up) = (slope(patch.across), slope(patch.up));
        let mut samples = [0.0; SAMPLES];
        let half = (SIDE / 2) as f32;
        for (n, sample) in samples.iter_mut().enumerate() {
            let (a, b) = ((n % SIDE) as f32 - half, (n / SIDE) as f32 - half);
            let (x, y) = (u + a * across.0 + b * up.0, v + a * across.1 + b * up.1);
            if !(x >= 0.0 && y >= 0.0 && x < (*width - 1) as f32 && y < (*height - 1) as f32) {
                return None;
            }
            let (i, j) = (x as usize, y as usize);
            let (fu, fv) = (x - i as f32, y - j as f32);
            let at = |i: usize, j: usize| level[j * width + i];
            let top = at(i, j) + (at(i + 1, j) - at(i, j)) * fu;
            let bottom = at(i, j + 1) + (at(i + 1, j + 1) - at(i, j + 1)) * fu;
            *sample = top + (bottom - top) * fv;
        }
        let mean = samples.iter().sum::<f32>() / SAMPLES as f32;
        samples.iter_mut().for_each(|s| *s -= mean);
        let length = samples.iter().map(|s| s * s).sum::<f32>().sqrt();
        if length < CONTRAST * (SAMPLES as f32).sqrt() {
            return None;
        }
        samples.iter_mut().for_each(|s| *s /= length);
        Some(samples)
    }
}
