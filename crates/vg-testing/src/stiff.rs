//! Small random scenes that combine all difficult cases of a backward pass, each with options and a picture gradient.

use super::Random;
use glam::{DMat3, DQuat, DVec3};
use vg::geometry::camera::Intrinsics;
use vg::render::{Background, DepthMode, PictureGradient, RenderOptions};
use vg::{Camera, Gaussians, Pose};

pub struct Stiff {
    pub gaussians: Gaussians,
    pub camera: Camera,
    pub options: RenderOptions,
    pub gradient: PictureGradient,
}

/// Scene number `seed`: SH degree `seed % 4`, antialiased every third.
pub fn stiff(seed: u64) -> Stiff {
    let mut r = Random::new(1000 + seed);
    let (width, height) = (r.uniform(20.0, 44.0) as u32, r.uniform(14.0, 34.0) as u32);
    let sh_degree = (seed % 4) as u8;
    let camera = camera(&mut r, width, height);
    let options = RenderOptions {
        background: match seed % 5 {
            0 => Background::Transparent,
            _ => Background::Color([0; 3].map(|_| r.uniform(0.0, 1.0) as f32)),
        },
        antialiased: seed.is_multiple_of(3),
        blur: if seed.is_multiple_of(7) { 0.1 } else { 0.3 },
        max_alpha: if seed.is_multiple_of(2) { 0.99 } else { 0.999 },
        sh_degree: if seed % 6 == 1 { 1 } else { 3 },
        depth_mode: if seed % 4 < 2 { DepthMode::Accumulated } else { DepthMode::Expected },
        ..RenderOptions::default()
    };
    let pixels = (width * height) as usize;
    let mut plane = |n: usize| (0..n).map(|_| r.normal() as f32).collect::<Vec<f32>>();
    let gradient = PictureGradient {
        width,
        height,
        color: plane(3 * pixels).as_chunks::<3>().0.to_vec(),
        alpha: if seed % 8 == 3 { Vec::new() } else { plane(pixels) },
        depth: if seed % 8 == 5 { Vec::new() } else { plane(pixels) },
    };
    Stiff { gaussians: gaussians(&mut r, sh_degree, &camera), camera, options, gradient }
}

/// A camera some metres from the origin that looks past it, with its principal point off centre.
fn camera(r: &mut Random, width: u32, height: u32) -> Camera {
    let eye = DVec3::new(r.normal(), r.normal(), r.normal()).normalize() * r.uniform(2.0, 9.0);
    let z = (DVec3::new(r.normal(), r.normal(), r.normal()) * 0.3 - eye).normalize();
    let x = z.cross(DVec3::new(0.2, 0.1, 0.97)).normalize();
    let rotation = DMat3::from_cols(x, z.cross(x), z);
    let f = f64::from(width) * r.uniform(0.6, 2.0);
    let intrinsics = Intrinsics {
        fx: f,
        fy: f * r.uniform(0.9, 1.1),
        cx: f64::from(width) * r.uniform(0.3, 0.7),
        cy: f64::from(height) * r.uniform(0.3, 0.7),
    };
    Camera::pinhole(width, height, intrinsics, Pose { rotation, translation: eye }).unwrap()
}

fn gaussians(r: &mut Random, sh_degree: u8, camera: &Camera) -> Gaussians {
    let n = r.uniform(8.0, 40.0) as usize;
    let mut out = Arrays::default();
    for _ in 0..n {
        let log = |r: &mut Random, low: f64, high: f64| r.uniform(low.ln(), high.ln()).exp();
        let kind = r.uniform(0.0, 12.0) as u32;
        let mut mean = DVec3::new(r.normal(), r.normal(), r.normal()) * 0.8;
        let mut scale = [0; 3].map(|_| log(r, 0.02, 0.5));
        let mut opacity = r.uniform(0.05, 0.95);
        match kind {
            // Needles and discs.
            0 => scale = [1e-4, 1e-4, log(r, 0.3, 3.0)],
            1 => scale = [log(r, 0.1, 1.0), log(r, 0.1, 1.0), 1e-6],
            2 => scale = [1e-10, 3.0, 1e-10],
            // Tiny and huge Gaussians.
            3 => scale = [1e-8; 3],
            4 => scale = [3.0, 2.0, 1.0],
            // A sphere, whose orientation has no effect.
            5 => scale = [0.2; 3],
            6 => opacity = r.uniform(1.0 / 255.0, 0.02),
            7 => opacity = r.uniform(0.98, 1.0),
            // At the near plane, outside the picture, around the camera.
            8 => {
                let z = log(r, 0.02, 0.3);
                mean = in_camera(camera, DVec3::new(0.2 * r.normal() * z, 0.2 * r.normal() * z, z));
                scale = [0; 3].map(|_| log(r, 0.1, 1.0) * z);
            }
            9 => {
                let z = r.uniform(0.5, 5.0);
                mean = in_camera(camera, DVec3::new(1.5 * z, r.normal() * z, z));
                scale = [0; 3].map(|_| log(r, 0.2, 1.5));
            }
            10 => {
                mean = camera.center() + DVec3::new(r.normal(), r.normal(), r.normal()) * 0.3;
                scale = [0; 3].map(|_| log(r, 0.3, 1.5));
            }
            _ => {}
        }
        let q = [0; 4].map(|_| r.normal() as f32);
        let sh: Vec<f32> = (0..3 * (usize::from(sh_degree) + 1).pow(2))
            .map(|k| (r.normal() * if k < 3 { 1.0 } else { 0.3 }) as f32)
            .collect();
        out.push(mean, q, scale, opacity, &sh);
        if kind == 11 {
            // Twice the same position and orientation, as in copies of a disc.
            out.push(mean, q, scale, r.uniform(0.1, 0.9), &sh);
        }
    }
    Gaussians::from_arrays(sh_degree, out.means, out.rotations, out.scales, out.opacities, out.sh).unwrap()
}

fn in_camera(camera: &Camera, p: DVec3) -> DVec3 {
    camera.vehicle_from_camera.transform_point(p)
}

#[derive(Default)]
struct Arrays {
    means: Vec<[f32; 3]>,
    rotations: Vec<[f32; 4]>,
    scales: Vec<[f32; 3]>,
    opacities: Vec<f32>,
    sh: Vec<f32>,
}

impl Arrays {
    fn push(&mut self, mean: DVec3, q: [f32; 4], scale: [f64; 3], opacity: f64, sh: &[f32]) {
        self.means.push(mean.to_array().map(|v| v as f32));
        let unit = DQuat::from_xyzw(q[1].into(), q[2].into(), q[3].into(), q[0].into()).normalize();
        self.rotations.push([unit.w, unit.x, unit.y, unit.z].map(|v| v as f32));
        self.scales.push(scale.map(|v| v as f32));
        self.opacities.push(opacity as f32);
        self.sh.extend(sh);
    }
}
