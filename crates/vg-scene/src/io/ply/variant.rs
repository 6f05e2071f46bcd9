//! Unsupported kinds of Gaussians, detected by their properties, and the ways to convert them.

use super::header::Header;

/// An unsupported kind of Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Variant {
    /// SuperSplat's layout of 16 bytes per Gaussian, in chunks.
    Packed,
    /// 2D Gaussian splatting: discs of two scales.
    Discs,
    /// Gaussians with red, green and blue in place of spherical harmonics.
    Rgb,
    /// Gaussians with more bands of spherical harmonics than are supported.
    HighDegree(u32),
}

/// Whether the vertices have a property that only Gaussians have.
pub(super) fn holds_splats(header: &Header) -> bool {
    ["rot_0", "scale_0", "f_dc_0", "packed_position"].iter().any(|name| header.find(name).is_some())
}

impl Variant {
    /// The kind of Gaussians that differ from 3DGS's layout; `None` if it is unknown or they are no Gaussians.
    pub(super) fn from_header(header: &Header) -> Option<Self> {
        let has = |name: &str| header.find(name).is_some();
        if !holds_splats(header) {
            return None;
        }
        if has("packed_position") {
            return Some(Self::Packed);
        }
        if has("scale_1") && !has("scale_2") {
            return Some(Self::Discs);
        }
        if !has("f_dc_0") && has("red") && has("green") && has("blue") {
            return Some(Self::Rgb);
        }
        let rest = header.properties.iter().filter(|p| p.name.starts_with("f_rest_")).count();
        (4..=10)
            .find(|degree| rest == 3 * ((degree + 1) * (degree + 1) - 1))
            .map(|d| Self::HighDegree(d as u32))
    }

    /// Name of the kind, for messages.
    pub(super) fn kind(self) -> String {
        match self {
            Self::Packed => "compressed PLY, as SuperSplat packs it".into(),
            Self::Discs => "2D Gaussians (2DGS), discs of two scales".into(),
            Self::Rgb => "Gaussians coloured by red, green and blue".into(),
            Self::HighDegree(degree) => format!("Gaussians of SH degree {degree}"),
        }
    }

    /// Way to convert them to 3DGS's layout.
    pub(super) fn way_out(self) -> &'static str {
        match self {
            Self::Packed => {
                "unpack it: `splat-transform IN.ply OUT.ply` (npm install -g @playcanvas/splat-transform), or superspl.at/convert"
            }
            Self::Discs => {
                "export 3D Gaussians, or give each vertex a property scale_2, the natural logarithm of a thickness in metres (-7 is 1 mm)"
            }
            Self::Rgb => {
                "give each vertex f_dc_0, f_dc_1, f_dc_2 of (colour / 255 - 0.5) / 0.28209479 in place of red, green, blue"
            }
            Self::HighDegree(_) => "train or export them with SH degree 3 or less",
        }
    }
}
