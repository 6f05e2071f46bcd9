//! Agreement of a ray with all cones: the maximum, along the ray, of the smallest distance inside them.
//!
//! The ray of a pixel on a silhouette's edge touches the vehicle, and the vehicle is inside every cone: somewhere on
//! the ray all other cones, mirrored ones too, have a value of at least 0 (silhouette coherence, Hernandez, Schmitt
//! and Cipolla 2007, with the mirrored cameras as further cameras). The amount by which the maximum is below 0 is the
//! ray's deficit.

use super::correction::Correction;
use super::samples::Sample;
use crate::prior::volume::Silhouette;
use glam::{DVec3, Mat3, Vec3};
use vg_geometry::{MIRROR_Y, Pose};
use vg_scene::View;

/// Maximum slope of a cone's value along a ray, metres per metre: 1 across a pixel's own ray, more off the
/// optical axis and where the ray runs towards the camera.
const STEEPEST: f32 = 1.5;

/// Resolution of the search along a ray, metres; the best place is then refined between its neighbours.
const STEP_M: f32 = 0.03;

/// Largest move of a meeting along its ray in one step of the solver, metres.
const NEARBY_M: f32 = 0.3;

/// Step of the central difference for the slope of a cone, metres: about a pixel, to smooth out the kinks of the
/// distance transform.
const SLOPE_STEP_M: f32 = 0.01;

/// All views' cones with corrected cameras.
pub(super) struct Cones<'a> {
    silhouettes: &'a [Silhouette],
    /// Whether a cone carves at all. `[views]`
    trusted: &'a [bool],
    /// `[views]`
    camera_from_vehicle: Vec<(Mat3, Vec3)>,
    /// `[views]`
    vehicle_from_camera: Vec<(Mat3, Vec3)>,
    /// Centre of the ball around the vehicle, within which rays are searched.
    middle: Vec3,
    /// Radius of the ball.
    radius: f32,
}

/// Ball around the vehicle, vehicle frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// Centre, metres.
    pub(super) middle: DVec3,
    /// Radius, metres.
    pub(super) radius: f64,
}

/// The point of a ray that is deepest inside all cones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting {
    /// Distance along the ray, metres.
    pub(super) t: f32,
    /// Distance inside all cones beyond the sample's margin, metres; the search stops at the first value above 0.
    pub(super) inside: f32,
}

/// A cone that limits a ray's value, and the gradient of the value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Index of the view.
    pub(super) view: usize,
    /// Whether it is the view's mirrored twin.
    pub(super) mirrored: bool,
    /// Gradient in the vehicle frame times the share of this cone in the value.
    pub(super) gradient: Vec3,
}

impl<'a> Cones<'a> {
    pub(super) fn new(
        silhouettes: &'a [Silhouette],
        trusted: &'a [bool],
        views: &[View],
        correction: &Correction,
        ball: Ball,
    ) -> Self {
        let poses: Vec<Pose> = views
            .iter()
            .enumerate()
            .map(|(i, v)| correction.apply(i, &v.camera.vehicle_from_camera))
            .collect();
        let single = |pose: &Pose| (pose.rotation.as_mat3(), pose.translation.as_vec3());
        Self {
            silhouettes,
            trusted,
            camera_from_vehicle: poses.iter().map(|p| single(&p.inverse())).collect(),
            vehicle_from_camera: poses.iter().map(single).collect(),
            middle: ball.middle.as_vec3(),
            radius: ball.radius as f32,
        }
    }

    /// Origin and unit direction of a sample's ray, vehicle frame.
    pub(super) fn ray(&self, sample: &Sample) -> (Vec3, Vec3) {
        let (rotation, center) = self.vehicle_from_camera[sample.view];
        (center, rotation * sample.direction)
    }

    fn one(&self, view: usize, mirrored: bool, p: Vec3) -> f32 {
        let (rotation, translation) = self.camera_from_vehicle[view];
        let p = if mirrored { p * MIRROR_Y } else { p };
        self.silhouettes[view].inside_camera(rotation * p + translation)
    }

