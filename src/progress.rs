//! How work runs: on threads that the caller started, with a progress callback that may cancel.

mod course;
mod watch;

pub(crate) use course::Course;
pub(crate) use watch::UNWATCHED;
pub use watch::{ASKED_EVERY, Watch};

use crate::error::{Error, Result};
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::sync::mpsc::{self, TryRecvError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

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

/// Worker threads of the caller's own, started once and used by any number of calls, one after another or at
/// the same time. They end when this is dropped.
#[derive(Debug)]
pub struct Threads {
    /// `None` only while this is dropped.
    pool: Option<rayon::ThreadPool>,
    workers: Vec<JoinHandle<()>>,
}

/// How often a worker looks whether it was answered: much less than an answer takes that is worth asking for.
const ANSWER_POLL: Duration = Duration::from_micros(20);

/// What the names of worker threads begin with.
pub const THREAD_NAME: &str = "vg-";

impl Threads {
    /// Starts `count` worker threads; 0 means one per core.
    pub fn new(count: usize) -> Result<Self> {
        const MAX_THREADS: usize = 1024;
        if count > MAX_THREADS {
            return Err(Error::argument(
                "threads",
                count.to_string(),
                format!("0 (all cores) to {MAX_THREADS}"),
            ));
        }
        let mut workers = Vec::new();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .spawn_handler(|worker| {
                let name = format!("{THREAD_NAME}{}", worker.index());
                workers.push(thread::Builder::new().name(name).spawn(|| worker.run())?);
                Ok(())
            })
            .build()
            .map_err(|e| Error::argument("threads", e.to_string(), "a number the system can start"));
        // Where one thread could not be started, those before it are on their way out.
        let mut threads = Self { pool: None, workers };
        threads.pool = Some(pool?);
        Ok(threads)
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.pool().current_num_threads()
    }

    /// Runs `work` on these threads: rayon inside it uses them and no others.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.pool().install(work)
    }

    /// Runs `work` on these threads with a function to ask the calling thread, where `answer` runs: for callbacks,
    /// which belong to the caller's own thread, out of the middle of work. `answer` may use these threads.
    pub fn run_asking<T: Send, Q: Send, A: Send>(
        &self,
        work: impl FnOnce(&dyn Fn(Q) -> A) -> T + Send,
        mut answer: impl FnMut(Q) -> A,
    ) -> T {
        let (ask, asked) = mpsc::channel();
        let (tell, told) = mpsc::channel();
        let mut done = None;
        let slot = &mut done;
        self.pool().in_place_scope(move |scope| {
            scope.spawn(move |_| {
                let ask_caller = |question| {
                    ask.send(question).expect("the caller listens until the work is done");
                    loop {
                        match told.try_recv() {
                            Ok(answer) => return answer,
                            Err(TryRecvError::Disconnected) => panic!("no answer: the caller panicked"),
                            Err(TryRecvError::Empty) => {}
                        }
                        // This may be the only worker, and the caller may need one for the answer.
                        if rayon::yield_now() != Some(rayon::Yield::Executed) {
                            thread::sleep(ANSWER_POLL);
                        }
                    }
                };
                *slot = Some(work(&ask_caller));
            });
            for question in asked {
                // Where it cannot be told, the worker panicked and the scope will say so.
                let _ = tell.send(answer(question));
            }
        });
        done.expect("the scope ends after the work")
    }

    fn pool(&self) -> &rayon::ThreadPool {
        self.pool.as_ref().expect("there until this is dropped")
    }
}

impl Drop for Threads {
    /// Waits for the threads to be gone, which rayon alone does not: a host may unload the library next.
    fn drop(&mut self) {
        drop(self.pool.take());
        for worker in self.workers.drain(..) {
            // A worker that panicked has told the caller whose work it was.
            let _ = worker.join();
        }
    }
}

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
    pub(crate) fn follow(&self, course: Course) {
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
    pub(crate) fn report_end(&self) -> Result<()> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_asks_the_callers_thread_which_may_use_the_worker_meanwhile() {
        for count in [1, 3] {
            let threads = Threads::new(count).unwrap();
            let caller = thread::current().id();
            let work = |ask: &dyn Fn(u32) -> u32| {
                assert_ne!(thread::current().id(), caller);
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
        let threads = Threads::new(1).unwrap();
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

    #[test]
    #[cfg(target_os = "linux")]
    fn the_threads_are_gone_when_the_handle_is() {
        let threads = Threads::new(3).unwrap();
        // Each leaves its number in the system's list of threads.
        let numbers: Vec<std::path::PathBuf> = threads.pool().broadcast(|_| {
            let link = std::fs::read_link("/proc/thread-self").unwrap();
            std::path::Path::new("/proc").join(link)
        });
        assert!(numbers.len() == 3 && numbers.iter().all(|n| n.exists()));
        drop(threads);
        // A thread that was joined runs nothing any more, but is listed until the kernel has buried it.
        let start = std::time::Instant::now();
        while numbers.iter().any(|n| n.exists()) && start.elapsed().as_secs() < 2 {
            thread::yield_now();
        }
        assert!(!numbers.iter().any(|n| n.exists()));
    }
}
