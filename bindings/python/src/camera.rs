//! `Camera`, and poses from other software's conventions.

use crate::arrays::{
    matrix3, matrix4, numbers, owned, pose, pose_rows, rows, shape_text, similarity, vector,
};
use crate::errors::{bad_type, bad_value, from_library};
use crate::parts::{self, CameraParts};
use crate::whole;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use std::hash::{DefaultHasher, Hash, Hasher};
use vg::Pose;
use vg::geometry::{CameraModel, Distortion, Intrinsics, OpenCvModel, Similarity, frame};

/// An immutable posed camera: methods return new cameras.
///
///     >>> K = [[600, 0, 320], [0, 600, 240], [0, 0, 1]]
///     >>> camera = Camera.from_matrix(K, vehicle_from_camera, width=640, height=480)
///     >>> half = camera.scaled(320, 240)
#[pyclass(module = "vehicle_gaussians", frozen, eq)]
#[derive(Clone, PartialEq)]
pub(crate) struct Camera {
    pub(crate) inner: vg::Camera,
}

#[pymethods]
impl Camera {
    /// Makes a camera from a COLMAP camera model, by name or number, and its parameters in COLMAP's order.
    ///
    /// vehicle_from_camera is a 3x4 or 4x4 rigid transform in metres; camera axes are x right, y down, z forward.
    ///
    ///     >>> camera = Camera.from_colmap("SIMPLE_RADIAL", 640, 480, [600, 320, 240, -0.05], vehicle_from_camera)
    ///     >>> camera.model
    ///     'OPENCV'
    #[staticmethod]
    #[pyo3(signature = (model, width, height, params, vehicle_from_camera))]
    fn from_colmap(
        model: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::width)] width: u32,
        #[pyo3(from_py_with = whole::height)] height: u32,
        params: &Bound<'_, PyAny>,
        vehicle_from_camera: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let py = model.py();
        let model = camera_model(model)?;
        let (shape, values) = numbers(params, "params", "a list of numbers")?;
        if shape.len() != 1 {
            return Err(bad_value(py, "params", &shape_text(&shape), "a list of numbers"));
        }
        let pose = pose(vehicle_from_camera, "vehicle_from_camera")?;
        vg::Camera::from_colmap("camera", model, width, height, &values, pose)
            .map(|inner| Self { inner })
            .map_err(|e| from_library(py, e))
    }

    /// Makes a camera from a 3x3 matrix K of focal lengths and principal point in pixels, without skew.
    ///
    /// The centre of the top-left pixel is (0.5, 0.5), as in COLMAP: a principal point in the centre is width / 2. For
    /// the K of OpenCV's calibration use from_opencv. distortion is k1, k2, p1, p2[, k3[, k4, k5, k6]].
    ///
    ///     >>> camera = Camera.from_matrix([[600, 0, 320], [0, 600, 240], [0, 0, 1]], vehicle_from_camera, 640, 480)
    #[staticmethod]
    #[pyo3(signature = (K, vehicle_from_camera, width, height, distortion=None))]
    #[expect(non_snake_case)]
    fn from_matrix(
        K: &Bound<'_, PyAny>,
        vehicle_from_camera: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::width)] width: u32,
        #[pyo3(from_py_with = whole::height)] height: u32,
        distortion: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let k = matrix3(K, "K")?;
        let pose = Some(vehicle_from_camera);
        let mut camera = Self::from_opencv(K, pose, width, height, distortion, false, None, None, None)?;
        (camera.inner.intrinsics.cx, camera.inner.intrinsics.cy) = (k[2], k[5]);
        Ok(camera)
    }

    /// Makes a camera from OpenCV's calibration. OpenCV has the centre of the top-left pixel at (0, 0), so half a pixel
    /// is added to the principal point.
    ///
    /// distortion is that of cv2.calibrateCamera or, with fisheye=True, of cv2.fisheye. rvec and tvec replace the pose,
    /// as cv2.solvePnP and cv2.calibrateCamera return them, from the world of the object's points. vehicle_from_world
    /// is a 4x4 similarity; without it, that world is the vehicle's frame.
    ///
    ///     >>> K = [[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]]
    ///     >>> camera = Camera.from_opencv(K, vehicle_from_camera, 640, 480)
    ///     >>> float(camera.K[0, 2])
    ///     320.0
    ///     >>> rvec, tvec = [0.0, 0.0, 1.5], [0.0, 0.5, 6.0]
    ///     >>> camera = Camera.from_opencv(K, width=640, height=480, distortion=[-0.1, 0, 0, 0], rvec=rvec, tvec=tvec)
    #[staticmethod]
    #[pyo3(signature = (
        K, vehicle_from_camera=None, width=0, height=0, distortion=None, *,
        fisheye=false, rvec=None, tvec=None, vehicle_from_world=None
    ), text_signature = "(K, vehicle_from_camera=None, width=0, height=0, distortion=None, *, fisheye=False, \
        rvec=None, tvec=None, vehicle_from_world=None)")]
    #[expect(non_snake_case)]
    fn from_opencv(
        K: &Bound<'_, PyAny>,
        vehicle_from_camera: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole::width)] width: u32,
        #[pyo3(from_py_with = whole::height)] height: u32,
        distortion: Option<&Bound<'_, PyAny>>,
        fisheye: bool,
        rvec: Option<&Bound<'_, PyAny>>,
        tvec: Option<&Bound<'_, PyAny>>,
        vehicle_from_world: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = K.py();
        let model = if fisheye { OpenCvModel::Fisheye } else { OpenCvModel::Standard };
        let distortion = match distortion {
            None => Vec::new(),
            // OpenCV also returns (1, n) and (n, 1).
            Some(object) => numbers(object, "distortion", "a list of numbers")?.1,
        };
        let pose = match (vehicle_from_camera, rvec, tvec) {
            (Some(matrix), None, None) if vehicle_from_world.is_none() => {
                pose(matrix, "vehicle_from_camera")?
            }
            (None, Some(rvec), Some(tvec)) => opencv_pose(py, rvec, tvec, vehicle_from_world)?,
            (matrix, ..) => {
                let found = if matrix.is_some() { "more than one pose" } else { "no whole pose" };
                let allowed = "vehicle_from_camera, or rvec and tvec";
                return Err(bad_value(py, "vehicle_from_camera, rvec, tvec", found, allowed));
            }
        };
        vg::Camera::from_opencv("camera", &matrix3(K, "K")?, &distortion, model, width, height, pose)
            .map(|inner| Self { inner })
            .map_err(|e| from_library(py, e))
    }

    /// Makes a pinhole camera at eye, a point of the vehicle's frame in metres, whose optical axis goes through target.
    /// Its picture shows fov_y_degrees from top to bottom, and the direction up points up. For another lens use
    /// with_pose.
    ///
    ///     >>> camera = Camera.look_at((6, -4, 1.5), (0, 0, 0.7), 640, 480)
    ///     >>> camera.project([[0, 0, 0.7]]).round(6)
    ///     array([[320., 240.]])
    #[staticmethod]
    #[pyo3(signature = (eye, target, width, height, *, fov_y_degrees=35.0, up=None),
        text_signature = "(eye, target, width, height, *, fov_y_degrees=35.0, up=(0.0, 0.0, 1.0))")]
    fn look_at(
        eye: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::width)] width: u32,
        #[pyo3(from_py_with = whole::height)] height: u32,
        fov_y_degrees: f64,
        up: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (from, to) = (vector::<3>(eye, "eye")?.into(), vector::<3>(target, "target")?.into());
        let up = up.map_or(Ok([0.0, 0.0, 1.0]), |up| vector::<3>(up, "up"))?;
        vg::Camera::look_at(from, to, up.into(), fov_y_degrees, width, height)
            .map(|inner| Self { inner })
            .map_err(|e| from_library(eye.py(), e))
    }

    /// Projects points (n, 3) of the vehicle's frame, metres, to pixels (n, 2), column and row; with depth=True returns
    /// a pair of the pixels and the depths (n,) along the optical axis, metres. NaN where the camera does not see a
    /// point: behind it, and beyond the angle at which its lens folds back. The centre of the top-left pixel is (0.5,
    /// 0.5); pixels beyond 0 to width and 0 to height are outside the picture.
    ///
    ///     >>> pixels, depths = camera.project(car.means, depth=True)
    #[pyo3(signature = (points, depth=false))]
    fn project<'py>(&self, points: &Bound<'py, PyAny>, depth: bool) -> PyResult<Bound<'py, PyAny>> {
        let py = points.py();
        let points = rows::<3>(points, "points")?;
        let (mut pixels, mut depths) = (Vec::with_capacity(2 * points.len()), Vec::new());
        for seen in self.inner.pixels_and_depths(&points) {
            let (pixel, along) = seen.unwrap_or(([f64::NAN; 2], f64::NAN));
            pixels.extend(pixel);
            depths.push(along);
        }
        let pixels = owned(py, (points.len(), 2), pixels);
        match depth {
            false => Ok(pixels.into_any()),
            true => Ok((pixels, owned(py, points.len(), depths)).into_pyobject(py)?.into_any()),
        }
    }

    /// Returns the points (n, 3) of the vehicle's frame, metres, behind pixels (n, 2), column and row, at depths (n,)
    /// along the optical axis, metres. NaN where a depth is no measurement (0, negative, NaN), and where the lens
    /// defines no ray.
    ///
    ///     >>> point = camera.unproject([[320.0, 240.0]], [6.0])
    #[pyo3(signature = (pixels, depths))]
    fn unproject<'py>(
        &self,
        pixels: &Bound<'py, PyAny>,
        depths: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let py = pixels.py();
        let pixels = rows::<2>(pixels, "pixels")?;
        let (shape, depths) = numbers(depths, "depths", "an (n,) array")?;
        if shape != [pixels.len()] {
            let allowed = format!("({},), one for each pixel", pixels.len());
            return Err(bad_value(py, "depths", &shape_text(&shape), &allowed));
        }
        let point = |(pixel, depth): (&[f64; 2], &f64)| {
            self.inner.vehicle_from_pixel(*pixel, *depth).map_or([f64::NAN; 3], |point| point.to_array())
        };
        let points: Vec<f64> = pixels.iter().zip(&depths).flat_map(point).collect();
        Ok(owned(py, (pixels.len(), 3), points))
    }

    /// The camera for pictures resized to width x height.
    ///
    ///     >>> half = camera.scaled(camera.width // 2, camera.height // 2)
    #[pyo3(signature = (width, height))]
    fn scaled(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = whole::width)] width: u32,
        #[pyo3(from_py_with = whole::height)] height: u32,
    ) -> PyResult<Self> {
        let resized = self.inner.resized(width, height).map_err(|e| from_library(py, e))?;
        Ok(Self { inner: resized })
    }

    /// The camera of the part image[y : y + height, x : x + width] of its pictures.
    ///
    ///     >>> part = camera.cropped(x=100, y=50, width=64, height=32)  # of image[50:82, 100:164]
    #[pyo3(signature = (x, y, width, height))]
    fn cropped(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = whole::x)] x: u32,
        #[pyo3(from_py_with = whole::y)] y: u32,
        #[pyo3(from_py_with = whole::width)] width: u32,
        #[pyo3(from_py_with = whole::height)] height: u32,
    ) -> PyResult<Self> {
        let part = self.inner.cropped(x, y, width, height).map_err(|e| from_library(py, e))?;
        Ok(Self { inner: part })
    }

    /// The camera, including its lens, at another pose.
    ///
    ///     >>> moved = camera.with_pose(other_vehicle_from_camera)
    #[pyo3(signature = (vehicle_from_camera))]
    fn with_pose(&self, vehicle_from_camera: &Bound<'_, PyAny>) -> PyResult<Self> {
        let vehicle_from_camera = pose(vehicle_from_camera, "vehicle_from_camera")?;
        Ok(Self { inner: vg::Camera { vehicle_from_camera, ..self.inner } })
    }

    /// Width of the picture, pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.inner.width
    }

    /// Height of the picture, pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.inner.height
    }

    /// Camera matrix, 3x3; the centre of the top-left pixel is (0.5, 0.5).
    #[getter(K)]
    fn matrix<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let Intrinsics { fx, fy, cx, cy } = self.inner.intrinsics;
        owned(py, (3, 3), vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
    }

    /// Pose, 4x4, metres.
    #[getter]
    fn vehicle_from_camera<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix4(py, &self.inner.vehicle_from_camera.to_row_major())
    }

    /// The COLMAP model that holds this lens: PINHOLE, OPENCV, FULL_OPENCV or OPENCV_FISHEYE.
    #[getter]
    fn model(&self) -> &'static str {
        self.colmap().0.name()
    }

    /// The parameters of that model, in COLMAP's order.
    #[getter]
    fn params<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.colmap().1)
    }

    /// Parts for pickle: the camera comes back to the last bit.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, CameraParts)> {
        let (model, params) = self.colmap();
        let pose = self.inner.vehicle_from_camera.to_row_major();
        let parts = (model.name(), self.inner.width, self.inner.height, params, pose);
        Ok((parts::function(py, "_camera")?, parts))
    }

    fn __copy__(this: Bound<'_, Self>) -> Bound<'_, Self> {
        this
    }

    fn __deepcopy__<'py>(this: Bound<'py, Self>, _memo: &Bound<'py, PyDict>) -> Bound<'py, Self> {
        this
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        (self.inner.width, self.inner.height).hash(&mut hasher);
        // Adding 0 turns -0 into 0, which is equal to it.
        self.inner.center().to_array().map(|c| (c + 0.0).to_bits()).hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        let [x, y, z] = self.inner.center().to_array();
        let (model, params) = self.colmap();
        let (width, height) = (self.inner.width, self.inner.height);
        format!(
            "Camera({model}, {width}x{height}, {params:?}, at ({x:.3}, {y:.3}, {z:.3}) m)",
            model = model.name()
        )
    }
}

