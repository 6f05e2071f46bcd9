//! `Gaussians`: read-only arrays over the library's memory, pictures, and PLY files.

use crate::arrays::{array, borrowed, floats, owned, shape_text, similarity, values, vector};
use crate::camera::Camera;
use crate::errors::{bad_type, bad_value, choice, detached, from_library, pooled};
use crate::parts;
use crate::watched::watched;
use crate::whole;
use numpy::PyUntypedArrayMethods;
use numpy::ndarray::ArrayView;
use numpy::{Element, PyArray, PyArray1, PyArray2, PyArray3, PyArrayDescr, PyArrayDescrMethods};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict, PyFunction, PyString, PyType};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};
use vg::geometry::Turntable;
use vg::io::{ply, splats};
use vg::progress::Watch;
use vg::render::backend::{Trainer, trainer};
use vg::render::{
    Backend, Background, CpuRenderer, Differentiable, PictureGradient, RenderOptions, Rendered, Renderer,
};

/// Draws for everybody: keeps its working memory, and the last lens, from picture to picture.
static RENDERER: LazyLock<CpuRenderer> = LazyLock::new(CpuRenderer::new);

/// The Gaussians of a vehicle, in its frame (x forward, y left, z up, metres). They do not change: methods return
/// new ones, and the arrays are read-only views that keep them alive.
///
///     >>> car = Gaussians.load_ply("car.ply")
///     >>> picture = car.render(camera)
///     >>> red = car.sh.copy()
///     >>> red[:, 0] = [1.77, -1.77, -1.77]
///     >>> car = Gaussians.from_arrays(car.means, car.scales, car.quats, car.opacities, red)
// A mapping, not a sequence: NumPy is not to take them for nested lists.
#[pyclass(module = "vehicle_gaussians", frozen, eq, mapping)]
#[derive(PartialEq)]
pub(crate) struct Gaussians {
    /// Shared with the renderers that were made of them.
    pub(crate) inner: Arc<vg::Gaussians>,
}

impl Gaussians {
    pub(crate) fn of(inner: vg::Gaussians) -> Self {
        Self { inner: Arc::new(inner) }
    }
}

#[pymethods]
impl Gaussians {
    /// From arrays of floats, of n Gaussians: means (n, 3) and scales (n, 3), standard deviations, in metres; quats
    /// (n, 4) as (w, x, y, z) of any norm; opacities (n,) from 0 to 1; sh (n, (degree + 1)^2, 3).
    ///
    ///     >>> means, scales, quats = np.zeros((2, 3)), np.full((2, 3), 0.1), np.tile([1.0, 0, 0, 0], (2, 1))
    ///     >>> Gaussians.from_arrays(means, scales, quats, opacities=np.ones(2), sh=np.zeros((2, 1, 3)))
    ///     Gaussians(2, sh_degree=0)
    #[staticmethod]
    #[pyo3(signature = (means, scales, quats, opacities, sh))]
    fn from_arrays(
        means: &Bound<'_, PyAny>,
        scales: &Bound<'_, PyAny>,
        quats: &Bound<'_, PyAny>,
        opacities: &Bound<'_, PyAny>,
        sh: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let py = means.py();
        let sh = floats(sh, "sh", FLOATS)?;
        let sh_degree = match sh.shape() {
            [_, 1, 3] => 0,
            [_, 4, 3] => 1,
            [_, 9, 3] => 2,
            [_, 16, 3] => 3,
            other => {
                return Err(bad_value(py, "sh", &shape_text(other), "(n, K, 3) with K = 1, 4, 9 or 16"));
            }
        };
        let opacities = floats(opacities, "opacities", FLOATS)?;
        if opacities.shape().len() != 1 {
            return Err(bad_value(py, "opacities", &shape_text(opacities.shape()), "(n,)"));
        }
        vg::Gaussians::from_arrays(
            sh_degree,
            rows::<3>(means, "means")?,
            rows::<4>(quats, "quats")?,
            rows::<3>(scales, "scales")?,
            values(&opacities)?.to_vec(),
            values(&sh)?.to_vec(),
        )
        .map(Self::of)
        .map_err(|e| from_library(py, e))
    }

    /// Reads a PLY file in the layout of 3D Gaussian Splatting.
    ///
    ///     >>> car = Gaussians.load_ply("car.ply")
    #[staticmethod]
    #[pyo3(signature = (path))]
    fn load_ply(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let (inner, _) = pooled(py, 1, || splats::read(&path))?;
        Ok(Self::of(inner))
    }

