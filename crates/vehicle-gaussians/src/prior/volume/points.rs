//! Moves a field's surface to measured points: a LiDAR sweep, or any cloud in the vehicle's frame.
//!
//! Most points lie on the surface up to noise. Others are stray, or lie on the road or on seats seen through a window.
//! Those outside the hull of the silhouettes cannot belong to the vehicle and are left out; those inside are outvoted
//! by their neighbours ([`super::relax`]).

use super::field::Field;
use super::fill::hold_masks;
use super::relax::{Ceiling, Pull, PullKind, Relaxation, relax};
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;
use vg_scene::{Cloud, View};

/// Largest distance of a vehicle point outside the silhouettes' hull, metres: errors of poses and sensor noise stay
/// below.
const OUTSIDE_M: f32 = 0.05;

/// Size of the cells whose points count as one, metres, so that the cost is bounded by the vehicle's surface.
const CELL_M: f32 = 0.03;

/// Largest weight of a cell; it grows with the square root of the number of points.
const MOST_WEIGHT: f32 = 3.0;

/// Chosen on ten ray-traced vehicles, see docs/SHAPE.md.
const RELAXATION: Relaxation =
    Relaxation { coarsest: 0.64, finest: 0.08, pulls_per_cell: 2.0, scale: 0.03, stiffness: 0.3, fade: 0.02 };

/// How measured points were used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PointFit {
    /// Points the surface was moved to.
    pub used: usize,
    /// Points outside the silhouettes' hull, which cannot lie on the vehicle.
    pub outside: usize,
    /// Median distance of the used points to the surface before it was moved, metres, approximated by the field's
    /// value.
    pub before_m: f64,
    /// The distance after it was moved.
    pub after_m: f64,
}

/// Deforms `field` until its surface passes through `points`, vehicle frame, metres, all finite. `hull` bounds the
/// vehicle; without it the field itself does. `held` are pulls that the points must not undo.
fn fit_points(field: &mut Field, hull: Option<&Field>, points: &[[f32; 3]], held: &[Pull]) -> PointFit {
    let bound: &Field = hull.unwrap_or(field);
    let inside: Vec<Vec3> = points
        .par_iter()
        .map(|p| Vec3::from_array(*p))
        .filter(|p| bound.sample(*p) - beyond(bound, *p) > -OUTSIDE_M)
        .collect();
    let pulls = thinned(&inside);
    let before_m = median_distance(field, &pulls);
    let ceiling = hull.map(|hull| Ceiling { hull, slack: 0.0 });
    let together: Vec<Pull> = pulls.iter().chain(held).copied().collect();
    if !pulls.is_empty() {
        relax(field, ceiling, &together, &RELAXATION);
    }
    PointFit {
        used: inside.len(),
        outside: points.len() - inside.len(),
        before_m,
        after_m: median_distance(field, &pulls),
    }
}

/// Deforms `field` to the scene's cloud, if there is one; the masks that `field` fills stay filled.
pub(crate) fn fit_cloud(
    field: &mut Field,
    hull: &Field,
    views: &[View],
    cloud: Option<&Cloud>,
) -> Option<PointFit> {
    let points = cloud?.points();
    let held = hold_masks(field, views);
    Some(fit_points(field, Some(hull), points, &held))
}

/// Distance of a point outside the field's grid, metres.
fn beyond(field: &Field, p: Vec3) -> f32 {
    let (low, high) = field.bounds();
    (low - p).max(p - high).max_element().max(0.0)
}

/// One pull per occupied cell, at the mean of its points, which are folded to y >= 0 first.
fn thinned(points: &[Vec3]) -> Vec<Pull> {
    let fold = |p: Vec3| Vec3::new(p.x, p.y.abs(), p.z);
    let cell = |p: Vec3| (fold(p) / CELL_M).floor().as_ivec3().to_array();
    let mut point_by_cell: Vec<([i32; 3], usize)> =
        points.par_iter().enumerate().map(|(i, p)| (cell(*p), i)).collect();
    point_by_cell.par_sort_unstable();
    let pull = |group: &[([i32; 3], usize)]| {
        let sum: glam::DVec3 = group.iter().map(|(_, i)| fold(points[*i]).as_dvec3()).sum();
        let point = (sum / group.len() as f64).as_vec3();
        let weight = (group.len() as f32).sqrt().min(MOST_WEIGHT);
        Pull { point, target: 0.0, kind: PullKind::Exact, weight }
    };
    point_by_cell.chunk_by(|a, b| a.0 == b.0).map(pull).collect()
}

/// Median distance of the pulls' points to the surface, metres, approximated by the field's value.
pub(crate) fn median_distance(field: &Field, pulls: &[Pull]) -> f64 {
    let mut distances: Vec<f32> = pulls.iter().map(|p| field.sample(p.point).abs()).collect();
    let middle = distances.len() / 2;
    match distances.len() {
        0 => 0.0,
        _ => f64::from(*distances.select_nth_unstable_by(middle, f32::total_cmp).1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn slab() -> Field {
        // The true flank is at |y| = 0.6, the field's at 0.8.
        Field::carve(DVec3::splat(-1.2), DVec3::splat(1.2), 0.04, |p| 0.8 - p.y.abs())
    }

    fn flank(count: usize) -> Vec<[f32; 3]> {
        let r = |i: usize| (i as f32 * 0.618_034).fract() * 2.0 - 1.0;
        (0..count).map(|i| [r(i), -0.6, r(i / 40 * 7)]).collect()
    }

    #[test]
    fn the_surface_passes_through_the_points_and_strays_are_counted() {
        let mut points = flank(1000);
        points.extend([[0.0, -0.95, 0.0], [50.0, 0.0, 0.0], [1e30, -1e30, 3.0], [f32::MAX; 3]]);
        let mut field = slab();
        let fit = fit_points(&mut field, None, &points, &[]);
        assert_eq!((fit.used, fit.outside), (1000, 4));
        assert!((fit.before_m - 0.2).abs() < 0.01 && fit.after_m < 0.01, "{fit:?}");
        assert!(field.sample(glam::Vec3::new(0.1, 0.6, 0.1)).abs() < 0.02);
    }

    #[test]
    fn ten_million_equal_points_act_as_one() {
        let mut field = slab();
        let fit = fit_points(&mut field, None, &vec![[0.3, -0.6, 0.2]; 10_000_000], &[]);
        assert_eq!(fit.used, 10_000_000);
        assert!(field.values().iter().all(|v| v.is_finite()) && fit.after_m < fit.before_m);
    }

    #[test]
    fn points_far_from_the_vehicle_change_nothing() {
        let mut field = slab();
        let fit = fit_points(&mut field, None, &[[0.0, 9.0, 0.0]], &[]);
        assert_eq!((fit.used, fit.before_m, fit.after_m), (0, 0.0, 0.0));
        assert_eq!(field.values(), slab().values());
    }
}
