//! Views of distorted cameras resampled onto a pinhole that holds all they saw.
//!
//! Kernels know pinholes only. Pictures and silhouettes are resampled bilinearly; depth likewise within one
//! surface, by the nearest pixel elsewhere (an edge between two depths is not a surface). Pinhole pixels that the
//! lens did not see are labelled unknown, so that nobody takes them for background.

use super::mask::{Label, Mask};
use super::{DepthMap, RgbImage, View};
use crate::error::{Error, Result};
use crate::geometry::unfolded::Unfolded;
use crate::geometry::{Camera, Distortion, Intrinsics};
use rayon::prelude::*;

/// The pinhole may be this many times the source's width and height; wider corners are cut.
const MAX_GROWTH: f64 = 2.0;

/// The view on a pinhole grid; a pinhole view is returned as it is, sharing its pixels.
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

/// A pinhole with the same focal lengths and pose whose image plane covers the source's picture.
pub fn pinhole_for(source: &Camera) -> Result<Camera> {
    let (w, h) = (f64::from(source.width), f64::from(source.height));
    let i = source.intrinsics;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    const SAMPLES: u32 = 64;
    for k in 0..=SAMPLES {
        let t = f64::from(k) / f64::from(SAMPLES);
        for pixel in [[t * w, 0.0], [t * w, h], [0.0, t * h], [w, t * h], [t * w, 0.5 * h], [0.5 * w, t * h]]
        {
            if let Some(ray) = source.ray(pixel) {
                let p = i.pixel_from_normalized([ray.x, ray.y]);
                for axis in 0..2 {
                    low[axis] = low[axis].min(p[axis]);
                    high[axis] = high[axis].max(p[axis]);
                }
            }
        }
    }
    if !(low[0] < high[0] && low[1] < high[1]) {
        return Err(Error::argument(
            "camera.distortion",
            "no pixel has a ray in front of the camera",
            "a lens model that can be inverted inside the picture",
        ));
    }
    // Never beyond the allowed growth, nor beyond what a camera may be. What is cut is cut evenly around the source's
    // own frame where the picture reaches beyond it on both sides; a crop from a lens's corner lies wholly to one side.
    let cap = |low: f64, high: f64, size: f64| {
        let (margin, widest) = (0.5 * (MAX_GROWTH - 1.0) * size, MAX_GROWTH * size);
        let start = (-margin).clamp(low, (high - widest).max(low));
        let (low, high) = (start.floor(), high.min(start + widest).ceil());
        (low, (high - low).clamp(1.0, f64::from(crate::geometry::camera::MAX_SIDE)))
    };
    let (x0, width) = cap(low[0], high[0], w);
    let (y0, height) = cap(low[1], high[1], h);
    Camera::pinhole(
        width as u32,
        height as u32,
        Intrinsics { cx: i.cx - x0, cy: i.cy - y0, ..i },
        source.vehicle_from_camera,
    )
}

/// Position in the source's picture of every pixel centre of the pinhole, in row order.
fn source_pixels(pinhole: &Camera, source: &Camera) -> Vec<[f32; 2]> {
    let normalized =
        |u: u32, v: u32| pinhole.intrinsics.normalized_from_pixel([f64::from(u) + 0.5, f64::from(v) + 0.5]);
    let corners = [(0, 0), (pinhole.width, 0), (0, pinhole.height), (pinhole.width, pinhole.height)];
    let reach = corners.map(|(u, v)| normalized(u, v)).iter().fold(0.0f64, |r, n| r.max(n[0].hypot(n[1])));
    let unfolded = Unfolded::new(&source.distortion, reach);
    let row = |v: u32| {
        let unfolded = &unfolded;
        (0..pinhole.width).map(move |u| {
            let normalized = normalized(u, v);
            // A polynomial that has folded back lands inside the picture though no light came that way.
            if !unfolded.contains(normalized) {
                return [f32::NEG_INFINITY; 2];
            }
            source.intrinsics.pixel_from_normalized(source.distortion.distort(normalized)).map(|c| c as f32)
        })
    };
    (0..pinhole.height).into_par_iter().flat_map_iter(row).collect()
}

/// The four pixels around a position, edges repeated, and how far it lies between them.
pub(crate) struct Taps {
    /// Row-order indices: top left, top right, bottom left, bottom right.
    pub(crate) index: [usize; 4],
    across: f32,
    down: f32,
}

impl Taps {
    /// Pixel centres lie at (u + 0.5, v + 0.5).
    pub(crate) fn new([x, y]: [f32; 2], width: u32, height: u32) -> Self {
        let (x, y) = (x - 0.5, y - 0.5);
        let clamp = |v: f32, n: u32| v.clamp(0.0, (n - 1) as f32) as usize;
        let (u, v) = (x.floor(), y.floor());
        let (u0, u1) = (clamp(u, width), clamp(u + 1.0, width));
        let (v0, v1) = (clamp(v, height) * width as usize, clamp(v + 1.0, height) * width as usize);
        Self { index: [v0 + u0, v0 + u1, v1 + u0, v1 + u1], across: x - u, down: y - v }
    }

    /// Shares of the four pixels, in the order of `index`; their sum is 1.
    pub(crate) fn weights(&self) -> [f32; 4] {
        let (x, y) = (self.across, self.down);
        [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y]
    }

    /// Between four values in the order of `index`.
    pub(crate) fn blend(&self, [a, b, c, d]: [f32; 4]) -> f32 {
        let top = a + (b - a) * self.across;
        let bottom = c + (d - c) * self.across;
        top + (bottom - top) * self.down
    }

    /// Row-order index of the pixel that the position lies in.
    pub(crate) fn nearest(&self) -> usize {
        self.index[usize::from(self.across >= 0.5) + 2 * usize::from(self.down >= 0.5)]
    }
}

/// Bilinear colour; pixel centres at (u + 0.5, v + 0.5), edges repeated.
pub(crate) fn bilinear(image: &RgbImage, position: [f32; 2]) -> [u8; 3] {
    let taps = Taps::new(position, image.width(), image.height());
    let colors = taps.index.map(|i| image.pixels()[i]);
    std::array::from_fn(|k| taps.blend(colors.map(|c| f32::from(c[k]))).round() as u8)
}

/// Vehicle where the bilinear share of vehicle is at least half; unknown beside an unknown pixel.
fn label_at(mask: &Mask, taps: &Taps) -> Label {
    let labels = taps.index.map(|i| mask.labels()[i]);
    if labels.contains(&Label::Unknown) {
        return mask.labels()[taps.nearest()];
    }
    let share = taps.blend(labels.map(|l| if l == Label::Vehicle { 1.0 } else { 0.0 }));
    if share >= 0.5 { Label::Vehicle } else { Label::Background }
}

/// Depth in metres, 0 for none: bilinear in inverse depth (linear on a plane) where all four pixels lie on the
/// surface of the nearest one, else that pixel's own.
pub(crate) fn depth_at(depth: &DepthMap, taps: &Taps) -> f32 {
    /// Neighbours on one surface differ by less, relatively.
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
    use crate::geometry::Pose;

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
