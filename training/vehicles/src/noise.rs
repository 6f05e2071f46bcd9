//! Errors of real poses and masks.

use crate::cameras::{HEIGHT, WIDTH};
use glam::{DMat3, DVec3};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use vg::geometry::{Camera, Pose};

/// Amounts of error in one scene.
pub struct Noise {
    turn: f64,
    shift: f64,
    plane_yaw: f64,
    plane_offset: f64,
    /// Pixels by which every mask is too large (or, if negative, too small).
    grown: i32,
    /// Probability that an object stands in front of the vehicle in a view.
    occluded: f64,
}

impl Noise {
    pub fn draw(rng: &mut impl Rng) -> Self {
        let level: f64 = if rng.random_bool(0.4) { 0.0 } else { rng.random_range(0.0f64..1.0).powi(2) };
        let plane: f64 = if rng.random_bool(0.6) { 0.0 } else { rng.random_range(0.0..1.0) };
        let normal = |rng: &mut _| -> f64 { StandardNormal.sample(rng) };
        Self {
            turn: (0.4 * level).to_radians(),
            shift: 0.04 * level,
            plane_yaw: plane * normal(rng) * 0.8f64.to_radians(),
            plane_offset: plane * normal(rng) * 0.02,
            grown: match rng.random_range(0..20) {
                0..2 => -1,
                2..4 => 1,
                4 => 2,
                _ => 0,
            },
            occluded: if rng.random_bool(0.08) { 0.4 } else { 0.0 },
        }
    }

    /// The camera with the errors of its pose.
    pub fn noisy_camera(&self, camera: &Camera, rng: &mut impl Rng) -> Camera {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let axis = DVec3::new(normal(), normal(), normal()) * self.turn;
        let turn = DMat3::from_axis_angle(axis.normalize_or(DVec3::X), axis.length());
        let shift = DVec3::new(normal(), normal(), normal()) * self.shift;
        let yaw = DMat3::from_rotation_z(self.plane_yaw);
        let pose = camera.vehicle_from_camera;
        let noisy = Pose {
            rotation: yaw * pose.rotation * turn,
            translation: yaw * (pose.translation + shift) + DVec3::Y * self.plane_offset,
        };
        Camera { vehicle_from_camera: noisy, ..*camera }
    }

    /// The mask with its errors. `[height * width]`
    pub fn mask(&self, seen: &[f32], rng: &mut impl Rng) -> Vec<u8> {
        let mut mask: Vec<u8> = seen.iter().map(|z| if *z > 0.0 { 255 } else { 0 }).collect();
        for _ in 0..self.grown.abs() {
            mask = grown(&mask, self.grown > 0);
        }
        if rng.random_bool(self.occluded) {
            occlude(&mut mask, rng);
        }
        mask
    }
}

/// The mask, one pixel larger or smaller.
fn grown(mask: &[u8], larger: bool) -> Vec<u8> {
    let (w, h) = (WIDTH as usize, HEIGHT as usize);
    let at = |u: usize, v: usize| mask[v * w + u];
    (0..w * h)
        .map(|i| {
            let (u, v) = (i % w, i / w);
            let around = [
                at(u.saturating_sub(1), v),
                at((u + 1).min(w - 1), v),
                at(u, v.saturating_sub(1)),
                at(u, (v + 1).min(h - 1)),
            ];
            around.into_iter().fold(at(u, v), |a, b| if larger { a.max(b) } else { a.min(b) })
        })
        .collect()
}

/// Covers a part of the mask: a bush along the bottom, a post, the end of another vehicle.
fn occlude(mask: &mut [u8], rng: &mut impl Rng) {
    let (w, h) = (WIDTH as usize, HEIGHT as usize);
    let rows: Vec<usize> = (0..h).filter(|v| mask[v * w..(v + 1) * w].contains(&255)).collect();
    let columns: Vec<usize> = (0..w).filter(|u| (0..h).any(|v| mask[v * w + u] > 0)).collect();
    let (Some(&top), Some(&bottom), Some(&left), Some(&right)) =
        (rows.first(), rows.last(), columns.first(), columns.last())
    else {
        return;
    };
    let span = |from: usize, to: usize, a: f32| from + ((to - from) as f32 * a) as usize;
    let (u0, u1, v0, v1) = match rng.random_range(0..3) {
        0 => (0, w, span(top, bottom, rng.random_range(0.75..0.98)), h),
        1 => {
            let u = span(left, right, rng.random_range(0.1..0.9));
            (u, (u + rng.random_range(2..14)).min(w), 0, h)
        }
        _ => {
            let u = span(left, right, rng.random_range(0.0..0.35));
            if rng.random_bool(0.5) { (0, u, 0, h) } else { (w - 1 - u.min(w - 1), w, 0, h) }
        }
    };
    for v in v0..v1 {
        mask[v * w + u0..v * w + u1].fill(0);
    }
}