impl Camera {
    /// The smallest of COLMAP's models that holds the lens, with its parameters.
    fn colmap(&self) -> (CameraModel, Vec<f64>) {
        let Intrinsics { fx, fy, cx, cy } = self.inner.intrinsics;
        let mut params = vec![fx, fy, cx, cy];
        let model = match self.inner.distortion {
            Distortion::None => CameraModel::Pinhole,
            Distortion::Fisheye { k } => {
                params.extend(k);
                CameraModel::OpenCvFisheye
            }
            Distortion::Brown { k, p } => {
                params.extend([k[0], k[1], p[0], p[1]]);
                if k[2..] == [0.0; 4] {
                    CameraModel::OpenCv
                } else {
                    params.extend(&k[2..]);
                    CameraModel::FullOpenCv
                }
            }
        };
        (model, params)
    }
}

fn camera_model(model: &Bound<'_, PyAny>) -> PyResult<CameraModel> {
    let (known, found) = if let Ok(name) = model.cast::<PyString>() {
        (CameraModel::from_name(name.to_str()?), name.to_string())
    } else if let Ok(id) = model.extract::<i32>() {
        (CameraModel::from_id(id), id.to_string())
    } else {
        return Err(bad_type("model", &model.get_type().name()?.to_string(), "COLMAP's name or number"));
    };
    known.ok_or_else(|| {
        let all = CameraModel::ALL.map(|m| format!("{} ({})", m.name(), m as i32)).join(", ");
        let allowed = format!("{all}; undistort other models first (colmap image_undistorter)");
        bad_value(model.py(), "model", &found, &allowed)
    })
}

