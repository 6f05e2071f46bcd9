//! The ground among the sparse points: the plane most of them lie on, of those that level pictures allow.

use super::candidates::up_of_pictures;
use super::scan::plane_of;
use super::silhouettes::Outline;
use glam::DVec3;
use vg_geometry::robust::scramble;

/// Planes tried: three of half the points lie in one plane once in eight times.
const TRIALS: u64 = 400;

/// Cosine of the angle that the ground may have with level pictures.
const LEVEL: f64 = 0.8;

/// Points are on the plane within this part of the cameras' distance from each other.
const THICKNESS: f64 = 0.004;

/// Fewer points are no ground.
const FEWEST: usize = 50;

/// A point of it and its normal, up, world; `None` where the points show no ground.
pub(super) fn plane(sparse: &[DVec3], outlines: &[Outline]) -> Option<(DVec3, DVec3)> {
    if sparse.len() < FEWEST {
        return None;
    }
    let up = up_of_pictures(outlines);
    let middle = outlines.iter().map(|o| o.pose().translation).sum::<DVec3>() / outlines.len() as f64;
    let size = outlines.iter().map(|o| o.pose().translation.distance(middle)).fold(0.0, f64::max);
    let near = |n: DVec3, p: DVec3| {
        let on = |q: &&DVec3| n.dot(**q - p).abs() < THICKNESS * size && q.distance(middle) < 2.0 * size;
        sparse.iter().filter(on).copied().collect::<Vec<DVec3>>()
    };
    let mut best: Vec<DVec3> = Vec::new();
    for trial in 0..TRIALS {
        let pick = |k: u64| sparse[(scramble(3 * trial + k) % sparse.len() as u64) as usize];
        let (a, b, c) = (pick(0), pick(1), pick(2));
        let n = (b - a).cross(c - a).normalize_or_zero();
        if n.dot(up).abs() < LEVEL {
            continue;
        }
        let on = near(n, a);
        if on.len() > best.len() {
            best = on;
        }
    }
    if best.len() < FEWEST {
        return None;
    }
    let (point, n) = plane_of(&best);
    Some((point, if n.dot(up) < 0.0 { -n } else { n }))
}
