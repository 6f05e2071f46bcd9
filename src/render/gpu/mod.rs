//! The renderer on a graphics processor: the picture of [`CpuRenderer`](crate::render::CpuRenderer), drawn by WGSL
//! kernels through wgpu and Vulkan, without a window.
//!
//! [`draw`](GpuRenderer::render_asset) has the stages in their order: `project` (one Gaussian a thread), sort by depth,
//! list (tile, splat) pairs, sort by tile, `blend` (one pixel a thread). The picture comes in bands of bounded size, a
//! band in slices of bounded pairs; one of each is the rule, and then the processor waits once. Nothing depends on the
//! order of threads: the same device draws the same bytes. `docs/GPU.md` has the measurements.

mod asset;
mod device;
mod frame;
mod kernels;
mod memory;
mod stages;

pub use asset::GpuAsset;
pub use device::Adapter;

use crate::error::{Error, Result};
use crate::gaussians::Gaussians;
use crate::geometry::Camera;
use crate::render::distorted::LensMap;
use crate::render::{RenderOptions, Rendered, Renderer};
use device::Device;
use frame::{Frame, TILE};
use kernels::Kernels;
use memory::{Memory, PIXEL, SPLAT};
use stages::{Stages, bits_of};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// Bounds of what is held at a time; tests lower them.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Bounds {
    /// (tile, splat) pairs: 320 MiB of them.
    pub pairs: u64,
    /// Pixels of a band: 80 MiB, and as many to be read.
    pub pixels: u64,
    /// Bytes of a buffer that a kernel is given.
    pub binding: u64,
}

/// Tiles of a band: their numbers have 16 bits.
const MOST_TILES: u64 = 1 << 16;

/// Groups of threads that one command may start.
const MOST_GROUPS: u64 = 65_535;

/// Gaussians of one asset, and pairs held at a time: a thread for each, in groups of 256.
const MOST_THREADS: u64 = 256 * MOST_GROUPS - 1;

/// Draws on a graphics processor. Device, kernels and working memory are made once and kept; may be shared between
/// threads, which then draw one after the other.
#[derive(Debug)]
pub struct GpuRenderer {
    device: Device,
    kernels: Kernels,
    bounds: Bounds,
    /// Held while the device is at work.
    memory: Mutex<Option<Memory>>,
    /// Of the last lens drawn.
    lens: Mutex<Option<Arc<LensMap>>>,
}

impl GpuRenderer {
    /// Opens a device and compiles the kernels for it: tens of milliseconds, more where the driver has not seen them.
    ///
    /// Errors: [`Error::Missing`] where there is no driver, none that `adapter` allows, or it cannot be opened.
    pub fn new(adapter: Adapter) -> Result<Self> {
        let device = Device::open(adapter)?;
        let kernels = Kernels::new(&device);
        device.check()?;
        let bounds = Bounds { pairs: MOST_THREADS, pixels: 1 << 22, binding: device.largest_binding };
        Ok(Self { device, kernels, bounds, memory: Mutex::default(), lens: Mutex::default() })
    }

    /// The renderer that this process has open, or a new one: a device and its kernels are made once, for as long as
    /// somebody holds them. One whose device was lost is not handed out again.
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

    /// The adapter's name, as its driver has it.
    pub fn name(&self) -> &str {
        &self.device.info.name
    }

    /// Whether the driver draws on the CPU.
    pub fn is_software(&self) -> bool {
        self.device.is_software()
    }

    /// The most Gaussians that one asset may have here.
    pub fn most_gaussians(&self) -> u64 {
        MOST_THREADS.min(self.bounds.binding / SPLAT)
    }

    /// Working memory that is held on the device, bytes; assets are beside it.
    pub fn working_bytes(&self) -> u64 {
        self.lock().as_ref().map_or(0, Memory::bytes)
    }

    /// With lower bounds, for tests.
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
    /// Errors: [`Error::Argument`] where there are more than [`most_gaussians`](GpuRenderer::most_gaussians),
    /// [`Error::Missing`] where the device has no room or is lost.
    pub fn upload(&self, gaussians: &Gaussians) -> Result<GpuAsset> {
        let _held = self.lock();
        let (found, most) = (gaussians.len(), self.most_gaussians());
        if found as u64 > most {
            let allowed = format!("0 to {most}, which {} has room for in one buffer", self.name());
            return Err(Error::argument("gaussians", format!("{found} of them"), allowed));
        }
        self.device.check()?;
        GpuAsset::upload(&self.device, gaussians, self.bounds.binding)
    }

