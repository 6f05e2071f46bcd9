//! Reads the pixels of listed views, in parallel, and checks them against their cameras.

use super::scene::SceneView;
use super::{depth, image};
use crate::error::{Error, Result};
use crate::progress::Watch;
use crate::scene::mask::VEHICLE_THRESHOLD;
use crate::scene::view::MAX_VIEWS;
use crate::scene::{Scene, View};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The scene of these views, and notes on what is legal but looks like a mistake.
pub(super) fn load(views: &[SceneView], watch: &Watch) -> Result<(Scene, Vec<String>)> {
    // Before a picture is decoded, not after all are.
    if views.is_empty() || views.len() > MAX_VIEWS {
        return Err(Error::argument("views", views.len().to_string(), format!("1 to {MAX_VIEWS}")));
    }
    let read = AtomicUsize::new(0);
    let one = |view: &SceneView| {
        watch.check()?;
        let loaded = load_view(view)?;
        watch.report((read.fetch_add(1, Ordering::Relaxed) + 1) as f64 / views.len() as f64)?;
        Ok(loaded)
    };
    let loaded: Vec<(View, Vec<String>)> = views.par_iter().map(one).collect::<Result<_>>()?;
    let (views, notes): (Vec<View>, Vec<Vec<String>>) = loaded.into_iter().unzip();
    let mut notes: Vec<String> = notes.into_iter().flatten().collect();
    if views.iter().any(|v| v.mask.is_some()) {
        let unmasked = views.iter().filter(|v| v.mask.is_none());
        notes.extend(unmasked.map(|v| format!("{}: no mask, though other views have one", v.name)));
    }
    let scene = Scene { views, ..Scene::default() };
    scene.validate()?;
    Ok((scene, notes))
}

fn load_view(listed: &SceneView) -> Result<(View, Vec<String>)> {
    let mut notes = Vec::new();
    let expected = (listed.camera.width, listed.camera.height);
    let picture = image::read(&listed.image)?;
    check_size(&listed.image, (picture.image.width(), picture.image.height()), expected, "its camera")?;

    let mask = match (&listed.mask, &picture.alpha) {
        (Some(path), _) => {
            let (mask, largest) = image::read_mask_and_largest(path)?;
            check_size(path, (mask.width(), mask.height()), expected, "its picture")?;
            if (1..VEHICLE_THRESHOLD).contains(&largest) {
                notes.push(format!(
                    "{}: the largest value is {largest}, and vehicle begins at {VEHICLE_THRESHOLD}: the mask is empty",
                    path.display()
                ));
            }
            Some(mask)
        }
        (None, Some(alpha)) => Some(image::mask_of_alpha(expected.0, expected.1, alpha)?),
        (None, None) => None,
    };
    let depth = match &listed.depth {
        None => None,
        Some(file) => {
            let map = depth::read(&file.path, file.unit)?;
            check_size(&file.path, (map.width(), map.height()), expected, "its picture")?;
            notes.extend(implausible_depth(&file.path, map.depth(), file.unit));
            Some(map)
        }
    };
    let view = View { name: listed.name.clone(), camera: listed.camera, image: picture.image, mask, depth };
    Ok((view, notes))
}

fn check_size(path: &Path, found: (u32, u32), expected: (u32, u32), whose: &str) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    let reason = format!("{}x{}, but {whose} is {}x{}", found.0, found.1, expected.0, expected.1);
    Err(Error::format(path, "size", reason))
}

/// Vehicles are photographed from metres away; a median outside 5 cm to 500 m is a wrong unit.
fn implausible_depth(path: &Path, depth: &[f32], unit: f64) -> Option<String> {
    let mut measured: Vec<f32> = depth.iter().copied().filter(|&d| d > 0.0).collect();
    let middle = measured.len() / 2;
    let median = match measured.len() {
        0 => return Some(format!("{}: no pixel holds a measurement", path.display())),
        _ => *measured.select_nth_unstable_by(middle, f32::total_cmp).1,
    };
    (!(0.05..=500.0).contains(&median)).then(|| {
        format!(
            "{}: the median depth is {median} m with {unit} m per unit: is the unit right?",
            path.display()
        )
    })
}
