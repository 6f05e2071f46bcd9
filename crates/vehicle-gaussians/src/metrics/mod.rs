//! Error between a render and a photograph: PSNR, SSIM, silhouette IoU (method section 7).
//!
//! The photograph is composited on white with its mask, the render is drawn on white with its own alpha; both are
//! compared over the full frame, unmasked, so anything drawn beyond the silhouette counts as error.

mod lpips;
mod surface;
mod views;

pub use lpips::{LPIPS_MIN_SIDE, Lpips};
pub use surface::{F_SCORE_M, SurfaceErrors, SurfaceOptions, visible_surface};
pub use vg_splat::quality::{COLORS, check_colors, psnr, psnr_in, ssim};
pub use views::ViewErrors;

use vg_scene::View;
use vg_scene::mask::Label;

/// The masked photograph on white, RGB in [0, 1]. `[height * width]`
pub fn on_white(view: &View) -> Vec<[f32; 3]> {
    let pixel = |(i, rgb): (usize, &[u8; 3])| {
        let vehicle = view.mask.as_ref().is_none_or(|m| m.labels()[i] == Label::Vehicle);
        if vehicle { rgb.map(|c| f32::from(c) / 255.0) } else { [1.0; 3] }
    };
    view.image.pixels().iter().enumerate().map(pixel).collect()
}

/// Intersection over union of the rendered silhouette (alpha >= 0.5) and the view's mask, without unknown pixels; 1
/// where both are empty.
pub fn silhouette_iou(alpha: &[f32], view: &View) -> f64 {
    let [both, drawn, vehicle] = silhouettes(alpha, view);
    share(both, drawn + vehicle - both)
}

/// The part of the view's mask that the rendered silhouette covers, 0 to 1; 1 where the mask is empty.
pub fn mask_covered(alpha: &[f32], view: &View) -> f64 {
    let [both, _, vehicle] = silhouettes(alpha, view);
    share(both, vehicle)
}

/// The numbers of pixels in the intersection, in the rendered silhouette, and in the mask.
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
    use vg_geometry::{Camera, Intrinsics, Pose};
    use vg_scene::{Mask, RgbImage};

    #[test]
    fn silhouettes_are_compared_only_at_known_pixels() {
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
