//! Pictures of cameras with a lens: a finer pinhole picture that covers them, resampled along the lens's rays.
//!
//! The pinhole picture is drawn [`SUPERSAMPLING`] times finer with the blur scaled accordingly, so that it samples the
//! same continuous picture, and is read bilinearly. Colour is read premultiplied by alpha, and depth as the accumulated
//! sum of T alpha z, divided by the resampled alpha in the end. These sums are linear, so interpolation is exact
//! between neighbouring pixels, and empty neighbours do not pull depth towards 0.

use super::{
    Background, DepthMode, Differentiable, Gradients, PictureGradient, RenderOptions, Rendered, Renderer,
};
use crate::gaussians::Gaussians;
use rayon::prelude::*;
use vg_geometry::camera::MAX_SIDE;
use vg_geometry::resample::{Taps, pinhole_for};
use vg_geometry::{Camera, Result};

/// Pinhole pixels per pixel and axis. Interpolation at this spacing preserves the peak of the smallest splat, whose
/// standard deviation is sqrt(0.3) pixels, to 10 %, and its centroid and sum exactly.
pub const SUPERSAMPLING: f64 = 2.0;

/// Largest magnitude of a gradient's entries when it is scattered.
const LARGEST: f32 = 1e34;

/// Largest blur that the options accept, pixels^2.
const MAX_BLUR: f32 = 100.0;

/// Position of each pixel of a distorted camera in its pinhole picture.
#[derive(Clone, Debug)]
pub(super) struct LensMap {
    source: Camera,
    pinhole: Camera,
    /// Position in pinhole pixels; NaN where the lens has no ray. `[height * width]`
    positions: Vec<[f32; 2]>,
}

impl LensMap {
    /// Builds the map of one lens; the camera's pose is ignored.
    pub(super) fn new(source: &Camera) -> Result<Self> {
        let cover = pinhole_for(source)?;
        let side = f64::from(cover.width.max(cover.height));
        let scale = SUPERSAMPLING.min(f64::from(MAX_SIDE) / side);
        let size = |n: u32| (f64::from(n) * scale).round().clamp(1.0, f64::from(MAX_SIDE)) as u32;
        let pinhole = cover.scaled_to(size(cover.width), size(cover.height));
        let (width, height) = (source.width as usize, source.height as usize);
        let position = |i: usize| {
            let pixel = [(i % width) as f64 + 0.5, (i / width) as f64 + 0.5];
            let ray = source.ray(pixel)?;
            let p = pinhole.intrinsics.pixel_from_normalized([ray.x, ray.y]);
            let inside = (0.0..=f64::from(pinhole.width)).contains(&p[0])
                && (0.0..=f64::from(pinhole.height)).contains(&p[1]);
            inside.then_some(p.map(|v| v as f32))
        };
        let positions =
            (0..width * height).into_par_iter().map(|i| position(i).unwrap_or([f32::NAN; 2])).collect();
        Ok(Self { source: *source, pinhole, positions })
    }

    /// Whether this map fits the lens and size of `camera`.
    pub(super) fn fits(&self, camera: &Camera) -> bool {
        Camera { vehicle_from_camera: self.source.vehicle_from_camera, ..*camera } == self.source
    }

