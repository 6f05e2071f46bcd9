//! Statistics of each Gaussian over the steps: the loss gradient by its position in the picture, and its size there.
//!
//! The renderer returns the gradient by centres in metres. With x and y the camera's axes, a centre's pixel is
//! (fx x/z, fy y/z), so that moving it along x at the same depth moves the pixel by fx/z alone: the
//! gradient by the pixel is z/fx times that by x. It still contains the effect of x on the shape in the picture,
//! through the projection's Jacobian, and on the colour, through the direction; both are small relative to that of the
//! position if the Gaussian is small relative to its distance. The authors' code measures from -1 to 1 across the
//! picture: times half its size.

use crate::symmetry::MirrorClone;
use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;
use vg_geometry::Camera;
use vg_splat::Gaussians;
use vg_splat::render::Gradients;
use vg_splat::render::options::{PROJECTION_MARGIN, RenderOptions};

/// Gaussians per task.
const CHUNK: usize = 1 << 10;

/// Sums over the steps since the last growth, for each original; a clone counts for its original.
#[derive(Clone, Debug, Default)]
pub(in crate::refine) struct Seen {
    /// Sum of the lengths of gradients, per half a picture. `[n]`
    gradients: Vec<f32>,
    /// The number of gradients in the sum. `[n]`
    times: Vec<u32>,
    /// Largest radius in a picture, pixels. `[n]`
    radii_px: Vec<f32>,
    /// Gradient and radius in the latest step of originals and clones that were in the picture. `[n + clones]`
    latest: Vec<Option<[f32; 2]>>,
}

impl Seen {
    /// Statistics of a single step.
    #[cfg(test)]
    pub(super) fn with(gradients: Vec<f32>, radii_px: Vec<f32>) -> Self {
        Self { times: vec![1; gradients.len()], gradients, radii_px, latest: Vec::new() }
    }

    /// Resets to `n` originals that no step has seen.
    pub(in crate::refine) fn reset(&mut self, n: usize) {
        self.gradients.clear();
        self.times.clear();
        self.radii_px.clear();
        self.gradients.resize(n, 0.0);
        self.times.resize(n, 0);
        self.radii_px.resize(n, 0.0);
    }

    /// Adds one step: the rendered Gaussians, originals before clones, and the gradients of all of them.
    pub(in crate::refine) fn note(
        &mut self,
        gaussians: &Gaussians,
        gradients: &Gradients,
        camera: &Camera,
        clones: &[MirrorClone],
    ) {
        let projection = Projection::new(camera);
        let all = (0..gaussians.len()).into_par_iter().with_min_len(CHUNK);
        all.map(|i| projection.measure(gaussians, i, gradients.means[i])).collect_into_vec(&mut self.latest);
        let n = gaussians.len() - clones.len();
        for (i, seen) in self.latest.iter().enumerate() {
            let Some([gradient, radius_px]) = *seen else { continue };
            let original = if i < n { i } else { clones[i - n].of as usize };
            self.gradients[original] += gradient;
            self.times[original] += 1;
            self.radii_px[original] = self.radii_px[original].max(radius_px);
        }
    }

    /// Mean gradient of an original over the pictures that it was in; 0 if it was in none.
    pub(super) fn gradient(&self, i: usize) -> f32 {
        self.gradients[i] / self.times[i].max(1) as f32
    }

    /// Largest radius in a picture, pixels.
    pub(super) fn radius_px(&self, i: usize) -> f32 {
        self.radii_px[i]
    }
}

/// A camera's projection, precomputed.
struct Projection {
    camera_from_vehicle: DMat3,
    center: DVec3,
    focal: DVec2,
    /// Range to which x/z and y/z are clamped for the Jacobian.
    least: DVec2,
    most: DVec2,
    principal: DVec2,
    size: DVec2,
    options: RenderOptions,
}

impl Projection {
    fn new(camera: &Camera) -> Self {
        let i = camera.intrinsics;
        let (focal, principal) = (DVec2::new(i.fx, i.fy), DVec2::new(i.cx, i.cy));
        let size = DVec2::new(camera.width.into(), camera.height.into());
        let margin = size * f64::from(PROJECTION_MARGIN);
        Self {
            camera_from_vehicle: camera.vehicle_from_camera.rotation.transpose(),
            center: camera.center(),
            focal,
            least: (-margin - principal) / focal,
            most: (size + margin - principal) / focal,
            principal,
            size,
            options: RenderOptions::default(),
        }
    }

