//! The renderer on a graphics processor: the picture of [`CpuRenderer`], drawn by WGSL kernels through wgpu and Vulkan,
//! without a window.
//!
//! `draw` has the stages of a picture in their order: `project` (one Gaussian per thread), sort by depth, list (tile,
//! splat) pairs, sort by tile, `blend` (one pixel per thread); `gradients` has those of the backward pass; `batch`
//! keeps the device busy while pictures are read. Nothing depends on the order of threads: the same device draws the
//! same bytes. `docs/GPU.md` has the measurements.

mod asset;
mod batch;
mod device;
mod draw;
mod frame;
mod gradients;
mod kernels;
mod memory;
mod stages;

pub use asset::GpuAsset;
pub use device::Adapter;
pub use draw::Target;

use crate::gaussians::Gaussians;
use crate::render::distorted::LensMap;
use crate::render::{CpuRenderer, RenderOptions, Rendered, Renderer, Rgba8};
use device::Device;
use kernels::Kernels;
use memory::{Memory, SPLAT};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use vg_geometry::{Camera, Error, Result};

/// Bounds of working memory; tests lower them.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Bounds {
    /// (tile, splat) pairs held at a time: 640 MiB.
    pub pairs: u64,
    /// Pairs whose gradients are held at a time: 320 MiB.
    pub shares: u64,
    /// Pixels of a band: 80 MiB, and as much to read them back.
    pub pixels: u64,
    /// Bytes of a buffer bound to a kernel.
    pub binding: u64,
}

/// Maximum number of tiles in a band: their indices have 16 bits.
const MOST_TILES: u64 = 1 << 16;

/// Maximum number of workgroups in one dispatch.
const MOST_GROUPS: u64 = 65_535;

/// Maximum number of Gaussians in one asset: one thread each and one more, in groups of 256.
const MOST_GAUSSIANS: u64 = 256 * MOST_GROUPS - 1;

/// Maximum number of (tile, splat) pairs held at a time: as many as fit in the smallest binding that drivers must
/// allow, 128 MiB.
const MOST_PAIRS: u64 = 1 << 25;

/// Renderer on a graphics processor. Device, kernels and working memory are created once and kept. It can be shared
/// between threads, which then draw one after the other.
#[derive(Debug)]
pub struct GpuRenderer {
    device: Device,
    kernels: Kernels,
    /// Computes the parts that are not worth a kernel.
    cpu: CpuRenderer,
    bounds: Bounds,
    /// Locked while the device is working.
    memory: Mutex<Option<Memory>>,
    /// Map of the last lens drawn.
    lens: Mutex<Option<Arc<LensMap>>>,
}

impl GpuRenderer {
    /// Opens a device and compiles the kernels for it: tens of milliseconds, more where the driver has not cached them.
    ///
    /// Errors: [`Error::Missing`] without a driver, without a device that `adapter` allows, or if it cannot be opened.
    pub fn new(adapter: Adapter) -> Result<Self> {
        let device = Device::open(adapter)?;
        let kernels = Kernels::new(&device);
        device.check()?;
        let binding = device.largest_binding;
        let bounds = Bounds { pairs: MOST_PAIRS.min(binding / 4), shares: 1 << 23, pixels: 1 << 22, binding };
        let cpu = CpuRenderer::new();
        Ok(Self { device, kernels, cpu, bounds, memory: Mutex::default(), lens: Mutex::default() })
    }

    /// The renderer that this process has open, or a new one: a device and its kernels are created once and live as
    /// long as a reference to them. A renderer whose device was lost is not returned again.
    ///
    /// Errors: those of [`GpuRenderer::new`].
    pub fn shared(adapter: Adapter) -> Result<Arc<Self>> {
        static OPEN: [Mutex<Weak<GpuRenderer>>; 2] = [Mutex::new(Weak::new()), Mutex::new(Weak::new())];
        let mut open = OPEN[adapter as usize].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(renderer) = open.upgrade().filter(|r| !r.device.is_lost()) {
            return Ok(renderer);
        }
        let renderer = Arc::new(Self::new(adapter)?);
        *open = Arc::downgrade(&renderer);
        Ok(renderer)
    }

