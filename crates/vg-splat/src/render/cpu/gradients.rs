//! Pictures with their gradients: one projection, one sort and one set of lists for both directions.

use super::backward::{self, BackwardTimes};
use super::simd::Lanes;
use super::{CpuRenderer, Level, Scratch, StageTimes, Watched};
use crate::gaussians::Gaussians;
use crate::render::{Differentiable, Gradients, PictureGradient, RenderOptions, Rendered};
use std::time::{Duration, Instant};
use vg_geometry::Camera;
use vg_geometry::Result;
use vg_geometry::progress::{UNWATCHED, Watch};

/// Wall time of each stage of a picture and its gradients.
#[derive(Clone, Copy, Debug, Default)]
pub struct GradientTimes {
    /// Drawing the picture.
    pub forward: StageTimes,
    /// The loss, and checking its gradient.
    pub loss: Duration,
    /// Going back.
    pub backward: BackwardTimes,
}

impl CpuRenderer {
    /// A picture, and the gradients of a loss of it. `loss` looks at the picture and returns the loss's gradient
    /// with respect to it, all of finite numbers; an error of its own ends the call.
    pub fn render_with_gradients(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        loss: impl FnOnce(&Rendered) -> Result<PictureGradient>,
    ) -> Result<(Rendered, Gradients)> {
        let (mut picture, mut gradients) = (Rendered::default(), Gradients::default());
        let mut of_picture = PictureGradient::default();
        let loss = |picture: &Rendered, gradient: &mut PictureGradient| {
            *gradient = loss(picture)?;
            Ok(())
        };
        let targets = (&mut picture, &mut of_picture, &mut gradients);
        self.render_with_gradients_into(gaussians, camera, options, targets, loss)?;
        Ok((picture, gradients))
    }

    /// As [`CpuRenderer::render_with_gradients`], into memory that is reused. `loss` adds to the gradient of the
    /// picture, which has its size and no plane yet. The times are of a pinhole camera's stages, and zero through a lens.
    ///
    /// After an error the targets hold nothing in particular.
    pub fn render_with_gradients_into(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        (picture, of_picture, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<GradientTimes> {
        let targets = (picture, of_picture, gradients);
        self.watched(&UNWATCHED).both_ways_with(gaussians, camera, options, targets, loss)
    }

    /// The way back from what pixels have for each Gaussian, where they were drawn and summed up elsewhere; the
    /// camera is valid and has no lens.
    #[cfg(feature = "gpu")]
    pub(in crate::render) fn back_to_gaussians(
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
                backward::back_to_gaussians(simd, gaussians, camera, options, shares, decided, out);
            }
            Level::Portable(simd) => {
                backward::back_to_gaussians(simd, gaussians, camera, options, shares, decided, out);
            }
        }
    }
}

impl Watched<'_> {
    /// See [`CpuRenderer::render_with_gradients_into`].
    fn both_ways_with(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        (picture, of_picture, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<GradientTimes> {
        camera.validate("camera")?;
        options.validate()?;
        let largest = |picture: &Rendered, of_picture: &mut PictureGradient| {
            of_picture.reset(picture);
            loss(picture, of_picture)?;
            of_picture.validate(camera)
        };
        if camera.distortion.is_none() {
            let targets = (picture, of_picture, gradients);
            return self.pinhole_both_ways(gaussians, camera, options, targets, largest);
        }
        let map = self.renderer.lens_map(camera)?;
        let (pinhole, fine) = map.pinhole(camera, options);
        let (mut fine_picture, mut of_fine) = (Rendered::default(), PictureGradient::default());
        let mut background = [0.0; 3];
        let through_lens = |fine: &Rendered, of_fine: &mut PictureGradient| {
            background = map.loss(options, (fine, &mut *of_fine), (picture, of_picture), largest)?;
            of_fine.validate(&pinhole)
        };
        let targets = (&mut fine_picture, &mut of_fine, &mut *gradients);
        self.pinhole_both_ways(gaussians, &pinhole, &fine, targets, through_lens)?;
        gradients.background = background;
        Ok(GradientTimes::default())
    }

    /// Of a valid camera without a lens; `loss` as in [`both_ways`].
    fn pinhole_both_ways(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        targets: (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<f32>,
    ) -> Result<GradientTimes> {
        let Self { renderer, watch } = *self;
        let mut scratch = renderer.pool().pop().unwrap_or_default();
        let budget = renderer.pair_budget;
        let times = match renderer.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => {
                both_ways(simd, gaussians, camera, options, budget, watch, &mut scratch, targets, loss)
            }
            Level::Portable(simd) => {
                both_ways(simd, gaussians, camera, options, budget, watch, &mut scratch, targets, loss)
            }
        };
        renderer.pool().push(scratch);
        watch.check()?;
        times
    }
}

/// `loss` fills the gradient of the picture and returns its largest magnitude.
fn both_ways<S: Lanes>(
    simd: S,
    gaussians: &Gaussians,
    camera: &Camera,
    options: &RenderOptions,
    pair_budget: u64,
    watch: &Watch,
    scratch: &mut Scratch,
    (picture, of_picture, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
    loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<f32>,
) -> Result<GradientTimes> {
    let mut forward = super::prepare(simd, gaussians, camera, options, watch, scratch);
    let binned =
        super::blend_in_slices(simd, camera, options, pair_budget, watch, scratch, picture, &mut forward);
    // The caller's function must not see a part of a picture.
    watch.check()?;
    let start = Instant::now();
    let largest = loss(picture, of_picture)?;
    let loss = start.elapsed();
    let given = (&*of_picture, largest);
    let budget = pair_budget;
    let backward = backward::backward(
        simd, gaussians, camera, options, budget, watch, scratch, binned, given, gradients,
    );
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

    fn both_ways(
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
            // Resampling needs the picture anyway.
            let (mut picture, mut of_picture) = (Rendered::default(), PictureGradient::default());
            let targets = (&mut picture, &mut of_picture, &mut out);
            let loss = |_: &Rendered, of_picture: &mut PictureGradient| {
                of_picture.clone_from(gradient);
                Ok(())
            };
            self.both_ways_with(gaussians, camera, options, targets, loss)?;
            return Ok(out);
        }
        let Self { renderer, watch } = *self;
        let mut scratch = renderer.pool().pop().unwrap_or_default();
        let (budget, given) = (renderer.pair_budget, (gradient, largest));
        match renderer.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => {
                back(simd, gaussians, camera, options, budget, watch, &mut scratch, given, &mut out);
            }
            Level::Portable(simd) => {
                back(simd, gaussians, camera, options, budget, watch, &mut scratch, given, &mut out);
            }
        }
        renderer.pool().push(scratch);
        watch.check()?;
        Ok(out)
    }

    fn both_ways(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        targets: (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: &mut dyn FnMut(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<()> {
        self.both_ways_with(gaussians, camera, options, targets, loss).map(drop)
    }
}

/// Without drawing the picture first.
fn back<S: Lanes>(
    simd: S,
    gaussians: &Gaussians,
    camera: &Camera,
    options: &RenderOptions,
    pair_budget: u64,
    watch: &Watch,
    scratch: &mut Scratch,
    gradient: (&PictureGradient, f32),
    out: &mut Gradients,
) {
    super::prepare(simd, gaussians, camera, options, watch, scratch);
    backward::backward(simd, gaussians, camera, options, pair_budget, watch, scratch, false, gradient, out);
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
