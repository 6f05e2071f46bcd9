//! Adaptive density control (Kerbl et al. 2023, section 5.2), following the authors' code.
//!
//! Every step adds to statistics (`seen`). At intervals (`options`) Gaussians with a large gradient of the position in
//! the picture are densified: small ones are cloned, large ones split into two that are drawn from them. Transparent
//! and oversized ones are pruned. Survivors keep the optimizer's state, new ones start without. A clone that is tied to
//! an original is cloned, split and pruned with it.

mod options;
mod seen;

pub use options::Densify;
pub(super) use options::{MOST, Schedule, scaled};
pub(super) use seen::Seen;

use super::chance::Rng;
use super::parameters::{Parameters, sigmoid};
use crate::symmetry::MirrorClone;
use glam::{Quat, Vec3};
use serde::Serialize;

/// Factor by which each half of a split Gaussian is smaller.
const SPLIT: f32 = 1.6;

/// Totals of density control in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Densified {
    /// The number of originals that were cloned.
    pub cloned: usize,
    /// The number of originals that were split in two.
    pub split: usize,
    /// The number of originals that were pruned.
    pub pruned: usize,
    /// The number of opacity resets.
    pub resets: u32,
    /// Whether the limit on the number of Gaussians prevented some clones or splits.
    pub full: bool,
}

impl Densified {
    /// Adds the totals of another growth.
    pub(super) fn add(&mut self, other: &Self) {
        self.cloned += other.cloned;
        self.split += other.split;
        self.pruned += other.pruned;
        self.resets += other.resets;
        self.full |= other.full;
    }
}

/// The set of Gaussians after a growth.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Growth {
    /// Source of each new Gaussian: survivors in their order, then copies, then halves, two of each. `[new n]`
    pub(super) sources: Vec<u32>,
    /// The number of survivors.
    pub(super) survivors: usize,
    /// Index of the first half.
    halves: usize,
    pub(super) done: Densified,
}

/// Action on one Gaussian.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Keep,
    Prune,
    Copy,
    Split,
}

impl Growth {
    /// Applies the rules; `None` if no Gaussian would be left. `prunes_large` is false before the first opacity reset.
    pub(super) fn new(
        parameters: &Parameters,
        clones: &[MirrorClone],
        seen: &Seen,
        rules: &Densify,
        extent_m: f32,
        prunes_large: bool,
    ) -> Option<Self> {
        let n = parameters.len();
        let fate = |i: usize| {
            let size = parameters.scales(i).into_iter().fold(0.0, f32::max) / extent_m;
            let is_large = |size: f32| prunes_large && size > rules.largest;
            let is_wide = prunes_large && seen.radius_px(i) > rules.largest_px;
            let grows = seen.gradient(i) >= rules.gradient && seen.gradient(i) > 0.0;
            match () {
                () if sigmoid(parameters.logits[i]) < rules.least_opacity => Fate::Prune,
                () if grows && size > rules.split_above && !is_large(size / SPLIT) => Fate::Split,
                () if is_large(size) || is_wide => Fate::Prune,
                () if grows && size <= rules.split_above => Fate::Copy,
                () => Fate::Keep,
            }
        };
        let mut fates: Vec<Fate> = (0..n).map(fate).collect();
        let full = hold_back(&mut fates, clones, seen, rules.most);

        let with_fate = |wanted: &[Fate]| -> Vec<u32> {
            let indices = (0..n).filter(|&i| wanted.contains(&fates[i]));
            indices.map(|i| i as u32).collect()
        };
        let mut sources = with_fate(&[Fate::Keep, Fate::Copy]);
        let survivors = sources.len();
        let (cloned, split) = (with_fate(&[Fate::Copy]), with_fate(&[Fate::Split]));
        sources.extend(&cloned);
        let halves = sources.len();
        sources.extend(split.iter().flat_map(|&i| [i, i]));
        let pruned = n - survivors - split.len();
        let done = Densified { cloned: cloned.len(), split: split.len(), pruned, resets: 0, full };
        (!sources.is_empty()).then_some(Self { sources, survivors, halves, done })
    }

    /// The parameters after the growth. The centre of each half is drawn from the Gaussian that was split; `key`
    /// identifies the run and the step.
    pub(super) fn grown(&self, parameters: &Parameters, key: [u64; 2]) -> Parameters {
        let mut grown = parameters.gathered(&self.sources);
        for i in self.halves..self.sources.len() {
            let mut rng = Rng::new([key[0], key[1], i as u64]);
            let draw = grown.scales(i).map(|scale| rng.normal() as f32 * scale);
            let [w, x, y, z] = grown.rotations[i];
            let moved = Vec3::from_array(grown.means[i])
                + Quat::from_xyzw(x, y, z, w).normalize() * Vec3::from_array(draw);
            grown.means[i] = moved.to_array();
            grown.log_scales[i] = grown.log_scales[i].map(|s| s - SPLIT.ln());
        }
        grown.bound();
        grown
    }
}

/// Cancels clones and splits with the smallest gradients until there are at most `most` Gaussians, counting tied
/// clones. Returns whether any was cancelled. A clone and a split each add one Gaussian.
fn hold_back(fates: &mut [Fate], clones: &[MirrorClone], seen: &Seen, most: usize) -> bool {
    let mut cost = vec![1; fates.len()];
    clones.iter().for_each(|clone| cost[clone.of as usize] += 1);
    let there: usize = (0..fates.len()).filter(|&i| fates[i] != Fate::Prune).map(|i| cost[i]).sum();
    let mut room = most.saturating_sub(there);
    let mut growing: Vec<usize> =
        (0..fates.len()).filter(|&i| matches!(fates[i], Fate::Copy | Fate::Split)).collect();
    growing.sort_by(|&a, &b| seen.gradient(b).total_cmp(&seen.gradient(a)).then(a.cmp(&b)));
    let mut full = false;
    for i in growing {
        full |= cost[i] > room;
        match full {
            true => fates[i] = Fate::Keep,
            false => room -= cost[i],
        }
    }
    full
}

/// Limits opacities to 0.01, as the authors' code does.
pub(super) fn reset_opacities(parameters: &mut Parameters) {
    /// logit(0.01)
    const RESET: f32 = -4.595_12;
    parameters.logits.iter_mut().for_each(|x| *x = x.min(RESET));
}

#[cfg(test)]
mod tests;
