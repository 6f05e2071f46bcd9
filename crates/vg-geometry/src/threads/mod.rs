//! Worker threads: started once, used by any number of calls, and joined when their handle is dropped.
//!
//! All parallel loops of the library run in the rayon pool that they are called from. Only [`Threads::run`] enters such
//! a pool; rayon's global pool is never used.

mod calling;
mod of_process;
mod signals;

use crate::error::{Error, Result};
use std::cell::RefCell;
use std::num::NonZero;
use std::sync::mpsc::{self, TryRecvError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

pub use of_process::OfProcess;
pub use signals::blocked as without_signals;

/// Worker threads that the caller owns, started once and used by any number of calls, one after another or at the same
/// time. They end when this is dropped. A count of 1 uses the calling thread itself and starts none.
#[derive(Debug)]
pub struct Threads {
    workers: OfProcess<Workers>,
}

/// The threads on which work runs.
#[derive(Debug)]
enum Workers {
    /// The calling thread.
    Calling,
    /// The threads of a pool. The pool is `None` only while it is dropped.
    Pool { pool: Option<rayon::ThreadPool>, handles: Vec<JoinHandle<()>> },
}

/// Interval at which a worker polls for its answer, much shorter than any callback worth making takes.
const ANSWER_POLL: Duration = Duration::from_micros(20);

/// Prefix of the names of worker threads.
pub const THREAD_NAME: &str = "vg-";

/// Maximum number of threads of one handle.
pub const MAX_THREADS: usize = 1024;

/// The number of cores that this process may use, by its affinity and the quotas of its control groups.
fn one_per_core() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get).min(MAX_THREADS)
}

impl Threads {
    /// Starts `count` worker threads, or none where `count` is 1; 0 means one per core that this process may use.
    ///
    /// # Errors
    /// [`Error::Argument`] for more than [`MAX_THREADS`], [`Error::Threads`] where the system starts fewer.
    pub fn new(count: usize) -> Result<Self> {
        if count > MAX_THREADS {
            return Err(Error::argument(
                "threads",
                count.to_string(),
                format!("0 (all cores) to {MAX_THREADS}"),
            ));
        }
        let workers = match if count == 0 { one_per_core() } else { count } {
            1 => Workers::Calling,
            count => Workers::start(count)?,
        };
        Ok(Self { workers: OfProcess::new(workers) })
    }

    /// The number of threads.
    ///
    /// # Panics
    /// As [`Threads::run`].
    pub fn count(&self) -> usize {
        self.pool().map_or(1, rayon::ThreadPool::current_num_threads)
    }

    /// Checks that these threads belong to this process: a fork has none of its parent's threads.
    ///
    /// # Errors
    /// [`Error::Argument`] in a fork of the process that made them.
    pub fn check_process(&self) -> Result<()> {
        self.workers.get("threads").map(drop)
    }