/// Returns vehicle_from_camera (4x4) for COLMAP's world-to-camera quaternion (w, x, y, z) and translation.
///
/// vehicle_from_world is the similarity (4x4) from the model's world to the vehicle's frame; without it, the two
/// are the same. pycolmap stores quaternions as (x, y, z, w).
///
///     >>> vehicle_from_camera = pose_from_colmap([1, 0, 0, 0], [0, 0, 5], vehicle_from_world)
#[pyfunction]
#[pyo3(signature = (qvec, tvec, vehicle_from_world=None))]
pub(crate) fn pose_from_colmap<'py>(
    qvec: &Bound<'py, PyAny>,
    tvec: &Bound<'py, PyAny>,
    vehicle_from_world: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (qvec_wxyz, translation) = (vector::<4>(qvec, "qvec")?, vector::<3>(tvec, "tvec")?);
    let pose = frame::pose_from_colmap("qvec", qvec_wxyz, translation);
    in_vehicle_frame(qvec.py(), pose, vehicle_from_world)
}

/// Returns vehicle_from_camera (4x4) for OpenCV's world-to-camera rvec and tvec, as cv2.solvePnP returns them.
///
/// vehicle_from_world is the similarity (4x4) from that world to the vehicle's frame; without it, the two are the
/// same.
///
///     >>> vehicle_from_camera = pose_from_opencv([0.0, 0.0, 1.5], [0.0, 0.5, 6.0])
#[pyfunction]
#[pyo3(signature = (rvec, tvec, vehicle_from_world=None))]
pub(crate) fn pose_from_opencv<'py>(
    rvec: &Bound<'py, PyAny>,
    tvec: &Bound<'py, PyAny>,
    vehicle_from_world: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let py = rvec.py();
    Ok(matrix4(py, &opencv_pose(py, rvec, tvec, vehicle_from_world)?.to_row_major()))
}

