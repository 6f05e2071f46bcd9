//! The verdict: whether a reconstruction can be trusted, and if not, why. Evidence -> rules -> verdict with reasons.
//!
//! The verdict does not change the model. The source of the thresholds is in docs/VERDICT.md.

mod coherence;
mod evidence;
mod photographs;
mod rules;

pub use evidence::{Evidence, ViewEvidence};
pub(super) use evidence::{Examined, compare, glance};
pub(super) use rules::{Judged, judge};

use serde::Serialize;
use std::fmt;
use vg_geometry::choices;

choices! {
    /// Whether a reconstruction is to be believed.
    #[derive(Default, PartialOrd, Ord)]
    pub enum Verdict as "verdict" {
        /// Nothing looks wrong.
        #[default]
        Good = 0 "good",
        /// Nothing looks wrong, but [`Options::check`](super::Options::check) was `false`: views were not compared with
        /// one another.
        Unchecked = 1 "unchecked",
        /// Something looks wrong; the model may still be of use.
        Doubtful = 2 "doubtful",
        /// The input contradicts itself, or describes no road vehicle.
        Bad = 3 "bad",
    }
}

/// The subject of a reason. Reports contain the names of the variants in kebab-case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ReasonCode {
    /// The vehicle is larger than any road vehicle.
    TooLarge,
    /// The vehicle is smaller than any road vehicle.
    TooSmall,
    /// The vehicle is wider or taller than vehicles of its length.
    Proportions,
    /// The cameras are far away from the vehicle, or the vehicle from the origin.
    FarAway,
    /// Vehicle and background seem to be swapped in a mask.
    MaskInverted,
    /// A lens model has no ray for some of the vehicle's pixels.
    Lens,
    /// One view contradicts the others.
    ViewDisagrees,
    /// The views contradict each other, and leaving one out does not help.
    ViewsDisagree,
    /// The views agree with one another, but not with their mirror images.
    Symmetry,
    /// The depth has another unit than the poses.
    DepthUnit,
    /// The depth lies outside the other views' silhouettes.
    DepthOutside,
    /// The photographs do not show the same things in the same places.
    Photographs,
    /// The model's silhouette in a view differs from the mask.
    Silhouette,
    /// The model's picture in a view differs from the photograph.
    Picture,
    /// A correction of the cameras was estimated and rejected.
    CalibrationRefused,
    /// The cameras were corrected by more than a few pixels.
    CamerasCorrected,
}

/// The severity of a reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The verdict is [`Verdict::Doubtful`] at least.
    Doubtful,
    /// The verdict is [`Verdict::Bad`].
    Bad,
}

/// A reason why the verdict is not [`Verdict::Good`]. Displayed as one line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reason {
    /// The subject.
    pub code: ReasonCode,
    /// The severity.
    pub severity: Severity,
    /// The view's name, where the reason concerns a single one.
    pub view: Option<String>,
    /// The observation.
    pub found: String,
    /// The expectation.
    pub expected: String,
    /// The likely cause.
    pub cause: String,
    /// The way out.
    pub remedy: String,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if let Some(view) = &self.view {
            write!(f, "view {view}: ")?;
        }
        let Self { found, expected, cause, remedy, .. } = self;
        write!(f, "{found}; expected: {expected}; likely cause: {cause}; {remedy}")
    }
}

/// The verdict of the most severe reason; without reasons, `Good` if there was a check.
pub(super) fn verdict(reasons: &[Reason], was_checked: bool) -> Verdict {
    match reasons.iter().map(|reason| reason.severity).max() {
        None if was_checked => Verdict::Good,
        None => Verdict::Unchecked,
        Some(Severity::Doubtful) => Verdict::Doubtful,
        Some(Severity::Bad) => Verdict::Bad,
    }
}
