//! Detection of other formats given in place of PLY, by their first bytes or else by the file extension, with the way
//! out.

use std::path::Path;
use vg_geometry::{Error, Result};

/// The number of bytes that identify a format.
pub(super) const FIRST_BYTES: usize = 512;

/// Way out for Gaussians.
const GAUSSIANS: &str = "convert it: `splat-transform IN OUT.ply` (npm install -g @playcanvas/splat-transform), or superspl.at/convert";

/// Way out for everything else.
const OTHERS: &str = "export Gaussians or a point cloud as PLY from the program that made it";

/// A format that is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Format {
    name: &'static str,
    way_out: &'static str,
}

const fn splats(name: &'static str) -> Format {
    Format { name, way_out: GAUSSIANS }
}

const fn other(name: &'static str) -> Format {
    Format { name, way_out: OTHERS }
}

const SPZ: Format = splats("SPZ, Niantic's compressed Gaussians");
const SOG: Format = splats("SOG, PlayCanvas' compressed Gaussians");
const SPLAT: Format = splats("the .splat layout of antimatter15");
const KSPLAT: Format = splats("the .ksplat layout of GaussianSplats3D");
const LCC: Format = splats("LCC, XGRIDS' Gaussians");
const GLB: Format = other("glTF in its binary form, GLB");
const GLTF: Format = other("glTF");
const USDZ: Format = other("USDZ");
const USD: Format = other("USD");
const LAS: Format = other("LAS, a point cloud of a laser scanner");
const PCD: Format = other("PCD, a point cloud of PCL");
const E57: Format = other("E57, a point cloud of a laser scanner");
const PICTURE: Format = other("a picture");
const ZIP: Format = other("a ZIP archive");
const CHECKPOINT: Format = other("a checkpoint of PyTorch");
const GZIP: Format = Format { name: "compressed by gzip", way_out: "unpack it first: `gunzip FILE`" };

/// Formats by the first bytes of a file.
const BY_CONTENT: [(&[u8], Format); 10] = [
    (b"NGSP", SPZ),
    (b"glTF", GLB),
    (b"PXR-USDC", USD),
    (b"#usda", USD),
    (b"LASF", LAS),
    (b"# .PCD", PCD),
    (b"ASTM-E57", E57),
    (b"\x89PNG", PICTURE),
    (b"\xff\xd8\xff", PICTURE),
    (b"RIFF", PICTURE),
];

/// Formats by file extension.
const BY_ENDING: [(&str, Format); 24] = [
    ("spz", SPZ),
    ("sog", SOG),
    ("splat", SPLAT),
    ("ksplat", KSPLAT),
    ("lcc", LCC),
    ("glb", GLB),
    ("gltf", GLTF),
    ("usdz", USDZ),
    ("usd", USD),
    ("usda", USD),
    ("usdc", USD),
    ("las", LAS),
    ("laz", LAS),
    ("pcd", PCD),
    ("e57", E57),
    ("pt", CHECKPOINT),
    ("pth", CHECKPOINT),
    ("ckpt", CHECKPOINT),
    ("obj", other("OBJ, a mesh")),
    ("stl", other("STL, a mesh")),
    ("png", PICTURE),
    ("jpg", PICTURE),
    ("jpeg", PICTURE),
    ("json", other("JSON")),
];

/// Returns an error that names the format if a file that begins with `first` is not a PLY file.
pub(super) fn refuse(first: &[u8], path: &Path) -> Result<()> {
    if first.starts_with(b"ply") {
        return Ok(());
    }
    match by_content(first, path).or_else(|| by_ending(path)) {
        Some(Format { name, way_out }) => {
            Err(Error::format(path, "format", format!("this is {name}; allowed: PLY; {way_out}")))
        }
        None => Ok(()),
    }
}

/// Returns an error if the name of a PLY file to be written has the extension of another format.
pub(super) fn refuse_name(path: &Path) -> Result<()> {
    match by_ending(path) {
        Some(Format { name, .. }) => {
            let found = format!("{}, the extension of {name}", path.display());
            Err(Error::argument("path", found, "a name that ends in .ply, since a PLY file is written"))
        }
        None => Ok(()),
    }
}

fn by_content(first: &[u8], path: &Path) -> Option<Format> {
    let holds = |word: &[u8]| first.windows(word.len()).any(|window| window == word);
    if first.starts_with(b"PK\x03\x04") {
        // The names of an archive's first files identify its format.
        return Some(match () {
            () if holds(b".usd") => USDZ,
            () if holds(b"meta.json") || holds(b".webp") => SOG,
            () => by_ending(path).unwrap_or(ZIP),
        });
    }
    if first.starts_with(b"\x1f\x8b") {
        return Some(by_ending(path).unwrap_or(GZIP));
    }
    BY_CONTENT.into_iter().find(|(magic, _)| first.starts_with(magic)).map(|(_, format)| format)
}

fn by_ending(path: &Path) -> Option<Format> {
    let ending = path.extension()?;
    BY_ENDING.into_iter().find(|(name, _)| ending.eq_ignore_ascii_case(name)).map(|(_, format)| format)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(first: &[u8], name: &str) -> String {
        refuse(first, Path::new(name)).err().map_or_else(String::new, |e| e.to_string())
    }

    #[test]
    fn a_format_is_detected_by_its_bytes_and_else_by_its_name() {
        for (first, name, format) in [
            (&b"\x1f\x8b\x08\x00\x0a"[..], "car.spz", "SPZ"),
            (b"NGSP\x03\x00\x00\x00", "car", "SPZ"),
            (b"PK\x03\x04\x0a\x00\x00\x00meta.json", "car", "SOG"),
            (b"PK\x03\x04\x0a\x00\x00\x00means_l.webp", "car.zip", "SOG"),
            (b"PK\x03\x04\x0a\x00\x00\x00scene.usdc", "car", "USDZ"),
            (b"PK\x03\x04\x14\x00", "car.pt", "PyTorch"),
            (b"\x00\x00\x80\x3f", "car.splat", ".splat"),
            (b"\x00\x01", "CAR.KSPLAT", ".ksplat"),
            (b"glTF\x02", "car.ply", "GLB"),
            (b"{\"asset\": {}}", "car.gltf", "glTF"),
        ] {
            let message = message(first, name);
            assert!(
                message.contains(format) && message.starts_with(name) && message.contains("; allowed: PLY; "),
                "{message}"
            );
        }
        assert!(message(b"\x1f\x8b", "car.ply").contains("gunzip"));
        assert!(message(b"NGSP", "car.ply").contains("splat-transform"));
        // A file that begins as PLY is one, whatever its name.
        assert_eq!([message(b"ply\n", "car.spz"), message(b"hello", "car.ply")], ["", ""]);
    }
}
