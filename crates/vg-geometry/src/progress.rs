//! Progress reports and cancellation of work that runs on the caller's worker threads.

mod course;
mod watch;

pub use course::Course;
pub use watch::UNWATCHED;
pub use watch::{ASKED_EVERY, Watch};

use crate::error::{Error, Result};
pub use crate::threads::Threads;
use std::cell::RefCell;
use std::ops::ControlFlow;

/// The progress of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Name of the running stage, as in the report.
    pub stage: &'static str,
    /// Completed fraction of the stage, 0 to 1.
    pub fraction: f64,
    /// Completed fraction of the whole call, in expected time. It never decreases, and is 1 in the last call.
    pub overall: f64,
    /// The current loss, where the stage is an optimisation.
    pub loss: Option<f64>,
}

/// Called on the caller's own thread at every stage boundary, inside long stages, and at the end; `Break` cancels.
pub type ProgressCallback<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// The context of every stage: worker threads and the progress callback.
pub struct Context<'a> {
    threads: &'a Threads,
    callback: RefCell<&'a mut ProgressCallback<'a>>,
    course: RefCell<Course>,
}

impl<'a> Context<'a> {
    /// Context of one run on these threads.
    pub fn new(threads: &'a Threads, callback: &'a mut ProgressCallback<'a>) -> Self {
        Self { threads, callback: RefCell::new(callback), course: RefCell::default() }
    }

    /// The number of worker threads.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Runs `work` on the worker threads: rayon inside it uses these and no others.
    pub fn parallel<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.threads.run(work)
    }

    /// Sets the expected stages, from which the overall fraction of all further reports is computed.
    pub fn follow(&self, course: Course) {
        self.course.replace(course);
    }

    /// Reports progress to the caller; [`Error::Cancelled`] if the callback returns `Break`.
    pub fn report(&self, stage: &'static str, fraction: f64) -> Result<()> {
        let overall = self.course.borrow_mut().overall(stage, fraction);
        self.call(Progress { stage, fraction, overall, loss: None })
    }

    /// Reports progress and the current loss of an optimisation; see [`Context::report`].
    pub fn report_loss(&self, stage: &'static str, fraction: f64, loss: f64) -> Result<()> {
        let overall = self.course.borrow_mut().overall(stage, fraction);
        self.call(Progress { stage, fraction, overall, loss: Some(loss) })
    }

    /// Reports the end of the run, in the stage of the last report.
    pub fn report_end(&self) -> Result<()> {
        let stage = self.course.borrow().stage();
        self.call(Progress { stage, fraction: 1.0, overall: 1.0, loss: None })
    }

    fn call(&self, progress: Progress) -> Result<()> {
        let stage = progress.stage;
        match (*self.callback.borrow_mut())(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Cancelled { stage }),
        }
    }
}
