//! Levenberg-Marquardt on the seven parameters of a similarity.
//!
//! A step is left-multiplied: a point x of the vehicle frame moves to x + omega x (x - c) + t + sigma (x - c), with c
//! the middle of the scan, so that rotation, translation and scale are nearly independent.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Cholesky, SMatrix, SVector};
use vg_geometry::Similarity;
use vg_geometry::descent::Descent;
use vg_geometry::progress::Watch;

/// Parameters of a step: omega (radians), t (metres), sigma (1).
pub(super) type Numbers = SVector<f64, 7>;

/// Normal equations and the cost that they belong to.
#[derive(Clone)]
pub(super) struct System {
    matrix: SMatrix<f64, 7, 7>,
    right: Numbers,
    /// Sum of the robust losses.
    pub(super) cost: f64,
}

impl System {
    pub(super) fn new() -> Self {
        Self { matrix: SMatrix::zeros(), right: Numbers::zeros(), cost: 0.0 }
    }

    /// Adds a residual, in units of its noise, with its derivatives, under a Huber loss that is linear from `bend` on.
    pub(super) fn add(&mut self, residual: f64, slope: &Numbers, weight: f64, bend: f64) {
        let size = residual.abs();
        let (loss, part) =
            if size <= bend { (0.5 * size * size, 1.0) } else { (bend * (size - 0.5 * bend), bend / size) };
        self.cost += weight * loss;
        self.matrix += (weight * part) * slope * slope.transpose();
        self.right -= (weight * part * residual) * slope;
    }

    /// Adds the constant loss of a missing residual.
    pub(super) fn add_constant(&mut self, loss: f64) {
        self.cost += loss;
    }

    /// Sum of systems, in the given order.
    pub(super) fn sum(systems: impl IntoIterator<Item = Self>) -> Self {
        systems.into_iter().fold(Self::new(), |mut sum, s| {
            sum.matrix += s.matrix;
            sum.right += s.right;
            sum.cost += s.cost;
            sum
        })
    }

    fn step(&self, damping: f64) -> Option<Numbers> {
        let mut matrix = self.matrix;
        for k in 0..7 {
            matrix[(k, k)] = matrix[(k, k)] * (1.0 + damping) + 1e-9;
        }
        let step = Cholesky::new(matrix)?.solve(&self.right);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}

/// Derivatives of a point's coordinate along `direction`, vehicle frame, with respect to the seven parameters.
pub(super) fn slope(point: DVec3, center: DVec3, direction: DVec3) -> Numbers {
    let arm = point - center;
    let turn = arm.cross(direction);
    Numbers::from([turn.x, turn.y, turn.z, direction.x, direction.y, direction.z, arm.dot(direction)])
}

/// The similarity after a step.
pub(super) fn moved(s: &Similarity, center: DVec3, step: &Numbers) -> Similarity {
    let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2])).normalize());
    let grow = step[6].clamp(-0.3, 0.3).exp();
    let translation =
        center + grow * (turn * (s.translation - center)) + DVec3::new(step[3], step[4], step[5]);
    // Renormalise: products of rotations drift.
    let rotation = DMat3::from_quat(DQuat::from_mat3(&(turn * s.rotation)).normalize());
    Similarity { scale: s.scale * grow, rotation, translation }
}

/// The number of steps is the caller's.
const DESCENT: Descent = Descent { steps: 0, trials: 5, stiffen: 10.0, least_damping: 1e-7, enough: 1e-5 };

/// Minimises the cost from `start` in at most `steps` steps; returns the similarity and its cost.
pub(super) fn descend(
    start: Similarity,
    center: DVec3,
    steps: usize,
    watch: &Watch,
    system: impl Fn(&Similarity) -> System,
) -> (Similarity, f64) {
    let at = (start, system(&start));
    let step = |(s, at): &(Similarity, System), _: &(), damping: f64| {
        if watch.is_stopped() {
            return None;
        }
        let next = moved(s, center, &at.step(damping)?);
        Some((next, system(&next)))
    };
    let (best, at) = Descent { steps, ..DESCENT }.run(at, |(_, at)| at.cost, |_| (), step);
    (best, at.cost)
}
