//! Long calls: they end at Ctrl-C, and tell the caller's function how far they are.

use crate::errors::detached;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyFunction;
use std::ops::ControlFlow;
use vg::progress::{Progress, Threads, Watch};

/// The caller's function, as `vehicle_gaussians._progress` asks it; `None` where there is none.
pub(crate) struct Teller(Option<Py<PyAny>>);

impl Teller {
    pub(crate) fn new(progress: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        static TELLER: PyOnceLock<Py<PyFunction>> = PyOnceLock::new();
        let told = progress.map(|function| {
            let teller = TELLER.import(function.py(), "vehicle_gaussians._progress", "teller")?;
            teller.call1((function,)).map(Bound::unbind)
        });
        Ok(Self(told.transpose()?))
    }

    /// Whether to go on. What the caller's function or a signal handler raises is kept in `raised`, and the end.
    pub(crate) fn tell(&self, state: Progress, raised: &mut Option<PyErr>) -> ControlFlow<()> {
        match Python::attach(|py| self.goes_on(py, state)) {
            Ok(true) => ControlFlow::Continue(()),
            Ok(false) => ControlFlow::Break(()),
            Err(error) => {
                *raised = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    fn goes_on(&self, py: Python<'_>, state: Progress) -> PyResult<bool> {
        py.check_signals()?;
        match &self.0 {
            None => Ok(true),
            Some(teller) => teller.bind(py).call1((state.stage, state.fraction, state.overall))?.is_truthy(),
        }
    }
}

/// Runs `work` without the GIL, with `threads` worker threads that end with it; 0 means one per core. This thread tells
/// `progress` of it and listens for signals.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    threads: usize,
    stage: &'static str,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> vg::Result<T> + Send,
) -> PyResult<T> {
    let teller = Teller::new(progress)?;
    let mut raised = None;
    let made = detached(py, || {
        let mut tell = |state: Progress| teller.tell(state, &mut raised);
        Threads::new(threads)?.run_watched(stage, &mut tell, work)
    });
    raised.map_or(made, Err)
}
