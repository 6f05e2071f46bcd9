//! `transforms.json`, `vehicle_from_world`, and known camera centres.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use vg::io::{transforms, vehicle_frame};

fuzz_target!(|bytes: &[u8]| {
    let path = Path::new("file.json");
    if let Ok(file) = transforms::parse(bytes, path) {
        for (i, frame) in file.frames.iter().enumerate() {
            // Data read without a size has a camera for any size.
            let _ = frame.camera(frame.size.unwrap_or((640, 480)), path, &format!("frames[{i}]"));
            assert!(frame.file_path.is_relative());
        }
    }
    let _ = vehicle_frame::parse_vehicle_from_world(bytes, path);
    let _ = vehicle_frame::parse_matrix(bytes, path);
    let _ = vehicle_frame::parse_known_centers(bytes, path);
});
