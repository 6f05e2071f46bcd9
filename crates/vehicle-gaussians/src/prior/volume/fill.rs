//! Inflates a field only where silhouettes need it, until the rays of vehicle pixels meet its surface.
//!
//! A smoothed or predicted surface ends inside the silhouettes in places. Where the ray of a
//! vehicle pixel misses it, the field is raised smoothly around the point where the ray comes closest. Single pixels
//! that take the depth of the nearest surface instead float in the air when they are seen from elsewhere.

use super::field::Field;
use super::march::{Meeting, Rays};
use super::relax::{Ceiling, Pull, PullKind, Relaxation, relax};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;
use vg_geometry::Camera;
use vg_scene::View;
use vg_scene::mask::{Label, Mask};

/// Rounds of raising the field: the membrane sags between the pulls, so some rays still miss after the first.
const ROUNDS: usize = 2;

/// Approximate reach of a surfel beyond its centre, pixels: rays that pass the surface more closely are covered anyway,
/// and a larger surface would spill over the silhouette.
const REACH_PX: f32 = 0.5;

/// A ray that passes the surface this closely counts as touching it, metres: the pulls raise the surface only up to the
/// ray.
const TOUCHING_M: f32 = 0.005;

/// Distance of a ray from the surface beyond which the mask is taken to be wrong, metres.
const WRONG_M: f32 = 0.25;

/// Distance between the sampled pixels near the silhouette's edge, metres on the vehicle.
const SAMPLE_M: f64 = 0.028;

/// Width of the band along the edge, in sample distances.
const EDGE_SAMPLES: usize = 4;

/// Distance between samples elsewhere, in sample distances.
const INNER_SAMPLES: usize = 3;

/// Node spacing if pictures are fine enough, metres. Narrow: the pulls are close together along the silhouette's
/// edge and must not move the surface elsewhere.
const FINEST_M: f64 = 0.04;

/// Largest node spacing, metres, whatever the pictures' resolution.
const COARSEST_M: f64 = 0.16;

/// Node spacing over the distance between pulls: with a smaller ratio the membrane would sag between them.
const NODE_SPACING: f64 = 1.4;

const RELAXATION: Relaxation =
    Relaxation { coarsest: 0.0, finest: 0.0, pulls_per_cell: 0.0, scale: 0.1, stiffness: 0.1, fade: 0.02 };

/// Share of the masks that the surface leaves uncovered, as a part of the vehicle's pixels, 0 to 1; estimated from
/// a sample of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Filled {
    /// Share before the field was raised.
    pub uncovered_before: f64,
    /// Share after the field was raised.
    pub uncovered_after: f64,
}

/// Raises `field` until the rays of the vehicle pixels of `views` meet its surface, but not above the `hull`, if there
/// is one. All views have masks.
pub(crate) fn fill_masks(field: &mut Field, hull: Option<&Field>, views: &[View]) -> Filled {
    let rays: Vec<Rays> = views.iter().map(Rays::new).collect();
    let (low, high) = field.bounds();
    let middle = (0.5 * (low + high)).as_dvec3();
    let grids: Vec<Grid> = views.iter().map(|view| Grid::new(&view.camera, middle)).collect();
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
        // An empty sum of floats is -0.0.
        open.map(|(sample, _)| sample.pixels).sum::<f64>().abs() / all.max(1.0)
    };
    let mut missed = passing(field, &rays, &samples);
    let uncovered_before = part(field, &missed);
    let ceiling = hull.map(|hull| Ceiling { hull, slack: 0.0 });
    for _ in 0..ROUNDS {
        if missed.is_empty() {
            break;
        }
        let pulls: Vec<Pull> =
            missed.iter().map(|(_, pull)| *pull).filter(|p| field.sample(p.point) > -WRONG_M).collect();
        relax(field, ceiling, &pulls, &relaxation);
        // The field only rises: covered rays stay covered.
        let again: Vec<Sample> = missed.iter().map(|(sample, _)| *sample).collect();
        missed = passing(field, &rays, &again);
    }
    Filled { uncovered_before, uncovered_after: part(field, &missed) }
}

/// Pulls that keep the silhouettes' edges covered while other evidence moves `field`: the ray of each edge pixel must
/// stay inside somewhere, and its deepest point needs the least force.
pub(crate) fn hold_masks(field: &Field, views: &[View]) -> Vec<Pull> {
    let (low, high) = field.bounds();
    let middle = (0.5 * (low + high)).as_dvec3();
    let pull = |(view, sample): (&View, Sample)| {
        let point = Rays::new(view).deepest(field, sample.u, sample.v)?;
        Some(Pull { point, target: 0.0, kind: PullKind::AtLeast, weight: 1.0 })
    };
    views
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, view)| {
            let step = Grid::new(&view.camera, middle).step;
            let mask = view.mask.as_ref().expect("hull views have masks");
            samples(i, mask, step, step, None).into_iter().filter_map(move |s| pull((view, s)))
        })
        .collect()
}

