//! Differences between two pictures: PSNR and SSIM.

mod ssim;

pub use ssim::{Reference, WINDOW, ssim};

use vg_geometry::{Error, Result};

/// Range of values accepted in pictures that are nominally in [0, 1]: spherical harmonics overshoot white by tenths.
/// Values farther out mean another range, such as 0 to 255; clamping them would hide all differences.
pub const COLORS: std::ops::RangeInclusive<f32> = -1.0..=2.0;

/// Checks that all values are finite and within [`COLORS`]; `argument` names the picture, whose rows have `width`
/// pixels of `channels`.
///
/// # Errors
/// [`Error::Argument`] that names the first number outside.
pub fn check_colors(argument: &str, values: &[f32], width: usize, channels: usize) -> Result<()> {
    let Some(at) = values.iter().position(|v| !COLORS.contains(v)) else { return Ok(()) };
    let (row, column) = (at / (width * channels), at / channels % width);
    let allowed = "0 to 1, and at most 1 beyond; divide the picture by its range first";
    Err(Error::argument(format!("{argument}[{row}, {column}]"), values[at].to_string(), allowed))
}

/// Peak signal-to-noise ratio of two pictures in [0, 1], dB; values outside are clamped first, as on a display.
/// Returns infinity for identical pictures.
pub fn psnr(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of different sizes");
    let squared = |(a, b): (&[f32; 3], &[f32; 3])| -> f64 {
        (0..3).map(|c| f64::from(a[c].clamp(0.0, 1.0) - b[c].clamp(0.0, 1.0)).powi(2)).sum()
    };
    let mse = a.iter().zip(b).map(squared).sum::<f64>() / (3 * a.len()) as f64;
    -10.0 * mse.log10()
}

/// PSNR inside the rectangle `[u0, v0, u1, v1]` (inclusive) of pictures `width` wide.
pub fn psnr_in(a: &[[f32; 3]], b: &[[f32; 3]], width: u32, [u0, v0, u1, v1]: [u32; 4]) -> f64 {
    let crop = |image: &[[f32; 3]]| -> Vec<[f32; 3]> {
        (v0..=v1)
            .flat_map(|v| &image[(v * width + u0) as usize..=(v * width + u1) as usize])
            .copied()
            .collect()
    };
    psnr(&crop(a), &crop(b))
}
