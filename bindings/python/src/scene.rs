//! Reads scenes from disk into arrays.

use crate::arrays::{owned, similarity};
use crate::camera::Camera;
use crate::errors::from_library;
use crate::reconstruct::warn;
use crate::watched::watched;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use std::path::PathBuf;
use vg::io::{self, SceneOptions};
use vg::progress::Watch;
use vg::scene::mask::Label;

/// Images, masks, depths, cameras and names, a list each; `None` for a missing mask or depth map.
type Lists<'py> = (
    Vec<Bound<'py, PyArray3<u8>>>,
    Vec<Option<Bound<'py, PyArray2<bool>>>>,
    Vec<Option<Bound<'py, PyArray2<f32>>>>,
    Vec<Camera>,
    Vec<String>,
);

#[pyfunction]
#[pyo3(signature = (path, views, vehicle_from_world, depth_scale, load_depth, progress))]
pub(crate) fn open_scene<'py>(
    py: Python<'py>,
    path: PathBuf,
    views: Option<Vec<String>>,
    vehicle_from_world: Option<&Bound<'py, PyAny>>,
    depth_scale: Option<f64>,
    load_depth: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Lists<'py>> {
    const ARGUMENT: &str = "vehicle_from_world";
    let vehicle_from_world = match vehicle_from_world {
        None => None,
        Some(object) => Some(match object.extract::<PathBuf>() {
            Ok(file) => io::read_vehicle_from_world(&file).map_err(|e| from_library(py, e))?,
            Err(_) => similarity(object, ARGUMENT)?,
        }),
    };
    let options = SceneOptions { views, vehicle_from_world, depth_scale, load_depth, format: None };
    let read = |watch: &Watch| io::open_scene_watched(&path, &options, watch);
    let files = watched(py, 0, "read", progress, read)?;
    for note in &files.notes {
        warn(py, note)?;
    }
    let mut lists: Lists<'py> = Default::default();
    for view in files.scene.views {
        let size = (view.camera.height as usize, view.camera.width as usize);
        lists.0.push(owned(py, (size.0, size.1, 3), view.image.pixels().as_flattened().to_vec()));
        lists.1.push(view.mask.map(|mask| {
            let is_vehicle = mask.labels().iter().map(|l| *l == Label::Vehicle).collect();
            owned(py, size, is_vehicle)
        }));
        lists.2.push(view.depth.map(|depth| owned(py, size, depth.depth().to_vec())));
        lists.3.push(Camera { inner: view.camera });
        lists.4.push(view.name);
    }
    Ok(lists)
}
