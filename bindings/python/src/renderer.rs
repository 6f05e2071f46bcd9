//! `Renderer`: Gaussians made ready to be drawn many times, by the CPU or a graphics processor.

use crate::camera::Camera;
use crate::errors::{bad_value, detached, pooled};
use crate::gaussians::{Gaussians, parse_background, picture};
use pyo3::prelude::*;
use std::sync::Arc;
use vg::render::{AssetRenderer, Backend, Background, RenderOptions, Rgba8};

/// Gaussians made ready to be drawn many times. backend is "auto", a graphics processor where this build and this
/// machine have one and there are 20,000 Gaussians or more, else the CPU; "cpu"; or "gpu", an error without. Under
/// "auto" the CPU goes on should the device fail.
#[pyclass(module = "vehicle_gaussians", frozen)]
pub(crate) struct Renderer {
    ready: AssetRenderer,
}

#[pymethods]
impl Renderer {
    #[new]
    #[pyo3(signature = (gaussians, backend="auto"))]
    fn new(gaussians: &Bound<'_, Gaussians>, backend: &str) -> PyResult<Self> {
        let py = gaussians.py();
        let backend = chosen(py, "backend", backend)?;
        let shared = Arc::clone(&gaussians.get().inner);
        Ok(Self { ready: detached(py, || AssetRenderer::new(shared, backend))? })
    }

    /// Who draws: "cpu" or "gpu".
    #[getter]
    fn backend(&self) -> &'static str {
        if self.ready.choice().backend == Backend::Gpu { "gpu" } else { "cpu" }
    }

    /// Who draws, and why.
    #[getter]
    fn choice(&self) -> String {
        self.ready.choice().to_string()
    }

    /// The picture a camera takes: uint8 (height, width, 3), or (height, width, 4) with straight alpha on a
    /// "transparent" background. Arguments are those of Gaussians.render.
    #[pyo3(signature = (
        camera, background=None, threads=0, *, antialiased=false, near=0.01, far=1e10, sh_degree=3
    ), text_signature = "(self, camera, background='white', threads=0, *, antialiased=False, near=0.01, far=1e10, \
        sh_degree=3)")]
    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: &Bound<'py, Camera>,
        background: Option<&Bound<'py, PyAny>>,
        threads: usize,
        antialiased: bool,
        near: f32,
        far: f32,
        sh_degree: u8,
    ) -> PyResult<Bound<'py, PyAny>> {
        let background = background.map_or(Ok(Background::Color([1.0; 3])), parse_background)?;
        let options =
            RenderOptions { background, antialiased, near, far, sh_degree, ..RenderOptions::default() };
        let camera = &camera.get().inner;
        let mut drawn = Rgba8::default();
        pooled(py, threads, || self.ready.render_rgba8(camera, &options, &mut drawn))?;
        let size = (camera.height as usize, camera.width as usize);
        let rgb = |&[r, g, b, _]: &[u8; 4]| [r, g, b];
        Ok(match background {
            Background::Color(_) => picture(py, size, drawn.pixels.iter().map(rgb).collect()),
            Background::Transparent => picture(py, size, drawn.pixels),
        })
    }

    fn __repr__(&self) -> String {
        format!("Renderer({})", self.ready.choice())
    }
}

/// Who is asked to draw, of an argument of this name.
pub(crate) fn chosen(py: Python<'_>, argument: &str, backend: &str) -> PyResult<Backend> {
    match backend {
        "auto" => Ok(Backend::Auto),
        "cpu" => Ok(Backend::Cpu),
        "gpu" => Ok(Backend::Gpu),
        other => Err(bad_value(py, argument, &format!("{other:?}"), "auto, cpu, gpu")),
    }
}
