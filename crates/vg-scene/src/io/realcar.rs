//! Folders in the layout of the data set 3DRealCar (described in docs/ALIGN.md).
//!
//! ```text
//! CAR/3dscanner_origin/                      the phone's recording: frame_00000.jpg and .json, ..., a scan
//! CAR/colmap_processed/images, masks/sam     the pictures in COLMAP's model, and their masks
//! CAR/colmap_processed/pcd_rescale/          images and masks/sam, links to those above; sparse/0, rescaled
//! ```

use super::colmap;
use std::path::{Path, PathBuf};
use vg_geometry::{Error, Result};

const SCANNER: &str = "3dscanner_origin";
const PROCESSED: &str = "colmap_processed";
const RESCALED: &str = "pcd_rescale";

/// The COLMAP model of the vehicle in `folder`; the rescaled one takes precedence.
pub(super) fn find_model(folder: &Path) -> Option<colmap::Found> {
    let processed = folder.join(PROCESSED);
    [processed.join(RESCALED), processed].iter().find_map(|folder| colmap::find(folder))
}

/// The scan of the vehicle in `folder`: the PLY file in the phone's recording, else the one next to the rescaled
/// model; `None` if there is none, an error if there are several.
pub fn find_scan(folder: &Path) -> Result<Option<PathBuf>> {
    for place in [folder.join(SCANNER), folder.join(PROCESSED).join(RESCALED)] {
        let Ok(entries) = std::fs::read_dir(&place) else { continue };
        let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        found.retain(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")));
        found.sort();
        match found.as_slice() {
            [] => {}
            [scan] => return Ok(Some(scan.clone())),
            several => {
                let names: Vec<_> = several.iter().filter_map(|path| path.file_name()).collect();
                return Err(Error::format(&place, "scan", format!("{names:?}; allowed: one PLY file")));
            }
        }
    }
    Ok(None)
}

/// The picture `image` of a model whose pictures are in `root`. The toolkit creates links with absolute paths, which
/// break once the folder has been moved; their targets are in the folder above.
pub(super) fn find_image(root: &Path, image: &Path) -> PathBuf {
    let above = root.parent().map(|folder| folder.join("images").join(image));
    let here = root.join("images").join(image);
    above.filter(|above| is_rescaled(root) && !here.is_file() && above.is_file()).unwrap_or(here)
}

/// The mask of `image`: `masks/sam/<stem>`, a NumPy array of booleans from this toolkit, a picture from others.
pub(super) fn find_mask(root: &Path, image: &Path) -> Option<PathBuf> {
    let above = root.parent().filter(|_| is_rescaled(root));
    let masks = [Some(root), above].into_iter().flatten().map(|folder| folder.join("masks/sam").join(image));
    let files = masks.flat_map(|mask| ["png", "npy", "jpg"].map(|extension| mask.with_extension(extension)));
    files.into_iter().find(|file| file.is_file())
}

fn is_rescaled(root: &Path) -> bool {
    root.ends_with(Path::new(PROCESSED).join(RESCALED))
}