    /// Runs `work` on these threads: rayon inside it uses them and no others. A single thread is the calling one; if
    /// that is a worker of another rayon pool, `work` runs in that pool.
    ///
    /// # Panics
    /// In a fork of the process that made them, see [`Threads::check_process`].
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match self.pool() {
            Some(pool) => pool.install(work),
            None => calling::run(work),
        }
    }

    /// Runs `work` on these threads and hands it a function that calls `answer` on the calling thread and waits for the
    /// result. It serves callbacks from the middle of work, which must run on the caller's own thread. `answer` may use
    /// these threads.
    ///
    /// # Panics
    /// As [`Threads::run`].
    pub fn run_asking<T: Send, Q: Send, A: Send>(
        &self,
        work: impl FnOnce(&dyn Fn(Q) -> A) -> T + Send,
        mut answer: impl FnMut(Q) -> A,
    ) -> T {
        let Some(pool) = self.pool() else {
            let answer = RefCell::new(answer);
            return calling::run(|| work(&|question| answer.borrow_mut()(question)));
        };
        let (ask, asked) = mpsc::channel();
        let (tell, told) = mpsc::channel();
        let mut done = None;
        let slot = &mut done;
        pool.in_place_scope(move |scope| {
            scope.spawn(move |_| {
                let ask_caller = |question| {
                    ask.send(question).expect("the caller listens until the work is done");
                    loop {
                        match told.try_recv() {
                            Ok(answer) => return answer,
                            Err(TryRecvError::Disconnected) => panic!("no answer: the caller panicked"),
                            Err(TryRecvError::Empty) => {}
                        }
                        // The other workers may be busy, and the caller may need one for the answer.
                        if rayon::yield_now() != Some(rayon::Yield::Executed) {
                            thread::sleep(ANSWER_POLL);
                        }
                    }
                };
                *slot = Some(work(&ask_caller));
            });
            for question in asked {
                // Sending fails only where the worker panicked; the scope then propagates the panic.
                let _ = tell.send(answer(question));
            }
        });
        done.expect("the scope ends after the work")
    }

    /// Runs `work` on these threads while the calling thread runs `wait`. Where the only thread is the calling one,
    /// another is started for this call, so that the calling thread is free to wait.
    ///
    /// # Errors
    /// [`Error::Threads`] where that thread cannot be started.
    ///
    /// # Panics
    /// As [`Threads::run`], and where `work` does.
    pub(crate) fn run_while_waiting<T: Send>(
        &self,
        work: impl FnOnce() -> T + Send,
        wait: impl FnOnce(),
    ) -> Result<T> {
        let Some(pool) = self.pool() else {
            return thread::scope(|scope| {
                let worker = thread::Builder::new().name(format!("{THREAD_NAME}0"));
                let worker = signals::blocked(|| worker.spawn_scoped(scope, || calling::run(work)));
                let worker =
                    worker.map_err(|e| Error::Threads { count: 1, started: 0, found: e.to_string() })?;
                wait();
                worker.join().map_err(|payload| std::panic::resume_unwind(payload))
            });
        };
        let mut done = None;
        let slot = &mut done;
        pool.in_place_scope(|scope| {
            scope.spawn(move |_| *slot = Some(work()));
            wait();
        });
        Ok(done.expect("the scope ends after the work"))
    }

    fn pool(&self) -> Option<&rayon::ThreadPool> {
        match self.workers.get("threads") {
            Ok(workers) => workers.pool(),
            Err(error) => panic!("{error}"),
        }
    }
}

impl Workers {
    fn start(count: usize) -> Result<Self> {
        let mut handles = Vec::with_capacity(count);
        let pool = signals::blocked(|| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(count)
                .spawn_handler(|worker| {
                    let name = format!("{THREAD_NAME}{}", worker.index());
                    handles.push(thread::Builder::new().name(name).spawn(|| worker.run())?);
                    Ok(())
                })
                .build()
        });
        let started = handles.len();
        // Where one thread could not be started, the earlier ones are already ending.
        let mut workers = Self::Pool { pool: None, handles };
        let found = pool.map_err(|e| Error::Threads { count, started, found: e.to_string() })?;
        if let Self::Pool { pool, .. } = &mut workers {
            *pool = Some(found);
        }
        Ok(workers)
    }

    fn pool(&self) -> Option<&rayon::ThreadPool> {
        match self {
            Self::Calling => None,
            Self::Pool { pool, .. } => pool.as_ref(),
        }
    }
}

