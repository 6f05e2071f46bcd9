//! The bundled sample: the scene of tests/data/sedan, so that the demo needs no file and no network.

use crate::files;
use crate::job::{Failure, Result};
use std::path::Path;

macro_rules! sample {
    ($($path:literal)*) => {
        &[$(($path, include_bytes!(concat!("../../../tests/data/sedan/", $path)))),*]
    };
}

/// Path in the scene's folder and contents of each file.
const FILES: &[(&str, &[u8])] = sample![
    "README.md" "transforms.json" "split.json" "vehicle.json" "vehicle_from_world.json"
    "images/000.png" "images/001.png" "images/002.png" "images/003.png"
    "images/004.png" "images/005.png" "images/006.png" "images/007.png"
    "masks/000.png" "masks/001.png" "masks/002.png" "masks/003.png"
    "masks/004.png" "masks/005.png" "masks/006.png" "masks/007.png"
    "depth/000.png" "depth/001.png" "depth/002.png" "depth/003.png"
    "sparse/0/cameras.bin" "sparse/0/images.bin" "sparse/0/points3D.bin"
];

/// Writes the files of the scene that are missing in this folder. A file of the same name with other contents is an
/// error, because it belongs to another scene; nothing is replaced.
pub(crate) fn write(folder: &Path) -> Result<()> {
    let missing: Vec<_> = FILES.iter().filter(|(path, _)| !folder.join(path).exists()).collect();
    for (path, bytes) in FILES.iter().filter(|(path, _)| folder.join(path).exists()) {
        let path = folder.join(path);
        if std::fs::read(&path).ok().as_deref() != Some(*bytes) {
            let message =
                "is not a file of the sample and would be replaced; choose another folder for the demo";
            return Err(Failure::job(format!("{}: {message}", path.display())));
        }
    }
    for (path, bytes) in missing {
        let path = folder.join(path);
        path.parent().map_or(Ok(()), files::prepare_folder)?;
        files::write(&path, |out| out.write_all(bytes))?;
    }
    Ok(())
}
