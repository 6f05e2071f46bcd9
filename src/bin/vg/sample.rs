//! The sample inside this program: the scene of tests/data/sedan, so that the demo needs no file and no network.

use crate::files;
use crate::job::Result;
use std::path::Path;

macro_rules! sample {
    ($($path:literal)*) => {
        &[$(($path, include_bytes!(concat!("../../../tests/data/sedan/", $path)))),*]
    };
}

/// Path in the scene's folder, and content.
const FILES: &[(&str, &[u8])] = sample![
    "README.md" "transforms.json" "split.json" "vehicle.json" "vehicle_from_world.json"
    "images/000.png" "images/001.png" "images/002.png" "images/003.png"
    "images/004.png" "images/005.png" "images/006.png" "images/007.png"
    "masks/000.png" "masks/001.png" "masks/002.png" "masks/003.png"
    "masks/004.png" "masks/005.png" "masks/006.png" "masks/007.png"
    "depth/000.png" "depth/001.png" "depth/002.png" "depth/003.png"
    "sparse/0/cameras.bin" "sparse/0/images.bin" "sparse/0/points3D.bin"
];

/// Writes the scene into this folder.
pub(crate) fn write(folder: &Path) -> Result<()> {
    for (path, bytes) in FILES {
        let path = folder.join(path);
        files::prepare(&path)?;
        files::write(&path, bytes)?;
    }
    Ok(())
}
