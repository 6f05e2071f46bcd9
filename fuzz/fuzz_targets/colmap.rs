//! The six files of a COLMAP model: the first byte selects one.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use vg::io::colmap::{
    Model, ModelImage, cameras_from_binary, cameras_from_text, images_from_binary, images_from_text,
    points_from_binary, points_from_text,
};

fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    let path = Path::new("file");
    match which % 6 {
        0 => drop(cameras_from_binary(bytes, path)),
        1 => drop(cameras_from_text(bytes, path)),
        2 => check(images_from_binary(bytes, path)),
        3 => check(images_from_text(bytes, path)),
        4 => drop(points_from_binary(bytes, path)),
        _ => drop(points_from_text(bytes, path)),
    }
});

/// Asserts that images have rotations as poses, and names inside their folder.
fn check(images: vg::Result<Vec<ModelImage>>) {
    let Ok(images) = images else { return };
    for image in &images {
        assert!((image.world_from_camera.rotation.determinant() - 1.0).abs() < 1e-9);
        assert!(image.name.is_relative() && !image.name.starts_with(".."));
    }
    let _ = Model::new(std::collections::HashMap::new(), images, Path::new("file"));
}
