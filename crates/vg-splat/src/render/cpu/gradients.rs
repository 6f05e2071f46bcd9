//! Pictures with their gradients: the forward and backward pass share one projection, one sort and one set of lists.

use super::backward::{self, BackwardTimes};
use super::simd::Lanes;
use super::{CpuRenderer, Job, Level, Scratch, StageTimes, Watched};
use crate::gaussians::Gaussians;
use crate::render::{Differentiable, Gradients, PictureGradient, RenderOptions, Rendered};
use std::time::{Duration, Instant};
use vg_geometry::progress::UNWATCHED;
use vg_geometry::{Camera, Result};

/// Wall time of each stage of a picture and its gradients.
#[derive(Clone, Copy, Debug, Default)]
pub struct GradientTimes {
    /// Drawing the picture.
    pub forward: StageTimes,
    /// Evaluating the loss, and checking its gradient.
    pub loss: Duration,
    /// The backward pass.
    pub backward: BackwardTimes,
}

impl CpuRenderer {
    /// Renders a picture and computes the gradients of a loss of it. `loss` returns the loss's gradient with respect to
    /// the picture, which must be finite; an error of its own ends the call.
    pub fn render_with_gradients(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        loss: impl FnOnce(&Rendered) -> Result<PictureGradient>,
    ) -> Result<(Rendered, Gradients)> {
        let (mut picture, mut gradients) = (Rendered::default(), Gradients::default());
        let mut picture_gradient = PictureGradient::default();
        let loss = |picture: &Rendered, gradient: &mut PictureGradient| {
            *gradient = loss(picture)?;
            Ok(())
        };
        let targets = (&mut picture, &mut picture_gradient, &mut gradients);
        self.render_with_gradients_into(gaussians, camera, options, targets, loss)?;
        Ok((picture, gradients))
    }

    /// As [`CpuRenderer::render_with_gradients`], into memory that is reused. `loss` adds to the gradient of the
    /// picture, which has its size and no plane yet. The times are those of a pinhole camera's stages, and zero through
    /// a lens.
    ///
    /// After an error the contents of the targets are unspecified.
    pub fn render_with_gradients_into(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        (picture, picture_gradient, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<GradientTimes> {
        let targets = (picture, picture_gradient, gradients);
        self.watched(&UNWATCHED).forward_backward_with(gaussians, camera, options, targets, loss)
    }

    /// Continues the backward pass from the pixels' sums for each Gaussian, computed elsewhere; the camera is valid and
    /// has no lens.
    #[cfg(feature = "gpu")]
    pub(in crate::render) fn backward_to_gaussians(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        shares: &backward::Shares,
        decided: impl Fn(usize) -> backward::Decided + Sync,
        out: &mut Gradients,
    ) {
        match self.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => {
                backward::backward_to_gaussians(simd, gaussians, camera, options, shares, decided, out);
            }
            Level::Portable(simd) => {
                backward::backward_to_gaussians(simd, gaussians, camera, options, shares, decided, out);
            }
        }
    }
}

impl Watched<'_> {
    /// See [`CpuRenderer::render_with_gradients_into`].
    fn forward_backward_with(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        (picture, picture_gradient, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<GradientTimes> {
        camera.validate("camera")?;
        options.validate()?;
        let largest = |picture: &Rendered, picture_gradient: &mut PictureGradient| {
            picture_gradient.reset(picture);
            loss(picture, picture_gradient)?;
            picture_gradient.validate(camera)
        };
        if camera.distortion.is_none() {
            let targets = (picture, picture_gradient, gradients);
            return self.pinhole_forward_backward(gaussians, camera, options, targets, largest);
        }
        let map = self.renderer.lens_map(camera)?;
        let (pinhole, fine) = map.pinhole(camera, options);
        let (mut fine_picture, mut fine_gradient) = (Rendered::default(), PictureGradient::default());
        let mut background = [0.0; 3];
        let through_lens = |fine: &Rendered, fine_gradient: &mut PictureGradient| {
            background =
                map.loss(options, (fine, &mut *fine_gradient), (picture, picture_gradient), largest)?;
            fine_gradient.validate(&pinhole)
        };
        let targets = (&mut fine_picture, &mut fine_gradient, &mut *gradients);
        self.pinhole_forward_backward(gaussians, &pinhole, &fine, targets, through_lens)?;
        gradients.background = background;
        Ok(GradientTimes::default())
    }

    /// Forward and backward pass of a valid camera without a lens; `loss` as in [`forward_backward`].
    fn pinhole_forward_backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        targets: (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<f32>,
    ) -> Result<GradientTimes> {
        let Self { renderer, watch } = *self;
        let mut scratch = renderer.pool().pop().unwrap_or_default();
        let job = Job { gaussians, camera, options, pair_budget: renderer.pair_budget, watch };
        let times = match renderer.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => forward_backward(simd, job, &mut scratch, targets, loss),
            Level::Portable(simd) => forward_backward(simd, job, &mut scratch, targets, loss),
        };
        renderer.pool().push(scratch);
        watch.check()?;
        times
    }
}

/// Renders a picture and computes its gradients. `loss` fills the gradient of the picture and returns its largest
/// magnitude.
fn forward_backward<S: Lanes>(
    simd: S,
    job: Job,
    scratch: &mut Scratch,
    (picture, picture_gradient, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
    loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<f32>,
) -> Result<GradientTimes> {
    let mut forward = super::prepare(simd, job, scratch);
    let listed = super::blend_in_slices(simd, job, scratch, picture, &mut forward);
    // The caller's function must not get an incomplete picture.
    job.watch.check()?;
    let start = Instant::now();
    let largest = loss(picture, picture_gradient)?;
    let loss = start.elapsed();
    let given = (&*picture_gradient, largest);
    let backward = backward::backward(simd, job, scratch, Some(listed), given, gradients);
    Ok(GradientTimes { forward, loss, backward })
}

impl Differentiable for CpuRenderer {
    fn backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        gradient: &PictureGradient,
    ) -> Result<Gradients> {
        self.watched(&UNWATCHED).backward(gaussians, camera, options, gradient)
    }

    fn forward_backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        targets: (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: &mut dyn FnMut(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<()> {
        self.render_with_gradients_into(gaussians, camera, options, targets, loss).map(drop)
    }
}

impl Differentiable for Watched<'_> {
    fn backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        gradient: &PictureGradient,
    ) -> Result<Gradients> {
        camera.validate("camera")?;
        options.validate()?;
        let largest = gradient.validate(camera)?;
        let mut out = Gradients::default();
        if !camera.distortion.is_none() {
            // Resampling needs the picture in any case.
            let (mut picture, mut picture_gradient) = (Rendered::default(), PictureGradient::default());
            let targets = (&mut picture, &mut picture_gradient, &mut out);
            let loss = |_: &Rendered, picture_gradient: &mut PictureGradient| {
                picture_gradient.clone_from(gradient);
                Ok(())
            };
            self.forward_backward_with(gaussians, camera, options, targets, loss)?;
            return Ok(out);
        }
        let Self { renderer, watch } = *self;
        let mut scratch = renderer.pool().pop().unwrap_or_default();
        let job = Job { gaussians, camera, options, pair_budget: renderer.pair_budget, watch };
        let given = (gradient, largest);
        match renderer.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => backward_only(simd, job, &mut scratch, given, &mut out),
            Level::Portable(simd) => backward_only(simd, job, &mut scratch, given, &mut out),
        }
        renderer.pool().push(scratch);
        watch.check()?;
        Ok(out)
    }

