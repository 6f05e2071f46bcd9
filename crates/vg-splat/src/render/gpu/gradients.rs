//! Gradients: the device differentiates the picture's tiles and sums the pixels' gradients for each Gaussian; the CPU
//! continues, in f64, with the projection and the colour.
//!
//! The backward pass needs all pairs of a tile at once. Where those of a band do not fit, the band is halved, down to
//! single tiles; where the pairs' shares do not fit, the pass is repeated for the next pairs. Usually one pass is
//! enough.

use super::GpuRenderer;
use super::asset::GpuAsset;
use super::draw::{Rows, Target, first_guess, pixels, tiles};
use super::frame::{Frame, TILE};
use super::memory::{BACKGROUND, Memory, NUMBERS, PIXEL, SHARE, SUMS};
use super::stages::{Stages, significant_bits};
use crate::gaussians::Gaussians;
use crate::render::cpu::backward::{Decided, Shares, SplatSums, gradient_scale};
use crate::render::{Background, Differentiable, Gradients, PictureGradient, RenderOptions, Rendered};
use rayon::prelude::*;
use vg_geometry::{Camera, Result};

/// A part of a band, in tiles.
#[derive(Clone, Copy)]
struct Window {
    rows: Rows,
    columns: Rows,
}

impl Window {
    fn tiles(self) -> u64 {
        u64::from(self.rows.count) * u64::from(self.columns.count)
    }

    /// Its halves, in order; `None` for a single tile.
    fn halves(self) -> Option<[Self; 2]> {
        let cut = |r: Rows| {
            let half = r.count / 2;
            [Rows { count: half, ..r }, Rows { first: r.first + half, count: r.count - half }]
        };
        if self.rows.count > 1 {
            Some(cut(self.rows).map(|rows| Self { rows, ..self }))
        } else if self.columns.count > 1 {
            Some(cut(self.columns).map(|columns| Self { columns, ..self }))
        } else {
            None
        }
    }
}

impl GpuRenderer {
    /// Renders a picture and computes the gradients of a loss of it, as
    /// [`CpuRenderer::render_with_gradients_into`](crate::render::CpuRenderer::render_with_gradients_into). The loss
    /// may use this renderer.
    ///
    /// Errors: those of the loss, and of [`GpuRenderer::upload`] and [`GpuRenderer::render_asset`].
    pub fn render_with_gradients_into(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        (picture, picture_gradient, gradients): (&mut Rendered, &mut PictureGradient, &mut Gradients),
        loss: impl FnOnce(&Rendered, &mut PictureGradient) -> Result<()>,
    ) -> Result<()> {
        camera.validate("camera")?;
        options.validate()?;
        let asset = self.upload(gaussians)?;
        let largest = |picture: &Rendered, picture_gradient: &mut PictureGradient| {
            picture_gradient.reset(picture);
            loss(picture, picture_gradient)?;
            picture_gradient.validate(camera)
        };
        if camera.distortion.is_none() {
            self.draw(&asset, camera, options, Target::Planes(picture))?;
            let largest = largest(picture, picture_gradient)?;
            return self.backward_pinhole(
                &asset,
                gaussians,
                camera,
                options,
                (picture_gradient, largest),
                gradients,
            );
        }
        let map = self.lens_map(camera)?;
        let (pinhole, fine) = map.pinhole(camera, options);
        let (mut fine_picture, mut fine_gradient) = (Rendered::default(), PictureGradient::default());
        self.draw(&asset, &pinhole, &fine, Target::Planes(&mut fine_picture))?;
        let background =
            map.loss(options, (&fine_picture, &mut fine_gradient), (picture, picture_gradient), largest)?;
        let largest = fine_gradient.validate(&pinhole)?;
        self.backward_pinhole(&asset, gaussians, &pinhole, &fine, (&fine_gradient, largest), gradients)?;
        gradients.background = background;
        Ok(())
    }

    /// Backward pass of a valid pinhole camera; `largest` is the largest magnitude in the gradient.
    fn backward_pinhole(
        &self,
        asset: &GpuAsset,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        (gradient, largest): (&PictureGradient, f32),
        out: &mut Gradients,
    ) -> Result<()> {
        let scale = gradient_scale(largest);
        let mut held = self.lock();
        // An error may leave the memory inconsistent, so it is taken out and put back only on success.
        let mut memory = held.take().unwrap_or_else(|| Memory::new(&self.device));
        let mut background = self.backward_bands(asset, camera, options, (gradient, scale), &mut memory)?;
        let (sums, flags) = self.read_sums(asset, &memory)?;
        *held = Some(memory);
        drop(held);

        if options.background == Background::Transparent {
            background = [0.0; 3];
        }
        let shares = Shares { sums: &sums, background, scale };
        let decided = |i: usize| {
            let flags = flags[i] as u32;
            let has = |bit: u32| flags & bit != 0;
            Decided { pivot_x: has(1), color_moves: [has(2), has(4), has(8)] }
        };
        self.cpu.backward_to_gaussians(gaussians, camera, options, &shares, decided, out);
        Ok(())
    }

