//! The GPU of this machine, or a software driver.

use super::say;
use vg::render::{Adapter, GpuRenderer};

/// A renderer. Prints a line and returns `None` if there is no driver; with `VG_NO_SKIP` that is a failure.
pub fn renderer() -> Option<GpuRenderer> {
    match GpuRenderer::new(Adapter::Any) {
        Ok(renderer) => Some(renderer),
        Err(e) if std::env::var_os("VG_NO_SKIP").is_none() => {
            say(&format!("skipped: {e}"));
            None
        }
        Err(e) => panic!("{e}"),
    }
}
