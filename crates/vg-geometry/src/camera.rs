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
    /// The smaller focal length, pixels: at planar depth z the wider side of a pixel is z over this.
    pub fn smaller_focal(&self) -> f64 {
        self.fx.min(self.fy)
    }

    /// The matrix K, row-major.
    pub fn to_row_major(self) -> [f64; 9] {
        [self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0]
    }

    /// Converts normalised coordinates (x/z, y/z) to pixel coordinates.
    #[inline]
    pub fn pixel_from_normalized(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.fx * x + self.cx, self.fy * y + self.cy]
    }

    /// Converts pixel coordinates to normalised coordinates (x/z, y/z).
    #[inline]
    pub fn normalized_from_pixel(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [(u - self.cx) / self.fx, (v - self.cy) / self.fy]
    }

    /// The ray through the centre of the pixel in column `u`, row `v`, in the camera frame: (x/z, y/z, 1), so that a
    /// multiple of it by z has planar depth z. Without a lens; [`Camera::ray`] knows one.
    #[inline]
    pub fn pixel_ray(&self, u: u32, v: u32) -> DVec3 {
        let [x, y] = self.normalized_from_pixel([f64::from(u) + 0.5, f64::from(v) + 0.5]);
        DVec3::new(x, y, 1.0)
    }
}

/// The supported camera models of COLMAP, with COLMAP's ids.
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

    /// The model with COLMAP's id `id`.
    pub fn from_id(id: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|m| *m as i32 == id)
    }

    /// The model with COLMAP's (and nerfstudio's) name `name`.
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

    /// The number of parameters of the model.
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

/// OpenCV's two lens models. The coefficients alone do not reveal which one a calibration uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpenCvModel {
    /// `cv::calibrateCamera`: k1, k2, p1, p2, k3, k4, k5, k6.
    Standard,
    /// `cv::fisheye`: k1, k2, k3, k4 in the angle from the axis.
    Fisheye,
}

/// A camera and its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
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

    /// Makes a checked camera from a COLMAP model and its parameters, in COLMAP's order.
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

    /// Makes a checked camera from an OpenCV calibration: the camera matrix `k`, `[3][3]` row-major, and the distortion
    /// coefficients.
    ///
    /// OpenCV puts the centre of the top-left pixel at (0, 0), this library at (0.5, 0.5): half a pixel is added to the
    /// principal point. `distortion` holds 0, 4, 5 or 8 numbers in OpenCV's order (k1, k2, p1, p2, k3, k4, k5, k6), the
    /// missing ones being zero; 12 or 14 are accepted only where the rest is zero. A fisheye takes 0 or 4; without
    /// coefficients it is equidistant, not a pinhole.
    ///
    /// # Errors
    /// A skew, a last row that is not 0 0 1, a thin-prism or tilted-sensor term, another number of coefficients, and
    /// whatever [`Camera::validate`] rejects; `argument` names the camera.
    pub fn from_opencv(
        argument: &str,
        k: &[f64; 9],
        distortion: &[f64],
        model: OpenCvModel,
        width: u32,
        height: u32,
        vehicle_from_camera: Pose,
    ) -> Result<Self> {
        let camera = Self {
            width,
            height,
            intrinsics: opencv_intrinsics(argument, k)?,
            distortion: opencv_distortion(argument, distortion, model)?,
            vehicle_from_camera,
        };
        camera.validate(argument)?;
        Ok(camera)
    }

    /// Checks that the size is 1 to [`MAX_SIDE`], the focal lengths are positive, and everything is finite and not too
    /// far away; `argument` names the camera in the error.
    pub fn validate(&self, argument: &str) -> Result<()> {
        let Self { width, height, intrinsics: Intrinsics { fx, fy, cx, cy }, .. } = *self;
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(Error::argument(
                format!("{argument}.size"),
                format!("{width}x{height}"),
                format!("1x1 to {MAX_SIDE}x{MAX_SIDE}"),
            ));
        }
        // Outside this range the projection can overflow or underflow f32.
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
        // From farther away, points lifted from the picture leave the range of f32.
        const DISTANCE: f64 = 1e12;
        if self.vehicle_from_camera.translation.abs().max_element() > DISTANCE {
            return Err(Error::argument(
                format!("{argument}.vehicle_from_camera"),
                format!("at {}", self.vehicle_from_camera.translation),
                "within 1e12 m of the origin",
            ));
        }
        Ok(())
    }

    /// The camera's position in the vehicle frame, metres.
    pub fn center(&self) -> DVec3 {
        self.vehicle_from_camera.translation
    }

    /// Projects a point of the camera frame to its pixel; `None` on or behind the camera plane.
    #[inline]
    pub fn project(&self, point_camera: DVec3) -> Option<[f64; 2]> {
        if point_camera.z <= 0.0 {
            return None;
        }
        let normalized = [point_camera.x / point_camera.z, point_camera.y / point_camera.z];
        Some(self.intrinsics.pixel_from_normalized(self.distortion.distort(normalized)))
    }

    /// Direction (x/z, y/z, 1) of a pixel's ray in the camera frame; `None` where the lens has no such ray.
    #[inline]
    pub fn ray(&self, pixel: [f64; 2]) -> Option<DVec3> {
        let [x, y] = self.distortion.undistort(self.intrinsics.normalized_from_pixel(pixel))?;
        Some(DVec3::new(x, y, 1.0))
    }

    /// The camera of the `width` x `height` part of the picture whose top-left pixel is in column `x`, row `y`. Every
    /// point of the scene stays in its pixel.
    ///
    /// # Errors
    /// The part is empty or does not lie inside the picture.
    pub fn cropped(&self, x: u32, y: u32, width: u32, height: u32) -> Result<Self> {
        let inside = |start: u32, length: u32, size: u32| {
            length > 0 && start.checked_add(length).is_some_and(|end| end <= size)
        };
        if !inside(x, width, self.width) || !inside(y, height, self.height) {
            return Err(Error::argument(
                "crop",
                format!("{width}x{height} at column {x}, row {y}"),
                format!("at least 1x1, inside {}x{}", self.width, self.height),
            ));
        }
        let i = self.intrinsics;
        let intrinsics = Intrinsics { cx: i.cx - f64::from(x), cy: i.cy - f64::from(y), ..i };
        let camera = Self { width, height, intrinsics, ..*self };
        camera.validate("crop")?;
        Ok(camera)
    }

    /// Checked [`Camera::scaled_to`].
    ///
    /// # Errors
    /// The size is not 1 to [`MAX_SIDE`], or takes the focal lengths out of what [`Camera::validate`] accepts.
    pub fn resized(&self, width: u32, height: u32) -> Result<Self> {
        let camera = self.scaled_to(width, height);
        camera.validate("resized")?;
        Ok(camera)
    }

    /// This camera with its picture resized to `width` x `height`, which are not checked.
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

