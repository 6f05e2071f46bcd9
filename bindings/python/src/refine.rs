//! Optimisation of existing Gaussians against photographs.

use crate::errors::{bad_value, choice, detached, from_library};
use crate::gaussians::Gaussians;
use crate::reconstruct::read_scene;
use crate::watched::ProgressFunction;
use crate::whole;
use pyo3::prelude::*;
use vg::progress::Progress;
use vg::refine::{Amount, Densify, RefineOptions};

/// The Gaussians, and the report as JSON.
#[pyfunction]
#[pyo3(signature = (
    gaussians, images, masks, cameras, depths, names, iterations, seconds, hold_out, densify, backend, threads, progress
))]
pub(crate) fn refine(
    py: Python<'_>,
    gaussians: &Bound<'_, Gaussians>,
    images: Vec<Bound<'_, PyAny>>,
    masks: Vec<Bound<'_, PyAny>>,
    cameras: Vec<Bound<'_, PyAny>>,
    depths: Vec<Bound<'_, PyAny>>,
    names: Vec<String>,
    #[pyo3(from_py_with = whole::iterations)] iterations: Option<u32>,
    seconds: Option<f64>,
    hold_out: bool,
    densify: bool,
    backend: &str,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Gaussians, String)> {
    let amount = match (iterations, seconds) {
        (Some(0), _) => return Err(bad_value(py, "iterations", "0", "1 to 1000000")),
        (Some(steps), None) => Amount::Iterations(steps),
        (None, Some(seconds)) => Amount::Seconds(seconds),
        (None, None) => RefineOptions::default().amount,
        (Some(steps), Some(seconds)) => {
            let found = format!("{seconds}, with iterations {steps}");
            return Err(bad_value(py, "seconds", &found, "only one of the two"));
        }
    };
    let densify = densify.then(Densify::for_refinement);
    let backend = choice(py, "backend", backend)?;
    let options = RefineOptions { amount, hold_out, densify, backend, ..RefineOptions::default() };
    let named = |error| match error {
        vg::Error::Argument { argument, found, allowed } => {
            vg::Error::argument(argument.trim_start_matches("options.refine."), found, allowed)
        }
        other => other,
    };
    // Checked before the pixels are copied.
    options.validate().map_err(|e| from_library(py, named(e)))?;
    let scene = read_scene(py, &images, Some(&masks), &cameras, Some(&depths), Some(names))?;
    let gaussians = &gaussians.get().inner;
    let function = ProgressFunction::new(progress)?;
    let mut raised = None;
    let made = detached(py, || {
        let mut report = |state: Progress| function.report(state, &mut raised);
        let (refined, done) = vg::refine::model(gaussians, &scene, &options, threads, &mut report)?;
        Ok((refined, serde_json::to_string(&done).unwrap_or_default()))
    });
    if let Some(error) = raised {
        return Err(error);
    }
    let (refined, done) = made?;
    Ok((Gaussians::new(refined), done))
}