    /// Writes a PLY file in the layout of 3D Gaussian Splatting. A file that is there is replaced only once the new
    /// one is complete.
    ///
    ///     >>> car.save_ply("copy.ply")
    #[pyo3(signature = (path))]
    fn save_ply(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        pooled(py, 1, || splats::write(&path, &self.inner))
    }

    /// From the bytes of a PLY file in the layout of 3D Gaussian Splatting.
    ///
    ///     >>> same = Gaussians.from_ply_bytes(car.to_ply_bytes())
    #[staticmethod]
    #[pyo3(signature = (data))]
    fn from_ply_bytes(py: Python<'_>, data: &Bound<'_, PyAny>) -> PyResult<Self> {
        let kind = || data.get_type().name().map_or_else(|_| "an object".into(), |n| n.to_string());
        let buffer = PyBuffer::<u8>::get(data).map_err(|_| bad_type("data", &kind(), "bytes"))?;
        // A copy: others may write to the memory while the library works.
        let bytes = buffer.to_vec(py)?;
        let (inner, _) = pooled(py, 1, || ply::from_bytes(&bytes))?;
        Ok(Self::of(inner))
    }

    /// What save_ply writes, as bytes.
    ///
    ///     >>> car.to_ply_bytes()[:4]
    ///     b'ply\n'
    #[pyo3(signature = ())]
    fn to_ply_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = pooled(py, 1, || Ok(ply::to_bytes(&self.inner)))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Those that an index of NumPy's selects of n: a slice, an array of n bools, or of whole numbers, in their order.
    ///
    ///     >>> solid = car[car.opacities > 0.5]
    ///     >>> every_tenth, two = car[::10], car[[3, -1]]
    fn __getitem__(&self, py: Python<'_>, index: &Bound<'_, PyAny>) -> PyResult<Self> {
        let n = self.inner.len();
        static SELECTED: PyOnceLock<Py<PyFunction>> = PyOnceLock::new();
        let indices = SELECTED.import(py, "vehicle_gaussians._select", "indices")?.call1((index, n))?;
        let indices = array::<i64>(&indices, "index", "whole numbers")?;
        let indices: Vec<usize> = values(&indices)?.iter().map(|&i| i as usize).collect();
        pooled(py, 1, || self.inner.selected(&indices)).map(Self::of)
    }

    /// Those whose centre lies in the box from low to high, three numbers each, metres, its faces included. Infinite sides
    /// are open.
    ///
    ///     >>> front = car.cropped((0, -10, -10), (10, 10, 10))
    #[pyo3(signature = (low, high))]
    fn cropped(&self, low: &Bound<'_, PyAny>, high: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = low.py();
        let [low, high] =
            [vector::<3>(low, "low")?, vector::<3>(high, "high")?].map(|corner| corner.map(|c| c as f32));
        pooled(py, 1, || self.inner.cropped(low, high)).map(Self::of)
    }

