//! The golden renders: their folder, and the scene of each.

use super::npz::Npz;
use super::say;
use glam::{DMat3, DVec3};
use std::path::PathBuf;
use vg::gaussians::sh;
use vg::geometry::camera::Intrinsics;
use vg::{Camera, Gaussians, Pose};

/// The folder of the golden renders. Prints a line if there is none.
pub fn golden() -> Option<PathBuf> {
    let folder = std::env::var_os("VG_GSPLAT_GOLDEN")
        .map_or_else(|| crate::root().join("../shared/data/gsplat_golden"), PathBuf::from);
    if folder.join("extreme_256.npz").exists() {
        return Some(folder);
    }
    say(&format!("skipped: no golden renders in {} (VG_GSPLAT_GOLDEN is their folder)", folder.display()));
    None
}

pub fn gaussians(npz: &Npz) -> Gaussians {
    let triples = |name: &str| -> Vec<[f32; 3]> { npz.f32(name).as_chunks::<3>().0.to_vec() };
    let rotations = npz.f32("quats_wxyz").as_chunks::<4>().0.to_vec();
    let (degree, sh) = match npz.scalar("sh_degree") as i32 {
        -1 => (0, triples("colors").into_iter().flat_map(sh::from_rgb).collect()),
        degree => (degree as u8, npz.f32("sh")),
    };
    Gaussians::from_arrays(degree, triples("means"), rotations, triples("scales"), npz.f32("opacities"), sh)
        .unwrap()
}

pub fn camera(npz: &Npz) -> Camera {
    let m = &npz.array("viewmats").values;
    let k = &npz.array("Ks").values;
    // The stored matrix is orthonormal to f32 only; its transpose as the rotation of the pose gives it back exactly.
    let rows = DMat3::from_cols_array(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]);
    let center = -(rows.transpose().inverse() * DVec3::new(m[3], m[7], m[11]));
    Camera::pinhole(
        npz.scalar("width") as u32,
        npz.scalar("height") as u32,
        Intrinsics { fx: k[0], fy: k[4], cx: k[2], cy: k[5] },
        Pose { rotation: rows, translation: center },
    )
    .unwrap()
}
