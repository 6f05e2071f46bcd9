//! A rendered picture: colour, alpha and depth planes.

/// What a renderer draws; rows without gaps, row 0 at the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rendered {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGB, not clamped above 1. `[height * width]`
    pub color: Vec<[f32; 3]>,
    /// 1 - transmittance. `[height * width]`
    pub alpha: Vec<f32>,
    /// Planar z in metres, see `DepthMode`. `[height * width]`
    pub depth: Vec<f32>,
}

impl Rendered {
    /// RGB as 8-bit, rounded.
    pub fn to_rgb8(&self) -> Vec<[u8; 3]> {
        self.color.iter().map(|c| c.map(to_u8)).collect()
    }

    /// RGBA as 8-bit with straight (not premultiplied) colour, for a render on a transparent background.
    pub fn to_rgba8(&self) -> Vec<[u8; 4]> {
        let pixel = |(c, &a): (&[f32; 3], &f32)| {
            let scale = if a > 0.0 { 1.0 / a } else { 0.0 };
            [to_u8(c[0] * scale), to_u8(c[1] * scale), to_u8(c[2] * scale), to_u8(a)]
        };
        self.color.iter().zip(&self.alpha).map(pixel).collect()
    }
}

/// 8 bits of a value in [0, 1], rounded.
pub(crate) fn to_u8(v: f32) -> u8 {
    // `as` saturates and sends NaN to 0.
    (v * 255.0).round() as u8
}