fn opencv_pose(
    py: Python<'_>,
    rvec: &Bound<'_, PyAny>,
    tvec: &Bound<'_, PyAny>,
    vehicle_from_world: Option<&Bound<'_, PyAny>>,
) -> PyResult<Pose> {
    // OpenCV returns (3, 1).
    let three = |object, argument| {
        let allowed = "3 numbers";
        let (shape, values) = numbers(object, argument, allowed)?;
        <[f64; 3]>::try_from(values).map_err(|_| bad_value(py, argument, &shape_text(&shape), allowed))
    };
    let pose = frame::pose_from_opencv("rvec, tvec", three(rvec, "rvec")?, three(tvec, "tvec")?)
        .map_err(|e| from_library(py, e))?;
    match vehicle_from_world {
        None => Ok(pose),
        Some(matrix) => Ok(similarity(matrix, "vehicle_from_world")?.transform_pose(&pose)),
    }
}

/// Returns vehicle_from_camera (4x4) for a camera-to-world matrix with OpenGL's camera axes (x right, y up, z
/// backward), as in nerfstudio's transforms.json and in Blender.
///
/// vehicle_from_world is the similarity (4x4) from that world to the vehicle's frame; without it, the two are the
/// same.
///
///     >>> vehicle_from_camera = pose_from_opengl(frame["transform_matrix"])
#[pyfunction]
#[pyo3(signature = (camera_to_world, vehicle_from_world=None))]
pub(crate) fn pose_from_opengl<'py>(
    camera_to_world: &Bound<'py, PyAny>,
    vehicle_from_world: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows = pose_rows(camera_to_world, "camera_to_world")?;
    let pose = frame::pose_from_opengl("camera_to_world", &rows);
    in_vehicle_frame(camera_to_world.py(), pose, vehicle_from_world)
}

