//! `Renderer`: Gaussians prepared for rendering many times, on the CPU or a GPU.

use crate::camera::Camera;
use crate::errors::{choice, detached};
use crate::gaussians::{Gaussians, parse_background, picture};
use crate::parts::stays_here;
use crate::watched::watched;
use crate::whole;
use pyo3::prelude::*;
use std::sync::Arc;
use vg::render::{AssetRenderer, Backend, Background, RenderOptions, Rgba8};

/// Gaussians prepared for rendering many times. backend is "auto", a GPU if this build and this machine have one
/// and there are 20,000 Gaussians or more, else the CPU; "cpu"; or "gpu", an error if there is none. With "auto"
/// the CPU takes over if the GPU fails.
///
///     >>> ready = Renderer(car, "cpu")
///     >>> pictures = [ready.render(camera) for camera in cameras]
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
        let backend = choice(py, "backend", backend)?;
        let shared = Arc::clone(&gaussians.get().inner);
        Ok(Self { ready: detached(py, || AssetRenderer::new(shared, backend))? })
    }

    /// The renderer that was chosen: "cpu" or "gpu".
    #[getter]
    fn backend(&self) -> &'static str {
        if self.ready.choice().backend == Backend::Gpu { "gpu" } else { "cpu" }
    }

    /// The renderer that was chosen, and why.
    #[getter]
    fn choice(&self) -> String {
        self.ready.choice().to_string()
    }

    /// Renders a camera's picture: uint8 (height, width, 3), or (height, width, 4) with straight alpha on a
    /// "transparent" background. Arguments are those of Gaussians.render.
    ///
    ///     >>> picture = Renderer(car).render(camera, "transparent")
    #[pyo3(signature = (
        camera, background=None, threads=0, *, antialiased=false, near=0.01, far=1e10, sh_degree=3
    ), text_signature = "(self, camera, background='white', threads=0, *, antialiased=False, near=0.01, far=1e10, \
        sh_degree=3)")]
    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: &Bound<'py, Camera>,
        background: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = whole::threads)] threads: usize,
        antialiased: bool,
        near: f32,
        far: f32,
        #[pyo3(from_py_with = whole::sh_degree)] sh_degree: u8,
    ) -> PyResult<Bound<'py, PyAny>> {
        let options = options(background, antialiased, [near, far], sh_degree)?;
        let camera = &camera.get().inner;
        let mut drawn = Rgba8::default();
        watched(py, threads, "render", None, |watch| {
            self.ready.render_into_watched(camera, &options, &mut drawn, watch)
        })?;
        Ok(array(py, camera, &options, drawn.pixels))
    }

    /// Renders the pictures of several cameras; returns a list of the results of render. A GPU draws a picture while
    /// the previous one is copied. progress is as for reconstruct, with the single stage "render".
    ///
    ///     >>> pictures = Renderer(car).render_many(cameras)
    #[pyo3(signature = (
        cameras, background=None, threads=0, *, antialiased=false, near=0.01, far=1e10, sh_degree=3, progress=None
    ), text_signature = "(self, cameras, background='white', threads=0, *, antialiased=False, near=0.01, far=1e10, \
        sh_degree=3, progress=None)")]
    fn render_many<'py>(
        &self,
        py: Python<'py>,
        cameras: Vec<Bound<'py, Camera>>,
        background: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = whole::threads)] threads: usize,
        antialiased: bool,
        near: f32,
        far: f32,
        #[pyo3(from_py_with = whole::sh_degree)] sh_degree: u8,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let options = options(background, antialiased, [near, far], sh_degree)?;
        let cameras: Vec<_> = cameras.iter().map(|camera| camera.get().inner).collect();
        let mut drawn = Vec::with_capacity(cameras.len());
        watched(py, threads, "render", progress, |watch| {
            self.ready.render_each_watched(&cameras, &options, &mut Rgba8::default(), watch, |_, picture| {
                drawn.push(picture.pixels.clone());
                Ok(())
            })
        })?;
        Ok(cameras.iter().zip(drawn).map(|(camera, pixels)| array(py, camera, &options, pixels)).collect())
    }

    fn __reduce__(&self) -> PyResult<()> {
        let way_out = "another process must make a new one from the Gaussians: Renderer(gaussians, backend)";
        Err(stays_here("Renderer", "working memory of this process", way_out))
    }

    fn __repr__(&self) -> String {
        format!("Renderer({})", self.ready.choice())
    }
}

fn options(
    background: Option<&Bound<'_, PyAny>>,
    antialiased: bool,
    [near, far]: [f32; 2],
    sh_degree: u8,
) -> PyResult<RenderOptions> {
    let background = background.map_or(Ok(Background::Color([1.0; 3])), parse_background)?;
    Ok(RenderOptions { background, antialiased, near, far, sh_degree, ..RenderOptions::default() })
}

/// uint8 (height, width, 3), or 4 on a transparent background.
fn array<'py>(
    py: Python<'py>,
    camera: &vg::Camera,
    options: &RenderOptions,
    pixels: Vec<[u8; 4]>,
) -> Bound<'py, PyAny> {
    let size = (camera.height as usize, camera.width as usize);
    let rgb = |&[r, g, b, _]: &[u8; 4]| [r, g, b];
    match options.background {
        Background::Color(_) => picture(py, size, pixels.iter().map(rgb).collect()),
        Background::Transparent => picture(py, size, pixels),
    }
}