    /// The adapter's name, as reported by its driver.
    pub fn name(&self) -> &str {
        &self.device.info.name
    }

    /// Whether the driver draws on the CPU.
    pub fn is_software(&self) -> bool {
        self.device.is_software()
    }

    /// The maximum number of Gaussians of one asset on this device.
    pub fn most_gaussians(&self) -> u64 {
        MOST_GAUSSIANS.min(self.bounds.binding / SPLAT)
    }

    /// Working memory on the device, bytes, without assets.
    pub fn working_bytes(&self) -> u64 {
        self.lock().as_ref().map_or(0, Memory::bytes)
    }

    /// Changes the bounds, for tests.
    #[doc(hidden)]
    pub fn bounded(mut self, change: impl FnOnce(&mut Bounds)) -> Self {
        change(&mut self.bounds);
        self
    }

    /// Loses the device, as a driver's reset would, for tests.
    #[doc(hidden)]
    pub fn lose_device(&self) {
        self.device.lose();
    }

    /// Copies Gaussians to the device, to be drawn any number of times by this renderer.
    ///
    /// Errors: [`Error::Argument`] for more than [`most_gaussians`](GpuRenderer::most_gaussians), [`Error::Missing`]
    /// where the device is out of memory or lost.
    pub fn upload(&self, gaussians: &Gaussians) -> Result<GpuAsset> {
        let _held = self.lock();
        let (found, most) = (gaussians.len(), self.most_gaussians());
        if found as u64 > most {
            let allowed = format!("0 to {most}, the limit of a buffer on {}", self.name());
            return Err(Error::argument("gaussians", format!("{found} Gaussians"), allowed));
        }
        self.device.check()?;
        GpuAsset::upload(&self.device, gaussians, self.bounds.binding)
    }

    /// Renders one picture of Gaussians that this renderer has uploaded. The camera may be distorted.
    ///
    /// Errors: [`Error::Argument`] for the camera or the options, [`Error::Missing`] where the device is lost, out of
    /// memory, or fails.
    pub fn render_asset(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Rendered> {
        let mut target = Rendered::default();
        self.render_asset_into(asset, camera, options, &mut target)?;
        Ok(target)
    }

    /// As [`GpuRenderer::render_asset`], into a picture whose memory is reused.
    pub fn render_asset_into(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        target: &mut Rendered,
    ) -> Result<()> {
        camera.validate("camera")?;
        options.validate()?;
        if camera.distortion.is_none() {
            return self.draw(asset, camera, options, Target::Planes(target));
        }
        *target = self.lens_map(camera)?.render_with(camera, options, |pinhole, fine| {
            let mut picture = Rendered::default();
            self.draw(asset, pinhole, fine, Target::Planes(&mut picture))?;
            Ok(picture)
        })?;
        Ok(())
    }

    /// As [`GpuRenderer::render_asset_into`], into the pixels of [`Rgba8`]: a fifth of the bytes to transfer.
    pub fn render_asset_rgba8(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        target: &mut Rgba8,
    ) -> Result<()> {
        if !camera.distortion.is_none() {
            return target.make(options, |planes| self.render_asset_into(asset, camera, options, planes));
        }
        camera.validate("camera")?;
        options.validate()?;
        self.draw(asset, camera, options, Target::Bytes(&mut target.pixels))
    }

    fn lens_map(&self, camera: &Camera) -> Result<Arc<LensMap>> {
        let known = self.lens.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(map) = known.filter(|map| map.fits(camera)) {
            return Ok(map);
        }
        let map = Arc::new(LensMap::new(camera)?);
        *self.lens.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&map));
        Ok(map)
    }

    fn lock(&self) -> MutexGuard<'_, Option<Memory>> {
        // A thread that panicked had taken the memory out.
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Renderer for GpuRenderer {
    /// Uploads the Gaussians and draws them once; [`GpuRenderer::render_asset`] for more than one picture.
    fn render(&self, gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Result<Rendered> {
        camera.validate("camera")?;
        options.validate()?;
        self.render_asset(&self.upload(gaussians)?, camera, options)
    }
}
