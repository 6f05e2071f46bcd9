//! Conversions at the edge of the program: other software's poses into `vehicle_from_camera`, nowhere else.

use super::pose::Pose;
use crate::error::Result;
use glam::{DMat3, DVec3};

/// Camera axes of OpenGL, Blender and nerfstudio (x right, y up, z backward) to ours (x right, y down, z forward).
const OPENCV_FROM_OPENGL: DMat3 =
    DMat3::from_cols(DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.0, -1.0, 0.0), DVec3::new(0.0, 0.0, -1.0));

/// A nerfstudio / OpenGL camera-to-world matrix, row-major `[R | t]`, as `world_from_camera` with our camera axes.
pub fn pose_from_opengl(argument: &str, camera_to_world: &[f64; 12]) -> Result<Pose> {
    let pose = Pose::from_row_major(argument, camera_to_world)?;
    // `OPENCV_FROM_OPENGL` is its own inverse.
    Ok(Pose { rotation: pose.rotation * OPENCV_FROM_OPENGL, translation: pose.translation })
}

/// Our `world_from_camera` as a nerfstudio / OpenGL camera-to-world matrix, row-major `[R | t]`.
pub fn opengl_from_pose(world_from_camera: &Pose) -> [f64; 12] {
    let rotation = world_from_camera.rotation * OPENCV_FROM_OPENGL;
    Pose { rotation, translation: world_from_camera.translation }.to_row_major()
}

/// COLMAP's world-to-camera quaternion (w, x, y, z) and translation as `world_from_camera`.
pub fn pose_from_colmap(argument: &str, qvec_wxyz: [f64; 4], tvec: [f64; 3]) -> Result<Pose> {
    Ok(Pose::from_wxyz(argument, qvec_wxyz, DVec3::from_array(tvec))?.inverse())
}
