//! A scene's masks without its pictures, in the scene's own world: what alignment needs.

use super::scene::SceneFormat;
use super::{colmap, image, listing};
use crate::error::{Error, Result};
use crate::scene::View;
use crate::scene::view::MAX_VIEWS;
use glam::DVec3;
use rayon::prelude::*;
use std::path::Path;

/// Masked views and sparse points in the world of the scene's poses.
#[derive(Clone, Debug)]
pub struct MaskedViews {
    /// Sorted by name. Cameras carry `world_from_camera`; pictures are black.
    pub views: Vec<View>,
    /// Of a COLMAP model; empty where there are none.
    pub points: Vec<DVec3>,
    /// How many views have no mask and were left out.
    pub unmasked: usize,
}

/// Reads cameras, masks (files, else the pictures' alpha) and sparse points of the scene at `path`. Views without a
/// mask are left out. Of a folder with both, the COLMAP model is read and not the `transforms.json`: it is the one whose
/// world says nothing.
pub fn read_masked(path: &Path) -> Result<MaskedViews> {
    let mut listing = listing::list(path, colmap_format(path))?;
    listing.views.sort_by(|a, b| a.name.cmp(&b.name));
    if listing.views.len() > MAX_VIEWS {
        return Err(Error::argument("views", listing.views.len().to_string(), format!("1 to {MAX_VIEWS}")));
    }
    let all: Vec<Option<View>> = listing.views.par_iter().map(read_view).collect::<Result<_>>()?;
    let views: Vec<View> = all.into_iter().flatten().collect();
    let points = match &listing.sparse_model {
        Some(model) => colmap::read_points(model)?.map(|p| p.positions).unwrap_or_default(),
        None => Vec::new(),
    };
    let points = points.into_iter().map(DVec3::from_array).collect();
    Ok(MaskedViews { unmasked: listing.views.len() - views.len(), views, points })
}

/// [`SceneFormat::Colmap`] where a COLMAP model is at or below `path`.
pub fn colmap_format(path: &Path) -> Option<SceneFormat> {
    listing::find_colmap(path).map(|_| SceneFormat::Colmap)
}

fn read_view(listed: &listing::ListedView) -> Result<Option<View>> {
    let (width, height) = (listed.camera.width, listed.camera.height);
    let (path, mask) = match &listed.mask {
        Some(path) => (path, image::read_mask(path)?),
        None if !listed.image.is_file() => return Ok(None),
        None => {
            let picture = image::read(&listed.image)?;
            let Some(alpha) = picture.alpha else { return Ok(None) };
            let size = (picture.image.width(), picture.image.height());
            (&listed.image, image::mask_of_alpha(size.0, size.1, &alpha)?)
        }
    };
    if (mask.width(), mask.height()) != (width, height) {
        let reason = format!("{}x{}, but its camera is {width}x{height}", mask.width(), mask.height());
        return Err(Error::format(path, "size", reason));
    }
    View::without_picture(listed.name.clone(), listed.camera, Some(mask)).map(Some)
}
