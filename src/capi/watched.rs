//! Work that reports its progress to the caller's callback, which can cancel it.

use super::context::CallContext;
use super::options::vg_progress_fn;
use super::status::c_string;
use std::ffi::c_void;
use std::ops::ControlFlow;
use vg::Result;
use vg::progress::{Progress, UNWATCHED, Watch};

/// The caller's progress callback and its user pointer.
#[derive(Clone, Copy)]
pub(super) struct ProgressCallback {
    pub(super) function: vg_progress_fn,
    pub(super) user: *mut c_void,
}

impl ProgressCallback {
    /// Reports progress to the caller; returns whether to continue.
    pub(super) unsafe fn report(self, progress: Progress) -> ControlFlow<()> {
        let Some(function) = self.function else { return ControlFlow::Continue(()) };
        let stage = c_string(progress.stage.to_owned());
        match unsafe { function(stage.as_ptr(), progress.fraction, self.user) } {
            0 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    }
}

/// Runs `work` on the context's threads and reports its progress on the calling thread.
pub(super) unsafe fn watched<T: Send>(
    context: &CallContext,
    stage: &'static str,
    callback: ProgressCallback,
    work: impl FnOnce(&Watch) -> Result<T> + Send,
) -> Result<T> {
    match callback.function {
        None => context.threads.run(|| work(&UNWATCHED)),
        Some(_) => {
            context.threads.run_watched(stage, &mut |progress| unsafe { callback.report(progress) }, work)
        }
    }
}
