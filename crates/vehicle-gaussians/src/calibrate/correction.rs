//! The estimated parameters, and the motion of the cameras that they describe.
//!
//! corrected_from_camera = plane o own o vehicle_from_camera. `plane` is one rigid motion of everything that puts the
//! true plane of symmetry on y = 0; `own` is a small motion of each camera about the vehicle's middle, in the
//! vehicle's axes: the tracked box's error as seen by that camera. A common shift along x or z and a common
//! pitch leave the plane where it is and cannot be determined from the silhouettes. They are not parameters of the
//! plane, and since all cameras are pulled towards zero alike, their own motions sum to zero along those three.
//! So the model stays where the caller's cameras, on average, see the vehicle.

use super::report::Bound;
use glam::{DMat3, DQuat, DVec3};
use vg_geometry::Pose;

/// The number of parameters of the plane: yaw, roll, lateral offset.
pub(super) const PLANE: usize = 3;

/// The number of parameters of a camera: rotation about the axes through the vehicle's middle, translation along them.
pub(super) const CAMERA: usize = 6;

/// Prior standard deviation of a tracked box's plane: yaw and roll in radians, offset in metres. A box
/// stands on the same road as the wheels, so it rolls far less than it yaws.
const PLANE_SIGMA: [f64; PLANE] = [0.035, 0.005, 0.06];

/// Prior standard deviation of single cameras against the box: rotation in radians (0.3 degrees), translation in
/// metres.
const CAMERA_SIGMA: [f64; CAMERA] = [0.005, 0.005, 0.005, 0.03, 0.03, 0.03];

/// Largest error of a detector: 5 and 2 degrees, metres. A larger one means another vehicle frame or a broken pose,
/// which silhouettes alone must not decide about.
const PLANE_LIMIT: [f64; PLANE] = [0.0873, 0.0349, 0.2];

/// Largest error of a camera: 1.5 degrees, about 13 pixels of a picture that is 50 degrees and 512 pixels wide; metres.
const CAMERA_LIMIT: [f64; CAMERA] = [0.0262, 0.0262, 0.0262, 0.15, 0.15, 0.15];

/// A correction of the plane and of all cameras.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Correction {
    /// `[3 + 6 views]`: the plane, then each camera.
    numbers: Vec<f64>,
    /// Centre of rotation, vehicle frame: near the vehicle's middle, so that yaw and offset do not mix.
    middle: DVec3,
}

impl Correction {
    /// The correction that moves nothing.
    pub(super) fn none(views: usize, middle: DVec3) -> Self {
        Self { numbers: vec![0.0; PLANE + CAMERA * views], middle }
    }

    /// Whether nothing is moved.
    pub(super) fn is_none(&self) -> bool {
        self.numbers.iter().all(|n| *n == 0.0)
    }

    /// All parameters. `[3 + 6 views]`
    pub(super) fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// This correction plus a step of the solver, kept within the limits.
    pub(super) fn moved(&self, step: &[f64]) -> Self {
        let numbers = self.numbers.iter().zip(step).enumerate();
        let numbers = numbers.map(|(k, (n, s))| (n + s).clamp(-limit(k), limit(k))).collect();
        Self { numbers, middle: self.middle }
    }

    /// Inverse prior variance of parameter `k`.
    pub(super) fn stiffness(k: usize) -> f64 {
        let sigma = if k < PLANE { PLANE_SIGMA[k] } else { CAMERA_SIGMA[(k - PLANE) % CAMERA] };
        (sigma * sigma).recip()
    }

    /// The plane's yaw and roll in radians, offset in metres.
    pub(super) fn plane_numbers(&self) -> [f64; PLANE] {
        [self.numbers[0], self.numbers[1], self.numbers[2]]
    }

    /// A camera's rotation in radians and translation in metres, vehicle axes.
    pub(super) fn camera_numbers(&self, view: usize) -> (DVec3, DVec3) {
        let n = &self.numbers[PLANE + CAMERA * view..][..CAMERA];
        (DVec3::new(n[0], n[1], n[2]), DVec3::new(n[3], n[4], n[5]))
    }

    /// The centre of rotation after the plane's motion.
    pub(super) fn moved_middle(&self) -> DVec3 {
        self.middle + DVec3::new(0.0, self.numbers[2], 0.0)
    }

    /// Motion corrected_from_vehicle that puts the true plane on y = 0.
    pub(super) fn plane(&self) -> Pose {
        let rotation = DMat3::from_rotation_z(self.numbers[0]) * DMat3::from_rotation_x(self.numbers[1]);
        Pose { rotation, translation: self.moved_middle() - rotation * self.middle }
    }

    /// A camera's own motion.
    pub(super) fn own(&self, view: usize) -> Pose {
        let (rotation, translation) = self.camera_numbers(view);
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(rotation));
        Pose { rotation, translation: self.middle + translation - rotation * self.middle }
    }

    /// The corrected pose of a camera in the frame whose y = 0 is the plane of symmetry.
    pub(super) fn apply(&self, view: usize, vehicle_from_camera: &Pose) -> Pose {
        self.plane().after(&self.own(view).after(vehicle_from_camera))
    }

    /// The first parameter that is at its limit.
    pub(super) fn at_limit(&self) -> Option<Bound> {
        let k = (0..self.numbers.len()).find(|&k| self.numbers[k].abs() >= 0.999 * limit(k))?;
        Some(match k {
            0 => Bound::Yaw,
            1 => Bound::Roll,
            2 => Bound::Lateral,
            k if (k - PLANE) % CAMERA < 3 => Bound::ViewRotation,
            _ => Bound::ViewTranslation,
        })
    }
}

fn limit(k: usize) -> f64 {
    if k < PLANE { PLANE_LIMIT[k] } else { CAMERA_LIMIT[(k - PLANE) % CAMERA] }
}
