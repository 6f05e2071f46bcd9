//! Error of a model's surface against a scan, metres: accuracy, completeness, Chamfer distance, F-score (Knapitsch et
//! al. 2017, Tanks and Temples), and the error of its size.
//!
//! 1. The model's surface is the part visible to cameras outside and above it (`seen`), as to a scanner, not its
//!    centres.
//! 2. Isolated points of the scan are removed (`strays`).
//! 3. Both sides are thinned to one point per cell of a regular grid (`grid`), so sampling density does not matter.
//! 4. Distances are taken from each point to the nearest of the other side, at most [`SurfaceOptions::reach_m`].
//!
//! Distances are from point to point: even a perfect model is about half the scan's spacing away from it.

mod grid;
mod seen;
mod strays;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;
use vg_geometry::nearest::Nearest;
use vg_geometry::progress::{UNWATCHED, Watch};
use vg_geometry::{Error, Result, measures};
use vg_scene::Cloud;
use vg_splat::Gaussians;

/// The distance below which a point counts as met, metres.
pub const F_SCORE_M: f64 = 0.05;

/// Options of the comparison of a surface with a scan; lengths in metres, 1e-3 to 1e3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// The distance below which a point counts as met.
    pub f_score_m: f64,
    /// The largest distance counted; larger ones are cut to it, so a missing part counts as this far away.
    pub reach_m: f64,
    /// Side of the grid's cells, of which each keeps one point.
    pub cell_m: f64,
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        Self { f_score_m: F_SCORE_M, reach_m: 0.5, cell_m: 0.02 }
    }
}

impl SurfaceOptions {
    /// Checks that each field is in its range.
    ///
    /// # Errors
    /// [`Error::Argument`] with the field's name.
    pub fn validate(&self) -> Result<()> {
        for (name, value) in
            [("f_score_m", self.f_score_m), ("reach_m", self.reach_m), ("cell_m", self.cell_m)]
        {
            if !(1e-3..=1e3).contains(&value) {
                return Err(Error::argument(format!("options.{name}"), value.to_string(), "0.001 to 1000"));
            }
        }
        Ok(())
    }
}

measures! {
    /// The error of a model's surface against a scan.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct SurfaceErrors {
        /// Mean distance from the model's surface to the scan, metres; distances above 0.5 m count as 0.5 m.
        pub accuracy_m: f64 => ("", 4, Lower),
        /// Mean distance from the scan to the model's surface, metres, likewise.
        pub completeness_m: f64 => ("", 4, Lower),
        /// Mean of the two.
        pub chamfer_m: f64 => ("Chamfer m", 4, Lower),
        /// Share of the model's surface that is nearer to the scan than `options.f_score_m`.
        pub precision: f64 => ("", 3, Higher),
        /// Share of the scan that is nearer to the model's surface than `options.f_score_m`.
        pub recall: f64 => ("", 3, Higher),
        /// Harmonic mean of the two.
        pub f_score: f64 => ("F 5 cm", 3, Higher),
        /// How much longer (x) the model is than the scan, percent; negative: shorter.
        pub length_error_percent: f64 => ("length %", 2, NearZero),
        /// The same of the width (y).
        pub width_error_percent: f64 => ("width %", 2, NearZero),
        /// The same of the height (z).
        pub height_error_percent: f64 => ("height %", 2, NearZero),
    }
}

/// Fraction of the work, in time, that is done once the visible surface has been rendered.
const SEEN: f64 = 0.7;

/// Fraction of points cut off at either end of an axis: strays so near to the vehicle that they were not recognised. A
/// larger one would cut off mirrors.
const BEYOND: f64 = 0.0005;

impl SurfaceErrors {
    /// The errors of a model against points measured on the vehicle, vehicle frame, metres, with default options.
    ///
    /// # Errors
    /// The model has no visible surface; also those of [`SurfaceErrors::between`].
    pub fn of(gaussians: &Gaussians, scan: &[[f32; 3]]) -> Result<Self> {
        Self::with(gaussians, scan, &SurfaceOptions::default())
    }

    /// [`SurfaceErrors::of`] with the given options.
    ///
    /// # Errors
    /// As [`SurfaceErrors::of`].
    pub fn with(gaussians: &Gaussians, scan: &[[f32; 3]], options: &SurfaceOptions) -> Result<Self> {
        Self::watched(gaussians, scan, options, &UNWATCHED)
    }

