//! The most probable correction: Levenberg-Marquardt on the rays' deficits, with a robust loss that ignores deficits
//! that no small correction can explain.

use super::cones::{Ball, Cones, Meeting};
use super::correction::{CAMERA, Correction, PLANE};
use super::samples::Sample;
use crate::prior::volume::Silhouette;
use glam::Vec3;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use vg_geometry::MIRROR_Y;
use vg_geometry::descent::Descent;
use vg_scene::View;

/// Noise of a deficit, metres: a mask is accurate to about a pixel.
const NOISE_M: f64 = 0.01;

/// The number of independent observations of two views, whatever the number of sampled pixels: errors of neighbours on
/// an edge are correlated. Two cones touch at a tangent plane above and one below, either camera sees both, and the
/// twin of one camera doubles that: 8. Each is a stretch of edge rather than a point.
const OBSERVATIONS_PER_PAIR: f64 = 16.0;

/// The descent at each scale of the loss.
const DESCENT: Descent = Descent { steps: 6, trials: 4, stiffen: 20.0, least_damping: 1e-6, enough: 0.01 };

/// The part of the problem that does not depend on the correction.
pub(super) struct Problem<'a> {
    pub(super) views: &'a [View],
    pub(super) silhouettes: &'a [Silhouette],
    pub(super) trusted: &'a [bool],
    pub(super) ball: Ball,
}

/// Parameters that the solver changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Free {
    /// The plane's parameters.
    Plane,
    /// The parameters of the plane and of all cameras.
    All,
}

/// A correction, where the rays meet the cones with it, and what that costs.
struct Tried {
    correction: Correction,
    meetings: Vec<Meeting>,
    cost: f64,
}

impl Problem<'_> {
    pub(super) fn cones(&self, correction: &Correction) -> Cones<'_> {
        Cones::new(self.silhouettes, self.trusted, self.views, correction, self.ball)
    }

    /// Each ray's meeting with the cones. `before` are the rays' meetings for a slightly different correction, near
    /// which better ones are searched for; without any, the whole rays are searched.
    pub(super) fn meetings(&self, c: &Correction, samples: &[Sample], before: &[Meeting]) -> Vec<Meeting> {
        let cones = self.cones(c);
        let meeting = |(k, sample): (usize, &Sample)| cones.meeting(sample, before.get(k).map(|m| m.t));
        samples.par_iter().enumerate().map(meeting).collect()
    }

    /// Fits the correction to the rays of `samples`, from `start` on, with the `scales` of the loss (metres) one after
    /// another.
    pub(super) fn fit(
        &self,
        start: &Correction,
        samples: &[Sample],
        free: Free,
        scales: &[f64],
    ) -> Correction {
        let mut correction = start.clone();
        for &scale in scales {
            let meetings = self.meetings(&correction, samples, &[]);
            let cost = self.cost(&correction, samples, &meetings, scale);
            let at = Tried { correction, meetings, cost };
            let linearize = |at: &Tried| self.normal_equations(at, samples, free, scale);
            let moved = |at: &Tried, (matrix, right): &(DMatrix<f64>, DVector<f64>), damping: f64| {
                let mut damped = matrix.clone();
                for k in 0..damped.nrows() {
                    damped[(k, k)] *= 1.0 + damping;
                }
                let mut step = Cholesky::new(damped)?.solve(right).as_slice().to_vec();
                step.resize(at.correction.numbers().len(), 0.0);
                let correction = at.correction.moved(&step);
                let meetings = self.meetings(&correction, samples, &at.meetings);
                let cost = self.cost(&correction, samples, &meetings, scale);
                Some(Tried { correction, meetings, cost })
            };
            correction = DESCENT.run(at, |at| at.cost, linearize, moved).correction;
        }
        correction
    }

    /// Weight of each of the samples.
    fn weight(&self, samples: &[Sample]) -> f64 {
        let n = self.views.len() as f64;
        let observations = OBSERVATIONS_PER_PAIR * 0.5 * n * (n - 1.0);
        (observations / samples.len().max(1) as f64).min(1.0) / (NOISE_M * NOISE_M)
    }

    fn cost(&self, correction: &Correction, samples: &[Sample], meetings: &[Meeting], scale: f64) -> f64 {
        let rays: f64 = meetings.iter().map(|m| loss(deficit(m), scale)).sum();
        let pull = correction.numbers().iter().enumerate().map(|(k, n)| Correction::stiffness(k) * n * n);
        self.weight(samples) * rays + pull.sum::<f64>()
    }

    fn normal_equations(
        &self,
        Tried { correction, meetings, .. }: &Tried,
        samples: &[Sample],
        free: Free,
        scale: f64,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let n = match free {
            Free::Plane => PLANE,
            Free::All => correction.numbers().len(),
        };
        let weight = self.weight(samples);
        let mut matrix = DMatrix::zeros(n, n);
        let mut right = DVector::zeros(n);
        for (k, number) in correction.numbers().iter().enumerate().take(n) {
            matrix[(k, k)] = Correction::stiffness(k);
            right[k] = -Correction::stiffness(k) * number;
        }
        let cones = self.cones(correction);
        let middle = correction.moved_middle().as_vec3();
        let rows: Vec<Option<Row>> = samples
            .par_iter()
            .zip(meetings)
            .map(|(sample, m)| (deficit(m) > 0.0).then(|| Row::new(&cones, middle, sample, m, free)))
            .collect();
        // Summed in the samples' order, whatever the number of threads.
        for (row, meeting) in rows.iter().zip(meetings) {
            let Some(row) = row else { continue };
            let missing = deficit(meeting);
            let w = weight * robust_weight(missing, scale);
            for (a, &(i, x)) in row.0.iter().enumerate() {
                right[i] += w * x * missing;
                for &(j, y) in &row.0[..=a] {
                    matrix[(i, j)] += w * x * y;
                    if i != j {
                        matrix[(j, i)] += w * x * y;
                    }
                }
            }
        }
        (matrix, right)
    }
}

