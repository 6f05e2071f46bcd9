//! Merges Gaussians of single photographs: keeps the vehicle's, in its frame, as one model.

use glam::DVec3;
use vg_geometry::{Error, Result, Similarity};
use vg_scene::View;
use vg_scene::mask::Label;
use vg_splat::Gaussians;

/// Label of a Gaussian's centre in a view's picture.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Seen {
    Vehicle,
    Other,
    /// Outside the picture, behind the camera, or on an unknown pixel.
    Unknown,
}

/// Merges Gaussians that were predicted from `views` into one model: one part per view, or one part for all views.
///
/// Gaussians of a view's own part are kept if their centre lies on the vehicle in the view's mask. Gaussians of a
/// common part are kept if they lie on the vehicle in every mask that shows them, at least one. `centers` are the
/// views' camera centres by name as the program placed them, in the frame of the parts: the parts are then transformed
/// by the similarity that takes these centres to the views' own (Umeyama), which needs three that are not on one line.
/// Without centres, the parts must be in the views' frame.
///
/// # Errors
/// A wrong number of parts, a view without a mask, a view without a centre if centres are given, centres on a line,
/// and no Gaussian left.
pub fn merge_views(
    parts: &[Gaussians],
    views: &[View],
    centers: Option<&[(String, DVec3)]>,
) -> Result<Gaussians> {
    if views.is_empty() || (parts.len() != views.len() && parts.len() != 1) {
        let allowed = format!("1, or {}: one for each view", views.len());
        return Err(Error::argument("parts", parts.len().to_string(), allowed));
    }
    if let Some((i, view)) = views.iter().enumerate().find(|(_, view)| view.mask.is_none()) {
        return Err(Error::argument(view.argument(i), "no mask", "a mask for every view"));
    }
    let to_vehicle = centers.map(|centers| similarity(views, centers)).transpose()?;
    let mut merged: Option<Gaussians> = None;
    for (i, part) in parts.iter().enumerate() {
        let placed = match &to_vehicle {
            Some(to_vehicle) => part.transformed(to_vehicle)?,
            None => part.clone(),
        };
        let own_views = if parts.len() == views.len() { &views[i..=i] } else { views };
        let keep: Vec<bool> = placed.means().iter().map(|mean| is_vehicle(mean, own_views)).collect();
        let kept = placed.filtered(&keep);
        merged = Some(match merged {
            Some(merged) => merged.merged(&kept),
            None => kept,
        });
    }
    merged.filter(|merged| !merged.is_empty()).ok_or_else(|| Error::Reconstruction {
        stage: "import",
        reason: "no Gaussian lies on the vehicle in the masks; check the frame that they are in".into(),
    })
}

/// Similarity from the program's frame to the views' frame.
fn similarity(views: &[View], centers: &[(String, DVec3)]) -> Result<Similarity> {
    let (mut from, mut to) = (Vec::new(), Vec::new());
    for view in views {
        let center = centers.iter().find(|(name, _)| *name == view.name);
        let (_, center) = center.ok_or_else(|| {
            Error::argument("centers", format!("none for {:?}", view.name), "one for each view, by its name")
        })?;
        from.push(*center);
        to.push(view.camera.center());
    }
    Similarity::umeyama(&from, &to)
}

fn is_vehicle(mean: &[f32; 3], views: &[View]) -> bool {
    let mut shown =
        views.iter().map(|view| seen(mean, view)).filter(|seen| *seen != Seen::Unknown).peekable();
    shown.peek().is_some() && shown.all(|seen| seen == Seen::Vehicle)
}

fn seen(mean: &[f32; 3], view: &View) -> Seen {
    let camera = &view.camera;
    let p = camera.vehicle_from_camera.inverse().transform_point(DVec3::from_array(mean.map(f64::from)));
    let Some([u, v]) = camera.project(p) else { return Seen::Unknown };
    let is_inside = u >= 0.0 && v >= 0.0 && u < f64::from(camera.width) && v < f64::from(camera.height);
    let label = view.mask.as_ref().filter(|_| is_inside).map(|mask| {
        let (u, v) = (u as usize, v as usize);
        mask.labels()[v * camera.width as usize + u]
    });
    match label {
        Some(Label::Vehicle) => Seen::Vehicle,
        Some(Label::Unknown) | None => Seen::Unknown,
        Some(_) => Seen::Other,
    }
}
