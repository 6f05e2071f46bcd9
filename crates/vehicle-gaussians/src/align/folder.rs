//! Alignment of a scene on disk to a scan on disk.

use super::{FEWEST_VIEWS, Heading, ScanAlignment, to_scan_watched};
use std::path::{Path, PathBuf};
use vg_geometry::progress::{UNWATCHED, Watch};
use vg_geometry::{Error, Result};
use vg_scene::Cloud;
use vg_scene::io::{self, MaskedViews};

/// The named scan, or else the one in the folder of a 3DRealCar vehicle.
pub fn scan_of(folder: &Path, named: Option<&Path>) -> Result<PathBuf> {
    let found = named.map_or_else(|| io::find_scan(folder), |path| Ok(Some(path.to_owned())))?;
    found.ok_or_else(|| {
        let none = format!("{} holds no scan", folder.display());
        let places = "one PLY file in 3dscanner_origin or in colmap_processed/pcd_rescale";
        Error::argument("scan", none, format!("a file name, or {places}"))
    })
}

/// Reads the masks and sparse points of a scene on disk; an error with fewer than [`FEWEST_VIEWS`] masks.
pub fn masks_of(folder: &Path) -> Result<MaskedViews> {
    let scene = io::read_masked(folder)?;
    if scene.views.len() < FEWEST_VIEWS {
        let (with, all) = (scene.views.len(), scene.views.len() + scene.unmasked);
        let reason = format!(
            "{with} of {all} views have a mask; allowed: at least {FEWEST_VIEWS}. {}",
            scene.notes.last().map_or("", String::as_str)
        );
        return Err(Error::format(folder, "masks", reason));
    }
    Ok(scene)
}

/// [`to_scan`](super::to_scan) with the masks, the sparse points and the scan (PLY, metres, vehicle frame) read from
/// files; also returns the masks. `scan` as in [`scan_of`].
pub fn folder_to_scan(
    folder: &Path,
    scan: Option<&Path>,
    heading: Heading,
) -> Result<(MaskedViews, ScanAlignment)> {
    folder_to_scan_watched(folder, scan, heading, &UNWATCHED)
}

/// [`folder_to_scan`] under `watch`.
pub fn folder_to_scan_watched(
    folder: &Path,
    scan: Option<&Path>,
    heading: Heading,
    watch: &Watch,
) -> Result<(MaskedViews, ScanAlignment)> {
    let path = scan_of(folder, scan)?;
    let (points, _) = io::ply::read_points(&path)?;
    let cloud = Cloud::new(points).map_err(|e| Error::format(&path, "vertex", e.to_string()))?;
    watch.check()?;
    let scene = masks_of(folder)?;
    watch.check()?;
    let found = to_scan_watched(&scene.views, &scene.points, &cloud, heading, watch)?;
    Ok((scene, found))
}
