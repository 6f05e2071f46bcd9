//! Report of the calibration.

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

/// A parameter that reached the largest error that is corrected.
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

/// Motion of a view's camera about the vehicle's middle, in addition to the plane's motion, which all views share.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewCalibration {
    /// The view's name.
    pub name: String,
    /// Motion of the image of the vehicle's middle, pixels of the undistorted view.
    pub pixels: f64,
    /// Rotation, degrees.
    pub degrees: f64,
    /// Translation of the vehicle's middle, metres.
    pub metres: f64,
    /// The corrected camera in the caller's vehicle frame, row-major `[R | t]`: from it, the model lines up with the
    /// view.
    pub vehicle_from_camera: [f64; 12],
    /// Whether its silhouette was left out of the estimate and carves nothing, because the others agree without it (an
    /// occluder cut it).
    pub ignored: bool,
}

/// Result of the calibration. Numbers are zero if nothing was estimated ([`Verdict::NotNeeded`]); for a refused
/// correction they describe what was refused.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Outcome.
    pub verdict: Verdict,
    /// Reason for the outcome, in words.
    pub why: String,
    /// Rotation about z that brings the true plane of symmetry onto y = 0, degrees.
    pub yaw_degrees: f64,
    /// Rotation about x that brings the true plane onto y = 0, degrees.
    pub roll_degrees: f64,
    /// Shift along y, at the vehicle's middle, that brings the true plane onto y = 0, metres.
    pub lateral_m: f64,
    /// The plane's whole motion corrected_from_vehicle, row-major `[R | t]`.
    pub corrected_from_vehicle: [f64; 12],
    /// Motion of each used view's camera.
    pub views: Vec<ViewCalibration>,
    /// Part of the masks' pixels whose rays meet the hull of all other views and of all mirrored ones, without the
    /// correction.
    pub coverage_before: f64,
    /// Coverage with the correction.
    pub coverage_after: f64,
    /// Mean distance by which rays on the silhouettes' edges miss the hull, without the correction, pixels; each is
    /// clipped to 20.
    pub edge_error_before_px: f64,
    /// Edge error with the correction, pixels.
    pub edge_error_after_px: f64,
    /// Edge error, without the correction, of the rays that it was not fitted to, pixels; `None` if nothing was fitted.
    pub held_out_before_px: Option<f64>,
    /// Edge error, with the correction, of the rays that it was not fitted to, pixels.
    pub held_out_after_px: Option<f64>,
}
