//! The sparse points of the vehicle against the scan's surface: point to plane, with scale.

use super::scan::Scan;
use super::silhouettes::Outline;
use super::solve::{System, slope};
use glam::DVec3;
use rayon::prelude::*;
use vg_geometry::Similarity;

/// A point is the vehicle's if so many views of those that could see it say so.
const INSIDE_SHARE: f64 = 0.95;

/// Points of the vehicle, world: those that project into nearly all masks. Seen or hidden: what is in all masks is in
/// the hull, where nothing is but the vehicle and some ground below it.
pub(super) fn of_vehicle(sparse: &[DVec3], outlines: &[Outline]) -> Vec<DVec3> {
    let inside = |p: &&DVec3| {
        let (mut asked, mut yes) = (0, 0);
        for said in outlines.iter().filter_map(|o| o.shows_vehicle(**p)) {
            asked += 1;
            yes += usize::from(said);
        }
        asked * 2 >= outlines.len() && f64::from(yes as u32) >= INSIDE_SHARE * f64::from(asked as u32)
    };
    sparse.par_iter().filter(inside).copied().collect()
}

/// Distances of points to the scan's planes, in units of `noise` metres; points farther than `reach` metres say
/// nothing (reflections, interiors, the ground).
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

/// Each point in the vehicle frame, its nearest point of the scan, and the signed distance along that one's normal.
fn distances(points: &[DVec3], scan: &Scan, s: &Similarity, reach: f64) -> Vec<Option<(DVec3, usize, f64)>> {
    let of = |p: &DVec3| {
        let point = s.transform_point(*p);
        let index = scan.tree.nearest(point).filter(|found| found.squared < reach * reach)?.index;
        Some((point, index, scan.normals[index].dot(point - scan.points[index])))
    };
    points.par_iter().map(of).collect()
}

/// Root mean square distance, metres, and number of the points within `reach` metres of the scan.
pub(super) fn residual(points: &[DVec3], scan: &Scan, s: &Similarity, reach: f64) -> (f64, usize) {
    let near: Vec<f64> = distances(points, scan, s, reach).into_iter().flatten().map(|d| d.2).collect();
    let squares = near.iter().map(|d| d * d).sum::<f64>();
    ((squares / near.len().max(1) as f64).sqrt(), near.len())
}