/// Distance between sampled pixels.
struct Grid {
    /// Distance in pixels.
    step: usize,
    /// Distance on the vehicle, metres.
    spacing: f64,
}

impl Grid {
    /// The grid of a camera for a vehicle around `middle`.
    fn new(camera: &Camera, middle: DVec3) -> Self {
        let footprint = (camera.center() - middle).length() / camera.intrinsics.smaller_focal();
        let step = (SAMPLE_M / footprint).round().clamp(1.0, f64::from(camera.width)) as usize;
        Self { step, spacing: step as f64 * footprint }
    }
}

/// Places that masks show but `field` does not contain: for each ray of a vehicle pixel that misses the field by more
/// than `far` metres although it meets the `hull`, the point where it is deepest inside the hull. All views have masks.
pub(crate) fn uncovered_places(field: &Field, hull: &Field, views: &[View], far: f32) -> Vec<Vec3> {
    const STEP: usize = 5;
    let places = |view: &View| {
        let rays = Rays::new(view);
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
    views.par_iter().map(places).collect::<Vec<_>>().concat()
}

/// A sampled pixel and the number of pixels it represents.
#[derive(Clone, Copy)]
struct Sample {
    view: usize,
    u: usize,
    v: usize,
    pixels: f64,
}

/// Vehicle pixels, every `step` within `band` of the edge and every `inner` elsewhere.
fn samples(view: usize, mask: &Mask, step: usize, band: usize, inner: Option<usize>) -> Vec<Sample> {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let vehicle = |u: usize, v: usize| mask.labels()[v * width + u] == Label::Vehicle;
    // The picture's border is no edge of the silhouette: what lies beyond is unknown.
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

/// The samples whose rays miss the surface, each with a pull that would cover it.
fn passing(field: &Field, rays: &[Rays], samples: &[Sample]) -> Vec<(Sample, Pull)> {
    let pull = |sample: &Sample| {
        let &Sample { view, u, v, .. } = sample;
        match rays[view].meet(field, u, v) {
            Meeting::Closest { z } => {
                let point = rays[view].point(u, v, z);
                let reach = REACH_PX * rays[view].footprint(z);
                // A little more than needed: the membrane sags between the pulls.
                let pull = Pull { point, target: -0.7 * reach, kind: PullKind::AtLeast, weight: 1.0 };
                (field.sample(point) < -reach).then_some((*sample, pull))
            }
            // The field cannot be raised outside its grid.
            Meeting::Surface(_) | Meeting::Nowhere => None,
        }
    };
    samples.par_iter().filter_map(pull).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};
    use vg_geometry::{Camera, Intrinsics, Pose};
    use vg_scene::RgbImage;

    /// A ball around the origin as a field.
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
    fn a_ball_too_small_grows_to_its_silhouette_but_not_beyond_the_hull() {
        let views = [view(0.8)];
        let (mut field, hull) = (ball(0.74), ball(0.82));
        let filled = fill_masks(&mut field, Some(&hull), &views);
        assert!(filled.uncovered_before > 0.1, "{filled:?}");
        assert!(filled.uncovered_after < 0.2 * filled.uncovered_before, "{filled:?}");
        // Where the rays of the edge touch a ball: a fifth of its radius towards the camera, four metres away.
        let rim = field.sample(0.78 * Vec3::new(0.98, -0.2, 0.0));
        // Pixels are 33 mm wide; surfels cover half of one.
        assert!(rim > -0.03, "{rim}");
        // The surface in the middle of the mask stays where it was.
        let front = field.sample(Vec3::new(0.0, -0.74, 0.0));
        assert!(front.abs() < 1e-3, "{front}");
        assert!(field.values().iter().zip(hull.values()).all(|(f, h)| *f <= h + 1e-5));
    }

    #[test]
    fn the_surface_stays_inside_a_hull_that_does_not_fill_the_mask() {
        let (mut field, hull) = (ball(0.7), ball(0.72));
        let filled = fill_masks(&mut field, Some(&hull), &[view(0.8)]);
        assert!(filled.uncovered_after > 0.1 && filled.uncovered_after < filled.uncovered_before);
        assert!(field.values().iter().zip(hull.values()).all(|(f, h)| *f <= h + 1e-5));
    }

    #[test]
    fn a_filled_mask_leaves_the_field_unchanged() {
        let mut field = ball(0.85);
        let filled = fill_masks(&mut field, None, &[view(0.8)]);
        assert_eq!((filled.uncovered_before, filled.uncovered_after), (0.0, 0.0));
        assert_eq!(field.values(), ball(0.85).values());
    }
}
