//! Scenes to render.

use super::Random;
use glam::{DMat3, DQuat, DVec3};
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

/// A camera at the origin that looks along +x of the vehicle, z up.
pub fn forward(width: u32, height: u32, focal: f64) -> Camera {
    let rotation = DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_Z, DVec3::X);
    let (cx, cy) = (0.5 * f64::from(width), 0.5 * f64::from(height));
    let intrinsics = Intrinsics { fx: focal, fy: focal, cx, cy };
    Camera::pinhole(width, height, intrinsics, Pose { rotation, translation: DVec3::ZERO }).unwrap()
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

/// A shell of `n` discs, 1 cm by 1 cm by 1 mm, spread evenly over an ellipsoid of 4.5 x 1.8 x 1.5 m; opacity 0.5 to
/// 0.98; SH degree 3.
pub fn surfel_car(n: usize) -> Gaussians {
    const AXES: DVec3 = DVec3::new(2.25, 0.90, 0.75);
    let mut r = Random::new(0);
    let (mut means, mut rotations, mut opacities) = (Vec::new(), Vec::new(), Vec::new());
    let mut sh = Vec::with_capacity(48 * n);
    while means.len() < n {
        let u = DVec3::new(r.normal(), r.normal(), r.normal()).normalize();
        // The area element over its maximum.
        if r.uniform(0.0, 1.0) >= (u / AXES).length() * AXES.min_element() {
            continue;
        }
        let p = u * AXES;
        let normal = (u / AXES).normalize();
        let tangent = normal.cross(DVec3::new(r.normal(), r.normal(), r.normal())).normalize();
        let q = DQuat::from_mat3(&DMat3::from_cols(tangent, normal.cross(tangent), normal));
        means.push(p.to_array().map(|v| v as f32));
        rotations.push([q.w, q.x, q.y, q.z].map(|v| v as f32));
        opacities.push(r.uniform(0.5, 0.98) as f32);
        let wave = |k: usize| (p[k] * [6.0, 9.0, 11.0][k] + k as f64).sin();
        sh.extend([0, 1, 2].map(|k| (0.35 * wave(k) / f64::from(vg::gaussians::sh::Y0)) as f32));
        sh.extend((3..48).map(|_| (0.04 * r.normal()) as f32));
    }
    let scales = vec![[0.01, 0.01, 0.001]; n];
    Gaussians::from_arrays(3, means, rotations, scales, opacities, sh).unwrap()
}