/// Distance by which the ray fails to meet all cones, metres; 0 if it meets them.
pub(super) fn deficit(meeting: &Meeting) -> f64 {
    f64::from(-meeting.inside).max(0.0)
}

/// Geman and McClure's loss: a square below `scale`, constant far above.
fn loss(r: f64, scale: f64) -> f64 {
    let r2 = r * r;
    r2 / (1.0 + r2 / (scale * scale))
}

/// Derivative of [`loss`] over 2 r.
fn robust_weight(r: f64, scale: f64) -> f64 {
    (1.0 + r * r / (scale * scale)).powi(-2)
}

/// Derivatives of the value at a ray's meeting: index of the parameter and derivative, each index once.
struct Row(Vec<(usize, f64)>);

impl Row {
    fn new(cones: &Cones, middle: Vec3, sample: &Sample, meeting: &Meeting, free: Free) -> Self {
        let mut row = Self(Vec::with_capacity(PLANE + 3 * CAMERA));
        let (origin, direction) = cones.ray(sample);
        let p = origin + meeting.t * direction;
        for contact in cones.contacts(sample, meeting).into_iter().flatten() {
            let mirror = if contact.mirrored { MIRROR_Y } else { Vec3::ONE };
            // The point moves with its own camera; the cone moves away under it.
            row.push(middle, sample.view, p, contact.gradient, free);
            row.push(middle, contact.view, p * mirror, -contact.gradient * mirror, free);
        }
        row
    }

    /// Adds the derivatives of `gradient` times the motion of `p`, which moves with the camera of `view`.
    fn push(&mut self, middle: Vec3, view: usize, p: Vec3, gradient: Vec3, free: Free) {
        let arm = p - middle;
        self.add(0, arm.cross(gradient).z);
        self.add(1, arm.cross(gradient).x);
        self.add(2, gradient.y);
        if free == Free::Plane {
            return;
        }
        // The rotation of a few degrees between the two frames is negligible for a step.
        let turn = arm.cross(gradient);
        let first = PLANE + CAMERA * view;
        for axis in 0..3 {
            self.add(first + axis, turn[axis]);
            self.add(first + 3 + axis, gradient[axis]);
        }
    }

    fn add(&mut self, index: usize, value: f32) {
        match self.0.iter_mut().find(|(i, _)| *i == index) {
            Some((_, sum)) => *sum += f64::from(value),
            None => self.0.push((index, f64::from(value))),
        }
    }
}
