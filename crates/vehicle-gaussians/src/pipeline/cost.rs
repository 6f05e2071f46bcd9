//! The cost model: the time of each stage, as a constant and times per pixel, per view or per grid point, measured on
//! one thread of the reference machine and divided by the speed of this machine.
//!
//! The constants of the table are fitted to the CPU time of each stage (`cargo bench --bench budget -- --stages`).

use super::machine::Machine;
use super::options::{Calibrate, Options, PriorChoice};
use super::plan;
use crate::prior::hull::FINEST_VOXEL_M;
use crate::refine::Amount;
use crate::refine::baseline::BaselineOptions;
use crate::relight::Relight;
use crate::symmetry::SymmetryMode;
use vg_geometry::progress::Course;

/// The size of a scene.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Load {
    /// Views that can be used.
    pub(super) views: usize,
    /// Mean megapixels of a view: all, and those of the vehicle.
    pub(super) pixels: f64,
    pub(super) vehicle: f64,
    /// Whether any lens has distortion: its views are resampled.
    pub(super) distorted: bool,
    /// Whether all views have depth and masks.
    pub(super) has_depth: bool,
    pub(super) has_masks: bool,
    /// Million points of a cloud.
    pub(super) cloud: f64,
}

/// Milliseconds on the reference machine: work on one thread only, and work that all threads share.
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

/// Grid spacing for a resolution: larger pixels do not resolve a finer grid. `None` is the finest.
pub(super) fn voxel_m(resolution: f64) -> Option<f64> {
    /// A coarser grid loses wheel arches and mirrors.
    const COARSEST_M: f64 = 0.05;
    (resolution < 1.0).then(|| (FINEST_VOXEL_M / resolution).min(COARSEST_M))
}

/// Seconds that a reconstruction takes on `machine`, without a refinement.
pub(super) fn seconds(load: &Load, options: &Options, machine: Machine) -> f64 {
    let mut sum = Cost::default();
    for (_, cost) in costs(load, options) {
        sum.add(cost.serial, cost.parallel);
    }
    1e-3 * sum.on(machine)
}

/// The stages of a reconstruction with the milliseconds that each is expected to take on so many threads.
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

/// The stages of a baseline with the milliseconds that each is expected to take on so many threads.
pub(super) fn course_of_baseline(
    load: &Load,
    options: &Options,
    how: &BaselineOptions,
    threads: usize,
) -> Course {
    let machine = Machine { serial: 1.0, parallel: threads as f64 };
    let costs = costs(load, options);
    let time =
        |stage: &str| costs.iter().find(|(name, _)| *name == stage).map_or(0.0, |(_, c)| c.on(machine));
    let fit = refinement(load, how.amount, machine);
    // The start depends on the points, not on the pixels, and takes next to no time.
    Course::new(vec![
        ("plan", time("plan")),
        ("undistort", time("undistort")),
        ("start", time("plan")),
        ("refine", fit),
        ("check", time("check")),
    ])
}

/// Milliseconds of a refinement.
fn refinement(load: &Load, amount: Amount, machine: Machine) -> f64 {
    match amount {
        Amount::Seconds(seconds) => 1e3 * seconds,
        // A step renders one view forward and backward: 71 ms for 0.3 megapixels, of which the vehicle has 0.08
        // (docs/REFINE.md).
        Amount::Iterations(steps) => {
            let mut step = Cost::default();
            step.add(4.0, 100.0 * load.pixels + 500.0 * load.vehicle);
            f64::from(steps) * step.on(machine)
        }
    }
}

/// The stages of a reconstruction in their order, without a refinement.
const STAGES: [&str; 8] = ["plan", "undistort", "calibrate", "prior", "pixels", "head", "symmetry", "check"];

/// The amounts that the costs are proportional to. Those of work that is switched off are 0.
struct Amounts {
    views: f64,
    /// Megapixels of all views at the working resolution: all, and those of the vehicle.
    pixels: f64,
    vehicle: f64,
    /// Megapixels that are read to lower the resolution, and that are written to remove distortion.
    resampled: f64,
    distorted: f64,
    /// 1 where the work is done, else 0.
    calibrated: f64,
    estimated: f64,
    by_hull: f64,
    by_shape: f64,
    by_photo: f64,
    cloned: f64,
    relit: f64,
    checked: f64,
    /// Million grid points of an estimated surface.
    grid: f64,
    /// Million points of a cloud.
    cloud: f64,
}

impl Amounts {
    fn new(load: &Load, options: &Options) -> Self {
        let one_if = |condition: bool| f64::from(u8::from(condition));
        let views = load.views.min(options.max_views.unwrap_or(usize::MAX)) as f64;
        let share = options.resolution * options.resolution;
        let prior = plan::prior(options.prior, load.has_depth);
        let is_estimated = prior != PriorChoice::Given;
        let by_shape = is_estimated && prior != PriorChoice::Hull;
        let is_cloned = options.symmetry != SymmetryMode::Never;
        let finer = voxel_m(options.resolution).map_or(1.0, |voxel| (FINEST_VOXEL_M / voxel).powi(3));
        let pixels = views * load.pixels * share;
        Self {
            views,
            pixels,
            vehicle: views * load.vehicle * share,
            resampled: one_if(options.resolution < 1.0) * views * load.pixels,
            distorted: one_if(load.distorted) * pixels,
            calibrated: one_if(
                options.calibrate == Calibrate::Auto && load.has_masks && (2.0..=64.0).contains(&views),
            ),
            estimated: one_if(is_estimated),
            by_hull: one_if(prior == PriorChoice::Hull),
            by_shape: one_if(by_shape),
            by_photo: one_if(by_shape && options.photo),
            cloned: one_if(is_cloned),
            relit: one_if(is_cloned && options.relight == Relight::Auto),
            checked: one_if(options.check),
            grid: one_if(is_estimated) * POINTS * finer,
            cloud: one_if(is_estimated) * load.cloud,
        }
    }
}

