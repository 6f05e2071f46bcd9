//! The graphics processor of this machine, or a driver that stands in for one.

use super::say;
use vg::render::{Adapter, GpuRenderer};

/// A renderer; or nothing, which is printed, where there is no driver. `VG_NO_SKIP` makes that a failure.
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
