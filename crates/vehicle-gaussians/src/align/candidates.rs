//! Initial alignments: directions of up, the vehicle's position and size, and all headings.

use super::scan::{Scan, smallest_axis};
use super::silhouettes::{Outline, coarse};
use super::solve::descend;
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;
use rayon::prelude::*;
use vg_geometry::progress::Watch;
use vg_geometry::{Error, Result, Similarity};

/// Headings tried for each up direction: the basin of each is wider than half the step.
const HEADINGS: usize = 8;

/// Maximum of steps on the support functions.
const STEPS: usize = 25;

/// Approximate maximum of views that are compared: neighbouring views are redundant.
const VIEWS: usize = 16;

/// Residuals from which the loss is linear, pixels: large at first, then small enough to ignore outliers.
const BENDS_PX: [f64; 2] = [30.0, 4.0];

/// Rotations closer than this count as the same result, radians.
const SAME_TURN: f64 = 0.3;

/// Coarse alignments of different rotations, best first.
pub(super) fn find(
    outlines: &[Outline],
    scan: &Scan,
    ground: Option<DVec3>,
    watch: &Watch,
) -> Result<Vec<Similarity>> {
    let middle = middle(outlines)?;
    let scale = scale(outlines, scan, middle)?;
    let starts: Vec<Similarity> = ups(outlines, ground)
        .into_iter()
        .flat_map(|up| {
            (0..HEADINGS).map(move |k| {
                let rotation = upright(up, std::f64::consts::TAU * k as f64 / HEADINGS as f64);
                Similarity { scale, rotation, translation: scan.center - scale * (rotation * middle) }
            })
        })
        .collect();
    let outlines: Vec<&Outline> = outlines.iter().step_by(outlines.len().div_ceil(VIEWS)).collect();
    let fit = |start: &Similarity| {
        let fit = |s, bend| descend(s, scan.center, STEPS, watch, |s| coarse(&outlines, scan, s, bend)).0;
        let found = BENDS_PX.into_iter().fold(*start, fit);
        (coarse(&outlines, scan, &found, BENDS_PX[1]).cost, found)
    };
    let mut found: Vec<(f64, Similarity)> = starts.par_iter().map(fit).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut different: Vec<Similarity> = Vec::new();
    for (_, s) in found {
        if different.iter().all(|d| turn_between(d, &s) > SAME_TURN) {
            different.push(s);
        }
    }
    Ok(different)
}

/// Angle between two rotations.
fn turn_between(a: &Similarity, b: &Similarity) -> f64 {
    let r = a.rotation.transpose() * b.rotation;
    (0.5 * (r.x_axis.x + r.y_axis.y + r.z_axis.z - 1.0)).clamp(-1.0, 1.0).acos()
}

/// The alignment with front and back exchanged, about the middle of the scan.
pub(super) fn turned(s: &Similarity, center: DVec3) -> Similarity {
    let half = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
    Similarity { rotation: half * s.rotation, translation: center + half * (s.translation - center), ..*s }
}

/// The point nearest to all rays through the masks' middles, world.
pub(super) fn middle(outlines: &[Outline]) -> Result<DVec3> {
    let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (origin, d) in outlines.iter().filter_map(Outline::central_ray) {
        let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        normal += across;
        right += across * origin;
    }
    let middle = normal.inverse() * right;
    // Parallel rays have no common point.
    let views = outlines.len() as f64;
    if !middle.is_finite() || normal.determinant() < 1e-6 * views.powi(3) {
        return Err(Error::Reconstruction {
            stage: "align",
            reason: "the views do not look at a common place; check the poses and the masks".into(),
        });
    }
    Ok(middle)
}

/// Metres per unit of the world, from the size of the masks and the size that the scan would have in their place.
fn scale(outlines: &[Outline], scan: &Scan, middle: DVec3) -> Result<f64> {
    // The mean width of a convex body over all directions follows from the mean distance of its corners.
    let spread =
        scan.corners.iter().map(|p| (*p - scan.center).length()).sum::<f64>() / scan.corners.len() as f64;
    let radii: Vec<f64> = outlines
        .iter()
        .filter_map(|o| Some(o.angular_radius()? * o.pose().translation.distance(middle)))
        .collect();
    let scale = 0.75 * spread / super::scan::median(&radii);
    if !(scale.is_finite() && scale > 0.0) {
        return Err(Error::Reconstruction {
            stage: "align",
            reason: "no mask lies entirely inside its picture, so the vehicle's size cannot be determined"
                .into(),
        });
    }
    Ok(scale)
}

/// Up directions to try, world: the ground's normal, up in level pictures, and the normal of the cameras' plane.
fn ups(outlines: &[Outline], ground: Option<DVec3>) -> Vec<DVec3> {
    let mut ups: Vec<DVec3> = Vec::new();
    let mut offer = |up: DVec3| {
        if up.is_finite() && ups.iter().all(|u| u.dot(up) < 0.97) {
            ups.push(up);
        }
    };
    ground.into_iter().for_each(&mut offer);
    offer(up_from_pictures(outlines));
    if outlines.len() >= 3 {
        let centers: Vec<DVec3> = outlines.iter().map(|o| o.pose().translation).collect();
        let normal = super::scan::plane_of(&centers).1;
        offer(normal);
        offer(-normal);
    }
    ups
}

/// Up direction if the pictures are level: their x axes lie in the ground's plane and their y axes point down.
pub(super) fn up_from_pictures(outlines: &[Outline]) -> DVec3 {
    let mut matrix = Matrix3::zeros();
    let mut down = DVec3::ZERO;
    for outline in outlines {
        let (x, y) = (outline.pose().rotation.x_axis, outline.pose().rotation.y_axis);
        // Views from one side alone have parallel x axes; their y axes decide.
        matrix += Matrix3::from_fn(|r, c| x[r] * x[c] - 0.05 * y[r] * y[c]);
        down += y;
    }
    let up = smallest_axis(matrix);
    if up.dot(down) > 0.0 { -up } else { up }
}

/// Rotation that takes `up` to z, followed by a turn by `heading` about z.
pub(super) fn upright(up: DVec3, heading: f64) -> DMat3 {
    let x = up.any_orthonormal_vector();
    DMat3::from_rotation_z(heading) * DMat3::from_cols(x, up.cross(x), up).transpose()
}
