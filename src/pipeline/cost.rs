//! How long a reconstruction takes: for each stage a constant and a time per pixel, per view or per grid point, as
//! measured on one thread of the reference machine, divided by how fast this machine is.
//!
//! The constants are fitted to the CPU time of each stage (`cargo bench --bench budget -- --stages`).

use super::machine::Machine;
use super::options::{Calibrate, Options, PriorChoice};
use super::plan;
use crate::prior::hull::FINEST_VOXEL_M;
use crate::relight::Relight;
use crate::symmetry::SymmetryMode;

/// What the views amount to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Load {
    /// Views that can be used.
    pub(super) views: usize,
    /// Megapixels of a view on average, all and of the vehicle.
    pub(super) pixels: f64,
    pub(super) vehicle: f64,
    /// Whether some lens is distorted: its views are resampled.
    pub(super) distorted: bool,
    /// Whether all views have depth and masks.
    pub(super) has_depth: bool,
    pub(super) has_masks: bool,
    /// Million points of a cloud.
    pub(super) cloud: f64,
}

/// Milliseconds on the reference machine: of work on one thread only, and of work that all threads share.
#[derive(Clone, Copy, Debug, Default)]
struct Cost {
    serial: f64,
    parallel: f64,
}

impl Cost {
    fn add(&mut self, serial: f64, parallel: f64) {
        self.serial += serial;
        self.parallel += parallel;
    }
}

/// Grid points of the finest lattice around a car, millions.
const POINTS: f64 = 1.6;

/// Grid spacing that goes with a resolution: pixels twice as large do not see a finer grid. `None` is the finest.
pub(super) fn voxel_m(resolution: f64) -> Option<f64> {
    /// Beyond this, wheel arches and mirrors go.
    const COARSEST_M: f64 = 0.05;
    (resolution < 1.0).then(|| (FINEST_VOXEL_M / resolution).min(COARSEST_M))
}

/// Seconds that a reconstruction of `load` with `options` takes on `machine`.
pub(super) fn seconds(load: &Load, options: &Options, machine: Machine) -> f64 {
    let cost = cost(load, options);
    1e-3 * (cost.serial / machine.serial + cost.parallel / machine.parallel)
}

fn cost(load: &Load, options: &Options) -> Cost {
    let views = load.views.min(options.max_views.unwrap_or(usize::MAX)) as f64;
    let share = options.resolution * options.resolution;
    let (pixels, vehicle) = (views * load.pixels * share, views * load.vehicle * share);
    let prior = plan::prior(options.prior, load.has_depth);
    let mut cost = Cost::default();
    // Threads, allocation, what no stage accounts for.
    cost.add(2.0, 0.0);
    if options.resolution < 1.0 {
        cost.add(0.0, 10.0 * views * load.pixels);
    }
    if load.distorted {
        cost.add(0.0, 60.0 * pixels);
    }
    if options.calibrate == Calibrate::Auto && load.has_masks && (2.0..=64.0).contains(&views) {
        cost.add(0.5 * views, 25.0 * pixels + 2.0 * views * views);
    }
    if prior != PriorChoice::Given {
        let finer = voxel_m(options.resolution).map_or(1.0, |voxel| (FINEST_VOXEL_M / voxel).powi(3));
        let points = POINTS * finer;
        // Silhouettes and the box.
        cost.add(1.0, 25.0 * pixels + 12.0 * views);
        // The hull on the grid; most points are decided by the first silhouettes.
        cost.add(6.0 * points, (20.0 + 8.0 * views) * points);
        // Filling the masks, marching.
        cost.add(30.0 + 25.0 * vehicle, 35.0 * points + 730.0 * vehicle);
        if prior == PriorChoice::Hull {
            cost.add(0.0, 30.0 * points);
        } else {
            cost.add(2.0, 60.0 + 4.0 * views + 20.0 * points + 30.0 * vehicle);
            if options.photo {
                cost.add(20.0 + 10.0 * vehicle, (400.0 + 400.0 * views) * vehicle);
            }
        }
        cost.add(50.0 * load.cloud, 100.0 * load.cloud);
    }
    // Normals, the choice of pixels, the head.
    cost.add(8.0 * pixels, 20.0 * pixels + (60.0 + 20.0 * views) * vehicle);
    if options.symmetry != SymmetryMode::Never {
        cost.add(20.0 * vehicle, 40.0 * vehicle);
        if options.relight == Relight::Auto {
            cost.add(10.0 * vehicle, 30.0 * vehicle);
        }
    }
    if options.check {
        cost.add(15.0 * pixels, (60.0 + 70.0 * views) * vehicle + 30.0 * pixels);
    }
    cost
}
