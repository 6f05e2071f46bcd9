//! The radius up to which a lens model can be used before its polynomial folds back.
//!
//! Beyond the fold two rays share a pixel and the farther one is a ghost. Checking that [`Distortion::undistort`]
//! returns the original ray costs a Newton iteration per point; this table costs a look-up.

use super::distortion::Distortion;

/// The largest radius x/z, y/z in each direction out to which the determinant of the distortion is positive.
#[derive(Clone, Debug)]
pub struct Unfolded {
    /// Direction k is the angle 2 pi k / DIRECTIONS. The tangential terms vary as slowly as sin and cos.
    radius: [f64; DIRECTIONS],
}

const DIRECTIONS: usize = 128;

impl Unfolded {
    /// Builds the table out to `reach`, in normalised coordinates.
    pub(crate) fn new(distortion: &Distortion, reach: f64) -> Self {
        const STEPS: usize = 512;
        let mut radius = [reach; DIRECTIONS];
        for (k, radius) in radius.iter_mut().enumerate() {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / DIRECTIONS as f64).sin_cos();
            let folded = (0..=STEPS).map(|i| reach * i as f64 / STEPS as f64).find(|r| {
                let p = [r * cos, r * sin];
                !distortion.is_unfolded_at(p)
            });
            if let Some(folded) = folded {
                *radius = folded - reach / STEPS as f64;
            }
        }
        Self { radius }
    }

    /// Whether there is no fold between the axis and this point.
    pub(crate) fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let turns = y.atan2(x) / std::f64::consts::TAU * DIRECTIONS as f64;
        let k = turns.floor();
        let at = |k: f64| self.radius[k.rem_euclid(DIRECTIONS as f64) as usize % DIRECTIONS];
        x.hypot(y) <= at(k).min(at(k + 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fold_of_a_radial_lens_is_where_its_derivative_vanishes() {
        // r (1 - r^2 / 3) turns back at r = 1.
        let lens = Distortion::Brown { k: [-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
        let unfolded = Unfolded::new(&lens, 2.0);
        for angle in 0..100 {
            let (sin, cos) = (f64::from(angle) * 0.1).sin_cos();
            assert!(unfolded.contains([0.99 * cos, 0.99 * sin]));
            assert!(!unfolded.contains([1.01 * cos, 1.01 * sin]));
        }
        assert!(unfolded.contains([0.0, 0.0]));
    }

    #[test]
    fn the_table_of_a_lens_without_a_fold_extends_to_its_reach() {
        let lens = Distortion::Fisheye { k: [0.0; 4] };
        let unfolded = Unfolded::new(&lens, 10.0);
        assert!(unfolded.contains([-7.0, 7.0]) && !unfolded.contains([8.0, 8.0]));
    }
}
