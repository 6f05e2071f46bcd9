//! Nearest neighbours in a fixed set of points: a k-d tree without pointers, the same for any number of threads.

use glam::DVec3;

/// A range of this many points is searched one by one.
const LEAF: usize = 8;

/// Points in the order of the tree: the middle of every range splits it along that range's longest axis.
pub(super) struct Tree {
    points: Vec<(DVec3, u32)>,
    axes: Vec<u8>,
}

impl Tree {
    /// Points must be finite.
    pub(super) fn new(points: &[DVec3]) -> Self {
        let mut points: Vec<(DVec3, u32)> = points.iter().zip(0..).map(|(p, i)| (*p, i)).collect();
        let mut axes = vec![0; points.len()];
        split(&mut points, &mut axes);
        Self { points, axes }
    }

    /// Index of and squared distance to the nearest point closer than `reach`.
    pub(super) fn nearest(&self, query: DVec3, reach: f64) -> Option<(usize, f64)> {
        let mut found = Vec::with_capacity(1);
        self.search(0, self.points.len(), query, 1, reach * reach, &mut found);
        found.first().map(|&(squared, index)| (index as usize, squared))
    }

    /// The `count` nearest points, nearest first, as squared distance and index.
    pub(super) fn neighbours(&self, query: DVec3, count: usize) -> Vec<(f64, u32)> {
        let mut found = Vec::with_capacity(count + 1);
        self.search(0, self.points.len(), query, count, f64::INFINITY, &mut found);
        found
    }

    fn search(
        &self,
        low: usize,
        high: usize,
        q: DVec3,
        count: usize,
        most: f64,
        found: &mut Vec<(f64, u32)>,
    ) {
        let worst = |found: &Vec<(f64, u32)>| if found.len() < count { most } else { found[count - 1].0 };
        let visit = |&(p, index): &(DVec3, u32), found: &mut Vec<(f64, u32)>| {
            let squared = p.distance_squared(q);
            if squared < worst(found) {
                let at = found.partition_point(|f| f.0 <= squared);
                found.insert(at, (squared, index));
                found.truncate(count);
            }
        };
        if high - low <= LEAF {
            self.points[low..high].iter().for_each(|p| visit(p, found));
            return;
        }
        let middle = usize::midpoint(low, high);
        let axis = self.axes[middle] as usize;
        let across = q[axis] - self.points[middle].0[axis];
        let (near, far) = ((low, middle), (middle + 1, high));
        let (near, far) = if across < 0.0 { (near, far) } else { (far, near) };
        self.search(near.0, near.1, q, count, most, found);
        visit(&self.points[middle], found);
        if across * across < worst(found) {
            self.search(far.0, far.1, q, count, most, found);
        }
    }
}

fn split(points: &mut [(DVec3, u32)], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let low = points.iter().fold(DVec3::INFINITY, |m, p| m.min(p.0));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(p.0));
    let size = high - low;
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    axes[middle] = axis as u8;
    let (left, right) = points.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    split(left, left_axes);
    split(&mut right[1..], &mut right_axes[1..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_finds_what_a_search_of_all_points_finds() {
        let number = |i: u64| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 / (1u64 << 24) as f64;
        let point = |i: u64| DVec3::new(number(3 * i), number(3 * i + 1), 0.2 * number(3 * i + 2));
        let points: Vec<DVec3> = (0..500).map(point).collect();
        let tree = Tree::new(&points);
        for query in (1000..1060).map(point) {
            let mut all: Vec<f64> = points.iter().map(|p| p.distance_squared(query)).collect();
            all.sort_by(f64::total_cmp);
            let found: Vec<f64> = tree.neighbours(query, 7).iter().map(|f| f.0).collect();
            assert_eq!(found, all[..7]);
            assert_eq!(tree.nearest(query, 10.0).unwrap().1, all[0]);
            assert!(tree.nearest(query, 0.99 * all[0].sqrt()).is_none());
        }
        assert!(Tree::new(&[]).nearest(DVec3::ZERO, 1.0).is_none());
    }
}
