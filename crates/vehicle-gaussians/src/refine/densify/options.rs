//! Options and schedule of density control.

use serde::Serialize;
use vg_geometry::{Error, Result};

/// Adaptive density control of 3DGS (Kerbl et al. 2023, section 5.2): Gaussians where pictures are wrong are cloned or
/// split, those that show nothing are pruned. The defaults are those of the authors' code.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Densify {
    /// Gradient of the loss by the position in the picture, per half a picture, from which a Gaussian is cloned or
    /// split; mean over the steps that saw it.
    pub gradient: f32,
    /// Size above which a Gaussian is split instead of cloned: largest standard deviation as a share of the extent.
    pub split_above: f32,
    /// Opacity below which a Gaussian is pruned.
    pub least_opacity: f32,
    /// Size above which a Gaussian is pruned after the first opacity reset, as a share of the extent.
    pub largest: f32,
    /// Three standard deviations in a picture above which a Gaussian is pruned after the first opacity reset, pixels.
    pub largest_px: f32,
    /// Whether opacities are reset to 0.01 at intervals: needed Gaussians become opaque again.
    pub resets: bool,
    /// Maximum of Gaussians, clones counted; at the limit, those with the largest gradients are cloned or split first.
    pub most: usize,
}

impl Default for Densify {
    fn default() -> Self {
        Self {
            gradient: 2e-4,
            split_above: 0.01,
            least_opacity: 0.005,
            largest: 0.1,
            largest_px: 20.0,
            resets: true,
            most: 300_000,
        }
    }
}

impl Densify {
    /// Options for a few hundred steps on a good model: without resets, from which opacities could not recover in time.
    pub fn for_refinement() -> Self {
        Self { resets: false, ..Self::default() }
    }

    /// Checks that each field is in its range; `argument` names these options in errors.
    pub(in crate::refine) fn validate(&self, argument: &str) -> Result<()> {
        let shares = [
            ("gradient", self.gradient, f32::MAX, "0 or more, finite"),
            ("split_above", self.split_above, 1.0, "0 to 1"),
            ("least_opacity", self.least_opacity, 1.0, "0 to 1"),
            ("largest", self.largest, f32::MAX, "0 or more, finite"),
            ("largest_px", self.largest_px, f32::MAX, "0 or more, finite"),
        ];
        for (name, value, most, allowed) in shares {
            if !(0.0..=most).contains(&value) {
                return Err(Error::argument(format!("{argument}.{name}"), value.to_string(), allowed));
            }
        }
        if !(1..=MOST).contains(&self.most) {
            let allowed = format!("1 to {MOST}");
            return Err(Error::argument(format!("{argument}.most"), self.most.to_string(), allowed));
        }
        Ok(())
    }
}

/// Upper limit of [`Densify::most`]: a Gaussian takes about 1.5 kB, with gradients and the optimizer's state.
pub(in crate::refine) const MOST: usize = 10_000_000;

/// Steps of a run in the paper, to which the schedule refers; a shorter run scales the whole schedule down.
pub(in crate::refine) const FULL_RUN: u32 = 30_000;

/// Minimum of steps between growths: mean gradients over fewer steps are dominated by single views.
const SHORTEST_INTERVAL: u32 = 20;

/// The number of steps in a run of `planned` steps that corresponds to `steps` of a full run.
pub(in crate::refine) fn scaled(steps: u32, planned: u32) -> u32 {
    (u64::from(steps) * u64::from(planned.min(FULL_RUN)) / u64::from(FULL_RUN)) as u32
}

/// Schedule of density control, in steps made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::refine) struct Schedule {
    from: u32,
    until: u32,
    every: u32,
    reset_every: u32,
}

impl Schedule {
    pub(in crate::refine) fn new(planned: u32) -> Self {
        let scaled = |steps| scaled(steps, planned);
        Self {
            from: scaled(500),
            until: scaled(15_000),
            every: scaled(100).max(SHORTEST_INTERVAL),
            reset_every: scaled(3_000).max(1),
        }
    }

    /// Whether Gaussians are cloned, split and pruned after this step.
    pub(in crate::refine) fn grows_at(&self, step: u32) -> bool {
        step > self.from && step < self.until && step.is_multiple_of(self.every)
    }

    /// Whether opacities are reset after this step. The reset before the first growth is for a white background.
    pub(in crate::refine) fn resets_at(&self, step: u32) -> bool {
        step < self.until && (step.is_multiple_of(self.reset_every) || step == self.from)
    }

    /// Whether growths after this step prune large Gaussians.
    pub(in crate::refine) fn prunes_large_at(&self, step: u32) -> bool {
        step > self.reset_every
    }

    /// Whether gradients are still collected after this step.
    pub(in crate::refine) fn collects_at(&self, step: u32) -> bool {
        step < self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_run_has_the_papers_schedule_and_a_shorter_run_scales_it() {
        let full = Schedule::new(30_000);
        assert_eq!(full, Schedule { from: 500, until: 15_000, every: 100, reset_every: 3_000 });
        assert_eq!(full, Schedule::new(100_000));
        let growths = |s: Schedule| (0..40_000).filter(|&i| s.grows_at(i)).count();
        let resets = |s: Schedule| (1..40_000).filter(|&i| s.resets_at(i)).collect::<Vec<_>>();
        assert_eq!((growths(full), resets(full)), (144, vec![500, 3_000, 6_000, 9_000, 12_000]));
        let tenth = Schedule::new(3_000);
        assert_eq!((growths(tenth), resets(tenth)), (72, vec![50, 300, 600, 900, 1_200]));
        assert!(!full.prunes_large_at(3_000) && full.prunes_large_at(3_100));
        // Runs that are too short for any growth.
        for planned in 0..20 {
            assert_eq!(growths(Schedule::new(planned)), 0);
        }
    }
}
