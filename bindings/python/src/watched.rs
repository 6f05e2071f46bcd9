//! Long calls, which end at Ctrl-C and report their progress to the caller's function.

use crate::errors::detached;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyFunction;
use std::ops::ControlFlow;
use vg::progress::{Progress, Threads, Watch};

/// The caller's progress function, wrapped by `vehicle_gaussians._progress`; `None` if there is none.
pub(crate) struct ProgressFunction(Option<Py<PyAny>>);

impl ProgressFunction {
    pub(crate) fn new(progress: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        static WRAP: PyOnceLock<Py<PyFunction>> = PyOnceLock::new();
        let function = progress.map(|function| {
            let wrap = WRAP.import(function.py(), "vehicle_gaussians._progress", "wrapped")?;
            wrap.call1((function,)).map(Bound::unbind)
        });
        Ok(Self(function.transpose()?))
    }

    /// Reports progress and returns whether to go on. An exception of the function or of a signal handler is stored in
    /// `raised` and ends the call.
    pub(crate) fn report(&self, state: Progress, raised: &mut Option<PyErr>) -> ControlFlow<()> {
        match Python::attach(|py| self.continues(py, state)) {
            Ok(true) => ControlFlow::Continue(()),
            Ok(false) => ControlFlow::Break(()),
            Err(error) => {
                *raised = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    fn continues(&self, py: Python<'_>, state: Progress) -> PyResult<bool> {
        py.check_signals()?;
        match &self.0 {
            None => Ok(true),
            Some(function) => {
                function.bind(py).call1((state.stage, state.fraction, state.overall))?.is_truthy()
            }
        }
    }
}

/// Runs `work` without the GIL, with `threads` worker threads that end with it; 0 means one per core. The calling
/// thread reports to `progress` and checks for signals.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    threads: usize,
    stage: &'static str,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> vg::Result<T> + Send,
) -> PyResult<T> {
    let function = ProgressFunction::new(progress)?;
    let mut raised = None;
    let made = detached(py, || {
        let mut report = |state: Progress| function.report(state, &mut raised);
        Threads::new(threads)?.run_watched(stage, &mut report, work)
    });
    raised.map_or(made, Err)
}
