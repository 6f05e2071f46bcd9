//! Resampling of photographs to the network's size, with exact intrinsics, and of its outputs back to full resolution.

use super::framing::{Framing, Resize};
use super::undistort::depth_at;
use super::{DepthMap, RgbImage};
use glam::DVec3;
use image::imageops::{self, FilterType};
use image::{ImageBuffer, Rgb};
use vg_geometry::resample::Taps;
use vg_geometry::{Intrinsics, Result};

/// Mapping from a photograph to the network's picture: u' = scale u - offset, and v' in the same way, in pixels whose
/// first centre is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Width and height of the network's picture.
    pub size: (u32, u32),
    scale: [f64; 2],
    offset: [u32; 2],
    /// Width and height of the scaled photograph before it is cropped.
    resized: (u32, u32),
}

impl Fit {
    /// The mapping of a photograph of `width` x `height` to a picture of `size`; `None` if nearly all would be cropped.
    pub fn new(width: u32, height: u32, size: (u32, u32), resize: Resize) -> Option<Self> {
        /// Maximum area of the scaled photograph over that of the network's picture.
        const MOST: u64 = 16;
        let (w, h) = (f64::from(width), f64::from(height));
        let resized = match resize {
            Resize::Stretch => size,
            Resize::CoverCrop => {
                // As in the training of the released networks; 1e-8 keeps the floor from losing a pixel.
                let a = (f64::from(size.0) / w).max(f64::from(size.1) / h) + 1e-8;
                (((w * a) as u32).max(size.0), ((h * a) as u32).max(size.1))
            }
        };
        let area = |(w, h): (u32, u32)| u64::from(w) * u64::from(h);
        if area(resized) > MOST * area(size) {
            return None;
        }
        let middle = |all: u32, kept: u32| (0.5 * f64::from(all - kept)).round_ties_even() as u32;
        Some(Self {
            size,
            // Exact scale after rounding to whole pixels.
            scale: [f64::from(resized.0) / w, f64::from(resized.1) / h],
            offset: [middle(resized.0, size.0), middle(resized.1, size.1)],
            resized,
        })
    }

    /// Intrinsics of the network's picture.
    pub fn intrinsics(&self, i: &Intrinsics) -> Intrinsics {
        let ([sx, sy], [left, top]) = (self.scale, self.offset.map(f64::from));
        Intrinsics { fx: sx * i.fx, fy: sy * i.fy, cx: sx * i.cx - left, cy: sy * i.cy - top }
    }

    /// Normalised colours of the network's picture. `[3][height][width]`
    pub fn picture(&self, image: &RgbImage, framing: &Framing) -> Vec<f32> {
        let (width, height) = (image.width(), image.height());
        let bytes = image.pixels().as_flattened().to_vec();
        let photograph: ImageBuffer<Rgb<u8>, _> =
            ImageBuffer::from_raw(width, height, bytes).expect("three bytes a pixel");
        let filter = if self.resized.0 < width { FilterType::Lanczos3 } else { FilterType::CatmullRom };
        let resized = match self.resized == (width, height) {
            true => photograph,
            false => imageops::resize(&photograph, self.resized.0, self.resized.1, filter),
        };
        let (w, h) = self.size;
        let mut out = vec![0.0; 3 * w as usize * h as usize];
        for (c, plane) in out.chunks_exact_mut(w as usize * h as usize).enumerate() {
            for (i, value) in plane.iter_mut().enumerate() {
                let (u, v) = (i as u32 % w + self.offset[0], i as u32 / w + self.offset[1]);
                let color = f32::from(resized.get_pixel(u, v).0[c]) / 255.0;
                *value = (color - framing.mean[c]) / framing.std[c];
            }
        }
        out
    }

    /// Depth of the network's picture at the photograph's pixels; 0 for pixels that were cropped.
    pub fn back(&self, depth: &DepthMap, width: u32, height: u32) -> Result<DepthMap> {
        let at = |pixel: usize| self.taps(pixel, width).map_or(0.0, |taps| depth_at(depth, &taps));
        DepthMap::new(width, height, (0..width as usize * height as usize).map(at).collect())
    }

    /// Index of the network's pixel that contains the centre of a photograph's pixel; `None` if it was cropped.
    pub fn nearest(&self, pixel: usize, width: u32) -> Option<usize> {
        self.taps(pixel, width).map(|taps| taps.nearest())
    }

    /// Position of the centre of a photograph's pixel in the network's picture; `None` if it was cropped.
    pub fn taps(&self, pixel: usize, width: u32) -> Option<Taps> {
        let ([sx, sy], [left, top]) = (self.scale, self.offset.map(f64::from));
        let u = sx * (f64::from(pixel as u32 % width) + 0.5) - left;
        let v = sy * (f64::from(pixel as u32 / width) + 0.5) - top;
        let inside = |x: f64, n: u32| (0.0..f64::from(n)).contains(&x);
        let is_seen = inside(u, self.size.0) && inside(v, self.size.1);
        is_seen.then(|| Taps::new([u as f32, v as f32], self.size.0, self.size.1))
    }
}

/// Direction of a pixel's ray with z = 1.
pub fn ray(i: &Intrinsics, pixel: usize, width: u32) -> DVec3 {
    i.pixel_ray(pixel as u32 % width, pixel as u32 / width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intrinsics_follow_the_pixels() {
        // Twice as large, and 20 columns cut on each side.
        let fit = Fit::new(100, 50, (160, 100), Resize::CoverCrop).unwrap();
        let i = fit.intrinsics(&Intrinsics { fx: 80.0, fy: 81.0, cx: 50.0, cy: 24.0 });
        assert_eq!((i.fx, i.fy, i.cx, i.cy), (160.0, 162.0, 80.0, 48.0));
        let fit = Fit::new(100, 50, (160, 100), Resize::Stretch).unwrap();
        let i = fit.intrinsics(&Intrinsics { fx: 80.0, fy: 81.0, cx: 50.0, cy: 24.0 });
        assert_eq!((i.fx, i.fy, i.cx, i.cy), (128.0, 162.0, 80.0, 48.0));
        assert!(Fit::new(1, 8192, (518, 392), Resize::CoverCrop).is_none());
    }

    #[test]
    fn depth_comes_back_to_where_it_was() {
        let fit = Fit::new(8, 4, (12, 8), Resize::CoverCrop).unwrap();
        // Twice as large; two of 16 columns are cut on each side, which is one of 8.
        let columns: Vec<f32> = (0..96).map(|i| 1.0 + 0.001 * (i % 12) as f32).collect();
        let back = fit.back(&DepthMap::new(12, 8, columns).unwrap(), 8, 4).unwrap();
        assert_eq!((back.get(0, 1), back.get(7, 2)), (None, None));
        for u in 1..7 {
            let expected = 1.0 + 0.001 * (2.0 * (u as f32 - 1.0) + 0.5);
            assert!((back.get(u, 2).unwrap() - expected).abs() < 1e-5);
        }
        // In the middle of four pixels, the last of them counts as nearest.
        assert_eq!((fit.nearest(0, 8), fit.nearest(1, 8)), (None, Some(13)));
    }
}
