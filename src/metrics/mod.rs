//! Error between a render and a photograph: PSNR, SSIM, silhouette IoU (method section 7).
//!
//! The photograph is composited on white with its mask, the render is drawn on white with its own alpha; both
//! are compared over the full frame, unmasked, so what spills over the silhouette costs.

mod ssim;
mod views;

pub use ssim::ssim;
pub use views::ViewErrors;

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
    let (mut both, mut either) = (0usize, 0usize);
    for (i, a) in alpha.iter().enumerate() {
        let label = view.mask.as_ref().map_or(Label::Vehicle, |m| m.labels()[i]);
        if label != Label::Unknown {
            let (drawn, vehicle) = (*a >= 0.5, label == Label::Vehicle);
            both += usize::from(drawn && vehicle);
            either += usize::from(drawn || vehicle);
        }
    }
    if either == 0 { 1.0 } else { both as f64 / either as f64 }
}
