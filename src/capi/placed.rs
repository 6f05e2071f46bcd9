//! Cameras that are placed by hand, and points to pixels and back.

use super::camera::{camera, vg_camera, write_pose};
use super::gaussians::{self, vg_gaussians};
use super::guard::guarded;
use super::read;
use super::status::{vg_error, vg_status};
use glam::DVec3;
use vg::geometry::{Camera, Pose, Turntable};
use vg::{Error, Result};

/// A camera's pose by where it stands and what it looks at.
///
/// - eye: 3 numbers, where the camera stands, metres, vehicle frame.
/// - target: 3 numbers, a point on its optical axis; not `eye`.
/// - up: 3 numbers, the direction that is up in the picture, of any length; not along the line of sight. NULL: the
///   vehicle's z axis.
/// - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_pose_look_at(
    eye: *const f64,
    target: *const f64,
    up: *const f64,
    out: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "12 numbers")?;
            let [eye, target, up] = sight(eye, target, up)?;
            write_pose(out, &Pose::look_at("", eye, target, up)?)
        })
    }
}

/// A pinhole camera by where it stands and what it looks at. For another lens, hand the pose of `vg_pose_look_at` to the
/// function that makes its camera.
///
/// - eye, target, up: as in `vg_pose_look_at`.
/// - fov_y_degrees: angle from the top to the bottom of the picture, above 0 and below 180. Pixels are square.
/// - width, height: 1 to 8192.
/// - out: receives the whole camera, `struct_size` included; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_look_at(
    eye: *const f64,
    target: *const f64,
    up: *const f64,
    fov_y_degrees: f64,
    width: u32,
    height: u32,
    out: *mut vg_camera,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "where to put the camera")?;
            let [eye, target, up] = sight(eye, target, up)?;
            let camera = Camera::look_at(eye, target, up, fov_y_degrees, width, height)?;
            out.write_unaligned(vg_camera::of(&camera));
            Ok(())
        })
    }
}

unsafe fn sight(eye: *const f64, target: *const f64, up: *const f64) -> Result<[DVec3; 3]> {
    unsafe {
        let point = |argument, numbers| read::fixed(argument, numbers).map(DVec3::from_array);
        let up = if up.is_null() { DVec3::Z } else { point("up", up)? };
        Ok([point("eye", eye)?, point("target", target)?, up])
    }
}

/// Cameras on a circle around Gaussians, from the vehicle's front towards its left, each with all of their centres in
/// its picture.
///
/// - gaussians: at least one.
/// - count: how many cameras, 1 to 100000.
/// - elevation_degrees: angle by which they look down, -89 to 89; the program takes 12.
/// - fov_y_degrees: vertical field of view, above 0 and below 180; the program takes 35.
/// - width, height: 1 to 8192.
/// - out: an array that receives `count` whole cameras, `struct_size` included; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_cameras_turntable(
    gaussians: *const vg_gaussians,
    count: usize,
    elevation_degrees: f64,
    fov_y_degrees: f64,
    width: u32,
    height: u32,
    out: *mut vg_camera,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out", out, "where to put the cameras")?;
            let bounds = gaussians::required("gaussians", gaussians)?.bounds();
            let (low, high) =
                bounds.ok_or_else(|| Error::argument("gaussians", "no Gaussians", "at least one"))?;
            let cameras = Turntable { elevation_degrees, fov_y_degrees }
                .cameras(low, high, count, width, height)
                .map_err(|e| read::renamed(e, &[("bounds", "gaussians")]))?;
            for (i, camera) in cameras.iter().enumerate() {
                out.add(i).write_unaligned(vg_camera::of(camera));
            }
            Ok(())
        })
    }
}

/// The pixels of many points: `vg_camera_project` for an array, where points without a pixel are no error.
///
/// - camera: is not changed.
/// - points: double `[count][3]` without gaps, metres, vehicle frame. NULL with 0.
/// - out_pixels: double `[count][2]`, column and row; NAN where the camera has no picture of the point: on or behind its
///   plane, and beyond the angle at which its lens model folds back. Pixels outside 0 to width and 0 to height lie beside
///   the picture.
/// - out_depths: double `[count]`, planar depth, metres, NAN where there is no pixel. NULL: not wanted.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_project_points(
    camera: *const vg_camera,
    points: *const f64,
    count: usize,
    out_pixels: *mut f64,
    out_depths: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let camera = self::camera("camera", &read::required("camera", camera)?)?;
            let points = read::numbers::<[f64; 3]>("points", points.cast(), count)?;
            read::writable("out_pixels", out_pixels, count)?;
            for (i, seen) in camera.pixels_and_depths(points).into_iter().enumerate() {
                let (pixel, depth) = seen.unwrap_or(([f64::NAN; 2], f64::NAN));
                out_pixels.cast::<[f64; 2]>().add(i).write_unaligned(pixel);
                if !out_depths.is_null() {
                    out_depths.add(i).write_unaligned(depth);
                }
            }
            Ok(())
        })
    }
}

/// The point behind a pixel.
///
/// - camera: is not changed.
/// - pixel: 2 numbers, column and row; the centre of the top-left pixel is (0.5, 0.5).
/// - depth_m: planar depth, metres along the optical axis, above 0.
/// - out_point: receives 3 numbers, metres, vehicle frame. Unchanged on failure, and where the lens has no ray to the
///   pixel, which is `VG_STATUS_ARGUMENT`.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_unproject(
    camera: *const vg_camera,
    pixel: *const f64,
    depth_m: f64,
    out_point: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("out_point", out_point, "3 numbers")?;
            let camera = self::camera("camera", &read::required("camera", camera)?)?;
            let pixel = read::fixed::<2>("pixel", pixel)?;
            if !(depth_m > 0.0 && depth_m.is_finite()) {
                return Err(Error::argument("depth_m", depth_m.to_string(), "above 0, finite"));
            }
            let point = camera.vehicle_from_pixel(pixel, depth_m).ok_or_else(|| {
                Error::argument("pixel", format!("{pixel:?}"), "a pixel for which the lens defines a ray")
            })?;
            out_point.cast::<[f64; 3]>().write_unaligned(point.to_array());
            Ok(())
        })
    }
}

/// The points behind many pixels: `vg_camera_unproject` for an array, where pixels without a point are no error.
///
/// - camera: is not changed.
/// - pixels: double `[count][2]` without gaps, column and row. NULL with 0.
/// - depths: double `[count]`, planar depth, metres; 0, negative, NAN and infinite mean no measurement. NULL with 0.
/// - out_points: double `[count][3]`, metres, vehicle frame; NAN where there is no measurement or no ray.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_camera_unproject_points(
    camera: *const vg_camera,
    pixels: *const f64,
    depths: *const f64,
    count: usize,
    out_points: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let camera = self::camera("camera", &read::required("camera", camera)?)?;
            let pixels = read::numbers::<[f64; 2]>("pixels", pixels.cast(), count)?;
            let depths = read::numbers("depths", depths, count)?;
            read::writable("out_points", out_points, count)?;
            for (i, (&pixel, &depth)) in pixels.iter().zip(depths).enumerate() {
                let point = camera.vehicle_from_pixel(pixel, depth).unwrap_or(DVec3::NAN);
                out_points.cast::<[f64; 3]>().add(i).write_unaligned(point.to_array());
            }
            Ok(())
        })
    }
}
