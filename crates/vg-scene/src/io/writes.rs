//! The active writes of this process, for a program that must end during one.
//!
//! The library leaves signals to its program. A handler sets the stop flag and, if the idle flag is set (no temporary
//! file exists), ends the process at once. Otherwise the active writes fail, remove their temporary files, and the
//! program ends on their error. There is no race between the two: a write clears the idle flag before it reads the stop
//! flag, and reads the stop flag again after it has restored the idle flag.

use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// The number of active writes, and the two flags.
#[derive(Debug)]
pub struct Writes {
    stop: Arc<AtomicBool>,
    idle: Arc<AtomicBool>,
    under_way: Mutex<usize>,
}

static OF_PROCESS: LazyLock<Writes> = LazyLock::new(Writes::new);

/// The writes of this process.
pub fn writes() -> &'static Writes {
    &OF_PROCESS
}

impl Writes {
    fn new() -> Self {
        Self {
            stop: Arc::new(AtomicBool::new(false)),
            idle: Arc::new(AtomicBool::new(true)),
            under_way: Mutex::new(0),
        }
    }

    /// Flag that a program sets, permanently, when it must end: active writes fail, and none begins.
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }

    /// Flag that is set while no temporary file exists. Callers must not change it.
    pub fn idle_flag(&self) -> Arc<AtomicBool> {
        self.idle.clone()
    }

    /// Runs `work`, which may create temporary files and must remove them if a write to `Stoppable` fails.
    pub(super) fn run<T>(&self, work: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
        self.count(1);
        // A guard, because `work` may panic.
        let end = End(self);
        let done = self.check().and_then(|()| work());
        drop(end);
        self.check().and(done)
    }

    /// A writer that fails once the stop flag is set.
    pub(super) fn stoppable<W: Write>(&self, inner: W) -> Stoppable<'_, W> {
        Stoppable { writes: self, inner }
    }

    fn check(&self) -> io::Result<()> {
        // Not the kind `Interrupted`, after which `write_all` would retry.
        if self.stop.load(Ordering::SeqCst) { Err(io::Error::other("interrupted")) } else { Ok(()) }
    }

    fn count(&self, change: isize) {
        let mut under_way = self.under_way.lock().unwrap_or_else(PoisonError::into_inner);
        *under_way = under_way.saturating_add_signed(change);
        self.idle.store(*under_way == 0, Ordering::SeqCst);
    }
}

struct End<'a>(&'a Writes);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.count(-1);
    }
}

/// See [`Writes::stoppable`].
pub(super) struct Stoppable<'a, W> {
    writes: &'a Writes,
    inner: W,
}

impl<W: Write> Write for Stoppable<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writes.check()?;
        self.inner.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_stop_active_writes_fail_and_none_begins() {
        let writes = Writes::new();
        let (stop, idle) = (writes.stop_flag(), writes.idle_flag());
        let mut bytes = Vec::new();
        let failed = writes.run(|| {
            assert!(!idle.load(Ordering::SeqCst));
            let mut out = writes.stoppable(&mut bytes);
            out.write_all(b"before")?;
            stop.store(true, Ordering::SeqCst);
            out.write_all(b"after")
        });
        assert_eq!((failed.unwrap_err().to_string().as_str(), &bytes[..]), ("interrupted", &b"before"[..]));
        assert!(idle.load(Ordering::SeqCst));
        assert!(writes.run(|| -> io::Result<()> { panic!("began") }).is_err());
    }

    #[test]
    fn overlapping_writes_are_idle_after_the_last() {
        let writes = Writes::new();
        let idle = writes.idle_flag();
        let inner = || writes.run(|| Ok(()));
        writes.run(|| inner().map(|()| assert!(!idle.load(Ordering::SeqCst)))).unwrap();
        assert!(idle.load(Ordering::SeqCst));
        let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            writes.run(|| -> io::Result<()> { panic!("in the middle") })
        }));
        assert!(panicked.is_err() && idle.load(Ordering::SeqCst));
    }
}
