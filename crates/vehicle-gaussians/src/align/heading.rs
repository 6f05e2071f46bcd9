//! Front and back if the shape is ambiguous: a person decides by one photograph.

use super::WorldView;
use glam::DVec3;
use vg_geometry::{Error, Result, Similarity, choices};
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

/// Sine of the smallest angle from abeam (17 degrees) at which ahead and behind are easy to tell in a picture.
const ABEAM: f64 = 0.3;

/// The view that [`Heading`] refers to: its name, and whether it was taken from ahead under `s`. The view does not
/// change if front and back are exchanged. `center` is the vehicle's middle, vehicle frame.
pub(super) fn heading_view<'a>(views: &'a [View], s: &Similarity, center: DVec3) -> Option<(&'a str, bool)> {
    let forward = |view: &View| {
        let seen = s.transform_point(WorldView(view).camera_center()) - center;
        seen.x / seen.truncate().length()
    };
    let oblique = views.iter().filter(|view| forward(view).abs() > ABEAM);
    let first = oblique.min_by(|a, b| a.name.cmp(&b.name))?;
    Some((&first.name, forward(first) > 0.0))
}

/// Whether `s` must be turned round to agree with `heading`.
pub(super) fn is_contrary(heading: Heading, views: &[View], s: &Similarity, center: DVec3) -> Result<bool> {
    if heading == Heading::Auto {
        return Ok(false);
    }
    let Some((_, ahead)) = heading_view(views, s, center) else {
        let asked = if heading == Heading::Forward { "forward" } else { "backward" };
        let found = format!("{asked}, but all views were taken from abeam");
        return Err(Error::argument("heading", found, "auto, or a view from obliquely ahead or behind"));
    };
    Ok(ahead != (heading == Heading::Forward))
}

/// The error for an ambiguous heading; it explains how to choose one.
pub(super) fn unknown(views: &[View], s: &Similarity, center: DVec3, why: &str) -> Error {
    let found = format!("auto, but {why}");
    let allowed = match heading_view(views, s, center) {
        Some((name, _)) => format!(
            "forward if {name} was taken from ahead of the vehicle's middle, backward if from behind it"
        ),
        None => "auto, with a view from obliquely ahead or behind to tell them apart".into(),
    };
    Error::argument("heading", found, allowed)
}
