//! The panic guard: a panic becomes a status with its message and place; it never unwinds into C, and never prints.

use super::status::{vg_error, vg_status};
use std::any::Any;
use std::cell::Cell;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::sync::{Mutex, Once, PoisonError};
use vg::Error;
use vg::threads::THREAD_NAME;

/// Failure of a function of the C interface.
pub(super) enum Failure {
    /// The library returned an error.
    Refused(Error),
    /// The library has a bug.
    Panicked(String),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Refused(error)
    }
}

/// Runs the body of a function that returns a status. `*out_error` is NULL afterwards unless it failed.
pub(super) unsafe fn guarded(
    out_error: *mut *mut vg_error,
    body: impl FnOnce() -> Result<(), Error>,
) -> vg_status {
    let _errno = Errno::kept();
    unsafe { clear(out_error) };
    let Err(failure) = caught(body).and_then(|done| done.map_err(Failure::from)) else {
        return vg_status::Ok;
    };
    // Allocating the error object may itself fail, which aborts the process.
    let error = vg_error::new(failure);
    let status = error.status();
    if out_error.is_null() {
        drop(error);
    } else {
        unsafe { out_error.write(error.into_raw()) };
    }
    status
}

/// Runs the body of a function that returns a value and fails only by a bug; returns `fallback` if it panics.
pub(super) fn guarded_value<T>(fallback: T, body: impl FnOnce() -> T) -> T {
    let _errno = Errno::kept();
    caught(body).unwrap_or(fallback)
}

/// Sets an out parameter to NULL, if there is one.
pub(super) unsafe fn clear<T>(out: *mut *mut T) {
    if !out.is_null() {
        unsafe { out.write(std::ptr::null_mut()) };
    }
}

/// Frees the `T` that a handle points to; does nothing for NULL.
pub(super) unsafe fn free<T>(handle: *mut T) {
    guarded_value((), || {
        if !handle.is_null() {
            drop(unsafe { Box::from_raw(handle) });
        }
    });
}

/// Restores errno when dropped: the library's system calls must not change the caller's errno.
struct Errno {
    #[cfg(unix)]
    was: i32,
}

impl Errno {
    fn kept() -> Self {
        Self {
            #[cfg(unix)]
            was: nix::errno::Errno::last_raw(),
        }
    }
}

impl Drop for Errno {
    fn drop(&mut self) {
        #[cfg(unix)]
        nix::errno::Errno::set_raw(self.was);
    }
}

fn caught<T>(body: impl FnOnce() -> T) -> Result<T, Failure> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = take_hook();
        set_hook(Box::new(move |info| if is_ours() { remember(info) } else { previous(info) }));
    });
    let _inside = Inside::enter();
    let body = AssertUnwindSafe(body);
    catch_unwind(|| {
        #[cfg(test)]
        injection::fire();
        // Captures the whole wrapper instead of the closure inside it.
        let body = body;
        (body.0)()
    })
    .map_err(|payload| Failure::Panicked(described(payload.as_ref())))
}

thread_local! {
    /// Number of guards around the current code on this thread: a callback may call the library again.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

struct Inside;

impl Inside {
    fn enter() -> Self {
        DEPTH.set(DEPTH.get() + 1);
        Self
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        DEPTH.set(DEPTH.get() - 1);
    }
}

/// Whether a panic on this thread will reach a guard: the thread is inside one, or is a worker of one that is.
fn is_ours() -> bool {
    DEPTH.get() > 0 || std::thread::current().name().is_some_and(|name| name.starts_with(THREAD_NAME))
}

/// Places of panics that have not reached their guard yet, message first. A panic on a worker thread is carried to the
/// caller's thread with its message but without its place.
static PLACES: Mutex<VecDeque<(String, String)>> = Mutex::new(VecDeque::new());

/// Largest number of remembered places; more panics at once make the oldest lose its place.
const MAX_PLACES: usize = 64;

fn remember(info: &PanicHookInfo<'_>) {
    let Some(place) = info.location() else { return };
    let mut places = PLACES.lock().unwrap_or_else(PoisonError::into_inner);
    places.truncate(MAX_PLACES - 1);
    places.push_front((message(info.payload()), place.to_string()));
}

fn described(payload: &(dyn Any + Send)) -> String {
    let message = message(payload);
    let mut places = PLACES.lock().unwrap_or_else(PoisonError::into_inner);
    let place = places.iter().position(|(m, _)| *m == message).and_then(|i| places.remove(i));
    match place {
        Some((_, place)) => format!("bug in libvg, please report it: {message} ({place})"),
        None => format!("bug in libvg, please report it: {message}"),
    }
}

fn message(payload: &(dyn Any + Send)) -> String {
    match (payload.downcast_ref::<&str>(), payload.downcast_ref::<String>()) {
        (Some(text), _) => (*text).to_owned(),
        (_, Some(text)) => text.clone(),
        _ => "panic without a message".to_owned(),
    }
}

/// Lets a test make the next guarded body panic.
#[cfg(test)]
pub(super) mod injection {
    use std::cell::Cell;

    thread_local! {
        static ARMED: Cell<bool> = const { Cell::new(false) };
    }

    pub(in crate::capi) fn arm() {
        ARMED.set(true);
    }

    pub(in crate::capi) fn is_armed() -> bool {
        ARMED.get()
    }

    pub(super) fn fire() {
        assert!(!ARMED.replace(false), "injected");
    }
}
