//! Scenes to render.

use super::Random;
use glam::{DMat3, DVec3};
use vg::geometry::camera::Intrinsics;
use vg::{Camera, Gaussians, Pose};

/// A camera `distance` metres from the origin that looks at it, the image's horizontal field of view 50 degrees.
pub fn looking_at_origin(width: u32, height: u32, direction: DVec3, distance: f64) -> Camera {
    let eye = direction.normalize() * distance;
    let z = -eye.normalize();
    let x = z.cross(DVec3::Z).normalize();
    let rotation = DMat3::from_cols(x, z.cross(x), z);
    let f = 0.5 * f64::from(width) / 25f64.to_radians().tan();
    let intrinsics = Intrinsics { fx: f, fy: f, cx: 0.5 * f64::from(width), cy: 0.5 * f64::from(height) };
    Camera::pinhole(width, height, intrinsics, Pose { rotation, translation: eye }).unwrap()
}

/// `n` Gaussians of any orientation in the box of a car; scales log-uniform in `scales` metres.
pub fn random(seed: u64, n: usize, sh_degree: u8, scales: [f64; 2]) -> Gaussians {
    let mut r = Random::new(seed);
    let coefficients = 3 * (usize::from(sh_degree) + 1).pow(2);
    let mut means = Vec::new();
    let mut rotations = Vec::new();
    let mut sizes = Vec::new();
    let mut opacities = Vec::new();
    let mut sh = Vec::new();
    for _ in 0..n {
        means.push([2.2, 0.9, 0.7].map(|a| r.uniform(-a, a) as f32));
        rotations.push([0; 4].map(|_| r.normal() as f32));
        sizes.push([0; 3].map(|_| r.uniform(scales[0].ln(), scales[1].ln()).exp() as f32));
        opacities.push(r.uniform(0.0, 1.0) as f32);
        sh.extend((0..coefficients).map(|k| (r.normal() * if k < 3 { 1.0 } else { 0.2 }) as f32));
    }
    Gaussians::from_arrays(sh_degree, means, rotations, sizes, opacities, sh).unwrap()
}
