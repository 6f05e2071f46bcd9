//! Cameras, and poses from other software's conventions.

use super::guard::guarded;
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use glam::DVec3;
use vg::geometry::camera::{CameraModel, OpenCvModel};
use vg::geometry::distortion::Distortion;
use vg::geometry::{Camera, Pose, Similarity, frame};
use vg::{Error, Result};

/// COLMAP's camera models and their numbers. Undistort pictures of other models first, with
/// `colmap image_undistorter`.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_camera_model {
    /// f, cx, cy
    SimplePinhole = 0,
    /// fx, fy, cx, cy
    Pinhole = 1,
    /// f, cx, cy, k
    SimpleRadial = 2,
    /// f, cx, cy, k1, k2
    Radial = 3,
    /// fx, fy, cx, cy, k1, k2, p1, p2
    Opencv = 4,
    /// fx, fy, cx, cy, k1, k2, k3, k4
    OpencvFisheye = 5,
    /// fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
    FullOpencv = 6,
}

/// A camera: its size, its lens, and where it stands. It lies inside `vg_view`, so its size never changes.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_camera {
    /// `sizeof(vg_camera)`.
    pub struct_size: usize,
    /// Columns, 1 to 8192.
    pub width: u32,
    /// Rows, 1 to 8192.
    pub height: u32,
    /// A `vg_camera_model`.
    pub model: i32,
    /// Reserved: 0.
    pub flags: u32,
    /// The model's parameters in COLMAP's order, pixels; the rest must be 0. The centre of the top-left pixel is
    /// (0.5, 0.5).
    pub params: [f64; 16],
    /// Camera to vehicle, the first three rows of a 4x4 matrix, row-major: r00 r01 r02 tx, r10 r11 r12 ty,
    /// r20 r21 r22 tz; metres. A rotation up to 1e-2, which is removed; mirrors and scales are refused.
    pub vehicle_from_camera: [f64; 12],
    /// Reserved: 0.
    pub reserved: [u64; 4],
}

const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

unsafe impl Versioned for vg_camera {
    const NAME: &'static str = "vg_camera";
    const FIRST_SIZE: usize = 280;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            width: 0,
            height: 0,
            model: vg_camera_model::Pinhole as i32,
            flags: 0,
            params: [0.0; 16],
            vehicle_from_camera: IDENTITY,
            reserved: [0; 4],
        }
    }
}

impl vg_camera {
    pub(super) fn of(camera: &Camera) -> Self {
        let i = camera.intrinsics;
        let four = [i.fx, i.fy, i.cx, i.cy];
        let (model, rest): (_, &[f64]) = match &camera.distortion {
            Distortion::None => (vg_camera_model::Pinhole, &[]),
            Distortion::Fisheye { k } => (vg_camera_model::OpencvFisheye, k),
            Distortion::Brown { k, p } => {
                (vg_camera_model::FullOpencv, &[k[0], k[1], p[0], p[1], k[2], k[3], k[4], k[5]])
            }
        };
        let mut params = [0.0; 16];
        params[..4].copy_from_slice(&four);
        params[4..4 + rest.len()].copy_from_slice(rest);
        Self {
            width: camera.width,
            height: camera.height,
            model: model as i32,
            params,
            vehicle_from_camera: camera.vehicle_from_camera.to_row_major(),
            ..Self::initial()
        }
    }
}

/// Reads and checks a camera; `argument` names it in errors.
pub(super) fn camera(argument: &str, camera: &vg_camera) -> Result<Camera> {
    let field = |name: &str| format!("{argument}.{name}");
    if camera.struct_size != size_of::<vg_camera>() {
        let (found, allowed) = (camera.struct_size.to_string(), size_of::<vg_camera>().to_string());
        return Err(Error::argument(field("struct_size"), found, format!("sizeof(vg_camera), {allowed}")));
    }
    read::zero(&field("flags"), camera.flags == 0)?;
    read::zero(&field("reserved"), camera.reserved == [0; 4])?;
    let model = model(&field("model"), camera.model)?;
    let (used, unused) = camera.params.split_at(model.parameter_count());
    if let Some(i) = unused.iter().position(|&p| p != 0.0) {
        let index = used.len() + i;
        let allowed = format!("0: {} has {} parameters", model.name(), used.len());
        return Err(Error::argument(field(&format!("params[{index}]")), unused[i].to_string(), allowed));
    }
    let pose = Pose::from_row_major(&field("vehicle_from_camera"), &camera.vehicle_from_camera)?;
    Camera::from_colmap(argument, model, camera.width, camera.height, used, pose)
}

fn model(argument: &str, id: i32) -> Result<CameraModel> {
    CameraModel::from_id(id).ok_or_else(|| {
        let known: Vec<String> =
            CameraModel::ALL.iter().map(|m| format!("{} ({})", *m as i32, m.name())).collect();
        let allowed = format!(
            "{}; undistort pictures of other models first, with colmap image_undistorter",
            known.join(", ")
        );
        Error::argument(argument, id.to_string(), allowed)
    })
}

