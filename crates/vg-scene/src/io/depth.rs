//! Depth maps from files: 16-bit PNG, float `.npy`, `.pfm` and `.exr`.
//!
//! A file's numbers times its unit are planar z in metres, whatever the gauge of the poses. Values that are no
//! measurement (0, NaN, infinite, negative) become 0 = none.

use super::files::read_limited;
use super::image::{Wanted, decode_gray16};
use super::{exr, npy, pfm};
use crate::DepthMap;
use std::path::Path;
use vg_geometry::camera::MAX_SIDE;
use vg_geometry::{Error, Result};

/// Default metres per unit of integers: millimetres, as in files of nerfstudio and most depth cameras. Floats are
/// metres.
pub const MILLIMETRES: f64 = 1e-3;

/// Longest depth file that is read: 8192 x 8192 doubles and a header.
const MAX_FILE: u64 = 513 << 20;

/// A depth file's format, determined by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthFormat {
    /// 16-bit grey PNG.
    Png,
    /// NumPy array of floats (f4, f8) or integers (u2, i2, u4, i4, u8, i8).
    Npy,
    /// Portable float map.
    Pfm,
    /// OpenEXR with a Z, depth, Y or R channel.
    Exr,
}

impl DepthFormat {
    /// The format of a file name's extension.
    pub fn from_path(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("npy") => Ok(Self::Npy),
            Some("pfm") => Ok(Self::Pfm),
            Some("exr") => Ok(Self::Exr),
            _ => Err(Error::format(path, "extension", "not a depth format; allowed: .png .npy .pfm .exr")),
        }
    }
}

/// Reads the depth map in `path`; `unit` is metres per number in the file, positive and finite. Without a unit,
/// integers are millimetres and floats metres.
pub fn read(path: &Path, unit: impl Into<Option<f64>>) -> Result<DepthMap> {
    let format = DepthFormat::from_path(path)?;
    decode(format, &read_limited(path, MAX_FILE)?, path, unit)
}

/// Decodes a depth map from bytes; `path` is for messages only.
pub fn decode(
    format: DepthFormat,
    bytes: &[u8],
    path: &Path,
    unit: impl Into<Option<f64>>,
) -> Result<DepthMap> {
    decode_wanted(format, bytes, path, unit.into(), None).map(|(map, _)| map)
}

/// Reads the depth map in `path`, which must have the wanted size; also returns the unit of its numbers.
pub(crate) fn read_wanted(path: &Path, unit: Option<f64>, wanted: Wanted) -> Result<(DepthMap, f64)> {
    let format = DepthFormat::from_path(path)?;
    decode_wanted(format, &read_limited(path, MAX_FILE)?, path, unit, Some(wanted))
}

fn decode_wanted(
    format: DepthFormat,
    bytes: &[u8],
    path: &Path,
    unit: Option<f64>,
    wanted: Option<Wanted>,
) -> Result<(DepthMap, f64)> {
    if let Some(unit) = unit.filter(|unit| !(*unit > 0.0 && unit.is_finite())) {
        return Err(Error::argument("depth_scale", unit.to_string(), "metres per unit, above 0"));
    }
    const METRES: f64 = 1.0;
    let (width, height, values, own_unit) = match format {
        DepthFormat::Png => {
            let (width, height, values) = decode_gray16(bytes, path, wanted)?;
            (width, height, values.into_iter().map(f32::from).collect(), MILLIMETRES)
        }
        DepthFormat::Npy => {
            let array = npy::decode(bytes, path)?;
            let unit = if array.is_integer { MILLIMETRES } else { METRES };
            (array.width, array.height, array.values, unit)
        }
        DepthFormat::Pfm => {
            let (width, height, values) = pfm::decode(bytes, path)?;
            (width, height, values, METRES)
        }
        DepthFormat::Exr => {
            let (width, height, values) = exr::decode(bytes, path, wanted)?;
            (width, height, values, METRES)
        }
    };
    if let Some(wanted) = wanted {
        wanted.check_size(path, (width, height))?;
    }
    let unit = unit.unwrap_or(own_unit);
    // The product in f64, so that 1234 mm is the f32 nearest to 1.234 m.
    let metres = values.into_iter().map(|v| (f64::from(v) * unit) as f32).collect();
    Ok((DepthMap::new(width, height, metres)?, unit))
}

/// A picture size from a header, checked against the allowed range.
pub(super) fn checked_size(path: &Path, width: u64, height: u64) -> Result<(u32, u32)> {
    let allowed = 1..=u64::from(MAX_SIDE);
    if !allowed.contains(&width) || !allowed.contains(&height) {
        let reason = format!("{width}x{height}; allowed: 1x1 to {MAX_SIDE}x{MAX_SIDE}");
        return Err(Error::format(path, "size", reason));
    }
    Ok((width as u32, height as u32))
}
