//! The two kinds of pictures: planes and bytes.

use super::cpu::Watched;
#[cfg(feature = "gpu")]
use super::{GpuAsset, GpuRenderer, gpu::Target};
use super::{RenderOptions, Rendered, Rgba8};
use crate::gaussians::Gaussians;
use vg_geometry::{Camera, Result};

/// [`Rendered`], or [`Rgba8`], which takes a fifth of the transfer from a device. Sealed.
pub trait Picture: Default + inside::Drawn {}

impl Picture for Rendered {}
impl Picture for Rgba8 {}

pub(crate) mod inside {
    use super::*;

    /// Drawing by each kind of renderer.
    pub trait Drawn {
        fn draw(
            &mut self,
            cpu: Watched<'_>,
            gaussians: &Gaussians,
            camera: &Camera,
            options: &RenderOptions,
        ) -> Result<()>;

        #[cfg(feature = "gpu")]
        fn draw_on(
            &mut self,
            gpu: &GpuRenderer,
            asset: &GpuAsset,
            camera: &Camera,
            options: &RenderOptions,
        ) -> Result<()>;

        /// The target of a device's picture.
        #[cfg(feature = "gpu")]
        fn target(&mut self) -> Target<'_>;
    }
}

impl inside::Drawn for Rendered {
    fn draw(
        &mut self,
        cpu: Watched<'_>,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<()> {
        cpu.render_into(gaussians, camera, options, self).map(drop)
    }

    #[cfg(feature = "gpu")]
    fn draw_on(
        &mut self,
        gpu: &GpuRenderer,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<()> {
        gpu.render_asset_into(asset, camera, options, self)
    }

    #[cfg(feature = "gpu")]
    fn target(&mut self) -> Target<'_> {
        Target::Planes(self)
    }
}

impl inside::Drawn for Rgba8 {
    fn draw(
        &mut self,
        cpu: Watched<'_>,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<()> {
        self.make(options, |planes| planes.draw(cpu, gaussians, camera, options))
    }

    #[cfg(feature = "gpu")]
    fn draw_on(
        &mut self,
        gpu: &GpuRenderer,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<()> {
        gpu.render_asset_rgba8(asset, camera, options, self)
    }

    #[cfg(feature = "gpu")]
    fn target(&mut self) -> Target<'_> {
        Target::Bytes(&mut self.pixels)
    }
}
