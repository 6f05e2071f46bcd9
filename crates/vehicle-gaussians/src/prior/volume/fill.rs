//! Inflates a field just where silhouettes demand it, until the vehicle's pixels meet its surface.
//!
//! A surface that is smoothed, or predicted, ends inside the silhouettes here and there. Where the ray of a
//! vehicle pixel passes it by, the field is pulled up at the point where the ray comes closest, smoothly, with
//! its surroundings: single pixels that take the depth of the nearest surface instead hang in the air when they
//! are seen from elsewhere.

use super::field::Field;
use super::march::{Meeting, Rays};
use super::relax::{Ceiling, Pull, Relaxation, Wish, relax};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;
use vg_geometry::Camera;
use vg_scene::View;
use vg_scene::mask::{Label, Mask};

/// Rays that were missed once more after a bend: the membrane gives way between the pulls.
const ROUNDS: usize = 2;

/// A surfel reaches about this many pixels beyond its centre: rays that pass the surface by closer are covered all the
/// same, and more would spill over the silhouette.
const REACH_PX: f32 = 0.5;

/// A ray that passes the surface this closely touches it, metres: the pulls end at it, from outside.
const TOUCHING_M: f32 = 0.005;

/// A ray that passes by farther than this says that its mask is wrong, metres.
const WRONG_M: f32 = 0.25;

/// How far the hull is allowed to be too small itself, metres: masks and poses are a pixel off.
const SLACK_M: f32 = 0.0;

/// Distance between the pixels that are looked at near the silhouette's edge, metres on the vehicle.
const SAMPLE_M: f64 = 0.028;

/// Near the edge is nearer than so many of them.
const EDGE_SAMPLES: usize = 4;

/// Elsewhere, every so many of them.
const INNER_SAMPLES: usize = 3;

/// Node spacing where pictures are fine enough, metres. Narrow: the pulls sit side by side along the silhouette's
/// edge, and are not to move what is seen elsewhere.
const FINEST_M: f64 = 0.04;

/// Nodes are no farther apart than this, metres, whatever the pictures are like.
const COARSEST_M: f64 = 0.16;

/// Nodes are this many times farther apart than pulls: nearer, the membrane would give way between them.
const NODE_SPACING: f64 = 1.4;

const RELAXATION: Relaxation =
    Relaxation { coarsest: 0.0, finest: 0.0, pulls_per_cell: 0.0, scale: 0.1, stiffness: 0.1, fade: 0.02 };

/// How much of the masks the surface leaves uncovered, as a part of the vehicle's pixels, 0 to 1; estimated from
/// some of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Filled {
    /// By the field as it was.
    pub uncovered_before: f64,
    /// After it was bent.
    pub uncovered_after: f64,
}

/// Raises `field` until the vehicle pixels of `views` meet its surface, but not above what the `hull`, where
/// there is one, and a little slack allow. All views have masks.
pub(crate) fn fill_masks(field: &mut Field, hull: Option<&Field>, views: &[View]) -> Filled {
    let rays: Vec<Rays> = views.iter().map(Rays::of).collect();
    let (low, high) = field.bounds();
    let middle = (0.5 * (low + high)).as_dvec3();
    let grids: Vec<Grid> = views.iter().map(|view| Grid::of(&view.camera, middle)).collect();
    let samples: Vec<Sample> = (0..views.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            let (mask, step) = (views[i].mask.as_ref().expect("hull views have masks"), grids[i].step);
            samples(i, mask, step, EDGE_SAMPLES * step, Some(INNER_SAMPLES * step))
        })
        .collect();
    let widest = grids.iter().map(|grid| grid.spacing).fold(0.0, f64::max);
    let spacing = (NODE_SPACING * widest).clamp(FINEST_M, COARSEST_M) as f32;
    let relaxation = Relaxation { coarsest: spacing, finest: spacing, ..RELAXATION };
    let all: f64 = samples.iter().map(|s| s.pixels).sum();
    let part = |field: &Field, missed: &[(Sample, Pull)]| {
        let open = missed.iter().filter(|(_, pull)| field.sample(pull.point) < -TOUCHING_M);
        // Of nothing, a sum of floats is -0.
        open.map(|(sample, _)| sample.pixels).sum::<f64>().abs() / all.max(1.0)
    };
    let mut missed = passing(field, &rays, &samples);
    let uncovered_before = part(field, &missed);
    let ceiling = hull.map(|hull| Ceiling { hull, slack: SLACK_M });
    for _ in 0..ROUNDS {
        if missed.is_empty() {
            break;
        }
        let pulls: Vec<Pull> =
            missed.iter().map(|(_, pull)| *pull).filter(|p| field.sample(p.point) > -WRONG_M).collect();
        relax(field, ceiling, &pulls, &relaxation);
        // The field only rises: what was covered stays so.
        let again: Vec<Sample> = missed.iter().map(|(sample, _)| *sample).collect();
        missed = passing(field, &rays, &again);
    }
    Filled { uncovered_before, uncovered_after: part(field, &missed) }
}

