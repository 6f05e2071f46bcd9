//! Networks in ONNX files.

use crate::arrays::owned;
use crate::camera::Camera;
use crate::errors::{choice, detached, pooled};
use crate::parts::stays_here;
use crate::reconstruct::picture;
use crate::whole;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::path::PathBuf;
use vg::onnx::ModelOptions;
use vg::scene::Segmenter;
use vg::scene::mask::Label;

/// A network in an ONNX file, opened by ONNX Runtime, for reconstruct's prior_model and head_model.
///
/// It is opened once and may be used by any number of threads at a time; its runs are serialised. It keeps its
/// weights and threads until it is garbage-collected. It cannot be used in a forked process.
///
///     >>> network = Model("depth.onnx")  # doctest: +SKIP
///     >>> made = reconstruct(images, masks, cameras, prior="onnx", prior_model=network)  # doctest: +SKIP
#[pyclass(module = "vehicle_gaussians", frozen)]
pub(crate) struct Model {
    pub(crate) inner: vg::onnx::Model,
}

#[pymethods]
impl Model {
    /// Opens the network in the file at path; external weight files in its folder are found by their names.
    ///
    /// runtime: ONNX Runtime's library or its folder; by default the environment variable VG_ONNXRUNTIME, else an
    /// installed package onnxruntime. A process has one runtime: the first that was loaded.
    /// provider: "cpu", or "cuda" for the first CUDA device.
    /// fall_back: whether the CPU is used if the provider is not available.
    /// threads: threads of the runtime, kept as long as the model is open; 0 means one per core.
    /// prepack: whether weights are rearranged for speed, which can take as much memory again; None: where the files
    /// take less than 1 GiB.
    /// arena: whether the runtime keeps the memory of a run for the next one.
    #[new]
    #[pyo3(signature = (path, runtime=None, provider="cpu", fall_back=false, threads=0, prepack=None, arena=false))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        runtime: Option<PathBuf>,
        provider: &str,
        fall_back: bool,
        #[pyo3(from_py_with = whole::threads)] threads: usize,
        prepack: Option<bool>,
        arena: bool,
    ) -> PyResult<Self> {
        let provider = choice(py, "provider", provider)?;
        let options = ModelOptions { runtime, provider, fall_back, threads, prepack, arena };
        let inner = detached(py, || vg::onnx::Model::open(&path, &options))?;
        Ok(Self { inner })
    }

    /// Path of the file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.inner.path().to_owned()
    }

    fn __reduce__(&self) -> PyResult<()> {
        let way_out = "another process must open the file again: Model(path)";
        Err(stays_here("Model", "a network that is open in this process", way_out))
    }

    fn __repr__(&self) -> String {
        format!("Model({:?})", self.inner.path())
    }
}

/// Computes the mask of a photograph by a segmentation network: bool (height, width), True for the vehicle at the
/// origin of the camera's vehicle frame.
///
/// image: RGB, uint8 (height, width, 3); the alpha of a fourth channel is ignored.
/// threads: worker threads; 0 means one per core.
///
///     >>> mask = segment(Model("segmentation.onnx"), images[0], cameras[0])  # doctest: +SKIP
#[pyfunction]
#[pyo3(signature = (model, image, camera, threads=0))]
pub(crate) fn segment<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    image: &Bound<'py, PyAny>,
    camera: &Bound<'py, Camera>,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<bool>>> {
    let (model, camera) = (model.get().inner.clone(), camera.get().inner);
    let (image, _) = picture(image, "image", &camera)?;
    let mask = pooled(py, threads, || Segmenter::new(model)?.mask(&image, &camera))?;
    let is_vehicle = mask.labels().iter().map(|l| *l == Label::Vehicle).collect();
    Ok(owned(py, (mask.height() as usize, mask.width() as usize), is_vehicle))
}
