//! What a caller may choose of density control, and when it acts.

use serde::Serialize;
use vg_geometry::{Error, Result};

/// Adaptive density control of 3DGS (Kerbl et al. 2023, section 5.2): Gaussians whose pictures are wrong get company,
/// those that show nothing go. The defaults are the original's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Densify {
    /// A Gaussian gets company from this gradient of the loss on by its place in the picture, per half a picture, mean
    /// over the steps that saw it.
    pub gradient: f32,
    /// One of at most this size is cloned, a larger one split; its largest standard deviation, as a share of the extent.
    pub split_above: f32,
    /// Less opaque ones go.
    pub least_opacity: f32,
    /// After the first reset of opacities larger ones go; as a share of the extent.
    pub largest: f32,
    /// After the first reset of opacities those go whose three standard deviations were wider in a picture, pixels.
    pub largest_px: f32,
    /// Whether opacities are reset to 0.01 now and then: what is needed comes back.
    pub resets: bool,
    /// No more Gaussians than this, clones counted; where all cannot have company, those of the largest gradients do.
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
    /// For a model that is good already and a few hundred steps, in which opacities that were reset do not come back.
    pub fn of_refinement() -> Self {
        Self { resets: false, ..Self::default() }
    }

    /// Each field in its range; `argument` is the name of this.
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

/// Of about 1.5 kB each, with gradients and the optimizer's state.
pub(in crate::refine) const MOST: usize = 10_000_000;

/// Steps of the original's run; its schedule is told for them, and in a shorter run every number of it is shorter by
/// the same factor.
pub(in crate::refine) const FULL_RUN: u32 = 30_000;

/// Mean gradients over fewer steps are noise of single views.
const SHORTEST_INTERVAL: u32 = 20;

/// Numbers of a schedule in a run of `planned` steps: what is `steps` in the original's.
pub(in crate::refine) fn scaled(steps: u32, planned: u32) -> u32 {
    (u64::from(steps) * u64::from(planned.min(FULL_RUN)) / u64::from(FULL_RUN)) as u32
}

/// When density control acts, in steps that were made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::refine) struct Schedule {
    from: u32,
    until: u32,
    every: u32,
    reset_every: u32,
}

impl Schedule {
    pub(in crate::refine) fn of(planned: u32) -> Self {
        let scaled = |steps| scaled(steps, planned);
        Self {
            from: scaled(500),
            until: scaled(15_000),
            every: scaled(100).max(SHORTEST_INTERVAL),
            reset_every: scaled(3_000).max(1),
        }
    }

    /// Whether Gaussians come and go after this step.
    pub(in crate::refine) fn grows_at(&self, step: u32) -> bool {
        step > self.from && step < self.until && step.is_multiple_of(self.every)
    }

    /// Whether opacities are reset after this step. On a white background once more before anything grows.
    pub(in crate::refine) fn resets_at(&self, step: u32) -> bool {
        step < self.until && (step.is_multiple_of(self.reset_every) || step == self.from)
    }

    /// Whether large ones go.
    pub(in crate::refine) fn prunes_large_at(&self, step: u32) -> bool {
        step > self.reset_every
    }

    /// Whether gradients are still looked at after this step.
    pub(in crate::refine) fn looks_at(&self, step: u32) -> bool {
        step < self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_schedule_is_the_originals_and_a_shorter_run_has_a_shorter_one() {
        let full = Schedule::of(30_000);
        assert_eq!(full, Schedule { from: 500, until: 15_000, every: 100, reset_every: 3_000 });
        assert_eq!(full, Schedule::of(100_000));
        let growths = |s: Schedule| (0..40_000).filter(|&i| s.grows_at(i)).count();
        let resets = |s: Schedule| (1..40_000).filter(|&i| s.resets_at(i)).collect::<Vec<_>>();
        assert_eq!((growths(full), resets(full)), (144, vec![500, 3_000, 6_000, 9_000, 12_000]));
        let tenth = Schedule::of(3_000);
        assert_eq!((growths(tenth), resets(tenth)), (72, vec![50, 300, 600, 900, 1_200]));
        assert!(!full.prunes_large_at(3_000) && full.prunes_large_at(3_100));
        // Too short to do anything in.
        for planned in 0..20 {
            assert_eq!(growths(Schedule::of(planned)), 0);
        }
    }
}