/// Returns vehicle_from_camera (4x4) for a vehicle that was tracked as a box, from the poses (3x4 or 4x4, metres)
/// of the box and of the camera in a common frame (ego, map, UTM) at the time of the picture. The box's axes are x
/// forward, y left, z up, and its origin lies on the vehicle's plane of symmetry.
///
///     >>> vehicle_from_camera = pose_from_box(ego_from_vehicle, ego_from_camera)
#[pyfunction]
#[pyo3(signature = (ego_from_vehicle, ego_from_camera))]
pub(crate) fn pose_from_box<'py>(
    ego_from_vehicle: &Bound<'py, PyAny>,
    ego_from_camera: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (vehicle, camera) =
        (pose(ego_from_vehicle, "ego_from_vehicle")?, pose(ego_from_camera, "ego_from_camera")?);
    Ok(matrix4(ego_from_vehicle.py(), &frame::pose_from_box(&vehicle, &camera).to_row_major()))
}

fn in_vehicle_frame<'py>(
    py: Python<'py>,
    world_from_camera: vg::Result<Pose>,
    vehicle_from_world: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut pose = world_from_camera.map_err(|e| from_library(py, e))?;
    if let Some(matrix) = vehicle_from_world {
        pose = similarity(matrix, "vehicle_from_world")?.transform_pose(&pose);
    }
    Ok(matrix4(py, &pose.to_row_major()))
}

/// Returns the similarity (4x4) that best maps source to target, both (n, 3) with n >= 3 (Umeyama 1991): for
/// example vehicle_from_world from camera centres that are known in both frames.
///
///     >>> vehicle_from_world = similarity_from_points(centers_in_world, centers_in_vehicle)
#[pyfunction]
#[pyo3(signature = (source, target))]
pub(crate) fn similarity_from_points<'py>(
    source: &Bound<'py, PyAny>,
    target: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let py = source.py();
    let points = |object: &Bound<'py, PyAny>, argument: &str| {
        let allowed = "an (n, 3) array";
        let (shape, values) = numbers(object, argument, allowed)?;
        match shape[..] {
            [_, 3] => Ok(values.as_chunks::<3>().0.iter().map(|&p| p.into()).collect::<Vec<_>>()),
            _ => Err(bad_value(py, argument, &shape_text(&shape), allowed)),
        }
    };
    let found = Similarity::umeyama(&points(source, "source")?, &points(target, "target")?);
    Ok(matrix4(py, &found.map_err(|e| from_library(py, e))?.to_row_major()))
}
