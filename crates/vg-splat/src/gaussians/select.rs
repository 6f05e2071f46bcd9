//! Selection of Gaussians by a mask, by indices, by a box, or by opacity.

use super::buffer::Gaussians;
use std::cmp::Ordering::{Equal, Less};
use vg_geometry::{Error, Result};

impl Gaussians {
    /// The Gaussians at `indices`, in that order; an index may occur more than once.
    ///
    /// # Errors
    /// An index is not below the number of Gaussians; the error names it as `indices[k]`.
    pub fn selected(&self, indices: &[usize]) -> Result<Self> {
        if let Some(k) = indices.iter().position(|&i| i >= self.len()) {
            let allowed = format!("below {}, the number of Gaussians", self.len());
            return Err(Error::argument(format!("indices[{k}]"), indices[k].to_string(), allowed));
        }
        Ok(self.gathered(indices))
    }

    /// The Gaussians with `keep[index]`, in order.
    ///
    /// # Errors
    /// `keep` does not have one flag per Gaussian.
    pub fn masked(&self, keep: &[bool]) -> Result<Self> {
        if keep.len() != self.len() {
            let allowed = format!("{}, one per Gaussian", self.len());
            return Err(Error::argument("keep", format!("{} flags", keep.len()), allowed));
        }
        Ok(self.filtered(keep))
    }

    /// The Gaussians whose centre lies in the box from `low` to `high`, metres, its faces included, in order. A side at
    /// infinity is open.
    ///
    /// # Errors
    /// A bound is NaN, or `low` is above `high`.
    pub fn cropped(&self, low: [f32; 3], high: [f32; 3]) -> Result<Self> {
        let ordered = |k: &usize| matches!(low[*k].partial_cmp(&high[*k]), Some(Less | Equal));
        if let Some(k) = (0..3).find(|k| !ordered(k)) {
            let found = format!("{} with high[{k}] {}", low[k], high[k]);
            return Err(Error::argument(format!("low[{k}]"), found, "not above high"));
        }
        let inside = |mean: &[f32; 3]| (0..3).all(|k| (low[k]..=high[k]).contains(&mean[k]));
        Ok(self.filtered(&self.means().iter().map(inside).collect::<Vec<_>>()))
    }

    /// The Gaussians with a peak opacity of at least `least`, in order.
    ///
    /// # Errors
    /// `least` is not within 0 to 1.
    pub fn with_opacity_of(&self, least: f32) -> Result<Self> {
        if !(0.0..=1.0).contains(&least) {
            return Err(Error::argument("least", least.to_string(), "0 to 1"));
        }
        Ok(self.filtered(&self.opacities().iter().map(|&o| o >= least).collect::<Vec<_>>()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five Gaussians, each with distinct numbers.
    fn five() -> Gaussians {
        let all = |f: fn(f32) -> f32| (0..5).map(move |i| f(i as f32));
        Gaussians::from_arrays(
            1,
            all(|t| t).map(|t| [t, -t, 0.5 * t]).collect(),
            all(|t| 0.1 * t).map(|t| [1.0, t, 0.0, 0.0]).collect(),
            all(|t| 0.1 + t).map(|t| [t; 3]).collect(),
            all(|t| 0.2 * t).collect(),
            (0..60).map(|i| i as f32).collect(),
        )
        .unwrap()
    }

    #[test]
    fn indices_select_whole_gaussians_in_their_order() {
        let g = five();
        let found = g.selected(&[3, 0, 3]).unwrap();
        assert_eq!(found.means(), [g.means()[3], g.means()[0], g.means()[3]]);
        assert_eq!(found.rotations(), [g.rotations()[3], g.rotations()[0], g.rotations()[3]]);
        assert_eq!(found.scales(), [g.scales()[3], g.scales()[0], g.scales()[3]]);
        assert_eq!(found.opacities(), [g.opacities()[3], g.opacities()[0], g.opacities()[3]]);
        assert_eq!(found.sh(), [&g.sh()[36..48], &g.sh()[0..12], &g.sh()[36..48]].concat());
        assert_eq!(g.selected(&[0, 1, 2, 3, 4]).unwrap(), g);
        assert!(g.selected(&[]).unwrap().is_empty());
        let error = g.selected(&[0, 5]).unwrap_err().to_string();
        assert_eq!(error, "indices[1]: 5; allowed: below 5, the number of Gaussians");
    }

    #[test]
    fn a_mask_a_box_and_an_opacity_select_as_the_equivalent_indices_do() {
        let g = five();
        let picked = |indices: &[usize]| g.selected(indices).unwrap();
        assert_eq!(g.masked(&[false, true, true, false, true]).unwrap(), picked(&[1, 2, 4]));
        // The faces belong to the box.
        assert_eq!(g.cropped([1.0, -9.0, 0.0], [3.0, -1.0, 1.0]).unwrap(), picked(&[1, 2]));
        let open = f32::INFINITY;
        assert_eq!(g.cropped([-open; 3], [open; 3]).unwrap(), g);
        assert_eq!(g.with_opacity_of(0.4).unwrap(), picked(&[2, 3, 4]));
    }

    #[test]
    fn invalid_masks_boxes_and_opacities_are_refused_by_name() {
        let g = five();
        for (found, beginning) in [
            (g.masked(&[true; 4]), "keep: 4 flags"),
            (g.cropped([0.0, 1.0, 0.0], [1.0, 0.5, 1.0]), "low[1]: 1 with high[1] 0.5"),
            (g.cropped([0.0, 0.0, f32::NAN], [1.0; 3]), "low[2]: NaN"),
            (g.with_opacity_of(1.5), "least: 1.5"),
            (g.with_opacity_of(f32::NAN), "least: NaN"),
        ] {
            let error = found.unwrap_err().to_string();
            assert!(error.starts_with(beginning), "{error}");
        }
    }
}
