//! A scene's masks without its pictures, in the scene's own world: the input of alignment.

use super::files::is_there;
use super::image::{ExifPixels, Wanted};
use super::listing::ListedView;
use super::scene::SceneFormat;
use super::{colmap, image, listing};
use crate::View;
use crate::view::MAX_VIEWS;
use glam::DVec3;
use rayon::prelude::*;
use std::path::Path;
use vg_geometry::{Error, Result};

/// Masked views and sparse points in the world of the scene's poses.
#[derive(Clone, Debug)]
pub struct MaskedViews {
    /// Views sorted by name. Cameras carry `world_from_camera`; pictures are black.
    pub views: Vec<View>,
    /// Sparse points of a COLMAP model; empty if there are none.
    pub points: Vec<DVec3>,
    /// The number of views without a mask, which were left out.
    pub unmasked: usize,
    /// Notes on choices among several candidates and on masks that were not found, a sentence each.
    pub notes: Vec<String>,
}

/// Reads cameras, masks (files, else the pictures' alpha) and sparse points of the scene at `path`. Views without a
/// mask are left out. In a folder with both, the COLMAP model is read instead of the `transforms.json`, because it is
/// the one in an arbitrary world.
pub fn read_masked(path: &Path) -> Result<MaskedViews> {
    let mut listing = listing::list(path, colmap_format(path))?;
    listing.views.sort_by(|a, b| a.name.cmp(&b.name));
    if listing.views.len() > MAX_VIEWS {
        return Err(Error::argument("views", listing.views.len().to_string(), format!("1 to {MAX_VIEWS}")));
    }
    let exif = if listing.sparse_model.is_some() { ExifPixels::Stored } else { ExifPixels::BySize };
    let read = |view: &ListedView| read_view(view, exif);
    let all: Vec<Option<View>> = listing.views.par_iter().map(read).collect::<Result<_>>()?;
    let mut notes = listing.notes;
    if let Some(first) = all.iter().position(Option::is_none) {
        let ListedView { name, mask_names, .. } = &listing.views[first];
        notes.push(format!("{name}: no mask; searched for {mask_names}"));
    }
    let views: Vec<View> = all.into_iter().flatten().collect();
    let points = match &listing.sparse_model {
        Some(model) => colmap::read_points(model)?.map(|p| p.positions).unwrap_or_default(),
        None => Vec::new(),
    };
    let points = points.into_iter().map(DVec3::from_array).collect();
    Ok(MaskedViews { unmasked: listing.views.len() - views.len(), views, points, notes })
}

/// [`SceneFormat::Colmap`] if a COLMAP model is at or below `path`.
pub fn colmap_format(path: &Path) -> Option<SceneFormat> {
    listing::find_colmap(path).map(|_| SceneFormat::Colmap)
}

fn read_view(listed: &ListedView, exif: ExifPixels) -> Result<Option<View>> {
    let size = (listed.camera.width, listed.camera.height);
    let wanted = Wanted { size, whose: "its camera", exif };
    let mask = match &listed.mask {
        Some(path) => image::read_mask_wanted(path, wanted)?,
        None if !is_there(&listed.image) => return Ok(None),
        None => {
            let Some(alpha) = image::read_wanted(&listed.image, wanted)?.alpha else { return Ok(None) };
            image::mask_from_alpha(&listed.image, size.0, size.1, &alpha)?
        }
    };
    View::without_picture(listed.name.clone(), listed.camera, Some(mask)).map(Some)
}
