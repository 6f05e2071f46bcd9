//! Removal of isolated points of a scan: dust, reflections, mixed measurements between two surfaces.

use glam::DVec3;
use rayon::prelude::*;
use vg_geometry::nearest::Nearest;
use vg_geometry::progress::Watch;

/// The neighbour whose distance measures a point's isolation; a group of strays must be larger than this to be kept.
const NEIGHBOUR: usize = 8;

/// Limit in median distances: a surface scanned at a ninth of the median density is kept.
const FACTOR: f64 = 3.0;

/// The points without those whose eighth neighbour is farther than three times the median of that distance.
pub(super) fn removed(points: &[[f32; 3]], watch: &Watch) -> Vec<[f32; 3]> {
    let tree = Nearest::from_f32(points);
    let far = |p: &[f32; 3]| {
        if watch.is_stopped() {
            return 0.0;
        }
        // The point itself is among the nearest.
        let near = tree.k_nearest(DVec3::from_array(p.map(f64::from)), NEIGHBOUR + 1);
        near.last().map_or(0.0, |n| n.squared)
    };
    let squared: Vec<f64> = points.par_iter().map(far).collect();
    let mut sorted = squared.clone();
    let middle = sorted.len() / 2;
    if sorted.is_empty() {
        return Vec::new();
    }
    let limit = FACTOR * FACTOR * *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    points.iter().zip(squared).filter(|(_, far)| *far <= limit).map(|(p, _)| *p).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::progress::UNWATCHED;

    #[test]
    fn isolated_points_are_removed_and_thin_surfaces_are_kept() {
        // A wall of 40 by 40 points 1 apart, one of 8 by 8 points 1.4 apart beside it, and five strays.
        let wall = (0..1600).map(|i| [(i % 40) as f32, (i / 40) as f32, 0.0]);
        let thin = (0..64).map(|i| [60.0 + 1.4 * (i % 8) as f32, 1.4 * (i / 8) as f32, 0.0]);
        let strays = (0..5).map(|i| [i as f32 * 10.0, 20.0, 30.0]);
        let points: Vec<[f32; 3]> = wall.chain(thin).chain(strays).collect();
        assert!(
            removed(&points, &UNWATCHED) == points[..1664],
            "{} left",
            removed(&points, &UNWATCHED).len()
        );
    }

    #[test]
    fn few_points_and_coincident_points_are_kept() {
        for points in [vec![], vec![[1.0; 3]], vec![[0.0; 3], [9.0; 3]], vec![[2.0; 3]; 100]] {
            assert_eq!(removed(&points, &UNWATCHED), points);
        }
    }
}
