//! What the calibration did.

use serde::Serialize;
use std::fmt;
use vg_geometry::choices;

choices! {
    /// What became of the correction of the cameras.
    pub enum Verdict as "calibration" {
        /// The silhouettes agree already.
        NotNeeded = 1 "not-needed",
        /// The cameras were moved.
        Accepted = 2 "accepted",
        /// A correction was estimated and thrown away.
        Refused = 3 "refused",
    }
}

/// A number that stopped at the largest error that is believed of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bound {
    Yaw,
    Roll,
    Lateral,
    ViewRotation,
    ViewTranslation,
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Yaw => "the plane's yaw reached 5 degrees",
            Self::Roll => "the plane's roll reached 2 degrees",
            Self::Lateral => "the plane's offset reached 0.2 m",
            Self::ViewRotation => "a camera's rotation reached 1.5 degrees",
            Self::ViewTranslation => "a camera's translation reached 0.15 m",
        })
    }
}

/// How a view's camera was moved about the vehicle's middle, beside the plane's motion, which all share.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewCalibration {
    /// The view's name.
    pub name: String,
    /// How far the picture of the vehicle's middle moved, pixels of the undistorted view.
    pub pixels: f64,
    /// Rotation, degrees.
    pub degrees: f64,
    /// Translation of the vehicle's middle, metres.
    pub metres: f64,
    /// The corrected camera in the caller's vehicle frame, row-major `[R | t]`: where the model lines up with it.
    pub vehicle_from_camera: [f64; 12],
    /// Whether its silhouette was left out of the estimate and carves nothing: without it the others agree (an
    /// occluder cut it).
    pub ignored: bool,
}

/// What the calibration found. Numbers are zero where nothing was moved ([`Verdict::NotNeeded`]); of a refused
/// correction they tell what was refused.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// What became of the correction.
    pub verdict: Verdict,
    /// Why, in words.
    pub why: String,
    /// Rotation about z that brings the true plane of symmetry onto y = 0, degrees.
    pub yaw_degrees: f64,
    /// Rotation about x that does, degrees.
    pub roll_degrees: f64,
    /// Shift along y, at the vehicle's middle, that does, metres.
    pub lateral_m: f64,
    /// corrected_from_vehicle: the plane's whole motion, row-major `[R | t]`.
    pub corrected_from_vehicle: [f64; 12],
    /// How each used view's camera was moved.
    pub views: Vec<ViewCalibration>,
    /// Part of the masks' pixels whose rays meet the hull of all other views and of all mirrored ones, before.
    pub coverage_before: f64,
    /// The same with the correction.
    pub coverage_after: f64,
    /// Mean of what rays on the silhouettes' edges miss the hull by, before, pixels; each at most 20.
    pub edge_error_before_px: f64,
    /// The same with the correction.
    pub edge_error_after_px: f64,
    /// The same of those rays only that the correction was not fitted to, before; `None` where nothing was fitted.
    pub held_out_before_px: Option<f64>,
    /// The same with the correction.
    pub held_out_after_px: Option<f64>,
}
