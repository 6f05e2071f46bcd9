//! Visibility of points in views with depth.

use super::mask::Label;
use super::{DepthMap, View};
use glam::{Mat3, Vec3};
use vg_geometry::Intrinsics;

/// Approximate agreement of the surfaces of one vehicle's views, metres.
pub const SURFACE_M: f32 = 0.06;

/// Visibility of a point in a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// Unknown: the point is behind the camera, outside the picture, hidden, or its pixel is unknown.
    Silent,
    /// The view sees the background there.
    Background,
    /// The view sees through the point to a surface behind it.
    Through,
    /// The point lies on the surface that its pixel shows.
    Surface,
}

/// One pinhole view and its depth, prepared for look-ups.
pub struct Observer<'a> {
    view: &'a View,
    depth: &'a DepthMap,
    intrinsics: [f32; 4],
    camera_from_vehicle: (Mat3, Vec3),
    /// Camera centre in the vehicle frame, metres.
    pub center: Vec3,
}

impl<'a> Observer<'a> {
    /// The observer of an undistorted view.
    #[inline]
    pub fn new(view: &'a View, depth: &'a DepthMap) -> Self {
        let camera_from_vehicle = view.camera.vehicle_from_camera.inverse();
        let Intrinsics { fx, fy, cx, cy } = view.camera.intrinsics;
        Self {
            view,
            depth,
            intrinsics: [fx as f32, fy as f32, cx as f32, cy as f32],
            camera_from_vehicle: (
                camera_from_vehicle.rotation.as_mat3(),
                camera_from_vehicle.translation.as_vec3(),
            ),
            center: view.camera.center().as_vec3(),
        }
    }

    /// Visibility of `point` (vehicle frame), for surfaces with a tolerance of `tolerance` metres.
    #[inline]
    pub fn sight(&self, point: Vec3, tolerance: f32) -> Sight {
        let p = self.camera_from_vehicle.0 * point + self.camera_from_vehicle.1;
        if p.z <= 0.0 {
            return Sight::Silent;
        }
        let [fx, fy, cx, cy] = self.intrinsics;
        let (u, v) = (fx * p.x / p.z + cx, fy * p.y / p.z + cy);
        let camera = &self.view.camera;
        if !(u >= 0.0 && v >= 0.0 && u < camera.width as f32 && v < camera.height as f32) {
            return Sight::Silent;
        }
        let pixel = v as usize * camera.width as usize + u as usize;
        match self.view.mask.as_ref().map_or(Label::Vehicle, |mask| mask.labels()[pixel]) {
            Label::Background => Sight::Background,
            Label::Unknown => Sight::Silent,
            Label::Vehicle => {
                let surface = self.depth.depth()[pixel];
                if surface <= 0.0 || p.z > surface + tolerance {
                    Sight::Silent
                } else if p.z < surface - tolerance {
                    Sight::Through
                } else {
                    Sight::Surface
                }
            }
        }
    }

    /// Colour at `point`, sampled bilinearly, in [0, 1].
    pub fn color_at(&self, point: Vec3) -> Vec3 {
        let p = self.camera_from_vehicle.0 * point + self.camera_from_vehicle.1;
        let [fx, fy, cx, cy] = self.intrinsics;
        let c = crate::undistort::bilinear(&self.view.image, [fx * p.x / p.z + cx, fy * p.y / p.z + cy]);
        Vec3::from_array(c.map(|c| f32::from(c) / 255.0))
    }

    /// Resolution of a surface at `point` with unit `normal` (vehicle frame), pixels per metre in the direction in
    /// which it is foreshortened. Negative from behind.
    #[inline]
    pub fn resolution(&self, point: Vec3, normal: Vec3) -> f32 {
        let to_camera = self.center - point;
        let focal = self.intrinsics[0].min(self.intrinsics[1]);
        focal * normal.dot(to_camera) / to_camera.length_squared()
    }
}