/// Pulls that hold `field` where the silhouettes' edges need it, so that other evidence does not uncover them:
/// each edge's ray must stay inside somewhere, and stays so most easily where it is deepest.
pub(crate) fn hold_masks(field: &Field, views: &[View]) -> Vec<Pull> {
    let (low, high) = field.bounds();
    let middle = (0.5 * (low + high)).as_dvec3();
    let pull = |(view, sample): (&View, Sample)| {
        let point = Rays::of(view).deepest(field, sample.u, sample.v)?;
        Some(Pull { point, target: 0.0, wish: Wish::AtLeast, weight: 1.0 })
    };
    views
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, view)| {
            let step = Grid::of(&view.camera, middle).step;
            let mask = view.mask.as_ref().expect("hull views have masks");
            samples(i, mask, step, step, None).into_iter().filter_map(move |s| pull((view, s)))
        })
        .collect()
}

/// How far apart the pixels are that are looked at.
struct Grid {
    /// Pixels.
    step: usize,
    /// Metres on the vehicle.
    spacing: f64,
}

impl Grid {
    /// For a vehicle around `middle`.
    fn of(camera: &Camera, middle: DVec3) -> Self {
        let footprint = (camera.center() - middle).length() / camera.intrinsics.smaller_focal();
        let step = (SAMPLE_M / footprint).round().clamp(1.0, f64::from(camera.width)) as usize;
        Self { step, spacing: step as f64 * footprint }
    }
}

/// Places that masks show and `field` denies: for rays of vehicle pixels that pass the field by more than `far`
/// metres although they meet the `hull`, the point where they are deepest inside the hull. All views have masks.
pub(crate) fn denied(field: &Field, hull: &Field, views: &[View], far: f32) -> Vec<Vec3> {
    const STEP: usize = 5;
    let of_view = |view: &View| {
        let rays = Rays::of(view);
        let mask = view.mask.as_ref().expect("hull views have masks");
        let (width, height) = (mask.width() as usize, mask.height() as usize);
        let place = |(u, v): (usize, usize)| {
            let Meeting::Closest { z } = rays.meet(field, u, v) else { return None };
            let missed = field.sample(rays.point(u, v, z)) < -far;
            missed.then(|| rays.deepest(hull, u, v)).flatten()
        };
        let pixels = (0..height).step_by(STEP).flat_map(|v| (0..width).step_by(STEP).map(move |u| (u, v)));
        let vehicle = pixels.filter(|&(u, v)| mask.labels()[v * width + u] == Label::Vehicle);
        vehicle.filter_map(place).collect::<Vec<Vec3>>()
    };
    views.par_iter().map(of_view).collect::<Vec<_>>().concat()
}

/// A pixel that stands for some.
#[derive(Clone, Copy)]
struct Sample {
    view: usize,
    u: usize,
    v: usize,
    pixels: f64,
}

/// Vehicle pixels nearer to the edge than `band` at every `step`, others at every `inner`.
fn samples(view: usize, mask: &Mask, step: usize, band: usize, inner: Option<usize>) -> Vec<Sample> {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let vehicle = |u: usize, v: usize| mask.labels()[v * width + u] == Label::Vehicle;
    // Beyond the picture's border nothing is known, and nothing ends there.
    let near_edge = |u: usize, v: usize| {
        let (left, top) = (u.saturating_sub(band), v.saturating_sub(band));
        let (right, bottom) = ((u + band).min(width - 1), (v + band).min(height - 1));
        !(vehicle(left, v) && vehicle(right, v) && vehicle(u, top) && vehicle(u, bottom))
    };
    let mut out = Vec::new();
    for v in (0..height).step_by(step) {
        for u in (0..width).step_by(step).filter(|&u| vehicle(u, v)) {
            if near_edge(u, v) {
                out.push(Sample { view, u, v, pixels: (step * step) as f64 });
            } else if let Some(inner) = inner.filter(|i| u.is_multiple_of(*i) && v.is_multiple_of(*i)) {
                out.push(Sample { view, u, v, pixels: (inner * inner) as f64 });
            }
        }
    }
    out
}

