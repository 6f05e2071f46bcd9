//! Peak memory of a reconstruction, measured in a process of its own, because an allocator keeps memory that earlier
//! work has freed.

use std::ffi::OsString;
use std::process::{Command, Stdio};
use vg::geometry::Similarity;

/// The null device.
const NULL_DEVICE: &str = if cfg!(windows) { "NUL" } else { "/dev/null" };

/// Runs `vg reconstruct` with these words, in this frame, and returns the peak resident memory of that process, bytes;
/// `None` where it fails or the system does not report it. The process writes no file, and ends when this one does.
pub(crate) fn reconstruction_peak(
    words: impl IntoIterator<Item = OsString>,
    frame: Option<&Similarity>,
) -> Option<u64> {
    let mut command = Command::new(std::env::current_exe().ok()?);
    command.arg("reconstruct").args(words);
    command.args(["--output", NULL_DEVICE, "--report", "-", "--end-with-input"]);
    if let Some(frame) = frame {
        command.arg(format!("--frame-matrix={:?}", frame.to_row_major()));
    }
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
    // Held until the process has ended.
    let _input = child.stdin.take();
    let ended = child.wait_with_output().ok()?;
    if !ended.status.success() {
        return None;
    }
    let report: serde_json::Value = serde_json::from_slice(&ended.stdout).ok()?;
    report["peak_rss_bytes"].as_u64()
}
