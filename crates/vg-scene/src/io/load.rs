//! Reads the pixels of listed views, in parallel, and checks them against their cameras.

use super::beside::{PICTURES, has_picture_extension};
use super::files::is_there;
use super::image::{ExifPixels, Wanted};
use super::scene::SceneView;
use super::{depth, image};
use crate::view::MAX_VIEWS;
use crate::{Scene, View};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use vg_geometry::progress::Watch;
use vg_geometry::{Error, Result};

/// Loads the scene of these views; also returns notes on legal input that looks like a mistake.
pub(super) fn load(views: &[SceneView], exif: ExifPixels, watch: &Watch) -> Result<(Scene, Vec<String>)> {
    // Check the number before any picture is decoded.
    if views.is_empty() || views.len() > MAX_VIEWS {
        return Err(Error::argument("views", views.len().to_string(), format!("1 to {MAX_VIEWS}")));
    }
    let read = AtomicUsize::new(0);
    let one = |view: &SceneView| {
        watch.check()?;
        let loaded = load_view(view, exif)?;
        watch.report((read.fetch_add(1, Ordering::Relaxed) + 1) as f64 / views.len() as f64)?;
        Ok(loaded)
    };
    let loaded: Vec<(View, Option<String>)> = views.par_iter().map(one).collect::<Result<_>>()?;
    let listed = views;
    let (views, doubts): (Vec<View>, Vec<Option<String>>) = loaded.into_iter().unzip();
    let mut notes: Vec<String> = doubts.into_iter().flatten().collect();
    notes.extend(unmasked(listed, &views));
    let scene = Scene { views, ..Scene::default() };
    scene.validate()?;
    Ok((scene, notes))
}

fn load_view(listed: &SceneView, exif: ExifPixels) -> Result<(View, Option<String>)> {
    let size = (listed.camera.width, listed.camera.height);
    let wanted = |whose| Wanted { size, whose, exif };
    if !has_picture_extension(&listed.image) && !is_there(&listed.image) {
        let tried: Vec<String> = PICTURES.iter().map(|extension| format!(".{extension}")).collect();
        let reason = format!("no such file, and none with {} added", tried.join(", "));
        return Err(Error::format(&listed.image, "picture", reason));
    }
    let picture = image::read_wanted(&listed.image, wanted("its camera"))?;
    let mask = match (&listed.mask, &picture.alpha) {
        (Some(path), _) => Some(image::read_mask_wanted(path, wanted("its picture"))?),
        (None, Some(alpha)) => Some(image::mask_from_alpha(&listed.image, size.0, size.1, alpha)?),
        (None, None) => None,
    };
    let mut doubt = None;
    let depth = match &listed.depth {
        None => None,
        Some(file) => {
            let (map, unit) = depth::read_wanted(&file.path, file.unit, wanted("its picture"))?;
            doubt = implausible_depth(&file.path, map.depth(), unit);
            Some(map)
        }
    };
    let view = View { name: listed.name.clone(), camera: listed.camera, image: picture.image, mask, depth };
    Ok((view, doubt))
}

/// A note on all views without a mask, with the names that were tried.
fn unmasked(listed: &[SceneView], views: &[View]) -> Option<String> {
    /// Maximum of views that the note names.
    const SHOWN: usize = 8;
    let without = listed.iter().zip(views).filter(|(_, view)| view.mask.is_none());
    let unmasked: Vec<&SceneView> = without.map(|(listed, _)| listed).collect();
    let tried = &unmasked.first()?.mask_names;
    if unmasked.len() == views.len() {
        return Some(format!("no view has a mask; searched for {tried}"));
    }
    let names: Vec<&str> = unmasked.iter().take(SHOWN).map(|view| view.name.as_str()).collect();
    let more = if unmasked.len() > SHOWN { ", ..." } else { "" };
    Some(format!("{}{more}: no mask, although other views have one; searched for {tried}", names.join(", ")))
}

/// A warning if the median depth is outside 5 cm to 500 m: vehicles are photographed from metres away, so the unit is
/// probably wrong.
fn implausible_depth(path: &Path, depth: &[f32], unit: f64) -> Option<String> {
    let mut measured: Vec<f32> = depth.iter().copied().filter(|&d| d > 0.0).collect();
    let middle = measured.len() / 2;
    let median = match measured.len() {
        0 => return Some(format!("{}: no pixel has a measurement", path.display())),
        _ => *measured.select_nth_unstable_by(middle, f32::total_cmp).1,
    };
    (!(0.05..=500.0).contains(&median)).then(|| {
        format!(
            "{}: the median depth is {median} m with {unit} m per unit; is the unit right?",
            path.display()
        )
    })
}
