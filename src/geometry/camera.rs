//! A posed camera: size, pinhole intrinsics, distortion, `vehicle_from_camera`; all f64.

use super::distortion::Distortion;
use super::pose::Pose;
use crate::error::{Error, Result};
use glam::DVec3;

/// Largest image side accepted anywhere.
pub const MAX_SIDE: u32 = 8192;

/// Focal lengths and principal point in pixels; the centre of the top-left pixel is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, column, pixels.
    pub cx: f64,
    /// Principal point, row, pixels.
    pub cy: f64,
}

impl Intrinsics {
    /// Pixel coordinates of normalised ones (x/z, y/z).
    pub fn pixel_from_normalized(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.fx * x + self.cx, self.fy * y + self.cy]
    }

    /// Normalised coordinates (x/z, y/z) of pixel coordinates.
    pub fn normalized_from_pixel(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [(u - self.cx) / self.fx, (v - self.cy) / self.fy]
    }
}

/// COLMAP's camera models that are understood, with COLMAP's ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum CameraModel {
    /// f, cx, cy
    SimplePinhole = 0,
    /// fx, fy, cx, cy
    Pinhole = 1,
    /// f, cx, cy, k
    SimpleRadial = 2,
    /// f, cx, cy, k1, k2
    Radial = 3,
    /// fx, fy, cx, cy, k1, k2, p1, p2
    OpenCv = 4,
    /// fx, fy, cx, cy, k1, k2, k3, k4
    OpenCvFisheye = 5,
    /// fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
    FullOpenCv = 6,
}

impl CameraModel {
    /// All models, in the order of their ids.
    pub const ALL: [Self; 7] = [
        Self::SimplePinhole,
        Self::Pinhole,
        Self::SimpleRadial,
        Self::Radial,
        Self::OpenCv,
        Self::OpenCvFisheye,
        Self::FullOpenCv,
    ];

    /// From COLMAP's number.
    pub fn from_id(id: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|m| *m as i32 == id)
    }

    /// From COLMAP's (and nerfstudio's) name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.name() == name)
    }

    /// COLMAP's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::SimplePinhole => "SIMPLE_PINHOLE",
            Self::Pinhole => "PINHOLE",
            Self::SimpleRadial => "SIMPLE_RADIAL",
            Self::Radial => "RADIAL",
            Self::OpenCv => "OPENCV",
            Self::OpenCvFisheye => "OPENCV_FISHEYE",
            Self::FullOpenCv => "FULL_OPENCV",
        }
    }

    /// How many parameters the model has.
    pub fn parameter_count(self) -> usize {
        match self {
            Self::SimplePinhole => 3,
            Self::Pinhole | Self::SimpleRadial => 4,
            Self::Radial => 5,
            Self::OpenCv | Self::OpenCvFisheye => 8,
            Self::FullOpenCv => 12,
        }
    }
}

/// A camera and where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Pinhole part.
    pub intrinsics: Intrinsics,
    /// Lens part.
    pub distortion: Distortion,
    /// Camera to vehicle, metres.
    pub vehicle_from_camera: Pose,
}

impl Camera {
    /// A checked pinhole camera.
    pub fn pinhole(
        width: u32,
        height: u32,
        intrinsics: Intrinsics,
        vehicle_from_camera: Pose,
    ) -> Result<Self> {
        let camera = Self { width, height, intrinsics, distortion: Distortion::None, vehicle_from_camera };
        camera.validate("camera")?;
        Ok(camera)
    }

