//! The fast renderer with cancellation: once the work is stopped, the remaining rows and tiles are skipped.

use super::{CpuRenderer, Job, Level, StageTimes, draw};
use crate::gaussians::Gaussians;
use crate::render::{RenderOptions, Rendered, Renderer};
use vg_geometry::progress::Watch;
use vg_geometry::{Camera, Result};

/// A renderer whose pictures can be cancelled: with [`Error::Cancelled`](vg_geometry::Error::Cancelled), and unspecified
/// contents of the target.
#[derive(Clone, Copy, Debug)]
pub struct Watched<'a> {
    pub(super) renderer: &'a CpuRenderer,
    pub(super) watch: &'a Watch,
}

impl CpuRenderer {
    /// This renderer under `watch`.
    pub fn watched<'a>(&'a self, watch: &'a Watch) -> Watched<'a> {
        Watched { renderer: self, watch }
    }
}

impl Watched<'_> {
    /// As [`CpuRenderer::render_into`].
    pub fn render_into(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        target: &mut Rendered,
    ) -> Result<StageTimes> {
        let Self { renderer, watch } = *self;
        camera.validate("camera")?;
        options.validate()?;
        watch.check()?;
        if !camera.distortion.is_none() {
            *target = renderer.lens_map(camera)?.render(self, gaussians, camera, options)?;
            return Ok(StageTimes::default());
        }
        let mut scratch = renderer.pool().pop().unwrap_or_default();
        let job = Job { gaussians, camera, options, pair_budget: renderer.pair_budget, watch };
        let times = match renderer.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => draw(simd, job, &mut scratch, target),
            Level::Portable(simd) => draw(simd, job, &mut scratch, target),
        };
        renderer.pool().push(scratch);
        watch.check()?;
        Ok(times)
    }
}

impl Renderer for Watched<'_> {
    fn render(&self, gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Result<Rendered> {
        let mut target = Rendered::default();
        self.render_into(gaussians, camera, options, &mut target)?;
        Ok(target)
    }
}
