//! Status codes of functions, and the error object with the message.

use super::guard::{Failure, free, guarded_value};
use std::ffi::{CStr, CString, c_char};
use vg::Error;

/// What a function returns. Numbers are never reused; later versions may add some, so treat an unknown one as a
/// failure.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_status {
    /// Done.
    Ok = 0,
    /// An argument is outside what the function accepts.
    Argument = 1,
    /// A file's content is not what its format promises.
    Format = 2,
    /// The operating system refused a file operation.
    Io = 3,
    /// The input is well formed, but no vehicle can be made of it.
    Reconstruction = 4,
    /// The progress callback asked to stop.
    Cancelled = 5,
    /// This build of the library was made without what was asked for.
    NotBuilt = 6,
    /// A bug in the library. The call had no effect; other handles are as they were.
    Internal = 7,
    /// What was asked for needs something that this machine does not have: ONNX Runtime, a device.
    Missing = 8,
    /// The operating system did not start the threads that were asked for.
    Threads = 9,
}

/// Why a call failed. Owned by the caller, who frees it with `vg_error_free`; it never changes, and any thread may
/// read it.
pub struct vg_error {
    _private: [u8; 0],
}

/// Type that a `vg_error` points to.
pub(super) struct ErrorObject {
    status: vg_status,
    message: CString,
}

impl vg_error {
    // Named after the handle, where readers look for it.
    #[allow(clippy::new_ret_no_self)]
    pub(super) fn new(failure: Failure) -> ErrorObject {
        let (status, message) = match failure {
            Failure::Panicked(message) => (vg_status::Internal, message),
            Failure::Refused(error) => (vg_status::from(&error), error.to_string()),
        };
        ErrorObject { status, message: c_string(one_line(&message)) }
    }
}

impl ErrorObject {
    pub(super) fn status(&self) -> vg_status {
        self.status
    }

    pub(super) fn into_raw(self) -> *mut vg_error {
        Box::into_raw(Box::new(self)).cast()
    }
}

impl From<&Error> for vg_status {
    fn from(error: &Error) -> Self {
        Self::ALL[error.status() as usize]
    }
}

/// A message on one line: quoted names and paths, and panic messages, may contain line breaks.
pub(super) fn one_line(text: &str) -> String {
    let escaped = |c: char| match c.is_control() {
        true => c.escape_default().collect::<String>(),
        false => c.into(),
    };
    text.chars().map(escaped).collect()
}

/// Text for C; a NUL inside, which a message may quote, becomes U+FFFD.
pub(super) fn c_string(text: String) -> CString {
    CString::new(text).unwrap_or_else(|e| {
        let text = String::from_utf8_lossy(&e.into_vec()).replace('\0', "\u{fffd}");
        CString::new(text).unwrap_or_default()
    })
}

impl vg_status {
    const ALL: [Self; 10] = [
        Self::Ok,
        Self::Argument,
        Self::Format,
        Self::Io,
        Self::Reconstruction,
        Self::Cancelled,
        Self::NotBuilt,
        Self::Internal,
        Self::Missing,
        Self::Threads,
    ];

    /// The status's name in C.
    fn name(self) -> &'static CStr {
        match self {
            Self::Ok => c"VG_STATUS_OK",
            Self::Argument => c"VG_STATUS_ARGUMENT",
            Self::Format => c"VG_STATUS_FORMAT",
            Self::Io => c"VG_STATUS_IO",
            Self::Reconstruction => c"VG_STATUS_RECONSTRUCTION",
            Self::Cancelled => c"VG_STATUS_CANCELLED",
            Self::NotBuilt => c"VG_STATUS_NOT_BUILT",
            Self::Internal => c"VG_STATUS_INTERNAL",
            Self::Missing => c"VG_STATUS_MISSING",
            Self::Threads => c"VG_STATUS_THREADS",
        }
    }
}

/// The name of a `vg_status`: `VG_STATUS_ARGUMENT` for 1. A number that this library does not know: an empty string. Never
/// NULL; lives for ever.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_status_name(status: i32) -> *const c_char {
    guarded_value(c"".as_ptr(), || {
        let known = vg_status::ALL.into_iter().find(|known| *known as i32 == status);
        known.map_or(c"", vg_status::name).as_ptr()
    })
}

unsafe fn object<'a>(error: *const vg_error) -> Option<&'a ErrorObject> {
    unsafe { error.cast::<ErrorObject>().as_ref() }
}

/// The status of the call that made this error. NULL: `VG_STATUS_OK`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_error_code(error: *const vg_error) -> vg_status {
    guarded_value(vg_status::Internal, || unsafe { object(error) }.map_or(vg_status::Ok, |e| e.status))
}

/// What went wrong in one line of UTF-8: the argument, what was found, what is allowed. Lives as long as the error.
/// NULL: an empty string. Never NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_error_message(error: *const vg_error) -> *const c_char {
    guarded_value(c"".as_ptr(), || unsafe { object(error) }.map_or(c"".as_ptr(), |e| e.message.as_ptr()))
}

/// Frees an error. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_error_free(error: *mut vg_error) {
    unsafe { free(error.cast::<ErrorObject>()) }
}
