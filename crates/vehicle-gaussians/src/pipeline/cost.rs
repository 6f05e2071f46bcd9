//! How long a reconstruction takes: for each stage a constant and a time per pixel, per view or per grid point, as
//! measured on one thread of the reference machine, divided by how fast this machine is.
//!
//! The constants are fitted to the CPU time of each stage (`cargo bench --bench budget -- --stages`).

use super::machine::Machine;
use super::options::{Calibrate, Options, PriorChoice};
use super::plan;
use crate::prior::hull::FINEST_VOXEL_M;
use crate::refine::Amount;
use crate::refine::baseline::BaselineOptions;
use crate::relight::Relight;
use crate::symmetry::SymmetryMode;
use vg_geometry::progress::Course;

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

    /// Milliseconds on `machine`.
    fn on(self, machine: Machine) -> f64 {
        self.serial / machine.serial + self.parallel / machine.parallel
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

/// Seconds that a reconstruction of `load` with `options` takes on `machine`, without a refinement.
pub(super) fn seconds(load: &Load, options: &Options, machine: Machine) -> f64 {
    let mut sum = Cost::default();
    for (_, cost) in costs(load, options) {
        sum.add(cost.serial, cost.parallel);
    }
    1e-3 * sum.on(machine)
}

/// The stages of a reconstruction that no budget decides on, with the milliseconds that each is expected to take with so
/// many threads.
pub(super) fn course(load: &Load, options: &Options, threads: usize) -> Course {
    let machine = Machine { serial: 1.0, parallel: threads as f64 };
    let mut stages = costs(load, options).map(|(stage, cost)| (stage, cost.on(machine))).to_vec();
    if let Some(refine) = &options.refine {
        let check = stages.pop();
        stages.push(("refine", refinement(load, refine.amount, machine)));
        stages.extend(check);
    }
    Course::new(stages)
}

/// As [`course`], of a baseline.
pub(super) fn course_of_baseline(
    load: &Load,
    options: &Options,
    how: &BaselineOptions,
    threads: usize,
) -> Course {
    let machine = Machine { serial: 1.0, parallel: threads as f64 };
    let costs = costs(load, options);
    let of = |stage: &str| costs.iter().find(|(name, _)| *name == stage).map_or(0.0, |(_, c)| c.on(machine));
    let fit = refinement(load, how.amount, machine);
    // The start is points, not pixels: next to nothing.
    Course::new(vec![
        ("plan", of("plan")),
        ("undistort", of("undistort")),
        ("start", of("plan")),
        ("refine", fit),
        ("check", of("check")),
    ])
}

/// Milliseconds of a refinement.
fn refinement(load: &Load, amount: Amount, machine: Machine) -> f64 {
    match amount {
        Amount::Seconds(seconds) => 1e3 * seconds,
        // A step draws one view, both ways: 71 ms of 0.3 megapixels, of which the vehicle has 0.08 (docs/REFINE.md).
        Amount::Iterations(steps) => {
            let mut step = Cost::default();
            step.add(4.0, 100.0 * load.pixels + 500.0 * load.vehicle);
            f64::from(steps) * step.on(machine)
        }
    }
}

/// Each stage, in their order.
fn costs(load: &Load, options: &Options) -> [(&'static str, Cost); 8] {
    let views = load.views.min(options.max_views.unwrap_or(usize::MAX)) as f64;
    let share = options.resolution * options.resolution;
    let (pixels, vehicle) = (views * load.pixels * share, views * load.vehicle * share);
    let prior = plan::prior(options.prior, load.has_depth);
    let [mut plan, mut undistort, mut calibrate, mut depth] = [Cost::default(); 4];
    let [mut kept, mut head, mut symmetry, mut check] = [Cost::default(); 4];
    // Threads, allocation, what no stage accounts for.
    plan.add(2.0, 0.0);
    if options.resolution < 1.0 {
        undistort.add(0.0, 10.0 * views * load.pixels);
    }
    if load.distorted {
        undistort.add(0.0, 60.0 * pixels);
    }
    if options.calibrate == Calibrate::Auto && load.has_masks && (2.0..=64.0).contains(&views) {
        calibrate.add(0.5 * views, 25.0 * pixels + 2.0 * views * views);
    }
    if prior != PriorChoice::Given {
        let finer = voxel_m(options.resolution).map_or(1.0, |voxel| (FINEST_VOXEL_M / voxel).powi(3));
        let points = POINTS * finer;
        // Silhouettes and the box.
        depth.add(1.0, 25.0 * pixels + 12.0 * views);
        // The hull on the grid; most points are decided by the first silhouettes.
        depth.add(6.0 * points, (20.0 + 8.0 * views) * points);
        // Filling the masks, marching.
        depth.add(30.0 + 25.0 * vehicle, 35.0 * points + 730.0 * vehicle);
        if prior == PriorChoice::Hull {
            depth.add(0.0, 30.0 * points);
        } else {
            depth.add(2.0, 60.0 + 4.0 * views + 20.0 * points + 30.0 * vehicle);
            if options.photo {
                depth.add(20.0 + 10.0 * vehicle, (400.0 + 400.0 * views) * vehicle);
            }
        }
        depth.add(50.0 * load.cloud, 100.0 * load.cloud);
    }
    // Normals.
    depth.add(0.0, 20.0 * pixels);
    kept.add(2.0 * pixels, 30.0 * vehicle);
    head.add(6.0 * pixels, (30.0 + 20.0 * views) * vehicle);
    if options.symmetry != SymmetryMode::Never {
        symmetry.add(20.0 * vehicle, 40.0 * vehicle);
        if options.relight == Relight::Auto {
            symmetry.add(10.0 * vehicle, 30.0 * vehicle);
        }
    }
    if options.check {
        check.add(15.0 * pixels, (60.0 + 70.0 * views) * vehicle + 30.0 * pixels);
    }
    [
        ("plan", plan),
        ("undistort", undistort),
        ("calibrate", calibrate),
        ("prior", depth),
        ("pixels", kept),
        ("head", head),
        ("symmetry", symmetry),
        ("check", check),
    ]
}
