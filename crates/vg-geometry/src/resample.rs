//! Pictures resampled from one pixel grid onto another: the pinhole that covers a lens, and bilinear taps.

use crate::camera::MAX_SIDE;
use crate::unfolded::Unfolded;
use crate::{Camera, Error, Intrinsics, Result};
use rayon::prelude::*;

/// Maximum of the pinhole's width and height relative to the source; the rest is cropped.
const MAX_GROWTH: f64 = 2.0;

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
    // Limit the growth and the size of a camera. If the picture extends beyond the source's own frame on both sides, it
    // is cropped evenly; the picture of a crop from a lens's corner lies entirely to one side.
    let cap = |low: f64, high: f64, size: f64| {
        let (margin, widest) = (0.5 * (MAX_GROWTH - 1.0) * size, MAX_GROWTH * size);
        let start = (-margin).clamp(low, (high - widest).max(low));
        let (low, high) = (start.floor(), high.min(start + widest).ceil());
        (low, (high - low).clamp(1.0, f64::from(MAX_SIDE)))
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
pub fn source_pixels(pinhole: &Camera, source: &Camera) -> Vec<[f32; 2]> {
    let normalized =
        |u: u32, v: u32| pinhole.intrinsics.normalized_from_pixel([f64::from(u) + 0.5, f64::from(v) + 0.5]);
    let corners = [(0, 0), (pinhole.width, 0), (0, pinhole.height), (pinhole.width, pinhole.height)];
    let reach = corners.map(|(u, v)| normalized(u, v)).iter().fold(0.0f64, |r, n| r.max(n[0].hypot(n[1])));
    let unfolded = Unfolded::new(&source.distortion, reach);
    let row = |v: u32| {
        let unfolded = &unfolded;
        (0..pinhole.width).map(move |u| {
            let normalized = normalized(u, v);
            // Where the polynomial folds back, it can land inside the picture although no light came that way.
            if !unfolded.contains(normalized) {
                return [f32::NEG_INFINITY; 2];
            }
            source.intrinsics.pixel_from_normalized(source.distortion.distort(normalized)).map(|c| c as f32)
        })
    };
    (0..pinhole.height).into_par_iter().flat_map_iter(row).collect()
}

/// The four pixels around a position, edges repeated, and its fractional offsets between them.
pub struct Taps {
    /// Row-order indices: top left, top right, bottom left, bottom right.
    pub index: [usize; 4],
    across: f32,
    down: f32,
}

impl Taps {
    /// The taps of a position; pixel centres lie at (u + 0.5, v + 0.5).
    #[inline]
    pub fn new([x, y]: [f32; 2], width: u32, height: u32) -> Self {
        let (x, y) = (x - 0.5, y - 0.5);
        let clamp = |v: f32, n: u32| v.clamp(0.0, (n - 1) as f32) as usize;
        let (u, v) = (x.floor(), y.floor());
        let (u0, u1) = (clamp(u, width), clamp(u + 1.0, width));
        let (v0, v1) = (clamp(v, height) * width as usize, clamp(v + 1.0, height) * width as usize);
        Self { index: [v0 + u0, v0 + u1, v1 + u0, v1 + u1], across: x - u, down: y - v }
    }

    /// Weights of the four pixels, in the order of `index`; their sum is 1.
    #[inline]
    pub fn weights(&self) -> [f32; 4] {
        let (x, y) = (self.across, self.down);
        [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y]
    }

    /// Bilinear interpolation of four values in the order of `index`.
    #[inline]
    pub fn blend(&self, [a, b, c, d]: [f32; 4]) -> f32 {
        let top = a + (b - a) * self.across;
        let bottom = c + (d - c) * self.across;
        top + (bottom - top) * self.down
    }

    /// Row-order index of the pixel that contains the position.
    #[inline]
    pub fn nearest(&self) -> usize {
        self.index[usize::from(self.across >= 0.5) + 2 * usize::from(self.down >= 0.5)]
    }
}
