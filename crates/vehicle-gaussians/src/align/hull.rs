//! Points on the visual hull of the masks, in upright coordinates of the world, for the vehicle's extent.

use super::silhouettes::Outline;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use vg_geometry::progress::Watch;

/// Cells along a side of the carved cube.
const CELLS: usize = 80;

/// Parts along a side into which a cell on the surface is divided, each about a five-hundredth of the cube.
const PARTS: usize = 6;

/// Minimum share of the views that see a point of the hull: a point that few views see is hardly carved.
const SEEN_SHARE: f64 = 0.5;

/// Points of the hull's surface in coordinates rotated by `upright_from_world`, and the distance between them. `middle`
/// is the cube's centre in the world, `half` half its side.
pub(super) fn surface(
    outlines: &[Outline],
    upright_from_world: DMat3,
    middle: DVec3,
    half: f64,
    watch: &Watch,
) -> (Vec<DVec3>, f64) {
    let world_from_upright = upright_from_world.transpose();
    let low = upright_from_world * middle - DVec3::splat(half);
    let cell = 2.0 * half / CELLS as f64;
    let inside = |p: DVec3| !watch.is_stopped() && is_inside(outlines, world_from_upright * p);
    let at =
        |i: usize| DVec3::new((i % CELLS) as f64, (i / CELLS % CELLS) as f64, (i / CELLS / CELLS) as f64);
    let filled: Vec<bool> =
        (0..CELLS.pow(3)).into_par_iter().map(|i| inside(low + cell * (at(i) + DVec3::splat(0.5)))).collect();
    let on_surface = |i: &usize| {
        let p = at(*i);
        let inner = p.min_element() > 0.0 && p.max_element() < (CELLS - 1) as f64;
        let strides = [1, CELLS, CELLS * CELLS];
        // A cell whose middle is carved may contain surface too; then a neighbour is filled.
        inner && strides.iter().any(|s| filled[i + s] != filled[*i] || filled[i - s] != filled[*i])
    };
    let part = cell / PARTS as f64;
    let parts = |i: usize| {
        let corner = low + cell * at(i);
        (0..PARTS.pow(3)).filter_map(move |k| {
            let k = DVec3::new((k % PARTS) as f64, (k / PARTS % PARTS) as f64, (k / PARTS / PARTS) as f64);
            let p = corner + part * (k + DVec3::splat(0.5));
            inside(p).then_some(p)
        })
    };
    let cells: Vec<usize> = (0..filled.len()).filter(on_surface).collect();
    let points: Vec<Vec<DVec3>> = cells.into_par_iter().map(|i| parts(i).collect()).collect();
    (points.into_iter().flatten().collect(), part)
}

/// Whether a point is background in no mask and vehicle in enough of them.
fn is_inside(outlines: &[Outline], world: DVec3) -> bool {
    let mut seen = 0;
    for outline in outlines {
        match outline.shows_vehicle(world) {
            Some(false) => return false,
            Some(true) => seen += 1,
            None => {}
        }
    }
    f64::from(seen) >= SEEN_SHARE * outlines.len() as f64
}
