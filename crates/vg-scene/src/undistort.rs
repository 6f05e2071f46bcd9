//! Resampling of views of distorted cameras onto a pinhole camera that covers the whole picture.
//!
//! Kernels support pinholes only. Pictures and silhouettes are resampled bilinearly. Depth is resampled bilinearly
//! within one surface and by the nearest pixel elsewhere (an edge between two depths is not a surface). Pinhole pixels
//! that the lens did not see are labelled unknown, so that they do not count as background.

use super::mask::{Label, Mask};
use super::{DepthMap, RgbImage, View};
use vg_geometry::resample::{Taps, pinhole_for, source_pixels};
use vg_geometry::{Camera, Distortion, Result};

/// The view on a pinhole grid; a pinhole view is returned unchanged, sharing its pixels.
pub fn undistorted(view: &View) -> Result<View> {
    if view.camera.distortion.is_none() {
        let camera = Camera { distortion: Distortion::None, ..view.camera };
        return Ok(View { camera, ..view.clone() });
    }
    let camera = pinhole_for(&view.camera)?;
    let map = source_pixels(&camera, &view.camera);
    let inside = |p: &[f32; 2]| {
        p[0] >= 0.0 && p[1] >= 0.0 && p[0] < view.camera.width as f32 && p[1] < view.camera.height as f32
    };
    let (width, height) = (camera.width, camera.height);

    let pixels = map.iter().map(|p| if inside(p) { bilinear(&view.image, *p) } else { [0; 3] }).collect();
    let label = |p: &[f32; 2]| match &view.mask {
        _ if !inside(p) => Label::Unknown,
        Some(mask) => label_at(mask, &Taps::new(*p, mask.width(), mask.height())),
        None => Label::Vehicle,
    };
    let labels = map.iter().map(label).collect();
    let depth = match &view.depth {
        None => None,
        Some(depth) => {
            let taps = |p: &[f32; 2]| Taps::new(*p, depth.width(), depth.height());
            let sample = |p: &[f32; 2]| if inside(p) { depth_at(depth, &taps(p)) } else { 0.0 };
            Some(DepthMap::new(width, height, map.iter().map(sample).collect())?)
        }
    };
    Ok(View {
        name: view.name.clone(),
        camera,
        image: RgbImage::new(width, height, pixels)?,
        mask: view.mask.is_some().then(|| Mask::new(width, height, labels)).transpose()?,
        depth,
    })
}

/// Bilinear colour; pixel centres at (u + 0.5, v + 0.5), edges repeated.
pub(crate) fn bilinear(image: &RgbImage, position: [f32; 2]) -> [u8; 3] {
    let taps = Taps::new(position, image.width(), image.height());
    let colors = taps.index.map(|i| image.pixels()[i]);
    std::array::from_fn(|k| taps.blend(colors.map(|c| f32::from(c[k]))).round() as u8)
}

/// Vehicle if the bilinear share of vehicle is at least half; next to an unknown pixel, the nearest pixel's label.
fn label_at(mask: &Mask, taps: &Taps) -> Label {
    let labels = taps.index.map(|i| mask.labels()[i]);
    if labels.contains(&Label::Unknown) {
        return mask.labels()[taps.nearest()];
    }
    let share = taps.blend(labels.map(|l| if l == Label::Vehicle { 1.0 } else { 0.0 }));
    if share >= 0.5 { Label::Vehicle } else { Label::Background }
}

/// Depth in metres, 0 for none: bilinear in inverse depth (linear on a plane) if all four pixels lie on the
/// surface of the nearest one, else the depth of that pixel.
pub(crate) fn depth_at(depth: &DepthMap, taps: &Taps) -> f32 {
    /// Largest relative difference of neighbours on one surface.
    const SAME_SURFACE: f32 = 0.02;
    let nearest = depth.depth()[taps.nearest()];
    let around = taps.index.map(|i| depth.depth()[i]);
    if nearest > 0.0 && around.iter().all(|d| (d - nearest).abs() < SAME_SURFACE * nearest) {
        taps.blend(around.map(f32::recip)).recip()
    } else {
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::{Intrinsics, Pose};

    #[test]
    fn a_pinhole_view_comes_back_without_a_copy_of_any_pixel() {
        let intrinsics = Intrinsics { fx: 4.0, fy: 4.0, cx: 2.0, cy: 1.5 };
        let depth = DepthMap::new(4, 3, vec![2.0; 12]).unwrap().with_confidence(vec![0.5; 12]).unwrap();
        let view = View {
            name: "pinhole".into(),
            camera: Camera::pinhole(4, 3, intrinsics, Pose::IDENTITY).unwrap(),
            image: RgbImage::new(4, 3, vec![[7; 3]; 12]).unwrap(),
            mask: Some(Mask::new(4, 3, vec![Label::Vehicle; 12]).unwrap()),
            depth: Some(depth),
        };
        let same = undistorted(&view).unwrap();
        assert_eq!(same.camera, view.camera);
        assert_eq!(same.image.pixels().as_ptr(), view.image.pixels().as_ptr());
        let labels = |view: &View| view.mask.as_ref().unwrap().labels().as_ptr();
        assert_eq!(labels(&same), labels(&view));
        let depth = |view: &View| {
            let map = view.depth.as_ref().unwrap();
            (map.depth().as_ptr(), map.confidence().unwrap().as_ptr())
        };
        assert_eq!(depth(&same), depth(&view));
    }
}
