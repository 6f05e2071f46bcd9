//! Calls without the GIL; errors and panics become `VgError`.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};
/// Numbers of `vehicle_gaussians.Status`.
pub(crate) use vg::error::Status;
use vg::geometry::Choice;
use vg::progress::Threads;

/// Text and place of the last panic, because its payload does not contain the place.
static LAST_PANIC: Mutex<Option<(String, String)>> = Mutex::new(None);

/// Makes a `vehicle_gaussians.VgError` of the subclass of its status.
pub(crate) fn vg_error(py: Python<'_>, status: Status, message: impl Into<String>) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    // Not made by PyErr::from_type, which would use exactly this class instead of its subclass.
    let class = CLASS.import(py, "vehicle_gaussians._errors", "VgError");
    match class.and_then(|class| class.call1((status as i32, message.into()))) {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}

/// The error of an argument of the right kind with a value that is not accepted.
pub(crate) fn bad_value(py: Python<'_>, argument: &str, found: &str, allowed: &str) -> PyErr {
    vg_error(py, Status::Argument, format!("{argument}: {found}; allowed: {allowed}"))
}

/// Parses a choice by its name; `argument` names it in errors.
pub(crate) fn choice<T: Choice>(py: Python<'_>, argument: &str, name: &str) -> PyResult<T> {
    T::from_name(argument, name).map_err(|e| from_library(py, e))
}

/// The error of an argument of the wrong kind.
pub(crate) fn bad_type(argument: &str, found: &str, allowed: &str) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let message = format!("{argument}: {found}; allowed: {allowed}");
    Python::attach(|py| match CLASS.import(py, "vehicle_gaussians._errors", "ArgumentTypeError") {
        Ok(class) => PyErr::from_type(class.clone(), (Status::Argument as i32, message)),
        Err(error) => error,
    })
}

/// Renames the argument of an error from the library's name, `from`, to Python's name, `to`.
pub(crate) fn renamed(error: vg::Error, from: &str, to: &str) -> vg::Error {
    match error {
        vg::Error::Argument { argument, found, allowed } => {
            vg::Error::argument(argument.replacen(from, to, 1), found, allowed)
        }
        other => other,
    }
}

/// The library's error with the arguments' names in Python.
pub(crate) fn from_library(py: Python<'_>, error: vg::Error) -> PyErr {
    let status = error.status();
    let message = match error {
        vg::Error::Argument { argument, found, allowed } => {
            let argument = argument.strip_prefix("options.").unwrap_or(&argument);
            let argument = argument.replace("rotations", "quats").replace("budget_s", "budget");
            let argument = argument.replace("f_score_m", "f_score");
            format!("{}; allowed: {allowed}", [&argument, &*found].join(": "))
        }
        vg::Error::NotBuilt { argument, found, remedy } => {
            let argument = argument.strip_prefix("options.").unwrap_or(&argument).to_owned();
            vg::Error::NotBuilt { argument, found, remedy }.to_string()
        }
        other => other.to_string(),
    };
    vg_error(py, status, message)
}

/// Runs `work` without the GIL.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> vg::Result<T> + Send) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(from_library(py, error)),
        Err(panic) => Err(vg_error(py, Status::Internal, describe(panic.as_ref()))),
    }
}

/// Runs `work` without the GIL, with `threads` worker threads that end with it; 0 means one per core.
pub(crate) fn pooled<T: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce() -> vg::Result<T> + Send,
) -> PyResult<T> {
    detached(py, || Threads::new(threads)?.run(work))
}

/// Prevents panics from printing: they are caught, and the exception contains their text.
pub(crate) fn keep_panics_quiet() {
    // The extension module has its own standard library, so this hook only sees its own panics.
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = Some((text(info.payload()), place));
    }));
}

fn describe(payload: &(dyn Any + Send)) -> String {
    let text = text(payload);
    let last = LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner).take();
    match last {
        Some((same, place)) if same == text => format!("internal error: {text} ({place})"),
        _ => format!("internal error: {text}"),
    }
}

fn text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref().map(String::as_str)).unwrap_or("panic").to_owned()
}

/// Panics, so that tests can check how a defect of the library is reported.
#[pyfunction]
#[pyo3(name = "_panic_on_a_worker_thread")]
pub(crate) fn panic_on_a_worker_thread(py: Python<'_>) -> PyResult<()> {
    pooled(py, 1, || panic!("made for a test"))
}
