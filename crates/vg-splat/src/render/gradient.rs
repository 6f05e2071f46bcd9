//! Input and output of the backward pass: gradients of a scalar loss by the picture, and by everything it is drawn
//! from.
//!
//! Discrete decisions are constants: the depth order, the pixels that a Gaussian reaches, alpha < 1/255, the stop at
//! T <= 1e-4, near and far. Where a value is clamped its gradient is zero: alpha at `max_alpha`, colour at 0, the
//! antialiased compensation at its floor, x/z and y/z of the projection's Jacobian outside the image and its margin.

use crate::gaussians::Gaussians;
use crate::render::{RenderOptions, Rendered, Renderer};
use glam::{DMat3, DQuat, DVec3};
use vg_geometry::{Camera, Error, Pose, Result};

/// Gradient of a loss with respect to a picture's planes. An empty plane is one on which the loss does not depend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureGradient {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// dL / d `Rendered::color`. `[height * width]` or empty
    pub color: Vec<[f32; 3]>,
    /// dL / d `Rendered::alpha`. `[height * width]` or empty
    pub alpha: Vec<f32>,
    /// dL / d `Rendered::depth`, whatever its `DepthMode`. `[height * width]` or empty
    pub depth: Vec<f32>,
}

/// Gradient of a loss with respect to everything that a picture is drawn from; the arrays are laid out as those of
/// [`Gaussians`]. All numbers are finite: values beyond f32 become +-`f32::MAX`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradients {
    /// dL / d(mean), per metre. `[n][3]`
    pub means: Vec<[f32; 3]>,
    /// dL / d(quaternion) (w, x, y, z), as four free numbers that are normalised before use, so that it is
    /// perpendicular to the quaternion. `[n][4]`
    pub rotations: Vec<[f32; 4]>,
    /// dL / d(standard deviation), per metre. `[n][3]`
    pub scales: Vec<[f32; 3]>,
    /// dL / d(opacity). `[n]`
    pub opacities: Vec<f32>,
    /// dL / d(coefficient), zero in bands above `RenderOptions::sh_degree`. `[n][(degree + 1)^2][3]`
    pub sh: Vec<f32>,
    /// dL / d(background colour), zero for a transparent background.
    pub background: [f64; 3],
    /// Gradient of the camera's pose.
    pub pose: PoseGradient,
}

/// Gradient of a loss with respect to the camera's pose.
///
/// [`moved`](PoseGradient::moved) defines the six numbers: the camera turns by `rotation` and moves by `translation`,
/// both along its own axes (x right, y down, z forward).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseGradient {
    /// Gradient per radian about the camera's axes.
    pub rotation: DVec3,
    /// Gradient per metre along the camera's axes.
    pub translation: DVec3,
    /// dL / d(entry) of `camera_from_vehicle = [R | t; 0 0 0 1]` with all entries free, row by row, where
    /// `p_camera = R p_vehicle + t` and colour is seen from the centre `-R^T t`; the last row is zero.
    pub view_matrix: [[f64; 4]; 4],
}

impl PoseGradient {
    /// `vehicle_from_camera * exp([rotation, translation])` to first order, exact in the rotation: the right
    /// perturbation whose derivative at zero [`PoseGradient`] holds.
    pub fn moved(vehicle_from_camera: &Pose, rotation: DVec3, translation: DVec3) -> Pose {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(rotation));
        Pose {
            rotation: vehicle_from_camera.rotation * turn,
            translation: vehicle_from_camera.translation + vehicle_from_camera.rotation * translation,
        }
    }

    /// Makes the gradient from sums over Gaussians: dL/dR of `p = R (m - c)` at fixed centre c, dL/dp, and the part of
    /// dL/dc through the directions of colour.
    pub(crate) fn new(pose: &Pose, entries: DMat3, point: DVec3, center_of_directions: DVec3) -> Self {
        let r = pose.rotation.transpose();
        let c = pose.translation;
        // R(w) = exp(-[w]) R and c(v) = c + R^T v.
        let m = entries * pose.rotation;
        let at = |row: usize, column: usize| m.col(column)[row];
        let rotation = DVec3::new(at(1, 2) - at(2, 1), at(2, 0) - at(0, 2), at(0, 1) - at(1, 0));
        let translation = r * center_of_directions - point;

        // p = R m + t, and c = -R^T t in the directions.
        let t = -(r * c);
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let of_rotation = entries + outer(point, c) - outer(t, center_of_directions);
        let mut view_matrix = [[0.0; 4]; 4];
        for row in 0..3 {
            for column in 0..3 {
                view_matrix[row][column] = of_rotation.col(column)[row];
            }
            view_matrix[row][3] = -translation[row];
        }
        Self { rotation, translation, view_matrix }
    }
}

