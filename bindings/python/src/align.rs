//! Alignment to the vehicle's frame; the fields of the results are named in `vehicle_gaussians._align`.

use crate::arrays::{floats, matrix4, owned, rows, shape_text, values, vector};
use crate::camera::Camera;
use crate::errors::{bad_value, choice, from_library, renamed};
use crate::reconstruct::mask;
use crate::watched::watched;
use crate::whole;
use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;
use vg::View;
use vg::align::{BoxAlignment, ScanAlignment};
use vg::align::{folder_to_scan_watched, to_box_watched, to_scan_watched};
use vg::geometry::Similarity;
use vg::scene::Cloud;

/// A matrix.
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// vehicle_from_world, scale, residual, confidence, outline distance, outline distance with front and rear swapped,
/// number of views or points used.
type Found<'py> = (Matrix<'py>, f64, f64, f64, Option<f64>, Option<f64>, usize);

#[pyfunction]
#[pyo3(signature = (masks, cameras, scan, sparse, heading, names, threads, progress))]
pub(crate) fn align_scan<'py>(
    py: Python<'py>,
    masks: Vec<Option<Bound<'py, PyAny>>>,
    cameras: Vec<Bound<'py, Camera>>,
    scan: &Bound<'py, PyAny>,
    sparse: Option<&Bound<'py, PyAny>>,
    heading: &str,
    names: Option<Vec<String>>,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Found<'py>> {
    let scan = floats(scan, "scan", "an array of floats, metres, (n, 3)")?;
    if !matches!(scan.shape(), [_, 3]) {
        return Err(bad_value(py, "scan", &shape_text(scan.shape()), "(n, 3)"));
    }
    // Copied, because other threads may write to the array while the library works.
    let points = values(&scan)?.as_chunks::<3>().0.to_vec();
    let views = read_views(py, &masks, &cameras, names)?;
    let sparse = sparse.map_or_else(|| Ok(Vec::new()), |object| rows::<3>(object, "sparse"))?;
    let heading = choice(py, "heading", heading)?;
    let found = watched(py, threads, "align", progress, |watch| {
        let scan = Cloud::new(points).map_err(|e| renamed(e, "cloud", "scan"))?;
        to_scan_watched(&views, &sparse.iter().map(|&p| p.into()).collect::<Vec<_>>(), &scan, heading, watch)
    })?;
    Ok(by_scan(py, &found))
}

#[pyfunction]
#[pyo3(signature = (masks, cameras, sparse, size, heading, names, threads, progress))]
pub(crate) fn align_box<'py>(
    py: Python<'py>,
    masks: Vec<Option<Bound<'py, PyAny>>>,
    cameras: Vec<Bound<'py, Camera>>,
    sparse: &Bound<'py, PyAny>,
    size: &Bound<'py, PyAny>,
    heading: &str,
    names: Option<Vec<String>>,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Found<'py>> {
    let views = read_views(py, &masks, &cameras, names)?;
    let (sparse, size) = (rows::<3>(sparse, "sparse")?, vector::<3>(size, "size")?);
    let heading = choice(py, "heading", heading)?;
    let BoxAlignment { vehicle_from_world, residual_m, confidence, views, .. } =
        watched(py, threads, "align", progress, |watch| {
            to_box_watched(
                &views,
                &sparse.iter().map(|&p| p.into()).collect::<Vec<_>>(),
                size,
                heading,
                watch,
            )
        })?;
    Ok(found(py, &vehicle_from_world, residual_m, confidence, None, views))
}

/// The fields of [`Found`], which pairs were used, and the residual of each.
type Fitted<'py> = (
    Matrix<'py>,
    f64,
    f64,
    f64,
    Option<f64>,
    Option<f64>,
    usize,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<f64>>,
);

#[pyfunction]
#[pyo3(signature = (world, vehicle))]
pub(crate) fn align_points<'py>(
    world: &Bound<'py, PyAny>,
    vehicle: &Bound<'py, PyAny>,
) -> PyResult<Fitted<'py>> {
    let py = world.py();
    let (from, to) = (rows::<3>(world, "world")?, rows::<3>(vehicle, "vehicle")?);
    if from.len() != to.len() {
        let allowed = format!("as many as world, {}", from.len());
        return Err(bad_value(py, "vehicle", &to.len().to_string(), &allowed));
    }
    let points = |rows: Vec<[f64; 3]>| rows.into_iter().map(Into::into).collect::<Vec<_>>();
    let fit = Similarity::umeyama_robust(&points(from), &points(to))
        .map_err(|e| from_library(py, renamed(e, "points", "world, vehicle")))?;
    let used = fit.kept.iter().filter(|kept| **kept).count();
    let (matrix, scale, residual, confidence, ..) =
        found(py, &fit.similarity, fit.residual(), fit.confidence(), None, used);
    let n = fit.kept.len();
    let (kept, residuals) = (owned(py, n, fit.kept), owned(py, n, fit.residuals));
    Ok((matrix, scale, residual, confidence, None, None, used, kept, residuals))
}

#[pyfunction]
#[pyo3(signature = (path, scan, heading, threads, progress))]
pub(crate) fn align_folder<'py>(
    py: Python<'py>,
    path: PathBuf,
    scan: Option<PathBuf>,
    heading: &str,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Found<'py>> {
    let heading = choice(py, "heading", heading)?;
    let (_, found) = watched(py, threads, "align", progress, |watch| {
        folder_to_scan_watched(&path, scan.as_deref(), heading, watch)
    })?;
    Ok(by_scan(py, &found))
}

fn by_scan<'py>(py: Python<'py>, scan: &ScanAlignment) -> Found<'py> {
    let outlines = Some((scan.residual_px, scan.other_px));
    found(py, &scan.vehicle_from_world, scan.residual_m, scan.confidence, outlines, scan.views)
}

fn found<'py>(
    py: Python<'py>,
    vehicle_from_world: &Similarity,
    residual_m: f64,
    confidence: f64,
    outlines_px: Option<(f64, f64)>,
    used: usize,
) -> Found<'py> {
    let matrix = matrix4(py, &vehicle_from_world.to_row_major());
    let (residual_px, other_px) = outlines_px.unzip();
    (matrix, vehicle_from_world.scale, residual_m, confidence, residual_px, other_px, used)
}

fn read_views(
    py: Python<'_>,
    masks: &[Option<Bound<'_, PyAny>>],
    cameras: &[Bound<'_, Camera>],
    names: Option<Vec<String>>,
) -> PyResult<Vec<View>> {
    for (argument, length) in [("masks", Some(masks.len())), ("names", names.as_ref().map(Vec::len))] {
        if let Some(n) = length.filter(|n| *n != cameras.len()) {
            let allowed = format!("one for each of {} cameras", cameras.len());
            return Err(bad_value(py, argument, &n.to_string(), &allowed));
        }
    }
    let view = |(i, camera): (usize, &Bound<'_, Camera>)| {
        let camera = camera.get().inner;
        let mask =
            masks[i].as_ref().map(|object| mask(object, &format!("masks[{i}]"), &camera)).transpose()?;
        let name = names.as_ref().map_or_else(|| format!("{i:03}"), |names| names[i].clone());
        View::without_picture(name, camera, mask).map_err(|e| from_library(py, e))
    };
    cameras.iter().enumerate().map(view).collect()
}
