//! The box the vehicle stands in, from its silhouettes alone.

use super::field::Field;
use super::silhouette::{Silhouette, central_ray};
use crate::prior::{BoxSource, WorkingBox};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use vg_geometry::{Error, MIRROR_Y, Result};
use vg_scene::View;

/// Size of the largest road vehicles, metres (length of an articulated bus, width and height of a lorry
/// with its mirrors); an axis that the silhouettes do not bound ends here or at the proportions below.
const LARGEST_M: DVec3 = DVec3::new(19.0, 3.0, 4.5);

/// Largest width over length of a vehicle (a city car), unless it is short.
const WIDTH_OVER_LENGTH: f64 = 0.46;

/// Width that any vehicle may have, metres.
const NARROWEST_LIMIT_M: f64 = 1.7;

/// Grid points along the longest axis of the search.
const SEARCH_POINTS: f64 = 72.0;

/// Upper bound on how far outer mirrors protrude from the body, metres.
pub(crate) const MIRROR_M: f64 = 0.12;

/// Beyond this distance outside, the exact value does not matter, metres.
const FAR_OUTSIDE_M: f32 = -1.0;

/// Box that the silhouettes leave for the vehicle, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Lowest corner.
    pub low: DVec3,
    /// Highest corner.
    pub high: DVec3,
}

impl Extent {
    /// The working box of a vehicle if only its silhouettes are known.
    ///
    /// # Errors
    /// [`Error::Reconstruction`] if no road vehicle is so large.
    pub fn estimated_box(&self) -> Result<WorkingBox> {
        let size = self.high - self.low;
        if size.cmpgt(LARGEST_M * 1.2).any() {
            return Err(Error::Reconstruction {
                stage: "prior",
                reason: format!(
                    "the silhouettes bound a box of {:.1} x {:.1} x {:.1} m, larger than any road vehicle; check \
                     that poses are metric and in the vehicle frame, or pass the vehicle's size",
                    size.x, size.y, size.z
                ),
            });
        }
        Ok(WorkingBox {
            low: self.low.to_array(),
            high: self.high.to_array(),
            source: BoxSource::Estimated,
            contradicted_m: 0.0,
        })
    }
}

/// Bounds the vehicle by repeated coarse carving, each time in the box that the last pass left, starting from a cube
/// around the point the views look at. The width is limited to the known size, or else to the proportions of road
/// vehicles and to the width at the wheels.
///
/// # Errors
/// [`Error::Reconstruction`] if the silhouettes do not intersect.
pub fn extent(
    views: &[View],
    known_size: Option<[f64; 3]>,
    inside: impl Fn(Vec3) -> f32 + Sync,
) -> Result<Extent> {
    let center = meeting_point(views);
    let radius = search_radius(views, center)?;
    // Views from one end see the length foreshortened, and their meeting point is near that end.
    let radius = known_size.map_or(radius, |[length, ..]| radius.max(length));
    let y = known_size.map_or(radius.min(0.5 * LARGEST_M.y), |[_, width, _]| 0.5 * width);
    let mut low = DVec3::new(center.x - radius, -y, center.z - radius);
    let mut high = DVec3::new(center.x + radius, y, center.z + radius);
    for _ in 0..3 {
        let voxel = ((high - low).max_element() / SEARCH_POINTS).max(0.02);
        let field = Field::carve(low, high, voxel, &inside);
        // A grid point may miss a sliver of hull that is thinner than the spacing.
        let Some(bounds) = field.bounds_above(-0.5 * voxel as f32) else {
            return Err(Error::Reconstruction {
                stage: "prior",
                reason:
                    "the silhouettes and their mirror images do not intersect; check the poses (camera to \
                         vehicle, x forward, y left, z up, symmetry plane y = 0) and the masks"
                        .into(),
            });
        };
        let margin = DVec3::splat(voxel);
        low = (bounds.0 - margin).max(low);
        high = (bounds.1 + margin).min(high);
        if known_size.is_some() {
            continue;
        }
        let length = high.x - low.x;
        let half_width = (0.5 * WIDTH_OVER_LENGTH * length).max(0.5 * NARROWEST_LIMIT_M);
        (low.y, high.y) = (low.y.max(-half_width), high.y.min(half_width));
    }
    if known_size.is_none()
        && let Some(half_width) = half_width_at_the_wheels(low, high, &inside)
    {
        (low.y, high.y) = (low.y.max(-half_width), high.y.min(half_width));
    }
    Ok(Extent { low, high })
}

