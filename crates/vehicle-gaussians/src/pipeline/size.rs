//! The length, width and height of the vehicle, which are smaller than those of the working box.

use crate::prior::{Ends, Geometry};
use serde::Serialize;
use vg_splat::Gaussians;

/// Share of the Gaussians at each end that are ignored as strays.
const STRAYS: f64 = 2e-4;

/// Error of an end that was measured as depth, metres: a pixel's footprint and the noise of a scan.
const MEASURED_M: f64 = 0.02;

/// Width of two outer mirrors, which an estimated surface often lacks, metres.
const MIRRORS_M: f64 = 0.2;

/// Length, width and height of the vehicle.
///
/// An estimated surface is closed, so its own ends are measured; measured depth gives the ends of its Gaussians. Outer
/// mirrors are thin and often missing from both: the width is then that of the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VehicleSize {
    /// Length, width, height, metres.
    pub size_m: [f64; 3],
    /// Their expected errors, metres.
    pub uncertainty_m: [f64; 3],
}

impl VehicleSize {
    /// `gaussians` are in the frame whose y = 0 is the plane of symmetry.
    pub(super) fn measured(gaussians: &Gaussians, geometry: &Geometry) -> Option<Self> {
        let ends = geometry.ends.or_else(|| ends(gaussians))?;
        let mirrors = if geometry.ends.is_some() { MIRRORS_M } else { 0.0 };
        let error = |k: usize| match k {
            // The sides mirror each other, and so do their errors: they add up.
            1 => (ends.error_m[1][0] + ends.error_m[1][1]).hypot(mirrors),
            k => ends.error_m[k][0].hypot(ends.error_m[k][1]),
        };
        Some(Self {
            size_m: std::array::from_fn(|k| ends.high[k] - ends.low[k]),
            uncertainty_m: std::array::from_fn(error),
        })
    }
}

/// The ends of Gaussians that show measured depth.
fn ends(gaussians: &Gaussians) -> Option<Ends> {
    let strays = (STRAYS * gaussians.len() as f64) as usize;
    let mut ends = Ends { low: [0.0; 3], high: [0.0; 3], error_m: [[MEASURED_M; 2]; 3] };
    for k in 0..3 {
        let mut along: Vec<f32> = gaussians.means().iter().map(|mean| mean[k]).collect();
        along.sort_unstable_by(f32::total_cmp);
        ends.low[k] = f64::from(*along.get(strays)?);
        ends.high[k] = f64::from(along[along.len() - 1 - strays]);
    }
    Some(ends)
}
