//! Depth per pixel: the first point of each ray inside the hull, sub-voxel.

use super::field::Field;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use vg_geometry::{Intrinsics, Result};
use vg_scene::mask::Label;
use vg_scene::{DepthMap, View};

/// Confidence of a pixel whose ray misses the hull and takes the depth where it comes closest.
const GRAZING_CONFIDENCE: f32 = 0.5;

/// Result of intersecting a ray with the surface of a field; z is planar depth, metres.
pub(super) enum Meeting {
    /// The ray enters the inside here.
    Surface(f32),
    /// The ray misses the surface and comes closest here.
    Closest { z: f32 },
    /// The ray misses the grid.
    Nowhere,
}

/// The rays of a pinhole view's pixels, vehicle frame.
pub(super) struct Rays {
    origin: Vec3,
    rotation: Mat3,
    intrinsics: Intrinsics,
}

/// Planar depth of every vehicle pixel of `view`. A ray that misses the hull (poses or masks slightly wrong)
/// takes the depth where it comes closest, so that every vehicle pixel is filled, with lower confidence.
pub(crate) fn march(view: &View, field: &Field) -> Result<DepthMap> {
    let camera = &view.camera;
    let mask = view.mask.as_ref().expect("hull views have masks");
    let width = camera.width as usize;
    let rays = Rays::new(view);
    let mut pixels = vec![(0.0f32, 0.0f32); width * camera.height as usize];
    pixels.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        for (u, pixel) in row.iter_mut().enumerate() {
            if mask.labels()[v * width + u] != Label::Vehicle {
                continue;
            }
            *pixel = match rays.meet(field, u, v) {
                Meeting::Surface(z) => (z, 1.0),
                Meeting::Closest { z } => (z, GRAZING_CONFIDENCE),
                Meeting::Nowhere => (0.0, 0.0),
            };
        }
    });
    let (depth, confidence) = pixels.into_iter().unzip();
    DepthMap::new(camera.width, camera.height, depth)?.with_confidence(confidence)
}

impl Rays {
    pub(super) fn new(view: &View) -> Self {
        Self {
            origin: view.camera.center().as_vec3(),
            rotation: view.camera.vehicle_from_camera.rotation.as_mat3(),
            intrinsics: view.camera.intrinsics,
        }
    }

    /// The point at planar depth z behind the centre of pixel (u, v).
    pub(super) fn point(&self, u: usize, v: usize, z: f32) -> Vec3 {
        self.origin + z * self.direction(u, v)
    }

    /// Width of a pixel at planar depth z, metres.
    pub(super) fn footprint(&self, z: f32) -> f32 {
        z / self.intrinsics.smaller_focal() as f32
    }

    /// The first point of a pixel's ray inside the field.
    pub(super) fn meet(&self, field: &Field, u: usize, v: usize) -> Meeting {
        meet(field, self.origin, self.direction(u, v))
    }

    /// The deepest point of a pixel's ray on its first stretch inside the field; `None` if it is never inside.
    pub(super) fn deepest(&self, field: &Field, u: usize, v: usize) -> Option<Vec3> {
        let Meeting::Surface(first) = self.meet(field, u, v) else { return None };
        let direction = self.direction(u, v);
        let step = field.voxel() / direction.length();
        let point = |k: usize| self.origin + (first + k as f32 * step) * direction;
        // A field may be positive up to its border, where samples repeat.
        let stretch = (1..1000).map(|k| (k, field.sample(point(k)))).take_while(|(_, inside)| *inside > 0.0);
        let deepest = stretch.max_by(|a, b| a.1.total_cmp(&b.1));
        Some(point(deepest.map_or(0, |(k, _)| k)))
    }

    /// Direction of a pixel's ray, with z = 1 in the camera frame.
    fn direction(&self, u: usize, v: usize) -> Vec3 {
        self.rotation * self.intrinsics.pixel_ray(u as u32, v as u32).as_vec3()
    }
}

/// Intersects a ray with the field; `direction` has z = 1 in the camera frame, so that z along it is planar depth.
fn meet(field: &Field, origin: Vec3, direction: Vec3) -> Meeting {
    let (low, high) = field.bounds();
    let (t0, t1) = ((low - origin) / direction, (high - origin) / direction);
    let enter = t0.min(t1).max_element().max(0.0);
    let leave = t0.max(t1).min_element();
    // A ray in a face of the grid gives NaN and counts as a miss.
    if enter.is_nan() || leave.is_nan() || enter >= leave {
        return Meeting::Nowhere;
    }
    let metres_per_z = direction.length();
    let shortest = 0.5 * field.voxel() / metres_per_z;
    let value = |z: f32| field.sample(origin + z * direction);
    let (mut before, mut z) = (enter, enter);
    let mut closest = (enter, f32::NEG_INFINITY);
    while z <= leave {
        let f = value(z);
        if f >= 0.0 {
            return Meeting::Surface(refine(value, before, z));
        }
        if f > closest.1 {
            closest = (z, f);
        }
        before = z;
        // The field's slope is at most 1, up to the slant of a pixel off the optical axis.
        z += (-0.7 * f / metres_per_z).max(shortest);
    }
    Meeting::Closest { z: closest.0 }
}

/// The zero crossing of the value between `outside` and `inside`, by bisection to 1/64 of the step.
fn refine(value: impl Fn(f32) -> f32, mut outside: f32, mut inside: f32) -> f32 {
    for _ in 0..6 {
        let middle = 0.5 * (outside + inside);
        if value(middle) < 0.0 { outside = middle } else { inside = middle }
    }
    0.5 * (outside + inside)
}
