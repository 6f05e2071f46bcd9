//! Parts of objects for `pickle`, which restores them bit for bit; and the error of objects that cannot be pickled.

use crate::camera::Camera;
use crate::errors::{bad_value, from_library};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use vg::Pose;
use vg::geometry::CameraModel;

/// COLMAP's model, width, height, parameters, and the pose's rows.
pub(crate) type CameraParts = (&'static str, u32, u32, Vec<f64>, [f64; 12]);

/// Makes a camera from the parts that `Camera.__reduce__` returns.
#[pyfunction]
#[pyo3(name = "_camera")]
pub(crate) fn camera(
    py: Python<'_>,
    model: &str,
    width: u32,
    height: u32,
    params: Vec<f64>,
    vehicle_from_camera: [f64; 12],
) -> PyResult<Camera> {
    let library = |e| from_library(py, e);
    let known = CameraModel::from_name(model)
        .ok_or_else(|| bad_value(py, "model", &format!("{model:?}"), "what a Camera was pickled as"))?;
    let m = vehicle_from_camera;
    let mut pose = Pose::from_row_major("vehicle_from_camera", &m).map_err(library)?;
    // Orthonormalising an orthonormal rotation again would change its last bits.
    let axis = |column: usize| [m[column], m[column + 4], m[column + 8]].into();
    (pose.rotation.x_axis, pose.rotation.y_axis, pose.rotation.z_axis) = (axis(0), axis(1), axis(2));
    vg::Camera::from_colmap("camera", known, width, height, &params, pose)
        .map(|inner| Camera { inner })
        .map_err(library)
}

/// A function of this module by the name that pickle uses.
pub(crate) fn function<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("vehicle_gaussians._native")?.getattr(name)
}

/// The error of an object that cannot leave its process, with the alternative.
pub(crate) fn stays_here(class: &str, holds: &str, way_out: &str) -> PyErr {
    PyTypeError::new_err(format!(
        "{class}: cannot be pickled or copied, because it holds {holds}; threads may share it, and {way_out}"
    ))
}
