//! Termination from outside: a signal, or the end of the parent process. No temporary file stays behind, and the exit
//! code names the signal.

use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::Duration;
use vg::io::writes;

/// A shell reports a process that was ended by a signal as this plus the signal's number.
const BY_SIGNAL: usize = 128;

/// SIGHUP, also used when the parent process has ended.
const HANG_UP: usize = 1;

/// 0, or the code to exit with.
static CODE: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);

/// The exit code after an interruption; `None` without one.
pub(crate) fn code() -> Option<ExitCode> {
    let code = CODE.load(Ordering::SeqCst);
    (code != 0).then(|| ExitCode::from(u8::try_from(code).unwrap_or(u8::MAX)))
}

/// Makes INT, TERM and HUP end the program: at once where no temporary file exists, else as soon as the writes in
/// progress have stopped and removed theirs. A file that exceeds its size limit becomes an error, not a termination.
#[cfg(unix)]
pub(crate) fn watch() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::flag;
    for signal in [SIGHUP, SIGINT, SIGTERM] {
        if is_ignored(signal) {
            continue;
        }
        let code = BY_SIGNAL as i32 + signal;
        // The order matters: the code is set before the stop flag, and immediate shutdown comes last. If a handler
        // cannot be registered, the signal keeps its default effect.
        let _ = flag::register_usize(signal, CODE.clone(), code as usize)
            .and_then(|_| flag::register(signal, writes().stop_flag()))
            .and_then(|_| flag::register_conditional_shutdown(signal, code, writes().idle_flag()));
    }
    let _ = flag::register(SIGXFSZ, Arc::default());
}

#[cfg(not(unix))]
pub(crate) fn watch() {}

/// Whether the signal was ignored by the parent, as `nohup` does; `false` where the system does not report it.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Ends the program when its standard input ends: the parent holds the other end of that pipe, and the system closes it
/// in whatever way the parent ends.
pub(crate) fn end_with_input() {
    let watch = || {
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        let code = BY_SIGNAL + HANG_UP;
        CODE.store(code, Ordering::SeqCst);
        writes().stop_flag().store(true, Ordering::SeqCst);
        while !writes().idle_flag().load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::process::exit(code as i32)
    };
    let _ = std::thread::Builder::new().name("parent".into()).spawn(watch);
}
