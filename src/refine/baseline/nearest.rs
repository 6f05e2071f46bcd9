//! How far points lie apart: the size that 3DGS gives a Gaussian at first.

use rayon::prelude::*;

/// Neighbours that are looked at.
const NEIGHBOURS: usize = 3;

/// Points below this are searched one by one.
const LEAF: usize = 8;

/// The root of the mean square distance to the three nearest others, for each point, in the points' unit; of fewer
/// points to those there are, and 0 of one alone.
pub(super) fn spacing(points: &[[f32; 3]]) -> Vec<f32> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    sort(points, &mut order, 0);
    let of = |i: usize| {
        let mut nearest = [f32::INFINITY; NEIGHBOURS];
        search(points, &order, 0, i, &mut nearest);
        let found = nearest.iter().filter(|d| d.is_finite()).count();
        (nearest[..found].iter().sum::<f32>() / found.max(1) as f32).sqrt()
    };
    (0..points.len()).into_par_iter().map(of).collect()
}

/// Makes a k-d tree of indices: the middle one parts the others along an axis, which alternates.
fn sort(points: &[[f32; 3]], order: &mut [u32], axis: usize) {
    if order.len() <= LEAF {
        return;
    }
    let middle = order.len() / 2;
    let at = |i: &u32| points[*i as usize][axis];
    order.select_nth_unstable_by(middle, |a, b| at(a).total_cmp(&at(b)).then(a.cmp(b)));
    let (below, above) = order.split_at_mut(middle);
    let next = (axis + 1) % 3;
    rayon::join(|| sort(points, below, next), || sort(points, &mut above[1..], next));
}

/// Sorts square distances from point `i` to points of this part of the tree in among the nearest.
fn search(points: &[[f32; 3]], order: &[u32], axis: usize, i: usize, nearest: &mut [f32; NEIGHBOURS]) {
    let from = points[i];
    let offer = |other: u32, nearest: &mut [f32; NEIGHBOURS]| {
        if other as usize == i {
            return;
        }
        let to = points[other as usize];
        let mut distance = (0..3).map(|k| (to[k] - from[k]).powi(2)).sum::<f32>();
        for near in nearest {
            if distance < *near {
                std::mem::swap(near, &mut distance);
            }
        }
    };
    if order.len() <= LEAF {
        order.iter().for_each(|&other| offer(other, nearest));
        return;
    }
    let middle = order.len() / 2;
    let offset = from[axis] - points[order[middle] as usize][axis];
    let (below, above) = (&order[..middle], &order[middle + 1..]);
    let (own, other) = if offset < 0.0 { (below, above) } else { (above, below) };
    let next = (axis + 1) % 3;
    search(points, own, next, i, nearest);
    offer(order[middle], nearest);
    if offset * offset < nearest[NEIGHBOURS - 1] {
        search(points, other, next, i, nearest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::chance::Chance;

    #[test]
    fn the_tree_finds_what_looking_at_all_finds() {
        for n in [0u64, 1, 2, 3, 9, 700] {
            let point = |i: u64| {
                let mut chance = Chance::of([n, 1, i]);
                // A coarse grid: many coincide or are equally far.
                [(); 3].map(|()| (chance.uniform() * 12.0).floor() as f32)
            };
            let points: Vec<[f32; 3]> = (0..n).map(point).collect();
            let slowly = |i: usize| {
                let mut all: Vec<f32> = (0..points.len())
                    .filter(|j| *j != i)
                    .map(|j| (0..3).map(|k| (points[i][k] - points[j][k]).powi(2)).sum())
                    .collect();
                all.sort_by(f32::total_cmp);
                all.truncate(3);
                (all.iter().sum::<f32>() / all.len().max(1) as f32).sqrt()
            };
            assert_eq!(spacing(&points), (0..points.len()).map(slowly).collect::<Vec<_>>(), "{n}");
        }
    }
}
