//! Long work that its caller watches: it tells how far it is, and can be stopped from the calling thread.

use super::{Progress, ProgressCallback, Threads};
use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// How often the caller of watched work is asked whether to go on: a person does not notice the delay, and a host with
/// a global lock is not slowed down by it.
pub const ASKED_EVERY: Duration = Duration::from_millis(50);

/// What watched work tells its caller, and asks. Loops look at [`Watch::is_stopped`] and leave out what is left; the
/// function around them returns the error of [`Watch::check`].
#[derive(Debug)]
pub struct Watch {
    stage: &'static str,
    is_stopped: AtomicBool,
    /// Bits of the largest fraction that was told; those of numbers from 0 on order like the numbers.
    fraction: AtomicU64,
}

/// What work is given that nobody watches: it is never stopped.
pub static UNWATCHED: Watch = Watch::new("");

impl Watch {
    /// Work that has just begun, by the name that its caller is told.
    pub const fn new(stage: &'static str) -> Self {
        Self { stage, is_stopped: AtomicBool::new(false), fraction: AtomicU64::new(0) }
    }

    /// Asks the work to end, from any thread.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
    }

    /// Whether the work is to end.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    /// [`Error::Cancelled`] where the work is to end.
    pub fn check(&self) -> Result<()> {
        if self.is_stopped() { Err(Error::Cancelled { stage: self.stage }) } else { Ok(()) }
    }

    /// Tells which part of the work is done, 0 to 1, and checks.
    pub fn report(&self, fraction: f64) -> Result<()> {
        self.fraction.fetch_max(fraction.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
        self.check()
    }

    fn progress(&self) -> Progress {
        let fraction = f64::from_bits(self.fraction.load(Ordering::Relaxed));
        Progress { stage: self.stage, fraction, overall: fraction, loss: None }
    }
}

impl Threads {
    /// Runs `work` on these threads, while `callback` is called on the calling one: at the start, about every
    /// [`ASKED_EVERY`], and with a fraction of 1 at the end. `Break` ends the call with [`Error::Cancelled`] as soon as
    /// the work looks at its watch. One thread that is the calling one gets a second for this call.
    pub fn run_watched<T: Send>(
        &self,
        stage: &'static str,
        callback: &mut ProgressCallback<'_>,
        work: impl FnOnce(&Watch) -> Result<T> + Send,
    ) -> Result<T> {
        let watch = &Watch::new(stage);
        if callback(watch.progress()).is_break() {
            watch.stop();
            watch.check()?;
        }
        let (running, ended) = mpsc::channel::<()>();
        let done = self.run_beside(
            move || {
                let done = work(watch);
                // Of work that panics it is dropped as well.
                drop(running);
                done
            },
            || {
                while ended.recv_timeout(ASKED_EVERY) == Err(RecvTimeoutError::Timeout) {
                    if !watch.is_stopped() && callback(watch.progress()).is_break() {
                        watch.stop();
                    }
                }
            },
        )?;
        watch.check()?;
        let done = done?;
        if callback(Progress { stage, fraction: 1.0, overall: 1.0, loss: None }).is_break() {
            watch.stop();
        }
        watch.check().map(|()| done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::ControlFlow;
    use std::thread;

    #[test]
    fn watched_work_is_told_of_on_the_calling_thread_and_ends_at_one() {
        let threads = Threads::new(2).unwrap();
        let caller = thread::current().id();
        let mut told = Vec::new();
        let made = threads.run_watched(
            "test",
            &mut |progress| {
                assert_eq!(thread::current().id(), caller);
                told.push((progress.stage, progress.fraction, progress.overall));
                ControlFlow::Continue(())
            },
            |watch| {
                assert_ne!(thread::current().id(), caller);
                watch.report(0.5)?;
                // Never back.
                watch.report(0.25)?;
                thread::sleep(3 * ASKED_EVERY);
                Ok(7)
            },
        );
        assert_eq!(made.unwrap(), 7);
        assert_eq!((told[0], told[told.len() - 1]), (("test", 0.0, 0.0), ("test", 1.0, 1.0)));
        assert!(told.len() >= 3 && told[1..told.len() - 1].iter().all(|t| t.1 == 0.5), "{told:?}");
    }

    #[test]
    fn a_break_at_any_time_stops_the_work() {
        let threads = Threads::new(1).unwrap();
        // At the start, while the work goes on, and after it.
        for (calls, goes_on) in [(0, true), (1, true), (1, false)] {
            let (mut left, mut rounds) = (calls, 0);
            let ended = threads.run_watched(
                "test",
                &mut |_| {
                    left -= 1;
                    if left < 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                },
                |watch| {
                    while goes_on && !watch.is_stopped() {
                        rounds += 1;
                        thread::sleep(Duration::from_millis(1));
                    }
                    Ok(())
                },
            );
            assert!(matches!(ended, Err(Error::Cancelled { stage: "test" })), "{calls}: {ended:?}");
            assert_eq!(rounds > 0, calls == 1 && goes_on);
        }
    }
}
