//! Gaussians and points: data that was read can be written and read again, with the same count.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use vg::io::ply;

fuzz_target!(|bytes: &[u8]| {
    let path = Path::new("file.ply");
    let _ = ply::read_points_from(bytes, bytes.len() as u64, path);
    let Ok((gaussians, _)) = ply::read_from(bytes, bytes.len() as u64, path) else { return };
    let mut written = Vec::new();
    ply::write_to(&mut written, &gaussians).unwrap();
    let (again, notes) = ply::read_from(&written[..], written.len() as u64, path).unwrap();
    assert_eq!((again.means(), again.sh()), (gaussians.means(), gaussians.sh()));
    assert!(notes.ignored.is_empty());
});
