//! Drawing a picture: in bands of bounded size, a band in slices of bounded pairs. Usually there is one of each, and
//! the CPU waits once.

use super::asset::GpuAsset;
use super::frame::{Frame, TILE};
use super::memory::{Memory, NUMBERS, PIXEL, Readback, Source};
use super::stages::{Stages, significant_bits};
use super::{GpuRenderer, MOST_TILES};
use crate::render::{RenderOptions, Rendered};
use vg_geometry::{Camera, Result};

/// Splats of a slice where the driver ends long loops early.
const FEW: u32 = 1 << 15;

/// The format of a picture.
#[derive(Clone, Copy)]
pub(super) enum Pixels {
    Planes,
    Bytes,
}

/// The target of a picture.
#[derive(Debug)]
pub enum Target<'a> {
    /// Colour, alpha and depth.
    Planes(&'a mut Rendered),
    /// RGBA, 8 bits each.
    Bytes(&'a mut Vec<[u8; 4]>),
}

impl GpuRenderer {
    /// Draws the picture of a valid camera without a lens.
    pub(super) fn draw(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        mut target: Target,
    ) -> Result<()> {
        let mut held = self.lock();
        // An error may leave the memory inconsistent, so it is taken out and put back only on success.
        let mut memory = held.take().unwrap_or_else(|| Memory::new(&self.device));
        self.draw_bands(asset, camera, options, &mut memory, &mut target)?;
        *held = Some(memory);
        Ok(())
    }

    fn draw_bands(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        memory: &mut Memory,
        target: &mut Target,
    ) -> Result<()> {
        let (mut frame, depth_bits) = self.frame(asset, camera, options, memory);
        let whole = Rows { first: 0, count: frame.tile_rows };
        let most = self.rows_per_band(camera);
        target.resize(camera);

        memory.reserve_band(&self.device, tiles(camera, most), pixels(camera, Rows { count: most, ..whole }));
        for first in (0..whole.count).step_by(most as usize) {
            let rows = Rows { first, count: most.min(whole.count - first) };
            (frame.first_tile_row, frame.tile_rows) = (rows.first, rows.count);
            self.draw_band(asset, camera, &mut frame, depth_bits, memory, target)?;
        }
        Ok(())
    }

    /// The kernels' parameters, and the number of bits in which depths differ. Reserves memory for the Gaussians.
    pub(super) fn frame(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        memory: &mut Memory,
    ) -> (Frame, u32) {
        let depths = asset.depths(camera, [options.near, options.far]);
        let depth_bits = significant_bits((depths[1].to_bits() - depths[0].to_bits()).saturating_add(1));
        let frame = Frame::new(asset, camera, options, depths);
        memory.reserve_gaussians(&self.device, asset.count as u64);
        self.device.queue.write_buffer(&memory.counters.gaussians, 0, bytemuck::bytes_of(&frame.count));
        (frame, depth_bits)
    }

    /// Draws one band: in one slice if its pairs fit, else slice after slice until every pixel is finished.
    fn draw_band(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        frame: &mut Frame,
        depth_bits: u32,
        memory: &mut Memory,
        target: &mut Target,
    ) -> Result<()> {
        let rows = Rows { first: frame.first_tile_row, count: frame.tile_rows };
        // A splat has at most one pair per tile, so a slice holds at least one splat.
        let most_pairs = self.bounds.pairs.max(tiles(camera, rows.count));
        let mut wanted = first_guess(asset, most_pairs);
        let last = target.pixels().last();
        (frame.slice_start, frame.is_first, frame.is_last) = (0, 1, last);
        frame.slice_splats = u32::MAX;
        memory.sliced_asset = None;
        loop {
            memory.reserve_pairs(&self.device, wanted);
            let slice = self.draw_slice(asset, camera, frame, depth_bits, memory, target)?;
            if slice.is_cut_short {
                if frame.slice_splats == FEW {
                    return Err(self.device.loop_limit_error());
                }
                // Start again, in slices whose lists are short enough for the driver.
                frame.slice_splats = FEW;
                memory.sliced_asset = Some(asset.id);
                (frame.slice_start, frame.is_first, frame.is_last) = (0, 1, 0);
                continue;
            }
            let all_fit = slice.end == u32::MAX;
            if frame.is_last != 0 && all_fit {
                return Ok(());
            }
            if frame.is_last != 0 {
                // The attempt is void: start again with room for all pairs, or in slices. These grow: the first ones
                // finish the pixels of opaque surfaces.
                let needed = u64::from(slice.pairs);
                if needed <= most_pairs {
                    wanted = needed.next_power_of_two().min(most_pairs);
                } else {
                    frame.is_last = 0;
                    memory.sliced_asset = Some(asset.id);
                }
                continue;
            }
            frame.is_first = 0;
            wanted = (4 * wanted).min(most_pairs);
            frame.slice_start = slice.end;
            if all_fit || !slice.is_unfinished {
                // An empty slice completes the picture.
                (frame.slice_start, frame.is_last) = (u32::MAX, last);
            }
        }
    }

    fn draw_slice(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        frame: &mut Frame,
        depth_bits: u32,
        memory: &mut Memory,
        target: &mut Target,
    ) -> Result<Slice> {
        let flight = self.submit_slice(asset, camera, frame, depth_bits, memory, target.pixels());
        self.finish_slice(flight, memory, target)
    }

    /// Submits the stages of a slice, in their order.
    pub(super) fn submit_slice(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        frame: &mut Frame,
        depth_bits: u32,
        memory: &mut Memory,
        format: Pixels,
    ) -> Flight {
        let rows = Rows { first: frame.first_tile_row, count: frame.tile_rows };
        let part = (frame.is_last != 0).then(|| format.part(pixels(camera, rows)));
        let bytes = part.map_or(0, |[_, bytes]| bytes);
        let readback = memory.readback(&self.device, bytes);
        let Memory { counters, gaussian: Some(per), pair: Some(pair), band: Some(band), .. } = &*memory
        else {
            unreachable!("allocated before any slice");
        };
        frame.pair_capacity = pair.tiles.capacity as u32;
        let queue = &self.device.queue;
        queue.write_buffer(&counters.frame, 0, bytemuck::bytes_of(frame));
        queue.write_buffer(&counters.slice_end, 0, bytemuck::bytes_of(&u32::MAX));
        queue.write_buffer(&counters.unfinished, 0, bytemuck::bytes_of(&0u32));

        let tiles = tiles(camera, rows.count);
        let tile_bits = significant_bits(tiles as u32);
        let mut stages = Stages::new(&self.device, &self.kernels);
        let splats_source = (asset.id, frame.splat_parameters());
        if memory.splats_source != Some(splats_source) {
            stages.project(asset, counters, per);
            stages.sort_by_depth(counters, per, depth_bits);
        }
        stages.list_pairs(counters, per, pair, depth_bits, tiles);
        stages.sort_by_tile(per, pair, band, tile_bits);
        stages.blend(frame, counters, per, pair, band, tile_bits);
        stages.read_back(counters, per, band, &readback, part);
        let submission = stages.submit();
        (memory.splats_source, memory.pairs_source) = (Some(splats_source), None);
        memory.listings += 1;
        Flight {
            readback,
            submission,
            bytes,
            first_pixel: (rows.first * TILE) as usize * camera.width as usize,
            listing: memory.listings,
            pairs_source: (frame.slice_start == 0).then(|| (asset.id, frame.list_parameters())),
        }
    }

    /// Waits for a slice. The last slice's pixels are then in the target.
    pub(super) fn finish_slice(
        &self,
        flight: Flight,
        memory: &mut Memory,
        target: &mut Target,
    ) -> Result<Slice> {
        let mut numbers = [0u32; 3];
        let take = |i: usize, bytes: &[u8]| match i {
            0 => bytemuck::bytes_of_mut(&mut numbers).copy_from_slice(bytes),
            _ => target.write(flight.first_pixel, bytes),
        };
        let buffers = [(&flight.readback.numbers, NUMBERS), (&flight.readback.picture, flight.bytes)];
        self.device.read(flight.submission, &buffers[..if flight.bytes > 0 { 2 } else { 1 }], take)?;
        memory.return_readback(flight.readback);
        let [pairs, end, unfinished] = numbers;
        // The lists are still there unless others have been made since.
        if memory.listings == flight.listing && end == u32::MAX {
            memory.pairs_source = flight.pairs_source.map(|source| (source, pairs));
        }
        Ok(Slice { pairs, end, is_unfinished: unfinished & 1 != 0, is_cut_short: unfinished & 2 != 0 })
    }

    /// Maximum number of rows of tiles in a band.
    pub(super) fn rows_per_band(&self, camera: &Camera) -> u32 {
        let columns = u64::from(camera.width.div_ceil(TILE));
        let row_of_pixels = u64::from(camera.width) * u64::from(TILE);
        let pixels = self.bounds.pixels.min(self.bounds.binding / PIXEL);
        let most = (MOST_TILES / columns).min(pixels / row_of_pixels).max(1);
        most.min(u64::from(camera.height.div_ceil(TILE))) as u32
    }
}

/// Rows of tiles.
#[derive(Clone, Copy)]
pub(super) struct Rows {
    pub(super) first: u32,
    pub(super) count: u32,
}

/// A submitted slice.
pub(super) struct Flight {
    readback: Readback,
    submission: wgpu::SubmissionIndex,
    /// Bytes of the picture to be read back.
    bytes: u64,
    first_pixel: usize,
    /// `Memory::listings` after this submission.
    listing: u64,
    /// Source of its lists, if the slice begins with the first splat.
    pairs_source: Option<Source>,
}

/// The result of a slice.
pub(super) struct Slice {
    /// Number of pairs of all its splats, whether they fitted or not.
    pub(super) pairs: u32,
    /// Rank of the first splat beyond it, or `u32::MAX`.
    end: u32,
    is_unfinished: bool,
    is_cut_short: bool,
}

impl Slice {
    /// Whether it contained everything to draw.
    pub(super) fn is_whole(&self) -> bool {
        self.end == u32::MAX && !self.is_cut_short
    }
}

/// Initial capacity for pairs: one for each Gaussian, within bounds.
pub(super) fn first_guess(asset: &GpuAsset, most: u64) -> u64 {
    (asset.count as u64).next_power_of_two().clamp(MOST_TILES.min(most), most)
}

pub(super) fn tiles(camera: &Camera, rows: u32) -> u64 {
    u64::from(camera.width.div_ceil(TILE)) * u64::from(rows)
}

/// Number of pixels in rows of tiles, of which the picture's last may be incomplete.
pub(super) fn pixels(camera: &Camera, rows: Rows) -> u64 {
    let last = ((rows.first + rows.count) * TILE).min(camera.height);
    u64::from(camera.width) * u64::from(last - rows.first * TILE)
}

impl Pixels {
    /// `Frame::is_last` of the last slice in this format.
    pub(super) fn last(self) -> u32 {
        match self {
            Self::Planes => 1,
            Self::Bytes => 2,
        }
    }

    /// Offset and number of the bytes of a band's picture that are read back.
    fn part(self, pixels: u64) -> [u64; 2] {
        match self {
            Self::Planes => [0, PIXEL * pixels],
            // Bytes are in the plane of depth.
            Self::Bytes => [16 * pixels, 4 * pixels],
        }
    }
}

impl Target<'_> {
    pub(super) fn pixels(&self) -> Pixels {
        match self {
            Self::Planes(_) => Pixels::Planes,
            Self::Bytes(_) => Pixels::Bytes,
        }
    }

    pub(super) fn resize(&mut self, camera: &Camera) {
        let pixels = camera.width as usize * camera.height as usize;
        match self {
            Self::Planes(picture) => {
                (picture.width, picture.height) = (camera.width, camera.height);
                picture.color.resize(pixels, [0.0; 3]);
                picture.alpha.resize(pixels, 0.0);
                picture.depth.resize(pixels, 0.0);
            }
            Self::Bytes(rgba) => rgba.resize(pixels, [0; 4]),
        }
    }

    /// Writes a band's pixels from `first` on; its planes are stored one after the other.
    fn write(&mut self, first: usize, bytes: &[u8]) {
        match self {
            Self::Planes(picture) => {
                let pixels = bytes.len() / PIXEL as usize;
                let (color, rest) = bytes.split_at(12 * pixels);
                let (alpha, depth) = rest.split_at(4 * pixels);
                let band = first..first + pixels;
                bytemuck::cast_slice_mut(&mut picture.color[band.clone()]).copy_from_slice(color);
                bytemuck::cast_slice_mut(&mut picture.alpha[band.clone()]).copy_from_slice(alpha);
                bytemuck::cast_slice_mut(&mut picture.depth[band]).copy_from_slice(depth);
            }
            Self::Bytes(rgba) => {
                rgba[first..first + bytes.len() / 4].as_flattened_mut().copy_from_slice(bytes);
            }
        }
    }
}