    /// Covariance matrices in the vehicle's frame, square metres. (n, 3, 3)
    ///
    ///     >>> volumes = np.sqrt(np.linalg.det(car.covariances()))
    #[pyo3(signature = ())]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let upper = pooled(py, 1, || Ok(self.inner.covariances()))?;
        let whole = |[xx, xy, xz, yy, yz, zz]: [f32; 6]| [xx, xy, xz, xy, yy, yz, xz, yz, zz];
        Ok(owned(py, (upper.len(), 3, 3), upper.into_iter().flat_map(whole).collect()))
    }

    /// count cameras on a circle around the vehicle, from its front towards its left, each with all of it in its picture.
    ///
    ///     >>> pictures = Renderer(car).render_many(car.turntable(36, 320, 240))
    #[pyo3(signature = (count, width, height, *, elevation_degrees=12.0, fov_y_degrees=35.0))]
    fn turntable(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = whole::count)] count: usize,
        #[pyo3(from_py_with = whole::width)] width: u32,
        #[pyo3(from_py_with = whole::height)] height: u32,
        elevation_degrees: f64,
        fov_y_degrees: f64,
    ) -> PyResult<Vec<Camera>> {
        let Some((low, high)) = self.inner.bounds() else {
            return Err(bad_value(py, "turntable", "no Gaussians", "at least one to walk around"));
        };
        let table = Turntable { elevation_degrees, fov_y_degrees };
        let cameras = table.cameras(low, high, count, width, height).map_err(|e| from_library(py, e))?;
        Ok(cameras.into_iter().map(|inner| Camera { inner }).collect())
    }

    /// The mirror image across the plane of symmetry, y = 0.
    ///
    ///     >>> car.mirrored().mirrored() == car
    ///     True
    #[pyo3(signature = ())]
    fn mirrored(&self, py: Python<'_>) -> PyResult<Self> {
        pooled(py, 1, || Ok(self.inner.mirrored())).map(Self::of)
    }

    /// These in another frame: to_from_vehicle is a 4x4 similarity. Colours turn with the vehicle. Coordinates must stay
    /// below 16384 m, where a float32 still holds a millimetre.
    ///
    ///     >>> twice_as_large = car.transformed(np.diag([2.0, 2.0, 2.0, 1.0]))
    #[pyo3(signature = (to_from_vehicle))]
    fn transformed(&self, to_from_vehicle: &Bound<'_, PyAny>) -> PyResult<Self> {
        let similarity = similarity(to_from_vehicle, "to_from_vehicle")?;
        let inner = pooled(to_from_vehicle.py(), 0, || self.inner.transformed(&similarity))?;
        Ok(Self::of(inner))
    }

    /// These, then those of other, at the higher of their degrees of spherical harmonics.
    ///
    ///     >>> both = car.merged(car.mirrored())
    ///     >>> len(both) == 2 * len(car)
    ///     True
    #[pyo3(signature = (other))]
    fn merged(&self, py: Python<'_>, other: &Bound<'_, Self>) -> PyResult<Self> {
        let other = &other.get().inner;
        pooled(py, 1, || Ok(self.inner.merged(other))).map(Self::of)
    }

    /// The picture a camera takes: uint8 (height, width, 3), or (height, width, 4) with straight alpha on a
    /// "transparent" background. With dtype float32 colours are not clamped above 1. With depth=True a pair of the
    /// picture and its depth in metres, float32 (height, width), 0 where there is nothing.
    ///
    /// background is "white", "black", "transparent" or (r, g, b) from 0 to 1; near and far are metres; sh_degree leaves
    /// out the colour's bands above it; threads=0 means one per core.
    ///
    ///     >>> picture = car.render(camera)
    ///     >>> rgba, depth = car.render(camera, "transparent", depth=True)
    #[pyo3(signature = (
        camera, background=None, depth=false, threads=0, *,
        dtype=None, antialiased=false, near=0.01, far=1e10, sh_degree=3
    ), text_signature = "(self, camera, background='white', depth=False, threads=0, *, dtype='uint8', \
        antialiased=False, near=0.01, far=1e10, sh_degree=3)")]
    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: &Bound<'py, Camera>,
        background: Option<&Bound<'py, PyAny>>,
        depth: bool,
        #[pyo3(from_py_with = whole::threads)] threads: usize,
        dtype: Option<&Bound<'py, PyAny>>,
        antialiased: bool,
        near: f32,
        far: f32,
        #[pyo3(from_py_with = whole::sh_degree)] sh_degree: u8,
    ) -> PyResult<Bound<'py, PyAny>> {
        let background = background.map_or(Ok(Background::Color([1.0; 3])), parse_background)?;
        let kind = dtype.map_or(Ok(Kind::Bytes), Kind::of)?;
        let options =
            RenderOptions { background, antialiased, near, far, sh_degree, ..RenderOptions::default() };
        let camera = &camera.get().inner;
        let draw = |watch: &Watch| RENDERER.watched(watch).render(&self.inner, camera, &options);
        let mut drawn = watched(py, threads, "render", None, draw)?;
        let size = (drawn.height as usize, drawn.width as usize);
        let picture = match (kind, background) {
            (Kind::Bytes, Background::Color(_)) => picture(py, size, drawn.to_rgb8()),
            (Kind::Bytes, Background::Transparent) => picture(py, size, drawn.to_rgba8()),
            (Kind::Floats, Background::Transparent) => picture(py, size, straight(&drawn)),
            (Kind::Floats, Background::Color(_)) => picture(py, size, std::mem::take(&mut drawn.color)),
        };
        match depth {
            false => Ok(picture),
            true => Ok((picture, owned(py, size, drawn.depth)).into_pyobject(py)?.into_any()),
        }
    }

    /// The picture as losses look at it: Planes of color (height, width, 3), over the background or, with a
    /// "transparent" one, premultiplied; alpha and depth (height, width). All float32; arguments as those of render,
    /// and depth_mode, "expected" or "accumulated": depth times alpha. backend is "cpu", "gpu", an error without, or
    /// "auto", the CPU: Renderer is for Gaussians that are drawn many times.
    ///
    ///     >>> color, alpha, depth = car.render_planes(camera, "black")
    #[pyo3(signature = (
        camera, background=None, threads=0, *,
        antialiased=false, near=0.01, far=1e10, sh_degree=3, depth_mode="expected", backend="auto"
    ), text_signature = "(self, camera, background='white', threads=0, *, antialiased=False, near=0.01, far=1e10, \
        sh_degree=3, depth_mode='expected', backend='auto')")]
    fn render_planes<'py>(
        &self,
        py: Python<'py>,
        camera: &Bound<'py, Camera>,
        background: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = whole::threads)] threads: usize,
        antialiased: bool,
        near: f32,
        far: f32,
        #[pyo3(from_py_with = whole::sh_degree)] sh_degree: u8,
        depth_mode: &str,
        backend: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        let options =
            RenderOptions { antialiased, near, far, sh_degree, ..planes(py, background, depth_mode)? };
        let camera = &camera.get().inner;
        let device = device(py, backend)?;
        let draw = |watch: &Watch| match &device {
            Some(device) => device.render(&self.inner, camera, &options),
            None => RENDERER.watched(watch).render(&self.inner, camera, &options),
        };
        let drawn = watched(py, threads, "render", None, draw)?;
        let size = (drawn.height as usize, drawn.width as usize);
        static PLANES: PyOnceLock<Py<PyType>> = PyOnceLock::new();
        PLANES.import(py, "vehicle_gaussians._gradients", "Planes")?.call1((
            picture(py, size, drawn.color),
            owned(py, size, drawn.alpha),
            owned(py, size, drawn.depth),
        ))
    }

    /// Goes back from the gradient of a loss with respect to the planes of a picture, as render_planes draws it, to
    /// Gradients of everything the picture is made of. color (height, width, 3), alpha and depth (height, width) are
    /// float32, finite; None where the loss does not look. The picture is drawn again on the way.
    ///
    /// Constants are the order of depth, the pixels a Gaussian reaches, what is too faint to be drawn, near and far.
    ///
    ///     >>> planes = car.render_planes(camera)
    ///     >>> gradients = car.render_backward(camera, color=2 * (planes.color - photograph))
    ///     >>> gradients.means.shape == car.means.shape
    ///     True
    #[pyo3(signature = (
        camera, color=None, alpha=None, depth=None, background=None, threads=0, *,
        antialiased=false, near=0.01, far=1e10, sh_degree=3, depth_mode="expected", backend="auto"
    ), text_signature = "(self, camera, color=None, alpha=None, depth=None, background='white', threads=0, *, \
        antialiased=False, near=0.01, far=1e10, sh_degree=3, depth_mode='expected', backend='auto')")]
    fn render_backward<'py>(
        &self,
        py: Python<'py>,
        camera: &Bound<'py, Camera>,
        color: Option<&Bound<'py, PyAny>>,
        alpha: Option<&Bound<'py, PyAny>>,
        depth: Option<&Bound<'py, PyAny>>,
        background: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = whole::threads)] threads: usize,
        antialiased: bool,
        near: f32,
        far: f32,
        #[pyo3(from_py_with = whole::sh_degree)] sh_degree: u8,
        depth_mode: &str,
        backend: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        let options =
            RenderOptions { antialiased, near, far, sh_degree, ..planes(py, background, depth_mode)? };
        let camera = &camera.get().inner;
        if color.is_none() && alpha.is_none() && depth.is_none() {
            return Err(bad_value(py, "color, alpha, depth", "all None", "at least one of them"));
        }
        let size = (camera.height as usize, camera.width as usize);
        let gradient = PictureGradient {
            width: camera.width,
            height: camera.height,
            color: plane::<3>(color, "color", size)?.as_chunks::<3>().0.to_vec(),
            alpha: plane::<1>(alpha, "alpha", size)?,
            depth: plane::<1>(depth, "depth", size)?,
        };
        let device = device(py, backend)?;
        let back = |watch: &Watch| match &device {
            Some(device) => device.backward(&self.inner, camera, &options, &gradient),
            None => RENDERER.watched(watch).backward(&self.inner, camera, &options, &gradient),
        };
        let g = watched(py, threads, "render", None, back)?;
        let n = self.inner.len();
        let pose = [g.pose.rotation, g.pose.translation].map(|v| v.to_array()).concat();
        static GRADIENTS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
        GRADIENTS.import(py, "vehicle_gaussians._gradients", "Gradients")?.call1((
            owned(py, (n, 3), g.means.into_flattened()),
            owned(py, (n, 3), g.scales.into_flattened()),
            owned(py, (n, 4), g.rotations.into_flattened()),
            owned(py, n, g.opacities),
            owned(py, (n, self.inner.sh_stride() / 3, 3), g.sh),
            owned(py, 3, g.background.to_vec()),
            owned(py, 6, pose),
            owned(py, (4, 4), g.pose.view_matrix.concat()),
        ))
    }

    /// Centres, metres. (n, 3)
    #[getter]
    fn means<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        view(this, (this.get().inner.len(), 3), this.get().inner.means().as_flattened())
    }

    /// Standard deviations along the Gaussians' own axes, metres. (n, 3)
    #[getter]
    fn scales<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        view(this, (this.get().inner.len(), 3), this.get().inner.scales().as_flattened())
    }

    /// vehicle_from_gaussian, unit quaternions (w, x, y, z). (n, 4)
    #[getter]
    fn quats<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        view(this, (this.get().inner.len(), 4), this.get().inner.rotations().as_flattened())
    }

    /// Peak opacities, 0 to 1. (n,)
    #[getter]
    fn opacities<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        view(this, this.get().inner.len(), this.get().inner.opacities())
    }

    /// Spherical harmonics in the order and with the signs of 3D Gaussian Splatting, RGB last:
    /// colour = 0.5 + sum of coefficient times basis. (n, (degree + 1)^2, 3)
    #[getter]
    fn sh<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let g = &this.get().inner;
        view(this, (g.len(), g.sh_stride() / 3, 3), g.sh())
    }

    /// Highest degree of the spherical harmonics, 0 to 3.
    #[getter]
    fn sh_degree(&self) -> u8 {
        self.inner.sh_degree()
    }

    /// Lowest and highest centre, metres, or None when there is no Gaussian. (2, 3)
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f32>>> {
        let (low, high) = self.inner.bounds()?;
        Some(owned(py, (2, 3), [low, high].concat()))
    }

    /// Parts for pickle: the arrays, which come back to the last bit.
    fn __reduce__<'py>(this: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Arrays<'py>)> {
        let arrays = (
            Self::means(this)?,
            Self::scales(this)?,
            Self::quats(this)?,
            Self::opacities(this)?,
            Self::sh(this)?,
        );
        Ok((parts::function(this.py(), "_gaussians")?, arrays))
    }

    fn __copy__(this: Bound<'_, Self>) -> Bound<'_, Self> {
        this
    }

    fn __deepcopy__<'py>(this: Bound<'py, Self>, _memo: &Bound<'py, PyDict>) -> Bound<'py, Self> {
        this
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        (self.inner.len(), self.inner.sh_degree()).hash(&mut hasher);
        // Adding 0 makes one of both zeros, which are equal.
        self.inner.means().first().map(|mean| mean.map(|c| (c + 0.0).to_bits())).hash(&mut hasher);
        hasher.finish()
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        format!("Gaussians({}, sh_degree={})", self.inner.len(), self.inner.sh_degree())
    }
}