    /// Renders the picture of `camera`, which this map fits.
    pub(super) fn render(
        &self,
        renderer: &impl Renderer,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Rendered> {
        self.render_with(camera, options, |pinhole, fine| renderer.render(gaussians, pinhole, fine))
    }

    /// As [`LensMap::render`], where `draw` makes the pinhole picture.
    pub(super) fn render_with(
        &self,
        camera: &Camera,
        options: &RenderOptions,
        draw: impl FnOnce(&Camera, &RenderOptions) -> Result<Rendered>,
    ) -> Result<Rendered> {
        let (pinhole, fine) = self.pinhole(camera, options);
        let mut out = Rendered::default();
        self.resample(&draw(&pinhole, &fine)?, options, &mut out);
        Ok(out)
    }

    /// The camera and options of the pinhole picture that is resampled.
    pub(super) fn pinhole(&self, camera: &Camera, options: &RenderOptions) -> (Camera, RenderOptions) {
        let pinhole = Camera { vehicle_from_camera: camera.vehicle_from_camera, ..self.pinhole };
        // Focal lengths in pixels grow by this factor, the blur in pixels^2 by its square.
        let scale = pinhole.intrinsics.fx / camera.intrinsics.fx;
        let fine = RenderOptions {
            background: Background::Transparent,
            depth_mode: DepthMode::Accumulated,
            blur: ((f64::from(options.blur) * scale * scale) as f32).min(MAX_BLUR),
            ..*options
        };
        (pinhole, fine)
    }

    /// Resamples the pinhole picture `fine` to the lens's picture.
    pub(super) fn resample(&self, fine: &Rendered, options: &RenderOptions, out: &mut Rendered) {
        let pixels = self.positions.len();
        (out.width, out.height) = (self.source.width, self.source.height);
        out.color.resize(pixels, [0.0; 3]);
        out.alpha.resize(pixels, 0.0);
        out.depth.resize(pixels, 0.0);
        let planes = out.color.par_iter_mut().zip(&mut out.alpha).zip(&mut out.depth);
        planes.zip(&self.positions).with_min_len(1 << 12).for_each(|(((color, alpha), depth), position)| {
            let ([r, g, b], a, d) = sample(fine, *position);
            let behind = match options.background {
                Background::Color(rgb) => rgb.map(|v| v * (1.0 - a)),
                Background::Transparent => [0.0; 3],
            };
            *color = [r + behind[0], g + behind[1], b + behind[2]];
            *alpha = a;
            *depth = match options.depth_mode {
                DepthMode::Expected if a > 0.0 => d / a,
                DepthMode::Expected => 0.0,
                DepthMode::Accumulated => d,
            };
        });
    }

    /// Evaluates a loss of the lens's picture and writes its gradient by the pinhole picture `fine` to `fine_gradient`.
    /// Returns the gradient of the background.
    pub(super) fn loss(
        &self,
        options: &RenderOptions,
        (fine, fine_gradient): (&Rendered, &mut PictureGradient),
        (picture, picture_gradient): (&mut Rendered, &mut PictureGradient),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<f32>,
    ) -> Result<[f64; 3]> {
        self.resample(fine, options, picture);
        loss(picture, picture_gradient)?;
        fine_gradient.reset(fine);
        Ok(self.scatter(picture, options, picture_gradient, fine_gradient))
    }

    /// The adjoint of [`LensMap::resample`]: scatters the gradient of the lens's `picture` with the weights that it was
    /// read with. Returns the gradient of the background.
    ///
    /// Runs on one thread, in the order of the lens's pixels.
    pub(super) fn scatter(
        &self,
        picture: &Rendered,
        options: &RenderOptions,
        gradient: &PictureGradient,
        fine: &mut PictureGradient,
    ) -> [f64; 3] {
        let (width, height) = (fine.width, fine.height);
        fine.add_planes();
        let PictureGradient { color: color_plane, alpha: alpha_plane, depth: depth_plane, .. } = fine;
        let mut background = [0.0; 3];
        let behind = match options.background {
            Background::Color(rgb) => Some(rgb),
            Background::Transparent => None,
        };
        for (i, position) in self.positions.iter().enumerate() {
            let a = picture.alpha[i];
            let color = gradient.color.get(i).copied().unwrap_or([0.0; 3]);
            let mut alpha = gradient.alpha.get(i).copied().unwrap_or(0.0);
            let mut depth = gradient.depth.get(i).copied().unwrap_or(0.0);
            if let Some(behind) = behind {
                for c in 0..3 {
                    alpha -= color[c] * behind[c];
                    background[c] += f64::from(color[c]) * f64::from(1.0 - a);
                }
            }
            if options.depth_mode == DepthMode::Expected {
                // d(D/A) = (dD - D/A dA) / A.
                depth = if a > 0.0 { depth / a } else { 0.0 };
                alpha -= depth * picture.depth[i];
            }
            if position[0].is_nan() {
                continue;
            }
            // A gradient near the limit of f32 saturates, so that the sums of its neighbours stay finite.
            let (alpha, depth) = (alpha.clamp(-LARGEST, LARGEST), depth.clamp(-LARGEST, LARGEST));
            let color = color.map(|v| v.clamp(-LARGEST, LARGEST));
            let taps = Taps::new(*position, width, height);
            for (at, weight) in taps.index.into_iter().zip(taps.weights()) {
                for c in 0..3 {
                    color_plane[at][c] += weight * color[c];
                }
                alpha_plane[at] += weight * alpha;
                depth_plane[at] += weight * depth;
            }
        }
        background
    }
}

/// Renders one picture of a camera with a lens, by a renderer of pinhole cameras. A pixel without a ray, or whose ray
/// leaves the widest pinhole that is drawn, shows the background.
pub fn render(
    renderer: &impl Renderer,
    gaussians: &Gaussians,
    camera: &Camera,
    options: &RenderOptions,
) -> Result<Rendered> {
    camera.validate("camera")?;
    options.validate()?;
    LensMap::new(camera)?.render(renderer, gaussians, camera, options)
}

/// Computes gradients through a lens, by a differentiable renderer of pinhole cameras.
pub(super) fn backward(
    renderer: &impl Differentiable,
    gaussians: &Gaussians,
    camera: &Camera,
    options: &RenderOptions,
    gradient: &PictureGradient,
) -> Result<Gradients> {
    camera.validate("camera")?;
    options.validate()?;
    gradient.validate(camera)?;
    let map = LensMap::new(camera)?;
    let (pinhole, fine) = map.pinhole(camera, options);
    let fine_picture = renderer.render(gaussians, &pinhole, &fine)?;
    let (mut picture, mut fine_gradient) = (Rendered::default(), PictureGradient::default());
    map.resample(&fine_picture, options, &mut picture);
    fine_gradient.reset(&fine_picture);
    let background = map.scatter(&picture, options, gradient, &mut fine_gradient);
    let gradients = renderer.backward(gaussians, &pinhole, &fine, &fine_gradient)?;
    Ok(Gradients { background, ..gradients })
}

/// Premultiplied colour, alpha and accumulated depth, interpolated bilinearly with repeated edges; zero at NaN.
fn sample(picture: &Rendered, position: [f32; 2]) -> ([f32; 3], f32, f32) {
    if position[0].is_nan() {
        return ([0.0; 3], 0.0, 0.0);
    }
    let taps = Taps::new(position, picture.width, picture.height);
    let mut color = [0.0; 3];
    let (mut alpha, mut depth) = (0.0, 0.0);
    for (i, weight) in taps.index.into_iter().zip(taps.weights()) {
        for c in 0..3 {
            color[c] += weight * picture.color[i][c];
        }
        alpha += weight * picture.alpha[i];
        depth += weight * picture.depth[i];
    }
    (color, alpha, depth)
}
