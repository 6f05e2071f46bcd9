//! Errors of a model; the fields of the results are named in `vehicle_gaussians._metrics`.

use crate::arrays::{array, floats, shape_text, values};
use crate::camera::Camera;
use crate::errors::{bad_value, from_library, pooled, renamed};
use crate::gaussians::Gaussians;
use crate::model::Model;
use crate::reconstruct::{depth, mask, picture};
use crate::watched::watched;
use crate::whole;
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use std::collections::HashMap;
use vg::View;
use vg::geometry::measures::Measure;
use vg::metrics::{Lpips, SurfaceErrors, SurfaceOptions, ViewErrors, check_colors, psnr, ssim};
use vg::render::{CpuRenderer, RenderOptions, Renderer};

/// PSNR, SSIM, LPIPS.
#[pyfunction]
#[pyo3(signature = (a, b, lpips, threads))]
pub(crate) fn picture_errors(
    py: Python<'_>,
    a: &Bound<'_, PyAny>,
    b: &Bound<'_, PyAny>,
    lpips: Option<&Bound<'_, Model>>,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
) -> PyResult<(f64, Option<f64>, Option<f64>)> {
    let ((a, size), (b, other)) = (on_white(a, "a")?, on_white(b, "b")?);
    if other != size {
        let [height, width] = size;
        let allowed = format!("the size of a, {width}x{height}");
        return Err(bad_value(py, "b", &format!("{}x{}", other[1], other[0]), &allowed));
    }
    let [height, width] = size;
    let network = lpips.map(|model| model.get().inner.clone());
    pooled(py, threads, || {
        let lpips = match network.map(Lpips::new).transpose()? {
            Some(lpips) => lpips.distance_of(&a, &b, width, height)?,
            None => None,
        };
        Ok((psnr(&a, &b), ssim(&a, &b, width, height), lpips))
    })
}

/// Measures by their names.
type ByName = HashMap<&'static str, Option<f64>>;

fn by_name(measures: &[Measure], values: Vec<Option<f64>>) -> ByName {
    measures.iter().map(|measure| measure.name).zip(values).collect()
}

#[pyfunction]
#[pyo3(signature = (gaussians, image, mask, camera, depth, lpips, threads))]
pub(crate) fn view_errors(
    py: Python<'_>,
    gaussians: &Bound<'_, Gaussians>,
    image: &Bound<'_, PyAny>,
    mask: Option<&Bound<'_, PyAny>>,
    camera: &Bound<'_, Camera>,
    depth: Option<&Bound<'_, PyAny>>,
    lpips: Option<&Bound<'_, Model>>,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
) -> PyResult<ByName> {
    let camera = camera.get().inner;
    let (image, cut_out) = picture(image, "image", &camera)?;
    let mask = match mask {
        Some(object) => Some(self::mask(object, "mask", &camera)?),
        None => cut_out,
    };
    let depth = depth.map(|object| self::depth(object, "depth", &camera)).transpose()?;
    let view = View { name: String::new(), camera, image, mask, depth };
    let network = lpips.map(|model| model.get().inner.clone());
    let gaussians = &gaussians.get().inner;
    watched(py, threads, "measure", None, |watch| {
        let drawn =
            CpuRenderer::new().watched(watch).render(gaussians, &camera, &RenderOptions::default())?;
        let lpips = match network.map(Lpips::new).transpose()? {
            Some(lpips) => lpips.of(&drawn, &view)?,
            None => None,
        };
        let mut errors = by_name(ViewErrors::MEASURES, ViewErrors::of(&drawn, &view).values());
        errors.insert("lpips", lpips);
        Ok(errors)
    })
}

#[pyfunction]
#[pyo3(signature = (gaussians, points, f_score, threads))]
pub(crate) fn surface_errors(
    py: Python<'_>,
    gaussians: &Bound<'_, Gaussians>,
    points: &Bound<'_, PyAny>,
    f_score: f64,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
) -> PyResult<ByName> {
    let points = floats(points, "points", "an array of floats, metres, (n, 3)")?;
    if !matches!(points.shape(), [_, 3]) {
        return Err(bad_value(py, "points", &shape_text(points.shape()), "(n, 3)"));
    }
    // Copied, because other threads may write to the array while the library works.
    let points = values(&points)?.as_chunks::<3>().0.to_vec();
    let options = SurfaceOptions { f_score_m: f_score, ..SurfaceOptions::default() };
    options.validate().map_err(|e| from_library(py, e))?;
    let gaussians = &gaussians.get().inner;
    let e = watched(py, threads, "measure", None, |watch| {
        SurfaceErrors::watched(gaussians, &points, &options, watch).map_err(|e| renamed(e, "scan", "points"))
    })?;
    Ok(by_name(SurfaceErrors::MEASURES, e.values()))
}

/// A picture composited on white, RGB in [0, 1], and its height and width.
fn on_white(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<(Vec<[f32; 3]>, [u32; 2])> {
    const ALLOWED: &str = "a NumPy array of uint8 or floats, (height, width, 3) or (height, width, 4)";
    let floats: Vec<f32>;
    let shape: Vec<usize>;
    if let Ok(bytes) = array::<u8>(object, argument, ALLOWED) {
        floats = values(&bytes)?.iter().map(|b| f32::from(*b) / 255.0).collect();
        shape = bytes.shape().to_vec();
    } else {
        let array = self::floats(object, argument, ALLOWED)?;
        (floats, shape) = (values(&array)?.to_vec(), array.shape().to_vec());
    }
    const SIDES: std::ops::RangeInclusive<usize> = 1..=vg::geometry::camera::MAX_SIDE as usize;
    let [height, width, channels @ (3 | 4)] = shape[..] else {
        let allowed = "(height, width, 3 or 4)";
        return Err(bad_value(object.py(), argument, &shape_text(&shape), allowed));
    };
    if !SIDES.contains(&height) || !SIDES.contains(&width) {
        let allowed = format!("sides of 1 to {}", SIDES.end());
        return Err(bad_value(object.py(), argument, &shape_text(&shape), &allowed));
    }
    check_colors(argument, &floats, width, channels).map_err(|e| from_library(object.py(), e))?;
    let pixel = |p: &[f32]| {
        let alpha = p.get(3).map_or(1.0, |a| a.clamp(0.0, 1.0));
        [p[0], p[1], p[2]].map(|c| alpha * c + (1.0 - alpha))
    };
    Ok((floats.chunks_exact(channels).map(pixel).collect(), [height as u32, width as u32]))
}
