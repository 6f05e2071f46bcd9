//! Masks: the pixels that show the vehicle.

use super::image::{check_len, strided_rows};
use std::sync::Arc;
use vg_geometry::{Error, Result};

/// Lowest mask value of vehicle pixels.
pub const VEHICLE_THRESHOLD: u8 = 128;

/// Label of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Label {
    /// Not vehicle: the ray of this pixel misses the vehicle.
    Background = 0,
    /// Unknown, for example outside the lens after undistortion.
    Unknown = 1,
    /// Vehicle.
    Vehicle = 255,
}

/// One label per pixel, rows without gaps. Clones share the labels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: u32,
    height: u32,
    /// `[height * width]`
    labels: Arc<[Label]>,
}

impl Mask {
    /// A mask from labels in row order; `labels.len()` must be `width * height`.
    pub fn new(width: u32, height: u32, labels: Vec<Label>) -> Result<Self> {
        check_len("mask", width, height, labels.len())?;
        Ok(Self { width, height, labels: labels.into() })
    }

    /// Copies from the caller's 8-bit buffer, whose rows start `row_stride` bytes apart; values of
    /// [`VEHICLE_THRESHOLD`] and above are vehicle. If no value is above 1, the values are 0 and 1, and 1 is vehicle.
    ///
    /// # Errors
    /// A largest value between: such a mask follows another convention and would be read as empty.
    pub fn from_strided(
        argument: &str,
        data: &[u8],
        width: u32,
        height: u32,
        row_stride: usize,
    ) -> Result<Self> {
        let rows = strided_rows(argument, data, width, height, row_stride, 1)?;
        let largest = rows.clone().filter_map(|row| row.iter().copied().max()).max().unwrap_or(0);
        let threshold = if largest == 1 { 1 } else { VEHICLE_THRESHOLD };
        if (2..VEHICLE_THRESHOLD).contains(&largest) {
            let allowed = format!(
                "0 and 255, where {VEHICLE_THRESHOLD} and above is vehicle, or 0 and 1, where 1 is vehicle"
            );
            return Err(Error::argument(argument, format!("largest value {largest}"), allowed));
        }
        let label = |&value: &u8| if value >= threshold { Label::Vehicle } else { Label::Background };
        // Row by row: an iterator over all pixels has no known length and is many times slower.
        let mut labels = Vec::with_capacity(width as usize * height as usize);
        rows.for_each(|row| labels.extend(row.iter().map(label)));
        Ok(Self { width, height, labels: labels.into() })
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

    /// Labels in row order. `[height * width]`
    #[inline]
    pub fn labels(&self) -> &[Label] {
        &self.labels
    }

    /// Whether the pixel in column u, row v is vehicle.
    #[inline]
    pub fn is_vehicle(&self, u: u32, v: u32) -> bool {
        self.labels[v as usize * self.width as usize + u as usize] == Label::Vehicle
    }

    /// The number of vehicle pixels.
    pub fn vehicle_pixels(&self) -> usize {
        self.labels.iter().filter(|&&l| l == Label::Vehicle).count()
    }

    /// First and last column and row with vehicle pixels, inclusive: `[u0, v0, u1, v1]`, or `None` if there are none.
    pub fn bounds(&self) -> Option<[u32; 4]> {
        let mut bounds: Option<[u32; 4]> = None;
        for (i, _) in self.labels.iter().enumerate().filter(|(_, l)| **l == Label::Vehicle) {
            let (u, v) = (i as u32 % self.width, i as u32 / self.width);
            let b = bounds.get_or_insert([u, v, u, v]);
            *b = [b[0].min(u), b[1].min(v), b[2].max(u), b[3].max(v)];
        }
        bounds
    }
}