/// Half the width where the vehicle stands on the ground, or `None` if no wheels are found.
///
/// A few silhouettes at one height bound the flanks loosely (the hull bulges by decimetres) but the tyres
/// tightly: cameras above the ground see the gap below the sills, so near the ground the hull ends a few
/// centimetres outside the outer faces of the wheels. Bodies are flush with their wheels to a few centimetres;
/// only mirrors protrude.
fn half_width_at_the_wheels(low: DVec3, high: DVec3, inside: impl Fn(Vec3) -> f32 + Sync) -> Option<f64> {
    const SLICE_M: f64 = 0.02;
    const STEP_M: f64 = 0.03;
    /// Minimum height of a wheel, metres; a bulge of the hull below the ground is lower.
    const WHEEL_M: f64 = 0.16;
    let slices = ((0.6 * (high.z - low.z)).min(0.8) / SLICE_M) as usize;
    let columns = ((high.x - low.x) / STEP_M) as usize;
    let rows = (high.y / STEP_M) as usize;
    let half_width = |slice: usize| {
        let z = low.z + slice as f64 * SLICE_M;
        let occupied = |y: f64| {
            (0..=columns).any(|i| {
                let x = low.x + i as f64 * STEP_M;
                let p = DVec3::new(x, y, z).as_vec3();
                inside(p) > 0.0 && inside(p * MIRROR_Y) > 0.0
            })
        };
        (0..=rows).rev().map(|j| j as f64 * STEP_M).find(|&y| occupied(y)).unwrap_or(0.0)
    };
    let widths: Vec<f64> = (0..slices).into_par_iter().map(half_width).collect();
    let above = (WHEEL_M / SLICE_M) as usize;
    let ground = (0..slices.saturating_sub(above))
        .find(|&k| widths[k] > 0.4 && widths[k] > 0.85 * widths[k + above])?;
    Some(widths[ground + 2] + 0.5 * STEP_M)
}

/// Approximate middle and radius of the vehicle, metres, from the directions of the views; `None` if they do not look
/// at a common place.
pub fn whereabouts(views: &[View]) -> Option<(DVec3, f64)> {
    let center = meeting_point(views);
    search_radius(views, center).ok().map(|radius| (center, radius))
}

/// The point nearest to all central rays and their mirror images; it lies on y = 0. Views that all look along
/// x do not determine the distance: a weak pull to the origin of the vehicle frame does.
fn meeting_point(views: &[View]) -> DVec3 {
    const PULL: f64 = 1e-3;
    let mut normal = DMat3::from_diagonal(DVec3::splat(PULL));
    let mut right = DVec3::ZERO;
    for view in views {
        let Some(bounds) = view.mask.as_ref().and_then(vg_scene::Mask::bounds) else { continue };
        let (origin, direction) = central_ray(&view.camera, bounds);
        for side in [1.0, -1.0] {
            let flip = DVec3::new(1.0, side, 1.0);
            let (o, d) = (origin * flip, direction * flip);
            let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
            normal += across;
            right += across * o;
        }
    }
    let point = normal.inverse() * right;
    DVec3::new(point.x, 0.0, point.z)
}

/// Largest distance of the vehicle from the meeting point, metres.
fn search_radius(views: &[View], center: DVec3) -> Result<f64> {
    let mut radius: f64 = 0.0;
    for view in views {
        let Some([u0, v0, u1, v1]) = view.mask.as_ref().and_then(vg_scene::Mask::bounds) else {
            continue;
        };
        let i = view.camera.intrinsics;
        let across = (f64::from(u1 - u0 + 1) / i.fx).hypot(f64::from(v1 - v0 + 1) / i.fy);
        let distance = (center - view.camera.center()).length();
        let cut = u0 == 0 || v0 == 0 || u1 + 1 == view.camera.width || v1 + 1 == view.camera.height;
        // Half the diagonal, a little more because the near end looks larger; a cut silhouette hides the rest.
        radius = radius.max(distance * across * if cut { 1.2 } else { 0.65 });
    }
    if !(radius.is_finite() && radius > 0.0 && center.is_finite()) {
        return Err(Error::Reconstruction {
            stage: "prior",
            reason: "the views do not look at a common place near the plane y = 0".into(),
        });
    }
    Ok(radius.clamp(1.0, LARGEST_M.x))
}

/// Distance of `p` inside the box, metres, negative outside.
pub fn inside_box(working_box: &WorkingBox, p: Vec3) -> f32 {
    let p = p.to_array();
    (0..3)
        .map(|k| (p[k] - working_box.low[k] as f32).min(working_box.high[k] as f32 - p[k]))
        .fold(f32::INFINITY, f32::min)
}

/// Distance of `p` inside a box that the caller gave, metres, negative outside; infinite for an estimated box, which
/// adds nothing to the silhouettes. The box is widened for mirrors, since given widths may exclude them.
pub fn inside_known(working_box: &WorkingBox, p: Vec3) -> f32 {
    match working_box.source {
        BoxSource::Estimated => f32::INFINITY,
        BoxSource::Given => {
            let mut wide = *working_box;
            (wide.low[1], wide.high[1]) = (wide.low[1] - MIRROR_M, wide.high[1] + MIRROR_M);
            inside_box(&wide, p)
        }
    }
}

/// Distance of `p` inside the cones of all silhouettes, metres, negative outside; below -1 m any value below -1 m.
pub fn inside_all(silhouettes: &[Silhouette], p: Vec3) -> f32 {
    let mut least = f32::INFINITY;
    for silhouette in silhouettes {
        least = least.min(silhouette.inside(p));
        if least < FAR_OUTSIDE_M {
            break;
        }
    }
    least
}

/// Distance of `p` inside the cones of all silhouettes and of their mirrored twins, see [`inside_all`].
pub fn inside_both(silhouettes: &[Silhouette], p: Vec3) -> f32 {
    let here = inside_all(silhouettes, p);
    if here < FAR_OUTSIDE_M {
        return here;
    }
    here.min(inside_all(silhouettes, p * MIRROR_Y))
}
