//! How work runs: on threads that the caller started, with a progress callback that may cancel.

mod course;
mod watch;

pub use course::Course;
pub use watch::UNWATCHED;
pub use watch::{ASKED_EVERY, Watch};

use crate::error::{Error, Result};
pub use crate::threads::Threads;
use std::cell::RefCell;
use std::ops::ControlFlow;

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Name of the running stage, as in the report.
    pub stage: &'static str,
    /// Part of the stage that is done, 0 to 1.
    pub fraction: f64,
    /// Part of the whole call that is done, in expected time: it never falls, and is 1 in the last call.
    pub overall: f64,
    /// What an optimisation has come down to, where the stage is one.
    pub loss: Option<f64>,
}

/// Called on the caller's own thread at every stage boundary, inside the long ones, and at the end; `Break` cancels.
pub type ProgressCallback<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// What every stage is given: worker threads and the progress callback.
pub struct Context<'a> {
    threads: &'a Threads,
    callback: RefCell<&'a mut ProgressCallback<'a>>,
    course: RefCell<Course>,
}

impl<'a> Context<'a> {
    /// For one run on these threads.
    pub fn new(threads: &'a Threads, callback: &'a mut ProgressCallback<'a>) -> Self {
        Self { threads, callback: RefCell::new(callback), course: RefCell::default() }
    }

    /// How many worker threads.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Runs `work` on the worker threads: rayon inside it uses these and no others.
    pub fn parallel<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.threads.run(work)
    }

    /// What is to come, for the overall fraction of what is told from now on.
    pub fn follow(&self, course: Course) {
        self.course.replace(course);
    }

    /// Tells the caller where the run stands; an error if the caller wants it to stop.
    pub fn report(&self, stage: &'static str, fraction: f64) -> Result<()> {
        let overall = self.course.borrow_mut().overall(stage, fraction);
        self.tell(Progress { stage, fraction, overall, loss: None })
    }

    /// The same of an optimisation.
    pub fn report_loss(&self, stage: &'static str, fraction: f64, loss: f64) -> Result<()> {
        let overall = self.course.borrow_mut().overall(stage, fraction);
        self.tell(Progress { stage, fraction, overall, loss: Some(loss) })
    }

    /// Tells the caller that all is done, in the stage that was told last.
    pub fn report_end(&self) -> Result<()> {
        let stage = self.course.borrow().stage();
        self.tell(Progress { stage, fraction: 1.0, overall: 1.0, loss: None })
    }

    fn tell(&self, progress: Progress) -> Result<()> {
        let stage = progress.stage;
        match (*self.callback.borrow_mut())(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Cancelled { stage }),
        }
    }
}
