//! `vehicle_gaussians._native`: the extension module, whose input and output are NumPy arrays.
//!
//! * Pixels are copied once on the way in; Gaussians are not copied on the way out (read-only views).
//! * The library works without the GIL, on its own threads that end with the call, so that calls before a fork do not
//!   affect the child process.
//! * Every error is a `VgError`, also after a panic, or a `TypeError` for the wrong kind of object.

// Python's functions have many keyword arguments, which PyO3 hands over by value.
#![allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]

mod align;
mod arrays;
mod camera;
mod errors;
mod gaussians;
mod metrics;
mod model;
mod parts;
mod reconstruct;
mod refine;
mod renderer;
mod scene;
mod settings;
mod watched;
mod whole;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::align::{align_box, align_folder, align_points, align_scan};
    #[pymodule_export]
    use crate::camera::{
        Camera, pose_from_box, pose_from_colmap, pose_from_opencv, pose_from_opengl, similarity_from_points,
    };
    #[pymodule_export]
    use crate::errors::panic_on_a_worker_thread;
    #[pymodule_export]
    use crate::gaussians::{Gaussians, gaussians_from_parts};
    #[pymodule_export]
    use crate::metrics::{picture_errors, surface_errors, view_errors};
    #[pymodule_export]
    use crate::model::{Model, segment};
    #[pymodule_export]
    use crate::parts::camera;
    #[pymodule_export]
    use crate::reconstruct::reconstruct;
    #[pymodule_export]
    use crate::refine::refine;
    #[pymodule_export]
    use crate::renderer::Renderer;
    #[pymodule_export]
    use crate::scene::open_scene;

    use super::{Bound, PyModule, PyModuleMethods, PyResult};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::errors::keep_panics_quiet();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