/// The samples whose rays pass the surface by, and what they ask for.
fn passing(field: &Field, rays: &[Rays], samples: &[Sample]) -> Vec<(Sample, Pull)> {
    let verdict = |sample: &Sample| {
        let &Sample { view, u, v, .. } = sample;
        match rays[view].meet(field, u, v) {
            Meeting::Closest { z } => {
                let point = rays[view].point(u, v, z);
                let reach = REACH_PX * rays[view].footprint(z);
                // A little more than needed: the membrane gives way between the pulls.
                let pull = Pull { point, target: -0.7 * reach, wish: Wish::AtLeast, weight: 1.0 };
                (field.sample(point) < -reach).then_some((*sample, pull))
            }
            // Outside the grid nothing can be raised.
            Meeting::Surface(_) | Meeting::Nowhere => None,
        }
    };
    samples.par_iter().filter_map(verdict).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};
    use vg_geometry::{Camera, Intrinsics, Pose};
    use vg_scene::RgbImage;

    /// How far inside a ball around the origin, metres.
    fn ball(radius: f32) -> Field {
        Field::carve(DVec3::splat(-1.2), DVec3::splat(1.2), 0.03, |p| radius - p.length())
    }

    /// The silhouette of a ball of this radius, from the right.
    fn view(radius: f64) -> View {
        let i = Intrinsics { fx: 120.0, fy: 120.0, cx: 50.0, cy: 50.0 };
        let rotation = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
        let pose = Pose::new("camera", rotation, DVec3::new(0.0, -4.0, 0.0)).unwrap();
        let camera = Camera::pinhole(100, 100, i, pose).unwrap();
        let label = |k: u32| {
            let ray = camera.ray([f64::from(k % 100) + 0.5, f64::from(k / 100) + 0.5]).unwrap();
            let passes_at = (4.0 * 4.0 * (1.0 - ray.normalize().z.powi(2))).sqrt();
            if passes_at < radius { Label::Vehicle } else { Label::Background }
        };
        let mask = Mask::new(100, 100, (0..10_000).map(label).collect()).unwrap();
        let image = RgbImage::new(100, 100, vec![[0; 3]; 10_000]).unwrap();
        View { name: String::new(), camera, image, mask: Some(mask), depth: None }
    }

    #[test]
    fn a_ball_too_small_grows_to_its_silhouette_and_no_further_than_the_hull() {
        let views = [view(0.8)];
        let (mut field, hull) = (ball(0.74), ball(0.82));
        let filled = fill_masks(&mut field, Some(&hull), &views);
        assert!(filled.uncovered_before > 0.1, "{filled:?}");
        assert!(filled.uncovered_after < 0.2 * filled.uncovered_before, "{filled:?}");
        // Where the rays of the edge touch a ball: a fifth of its radius towards the camera, four metres away.
        let rim = field.sample(0.78 * Vec3::new(0.98, -0.2, 0.0));
        // Pixels are 33 mm wide; half of one is left to the surfels.
        assert!(rim > -0.03, "{rim}");
        // What the view sees in the middle of the mask stays where it was.
        let front = field.sample(Vec3::new(0.0, -0.74, 0.0));
        assert!(front.abs() < 1e-3, "{front}");
        assert!(field.values().iter().zip(hull.values()).all(|(f, h)| *f <= h + 1e-5));
    }

    #[test]
    fn a_hull_that_does_not_fill_the_mask_is_not_left() {
        let (mut field, hull) = (ball(0.7), ball(0.72));
        let filled = fill_masks(&mut field, Some(&hull), &[view(0.8)]);
        assert!(filled.uncovered_after > 0.1 && filled.uncovered_after < filled.uncovered_before);
        assert!(field.values().iter().zip(hull.values()).all(|(f, h)| *f <= h + 1e-5));
    }

    #[test]
    fn a_filled_mask_leaves_every_byte() {
        let mut field = ball(0.85);
        let filled = fill_masks(&mut field, None, &[view(0.8)]);
        assert_eq!((filled.uncovered_before, filled.uncovered_after), (0.0, 0.0));
        assert_eq!(field.values(), ball(0.85).values());
    }
}
