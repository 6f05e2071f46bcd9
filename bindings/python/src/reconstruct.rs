//! Reconstruction from photographs in memory.

use crate::arrays::{array, floats, owned, shape_text, values, vector};
use crate::camera::Camera;
use crate::errors::{bad_type, bad_value, choice, detached, from_library};
use crate::gaussians::Gaussians;
use crate::model::Model;
use crate::settings;
use crate::watched::ProgressFunction;
use crate::whole;
use numpy::{PyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyFunction};
use vg::pipeline::Options;
use vg::progress::Progress;
use vg::refine::{Amount, RefineOptions};
use vg::scene::image::PixelFormat;
use vg::scene::{Cloud, DepthMap, Mask, Place, RgbImage};
use vg::{Scene, View};

/// Positions (n, 3) and colours (n, 3).
type Points<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u8>>);

/// The Gaussians, the report as JSON, and the points if requested.
#[pyfunction]
#[pyo3(signature = (
    images, masks, cameras, depths, *, options, prior_model, head_model, cloud, vehicle_size, vehicle_place,
    refine_iterations, refine_seconds, refine_hold_out, refine_backend, threads, names, progress
))]
pub(crate) fn reconstruct<'py>(
    py: Python<'py>,
    images: Vec<Bound<'py, PyAny>>,
    masks: Option<Vec<Bound<'py, PyAny>>>,
    cameras: Vec<Bound<'py, PyAny>>,
    depths: Option<Vec<Bound<'py, PyAny>>>,
    options: &Bound<'py, PyDict>,
    prior_model: Option<Bound<'py, Model>>,
    head_model: Option<Bound<'py, Model>>,
    cloud: Option<&Bound<'py, PyAny>>,
    vehicle_size: Option<Bound<'py, PyAny>>,
    vehicle_place: Option<Bound<'py, PyAny>>,
    #[pyo3(from_py_with = whole::refine_iterations)] refine_iterations: Option<u32>,
    refine_seconds: Option<f64>,
    refine_hold_out: bool,
    refine_backend: &str,
    #[pyo3(from_py_with = whole::threads)] threads: usize,
    names: Option<Vec<String>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Gaussians, String, Option<Points<'py>>)> {
    let options = Options {
        prior_model: prior_model.map(|model| model.get().inner.clone()),
        head_model: head_model.map(|model| model.get().inner.clone()),
        vehicle_size: vehicle_size.map(|size| vector::<3>(&size, "vehicle_size")).transpose()?,
        vehicle_place: vehicle_place
            .map(|place| vector::<4>(&place, "vehicle_place"))
            .transpose()?
            .map(|[x, y, z, yaw]| Place { center: [x, y, z], yaw }),
        threads,
        refine: refinement(py, refine_iterations, refine_seconds, refine_hold_out, refine_backend)?,
        ..settings::options(options)?
    };
    // Checked before the pixels are copied.
    options.validate().map_err(|e| from_library(py, e))?;
    let mut scene = read_scene(py, &images, masks.as_deref(), &cameras, depths.as_deref(), names)?;
    scene.cloud = cloud.map_or(Ok(None), self::cloud)?;

    let function = ProgressFunction::new(progress)?;
    let mut raised = None;
    let made = detached(py, || {
        let mut report = |state: Progress| function.report(state, &mut raised);
        let made = vg::pipeline::reconstruct(&scene, &options, &mut report)?;
        // A report that cannot be written is left empty: the model is still valid.
        let report = serde_json::to_string(&made.report).unwrap_or_default();
        Ok((made, report))
    });
    if let Some(error) = raised {
        return Err(error);
    }
    let (made, report) = made?;
    let points = made.points.map(|cloud| {
        let n = cloud.positions.len();
        let positions = owned(py, (n, 3), cloud.positions.into_flattened());
        (positions, owned(py, (n, 3), cloud.colors.into_flattened()))
    });
    Ok((Gaussians::new(made.gaussians), report, points))
}