fn opencv_intrinsics(argument: &str, k: &[f64; 9]) -> Result<Intrinsics> {
    let [fx, skew, cx, below, fy, cy, last @ ..] = *k;
    // NaN is unequal to everything, so it is rejected here.
    if skew != 0.0 || below != 0.0 || last != [0.0, 0.0, 1.0] {
        return Err(Error::argument(
            format!("{argument}.k"),
            format!("{k:?}"),
            "fx 0 cx, 0 fy cy, 0 0 1 (a calibration without skew)",
        ));
    }
    Ok(Intrinsics { fx, fy, cx: cx + 0.5, cy: cy + 0.5 })
}

fn opencv_distortion(argument: &str, given: &[f64], model: OpenCvModel) -> Result<Distortion> {
    let argument = format!("{argument}.distortion");
    let (counts, allowed): (&[usize], _) = match model {
        OpenCvModel::Standard => {
            (&[0, 4, 5, 8, 12, 14], "0, 4, 5 or 8, or 12 or 14 with zeros after the 8th")
        }
        OpenCvModel::Fisheye => (&[0, 4], "0 or 4 for a fisheye"),
    };
    if !counts.contains(&given.len()) {
        return Err(Error::argument(argument, format!("{} numbers", given.len()), allowed));
    }
    let at = |i: usize| given.get(i).copied().unwrap_or(0.0);
    if model == OpenCvModel::Fisheye {
        return Ok(Distortion::Fisheye { k: [at(0), at(1), at(2), at(3)] });
    }
    if let Some(i) = (8..given.len()).find(|&i| given[i] != 0.0) {
        let allowed = "0: thin-prism and tilted-sensor terms are not supported";
        return Err(Error::argument(format!("{argument}[{i}]"), given[i].to_string(), allowed));
    }
    let brown = Distortion::Brown { k: [at(0), at(1), at(4), at(5), at(6), at(7)], p: [at(2), at(3)] };
    Ok(if brown.is_none() { Distortion::None } else { brown })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        let intrinsics = Intrinsics { fx: 500.0, fy: 510.0, cx: 320.25, cy: 239.5 };
        let distortion = Distortion::Brown { k: [-0.2, 0.05, 0.0, 0.0, 0.0, 0.0], p: [1e-3, -2e-3] };
        Camera { width: 640, height: 480, intrinsics, distortion, vehicle_from_camera: Pose::IDENTITY }
    }

    fn refused(result: Result<Camera>, beginning: &str) {
        let error = result.unwrap_err().to_string();
        assert!(error.starts_with(beginning), "{error}");
    }

    #[test]
    fn a_cropped_camera_sees_every_point_in_the_pixel_that_showed_it() {
        let (whole, part) = (camera(), camera().cropped(100, 37, 300, 200).unwrap());
        assert_eq!((part.width, part.height), (300, 200));
        for point in [DVec3::new(0.1, -0.2, 2.0), DVec3::new(-0.7, 0.4, 3.0)] {
            let ([u, v], [u_part, v_part]) = (whole.project(point).unwrap(), part.project(point).unwrap());
            // Pixels are a few hundred: a step of f64 is 6e-14.
            assert!((u - 100.0 - u_part).abs() < 1e-12 && (v - 37.0 - v_part).abs() < 1e-12);
        }
        assert_eq!(whole.cropped(0, 0, 640, 480).unwrap(), whole);
        assert!(whole.cropped(639, 479, 1, 1).is_ok());
    }

    #[test]
    fn a_camera_too_far_away_to_lift_points_is_refused() {
        let at = |x: f64| {
            let vehicle_from_camera = Pose { translation: DVec3::new(0.0, x, 0.0), ..Pose::IDENTITY };
            Camera { vehicle_from_camera, ..camera() }
        };
        assert!(at(1e12).validate("camera").is_ok() && at(-1e12).validate("camera").is_ok());
        for x in [1.1e12, -1e39, f64::NAN] {
            refused(at(x).validate("camera").map(|()| at(x)), "camera.vehicle_from_camera: ");
        }
    }

    #[test]
    fn a_crop_that_is_empty_or_leaves_the_picture_is_refused() {
        for (x, y, width, height) in [
            (0, 0, 0, 10),
            (0, 0, 10, 0),
            (1, 0, 640, 480),
            (0, 1, 1, 480),
            (640, 0, 1, 1),
            (u32::MAX, 0, 2, 1),
        ] {
            refused(camera().cropped(x, y, width, height), "crop: ");
        }
    }

    #[test]
    fn a_resized_camera_is_the_scaled_one_and_a_size_out_of_range_is_refused() {
        assert_eq!(camera().resized(320, 120).unwrap(), camera().scaled_to(320, 120));
        for (width, height) in [(0, 480), (640, 0), (MAX_SIDE + 1, 480)] {
            refused(camera().resized(width, height), "resized.size: ");
        }
        let short = Camera { intrinsics: Intrinsics { fx: 1e-3, ..camera().intrinsics }, ..camera() };
        refused(short.resized(10, 10), "resized.focal length: ");
    }

    const K: [f64; 9] = [500.0, 0.0, 319.5, 0.0, 510.0, 239.25, 0.0, 0.0, 1.0];

    fn opencv(k: &[f64; 9], distortion: &[f64], model: OpenCvModel) -> Result<Camera> {
        Camera::from_opencv("views[1].camera", k, distortion, model, 640, 480, Pose::IDENTITY)
    }

    /// Pixel of a point by OpenCV's documentation of calib3d, with the centre of the top-left pixel at (0, 0).
    fn opencv_pixel(d: [f64; 8], [x, y, z]: [f64; 3]) -> [f64; 2] {
        let [k1, k2, p1, p2, k3, k4, k5, k6] = d;
        let (x, y) = (x / z, y / z);
        let r2 = x.powi(2) + y.powi(2);
        let radial = (1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3))
            / (1.0 + k4 * r2 + k5 * r2.powi(2) + k6 * r2.powi(3));
        let x2 = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x.powi(2));
        let y2 = y * radial + p1 * (r2 + 2.0 * y.powi(2)) + 2.0 * p2 * x * y;
        [K[0] * x2 + K[2], K[4] * y2 + K[5]]
    }

    /// Pixel of a point by OpenCV's documentation of the fisheye module.
    fn opencv_fisheye_pixel([k1, k2, k3, k4]: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 2] {
        let (a, b) = (x / z, y / z);
        let r = (a.powi(2) + b.powi(2)).sqrt();
        let t = r.atan();
        let bent = t * (1.0 + k1 * t.powi(2) + k2 * t.powi(4) + k3 * t.powi(6) + k4 * t.powi(8));
        [K[0] * (bent / r) * a + K[2], K[4] * (bent / r) * b + K[5]]
    }

    const POINTS: [[f64; 3]; 3] = [[0.3, -0.2, 2.0], [-1.1, 0.7, 2.5], [1e-3, 2e-3, 1.0]];

    #[track_caller]
    fn half_a_pixel_from(camera: &Camera, theirs: impl Fn([f64; 3]) -> [f64; 2]) {
        for point in POINTS {
            let (found, theirs) = (camera.project(DVec3::from_array(point)).unwrap(), theirs(point));
            for axis in 0..2 {
                // A step of f64 at a few hundred pixels is 6e-14.
                assert!((found[axis] - theirs[axis] - 0.5).abs() < 1e-11, "{found:?} {theirs:?}");
            }
        }
    }

    #[test]
    fn points_lie_half_a_pixel_from_where_opencv_puts_them() {
        let full = [-0.21, 0.06, 1e-3, -2e-3, 0.011, 0.02, -0.013, 0.004];
        for count in [0, 4, 5, 8] {
            let mut used = [0.0; 8];
            used[..count].copy_from_slice(&full[..count]);
            let camera = opencv(&K, &full[..count], OpenCvModel::Standard).unwrap();
            half_a_pixel_from(&camera, |p| opencv_pixel(used, p));
        }
        for zeros in [12, 14] {
            let mut padded = full.to_vec();
            padded.resize(zeros, 0.0);
            let camera = opencv(&K, &padded, OpenCvModel::Standard).unwrap();
            assert_eq!(camera, opencv(&K, &full, OpenCvModel::Standard).unwrap());
        }
        let fisheye = [0.05, -0.02, 0.006, -0.001];
        let camera = opencv(&K, &fisheye, OpenCvModel::Fisheye).unwrap();
        half_a_pixel_from(&camera, |p| opencv_fisheye_pixel(fisheye, p));
    }

    #[test]
    fn without_numbers_the_standard_model_is_a_pinhole_and_the_fisheye_is_equidistant() {
        let pinhole = opencv(&K, &[], OpenCvModel::Standard).unwrap();
        assert_eq!(pinhole.distortion, Distortion::None);
        assert_eq!(opencv(&K, &[0.0; 5], OpenCvModel::Standard).unwrap(), pinhole);
        let fisheye = opencv(&K, &[], OpenCvModel::Fisheye).unwrap();
        half_a_pixel_from(&fisheye, |p| opencv_fisheye_pixel([0.0; 4], p));
    }

    #[test]
    fn the_centre_of_opencv_s_first_pixel_is_ours() {
        // The principal point is that pixel's centre: (0, 0) in OpenCV, (0.5, 0.5) here.
        let k = [500.0, 0.0, 0.0, 0.0, 500.0, 0.0, 0.0, 0.0, 1.0];
        let camera = opencv(&k, &[], OpenCvModel::Standard).unwrap();
        assert_eq!(camera.project(DVec3::Z), Some([0.5, 0.5]));
    }

    #[test]
    fn unsupported_calibrations_are_refused_by_name() {
        for (i, value) in [(1, 0.3), (3, 0.1), (6, 1e-9), (7, 1.0), (8, 2.0), (1, f64::NAN), (8, f64::NAN)] {
            let mut k = K;
            k[i] = value;
            refused(opencv(&k, &[], OpenCvModel::Standard), "views[1].camera.k: ");
        }
        for count in [1, 2, 3, 6, 7, 9, 11, 13, 15] {
            refused(opencv(&K, &vec![0.0; count], OpenCvModel::Standard), "views[1].camera.distortion: ");
        }
        for count in [1, 3, 5, 8] {
            refused(opencv(&K, &vec![0.0; count], OpenCvModel::Fisheye), "views[1].camera.distortion: ");
        }
        for (count, i) in [(12, 8), (12, 11), (14, 12), (14, 13)] {
            for value in [1e-4, f64::NAN] {
                let mut d = vec![0.0; count];
                d[i] = value;
                let beginning = format!("views[1].camera.distortion[{i}]: ");
                refused(opencv(&K, &d, OpenCvModel::Standard), &beginning);
            }
        }
        refused(opencv(&K, &[f64::NAN; 4], OpenCvModel::Fisheye), "views[1].camera.distortion: ");
        let mut k = K;
        k[0] = -500.0;
        refused(opencv(&k, &[], OpenCvModel::Standard), "views[1].camera.focal length: ");
    }
}
