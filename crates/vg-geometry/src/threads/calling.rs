//! A pool of one whose worker is the calling thread: no thread is started, and rayon inside it uses no other.
//!
//! rayon allows a worker's loop to run on any thread. Here that is the calling thread; the loop runs one job and ends.
//! The pool costs a few microseconds.

use scoped_tls_hkt::scoped_thread_local;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

scoped_thread_local!(static mut WORK: for<'a> &'a mut dyn FnMut());

/// Runs `work` on the calling thread, in a pool of this thread alone; on a worker of a pool, in that pool.
pub(super) fn run<T>(work: impl FnOnce() -> T) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    let mut worker = None;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .spawn_handler(|builder| {
            worker = Some(builder);
            Ok(())
        })
        .build();
    let (Ok(pool), Some(worker)) = (pool, worker) else {
        unreachable!("building this pool makes no system call that can fail");
    };
    // A pool's job must own its data, so it reaches the borrowed work through a thread-local.
    pool.spawn(|| WORK.with(|work| work()));
    // The worker's loop runs until the pool is dropped and its jobs are done.
    drop(pool);

    let mut work = Some(work);
    let mut done = None;
    let mut once = || done = work.take().map(|work| catch_unwind(AssertUnwindSafe(work)));
    WORK.set(&mut once, || worker.run());
    match done.expect("the worker's loop ends after its job") {
        Ok(value) => value,
        Err(panic) => resume_unwind(panic),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::thread;

    #[test]
    fn all_work_stays_on_the_calling_thread() {
        let caller = thread::current().id();
        let on = run(|| {
            assert_eq!(rayon::current_num_threads(), 1);
            let (a, b) = rayon::join(|| thread::current().id(), || run(|| thread::current().id()));
            let mut all: Vec<_> = (0..1000).into_par_iter().map(|_| thread::current().id()).collect();
            all.extend([a, b]);
            all
        });
        assert!(on.iter().all(|id| *id == caller));
        assert_eq!(rayon::current_thread_index(), None, "the thread is no longer a worker");
    }

    #[test]
    fn a_call_from_a_pools_worker_runs_in_that_pool() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(pool.install(|| run(rayon::current_num_threads)), 3);
    }

    #[test]
    fn a_panic_passes_through_and_the_next_call_works() {
        let panic = catch_unwind(|| run(|| rayon::join(|| (), || panic!("mine")))).unwrap_err();
        assert_eq!(*panic.downcast::<&str>().unwrap(), "mine");
        assert_eq!(run(|| 7), 7);
    }
}
