//! Steps of a refinement, and the evaluation of its state.

use super::densify::{self, Densified, Growth, Schedule, Seen};
use super::parameters::{Optimizer, Parameters, Rates};
use super::target::{Loss, Shown, Target};
use super::{RefineOptions, State, tie};
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::View;
use vg_splat::Gaussians;
use vg_splat::render::backend::{Choice, Trainer, trainer};
use vg_splat::render::{Background, Gradients, PictureGradient, RenderOptions, Rendered};

/// Constants that differ between the methods of optimisation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measures {
    /// Gradients of this size and below move a parameter by less than the rate.
    pub(super) noise: f32,
    /// Unit of the step size of centres and of the sizes in density control, metres.
    pub(super) extent_m: f32,
    /// Seed of density control.
    pub(super) seed: u64,
}

/// Inputs and buffers of one vehicle's refinement.
pub(super) struct Work<'a> {
    views: &'a [View],
    targets: Vec<Target>,
    options: &'a RefineOptions,
    measures: Measures,
    optimizer: Optimizer,
    renderer: Trainer,
    choice: Choice,
    render: RenderOptions,
    /// Totals of density control.
    densified: Densified,
    // Reused from step to step.
    gaussians: Gaussians,
    picture: Rendered,
    shown: Shown,
    of_picture: PictureGradient,
    gradients: Gradients,
    seen: Seen,
    /// Whether density control still collects gradients.
    collects: bool,
}

impl<'a> Work<'a> {
    /// Prepares steps from `state` on.
    pub(super) fn new(
        state: &State,
        views: &'a [View],
        options: &'a RefineOptions,
        measures: Measures,
    ) -> Result<Self> {
        let Parameters { sh_degree, .. } = state.parameters;
        let mut seen = Seen::default();
        seen.reset(state.parameters.len());
        let (renderer, choice) = trainer(options.backend)?;
        Ok(Self {
            views,
            targets: views.iter().map(Target::new).collect(),
            options,
            measures,
            optimizer: Optimizer::new(state.parameters.len(), sh_degree, measures.noise),
            renderer,
            choice,
            // Transparent, so that exposure acts on the vehicle alone.
            render: RenderOptions { background: Background::Transparent, ..RenderOptions::default() },
            densified: Densified::default(),
            gaussians: Gaussians::default(),
            picture: Rendered::default(),
            shown: Shown::default(),
            of_picture: PictureGradient::default(),
            gradients: Gradients::default(),
            seen,
            collects: options.densify.is_some(),
        })
    }

    /// The renderer that is used, and the reason.
    pub(super) fn drawn_by(&self) -> String {
        self.choice.to_string()
    }

    /// Renders colours up to this SH degree from now on; coefficients above it do not change.
    pub(super) fn show_degree(&mut self, sh_degree: u8) {
        self.render.sh_degree = sh_degree;
    }

    /// Makes one step by the gradient of `view`; returns the loss before it.
    pub(super) fn step(
        &mut self,
        view: usize,
        state: &mut State,
        rates: &Rates,
        context: &Context,
    ) -> Result<f64> {
        let Self { views, targets, options, measures, optimizer, renderer, render, seen, collects, .. } =
            self;
        let (gaussians, gradients) = (&mut self.gaussians, &mut self.gradients);
        let (picture, shown, of_picture) = (&mut self.picture, &mut self.shown, &mut self.of_picture);
        let State { parameters, clones, exposure } = state;
        context.parallel(|| {
            tie::made(parameters, clones, gaussians);
            let mut loss = Loss::default();
            let mut of_loss = |picture: &Rendered, of_picture: &mut PictureGradient| {
                loss = targets[view].loss(picture, exposure.factor(view), options, shown, of_picture)?;
                Ok(())
            };
            let camera = &views[view].camera;
            let results = (picture, of_picture, &mut *gradients);
            renderer.forward_backward(gaussians, camera, render, results, &mut of_loss)?;
            if *collects {
                seen.note(gaussians, gradients, camera, clones);
            }
            tie::gather(gradients, clones, parameters.len(), parameters.sh_degree);
            optimizer.step(parameters, gradients, rates, measures.extent_m);
            if options.exposure {
                exposure.step(view, loss.of_exposure, rates.exposure);
            }
            Ok(loss.total)
        })
    }

    /// Runs density control after `made` of `planned` steps, if it is enabled and due.
    pub(super) fn densify(&mut self, state: &mut State, made: u32, planned: u32, context: &Context) {
        let Some(rules) = &self.options.densify else { return };
        let schedule = Schedule::new(planned);
        self.collects = schedule.collects_at(made);
        let State { parameters, clones, .. } = state;
        if schedule.grows_at(made) {
            let growth = context.parallel(|| {
                let prunes_large = rules.resets && schedule.prunes_large_at(made);
                let extent_m = self.measures.extent_m;
                Growth::new(parameters, clones, &self.seen, rules, extent_m, prunes_large)
            });
            if let Some(growth) = growth {
                *clones = tie::followed(clones, &growth.sources, parameters.len());
                *parameters = growth.grown(parameters, [self.measures.seed, made.into()]);
                self.optimizer.follow(&growth.sources, growth.survivors, parameters.sh_degree);
                self.densified.add(&growth.done);
            }
            self.seen.reset(parameters.len());
        }
        if rules.resets && schedule.resets_at(made) {
            densify::reset_opacities(parameters);
            self.optimizer.forget_opacities();
            self.densified.resets += 1;
        }
    }

    /// Totals of density control, if it is enabled.
    pub(super) fn densified(&self) -> Option<Densified> {
        self.options.densify.map(|_| self.densified)
    }

    /// Holds the surface of `state`; returns [`Work::psnr_db`] and whether any view sees the model.
    pub(super) fn begin(&mut self, state: &State, context: &Context) -> Result<(Vec<f64>, bool)> {
        context.parallel(|| {
            tie::made(&state.parameters, &state.clones, &mut self.gaussians);
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
            tie::made(&state.parameters, &state.clones, &mut self.gaussians);
            self.psnr_drawn(view, state)
        })
    }

    /// PSNR of all views on white, each in its exposure, dB.
    pub(super) fn psnr_db(&mut self, state: &State, context: &Context) -> Result<Vec<f64>> {
        context.parallel(|| {
            tie::made(&state.parameters, &state.clones, &mut self.gaussians);
            (0..self.views.len()).map(|view| self.psnr_drawn(view, state)).collect()
        })
    }

    fn psnr_drawn(&mut self, view: usize, state: &State) -> Result<f64> {
        self.draw(view)?;
        Ok(self.psnr_of_drawn(view, state))
    }

    fn draw(&mut self, view: usize) -> Result<()> {
        let camera = &self.views[view].camera;
        self.picture = self.renderer.render(&self.gaussians, camera, &self.render)?;
        Ok(())
    }

    fn psnr_of_drawn(&mut self, view: usize, state: &State) -> f64 {
        let factor = state.exposure.factor(view);
        self.targets[view].psnr_db(&self.picture, factor, &mut self.shown)
    }

    /// The Gaussians of a state: originals, then clones.
    pub(super) fn finished(mut self, state: &State, context: &Context) -> Gaussians {
        context.parallel(|| tie::made(&state.parameters, &state.clones, &mut self.gaussians));
        self.gaussians
    }
}
