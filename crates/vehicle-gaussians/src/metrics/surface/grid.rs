//! Thinning of points to one per cell of a regular grid.

use rayon::prelude::*;

/// Bits of a cell's index along one axis.
const BITS: u32 = 21;

/// The mean of the points in each cell of side `cell`, in the order of cells; the grid begins at the origin.
pub(super) fn thinned(points: &[[f32; 3]], cell: f64) -> Vec<[f32; 3]> {
    let key = |p: &[f32; 3]| {
        p.iter().fold(0u64, |key, c| {
            // `as` saturates: points beyond the last cell, kilometres away, share it.
            let half = 1i64 << (BITS - 1);
            let number = ((f64::from(*c) / cell).floor() as i64).clamp(-half, half - 1) + half;
            (key << BITS) | number as u64
        })
    };
    let mut keys: Vec<(u64, u32)> = points.par_iter().enumerate().map(|(i, p)| (key(p), i as u32)).collect();
    keys.par_sort_unstable();
    let mean = |inside: &[(u64, u32)]| {
        let mut sum = [0.0; 3];
        for (_, i) in inside {
            (0..3).for_each(|k| sum[k] += f64::from(points[*i as usize][k]));
        }
        sum.map(|s| (s / inside.len() as f64) as f32)
    };
    keys.chunk_by(|a, b| a.0 == b.0).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_one_cell_become_their_mean_and_others_stay() {
        let points = [[0.1, 0.1, 0.1], [-0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [0.2, 0.4, 0.1], [1e30, 0.0, 0.0]];
        let mut thin = thinned(&points, 0.5);
        thin[1] = thin[1].map(|c| (c * 1e3).round() / 1e3);
        assert_eq!(thin, [[-0.1, 0.1, 0.1], [0.2, 0.2, 0.1], [1e30, 0.0, 0.0]]);
        assert_eq!(thinned(&[], 0.5), [[0.0; 3]; 0]);
    }
}