/// A differentiable renderer.
pub trait Differentiable: Renderer {
    /// Computes the gradients of the loss whose gradient with respect to the picture of these arguments is `gradient`.
    fn backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        gradient: &PictureGradient,
    ) -> Result<Gradients>;

    /// Renders a picture and computes the gradients of a loss of it, into memory that is reused; a renderer may share
    /// work between the two. `loss` adds to the picture's gradient, which has its size and no plane yet; its error ends
    /// the call. It is called once, or again by a renderer that starts over.
    ///
    /// After an error the contents of the targets are unspecified.
    fn forward_backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        (picture, picture_gradient, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: &mut dyn FnMut(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<()> {
        *picture = self.render(gaussians, camera, options)?;
        picture_gradient.reset(picture);
        loss(picture, picture_gradient)?;
        *gradients = self.backward(gaussians, camera, options, picture_gradient)?;
        Ok(())
    }
}

impl PictureGradient {
    /// A gradient of zeros, of a picture's size, with every plane.
    pub fn zeros(width: u32, height: u32) -> Self {
        let pixels = width as usize * height as usize;
        Self {
            width,
            height,
            color: vec![[0.0; 3]; pixels],
            alpha: vec![0.0; pixels],
            depth: vec![0.0; pixels],
        }
    }

    /// Resizes to `picture` and empties all planes, keeping their memory, before a loss adds its terms.
    pub fn reset(&mut self, picture: &Rendered) {
        (self.width, self.height) = (picture.width, picture.height);
        self.color.clear();
        self.alpha.clear();
        self.depth.clear();
    }

    /// The gradient of colour to add to; filled with zeros if the plane was empty.
    pub fn color_mut(&mut self) -> &mut [[f32; 3]] {
        self.color.resize(self.width as usize * self.height as usize, [0.0; 3]);
        &mut self.color
    }

    /// The gradient of alpha, as [`PictureGradient::color_mut`].
    pub fn alpha_mut(&mut self) -> &mut [f32] {
        self.alpha.resize(self.width as usize * self.height as usize, 0.0);
        &mut self.alpha
    }

    /// The gradient of depth, as [`PictureGradient::color_mut`].
    pub fn depth_mut(&mut self) -> &mut [f32] {
        self.depth.resize(self.width as usize * self.height as usize, 0.0);
        &mut self.depth
    }

    /// Fills empty planes with zeros.
    pub(crate) fn add_planes(&mut self) {
        self.color_mut();
        self.alpha_mut();
        self.depth_mut();
    }

    /// Checks that the planes have the camera's size or are empty, and are finite. Returns the largest magnitude in
    /// them.
    pub(crate) fn validate(&self, camera: &Camera) -> Result<f32> {
        let size = (camera.width, camera.height);
        if (self.width, self.height) != size {
            return Err(Error::argument(
                "gradient.size",
                format!("{}x{}", self.width, self.height),
                format!("{}x{}, the picture's", size.0, size.1),
            ));
        }
        let pixels = camera.width as usize * camera.height as usize;
        let color = largest("color", self.color.as_flattened(), 3, pixels)?;
        let alpha = largest("alpha", &self.alpha, 1, pixels)?;
        let depth = largest("depth", &self.depth, 1, pixels)?;
        Ok(color.max(alpha).max(depth))
    }
}

/// Returns the largest magnitude in a plane, or an error that names the first pixel that is not finite.
fn largest(plane: &str, values: &[f32], channels: usize, pixels: usize) -> Result<f32> {
    if !values.is_empty() && values.len() != pixels * channels {
        return Err(Error::argument(
            format!("gradient.{plane}"),
            format!("{} entries", values.len() / channels),
            format!("{pixels}, one per pixel, or none"),
        ));
    }
    // Magnitudes order like their bits, with NaN above infinity, so no branch per entry is needed.
    let bits = values.iter().fold(0, |largest: u32, v| largest.max(v.abs().to_bits()));
    if f32::from_bits(bits).is_finite() {
        return Ok(f32::from_bits(bits));
    }
    let first = values.iter().position(|v| !v.is_finite()).unwrap_or(0);
    Err(Error::argument(
        format!("gradient.{plane}[{}]", first / channels),
        values[first].to_string(),
        "finite numbers",
    ))
}

impl Gradients {
    /// Resizes the arrays for `gaussians`, keeping memory and old values.
    pub fn resize(&mut self, gaussians: &Gaussians) {
        let n = gaussians.len();
        self.means.resize(n, [0.0; 3]);
        self.rotations.resize(n, [0.0; 4]);
        self.scales.resize(n, [0.0; 3]);
        self.opacities.resize(n, 0.0);
        self.sh.resize(n * gaussians.sh_stride(), 0.0);
    }
}

/// Converts a gradient to f32, saturating at the largest finite number.
#[inline(always)]
pub(crate) fn narrow(v: f64) -> f32 {
    v.clamp(-f64::from(f32::MAX), f64::from(f32::MAX)) as f32
}
