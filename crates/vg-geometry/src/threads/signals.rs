//! Signals of the process belong to the host: its handlers must run on its own threads, not on the library's workers.

/// Runs `start`, which starts threads, with all signals blocked except those of a thread's own faults. The new threads
/// inherit this mask; the calling thread's own is restored.
#[cfg(unix)]
pub fn blocked<T>(start: impl FnOnce() -> T) -> T {
    use nix::sys::signal::{SigSet, SigmaskHow, Signal};

    /// Restores a thread's mask on drop, also during a panic.
    struct Restore(SigSet);
    impl Drop for Restore {
        fn drop(&mut self) {
            // It was this thread's mask before.
            let _ = self.0.thread_set_mask();
        }
    }

    let mut all = SigSet::all();
    // Where these are blocked, a thread that causes one ends the process without the host's crash handler.
    for fault in [
        Signal::SIGSEGV,
        Signal::SIGBUS,
        Signal::SIGFPE,
        Signal::SIGILL,
        Signal::SIGTRAP,
        Signal::SIGABRT,
        Signal::SIGSYS,
    ] {
        all.remove(fault);
    }
    let _restore = all.thread_swap_mask(SigmaskHow::SIG_BLOCK).ok().map(Restore);
    start()
}

/// Runs `start`: there are no signals to block.
#[cfg(not(unix))]
pub fn blocked<T>(start: impl FnOnce() -> T) -> T {
    start()
}

/// The blocked signals of the calling thread, as the system lists them: bit n - 1 is signal n.
#[cfg(all(test, target_os = "linux"))]
pub(super) fn mask_of_this_thread() -> u64 {
    let status = std::fs::read_to_string("/proc/thread-self/status").expect("the system's list");
    let mask = status.lines().find_map(|line| line.strip_prefix("SigBlk:")).expect("the mask");
    u64::from_str_radix(mask.trim(), 16).expect("a hexadecimal number")
}