    /// Computes the Gaussians' sums, which stay on the device; returns the background's gradient.
    fn backward_bands(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        (gradient, scale): (&PictureGradient, f64),
        memory: &mut Memory,
    ) -> Result<[f64; 3]> {
        let (mut frame, depth_bits) = self.frame(asset, camera, options, memory);
        let columns = Rows { first: 0, count: frame.tile_columns };
        let (height, most) = (frame.tile_rows, self.rows_per_band(camera));
        let band_tiles = tiles(camera, most);
        memory.reserve_band(&self.device, band_tiles, 1);
        let band_pixels = pixels(camera, Rows { first: 0, count: most });
        memory.reserve_backward(&self.device, asset.count, [band_tiles, band_pixels], self.bounds.binding);
        self.clear_sums(memory);

        let mut background = [0.0; 3];
        let mut staged = Vec::new();
        for first in (0..height).step_by(most as usize) {
            let rows = Rows { first, count: most.min(height - first) };
            frame.band_row = rows.first * TILE;
            stage(gradient, scale, frame.band_row as usize, pixels(camera, rows) as usize, &mut staged);
            if let Some(back) = &memory.back {
                self.device.queue.write_buffer(&back.gradient, 0, bytemuck::cast_slice(&staged));
            }
            let mut windows = vec![Window { rows, columns }];
            while let Some(window) = windows.pop() {
                if let Some(share) = self.backward_window(asset, &mut frame, window, depth_bits, memory)? {
                    for c in 0..3 {
                        background[c] += share[c];
                    }
                } else if let Some([near, far]) = window.halves() {
                    windows.extend([far, near]);
                }
            }
        }
        Ok(background)
    }

    /// Adds the shares of a window's tiles to the sums and returns their gradient of the background; `None`, with
    /// nothing added, if their pairs do not fit.
    fn backward_window(
        &self,
        asset: &GpuAsset,
        frame: &mut Frame,
        window: Window,
        depth_bits: u32,
        memory: &mut Memory,
    ) -> Result<Option<[f64; 3]>> {
        (frame.first_tile_row, frame.tile_rows) = (window.rows.first, window.rows.count);
        (frame.first_tile_column, frame.tile_columns) = (window.columns.first, window.columns.count);
        let tile_bits = significant_bits(window.tiles() as u32);
        // A splat has one pair in a tile, so the pairs of one tile fit.
        let most_pairs = self.bounds.pairs.max(asset.count as u64);
        let mut wanted = first_guess(asset, most_pairs);
        loop {
            memory.reserve_pairs(&self.device, wanted);
            let capacity = memory.pair.as_ref().map_or(0, |p| p.tiles.capacity);
            let most_shares = capacity.min(self.bounds.shares);
            memory.reserve_shares(&self.device, most_shares, self.bounds.binding);
            memory.listings += 1;
            let readback = memory.readback(&self.device, 0);
            let Memory {
                counters,
                gaussian: Some(per),
                pair: Some(pair),
                band: Some(band),
                back: Some(back),
                ..
            } = &*memory
            else {
                unreachable!("allocated before any window");
            };
            (frame.pair_capacity, frame.first_pair) = (capacity as u32, 0);
            frame.held_pairs = most_shares.min(back.shares.size() / SHARE) as u32;
            let splats_source = (asset.id, frame.splat_parameters());
            let pairs_source = (asset.id, frame.list_parameters());
            let listed = memory.pairs_source.filter(|(source, _)| *source == pairs_source);
            let known = listed.map(|(_, pairs)| pairs);

            self.device.queue.write_buffer(&counters.frame, 0, bytemuck::bytes_of(frame));
            let mut stages = Stages::new(&self.device, &self.kernels);
            if memory.splats_source != Some(splats_source) {
                stages.project(asset, counters, per);
                stages.sort_by_depth(counters, per, depth_bits);
            }
            if known.is_none() {
                stages.list_pairs(counters, per, pair, depth_bits, window.tiles());
                stages.sort_by_tile(per, pair, band, tile_bits);
            }
            stages.back(frame, counters, (per, pair), band, back, [depth_bits, tile_bits]);
            stages.read_back(counters, per, band, &readback, None);
            stages.read_backgrounds(back, window.tiles());
            let submission = stages.submit();
            let mut numbers = [0u32; 3];
            let mut background = [0.0; 4];
            let take = |i: usize, bytes: &[u8]| match i {
                0 => bytemuck::bytes_of_mut(&mut numbers).copy_from_slice(bytes),
                _ => background = sum(bytes),
            };
            let backgrounds = (&back.backgrounds_readback, BACKGROUND * window.tiles());
            self.device.read(submission, &[(&readback.numbers, NUMBERS), backgrounds], take)?;
            let pairs = known.unwrap_or(numbers[0]);
            if pairs > frame.pair_capacity {
                memory.return_readback(readback);
                (memory.splats_source, memory.pairs_source) = (Some(splats_source), None);
                if u64::from(pairs) > most_pairs {
                    return Ok(None);
                }
                wanted = u64::from(pairs).next_power_of_two().min(most_pairs);
                continue;
            }
            for first in (0..pairs).step_by(frame.held_pairs as usize).skip(1) {
                frame.first_pair = first;
                self.device.queue.write_buffer(&counters.frame, 0, bytemuck::bytes_of(frame));
                let mut stages = Stages::new(&self.device, &self.kernels);
                stages.back(frame, counters, (per, pair), band, back, [depth_bits, tile_bits]);
                stages.submit();
            }
            memory.return_readback(readback);
            let [r, g, b, is_cut_short] = background;
            if is_cut_short > 0.0 {
                return Err(self.device.loop_limit_error());
            }
            memory.splats_source = Some(splats_source);
            memory.pairs_source = Some((pairs_source, pairs));
            return Ok(Some([r, g, b]));
        }
    }

