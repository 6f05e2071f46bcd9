//! Photographs at the network's size, with intrinsics that follow exactly, and the way back to full resolution.

use super::contract::{Contract, Resize};
use crate::error::Result;
use crate::geometry::Intrinsics;
use crate::scene::undistort::{Taps, depth_at};
use crate::scene::{DepthMap, View};
use glam::DVec3;
use image::imageops::{self, FilterType};
use image::{ImageBuffer, Rgb};

/// How a photograph lies in the network's picture: u' = scale u - offset, both ways alike in v; pixels whose first
/// centre is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Of the network's picture.
    pub(crate) size: (u32, u32),
    scale: [f64; 2],
    offset: [u32; 2],
    /// Of the photograph before anything is cut.
    resized: (u32, u32),
}

impl Fit {
    /// A photograph of `width` x `height` in a picture of `size`.
    pub(crate) fn new(width: u32, height: u32, size: (u32, u32), resize: Resize) -> Self {
        let (w, h) = (f64::from(width), f64::from(height));
        let resized = match resize {
            Resize::Stretch => size,
            Resize::CoverCrop => {
                // What the released networks were trained with; the least more keeps the floor from losing a pixel.
                let a = (f64::from(size.0) / w).max(f64::from(size.1) / h) + 1e-8;
                (((w * a) as u32).max(size.0), ((h * a) as u32).max(size.1))
            }
        };
        let middle = |all: u32, kept: u32| (0.5 * f64::from(all - kept)).round_ties_even() as u32;
        Self {
            size,
            // Of the pictures as they are, rounded to whole pixels.
            scale: [f64::from(resized.0) / w, f64::from(resized.1) / h],
            offset: [middle(resized.0, size.0), middle(resized.1, size.1)],
            resized,
        }
    }

    /// The camera of the network's picture.
    pub(crate) fn intrinsics(&self, i: &Intrinsics) -> Intrinsics {
        let ([sx, sy], [left, top]) = (self.scale, self.offset.map(f64::from));
        Intrinsics { fx: sx * i.fx, fy: sy * i.fy, cx: sx * i.cx - left, cy: sy * i.cy - top }
    }

    /// Colours as the network takes them. `[3][height][width]`
    pub(crate) fn picture(&self, view: &View, contract: &Contract) -> Vec<f32> {
        let (width, height) = (view.camera.width, view.camera.height);
        let bytes = view.image.pixels().as_flattened().to_vec();
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
                *value = (color - contract.mean[c]) / contract.std[c];
            }
        }
        out
    }

    /// Depth of the network's picture at the photograph's pixels; 0 where the network did not see them.
    pub(crate) fn back(&self, depth: &DepthMap, width: u32, height: u32) -> Result<DepthMap> {
        let at = |pixel: usize| self.taps(pixel, width).map_or(0.0, |taps| depth_at(depth, &taps));
        DepthMap::new(width, height, (0..width as usize * height as usize).map(at).collect())
    }

    /// Index of the network's pixel in which the centre of the photograph's lies.
    pub(crate) fn nearest(&self, pixel: usize, width: u32) -> Option<usize> {
        self.taps(pixel, width).map(|taps| taps.nearest())
    }

    /// Where the centre of a photograph's pixel lies in the network's picture, if it does.
    fn taps(&self, pixel: usize, width: u32) -> Option<Taps> {
        let ([sx, sy], [left, top]) = (self.scale, self.offset.map(f64::from));
        let u = sx * (f64::from(pixel as u32 % width) + 0.5) - left;
        let v = sy * (f64::from(pixel as u32 / width) + 0.5) - top;
        let inside = |x: f64, n: u32| (0.0..f64::from(n)).contains(&x);
        let is_seen = inside(u, self.size.0) && inside(v, self.size.1);
        is_seen.then(|| Taps::new([u as f32, v as f32], self.size.0, self.size.1))
    }
}

/// Direction of a pixel's ray with z = 1.
pub(crate) fn ray(i: &Intrinsics, pixel: usize, width: u32) -> DVec3 {
    let (u, v) = (pixel as u32 % width, pixel as u32 / width);
    let [x, y] = i.normalized_from_pixel([f64::from(u) + 0.5, f64::from(v) + 0.5]);
    DVec3::new(x, y, 1.0)
}