/// A line of the cost model: the stage, milliseconds on one thread, milliseconds that all threads share, and what both
/// are multiplied by.
type Line = (&'static str, f64, f64, fn(&Amounts) -> f64);

const TABLE: &[Line] = &[
    // Threads, allocation, what no stage accounts for.
    ("plan", 2.0, 0.0, |_| 1.0),
    ("undistort", 0.0, 10.0, |a| a.resampled),
    ("undistort", 0.0, 60.0, |a| a.distorted),
    ("calibrate", 0.5, 0.0, |a| a.calibrated * a.views),
    ("calibrate", 0.0, 25.0, |a| a.calibrated * a.pixels),
    ("calibrate", 0.0, 2.0, |a| a.calibrated * a.views * a.views),
    // Silhouettes and the box.
    ("prior", 1.0, 0.0, |a| a.estimated),
    ("prior", 0.0, 25.0, |a| a.estimated * a.pixels),
    ("prior", 0.0, 12.0, |a| a.estimated * a.views),
    // The hull on the grid; most points are decided by the first silhouettes.
    ("prior", 6.0, 20.0, |a| a.grid),
    ("prior", 0.0, 8.0, |a| a.grid * a.views),
    // Filling the masks, marching.
    ("prior", 30.0, 0.0, |a| a.estimated),
    ("prior", 25.0, 730.0, |a| a.estimated * a.vehicle),
    ("prior", 0.0, 35.0, |a| a.grid),
    ("prior", 0.0, 30.0, |a| a.by_hull * a.grid),
    ("prior", 2.0, 60.0, |a| a.by_shape),
    ("prior", 0.0, 4.0, |a| a.by_shape * a.views),
    ("prior", 0.0, 20.0, |a| a.by_shape * a.grid),
    ("prior", 0.0, 30.0, |a| a.by_shape * a.vehicle),
    ("prior", 20.0, 0.0, |a| a.by_photo),
    ("prior", 10.0, 400.0, |a| a.by_photo * a.vehicle),
    ("prior", 0.0, 400.0, |a| a.by_photo * a.views * a.vehicle),
    ("prior", 50.0, 100.0, |a| a.cloud),
    // Normals.
    ("prior", 0.0, 20.0, |a| a.pixels),
    ("pixels", 2.0, 0.0, |a| a.pixels),
    ("pixels", 0.0, 30.0, |a| a.vehicle),
    ("head", 6.0, 0.0, |a| a.pixels),
    ("head", 0.0, 30.0, |a| a.vehicle),
    ("head", 0.0, 20.0, |a| a.views * a.vehicle),
    ("symmetry", 20.0, 40.0, |a| a.cloned * a.vehicle),
    ("symmetry", 10.0, 30.0, |a| a.relit * a.vehicle),
    ("check", 15.0, 30.0, |a| a.checked * a.pixels),
    ("check", 0.0, 60.0, |a| a.checked * a.vehicle),
    ("check", 0.0, 70.0, |a| a.checked * a.views * a.vehicle),
];

/// The cost of each stage.
fn costs(load: &Load, options: &Options) -> [(&'static str, Cost); 8] {
    let amounts = Amounts::new(load, options);
    STAGES.map(|stage| {
        let mut cost = Cost::default();
        for (_, serial, parallel, amount) in TABLE.iter().filter(|(name, ..)| *name == stage) {
            cost.add(serial * amount(&amounts), parallel * amount(&amounts));
        }
        (stage, cost)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_belongs_to_a_stage() {
        assert!(TABLE.iter().all(|(stage, ..)| STAGES.contains(stage)));
    }

    #[test]
    fn a_run_that_is_switched_off_stage_by_stage_costs_what_the_table_says() {
        let load = Load { views: 4, pixels: 0.5, vehicle: 0.25, has_depth: true, ..Load::default() };
        let options = Options {
            calibrate: Calibrate::Off,
            symmetry: SymmetryMode::Never,
            check: false,
            ..Options::default()
        };
        let cost = |stage: &str| {
            let (_, Cost { serial, parallel }) =
                costs(&load, &options).into_iter().find(|(name, _)| *name == stage).unwrap();
            [serial, parallel]
        };
        assert_eq!(cost("plan"), [2.0, 0.0]);
        assert_eq!([cost("undistort"), cost("calibrate"), cost("symmetry"), cost("check")], [[0.0; 2]; 4]);
        // Normals of 2 megapixels; 1 megapixel shows the vehicle.
        assert_eq!(cost("prior"), [0.0, 40.0]);
        assert_eq!(cost("pixels"), [4.0, 30.0]);
        assert_eq!(cost("head"), [12.0, 30.0 + 80.0]);
    }
}