    /// All trusted cones except the ray's own, on whose edge it lies.
    fn others(&self, own: usize) -> impl Iterator<Item = (usize, bool)> + '_ {
        let n = self.silhouettes.len();
        (0..2 * n)
            .map(move |k| (k % n, k >= n))
            .filter(move |&(view, mirrored)| self.trusted[view] && (mirrored || view != own))
    }

    /// The smallest value of all cones; stops early with a value below `enough`.
    fn smallest(&self, own: usize, p: Vec3, enough: f32) -> f32 {
        let mut smallest = f32::INFINITY;
        for (view, mirrored) in self.others(own) {
            smallest = smallest.min(self.one(view, mirrored, p));
            if smallest < enough {
                break;
            }
        }
        smallest
    }

    /// The point of the ray of `sample` that is deepest inside all other cones. Searches near `guess`, the result
    /// before the cones were moved slightly, or else the whole ray.
    pub(super) fn meeting(&self, sample: &Sample, guess: Option<f32>) -> Meeting {
        let (origin, direction) = self.ray(sample);
        let along = (self.middle - origin).dot(direction);
        let (mut start, mut end) = ((along - self.radius).max(0.05), along + self.radius);
        let mut best = Meeting { t: along.max(start), inside: f32::NEG_INFINITY };
        if let Some(guess) = guess {
            (start, end) = ((guess - NEARBY_M).max(start), (guess + NEARBY_M).min(end));
            best.t = guess;
        }
        let value = |t: f32, enough: f32| {
            self.smallest(sample.view, origin + t * direction, enough + sample.margin) - sample.margin
        };
        best.inside = value(best.t, f32::NEG_INFINITY);
        let mut t = start;
        while t <= end && best.inside < 0.0 {
            let inside = value(t, best.inside - STEEPEST * STEP_M);
            if inside > best.inside {
                best = Meeting { t, inside };
            }
            // No better place is nearer than this.
            t += ((best.inside - inside) / STEEPEST).max(STEP_M);
        }
        // Refine between the neighbours by halving the step.
        let mut reach = 0.5 * STEP_M;
        while best.inside < 0.0 && reach > 5e-4 {
            for t in [best.t - reach, best.t + reach] {
                let inside = value(t, best.inside);
                if inside > best.inside {
                    best = Meeting { t, inside };
                }
            }
            reach *= 0.5;
        }
        best
    }

    /// The cones that limit the value at a meeting: the lowest, and the one that rises where the first falls.
    /// At the maximum of a minimum, a mixture of both gradients has no slope along the ray.
    pub(super) fn contacts(&self, sample: &Sample, at: &Meeting) -> [Option<Contact>; 2] {
        let (origin, direction) = self.ray(sample);
        let p = origin + at.t * direction;
        // A cone may be the other one if it is higher by no more than this, the error of the search.
        let near = at.inside + sample.margin + STEEPEST * STEP_M;
        let lowest = self
            .others(sample.view)
            .map(|cone| (self.one(cone.0, cone.1, p), cone))
            .filter(|(value, _)| *value <= near);
        let mut candidates: Vec<(f32, (usize, bool))> = lowest.collect();
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(&(_, first)) = candidates.first() else { return [None, None] };
        let contact =
            |cone: (usize, bool), gradient: Vec3| Some(Contact { view: cone.0, mirrored: cone.1, gradient });
        let gradient = self.gradient(first, p);
        let slope = gradient.dot(direction);
        /// Slope below which the point is stationary.
        const FLAT: f32 = 0.05;
        if slope.abs() < FLAT {
            return [contact(first, gradient), None];
        }
        for &(_, second) in &candidates[1..] {
            let other = self.gradient(second, p);
            let other_slope = other.dot(direction);
            if other_slope * slope < 0.0 {
                let share = other_slope / (other_slope - slope);
                return [contact(first, share * gradient), contact(second, (1.0 - share) * other)];
            }
        }
        [contact(first, gradient), None]
    }

    fn gradient(&self, (view, mirrored): (usize, bool), p: Vec3) -> Vec3 {
        let slope = |axis: Vec3| {
            let at = |s: f32| self.one(view, mirrored, p + s * axis);
            let slope = (at(SLOPE_STEP_M) - at(-SLOPE_STEP_M)) / (2.0 * SLOPE_STEP_M);
            // At a border that cuts the silhouette the cone ends and gives no slope.
            if slope.is_finite() { slope } else { 0.0 }
        };
        Vec3::new(slope(Vec3::X), slope(Vec3::Y), slope(Vec3::Z))
    }
}
