//! The most memory that a reconstruction takes: in a process of its own, because an allocator keeps what earlier work
//! gave back.

use std::ffi::OsString;
use std::process::{Command, Stdio};
use vg::geometry::Similarity;

/// Runs `vg reconstruct` with these words, in this frame, and returns the highest resident memory of that process, bytes; `None` where
/// it fails or the system does not tell.
pub(crate) fn of_reconstruction(
    words: impl IntoIterator<Item = OsString>,
    frame: Option<&Similarity>,
) -> Option<u64> {
    let folder = tempfile::tempdir().ok()?;
    let report = folder.path().join("report.json");
    let mut command = Command::new(std::env::current_exe().ok()?);
    command.arg("reconstruct").args(words);
    command.arg("--output").arg(folder.path().join("asset.ply")).arg("--report").arg(&report);
    if let Some(frame) = frame {
        let file = folder.path().join("frame.json");
        vg::io::write_vehicle_from_world(&file, frame).ok()?;
        command.arg("--vehicle-from-world").arg(file);
    }
    let ended = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status().ok()?;
    if !ended.success() {
        return None;
    }
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(report).ok()?).ok()?;
    report["peak_rss_bytes"].as_u64()
}