/// Means, scales, quaternions, opacities, spherical harmonics.
type Arrays<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray3<f32>>,
);

/// Gaussians of the parts that `Gaussians.__reduce__` gives.
#[pyfunction]
#[pyo3(name = "_gaussians")]
pub(crate) fn of_arrays(
    means: &Bound<'_, PyAny>,
    scales: &Bound<'_, PyAny>,
    quats: &Bound<'_, PyAny>,
    opacities: &Bound<'_, PyAny>,
    sh: &Bound<'_, PyAny>,
) -> PyResult<Gaussians> {
    Gaussians::from_arrays(means, scales, quats, opacities, sh)
}

/// A read-only array over memory of the Gaussians.
fn view<'py, T: Element, D: numpy::ndarray::IntoDimension>(
    owner: &Bound<'py, Gaussians>,
    shape: D,
    values: &[T],
) -> PyResult<Bound<'py, PyArray<T, D::Dim>>> {
    let view = ArrayView::from_shape(shape.into_dimension(), values).expect("as many values as the shape");
    // SAFETY: the class is frozen and never touches its arrays, so that they stay as they are while it lives.
    #[expect(unsafe_code)]
    unsafe {
        borrowed(owner.clone().into_any(), &view)
    }
}

/// Arrays of Gaussians and of planes.
const FLOATS: &str = "an array of floats";

