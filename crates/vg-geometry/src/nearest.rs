//! Nearest neighbours among points: a k-d tree that is built once.
//!
//! Equally near points are ordered by index, whatever the machine and the number of threads. A general crate was
//! measured for comparison (kiddo 5.3 and 6.3, 40,000 points on a surface): it is 1.2 times as fast for one neighbour
//! and no faster for four, but its order of ties depends on the instruction set, and it adds a dozen dependencies.

use glam::DVec3;

/// Largest number of points that are searched one by one.
const LEAF: usize = 16;

/// Halves larger than this are built in parallel.
const ALONE: usize = 4096;

/// A k-d tree over points.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// The middle point separates those before it from those after it along an axis, which alternates; each half is
    /// ordered in the same way.
    tree: Vec<Point>,
}

#[derive(Clone, Copy, Debug)]
struct Point {
    at: [f64; 3],
    index: u32,
}

/// A neighbour found by a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Index in the list of points that the tree was built from.
    pub index: usize,
    /// Squared distance, in the points' unit.
    pub squared: f64,
}

/// The sort key of neighbours: squared distance, then index.
type Rank = (f64, u32);

/// The rank after that of any point.
const NONE: Rank = (f64::INFINITY, u32::MAX);

impl Nearest {
    /// Builds the tree of finite points, fewer than 2^32.
    pub fn new(points: impl IntoIterator<Item = DVec3>) -> Self {
        let point = |(index, at): (usize, DVec3)| {
            debug_assert!(at.is_finite(), "points[{index}] is {at}");
            Point { at: at.to_array(), index: index as u32 }
        };
        let mut tree: Vec<Point> = points.into_iter().enumerate().map(point).collect();
        assert!(tree.len() < u32::MAX as usize, "{} points", tree.len());
        part(&mut tree, 0);
        Self { tree }
    }

    /// Builds the tree of f32 positions, as point clouds and scans store them.
    pub fn from_f32(points: &[[f32; 3]]) -> Self {
        Self::new(points.iter().map(|p| DVec3::from_array(p.map(f64::from))))
    }

    /// The point nearest to a finite position; `None` for an empty tree.
    pub fn nearest(&self, to: DVec3) -> Option<Neighbor> {
        let mut best = [NONE];
        search(&self.tree, 0, to.to_array(), &mut best);
        (best[0] != NONE).then(|| found(best[0]))
    }

    /// The `k` points nearest to a finite position, nearest first; all of them where there are fewer.
    pub fn k_nearest(&self, to: DVec3, k: usize) -> Vec<Neighbor> {
        let mut best = vec![NONE; k.min(self.tree.len())];
        if !best.is_empty() {
            search(&self.tree, 0, to.to_array(), &mut best);
        }
        best.into_iter().map(found).collect()
    }
}

fn found((squared, index): Rank) -> Neighbor {
    Neighbor { index: index as usize, squared }
}

/// Sorts the points into a tree. Equal coordinates are ordered by index, so any number of points may coincide.
fn part(points: &mut [Point], axis: usize) {
    if points.len() <= LEAF {
        return;
    }
    let middle = points.len() / 2;
    let order = |a: &Point, b: &Point| a.at[axis].total_cmp(&b.at[axis]).then(a.index.cmp(&b.index));
    points.select_nth_unstable_by(middle, order);
    let (below, above) = points.split_at_mut(middle);
    let (above, next) = (&mut above[1..], (axis + 1) % 3);
    if middle > ALONE {
        rayon::join(|| part(below, next), || part(above, next));
    } else {
        part(below, next);
        part(above, next);
    }
}

/// Inserts the points of this part of the tree into `best`, which is not empty.
fn search(points: &[Point], axis: usize, to: [f64; 3], best: &mut [Rank]) {
    if points.len() <= LEAF {
        points.iter().for_each(|point| offer(point, to, best));
        return;
    }
    let middle = points.len() / 2;
    let offset = to[axis] - points[middle].at[axis];
    let (below, above) = (&points[..middle], &points[middle + 1..]);
    let (near, far) = if offset < 0.0 { (below, above) } else { (above, below) };
    let next = (axis + 1) % 3;
    search(near, next, to, best);
    offer(&points[middle], to, best);
    // `<=`: a point as far away as the worst of the best may have a lower index.
    if offset * offset <= best[best.len() - 1].0 {
        search(far, next, to, best);
    }
}

fn offer(point: &Point, to: [f64; 3], best: &mut [Rank]) {
    let squared = (0..3).map(|k| (point.at[k] - to[k]).powi(2)).sum();
    let mut rank = (squared, point.index);
    if rank < best[best.len() - 1] {
        for other in best {
            if rank < *other {
                std::mem::swap(&mut rank, other);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform numbers in [0, 1), equal on every machine.
    fn uniform(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    fn slowly(points: &[DVec3], to: DVec3, k: usize) -> Vec<Neighbor> {
        let neighbor = |(index, p): (usize, &DVec3)| {
            let squared = (0..3).map(|k| (p[k] - to[k]).powi(2)).sum();
            Neighbor { index, squared }
        };
        let mut all: Vec<Neighbor> = points.iter().enumerate().map(neighbor).collect();
        all.sort_by(|a, b| a.squared.total_cmp(&b.squared).then(a.index.cmp(&b.index)));
        all.truncate(k);
        all
    }

    #[test]
    fn the_tree_returns_the_neighbours_of_an_exhaustive_search_with_ties_by_index() {
        let mut state = 1;
        // On a coarse grid of that many cells (0: no grid) many points coincide or are equally far.
        for (n, cells) in [(0, 0.0), (1, 0.0), (3, 0.0), (700, 0.0), (700, 6.0), (9_000, 12.0), (9_000, 0.0)]
        {
            let mut point = || {
                let p = DVec3::from_array([(); 3].map(|()| uniform(&mut state)));
                if cells > 0.0 { (p * cells).floor() } else { p }
            };
            let points: Vec<DVec3> = (0..n).map(|_| point()).collect();
            let tree = Nearest::new(points.iter().copied());
            for _ in 0..50 {
                let to = point();
                let expected = slowly(&points, to, 5);
                assert_eq!(tree.nearest(to), expected.first().copied(), "{n} points, {cells} cells");
                assert_eq!(tree.k_nearest(to, 5), expected, "{n} points, {cells} cells");
            }
            assert_eq!(tree.k_nearest(DVec3::ZERO, 0), []);
        }
    }

    #[test]
    fn ten_thousand_points_in_one_place_are_found_by_their_indices() {
        for point in [DVec3::ZERO, DVec3::new(1.0, -2.0, 3.0)] {
            let tree = Nearest::new(std::iter::repeat_n(point, 10_000));
            let indices: Vec<usize> = tree.k_nearest(point, 20).iter().map(|n| n.index).collect();
            assert_eq!(indices, (0..20).collect::<Vec<_>>());
            assert_eq!(tree.nearest(point + DVec3::X), Some(Neighbor { index: 0, squared: 1.0 }));
        }
        // Points equal along two axes (on a line), and along one (on a plane).
        for equal in [2, 1] {
            let mut state = 7;
            let point = |_| {
                DVec3::from_array(std::array::from_fn(|k| if k < equal { 4.0 } else { uniform(&mut state) }))
            };
            let points: Vec<DVec3> = (0..10_000).map(point).collect();
            let tree = Nearest::new(points.iter().copied());
            let to = DVec3::splat(0.5);
            assert_eq!(tree.k_nearest(to, 7), slowly(&points, to, 7));
        }
    }
}
