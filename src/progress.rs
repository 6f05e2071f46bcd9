//! How long work runs: on the caller's threads' budget, with a progress callback that may cancel.

use crate::error::{Error, Result};
use std::cell::RefCell;
use std::ops::ControlFlow;

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Name of the running stage, as in the report.
    pub stage: &'static str,
    /// Part of the stage that is done, 0 to 1.
    pub fraction: f64,
}

/// Called on the caller's own thread at every stage boundary and inside the long ones; `Break` cancels.
pub type ProgressCallback<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// What every stage is given: a thread pool of its own and the progress callback.
pub struct Context<'a> {
    pool: rayon::ThreadPool,
    callback: RefCell<&'a mut ProgressCallback<'a>>,
}

impl<'a> Context<'a> {
    /// With `threads` worker threads; 0 means one per core.
    pub fn new(threads: usize, callback: &'a mut ProgressCallback<'a>) -> Result<Self> {
        const MAX_THREADS: usize = 1024;
        if threads > MAX_THREADS {
            return Err(Error::argument(
                "threads",
                threads.to_string(),
                format!("0 (all cores) to {MAX_THREADS}"),
            ));
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("vg-{i}"))
            .build()
            .map_err(|e| Error::argument("threads", e.to_string(), "a number the system can start"))?;
        Ok(Self { pool, callback: RefCell::new(callback) })
    }

    /// Worker threads.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs `work` on the pool: rayon inside it uses these threads and no others.
    pub fn parallel<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.pool.install(work)
    }

    /// Tells the caller where the run stands; an error if the caller wants it to stop.
    pub fn report(&self, stage: &'static str, fraction: f64) -> Result<()> {
        match (*self.callback.borrow_mut())(Progress { stage, fraction }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Cancelled { stage }),
        }
    }
}
