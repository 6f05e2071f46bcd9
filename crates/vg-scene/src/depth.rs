//! Metric depth per pixel: planar z along the optical axis, metres.

use super::image::{check_len, strided_rows};
use std::sync::Arc;
use vg_geometry::Result;

/// Planar depth in metres with confidence; a pixel without a measurement holds 0. Clones share
/// both.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    width: u32,
    height: u32,
    /// `[height * width]`
    depth: Arc<[f32]>,
    /// `[height * width]`
    confidence: Option<Arc<[f32]>>,
}

/// Largest measured depth; larger values count as no measurement, like NaN, infinity and values <= 0.
pub const MAX_DEPTH_M: f32 = 1e5;

impl DepthMap {
    /// A depth map from depths in row order; values that are not measurements (NaN, infinite, <= 0, beyond
    /// [`MAX_DEPTH_M`]) become 0 = none. `depth.len()` must be `width * height`.
    pub fn new(width: u32, height: u32, depth: Vec<f32>) -> Result<Self> {
        check_len("depth", width, height, depth.len())?;
        let depth = depth.into_iter().map(measured).collect();
        Ok(Self { width, height, depth, confidence: None })
    }

    /// Copies from the caller's buffer of metres, whose rows start `row_stride` floats apart.
    pub fn from_strided(
        argument: &str,
        data: &[f32],
        width: u32,
        height: u32,
        row_stride: usize,
    ) -> Result<Self> {
        let rows = strided_rows(argument, data, width, height, row_stride, 1)?;
        let mut depth = Vec::with_capacity(width as usize * height as usize);
        rows.for_each(|row| depth.extend(row.iter().map(|&d| measured(d))));
        Ok(Self { width, height, depth: depth.into(), confidence: None })
    }

    /// This depth map with a confidence in [0, 1] per pixel.
    pub fn with_confidence(mut self, confidence: Vec<f32>) -> Result<Self> {
        check_len("confidence", self.width, self.height, confidence.len())?;
        self.confidence = Some(confidence.into());
        Ok(self)
    }

    /// This depth map without the measurements for which `keep` (of a pixel's index in row order) is false.
    pub fn where_kept(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept = |(i, &d): (usize, &f32)| if keep(i) { d } else { 0.0 };
        Self { depth: self.depth.iter().enumerate().map(kept).collect(), ..self.clone() }
    }

    /// Columns.
    #[inline]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[inline]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Planar z in metres in row order, 0 without a measurement. `[height * width]`
    #[inline]
    pub fn depth(&self) -> &[f32] {
        &self.depth
    }

    /// Confidence in [0, 1] in row order, if the source provides it. `[height * width]`
    #[inline]
    pub fn confidence(&self) -> Option<&[f32]> {
        self.confidence.as_deref()
    }

    /// Depth in column u, row v, or `None` without a measurement.
    #[inline]
    pub fn get(&self, u: u32, v: u32) -> Option<f32> {
        let d = self.depth[v as usize * self.width as usize + u as usize];
        (d > 0.0).then_some(d)
    }
}

fn measured(d: f32) -> f32 {
    if d > 0.0 && d <= MAX_DEPTH_M { d } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_no_measurement_are_stored_as_none() {
        let d = DepthMap::new(6, 1, vec![f32::NAN, f32::INFINITY, -1.0, 0.0, 1e9, 2.5]).unwrap();
        assert_eq!(d.depth(), [0.0, 0.0, 0.0, 0.0, 0.0, 2.5]);
        assert_eq!(d.get(0, 0), None);
        assert_eq!(d.get(5, 0), Some(2.5));
    }
}