/// Transforms a pose from the world to the vehicle's frame by an optional similarity.
unsafe fn in_vehicle(world_from_camera: Pose, vehicle_from_world: *const f64) -> Result<Pose> {
    if vehicle_from_world.is_null() {
        return Ok(world_from_camera);
    }
    let matrix = unsafe { read::fixed("vehicle_from_world", vehicle_from_world)? };
    let vehicle_from_world = Similarity::from_row_major("vehicle_from_world", &matrix)?;
    Ok(vehicle_from_world.transform_pose(&world_from_camera))
}

unsafe fn optional_pose(argument: &str, pose: *const f64) -> Result<Pose> {
    if pose.is_null() {
        return Ok(Pose::IDENTITY);
    }
    Pose::from_row_major(argument, &unsafe { read::fixed(argument, pose)? })
}

pub(super) unsafe fn write_pose(out: *mut f64, pose: &Pose) -> Result<()> {
    let rows = pose.to_row_major();
    if !rows.iter().all(|v| v.is_finite()) {
        return Err(Error::argument("pose", "numbers that overflow", "a finite result"));
    }
    unsafe { out.cast::<[f64; 12]>().write_unaligned(rows) };
    Ok(())
}

/// Sets `*camera` to a pinhole without size at the origin. `size`: `sizeof *camera`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_init(camera: *mut vg_camera, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("camera", camera, size)) }
}

/// A camera from one of COLMAP's models.
///
/// - model: a `vg_camera_model`; COLMAP's numbers.
/// - params, param_count: as many as the model has, in COLMAP's order.
/// - vehicle_from_camera: 12 numbers as in `vg_camera`; NULL: the identity.
/// - out: receives the whole camera, `struct_size` included; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_from_colmap_model(
    model: i32,
    params: *const f64,
    param_count: usize,
    width: u32,
    height: u32,
    vehicle_from_camera: *const f64,
    out: *mut vg_camera,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "where to put the camera")?;
            let id = model;
            let model = self::model("model", id)?;
            if param_count != model.parameter_count() {
                let allowed = format!("{} for {}", model.parameter_count(), model.name());
                return Err(Error::argument("param_count", param_count.to_string(), allowed));
            }
            let given = read::numbers("params", params, param_count)?;
            let pose = optional_pose("vehicle_from_camera", vehicle_from_camera)?;
            Camera::from_colmap("camera", model, width, height, given, pose)?;
            let mut camera = vg_camera {
                width,
                height,
                model: id,
                vehicle_from_camera: pose.to_row_major(),
                ..vg_camera::initial()
            };
            camera.params[..given.len()].copy_from_slice(given);
            out.write_unaligned(camera);
            Ok(())
        })
    }
}

/// A camera from OpenCV's calibration, whose pixel centres are half a pixel from ours: cx and cy grow by 0.5.
///
/// - k: the 3x3 camera matrix, row-major, without skew.
/// - distortion, distortion_count: 0, 4, 5 or 8 numbers k1 k2 p1 p2 k3 k4 k5 k6, or 12 or 14 with zeros
///   behind the 8th; with `fisheye`, 0 or 4.
/// - fisheye: 0: `cv::calibrateCamera`'s model; 1: `cv::fisheye`'s.
/// - vehicle_from_camera: 12 numbers as in `vg_camera`; NULL: the identity.
/// - out: receives the whole camera, `struct_size` included; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_from_opencv(
    k: *const f64,
    distortion: *const f64,
    distortion_count: usize,
    fisheye: i32,
    width: u32,
    height: u32,
    vehicle_from_camera: *const f64,
    out: *mut vg_camera,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "where to put the camera")?;
            let k = read::fixed::<9>("k", k)?;
            let distortion = read::numbers("distortion", distortion, distortion_count)?;
            let kind = match read::flag("fisheye", fisheye)? {
                true => OpenCvModel::Fisheye,
                false => OpenCvModel::Standard,
            };
            let pose = optional_pose("vehicle_from_camera", vehicle_from_camera)?;
            let camera = Camera::from_opencv("camera", &k, distortion, kind, width, height, pose)?;
            out.write_unaligned(vg_camera::of(&camera));
            Ok(())
        })
    }
}

/// The camera of the picture resized to `width` x `height`.
///
/// - camera: is not changed.
/// - out: receives the camera; may be `camera` itself; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_scale(
    camera: *const vg_camera,
    width: u32,
    height: u32,
    out: *mut vg_camera,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe { guarded(out_error, || changed(camera, out, |camera| camera.resized(width, height))) }
}

/// The camera of the part of the picture that begins at column `x`, row `y`, and is `width` x `height`.
///
/// - camera: is not changed. The part must lie inside its picture.
/// - out: receives the camera; may be `camera` itself; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_crop(
    camera: *const vg_camera,
    x: u32,
    y: u32,
    width: u32,
    height: u32,
    out: *mut vg_camera,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe { guarded(out_error, || changed(camera, out, |camera| camera.cropped(x, y, width, height))) }
}

