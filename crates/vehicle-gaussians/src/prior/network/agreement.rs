//! How well a network's cameras and views agree with the caller's, and the scales that make them agree.

use glam::DVec3;
use nalgebra::{DMatrix, DVector, Matrix3};
use serde::Serialize;
use vg_geometry::{Camera, Pose};
use vg_scene::{DepthMap, View};

/// The network's cameras against the caller's, in the frame of the first view.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoseFit {
    /// Common factor from the network's translations to the caller's.
    pub scale: f64,
    /// Degrees between each camera's rotation and the caller's.
    pub rotation_degrees: Vec<f64>,
    /// Metres between each camera's centre and the caller's, after one rotation and scale for all of them.
    pub center_m: Vec<f64>,
}

/// How much the views contradict each other's depth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewFit {
    /// Factor applied to each view's depth.
    pub scales: Vec<f64>,
    /// Median of |ln(depth / depth that another view sees there)| before scaling.
    pub before: f64,
    /// The median after scaling.
    pub after: f64,
}

/// Camera centres closer together than this do not determine a scale, metres.
const BASELINE_M: f64 = 0.01;

/// Fits `predicted` camera poses, in the network's metres, to the `given` ones, both camera-to-reference. Returns
/// `None` if no two cameras are apart. Rotation by orthogonal Procrustes, scale by least squares.
pub(super) fn fit_poses(predicted: &[Pose], given: &[Pose]) -> Option<PoseFit> {
    let centred = |poses: &[Pose]| {
        let mean = poses.iter().map(|p| p.translation).sum::<DVec3>() / poses.len() as f64;
        poses.iter().map(|p| p.translation - mean).collect::<Vec<DVec3>>()
    };
    let (from, to) = (centred(predicted), centred(given));
    let squared = |v: &[DVec3]| v.iter().map(|p| p.length_squared()).sum::<f64>();
    if squared(&to).sqrt() < BASELINE_M || squared(&from) < 1e-12 * squared(&to) {
        return None;
    }
    let matrix = |v: DVec3| nalgebra::Vector3::new(v.x, v.y, v.z);
    let covariance: Matrix3<f64> =
        from.iter().zip(&to).map(|(f, t)| matrix(*t) * matrix(*f).transpose()).sum();
    let svd = covariance.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?);
    // Cameras on a line leave the rotation about it undetermined; it must not become a reflection.
    let sign = (u * v).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign)) * v;
    let turned: Vec<DVec3> = from
        .iter()
        .map(|f| {
            let r = rotation * matrix(*f);
            DVec3::new(r.x, r.y, r.z)
        })
        .collect();
    let scale = to.iter().zip(&turned).map(|(t, f)| t.dot(*f)).sum::<f64>() / squared(&turned);
    let angle = |(p, g): (&Pose, &Pose)| {
        let trace = (p.rotation.transpose() * g.rotation).to_cols_array();
        (0.5 * (trace[0] + trace[4] + trace[8] - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
    };
    Some(PoseFit {
        scale,
        rotation_degrees: predicted.iter().zip(given).map(angle).collect(),
        center_m: to.iter().zip(&turned).map(|(t, f)| (*t - scale * *f).length()).collect(),
    })
}

/// Approximate maximum of pixels per view that are compared with the other views.
const SAMPLES: usize = 4000;

/// Depths that differ by more than this factor belong to different surfaces.
const SAME: f64 = 1.5;

/// Logarithms beyond this are outliers (Huber).
const HUBER: f64 = 0.05;

/// Weight that holds each scale at 1, relative to one pair of pixels.
const HELD: f64 = 1.0;

/// One factor per view that makes the depths agree best where two views see one place; all 1 if that is no
/// improvement. Returns `None` if no two views see the same place.
pub(super) fn fit_views(views: &[View], depths: &[DepthMap]) -> Option<ViewFit> {
    let pairs = pairs(views, depths);
    let n = views.len();
    let typical =
        |b: &DVector<f64>| median(pairs.iter().map(|p| (p.ratio - b[p.from] + b[p.to]).abs()).collect());
    let mut b = DVector::zeros(n);
    let before = typical(&b)?;
    const ROUNDS: usize = 10;
    for _ in 0..ROUNDS {
        let mut normal = DMatrix::identity(n, n) * HELD;
        let mut right = DVector::zeros(n);
        for p in &pairs {
            let residual: f64 = p.ratio - b[p.from] + b[p.to];
            let weight = (HUBER / residual.abs().max(HUBER)).min(1.0);
            normal[(p.from, p.from)] += weight;
            normal[(p.to, p.to)] += weight;
            normal[(p.from, p.to)] -= weight;
            normal[(p.to, p.from)] -= weight;
            right[p.from] += weight * p.ratio;
            right[p.to] -= weight * p.ratio;
        }
        b = normal.cholesky()?.solve(&right);
    }
    let after = typical(&b)?;
    let better = after < before;
    let scales = b.iter().map(|b| if better { b.exp() } else { 1.0 }).collect();
    Some(ViewFit { scales, before, after: if better { after } else { before } })
}

/// Median (the upper one of an even number); `None` for an empty list.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// A surface point of view `from` that view `to` sees too: `ratio` is ln(depth in `to` / projected depth).
struct Pair {
    from: usize,
    to: usize,
    ratio: f64,
}

fn pairs(views: &[View], depths: &[DepthMap]) -> Vec<Pair> {
    let mut out = Vec::new();
    for (i, (view, depth)) in views.iter().zip(depths).enumerate() {
        let seen: Vec<(u32, u32, f32)> = vehicle_pixels(view, depth).collect();
        let every = (seen.len() / SAMPLES).max(1);
        for (j, other) in views.iter().enumerate().filter(|(j, _)| *j != i) {
            // Directly from camera to camera: the origin of the common frame may be kilometres away.
            let to_from = other.camera.vehicle_from_camera.inverse().after(&view.camera.vehicle_from_camera);
            for (u, v, z) in seen.iter().step_by(every) {
                let ray = view.camera.intrinsics.pixel_ray(*u, *v);
                let place = to_from.transform_point(f64::from(*z) * ray);
                if let Some(found) = depth_towards(other, &depths[j], place)
                    && (found / place.z).max(place.z / found) < SAME
                {
                    // Farther in j than projected from i: i is too near, or j too far.
                    out.push(Pair { from: i, to: j, ratio: (found / place.z).ln() });
                }
            }
        }
    }
    out
}

fn vehicle_pixels<'a>(view: &'a View, depth: &'a DepthMap) -> impl Iterator<Item = (u32, u32, f32)> + 'a {
    let pixels = (0..depth.height()).flat_map(|v| (0..depth.width()).map(move |u| (u, v)));
    pixels
        .filter(|(u, v)| view.mask.as_ref().is_none_or(|m| m.is_vehicle(*u, *v)))
        .filter_map(|(u, v)| Some((u, v, depth.get(u, v)?)))
}

/// The vehicle's depth in a view in the direction of `place`, a point in its camera's frame.
fn depth_towards(view: &View, depth: &DepthMap, place: DVec3) -> Option<f64> {
    let camera: &Camera = &view.camera;
    let [u, v] = camera.project(place)?;
    let inside = u >= 0.0 && v >= 0.0 && u < f64::from(camera.width) && v < f64::from(camera.height);
    let (u, v) = (u as u32, v as u32);
    if !inside || view.mask.as_ref().is_some_and(|m| !m.is_vehicle(u, v)) {
        return None;
    }
    depth.get(u, v).map(f64::from)
}
