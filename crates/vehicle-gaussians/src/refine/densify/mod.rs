//! Adaptive density control (Kerbl et al. 2023, section 5.2), as their code does it.
//!
//! Steps are watched (`seen`). Now and then (`options`) Gaussians whose place in the picture matters much get company:
//! small ones are cloned, large ones split into two that are drawn from them; transparent and oversized ones go.
//! Survivors keep the optimizer's state, others begin without. A clone that is tied to an original comes, divides and
//! goes with it.

mod options;
mod seen;

pub use options::Densify;
pub(super) use options::{MOST, Schedule, scaled};
pub(super) use seen::Seen;

use super::chance::Chance;
use super::parameters::{Parameters, sigmoid};
use super::tie::Clone as Tied;
use glam::{Quat, Vec3};
use serde::Serialize;

/// Each half of a Gaussian is smaller than it by this factor.
const SPLIT: f32 = 1.6;

/// What density control did in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Densified {
    /// Originals that were cloned.
    pub cloned: usize,
    /// Originals that were split in two.
    pub split: usize,
    /// Originals that went.
    pub pruned: usize,
    /// Times that opacities were reset.
    pub resets: u32,
    /// Whether some got no company because there were enough.
    pub full: bool,
}

impl Densified {
    /// Another growth.
    pub(super) fn add(&mut self, other: &Self) {
        self.cloned += other.cloned;
        self.split += other.split;
        self.pruned += other.pruned;
        self.resets += other.resets;
        self.full |= other.full;
    }
}

/// Who is there after a growth.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Growth {
    /// Of whom each one is made: survivors in their order, then copies, then halves, two of each. `[new n]`
    pub(super) sources: Vec<u32>,
    /// So many of them are survivors.
    pub(super) survivors: usize,
    /// The first of the halves.
    halves: usize,
    pub(super) done: Densified,
}

/// What becomes of one.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Stays,
    Goes,
    IsCloned,
    IsSplit,
}

impl Growth {
    /// By the rules; `None` where nobody would be left. `prunes_large` is false before the first reset of opacities.
    pub(super) fn of(
        parameters: &Parameters,
        clones: &[Tied],
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
            let wants = seen.gradient(i) >= rules.gradient && seen.gradient(i) > 0.0;
            match () {
                () if sigmoid(parameters.logits[i]) < rules.least_opacity => Fate::Goes,
                () if wants && size > rules.split_above && !is_large(size / SPLIT) => Fate::IsSplit,
                () if is_large(size) || is_wide => Fate::Goes,
                () if wants && size <= rules.split_above => Fate::IsCloned,
                () => Fate::Stays,
            }
        };
        let mut fates: Vec<Fate> = (0..n).map(fate).collect();
        let full = hold_back(&mut fates, clones, seen, rules.most);

        let of = |wanted: &[Fate]| -> Vec<u32> {
            let those = (0..n).filter(|&i| wanted.contains(&fates[i]));
            those.map(|i| i as u32).collect()
        };
        let mut sources = of(&[Fate::Stays, Fate::IsCloned]);
        let survivors = sources.len();
        let (cloned, split) = (of(&[Fate::IsCloned]), of(&[Fate::IsSplit]));
        sources.extend(&cloned);
        let halves = sources.len();
        sources.extend(split.iter().flat_map(|&i| [i, i]));
        let pruned = n - survivors - split.len();
        let done = Densified { cloned: cloned.len(), split: split.len(), pruned, resets: 0, full };
        (!sources.is_empty()).then_some(Self { sources, survivors, halves, done })
    }

    /// The parameters afterwards. Halves lie where a draw from the Gaussian they are made of puts them; `key` tells the
    /// run and the step.
    pub(super) fn grown(&self, parameters: &Parameters, key: [u64; 2]) -> Parameters {
        let mut grown = parameters.gathered(&self.sources);
        for i in self.halves..self.sources.len() {
            let mut chance = Chance::of([key[0], key[1], i as u64]);
            let draw = grown.scales(i).map(|scale| chance.normal() as f32 * scale);
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

/// Takes company back from those of the smallest gradients until there are at most `most`, tied clones counted; whether
/// that was needed. Company of either kind is one more.
fn hold_back(fates: &mut [Fate], clones: &[Tied], seen: &Seen, most: usize) -> bool {
    let mut cost = vec![1; fates.len()];
    clones.iter().for_each(|clone| cost[clone.of as usize] += 1);
    let there: usize = (0..fates.len()).filter(|&i| fates[i] != Fate::Goes).map(|i| cost[i]).sum();
    let mut room = most.saturating_sub(there);
    let mut want: Vec<usize> =
        (0..fates.len()).filter(|&i| matches!(fates[i], Fate::IsCloned | Fate::IsSplit)).collect();
    want.sort_by(|&a, &b| seen.gradient(b).total_cmp(&seen.gradient(a)).then(a.cmp(&b)));
    let mut full = false;
    for i in want {
        full |= cost[i] > room;
        match full {
            true => fates[i] = Fate::Stays,
            false => room -= cost[i],
        }
    }
    full
}

/// Opacities of at most 0.01: the original's reset.
pub(super) fn reset_opacities(parameters: &mut Parameters) {
    /// logit(0.01)
    const RESET: f32 = -4.595_12;
    parameters.logits.iter_mut().for_each(|x| *x = x.min(RESET));
}

#[cfg(test)]
mod tests;
