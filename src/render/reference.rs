//! The definition of a right picture: method section 5 in f64, every pixel against every Gaussian.
//!
//! It shares no formula with the fast renderer: the covariance is multiplied out, its inverse is the plain conic
//! (which in f64 has digits to spare), the order is a library sort. Minutes for a large scene; for tests.

use crate::error::Result;
use crate::gaussians::{Gaussians, sh};
use crate::geometry::Camera;
use crate::render::options::{MIN_COMPENSATION, PROJECTION_MARGIN, TRANSMITTANCE_THRESHOLD};
use crate::render::{Background, DepthMode, RenderOptions, Rendered, Renderer, distorted};
use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

/// The brute-force renderer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reference;

/// A picture with every digit that was computed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferencePicture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGB. `[height * width]`
    pub color: Vec<[f64; 3]>,
    /// 1 - transmittance. `[height * width]`
    pub alpha: Vec<f64>,
    /// Metres, see `DepthMode`. `[height * width]`
    pub depth: Vec<f64>,
}

/// A Gaussian on the image plane.
struct Projected {
    depth: f64,
    center: DVec2,
    /// Inverse covariance, 1 / pixels^2.
    conic: DMat2,
    opacity: f64,
    color: [f64; 3],
}

impl Reference {
    /// One picture in f64 of a pinhole camera (distortion is ignored); camera and options are validated.
    pub fn render_f64(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<ReferencePicture> {
        camera.validate("camera")?;
        options.validate()?;
        let mut splats: Vec<Projected> =
            (0..gaussians.len()).filter_map(|i| project(gaussians, i, camera, options)).collect();
        // Stable, by depth rounded to f32: ties are drawn in the order of storage.
        splats.sort_by(|a, b| (a.depth as f32).total_cmp(&(b.depth as f32)));

        let (width, height) = (camera.width as usize, camera.height as usize);
        let pixels: Vec<([f64; 3], f64, f64)> = (0..width * height)
            .into_par_iter()
            .with_min_len(width.min(64))
            .map(|i| {
                let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
                blend(&splats, pixel, options)
            })
            .collect();
        Ok(ReferencePicture {
            width: camera.width,
            height: camera.height,
            color: pixels.iter().map(|p| p.0).collect(),
            alpha: pixels.iter().map(|p| p.1).collect(),
            depth: pixels.iter().map(|p| p.2).collect(),
        })
    }
}

impl Renderer for Reference {
    fn render(&self, gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Result<Rendered> {
        if !camera.distortion.is_none() {
            return distorted::render(self, gaussians, camera, options);
        }
        let picture = self.render_f64(gaussians, camera, options)?;
        Ok(Rendered {
            width: picture.width,
            height: picture.height,
            color: picture.color.iter().map(|c| c.map(|v| v as f32)).collect(),
            alpha: picture.alpha.iter().map(|&v| v as f32).collect(),
            depth: picture.depth.iter().map(|&v| v as f32).collect(),
        })
    }
}

/// Gaussian `i` on the image plane, or `None` where its centre is not between near and far.
fn project(gaussians: &Gaussians, i: usize, camera: &Camera, options: &RenderOptions) -> Option<Projected> {
    let vector = |v: [f32; 3]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
    let mean = vector(gaussians.means()[i]);
    let camera_from_vehicle = camera.vehicle_from_camera.rotation.transpose();
    let p = camera_from_vehicle * (mean - camera.center());
    if !(p.z > f64::from(options.near) && p.z < f64::from(options.far)) {
        return None;
    }

    // Sigma = R S S^T R^T in the camera frame.
    let [w, x, y, z] = gaussians.rotations()[i].map(f64::from);
    let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    let half = camera_from_vehicle * rotation * DMat3::from_diagonal(vector(gaussians.scales()[i]));
    let covariance = half * half.transpose();

    // J of the pinhole at (x', y', z), the ray clamped to the image and 15 % around it.
    let k = camera.intrinsics;
    let clamped = |ratio: f64, f: f64, c: f64, size: u32| {
        let margin = f64::from(PROJECTION_MARGIN) * f64::from(size);
        p.z * ratio.clamp((0.0 - c - margin) / f, (f64::from(size) - c + margin) / f)
    };
    let x = clamped(p.x / p.z, k.fx, k.cx, camera.width);
    let y = clamped(p.y / p.z, k.fy, k.cy, camera.height);
    let row_x = DVec3::new(k.fx / p.z, 0.0, -k.fx * x / (p.z * p.z));
    let row_y = DVec3::new(0.0, k.fy / p.z, -k.fy * y / (p.z * p.z));
    let (a, b, c) =
        (row_x.dot(covariance * row_x), row_x.dot(covariance * row_y), row_y.dot(covariance * row_y));

    let blur = f64::from(options.blur);
    let blurred = DMat2::from_cols(DVec2::new(a + blur, b), DVec2::new(b, c + blur));
    // The blur's own determinant is the smallest that can be; rounding may not go below it.
    let determinant = ((a + blur) * (c + blur) - b * b).max(blur * blur);
    let adjugate = DMat2::from_cols(
        DVec2::new(blurred.y_axis.y, -blurred.x_axis.y),
        DVec2::new(-blurred.y_axis.x, blurred.x_axis.x),
    );
    let mut opacity = f64::from(gaussians.opacities()[i]);
    if options.antialiased {
        let ratio = ((a * c - b * b) / determinant).max(f64::from(MIN_COMPENSATION).powi(2));
        opacity *= ratio.sqrt();
    }

    let stride = gaussians.sh_stride();
    let direction = (mean - camera.center()).normalize_or_zero().to_array();
    let degree = options.sh_degree.min(gaussians.sh_degree());
    Some(Projected {
        depth: p.z,
        center: DVec2::new(k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy),
        conic: adjugate * (1.0 / determinant),
        opacity,
        color: sh::color(&gaussians.sh()[i * stride..(i + 1) * stride], direction, degree),
    })
}

/// Colour, alpha and depth of one pixel.
fn blend(splats: &[Projected], pixel: DVec2, options: &RenderOptions) -> ([f64; 3], f64, f64) {
    let mut transmittance = 1.0;
    let mut color = [0.0; 3];
    let mut depth = 0.0;
    for splat in splats {
        let d = pixel - splat.center;
        let sigma = 0.5 * d.dot(splat.conic * d);
        // e^-6 is below 1/255: what follows could not be drawn.
        if !(0.0..=6.0).contains(&sigma) {
            continue;
        }
        let alpha = (splat.opacity * (-sigma).exp()).min(f64::from(options.max_alpha));
        if alpha < 1.0 / 255.0 {
            continue;
        }
        let next = transmittance * (1.0 - alpha);
        if next <= f64::from(TRANSMITTANCE_THRESHOLD) {
            break;
        }
        for c in 0..3 {
            color[c] += transmittance * alpha * splat.color[c];
        }
        depth += transmittance * alpha * splat.depth;
        transmittance = next;
    }
    if let Background::Color(rgb) = options.background {
        for c in 0..3 {
            color[c] += transmittance * f64::from(rgb[c]);
        }
    }
    let alpha = 1.0 - transmittance;
    if options.depth_mode == DepthMode::Expected {
        depth = if alpha > 0.0 { depth / alpha } else { 0.0 };
    }
    (color, alpha, depth)
}