    /// One picture of Gaussians that this renderer has uploaded. The camera may be distorted.
    ///
    /// Errors: [`Error::Argument`] of the camera or the options, [`Error::Missing`] where the device is lost, out of
    /// memory, or otherwise refuses.
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
            return self.draw(asset, camera, options, target);
        }
        *target = self.lens_map(camera)?.render_with(camera, options, |pinhole, fine| {
            let mut picture = Rendered::default();
            self.draw(asset, pinhole, fine, &mut picture)?;
            Ok(picture)
        })?;
        Ok(())
    }

    /// Of a valid camera without a lens.
    fn draw(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        target: &mut Rendered,
    ) -> Result<()> {
        let mut held = self.lock();
        // What an error left is not to be trusted: it is taken, and put back when all went well.
        let mut memory = held.take().unwrap_or_else(|| Memory::new(&self.device));
        self.draw_bands(asset, camera, options, &mut memory, target)?;
        *held = Some(memory);
        Ok(())
    }

    fn draw_bands(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        memory: &mut Memory,
        target: &mut Rendered,
    ) -> Result<()> {
        let depths = asset.depths(camera, [options.near, options.far]);
        let depth_bits = bits_of((depths[1].to_bits() - depths[0].to_bits()).saturating_add(1));
        let mut frame = Frame::new(asset, camera, options, depths);
        let whole = Rows { first: 0, count: frame.tile_rows };
        let most = self.rows_of_a_band(camera);
        resize(target, camera);

        memory.for_gaussians(&self.device, asset.count as u64);
        memory.for_band(&self.device, tiles(camera, most), pixels(camera, Rows { count: most, ..whole }));
        self.device.queue.write_buffer(&memory.counters.gaussians, 0, bytemuck::bytes_of(&frame.count));
        let mut is_projected = false;
        for first in (0..whole.count).step_by(most as usize) {
            let rows = Rows { first, count: most.min(whole.count - first) };
            (frame.first_tile_row, frame.tile_rows) = (rows.first, rows.count);
            self.draw_band(asset, camera, &mut frame, depth_bits, memory, &mut is_projected, target)?;
        }
        Ok(())
    }

    /// One band: in one slice if its pairs fit, else slice after slice until every pixel is finished.
    fn draw_band(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        frame: &mut Frame,
        depth_bits: u32,
        memory: &mut Memory,
        is_projected: &mut bool,
        target: &mut Rendered,
    ) -> Result<()> {
        let rows = Rows { first: frame.first_tile_row, count: frame.tile_rows };
        let tiles = tiles(camera, rows.count);
        // A splat has at most one pair per tile: a slice holds one at least.
        let most_pairs = self.bounds.pairs.max(tiles);
        let mut wanted =
            (asset.count as u64).next_power_of_two().clamp(MOST_TILES.min(most_pairs), most_pairs);
        (frame.slice_start, frame.is_first, frame.is_last) = (0, 1, 1);
        loop {
            memory.for_pairs(&self.device, wanted);
            let slice = self.draw_slice(asset, camera, frame, depth_bits, memory, *is_projected, target)?;
            *is_projected = true;
            let capacity = memory.pair.as_ref().map_or(0, |p| p.tiles.capacity);
            let all_fit = u64::from(slice.pairs) <= capacity;
            if frame.is_last == 1 && all_fit {
                return Ok(());
            }
            if frame.is_last == 1 {
                // Nothing is drawn yet that counts: once more with room for all, or in slices.
                let needed = u64::from(slice.pairs).next_power_of_two();
                frame.is_last = u32::from(needed <= most_pairs);
                wanted = needed.min(most_pairs);
                continue;
            }
            frame.is_first = 0;
            frame.slice_start = slice.end;
            if all_fit || !slice.is_unfinished {
                // An empty slice completes the picture.
                (frame.slice_start, frame.is_last) = (u32::MAX, 1);
            }
        }
    }

    /// The stages, in their order.
    fn draw_slice(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        frame: &mut Frame,
        depth_bits: u32,
        memory: &Memory,
        is_projected: bool,
        target: &mut Rendered,
    ) -> Result<Slice> {
        let Memory { counters, gaussian: Some(per), pair: Some(pair), band: Some(band) } = memory else {
            unreachable!("made before any slice");
        };
        frame.pair_capacity = pair.tiles.capacity as u32;
        let queue = &self.device.queue;
        queue.write_buffer(&counters.frame, 0, bytemuck::bytes_of(frame));
        queue.write_buffer(&counters.slice_end, 0, bytemuck::bytes_of(&u32::MAX));
        queue.write_buffer(&counters.unfinished, 0, bytemuck::bytes_of(&0u32));

        let rows = Rows { first: frame.first_tile_row, count: frame.tile_rows };
        let tile_bits = bits_of(tiles(camera, rows.count) as u32);
        let pixels = pixels(camera, rows);
        let mut stages = Stages::new(&self.device, &self.kernels);
        if !is_projected {
            stages.project(asset, counters, per);
            stages.sort_by_depth(counters, per, depth_bits);
        }
        stages.list_pairs(counters, per, pair, depth_bits);
        stages.sort_by_tile(per, pair, band, tile_bits);
        stages.blend(frame, counters, per, pair, band, tile_bits);
        stages.read_back(counters, per, band, (frame.is_last == 1).then_some(pixels));
        stages.submit();

        let mut numbers = [0u32; 3];
        let first = (rows.first * TILE) as usize * camera.width as usize;
        let take = |i: usize, bytes: &[u8]| match i {
            0 => bytemuck::bytes_of_mut(&mut numbers).copy_from_slice(bytes),
            _ => write_band(target, first, bytes),
        };
        let buffers = [(&counters.readback, 12), (&band.readback, PIXEL * pixels)];
        self.device.read(&buffers[..if frame.is_last == 1 { 2 } else { 1 }], take)?;
        let [pairs, end, unfinished] = numbers;
        Ok(Slice { pairs, end, is_unfinished: unfinished != 0 })
    }

    /// Rows of tiles that a band may have.
    fn rows_of_a_band(&self, camera: &Camera) -> u32 {
        let columns = u64::from(camera.width.div_ceil(TILE));
        let row_of_pixels = u64::from(camera.width) * u64::from(TILE);
        let pixels = self.bounds.pixels.min(self.bounds.binding / PIXEL);
        let most = (MOST_TILES / columns).min(pixels / row_of_pixels).max(1);
        most.min(u64::from(camera.height.div_ceil(TILE))) as u32
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
        // Whoever panicked had taken the memory out.
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

/// Rows of tiles.
#[derive(Clone, Copy)]
struct Rows {
    first: u32,
    count: u32,
}

/// How a slice went.
struct Slice {
    /// Those of all splats from its start on, whether they fitted or not.
    pairs: u32,
    /// Rank of the first splat that did not fit.
    end: u32,
    is_unfinished: bool,
}

fn tiles(camera: &Camera, rows: u32) -> u64 {
    u64::from(camera.width.div_ceil(TILE)) * u64::from(rows)
}

/// Pixels in rows of tiles, of which the picture's last may be cut.
fn pixels(camera: &Camera, rows: Rows) -> u64 {
    let last = ((rows.first + rows.count) * TILE).min(camera.height);
    u64::from(camera.width) * u64::from(last - rows.first * TILE)
}

fn resize(target: &mut Rendered, camera: &Camera) {
    let pixels = camera.width as usize * camera.height as usize;
    (target.width, target.height) = (camera.width, camera.height);
    target.color.resize(pixels, [0.0; 3]);
    target.alpha.resize(pixels, 0.0);
    target.depth.resize(pixels, 0.0);
}

/// The planes of a band, one after the other in `bytes`, from pixel `first` on.
fn write_band(target: &mut Rendered, first: usize, bytes: &[u8]) {
    let pixels = bytes.len() / PIXEL as usize;
    let (color, rest) = bytes.split_at(12 * pixels);
    let (alpha, depth) = rest.split_at(4 * pixels);
    let band = first..first + pixels;
    bytemuck::cast_slice_mut(&mut target.color[band.clone()]).copy_from_slice(color);
    bytemuck::cast_slice_mut(&mut target.alpha[band.clone()]).copy_from_slice(alpha);
    bytemuck::cast_slice_mut(&mut target.depth[band]).copy_from_slice(depth);
}