    /// From a COLMAP model and its parameters, in COLMAP's order.
    pub fn from_colmap(
        argument: &str,
        model: CameraModel,
        width: u32,
        height: u32,
        params: &[f64],
        vehicle_from_camera: Pose,
    ) -> Result<Self> {
        let expected = model.parameter_count();
        if params.len() != expected {
            return Err(Error::argument(
                format!("{argument}.params"),
                format!("{} numbers", params.len()),
                format!("{expected} for {}", model.name()),
            ));
        }
        let p = |i: usize| params[i];
        let single = |f: f64, cx: f64, cy: f64| Intrinsics { fx: f, fy: f, cx, cy };
        let double = || Intrinsics { fx: p(0), fy: p(1), cx: p(2), cy: p(3) };
        let brown = |k: [f64; 6], p: [f64; 2]| Distortion::Brown { k, p };
        let (intrinsics, distortion) = match model {
            CameraModel::SimplePinhole => (single(p(0), p(1), p(2)), Distortion::None),
            CameraModel::Pinhole => (double(), Distortion::None),
            CameraModel::SimpleRadial => {
                (single(p(0), p(1), p(2)), brown([p(3), 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]))
            }
            CameraModel::Radial => {
                (single(p(0), p(1), p(2)), brown([p(3), p(4), 0.0, 0.0, 0.0, 0.0], [0.0; 2]))
            }
            CameraModel::OpenCv => (double(), brown([p(4), p(5), 0.0, 0.0, 0.0, 0.0], [p(6), p(7)])),
            CameraModel::OpenCvFisheye => (double(), Distortion::Fisheye { k: [p(4), p(5), p(6), p(7)] }),
            CameraModel::FullOpenCv => {
                (double(), brown([p(4), p(5), p(8), p(9), p(10), p(11)], [p(6), p(7)]))
            }
        };
        let camera = Self { width, height, intrinsics, distortion, vehicle_from_camera };
        camera.validate(argument)?;
        Ok(camera)
    }

    /// Size 1 to [`MAX_SIDE`], focal lengths positive, everything finite; `argument` names it in the error.
    pub fn validate(&self, argument: &str) -> Result<()> {
        let Self { width, height, intrinsics: Intrinsics { fx, fy, cx, cy }, .. } = *self;
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(Error::argument(
                format!("{argument}.size"),
                format!("{width}x{height}"),
                format!("1x1 to {MAX_SIDE}x{MAX_SIDE}"),
            ));
        }
        // Outside these the projection leaves the range of f32 before it leaves the range of use.
        const FOCAL: std::ops::RangeInclusive<f64> = 1e-3..=1e9;
        if !FOCAL.contains(&fx) || !FOCAL.contains(&fy) {
            return Err(Error::argument(
                format!("{argument}.focal length"),
                format!("{fx} x {fy}"),
                "1e-3 to 1e9 pixels",
            ));
        }
        const PRINCIPAL_POINT: f64 = 1e9;
        if !(cx.abs() <= PRINCIPAL_POINT && cy.abs() <= PRINCIPAL_POINT) {
            return Err(Error::argument(
                format!("{argument}.principal point"),
                format!("({cx}, {cy})"),
                "within 1e9 pixels of the origin",
            ));
        }
        let finite = match self.distortion {
            Distortion::None => true,
            Distortion::Brown { k, p } => k.iter().chain(&p).all(|v| v.is_finite()),
            Distortion::Fisheye { k } => k.iter().all(|v| v.is_finite()),
        };
        if !finite {
            return Err(Error::argument(
                format!("{argument}.distortion"),
                format!("{:?}", self.distortion),
                "finite numbers",
            ));
        }
        if !(self.vehicle_from_camera.rotation.is_finite()
            && self.vehicle_from_camera.translation.is_finite())
        {
            return Err(Error::argument(
                format!("{argument}.vehicle_from_camera"),
                "a NaN or infinite entry",
                "finite numbers",
            ));
        }
        Ok(())
    }

    /// Where the camera stands in the vehicle frame, metres.
    pub fn center(&self) -> DVec3 {
        self.vehicle_from_camera.translation
    }

    /// Pixel of a point in the camera frame, or `None` on or behind the camera plane.
    pub fn project(&self, point_camera: DVec3) -> Option<[f64; 2]> {
        if point_camera.z <= 0.0 {
            return None;
        }
        let normalized = [point_camera.x / point_camera.z, point_camera.y / point_camera.z];
        Some(self.intrinsics.pixel_from_normalized(self.distortion.distort(normalized)))
    }

    /// Direction (x/z, y/z, 1) in the camera frame of a pixel, or `None` where the lens has no such ray.
    pub fn ray(&self, pixel: [f64; 2]) -> Option<DVec3> {
        let [x, y] = self.distortion.undistort(self.intrinsics.normalized_from_pixel(pixel))?;
        Some(DVec3::new(x, y, 1.0))
    }

    /// The same camera with the picture resized to `width` x `height`.
    pub fn scaled_to(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        let i = self.intrinsics;
        Self {
            width,
            height,
            intrinsics: Intrinsics { fx: i.fx * sx, fy: i.fy * sy, cx: i.cx * sx, cy: i.cy * sy },
            ..*self
        }
    }
}
