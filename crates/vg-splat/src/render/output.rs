//! A rendered picture: colour, alpha and depth planes, or bytes.

use super::{Background, RenderOptions};
use rayon::prelude::*;
use vg_geometry::Result;

/// A rendered picture; rows without gaps, row 0 at the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rendered {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// RGB, not clamped above 1. `[height * width]`
    pub color: Vec<[f32; 3]>,
    /// 1 - transmittance. `[height * width]`
    pub alpha: Vec<f32>,
    /// Planar z in metres, see `DepthMode`. `[height * width]`
    pub depth: Vec<f32>,
}

impl Rendered {
    /// Converts to 8-bit RGB, rounded.
    pub fn to_rgb8(&self) -> Vec<[u8; 3]> {
        self.color.iter().map(|c| c.map(to_u8)).collect()
    }

    /// Converts to 8-bit RGBA with straight (not premultiplied) colour, for a render on a transparent background.
    pub fn to_rgba8(&self) -> Vec<[u8; 4]> {
        self.color.iter().zip(&self.alpha).map(straight).collect()
    }
}

fn straight((c, &a): (&[f32; 3], &f32)) -> [u8; 4] {
    let scale = if a > 0.0 { 1.0 / a } else { 0.0 };
    [to_u8(c[0] * scale), to_u8(c[1] * scale), to_u8(c[2] * scale), to_u8(a)]
}

/// An 8-bit picture, with working memory that is reused from picture to picture.
#[derive(Clone, Debug, Default)]
pub struct Rgba8 {
    /// Red, green, blue and alpha, rounded; rows without gaps. Over a background alpha is 255; on a transparent one
    /// colour is straight. `[height * width]`
    pub pixels: Vec<[u8; 4]>,
    planes: Rendered,
}

impl Rgba8 {
    /// Converts the planes that `draw` renders.
    pub(crate) fn make(
        &mut self,
        options: &RenderOptions,
        draw: impl FnOnce(&mut Rendered) -> Result<()>,
    ) -> Result<()> {
        draw(&mut self.planes)?;
        let Rendered { color, alpha, .. } = &self.planes;
        self.pixels.resize(color.len(), [0; 4]);
        let pixels = self.pixels.par_iter_mut().zip(color).zip(alpha).with_min_len(1 << 14);
        match options.background {
            Background::Transparent => pixels.for_each(|((out, c), a)| *out = straight((c, a))),
            Background::Color(_) => pixels.for_each(|((out, c), _)| {
                let [r, g, b] = c.map(to_u8);
                *out = [r, g, b, 255];
            }),
        }
        Ok(())
    }
}

/// Converts a value in [0, 1] to 8 bits, rounded.
pub fn to_u8(v: f32) -> u8 {
    // `as` saturates and converts NaN to 0.
    (v * 255.0).round() as u8
}