    fn clear_sums(&self, memory: &Memory) {
        if let Some(back) = &memory.back {
            let mut stages = Stages::new(&self.device, &self.kernels);
            stages.clear_sums(back);
            stages.submit();
        }
    }

    /// Reads each Gaussian's sums over pixels, and the device's discrete decisions about it.
    fn read_sums(&self, asset: &GpuAsset, memory: &Memory) -> Result<(Vec<SplatSums>, Vec<f32>)> {
        let (mut sums, mut flags) = (vec![[0.0; 10]; asset.count], vec![0.0; asset.count]);
        let Some(back) = &memory.back else { return Ok((sums, flags)) };
        let mut stages = Stages::new(&self.device, &self.kernels);
        stages.read_sums(back);
        let submission = stages.submit();
        let buffers: Vec<_> = back.sums.iter().map(|s| (&s.readback, SUMS * s.count as u64 + 4)).collect();
        let (mut first, mut is_cut_short) = (0, false);
        self.device.read(submission, &buffers, |i, bytes| {
            let chunk = first..first + back.sums[i].count;
            let (sum_bytes, rest) = bytes.split_at(40 * chunk.len());
            let (flag_bytes, loop_bytes) = rest.split_at(4 * chunk.len());
            is_cut_short |= loop_bytes != [0; 4];
            bytemuck::cast_slice_mut(&mut sums[chunk.clone()]).copy_from_slice(sum_bytes);
            bytemuck::cast_slice_mut(&mut flags[chunk.clone()]).copy_from_slice(flag_bytes);
            first = chunk.end;
        })?;
        if is_cut_short {
            return Err(self.device.loop_limit_error());
        }
        Ok((sums, flags))
    }
}

impl Differentiable for GpuRenderer {
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
        if camera.distortion.is_none() {
            let asset = self.upload(gaussians)?;
            self.backward_pinhole(&asset, gaussians, camera, options, (gradient, largest), &mut out)?;
            return Ok(out);
        }
        // Resampling needs the picture in any case.
        let (mut picture, mut picture_gradient) = (Rendered::default(), PictureGradient::default());
        let targets = (&mut picture, &mut picture_gradient, &mut out);
        self.render_with_gradients_into(gaussians, camera, options, targets, |_, g| {
            g.clone_from(gradient);
            Ok(())
        })?;
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
        self.render_with_gradients_into(gaussians, camera, options, targets, loss)
    }
}

/// Writes `scale` times the gradient of `count` pixels from row `first_row` on: red, green, blue, alpha, depth of each.
fn stage(gradient: &PictureGradient, scale: f64, first_row: usize, count: usize, out: &mut Vec<f32>) {
    let first = first_row * gradient.width as usize;
    let PictureGradient { color, alpha, depth, .. } = gradient;
    let scaled = |v: f32| (scale * f64::from(v)) as f32;
    out.clear();
    out.resize((PIXEL / 4) as usize * count, 0.0);
    out.par_chunks_exact_mut(5).enumerate().with_min_len(1 << 14).for_each(|(i, out)| {
        if let Some(color) = color.get(first + i) {
            out[..3].copy_from_slice(&color.map(scaled));
        }
        out[3] = alpha.get(first + i).copied().map_or(0.0, scaled);
        out[4] = depth.get(first + i).copied().map_or(0.0, scaled);
    });
}

/// Sums the tiles' gradients of the background, in their order, and counts those whose loop ended early.
fn sum(bytes: &[u8]) -> [f64; 4] {
    let mut total = [0.0; 4];
    for tile in bytemuck::cast_slice::<u8, [f32; 4]>(bytes) {
        for c in 0..4 {
            total[c] += f64::from(tile[c]);
        }
    }
    total
}
