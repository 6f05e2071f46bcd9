//! Views and scenes, and their validation.

use super::{Cloud, DepthMap, Mask, RgbImage, VehicleBox};
use glam::Vec3;
use vg_geometry::{Camera, Error, Result};

/// Maximum of views in a scene.
pub const MAX_VIEWS: usize = 4096;

/// One photograph: picture, camera and mask. Clones share all per-pixel data.
#[derive(Clone, Debug)]
pub struct View {
    /// Name for messages and output files, for example the picture's file name.
    pub name: String,
    /// Intrinsics, distortion and `vehicle_from_camera`.
    pub camera: Camera,
    /// The picture, of the camera's size.
    pub image: RgbImage,
    /// Mask of the vehicle, of the camera's size; `None` if there is none.
    pub mask: Option<Mask>,
    /// Measured planar depth in metres, of the camera's size.
    pub depth: Option<DepthMap>,
}

/// Views of one vehicle in its own frame, and further measurements of it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Views, in the caller's order.
    pub views: Vec<View>,
    /// Points measured on the vehicle, if any; priors that estimate the surface move it to these points.
    pub cloud: Option<Cloud>,
    /// The vehicle's box, if it was tracked or measured; `Options::vehicle_size` takes precedence.
    pub vehicle_box: Option<VehicleBox>,
}

impl View {
    /// A view with a black picture, for functions that use only cameras and masks.
    pub fn without_picture(name: String, camera: Camera, mask: Option<Mask>) -> Result<Self> {
        camera.validate("camera")?;
        let (width, height) = (camera.width, camera.height);
        let image = RgbImage::new(width, height, vec![[0; 3]; width as usize * height as usize])?;
        Ok(Self { name, camera, image, mask, depth: None })
    }

    /// Checks that the camera is valid and that picture, mask and depth have its size; `argument` names the view in the
    /// error.
    pub fn validate(&self, argument: &str) -> Result<()> {
        self.camera.validate(&format!("{argument}.camera"))?;
        let expected = (self.camera.width, self.camera.height);
        let same_size = |what: &str, width: u32, height: u32| {
            if (width, height) == expected {
                return Ok(());
            }
            Err(Error::argument(
                format!("{argument}.{what}"),
                format!("{width}x{height}"),
                format!("the camera's size, {}x{}", expected.0, expected.1),
            ))
        };
        same_size("image", self.image.width(), self.image.height())?;
        if let Some(mask) = &self.mask {
            same_size("mask", mask.width(), mask.height())?;
        }
        if let Some(depth) = &self.depth {
            same_size("depth", depth.width(), depth.height())?;
        }
        Ok(())
    }

    /// The point at planar depth `z` metres on the ray of the centre of pixel (u, v) of a pinhole view, vehicle frame
    /// (paper eqs. 3, 4).
    #[inline]
    pub fn lift(&self, u: u32, v: u32, z: f32) -> Vec3 {
        let point_camera = self.camera.intrinsics.pixel_ray(u, v) * f64::from(z);
        self.camera.vehicle_from_camera.transform_point(point_camera).as_vec3()
    }

    /// Name of the view in errors, if its number is `index`.
    pub fn argument(&self, index: usize) -> String {
        if self.name.is_empty() {
            format!("views[{index}]")
        } else {
            format!("views[{index}] ({})", self.name)
        }
    }
}

impl Scene {
    /// Checks that there is at least one view and that all views are valid.
    pub fn validate(&self) -> Result<()> {
        if self.views.is_empty() || self.views.len() > MAX_VIEWS {
            return Err(Error::argument("views", self.views.len().to_string(), format!("1 to {MAX_VIEWS}")));
        }
        self.views.iter().enumerate().try_for_each(|(i, view)| view.validate(&view.argument(i)))?;
        self.vehicle_box.map_or(Ok(()), |known| known.validate("vehicle_box"))
    }
}
