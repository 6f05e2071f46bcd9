//! Pictures and depth maps: the first byte selects the format.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use vg::io::depth::{self, DepthFormat};
use vg::io::image;

fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    let path = Path::new("file");
    let format = match which % 5 {
        0 => return drop(image::decode(bytes, path)),
        1 => DepthFormat::Png,
        2 => DepthFormat::Npy,
        3 => DepthFormat::Pfm,
        _ => DepthFormat::Exr,
    };
    if let Ok(map) = depth::decode(format, bytes, path, 1e-3) {
        assert!(map.depth().iter().all(|d| d.is_finite() && *d >= 0.0));
    }
});
