//! One step, and a look at where it led.

use super::parameters::{Optimizer, Rates};
use super::target::{Loss, Shown, Target};
use super::tie::{self, Clone as Tied};
use super::{RefineOptions, State};
use crate::error::Result;
use crate::gaussians::Gaussians;
use crate::progress::Context;
use crate::render::{Background, CpuRenderer, Gradients, PictureGradient, RenderOptions, Rendered};
use crate::scene::View;

/// Gradients of this size are noise of single pixels: a loss is a mean over all pixels.
const NOISE: f32 = 1e-9;

/// What one vehicle's refinement works with.
pub(super) struct Work<'a> {
    views: &'a [View],
    targets: Vec<Target>,
    clones: &'a [Tied],
    options: &'a RefineOptions,
    optimizer: Optimizer,
    /// Steps of centres are shares of it.
    radius_m: f32,
    renderer: CpuRenderer,
    render: RenderOptions,
    // Reused from step to step.
    gaussians: Gaussians,
    picture: Rendered,
    shown: Shown,
    of_picture: PictureGradient,
    gradients: Gradients,
}

impl<'a> Work<'a> {
    pub(super) fn new(
        originals: &Gaussians,
        clones: &'a [Tied],
        views: &'a [View],
        options: &'a RefineOptions,
    ) -> Self {
        let diagonal = |(low, high): ([f32; 3], [f32; 3])| {
            (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f32>().sqrt()
        };
        Self {
            views,
            targets: views.iter().map(Target::of).collect(),
            clones,
            options,
            optimizer: Optimizer::new(originals.len(), originals.sh_degree(), NOISE),
            radius_m: originals.bounds().map_or(1.0, |bounds| 0.5 * diagonal(bounds)).clamp(1e-3, 1e3),
            renderer: CpuRenderer::new(),
            // Drawn on nothing, so that exposure acts on the vehicle alone.
            render: RenderOptions { background: Background::Transparent, ..RenderOptions::default() },
            gaussians: Gaussians::default(),
            picture: Rendered::default(),
            shown: Shown::default(),
            of_picture: PictureGradient::default(),
            gradients: Gradients::default(),
        }
    }

    /// One step by what `view` shows; the loss before it.
    pub(super) fn step(
        &mut self,
        view: usize,
        state: &mut State,
        rates: &Rates,
        context: &Context,
    ) -> Result<f64> {
        let Self { views, targets, clones, options, optimizer, radius_m, renderer, render, .. } = self;
        let (gaussians, gradients) = (&mut self.gaussians, &mut self.gradients);
        let (picture, shown, of_picture) = (&mut self.picture, &mut self.shown, &mut self.of_picture);
        let State { parameters, exposure } = state;
        context.parallel(|| {
            tie::made(parameters, clones, gaussians);
            let mut loss = Loss::default();
            let of_loss = |picture: &Rendered, of_picture: &mut PictureGradient| {
                loss = targets[view].loss(picture, exposure.factor(view), options, shown, of_picture)?;
                Ok(())
            };
            let camera = &views[view].camera;
            let results = (picture, of_picture, &mut *gradients);
            renderer.render_with_gradients_into(gaussians, camera, render, results, of_loss)?;
            tie::gather(gradients, clones, parameters.len(), parameters.sh_degree);
            optimizer.step(parameters, gradients, rates, *radius_m);
            if options.exposure {
                exposure.step(view, loss.of_exposure, rates.exposure);
            }
            Ok(loss.total)
        })
    }

    /// Holds the surface where `state` has it; what [`Work::psnr_db`] of it says, and whether any view sees it.
    pub(super) fn begin(&mut self, state: &State, context: &Context) -> Result<(Vec<f64>, bool)> {
        context.parallel(|| {
            tie::made(&state.parameters, self.clones, &mut self.gaussians);
            let mut seen = false;
            let mut psnr_db = Vec::with_capacity(self.views.len());
            for view in 0..self.views.len() {
                self.draw(view)?;
                seen |= self.picture.alpha.iter().any(|alpha| *alpha > 0.0);
                self.targets[view].hold(&self.picture)?;
                psnr_db.push(self.psnr_of_drawn(view, state));
            }
            Ok((psnr_db, seen))
        })
    }

    /// PSNR of a view on white, in its exposure, dB.
    pub(super) fn psnr_of(&mut self, view: usize, state: &State, context: &Context) -> Result<f64> {
        context.parallel(|| {
            tie::made(&state.parameters, self.clones, &mut self.gaussians);
            self.psnr_drawn(view, state)
        })
    }

    /// The same of all views.
    pub(super) fn psnr_db(&mut self, state: &State, context: &Context) -> Result<Vec<f64>> {
        context.parallel(|| {
            tie::made(&state.parameters, self.clones, &mut self.gaussians);
            (0..self.views.len()).map(|view| self.psnr_drawn(view, state)).collect()
        })
    }

    fn psnr_drawn(&mut self, view: usize, state: &State) -> Result<f64> {
        self.draw(view)?;
        Ok(self.psnr_of_drawn(view, state))
    }

    fn draw(&mut self, view: usize) -> Result<()> {
        let camera = &self.views[view].camera;
        self.renderer.render_into(&self.gaussians, camera, &self.render, &mut self.picture)?;
        Ok(())
    }

    fn psnr_of_drawn(&mut self, view: usize, state: &State) -> f64 {
        let factor = state.exposure.factor(view);
        self.targets[view].psnr_db(&self.picture, factor, &mut self.shown)
    }

    /// The Gaussians of a state: originals, then clones.
    pub(super) fn finished(mut self, state: &State, context: &Context) -> Gaussians {
        context.parallel(|| tie::made(&state.parameters, self.clones, &mut self.gaussians));
        self.gaussians
    }
}
