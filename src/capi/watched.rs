//! Work that the caller is told of, and can end, where its options name a callback.

use super::context::Workshop;
use super::options::vg_progress_fn;
use super::status::c_string;
use std::ffi::c_void;
use std::ops::ControlFlow;
use vg::Result;
use vg::progress::{Progress, UNWATCHED, Watch};

/// The caller's callback.
#[derive(Clone, Copy)]
pub(super) struct Told {
    pub(super) callback: vg_progress_fn,
    pub(super) user: *mut c_void,
}

impl Told {
    /// Tells the caller where the call stands, and hears whether to go on.
    pub(super) unsafe fn tell(self, progress: Progress) -> ControlFlow<()> {
        let Some(callback) = self.callback else { return ControlFlow::Continue(()) };
        let stage = c_string(progress.stage.to_owned());
        match unsafe { callback(stage.as_ptr(), progress.fraction, self.user) } {
            0 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    }
}

/// Runs `work` on the workshop's threads, and tells of it on this one.
pub(super) unsafe fn watched<T: Send>(
    shop: &Workshop,
    stage: &'static str,
    told: Told,
    work: impl FnOnce(&Watch) -> Result<T> + Send,
) -> Result<T> {
    match told.callback {
        None => shop.threads.run(|| work(&UNWATCHED)),
        Some(_) => shop.threads.run_watched(stage, &mut |progress| unsafe { told.tell(progress) }, work),
    }
}
