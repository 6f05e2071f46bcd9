//! Front and back where shape does not tell: a question that a person answers by looking at one photograph.

use glam::DVec3;
use vg_geometry::Similarity;
use vg_geometry::{Error, Result, choices};
use vg_scene::View;

choices! {
    /// How front and back are told apart.
    #[derive(Default)]
    pub enum Heading as "heading" {
        /// By shape; where the other way round fits as well, it is an error that names the view to look at.
        #[default]
        Auto = 0 "auto",
        /// The first view by name, of those not taken from abeam, was taken from ahead of the vehicle's middle.
        Forward = 1 "forward",
        /// It was taken from behind the middle.
        Backward = 2 "backward",
    }
}

/// Nearer to abeam than this, ahead and behind are hard to tell in a picture: sine of 17 degrees.
const ABEAM: f64 = 0.3;

/// The view that [`Heading`] speaks of: its name, and whether it was taken from ahead under `s`. Under `s` turned round
/// it is the same view. `center` is the vehicle's middle, vehicle frame.
pub(super) fn asked_view<'a>(views: &'a [View], s: &Similarity, center: DVec3) -> Option<(&'a str, bool)> {
    let forward = |view: &View| {
        let seen = s.transform_point(view.camera.center()) - center;
        seen.x / seen.truncate().length()
    };
    let oblique = views.iter().filter(|view| forward(view).abs() > ABEAM);
    let first = oblique.min_by(|a, b| a.name.cmp(&b.name))?;
    Some((&first.name, forward(first) > 0.0))
}

/// Whether `s` has to be turned round to be as `heading` says.
pub(super) fn is_contrary(heading: Heading, views: &[View], s: &Similarity, center: DVec3) -> Result<bool> {
    if heading == Heading::Auto {
        return Ok(false);
    }
    let Some((_, ahead)) = asked_view(views, s, center) else {
        let asked = if heading == Heading::Forward { "forward" } else { "backward" };
        let found = format!("{asked}, but all views were taken from abeam");
        return Err(Error::argument("heading", found, "auto, or a view from obliquely ahead or behind"));
    };
    Ok(ahead != (heading == Heading::Forward))
}

/// The refusal to guess, with what to answer.
pub(super) fn unknown(views: &[View], s: &Similarity, center: DVec3, why: &str) -> Error {
    let found = format!("auto, but {why}");
    let allowed = match asked_view(views, s, center) {
        Some((name, _)) => format!(
            "forward if {name} was taken from ahead of the vehicle's middle, backward if from behind it"
        ),
        None => "a view from obliquely ahead or behind, to tell them by".into(),
    };
    Error::argument("heading", found, allowed)
}