    /// Gradient per half a picture and radius in pixels of Gaussian `i`; `None` if it is not in the picture. `of_mean`
    /// is the gradient of its centre.
    fn measure(&self, gaussians: &Gaussians, i: usize, of_mean: [f32; 3]) -> Option<[f32; 2]> {
        let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let p = self.camera_from_vehicle * (vector(gaussians.means()[i]) - self.center);
        if p.z < f64::from(self.options.near) {
            return None;
        }
        let ratio = p.truncate() / p.z;
        let pixel = self.focal * ratio + self.principal;
        // Columns of J W R S: the covariance in the picture is the sum of their squares.
        let at = ratio.clamp(self.least, self.most);
        let [w, x, y, z] = gaussians.rotations()[i].map(f64::from);
        let axes = self.camera_from_vehicle * DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
        let (mut xx, mut xy, mut yy) = (f64::from(self.options.blur), 0.0, f64::from(self.options.blur));
        for (axis, scale) in [axes.x_axis, axes.y_axis, axes.z_axis].into_iter().zip(gaussians.scales()[i]) {
            let column = self.focal * (axis.truncate() - at * axis.z) * (f64::from(scale) / p.z);
            (xx, xy, yy) = (xx + column.x * column.x, xy + column.x * column.y, yy + column.y * column.y);
        }
        let radius = 3.0 * (0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy)).sqrt();
        if (pixel + radius).cmplt(DVec2::ZERO).any() || (pixel - radius).cmpgt(self.size).any() {
            return None;
        }
        let of_point = self.camera_from_vehicle * vector(of_mean);
        let of_pixel = of_point.truncate() * p.z / self.focal;
        let gradient = (of_pixel * 0.5 * self.size).length();
        Some([gradient, radius].map(|v| v.min(f64::from(f32::MAX)) as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::{Intrinsics, Pose};
    use vg_splat::gaussians::buffer::Gaussian;
    use vg_splat::render::{CpuRenderer, Differentiable, PictureGradient, Renderer};

    fn camera() -> Camera {
        let i = Intrinsics { fx: 90.0, fy: 80.0, cx: 33.0, cy: 22.0 };
        let turn = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_x(0.2);
        let pose = Pose::new("pose", turn, -4.0 * turn.z_axis).unwrap();
        Camera::pinhole(64, 48, i, pose).unwrap()
    }

    fn blob(mean: [f32; 3], scale: f32) -> Gaussians {
        let mut g = Gaussians::default();
        let sh0 = [-1.0, 0.5, 1.0];
        g.push(&Gaussian { mean, rotation: [1.0, 0.0, 0.0, 0.0], scale: [scale; 3], opacity: 0.8, sh0 });
        g
    }

    #[test]
    fn the_gradient_by_the_pixel_equals_that_of_moving_the_picture() {
        // The loss is the sum of weights that grow along both axes times alpha: moving the blob by a pixel changes it
        // by the slope times all of its alpha.
        let (camera, gaussians) = (camera(), blob([0.1, -0.1, 0.2], 0.05));
        let renderer = CpuRenderer::new();
        let options = RenderOptions::default();
        let picture = renderer.render(&gaussians, &camera, &options).unwrap();
        let mut gradient = PictureGradient::default();
        gradient.reset(&picture);
        let slope = DVec2::new(0.3, -0.2);
        for (i, of) in gradient.alpha_mut().iter_mut().enumerate() {
            *of = (slope.x * (i % 64) as f64 + slope.y * (i / 64) as f64) as f32 * 1e-3;
        }
        let gradients = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
        let alpha: f64 = picture.alpha.iter().map(|a| f64::from(*a)).sum();
        let expected = 1e-3 * alpha * (slope * DVec2::new(32.0, 24.0)).length();
        let [found, _] = Projection::new(&camera).measure(&gaussians, 0, gradients.means[0]).unwrap();
        // The tolerance covers the shape's share of the gradient and the threshold on alpha.
        assert!((f64::from(found) / expected - 1.0).abs() < 0.03, "{found} {expected}");
    }

    #[test]
    fn gaussians_outside_the_picture_are_not_measured() {
        let measure = |mean: [f32; 3]| Projection::new(&camera()).measure(&blob(mean, 0.05), 0, [1.0; 3]);
        let eye = camera().center().as_vec3().to_array();
        assert!(measure([0.0; 3]).is_some() && measure(eye).is_none() && measure([30.0, 0.0, 0.0]).is_none());
        assert!(measure(eye.map(|c| 3.0 * c)).is_none());
        // A radius is three standard deviations.
        let [_, radius] = measure([0.0; 3]).unwrap();
        assert!((radius - 3.0 * (0.05f32 / 4.0 * 90.0).hypot(0.3f32.sqrt())).abs() < 0.1, "{radius}");
    }

    #[test]
    fn a_clones_gradient_counts_for_its_original() {
        let mut seen = Seen::default();
        let mut both = blob([0.1, 0.1, 0.0], 0.05);
        both.append(&blob([0.1, -0.1, 0.0], 0.05));
        let gradients = Gradients { means: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], ..Gradients::default() };
        seen.reset(1);
        seen.note(&both, &gradients, &camera(), &[MirrorClone { of: 0, gain: [1.0; 3] }]);
        assert_eq!(seen.times, [2]);
        assert!(seen.gradient(0) > 0.0 && seen.radius_px(0) > 3.0);
        seen.reset(2);
        assert!(seen.gradient(0) == 0.0 && seen.times == [0, 0]);
    }
}