impl Drop for Workers {
    /// Joins the threads, which rayon does not do.
    fn drop(&mut self) {
        let Self::Pool { pool, handles } = self else { return };
        drop(pool.take());
        for handle in handles.drain(..) {
            // A worker's panic has already been propagated to the caller whose work it was.
            let _ = handle.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_is_answered_on_the_calling_thread_which_may_use_the_workers() {
        for count in [1, 2, 3] {
            let threads = Threads::new(count).unwrap();
            let caller = thread::current().id();
            let work = |ask: &dyn Fn(u32) -> u32| {
                assert_eq!(thread::current().id() == caller, count == 1);
                (0..4).map(ask).sum::<u32>()
            };
            let sum = threads.run_asking(work, |n| {
                assert_eq!(thread::current().id(), caller);
                threads.run(|| rayon::join(|| n, || 10 * n)).1
            });
            assert_eq!(sum, 60);
        }
    }

    #[test]
    fn a_panic_on_either_side_of_a_question_reaches_the_caller() {
        use std::panic::{AssertUnwindSafe, catch_unwind};
        for count in [1, 2] {
            let threads = Threads::new(count).unwrap();
            let message = |work: &mut dyn FnMut()| {
                let payload = catch_unwind(AssertUnwindSafe(work)).unwrap_err();
                *payload.downcast::<&str>().unwrap()
            };
            let asking = message(&mut || threads.run_asking(|_: &dyn Fn(())| panic!("asking"), |()| ()));
            assert_eq!(asking, "asking");
            let answering = message(&mut || threads.run_asking(|ask| ask(()), |()| panic!("answering")));
            assert!(["answering", "no answer: the caller panicked"].contains(&answering), "{answering}");
            assert_eq!(threads.run(|| 7), 7);
        }
    }

    #[test]
    fn the_count_is_the_requested_one_and_0_means_all_that_the_process_may_use() {
        assert_eq!(Threads::new(0).unwrap().count(), thread::available_parallelism().unwrap().get());
        assert_eq!(Threads::new(5).unwrap().count(), 5);
        let error = Threads::new(1025).unwrap_err().to_string();
        assert_eq!(error, "threads: 1025; allowed: 0 (all cores) to 1024");
    }

    #[test]
    fn threads_of_another_process_are_an_error_and_are_left_alone() {
        for count in [1, 2] {
            let threads = Threads { workers: of_process::as_in_a_fork(Threads::new(count).unwrap().workers) };
            let error = threads.check_process().unwrap_err().to_string();
            assert!(error.starts_with("threads: made in process 1, but this process, "), "{error}");
            let run = std::panic::AssertUnwindSafe(|| threads.run(|| ()));
            assert!(std::panic::catch_unwind(run).is_err());
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_threads_end_when_the_handle_is_dropped() {
        let threads = Threads::new(3).unwrap();
        // The entry of each thread in the system's list.
        let numbers: Vec<std::path::PathBuf> = threads.pool().unwrap().broadcast(|_| {
            let link = std::fs::read_link("/proc/thread-self").unwrap();
            std::path::Path::new("/proc").join(link)
        });
        assert!(numbers.len() == 3 && numbers.iter().all(|n| n.exists()));
        drop(threads);
        // A joined thread has ended, but is listed until the kernel has reaped it.
        let start = std::time::Instant::now();
        while numbers.iter().any(|n| n.exists()) && start.elapsed().as_secs() < 2 {
            thread::yield_now();
        }
        assert!(!numbers.iter().any(|n| n.exists()));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn workers_block_all_signals_except_their_own_faults() {
        let host = signals::mask_of_this_thread();
        let threads = Threads::new(2).unwrap();
        let workers = threads.pool().unwrap().broadcast(|_| signals::mask_of_this_thread());
        assert_eq!(signals::mask_of_this_thread(), host, "the host's own thread is unchanged");
        // Signal n is bit n - 1: HUP 1, INT 2, ILL 4, TRAP 5, ABRT 6, BUS 7, FPE 8, SEGV 11, ALRM 14, TERM 15, PROF 27,
        // SYS 31.
        for mask in workers {
            let is_blocked = |signal: u32| mask >> (signal - 1) & 1 == 1;
            assert!([1, 2, 10, 12, 14, 15, 17, 27].iter().all(|&s| is_blocked(s)), "{mask:x}");
            assert!(![4, 5, 6, 7, 8, 11, 31].iter().any(|&s| is_blocked(s)), "{mask:x}");
        }
    }
}