/// An (n, N) array of float32.
fn rows<const N: usize>(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<Vec<[f32; N]>> {
    let array = floats(object, argument, FLOATS)?;
    match array.shape() {
        [_, n] if *n == N => Ok(values(&array)?.as_chunks::<N>().0.to_vec()),
        other => Err(bad_value(object.py(), argument, &shape_text(other), &format!("(n, {N})"))),
    }
}

pub(crate) fn parse_background(object: &Bound<'_, PyAny>) -> PyResult<Background> {
    let Ok(name) = object.cast::<PyString>() else {
        return vector::<3>(object, "background").map(|rgb| Background::Color(rgb.map(|c| c as f32)));
    };
    match name.to_str()? {
        "white" => Ok(Background::Color([1.0; 3])),
        "black" => Ok(Background::Color([0.0; 3])),
        "transparent" => Ok(Background::Transparent),
        other => {
            let allowed = "white, black, transparent, or (r, g, b) from 0 to 1";
            Err(bad_value(object.py(), "background", &format!("{other:?}"), allowed))
        }
    }
}

/// The graphics processor, where it is asked for.
fn device(py: Python<'_>, backend: &str) -> PyResult<Option<Trainer>> {
    match choice(py, "backend", backend)? {
        Backend::Gpu => Ok(Some(detached(py, || trainer(Backend::Gpu))?.0)),
        Backend::Auto | Backend::Cpu => Ok(None),
    }
}

/// How planes are drawn, from what is not a number: a background, white for None, and a mode of depth.
fn planes(
    py: Python<'_>,
    background: Option<&Bound<'_, PyAny>>,
    depth_mode: &str,
) -> PyResult<RenderOptions> {
    let background = background.map_or(Ok(Background::Color([1.0; 3])), parse_background)?;
    let depth_mode = choice(py, "depth_mode", depth_mode)?;
    Ok(RenderOptions { background, depth_mode, ..RenderOptions::default() })
}

/// A plane of a picture's gradient, of `N` numbers a pixel, finite; empty for None.
fn plane<const N: usize>(
    object: Option<&Bound<'_, PyAny>>,
    argument: &str,
    (height, width): (usize, usize),
) -> PyResult<Vec<f32>> {
    let Some(object) = object else { return Ok(vec![]) };
    let py = object.py();
    let array = floats(object, argument, FLOATS)?;
    let (fits, allowed) = match N {
        1 => (array.shape() == [height, width], format!("({height}, {width})")),
        _ => (array.shape() == [height, width, N], format!("({height}, {width}, {N})")),
    };
    if !fits {
        return Err(bad_value(py, argument, &shape_text(array.shape()), &allowed));
    }
    let values = values(&array)?;
    if let Some(i) = values.iter().position(|value| !value.is_finite()) {
        let (row, column) = (i / (width * N), i % (width * N) / N);
        let found = values[i].to_string();
        return Err(bad_value(py, &format!("{argument}[{row}, {column}]"), &found, "finite numbers"));
    }
    Ok(values.to_vec())
}

/// What the numbers of a picture are.
#[derive(Clone, Copy)]
enum Kind {
    Bytes,
    Floats,
}

impl Kind {
    fn of(dtype: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = dtype.py();
        let asked = PyArrayDescr::new(py, dtype)?;
        if asked.is_equiv_to(&numpy::dtype::<u8>(py)) {
            Ok(Self::Bytes)
        } else if asked.is_equiv_to(&numpy::dtype::<f32>(py)) {
            Ok(Self::Floats)
        } else {
            Err(bad_type("dtype", &asked.to_string(), "uint8 or float32"))
        }
    }
}

pub(crate) fn picture<T: Element, const N: usize>(
    py: Python<'_>,
    (height, width): (usize, usize),
    pixels: Vec<[T; N]>,
) -> Bound<'_, PyAny> {
    owned(py, (height, width, N), pixels.into_flattened()).into_any()
}

/// RGBA with straight alpha.
fn straight(drawn: &Rendered) -> Vec<[f32; 4]> {
    let pixel = |(c, &a): (&[f32; 3], &f32)| {
        let scale = if a > 0.0 { 1.0 / a } else { 0.0 };
        [c[0] * scale, c[1] * scale, c[2] * scale, a]
    };
    drawn.color.iter().zip(&drawn.alpha).map(pixel).collect()
}
