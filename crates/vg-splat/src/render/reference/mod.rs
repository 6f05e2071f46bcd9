//! The reference renderer: method section 5 in f64, every pixel against every Gaussian, and its gradients.
//!
//! It shares no formula with the fast renderer: the covariance is multiplied out, its inverse is the plain conic (f64
//! has digits to spare), the order is a library sort, and the projection is differentiated by dual numbers. It is for
//! tests, and takes minutes for a large scene.

mod blend;
mod dual;
mod gradients;
mod project;

pub use blend::Cuts;
pub use gradients::ReferenceGradients;

use crate::gaussians::Gaussians;
use crate::render::{
    Background, Differentiable, Gradients, PictureGradient, RenderOptions, Rendered, Renderer, distorted,
};
use project::{Projected, Variables};
use vg_geometry::{Camera, Intrinsics, Result};

/// The brute-force renderer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reference;

/// A picture in f64.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferencePicture {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// RGB. `[height * width]`
    pub color: Vec<[f64; 3]>,
    /// 1 - transmittance. `[height * width]`
    pub alpha: Vec<f64>,
    /// Metres, see `DepthMode`. `[height * width]`
    pub depth: Vec<f64>,
}

/// Everything that a picture is drawn from, in f64, so that finite differences can vary it.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Centres, metres. `[n][3]`
    pub means: Vec<[f64; 3]>,
    /// Quaternions (w, x, y, z) of any norm. `[n][4]`
    pub rotations: Vec<[f64; 4]>,
    /// Standard deviations, metres. `[n][3]`
    pub scales: Vec<[f64; 3]>,
    /// `[n]`
    pub opacities: Vec<f64>,
    /// `[n][(sh_degree + 1)^2][3]`
    pub sh: Vec<f64>,
    /// Background colour, ignored where the options have a transparent background.
    pub background: [f64; 3],
    sh_degree: u8,
    /// The original position of the camera; it is subtracted first, so that a distant camera loses no digits.
    origin: [f64; 3],
    /// `[R | t]`, `p_camera = R (p_vehicle - origin) + t`.
    view: [[f64; 4]; 3],
    intrinsics: Intrinsics,
    width: u32,
    height: u32,
}

impl Parameters {
    /// The parameters for a pinhole camera (distortion is ignored); camera and options are validated.
    pub fn new(gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Result<Self> {
        camera.validate("camera")?;
        options.validate()?;
        let rows = camera.vehicle_from_camera.rotation.to_cols_array_2d();
        let background = match options.background {
            Background::Color(rgb) => rgb.map(f64::from),
            Background::Transparent => [0.0; 3],
        };
        Ok(Self {
            means: gaussians.means().iter().map(|m| m.map(f64::from)).collect(),
            rotations: gaussians.rotations().iter().map(|q| q.map(f64::from)).collect(),
            scales: gaussians.scales().iter().map(|s| s.map(f64::from)).collect(),
            opacities: gaussians.opacities().iter().map(|&o| o.into()).collect(),
            sh: gaussians.sh().iter().map(|&v| v.into()).collect(),
            background,
            sh_degree: gaussians.sh_degree(),
            origin: camera.center().to_array(),
            view: rows.map(|r| [r[0], r[1], r[2], 0.0]),
            intrinsics: camera.intrinsics,
            width: camera.width,
            height: camera.height,
        })
    }

    /// Adds `step` to one entry of `camera_from_vehicle`, row 0 to 2.
    pub fn move_view(&mut self, row: usize, column: usize, step: f64) {
        self.view[row][column] += step;
        if column < 3 {
            self.view[row][3] += step * self.origin[column];
        }
    }

    /// SH coefficients of Gaussian `i`.
    fn coefficients(&self, i: usize) -> &[f64] {
        let stride = 3 * crate::gaussians::sh::coefficients(self.sh_degree);
        &self.sh[i * stride..(i + 1) * stride]
    }

    /// Projects every Gaussian to the image plane; `None` where it is not between near and far.
    fn project(&self, options: &RenderOptions) -> Vec<Option<Projected<f64>>> {
        let variables = |i: usize| Variables {
            mean: self.means[i],
            rotation: self.rotations[i],
            scale: self.scales[i],
            opacity: self.opacities[i],
            view: self.view,
        };
        (0..self.means.len()).map(|i| project::project(self, i, &variables(i), options)).collect()
    }
}

impl Reference {
    /// Renders one picture of a pinhole camera in f64 (distortion is ignored); camera and options are validated.
    pub fn render_f64(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<ReferencePicture> {
        let parameters = Parameters::new(gaussians, camera, options)?;
        Ok(blend::picture(&parameters, options))
    }

    /// Computes gradients in f64 for a pinhole camera (distortion is ignored), of the loss whose gradient with respect
    /// to the picture is `gradient`.
    pub fn backward_f64(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        gradient: &PictureGradient,
    ) -> Result<ReferenceGradients> {
        let parameters = Parameters::new(gaussians, camera, options)?;
        gradient.validate(camera)?;
        Ok(gradients::backward(&parameters, options, gradient))
    }

    /// The layers drawn in each pixel and which of their alphas are clamped: finite differences must keep these fixed.
    pub fn cuts(&self, parameters: &Parameters, options: &RenderOptions) -> Cuts {
        Cuts::new(parameters, options)
    }

    /// Renders `parameters` with the cuts of others, which makes the picture a smooth function of the parameters.
    pub fn render_with_cuts(
        &self,
        parameters: &Parameters,
        options: &RenderOptions,
        cuts: &Cuts,
    ) -> ReferencePicture {
        cuts.picture(parameters, options)
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

impl Differentiable for Reference {
    fn backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        gradient: &PictureGradient,
    ) -> Result<Gradients> {
        if !camera.distortion.is_none() {
            return distorted::backward(self, gaussians, camera, options, gradient);
        }
        let g = self.backward_f64(gaussians, camera, options, gradient)?;
        Ok(g.narrowed(camera))
    }
}