    /// [`SurfaceErrors::with`] under `watch`.
    ///
    /// # Errors
    /// As [`SurfaceErrors::of`], and [`Error::Cancelled`].
    pub fn watched(
        gaussians: &Gaussians,
        scan: &[[f32; 3]],
        options: &SurfaceOptions,
        watch: &Watch,
    ) -> Result<Self> {
        options.validate()?;
        Cloud::check("scan", scan)?;
        let model = surface(gaussians, options.cell_m, watch)?;
        watch.report(SEEN)?;
        Self::compared(&model, scan, options, watch)
    }

    /// The errors of points that all lie on the model's surface, against a scan, which may have strays.
    ///
    /// # Errors
    /// A side has no points, too many for a [`Cloud`], or one that is not finite; or an option is out of range.
    pub fn between(model: &[[f32; 3]], scan: &[[f32; 3]], options: &SurfaceOptions) -> Result<Self> {
        options.validate()?;
        Cloud::check("model", model)?;
        Cloud::check("scan", scan)?;
        Self::compared(model, scan, options, &UNWATCHED)
    }

    /// The errors of checked points and options.
    fn compared(
        model: &[[f32; 3]],
        scan: &[[f32; 3]],
        options: &SurfaceOptions,
        watch: &Watch,
    ) -> Result<Self> {
        let model = grid::thinned(model, options.cell_m);
        let scan = grid::thinned(&strays::removed(scan, watch), options.cell_m);
        watch.check()?;
        let there = distances(&model, &scan, options.reach_m, watch);
        let back = distances(&scan, &model, options.reach_m, watch);
        watch.check()?;
        let (accuracy_m, completeness_m) = (mean(&there), mean(&back));
        let (precision, recall) = (share(&there, options.f_score_m), share(&back, options.f_score_m));
        let both = precision + recall;
        let of_model = extents(&strays::removed(&model, watch));
        watch.check()?;
        let of_scan = extents(&scan);
        let [length, width, height] = std::array::from_fn(|k| {
            if of_scan[k] > 0.0 { 100.0 * (of_model[k] / of_scan[k] - 1.0) } else { 0.0 }
        });
        Ok(Self {
            accuracy_m,
            completeness_m,
            chamfer_m: 0.5 * (accuracy_m + completeness_m),
            precision,
            recall,
            f_score: if both > 0.0 { 2.0 * precision * recall / both } else { 0.0 },
            length_error_percent: length,
            width_error_percent: width,
            height_error_percent: height,
        })
    }
}

/// The surface of a model visible from outside and above, one point per cell of a regular grid, vehicle frame, metres.
///
/// # Errors
/// The model has no Gaussians or no visible surface.
pub fn visible_surface(gaussians: &Gaussians, cell_m: f64) -> Result<Vec<[f32; 3]>> {
    surface(gaussians, cell_m, &UNWATCHED)
}

/// As [`visible_surface`], under `watch`.
fn surface(gaussians: &Gaussians, cell_m: f64, watch: &Watch) -> Result<Vec<[f32; 3]>> {
    let points = grid::thinned(&seen::points(gaussians, cell_m, watch)?, cell_m);
    if points.is_empty() {
        let found = "nothing with an alpha of 0.5 from any side";
        return Err(Error::argument("gaussians", found, "a visible surface"));
    }
    Ok(points)
}

/// Distance from each point to the nearest of the others, at most `reach`.
fn distances(points: &[[f32; 3]], others: &[[f32; 3]], reach: f64, watch: &Watch) -> Vec<f64> {
    let tree = Nearest::from_f32(others);
    let distance = |p: &[f32; 3]| {
        if watch.is_stopped() {
            return reach;
        }
        tree.nearest(DVec3::from_array(p.map(f64::from))).map_or(reach, |n| n.squared.sqrt().min(reach))
    };
    points.par_iter().map(distance).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn share(distances: &[f64], below: f64) -> f64 {
    distances.iter().filter(|d| **d < below).count() as f64 / distances.len() as f64
}

/// Extent along each axis, without [`BEYOND`] of the points at either end.
fn extents(points: &[[f32; 3]]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let mut along: Vec<f32> = points.iter().map(|p| p[k]).collect();
        let beyond = (BEYOND * along.len() as f64) as usize;
        let last = along.len() - 1;
        let low = *along.select_nth_unstable_by(beyond, f32::total_cmp).1;
        let high = *along.select_nth_unstable_by(last - beyond, f32::total_cmp).1;
        f64::from(high) - f64::from(low)
    })
}
