//! Point-to-plane ICP, with scale, of the vehicle's sparse points and the scan's surface.

use super::scan::Scan;
use super::silhouettes::Outline;
use super::solve::{System, slope};
use glam::DVec3;
use rayon::prelude::*;
use vg_geometry::Similarity;

/// Minimum share of masks that contain a vehicle point, of those whose picture it projects into.
const INSIDE_SHARE: f64 = 0.95;

/// Points of the vehicle, world: those that project into nearly all masks, visible or not. Such points are in the
/// hull, which contains only the vehicle and some ground below it.
pub(super) fn vehicle_points(sparse: &[DVec3], outlines: &[Outline]) -> Vec<DVec3> {
    let inside = |p: &&DVec3| {
        let (mut known, mut inside) = (0, 0);
        for is_vehicle in outlines.iter().filter_map(|o| o.shows_vehicle(**p)) {
            known += 1;
            inside += usize::from(is_vehicle);
        }
        known * 2 >= outlines.len() && f64::from(inside as u32) >= INSIDE_SHARE * f64::from(known as u32)
    };
    sparse.par_iter().filter(inside).copied().collect()
}

/// Distances of points to the scan's planes, in units of `noise` metres; points farther than `reach` metres only add a
/// constant (reflections, interiors, the ground).
pub(super) fn system(
    points: &[DVec3],
    scan: &Scan,
    s: &Similarity,
    reach: f64,
    noise: f64,
    weight: f64,
) -> System {
    let mut system = System::new();
    let bend = 0.5 * reach / noise;
    for found in distances(points, scan, s, reach) {
        match found {
            Some((point, index, distance)) => {
                let slope = slope(point, scan.center, scan.normals[index]) / noise;
                system.add(distance / noise, &slope, weight, bend);
            }
            None => system.add_constant(weight * bend * (reach / noise - 0.5 * bend)),
        }
    }
    system
}

/// Each point in the vehicle frame, the index of its nearest scan point, and the signed distance along its normal.
fn distances(points: &[DVec3], scan: &Scan, s: &Similarity, reach: f64) -> Vec<Option<(DVec3, usize, f64)>> {
    let distance = |p: &DVec3| {
        let point = s.transform_point(*p);
        let index = scan.tree.nearest(point).filter(|found| found.squared < reach * reach)?.index;
        Some((point, index, scan.normals[index].dot(point - scan.points[index])))
    };
    points.par_iter().map(distance).collect()
}

/// Root mean square distance, metres, and number of the points within `reach` metres of the scan.
pub(super) fn residual(points: &[DVec3], scan: &Scan, s: &Similarity, reach: f64) -> (f64, usize) {
    let near: Vec<f64> = distances(points, scan, s, reach).into_iter().flatten().map(|d| d.2).collect();
    let squares = near.iter().map(|d| d * d).sum::<f64>();
    ((squares / near.len().max(1) as f64).sqrt(), near.len())
}
