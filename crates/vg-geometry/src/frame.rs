//! Conversions of other software's poses to and from this library's conventions, all in this one place.

use super::pose::Pose;
use crate::error::{Error, Result};
use glam::{DMat3, DVec3};

/// Camera axes of OpenGL, Blender and nerfstudio (x right, y up, z backward) to ours (x right, y down, z forward).
const OPENCV_FROM_OPENGL: DMat3 =
    DMat3::from_cols(DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.0, -1.0, 0.0), DVec3::new(0.0, 0.0, -1.0));

/// Converts a nerfstudio / OpenGL camera-to-world matrix, row-major `[R | t]`, to `world_from_camera` with our camera
/// axes.
pub fn pose_from_opengl(argument: &str, camera_to_world: &[f64; 12]) -> Result<Pose> {
    let pose = Pose::from_row_major(argument, camera_to_world)?;
    // `OPENCV_FROM_OPENGL` is its own inverse.
    Ok(Pose { rotation: pose.rotation * OPENCV_FROM_OPENGL, translation: pose.translation })
}

/// Converts our `world_from_camera` to a nerfstudio / OpenGL camera-to-world matrix, row-major `[R | t]`.
pub fn opengl_from_pose(world_from_camera: &Pose) -> [f64; 12] {
    let rotation = world_from_camera.rotation * OPENCV_FROM_OPENGL;
    Pose { rotation, translation: world_from_camera.translation }.to_row_major()
}

/// Converts COLMAP's world-to-camera quaternion (w, x, y, z) and translation to `world_from_camera`.
pub fn pose_from_colmap(argument: &str, qvec_wxyz: [f64; 4], tvec: [f64; 3]) -> Result<Pose> {
    Ok(Pose::from_wxyz(argument, qvec_wxyz, DVec3::from_array(tvec))?.inverse())
}

/// Converts the world-to-camera `rvec` (a rotation vector whose length is the angle in radians) and `tvec` that
/// `cv::solvePnP`, `cv::calibrateCamera` and ArUco return to `world_from_camera`.
pub fn pose_from_opencv(argument: &str, rvec: [f64; 3], tvec: [f64; 3]) -> Result<Pose> {
    let (rvec, translation) = (DVec3::from_array(rvec), DVec3::from_array(tvec));
    let angle = rvec.length();
    if !angle.is_finite() || !translation.is_finite() {
        let found = format!("rvec {rvec}, tvec {translation}");
        return Err(Error::argument(argument, found, "finite numbers"));
    }
    // Without a rotation any axis is right, also where the length underflows to zero.
    let axis = if angle > 0.0 { rvec / angle } else { DVec3::Z };
    let rotation = DMat3::from_axis_angle(axis.normalize(), angle);
    Ok(Pose { rotation, translation }.inverse())
}

/// `vehicle_from_camera` of a vehicle that was tracked as a box, from the poses of the box and the camera in one frame
/// (ego, map, UTM) at the time of the picture. The box's axes must be the vehicle's: x forward, y left, z up.
///
/// The positions are subtracted before the rotation. The difference of nearby positions is exact, so the only error is
/// the rounding of the inputs: at 4e6 m a step of f64 is 0.5 nm (0.9 nm from 2^22 m on), each of the two is off by half
/// of one, and the result is within 1 nm. Rotating first loses three times as much.
pub fn pose_from_box(ego_from_vehicle: &Pose, ego_from_camera: &Pose) -> Pose {
    let vehicle_from_ego = ego_from_vehicle.rotation.transpose();
    Pose {
        rotation: vehicle_from_ego * ego_from_camera.rotation,
        translation: vehicle_from_ego * (ego_from_camera.translation - ego_from_vehicle.translation),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(yaw: f64, pitch: f64, roll: f64, translation: DVec3) -> Pose {
        let rotation = DMat3::from_euler(glam::EulerRot::ZYX, yaw, pitch, roll);
        Pose::new("pose", rotation, translation).unwrap()
    }

    #[test]
    fn opencv_s_rotation_vectors_turn_as_rodrigues_says() {
        let camera_from_world = |rvec| pose_from_opencv("pose", rvec, [1.0, 2.0, 3.0]).unwrap().inverse();
        // A quarter turn about z takes x to y.
        let quarter = camera_from_world([0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        assert!((quarter.transform_point(DVec3::X) - DVec3::new(1.0, 3.0, 3.0)).length() < 1e-15);
        let (rvec, p) = (DVec3::new(0.3, -1.1, 0.7), DVec3::new(0.2, 0.5, -0.4));
        let (angle, axis) = (rvec.length(), rvec.normalize());
        let turned = p * angle.cos() + axis.cross(p) * angle.sin() + axis * axis.dot(p) * (1.0 - angle.cos());
        let found = camera_from_world(rvec.to_array()).transform_point(p);
        assert!((found - turned - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-14);
        assert_eq!(camera_from_world([0.0; 3]).rotation, DMat3::IDENTITY);
        assert_eq!(camera_from_world([1e-320, 0.0, 0.0]).rotation, DMat3::IDENTITY);
        for bad in [[f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0], [1e300, 0.0, 0.0]] {
            assert!(pose_from_opencv("pose", bad, [0.0; 3]).is_err(), "{bad:?}");
        }
        assert!(pose_from_opencv("pose", [0.0; 3], [f64::NAN; 3]).is_err());
    }

    #[test]
    fn a_box_s_pose_is_the_inverse_of_the_box_after_the_camera() {
        let (vehicle, camera) = (
            pose(0.3, 0.02, -0.01, DVec3::new(12.0, -3.0, 0.8)),
            pose(-1.2, 0.4, 1.7, DVec3::new(1.5, 0.2, 1.6)),
        );
        let found = pose_from_box(&vehicle, &camera);
        let expected = vehicle.inverse().after(&camera);
        let rows = |p: &Pose| p.to_row_major();
        // Translations are about 10, so rounding is a few steps of 1.8e-15.
        assert!(rows(&found).iter().zip(rows(&expected)).all(|(a, b)| (a - b).abs() < 1e-14));
        let point = DVec3::new(0.4, -0.3, 7.0);
        let in_ego = vehicle.transform_point(found.transform_point(point));
        assert!((in_ego - camera.transform_point(point)).length() < 1e-14);
    }

    #[test]
    fn utm_coordinates_cost_a_nanometre_at_most() {
        let mut worst = 0.0f64;
        for i in 0..100 {
            let t = f64::from(i);
            let near = |k: f64| DVec3::new((k * t).sin() * 20.0, (k * t + 1.0).cos() * 20.0, (k * t).cos());
            let (at_vehicle, at_camera) = (near(0.7), near(1.3));
            let origin = DVec3::new(4.3e5 + 0.1 * t, 4.0e6 + 0.3 * t, 312.7);
            let in_utm = |p: DVec3| p + origin;
            let vehicle = |at| pose(0.4 * t, 0.01, 0.02, at);
            let camera = |at| pose(1.1 * t, -0.5, 1.6, at);
            let local = pose_from_box(&vehicle(at_vehicle), &camera(at_camera));
            let far = pose_from_box(&vehicle(in_utm(at_vehicle)), &camera(in_utm(at_camera)));
            assert_eq!(far.rotation, local.rotation);
            worst = worst.max((far.translation - local.translation).length());
        }
        assert!(worst < 1e-9, "{worst} m");
    }
}
