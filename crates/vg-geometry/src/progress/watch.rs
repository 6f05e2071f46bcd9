//! Long work that the caller watches: it reports its progress and can be stopped from the calling thread.

use super::{Progress, ProgressCallback, Threads};
use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Interval between progress callbacks of watched work: short enough that a person does not notice the delay, long
/// enough that a host with a global lock is not slowed down.
pub const ASKED_EVERY: Duration = Duration::from_millis(50);

/// Progress and stop flag that watched work shares with its caller. Loops poll [`Watch::is_stopped`] and skip the rest;
/// the function around them returns the error of [`Watch::check`].
#[derive(Debug)]
pub struct Watch {
    stage: &'static str,
    is_stopped: AtomicBool,
    /// Bits of the largest fraction reported; the bits of non-negative floats order like the floats.
    fraction: AtomicU64,
}

/// The watch of work that is not watched: it never stops.
pub static UNWATCHED: Watch = Watch::new("");

impl Watch {
    /// Watch of work that has just begun; `stage` is the name reported to the caller.
    pub const fn new(stage: &'static str) -> Self {
        Self { stage, is_stopped: AtomicBool::new(false), fraction: AtomicU64::new(0) }
    }

    /// Requests the work to stop, from any thread.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
    }

    /// Whether a stop was requested.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    /// Returns [`Error::Cancelled`] if a stop was requested.
    pub fn check(&self) -> Result<()> {
        if self.is_stopped() { Err(Error::Cancelled { stage: self.stage }) } else { Ok(()) }
    }

    /// Reports the completed fraction of the work, 0 to 1, and calls [`Watch::check`].
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
    /// Runs `work` on these threads while `callback` is called on the calling thread: at the start, about every
    /// [`ASKED_EVERY`], and with a fraction of 1 at the end. `Break` ends the call with [`Error::Cancelled`] as soon as
    /// the work checks its watch. Where the only thread is the calling one, a second is started for this call.
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
        let done = self.run_while_waiting(
            move || {
                let done = work(watch);
                // It is dropped as well when the work panics.
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
    fn watched_work_is_reported_on_the_calling_thread_and_ends_at_one() {
        let threads = Threads::new(2).unwrap();
        let caller = thread::current().id();
        let mut reports = Vec::new();
        let made = threads.run_watched(
            "test",
            &mut |progress| {
                assert_eq!(thread::current().id(), caller);
                reports.push((progress.stage, progress.fraction, progress.overall));
                ControlFlow::Continue(())
            },
            |watch| {
                assert_ne!(thread::current().id(), caller);
                watch.report(0.5)?;
                // The fraction never decreases.
                watch.report(0.25)?;
                thread::sleep(3 * ASKED_EVERY);
                Ok(7)
            },
        );
        assert_eq!(made.unwrap(), 7);
        assert_eq!((reports[0], reports[reports.len() - 1]), (("test", 0.0, 0.0), ("test", 1.0, 1.0)));
        assert!(
            reports.len() >= 3 && reports[1..reports.len() - 1].iter().all(|r| r.1 == 0.5),
            "{reports:?}"
        );
    }

    #[test]
    fn a_break_at_any_time_stops_the_work() {
        let threads = Threads::new(1).unwrap();
        // Break at the start, while the work runs, and after it.
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