/// The amount of refinement: a number of steps, or a time.
fn refinement(
    py: Python<'_>,
    iterations: Option<u32>,
    seconds: Option<f64>,
    hold_out: bool,
    backend: &str,
) -> PyResult<Option<RefineOptions>> {
    let backend = choice(py, "refine_backend", backend)?;
    let amount = match (iterations, seconds) {
        (None, None) => return Ok(None),
        (Some(0), _) => return Err(bad_value(py, "refine_iterations", "0", "1 to 1000000")),
        (Some(steps), None) => Amount::Iterations(steps),
        (None, Some(seconds)) => Amount::Seconds(seconds),
        (Some(steps), Some(seconds)) => {
            let found = format!("{seconds}, with refine_iterations {steps}");
            return Err(bad_value(py, "refine_seconds", &found, "only one of the two"));
        }
    };
    let options = RefineOptions { amount, hold_out, backend, ..RefineOptions::default() };
    match options.validate() {
        Err(vg::Error::Argument { argument, found, allowed }) => {
            let name = argument.trim_start_matches("options.").replace('.', "_");
            Err(bad_value(py, &name, &found, &allowed))
        }
        Err(other) => Err(from_library(py, other)),
        Ok(()) => Ok(Some(options)),
    }
}

pub(crate) fn read_scene(
    py: Python<'_>,
    images: &[Bound<'_, PyAny>],
    masks: Option<&[Bound<'_, PyAny>]>,
    cameras: &[Bound<'_, PyAny>],
    depths: Option<&[Bound<'_, PyAny>]>,
    names: Option<Vec<String>>,
) -> PyResult<Scene> {
    if images.is_empty() {
        return Err(bad_value(py, "images", "none", "at least one"));
    }
    let lengths = [
        ("cameras", Some(cameras.len())),
        ("masks", masks.map(<[_]>::len)),
        ("depths", depths.map(<[_]>::len)),
        ("names", names.as_ref().map(Vec::len)),
    ];
    for (argument, length) in lengths {
        if length.is_some_and(|n| n != images.len()) {
            let found = format!("{} entries", length.unwrap_or_default());
            return Err(bad_value(py, argument, &found, &format!("{}, one per image", images.len())));
        }
    }
    let views = images.iter().enumerate().map(|(i, image)| {
        let camera = cameras[i].cast::<Camera>().map_err(|_| {
            let found = cameras[i].get_type().name().map_or_else(|_| "an object".into(), |n| n.to_string());
            bad_type(&format!("cameras[{i}]"), &found, "a Camera")
        })?;
        let camera = camera.get().inner;
        let (image, cut_out) = picture(image, &format!("images[{i}]"), &camera)?;
        let mask = match masks.map(|list| &list[i]).filter(|o| !o.is_none()) {
            Some(object) => Some(mask(object, &format!("masks[{i}]"), &camera)?),
            None => cut_out,
        };
        let depth = depths.map(|list| &list[i]).filter(|o| !o.is_none());
        let depth = depth.map(|object| self::depth(object, &format!("depths[{i}]"), &camera)).transpose()?;
        let name = names.as_ref().map_or_else(|| format!("{i:03}"), |names| names[i].clone());
        Ok(View { name, camera, image, mask, depth })
    });
    Ok(Scene { views: views.collect::<PyResult<_>>()?, ..Scene::default() })
}

/// The picture, and the mask from its alpha channel if it is transparent anywhere.
pub(crate) fn picture(
    object: &Bound<'_, PyAny>,
    argument: &str,
    camera: &vg::Camera,
) -> PyResult<(RgbImage, Option<Mask>)> {
    let py = object.py();
    let allowed = "a NumPy array of uint8, (height, width, 3) or (height, width, 4); floats of 0 to 1 become one by \
                   (255 * image).round().astype(np.uint8)";
    let pixels = array::<u8>(object, argument, allowed)?;
    let (width, height) = (camera.width, camera.height);
    let format = match pixels.shape() {
        [h, w, 3] if (*h, *w) == (height as usize, width as usize) => PixelFormat::Rgb8,
        [h, w, 4] if (*h, *w) == (height as usize, width as usize) => PixelFormat::Rgba8,
        other => {
            let allowed = format!("({height}, {width}, 3) or ({height}, {width}, 4), its camera's size");
            return Err(bad_value(py, argument, &shape_text(other), &allowed));
        }
    };
    let data = values(&pixels)?;
    let stride = width as usize * format.bytes_per_pixel();
    let library = |e| from_library(py, e);
    let image = RgbImage::from_strided(argument, data, width, height, stride, format).map_err(library)?;
    let alpha = || data.iter().skip(3).step_by(4).copied();
    if format == PixelFormat::Rgb8 || alpha().all(|a| a == u8::MAX) {
        return Ok((image, None));
    }
    let alpha: Vec<u8> = alpha().collect();
    let mask = Mask::from_strided(argument, &alpha, width, height, width as usize).map_err(library)?;
    Ok((image, Some(mask)))
}

pub(crate) fn mask(object: &Bound<'_, PyAny>, argument: &str, camera: &vg::Camera) -> PyResult<Mask> {
    let py = object.py();
    let allowed = "a NumPy array of bool, or of uint8 where 128 and above is vehicle, or 1 of 0 and 1, (height, width); \
                   others become one by a comparison: mask > 0.5";
    // One byte each, 0 or 1.
    let is_bool = object.cast::<PyUntypedArray>().is_ok_and(|a| numpy_is_bool(py, a));
    let labels: Vec<u8>;
    let bytes;
    let (shape, data) = if is_bool {
        let flags = array::<bool>(object, argument, allowed)?;
        labels = values(&flags)?.iter().map(|&v| if v { u8::MAX } else { 0 }).collect();
        (flags.shape().to_vec(), &labels[..])
    } else {
        bytes = array::<u8>(object, argument, allowed)?;
        (bytes.shape().to_vec(), values(&bytes)?)
    };
    same_size(py, argument, &shape, camera)?;
    Mask::from_strided(argument, data, camera.width, camera.height, camera.width as usize)
        .map_err(|e| from_library(py, e))
}

fn numpy_is_bool(py: Python<'_>, array: &Bound<'_, PyUntypedArray>) -> bool {
    use numpy::PyArrayDescrMethods;
    array.dtype().is_equiv_to(&numpy::dtype::<bool>(py))
}

pub(crate) fn depth(object: &Bound<'_, PyAny>, argument: &str, camera: &vg::Camera) -> PyResult<DepthMap> {
    let py = object.py();
    let allowed = "an array of floats, metres, (height, width); millimetres become one by \
                   depth.astype(np.float32) / 1000";
    let metres = floats(object, argument, allowed)?;
    same_size(py, argument, metres.shape(), camera)?;
    let stride = camera.width as usize;
    DepthMap::from_strided(argument, values(&metres)?, camera.width, camera.height, stride)
        .map_err(|e| from_library(py, e))
}

/// Copies the points; `None` if there are none.
fn cloud(object: &Bound<'_, PyAny>) -> PyResult<Option<Cloud>> {
    let py = object.py();
    let points = floats(object, "cloud", "an array of floats, metres, (n, 3)")?;
    if !matches!(points.shape(), [_, 3]) {
        return Err(bad_value(py, "cloud", &shape_text(points.shape()), "(n, 3)"));
    }
    let (points, _) = values(&points)?.as_chunks::<3>();
    if points.is_empty() {
        return Ok(None);
    }
    Cloud::new(points.to_vec()).map(Some).map_err(|e| from_library(py, e))
}

fn same_size(py: Python<'_>, argument: &str, shape: &[usize], camera: &vg::Camera) -> PyResult<()> {
    if shape == [camera.height as usize, camera.width as usize] {
        return Ok(());
    }
    let allowed = format!("({}, {}), its camera's size", camera.height, camera.width);
    Err(bad_value(py, argument, &shape_text(shape), &allowed))
}

/// Issues a warning about legal input that looks like a mistake.
pub(crate) fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    static WARN: PyOnceLock<Py<PyFunction>> = PyOnceLock::new();
    WARN.import(py, "vehicle_gaussians._warn", "warn")?.call1((text,))?;
    Ok(())
}
