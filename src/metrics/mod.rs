//! Error between a render and a photograph: PSNR, SSIM, silhouette IoU (method section 7).
//!
//! The photograph is composited on white with its mask, the render is drawn on white with its own alpha; both
//! are compared over the full frame, unmasked, so what spills over the silhouette costs.

mod lpips;
mod ssim;
mod surface;
mod views;

pub use lpips::{LPIPS_MIN_SIDE, Lpips};
pub use ssim::ssim;
pub(crate) use ssim::{Reference, WINDOW};
pub use surface::{F_SCORE_M, SurfaceErrors, SurfaceOptions, visible_surface};
pub use views::ViewErrors;

use crate::error::{Error, Result};
use crate::scene::View;
use crate::scene::mask::Label;

/// The masked photograph on white, RGB in [0, 1]. `[height * width]`
pub fn on_white(view: &View) -> Vec<[f32; 3]> {
    let pixel = |(i, rgb): (usize, &[u8; 3])| {
        let vehicle = view.mask.as_ref().is_none_or(|m| m.labels()[i] == Label::Vehicle);
        if vehicle { rgb.map(|c| f32::from(c) / 255.0) } else { [1.0; 3] }
    };
    view.image.pixels().iter().enumerate().map(pixel).collect()
}

/// What pictures in [0, 1] may hold: spherical harmonics overshoot white by tenths. What lies farther out is not of this
/// range (0 to 255, for one), and clamped it would be equal to anything as bright.
pub const COLORS: std::ops::RangeInclusive<f32> = -1.0..=2.0;

/// All finite and within [`COLORS`]; `argument` names the picture, whose rows have `width` pixels of `channels`.
///
/// # Errors
/// [`Error::Argument`] that names the first number that is not.
pub fn check_colors(argument: &str, values: &[f32], width: usize, channels: usize) -> Result<()> {
    let Some(at) = values.iter().position(|v| !COLORS.contains(v)) else { return Ok(()) };
    let (row, column) = (at / (width * channels), at / channels % width);
    let allowed = "0 to 1, and at most 1 beyond; divide the picture by its range first";
    Err(Error::argument(format!("{argument}[{row}, {column}]"), values[at].to_string(), allowed))
}

/// Peak signal-to-noise ratio of two pictures in [0, 1], dB; values outside are clamped first, as a display
/// would. Identical pictures give infinity.
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

/// Intersection over union of the rendered silhouette (alpha >= 0.5) and the view's mask, leaving out pixels
/// of which nothing is known; 1 where both are empty.
pub fn silhouette_iou(alpha: &[f32], view: &View) -> f64 {
    let [both, drawn, vehicle] = silhouettes(alpha, view);
    share(both, drawn + vehicle - both)
}

/// The part of the view's mask that the rendered silhouette covers, 0 to 1; 1 where the mask is empty.
pub fn mask_covered(alpha: &[f32], view: &View) -> f64 {
    let [both, _, vehicle] = silhouettes(alpha, view);
    share(both, vehicle)
}

/// Pixels of both silhouettes, of the rendered one, of the mask.
fn silhouettes(alpha: &[f32], view: &View) -> [usize; 3] {
    let mut counts = [0; 3];
    for (i, a) in alpha.iter().enumerate() {
        let label = view.mask.as_ref().map_or(Label::Vehicle, |m| m.labels()[i]);
        if label != Label::Unknown {
            let (drawn, vehicle) = (*a >= 0.5, label == Label::Vehicle);
            for (count, here) in counts.iter_mut().zip([drawn && vehicle, drawn, vehicle]) {
                *count += usize::from(here);
            }
        }
    }
    counts
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 1.0 } else { part as f64 / whole as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Intrinsics, Pose};
    use crate::scene::{Mask, RgbImage};

    #[test]
    fn silhouettes_are_compared_where_something_is_known() {
        let i = Intrinsics { fx: 4.0, fy: 4.0, cx: 2.0, cy: 0.5 };
        let mut view = View {
            name: "four in a row".into(),
            camera: Camera::pinhole(4, 1, i, Pose::IDENTITY).unwrap(),
            image: RgbImage::new(4, 1, vec![[0; 3]; 4]).unwrap(),
            mask: Some(Mask::from_strided("mask", &[255, 255, 0, 0], 4, 1, 4).unwrap()),
            depth: None,
        };
        let both = |alpha: [f32; 4], view: &View| (silhouette_iou(&alpha, view), mask_covered(&alpha, view));
        assert_eq!(both([1.0, 0.5, 0.49, 0.0], &view), (1.0, 1.0));
        assert_eq!(both([0.0, 1.0, 1.0, 0.0], &view), (1.0 / 3.0, 0.5));
        view.mask = Some(Mask::from_strided("mask", &[0; 4], 4, 1, 4).unwrap());
        assert_eq!(both([0.0; 4], &view), (1.0, 1.0));
        assert_eq!(both([1.0; 4], &view), (0.0, 1.0));
    }
}
