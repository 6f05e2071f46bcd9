//! Pictures of many cameras: the device draws the next one while the CPU processes the previous one.

use super::GpuRenderer;
use super::asset::GpuAsset;
use super::draw::{Flight, Pixels, Rows, Target, first_guess, pixels, tiles};
use super::frame::TILE;
use super::memory::Memory;
use crate::render::{Picture, RenderOptions};
use vg_geometry::{Camera, Result};

impl GpuRenderer {
    /// Renders a picture for each camera into the memory of `picture` and passes it to `take` with the camera's index,
    /// in order. The bytes are those of [`GpuRenderer::render_asset`] or [`GpuRenderer::render_asset_rgba8`]. `take`
    /// may use this renderer.
    ///
    /// Errors: those of `take` and of [`GpuRenderer::render_asset`], for the first camera that has one.
    pub fn render_each<P: Picture>(
        &self,
        asset: &GpuAsset,
        cameras: &[Camera],
        options: &RenderOptions,
        picture: &mut P,
        mut take: impl FnMut(usize, &P) -> Result<()>,
    ) -> Result<()> {
        let mut before = None;
        for i in 0..=cameras.len() {
            let next = match cameras.get(i) {
                Some(camera) => self.begin(asset, camera, options, picture.target().pixels()),
                None => Ok(None),
            };
            if let Some(drawn) = i.checked_sub(1) {
                let camera = &cameras[drawn];
                let is_whole = match before.take() {
                    Some(flight) => self.end(flight, camera, &mut picture.target())?,
                    None => false,
                };
                if !is_whole {
                    picture.draw_on(self, asset, camera, options)?;
                }
                take(drawn, picture)?;
            }
            before = next?;
        }
        Ok(())
    }

    /// Submits a picture to the device, if it may fit into one slice of one band.
    fn begin(
        &self,
        asset: &GpuAsset,
        camera: &Camera,
        options: &RenderOptions,
        format: Pixels,
    ) -> Result<Option<Flight>> {
        camera.validate("camera")?;
        options.validate()?;
        if !camera.distortion.is_none() {
            return Ok(None);
        }
        let mut held = self.lock();
        let mut memory = held.take().unwrap_or_else(|| Memory::new(&self.device));
        let (mut frame, depth_bits) = self.frame(asset, camera, options, &mut memory);
        if self.rows_per_band(camera) < frame.tile_rows || memory.sliced_asset == Some(asset.id) {
            *held = Some(memory);
            return Ok(None);
        }
        let rows = Rows { first: 0, count: frame.tile_rows };
        let tiles = tiles(camera, rows.count);
        memory.reserve_band(&self.device, tiles, pixels(camera, rows));
        memory.reserve_pairs(&self.device, first_guess(asset, self.bounds.pairs.max(tiles)));
        frame.is_last = format.last();
        let flight = self.submit_slice(asset, camera, &mut frame, depth_bits, &mut memory, format);
        // An error that the device reports later is returned by a later call.
        self.device.check()?;
        *held = Some(memory);
        Ok(Some(flight))
    }

    /// Waits for a picture; returns `false` if the slice did not contain all of it.
    fn end(&self, flight: Flight, camera: &Camera, target: &mut Target) -> Result<bool> {
        let mut held = self.lock();
        let mut memory = held.take().unwrap_or_else(|| Memory::new(&self.device));
        target.resize(camera);
        let slice = self.finish_slice(flight, &mut memory, target)?;
        let most = self.bounds.pairs.max(tiles(camera, camera.height.div_ceil(TILE)));
        let needed = u64::from(slice.pairs);
        if !slice.is_whole() && needed <= most {
            memory.reserve_pairs(&self.device, needed.next_power_of_two().min(most));
        }
        *held = Some(memory);
        Ok(slice.is_whole())
    }
}
