//! The camera and options in the form the projection uses, prepared once per picture.

use crate::render::options::{PROJECTION_MARGIN, RenderOptions};
use vg_geometry::{Camera, Intrinsics};

/// A pinhole camera in the form the projection uses; f64, so that a camera a million metres away loses no precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct PinholeView {
    /// Rows of `camera_from_vehicle`'s rotation.
    pub(super) rotation: [[f64; 3]; 3],
    /// Camera centre in the vehicle frame, metres.
    pub(super) center: [f64; 3],
    pub(super) intrinsics: Intrinsics,
    /// Range of x/z, then of y/z, in which the Jacobian is taken: the image and 15 % of its size around it.
    pub(super) jacobian_range: [[f64; 2]; 2],
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) near: f32,
    pub(super) far: f32,
    /// Variance added to each projected Gaussian, pixels^2.
    pub(super) blur: f64,
    pub(super) antialiased: bool,
    pub(super) sh_degree: u8,
}

impl PinholeView {
    pub(super) fn new(camera: &Camera, options: &RenderOptions, sh_degree: u8) -> Self {
        let i = camera.intrinsics;
        let margin = f64::from(PROJECTION_MARGIN);
        let range = |c: f64, f: f64, size: u32| {
            let size = f64::from(size);
            [-(c + margin * size) / f, (size - c + margin * size) / f]
        };
        // The pose's columns are the rows of its inverse.
        let columns = camera.vehicle_from_camera.rotation;
        Self {
            rotation: [columns.x_axis.to_array(), columns.y_axis.to_array(), columns.z_axis.to_array()],
            center: camera.center().to_array(),
            intrinsics: i,
            jacobian_range: [range(i.cx, i.fx, camera.width), range(i.cy, i.fy, camera.height)],
            width: camera.width,
            height: camera.height,
            near: options.near,
            far: options.far,
            blur: f64::from(options.blur),
            antialiased: options.antialiased,
            sh_degree: options.sh_degree.min(sh_degree),
        }
    }
}
