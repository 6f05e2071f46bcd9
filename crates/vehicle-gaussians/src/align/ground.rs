//! The ground among the sparse points: the plane with the most points, among those consistent with level pictures.

use super::candidates::up_from_pictures;
use super::scan::plane_of;
use super::silhouettes::Outline;
use glam::DVec3;
use vg_geometry::robust::scramble;

/// The number of planes tried: if half the points lie in one plane, three random ones do once in eight times.
const TRIALS: u64 = 400;

/// Cosine of the largest angle between the ground's normal and up in level pictures.
const LEVEL: f64 = 0.8;

/// Largest distance of a point from the plane, as a part of the cameras' largest distance from their middle.
const THICKNESS: f64 = 0.004;

/// Minimum of points on the ground.
const FEWEST: usize = 50;

/// A point of the ground and its upward normal, world; `None` if the points show no ground.
pub(super) fn plane(sparse: &[DVec3], outlines: &[Outline]) -> Option<(DVec3, DVec3)> {
    if sparse.len() < FEWEST {
        return None;
    }
    let up = up_from_pictures(outlines);
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
