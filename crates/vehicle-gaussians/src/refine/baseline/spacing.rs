//! Distances between neighbouring points: the first size of a Gaussian in 3DGS.

use glam::DVec3;
use rayon::prelude::*;
use vg_geometry::nearest::Nearest;

/// Number of neighbours.
const NEIGHBOURS: usize = 3;

/// The root mean square distance of each point to its three nearest neighbours, in the points' unit; to fewer where there
/// are not three, and 0 for a single point.
pub(super) fn spacing(points: &[[f32; 3]]) -> Vec<f32> {
    let tree = Nearest::from_f32(points);
    let of = |(i, point): (usize, &[f32; 3])| {
        let mut near = tree.k_nearest(DVec3::from_array(point.map(f64::from)), NEIGHBOURS + 1);
        // The point itself, or another in the same place.
        let own = near.iter().position(|n| n.index == i).unwrap_or(near.len() - 1);
        near.remove(own);
        (near.iter().map(|n| n.squared).sum::<f64>() / near.len().max(1) as f64).sqrt() as f32
    };
    points.par_iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::chance::Rng;

    #[test]
    fn a_points_size_is_that_of_looking_at_all_others() {
        for n in [0u64, 1, 2, 3, 9, 700] {
            let point = |i: u64| {
                let mut rng = Rng::new([n, 1, i]);
                // A coarse grid, so that many points coincide or are equally far apart.
                [(); 3].map(|()| (rng.uniform() * 12.0).floor() as f32)
            };
            let points: Vec<[f32; 3]> = (0..n).map(point).collect();
            let slowly = |i: usize| {
                let squared =
                    |j: usize| (0..3).map(|k| f64::from(points[i][k] - points[j][k]).powi(2)).sum::<f64>();
                let mut all: Vec<f64> = (0..points.len()).filter(|j| *j != i).map(squared).collect();
                all.sort_by(f64::total_cmp);
                all.truncate(3);
                (all.iter().sum::<f64>() / all.len().max(1) as f64).sqrt() as f32
            };
            assert_eq!(spacing(&points), (0..points.len()).map(slowly).collect::<Vec<_>>(), "{n}");
        }
    }

    #[test]
    fn points_in_one_place_have_no_size() {
        assert_eq!(spacing(&[[1.0, 2.0, 3.0]; 9]), [0.0; 9]);
    }
}