    fn forward_backward(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        targets: (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: &mut dyn FnMut(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<()> {
        self.forward_backward_with(gaussians, camera, options, targets, loss).map(drop)
    }
}

/// Computes the gradients without drawing the picture first.
fn backward_only<S: Lanes>(
    simd: S,
    job: Job,
    scratch: &mut Scratch,
    gradient: (&PictureGradient, f32),
    out: &mut Gradients,
) {
    super::prepare(simd, job, scratch);
    backward::backward(simd, job, scratch, None, gradient, out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::Pose;
    use vg_geometry::camera::Intrinsics;

    #[test]
    fn pair_budgets_of_any_size_give_the_same_bytes() {
        let n = 300;
        let at = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1000) as f32 / 1000.0 - 0.5;
        let means = (0..n).map(|i| [3.0 * at(i, 0), 2.0 * at(i, 1), 4.0 + at(i, 2)]).collect();
        let rotations = (0..n).map(|i| [at(i, 3), at(i, 4), at(i, 5), 1.0]).collect();
        let scales = (0..n).map(|i| [0.4, 0.02, 0.1 + 0.1 * at(i, 6)]).collect();
        let opacities = (0..n).map(|i| 0.5 + at(i, 7)).collect();
        let sh = (0..3 * n).map(|i| at(i, 8)).collect();
        let gaussians = Gaussians::from_arrays(0, means, rotations, scales, opacities, sh).unwrap();
        let intrinsics = Intrinsics { fx: 150.0, fy: 150.0, cx: 90.0, cy: 40.0 };
        let camera = Camera::pinhole(190, 90, intrinsics, Pose::IDENTITY).unwrap();
        let mut gradient = PictureGradient::zeros(190, 90);
        for i in 0..190 * 90 {
            (gradient.color[i], gradient.alpha[i]) = ([at(i, 1), at(i, 2), at(i, 3)], at(i, 4));
            gradient.depth[i] = at(i, 5);
        }
        let options = RenderOptions::default();
        let expected = CpuRenderer::new().backward(&gaussians, &camera, &options, &gradient).unwrap();
        assert!(expected.means.iter().filter(|m| **m != [0.0; 3]).count() > 100);
        for pair_budget in [1, 50, 200, 800] {
            let renderer = CpuRenderer { pair_budget, ..CpuRenderer::new() };
            let loss = |_: &Rendered| Ok(gradient.clone());
            let found = renderer.render_with_gradients(&gaussians, &camera, &options, loss).unwrap().1;
            assert!(found == expected, "{pair_budget} pairs, with the picture");
            let found = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
            assert!(found == expected, "{pair_budget} pairs");
        }
    }
}