unsafe fn changed(
    camera: *const vg_camera,
    out: *mut vg_camera,
    change: impl FnOnce(&Camera) -> Result<Camera>,
) -> Result<()> {
    unsafe {
        read::not_null("out", out, "where to put the camera")?;
        let camera = self::camera("camera", &read::required("camera", camera)?)?;
        out.write_unaligned(vg_camera::of(&change(&camera)?));
    }
    Ok(())
}

/// A pose from COLMAP's `images.txt`: QW QX QY QZ and TX TY TZ, world to camera.
///
/// - qvec: 4 numbers w, x, y, z of any norm but zero.
/// - tvec: 3 numbers.
/// - vehicle_from_world: 16 numbers, a row-major 4x4 similarity that takes COLMAP's world, which lies anywhere and
///   has any scale, to the vehicle's frame in metres. NULL: the world is the vehicle's frame.
/// - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_pose_from_colmap(
    qvec: *const f64,
    tvec: *const f64,
    vehicle_from_world: *const f64,
    out: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "12 numbers")?;
            let (qvec, tvec) = (read::fixed("qvec", qvec)?, read::fixed("tvec", tvec)?);
            let pose = frame::pose_from_colmap("qvec, tvec", qvec, tvec)?;
            write_pose(out, &in_vehicle(pose, vehicle_from_world)?)
        })
    }
}

/// A pose from an OpenGL, Blender or nerfstudio matrix: camera to world, camera axes x right, y up, z backward.
///
/// - camera_to_world: 12 numbers, the first three rows, row-major.
/// - vehicle_from_world: 16 numbers, as in `vg_pose_from_colmap`. NULL: the world is the vehicle's frame.
/// - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_pose_from_opengl(
    camera_to_world: *const f64,
    vehicle_from_world: *const f64,
    out: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "12 numbers")?;
            let matrix = read::fixed("camera_to_world", camera_to_world)?;
            let pose = frame::pose_from_opengl("camera_to_world", &matrix)?;
            write_pose(out, &in_vehicle(pose, vehicle_from_world)?)
        })
    }
}

/// A pose from OpenCV's `cv::solvePnP`, `cv::calibrateCamera` or ArUco: world to camera. With `vg_camera_from_opencv` it
/// makes a whole camera.
///
/// - rvec: 3 numbers, a rotation vector: its direction is the axis, its length the angle in radians.
/// - tvec: 3 numbers.
/// - vehicle_from_world: 16 numbers, as in `vg_pose_from_colmap`. NULL: the world, where the object's points were
///   measured, is the vehicle's frame.
/// - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_pose_from_opencv(
    rvec: *const f64,
    tvec: *const f64,
    vehicle_from_world: *const f64,
    out: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "12 numbers")?;
            let (rvec, tvec) = (read::fixed("rvec", rvec)?, read::fixed("tvec", tvec)?);
            let pose = frame::pose_from_opencv("rvec, tvec", rvec, tvec)?;
            write_pose(out, &in_vehicle(pose, vehicle_from_world)?)
        })
    }
}

/// A pose from a tracked box: where the vehicle and the camera are in any common frame (ego, map, UTM) at the
/// moment of the picture. The vehicle may move between pictures. Camera axes x right, y down, z forward; box axes
/// x forward, y left, z up, its origin on the vehicle's plane of symmetry.
///
/// - vehicle_in_ego: 12 numbers, vehicle to common frame, row-major, metres.
/// - camera_in_ego: 12 numbers, camera to the same frame.
/// - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_pose_from_box(
    vehicle_in_ego: *const f64,
    camera_in_ego: *const f64,
    out: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "12 numbers")?;
            let pose = |argument, pointer| Pose::from_row_major(argument, &read::fixed(argument, pointer)?);
            let vehicle = pose("vehicle_in_ego", vehicle_in_ego)?;
            let camera = pose("camera_in_ego", camera_in_ego)?;
            write_pose(out, &frame::pose_from_box(&vehicle, &camera))
        })
    }
}

/// The pixel of a point. For many points, `vg_camera_project_points`.
///
/// - camera: is not changed.
/// - point_vehicle: 3 numbers, metres, vehicle frame.
/// - out_pixel: receives 2 numbers, column and row; a picture's pixels are 0 to width and 0 to height. Unchanged on
///   failure, and where the camera has no picture of the point, which is `VG_STATUS_ARGUMENT`: on or behind its plane, and
///   beyond the angle at which its lens model folds back.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_project(
    camera: *const vg_camera,
    point_vehicle: *const f64,
    out_pixel: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out_pixel", out_pixel, "2 numbers")?;
            let camera = self::camera("camera", &read::required("camera", camera)?)?;
            let point = DVec3::from_array(read::fixed("point_vehicle", point_vehicle)?);
            let pixel = camera.pixel_from_vehicle(point).ok_or_else(|| {
                let along = camera.vehicle_from_camera.inverse().transform_point(point).z;
                let found = format!("{point}, {along} m along the optical axis");
                let allowed = "a finite point in front of the camera and within the range of its lens";
                Error::argument("point_vehicle", found, allowed)
            })?;
            out_pixel.cast::<[f64; 2]>().write_unaligned(pixel);
            Ok(())
        })
    }
}
