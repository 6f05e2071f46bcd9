//! Simulates a sensor next to the cameras: a few points of a scan, on the side that the cameras see.
//!
//! A scan covers the whole vehicle, including the side that a method has to infer. Hidden points are found from the
//! cloud alone, without ground truth.

use glam::DVec3;
use vg::View;

/// Cells across the pictures of the hidden-point test: in 64, a scan of 40 000 points leaves none of a car's
/// empty.
const CELLS: f64 = 64.0;

/// A point this far behind the nearest one of its cell is hidden, metres: more than a slanted panel falls away
/// within a cell, less than a vehicle is thick.
const BEHIND_M: f64 = 0.2;

/// At most `count` of the points on the cameras' side of y = 0 that a camera sees. Deterministic; the points of a
/// smaller count are a subset of those of a larger count.
pub(super) fn sweep(points: &[[f32; 3]], views: &[View], count: usize) -> Vec<[f32; 3]> {
    let side: f64 = views.iter().map(|view| view.camera.center().y).sum();
    let mut seen = vec![false; points.len()];
    for view in views {
        see(points, view, &mut seen);
    }
    let mut chosen: Vec<usize> =
        (0..points.len()).filter(|&i| seen[i] && f64::from(points[i][1]) * side >= 0.0).collect();
    chosen.sort_by_key(|&i| scrambled(i as u64));
    chosen.truncate(count);
    chosen.into_iter().map(|i| points[i]).collect()
}

/// Marks the points that are not hidden by a nearer point of their cell.
fn see(points: &[[f32; 3]], view: &View, seen: &mut [bool]) {
    let camera = &view.camera;
    let camera_from_vehicle = camera.vehicle_from_camera.inverse();
    let cell_px = f64::from(camera.width) / CELLS;
    let rows = (f64::from(camera.height) / cell_px).ceil();
    let place = |point: &[f32; 3]| {
        let p = camera_from_vehicle.transform_point(DVec3::from_array(point.map(f64::from)));
        let cell = camera.project(p)?.map(|c| (c / cell_px).floor());
        let inside = cell[0] >= 0.0 && cell[0] < CELLS && cell[1] >= 0.0 && cell[1] < rows;
        inside.then_some(((cell[1] * CELLS + cell[0]) as usize, p.z))
    };
    let places: Vec<Option<(usize, f64)>> = points.iter().map(place).collect();
    let mut nearest = vec![f64::INFINITY; (CELLS * rows) as usize];
    for &(cell, z) in places.iter().flatten() {
        nearest[cell] = nearest[cell].min(z);
    }
    for (seen, place) in seen.iter_mut().zip(places) {
        *seen = *seen || place.is_some_and(|(cell, z)| z <= nearest[cell] + BEHIND_M);
    }
}

/// SplitMix64's finaliser: a pseudo-random order that is the same on every platform.
fn scrambled(i: u64) -> u64 {
    let mut z = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
