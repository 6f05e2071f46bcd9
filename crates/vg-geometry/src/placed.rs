//! Camera placement: one camera that looks at a point, and a circle of cameras around a box.

use super::camera::{Camera, Intrinsics};
use super::pose::Pose;
use crate::error::{Error, Result};
use glam::{DMat3, DVec3};

/// Smallest sine of the angle between the line of sight and `up`; below it, rounding decides which way is up.
const LEAST_TILT: f64 = 1e-6;

/// Smallest radius and half height of the cylinder that a turntable circles, metres: a single Gaussian has no extent.
const LEAST_RADIUS_M: f64 = 1e-3;

/// Factor on the distance at which all centres just fit, because Gaussians extend beyond their centres.
const MARGIN: f64 = 1.02;

/// Maximum number of cameras of one turntable.
const MOST_CAMERAS: usize = 100_000;

impl Pose {
    /// `vehicle_from_camera` of a camera at `eye` whose optical axis meets `target`. The picture's upward direction is
    /// `up`, as far as the line of sight allows; use [`DVec3::Z`] for a level camera.
    ///
    /// # Errors
    /// `argument` and one of `eye`, `target`, `up`: a number is not finite, `eye` is `target`, `up` is zero or lies
    /// along the line of sight.
    pub fn look_at(argument: &str, eye: DVec3, target: DVec3, up: DVec3) -> Result<Self> {
        let refuse = |name: &str, found: String, allowed: &str| {
            Err(Error::argument(format!("{argument}{name}"), found, allowed))
        };
        for (name, point) in [("eye", eye), ("target", target), ("up", up)] {
            if !point.is_finite() {
                return refuse(name, point.to_string(), "finite numbers");
            }
        }
        let Some(forward) = direction(target - eye) else {
            return refuse("target", format!("{target}, where the camera stands"), "a point away from eye");
        };
        let Some(up_unit) = direction(up) else {
            return refuse("up", up.to_string(), "a direction that is not zero");
        };
        let right = forward.cross(up_unit);
        if right.length() < LEAST_TILT {
            return refuse("up", format!("{up}, along the line of sight"), "a direction across it");
        }
        let right = right.normalize();
        let rotation = DMat3::from_cols(right, forward.cross(right), forward);
        Self::new(argument, rotation, eye)
    }
}

/// The unit vector along `v`; `None` for zero and on overflow.
fn direction(v: DVec3) -> Option<DVec3> {
    // Divide by the largest entry first, so that lengths of 1e-200 and 1e200 neither vanish nor overflow.
    (v / v.abs().max_element()).try_normalize()
}

impl Intrinsics {
    /// Intrinsics of a pinhole with vertical field of view `fov_y_degrees`, square pixels and the principal point in
    /// the middle.
    ///
    /// # Errors
    /// `fov_y_degrees` is not between 0 and 180, both excluded.
    pub fn from_fov(width: u32, height: u32, fov_y_degrees: f64) -> Result<Self> {
        if !(fov_y_degrees > 0.0 && fov_y_degrees < 180.0) {
            let allowed = "above 0, below 180 degrees";
            return Err(Error::argument("fov_y_degrees", fov_y_degrees.to_string(), allowed));
        }
        let (half_width, half_height) = (0.5 * f64::from(width), 0.5 * f64::from(height));
        let focal = half_height / (0.5 * fov_y_degrees.to_radians()).tan();
        Ok(Self { fx: focal, fy: focal, cx: half_width, cy: half_height })
    }
}

impl Camera {
    /// A pinhole camera at `eye` that looks at `target`, metres, vehicle frame: [`Pose::look_at`] with
    /// [`Intrinsics::from_fov`]. For another lens, pass [`Pose::look_at`] to its constructor.
    ///
    /// # Errors
    /// Those of these two and of [`Camera::validate`].
    pub fn look_at(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        fov_y_degrees: f64,
        width: u32,
        height: u32,
    ) -> Result<Self> {
        let pose = Pose::look_at("", eye, target, up)?;
        Self::pinhole(width, height, Intrinsics::from_fov(width, height, fov_y_degrees)?, pose)
    }
}

/// Parameters of a turntable, a circle of cameras around a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turntable {
    /// Angle by which the cameras look down, -89 to 89 degrees.
    pub elevation_degrees: f64,
    /// Vertical field of view, degrees.
    pub fov_y_degrees: f64,
}

impl Default for Turntable {
    /// A view slightly from above, through a portrait lens.
    fn default() -> Self {
        Self { elevation_degrees: 12.0, fov_y_degrees: 35.0 }
    }
}

impl Turntable {
    /// `count` cameras on a circle around the box from `low` to `high`, metres, vehicle frame: the first in front, the
    /// next towards the left, each with the whole box in its picture. `Gaussians::bounds`
    /// returns the box of a model.
    ///
    /// # Errors
    /// `count` is 0 or above 100,000, `low` is above `high`, a bound is not finite, an angle is out of range, or
    /// [`Camera::validate`] rejects a camera.
    pub fn cameras(
        &self,
        low: [f32; 3],
        high: [f32; 3],
        count: usize,
        width: u32,
        height: u32,
    ) -> Result<Vec<Camera>> {
        if !(1..=MOST_CAMERAS).contains(&count) {
            return Err(Error::argument("count", count.to_string(), format!("1 to {MOST_CAMERAS} cameras")));
        }
        if !(-89.0..=89.0).contains(&self.elevation_degrees) {
            let allowed = "-89 to 89 degrees";
            return Err(Error::argument("elevation_degrees", self.elevation_degrees.to_string(), allowed));
        }
        if !(0..3).all(|k| low[k] <= high[k] && low[k].is_finite() && high[k].is_finite()) {
            let found = format!("{low:?} to {high:?}");
            return Err(Error::argument("bounds", found, "finite numbers, low not above high"));
        }
        let (low, high) = (DVec3::from(low.map(f64::from)), DVec3::from(high.map(f64::from)));
        let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
        let intrinsics = Intrinsics::from_fov(width, height, self.fov_y_degrees)?;
        let unplaced = Camera::pinhole(width, height, intrinsics, Pose::IDENTITY)?;
        let (sin, cos) = self.elevation_degrees.to_radians().sin_cos();
        let radius = half.x.hypot(half.y).max(LEAST_RADIUS_M);
        let tangent = |side: u32| 0.5 * f64::from(side) / intrinsics.fx;
        let fits = fitting_distance(radius, half.z, (sin, cos), [tangent(width), tangent(height)]);
        let distance = MARGIN * fits;
        let camera = |i: usize| {
            let azimuth = std::f64::consts::TAU * i as f64 / count as f64;
            let outwards = DVec3::new(azimuth.cos() * cos, azimuth.sin() * cos, sin);
            let pose = Pose::look_at("turntable.", center + distance * outwards, center, DVec3::Z)?;
            let camera = Camera { vehicle_from_camera: pose, ..unplaced };
            camera.validate("turntable").map(|()| camera)
        };
        (0..count).map(camera).collect()
    }
}

/// Smallest distance, from the middle of an upright cylinder, of a camera whose picture contains the cylinder.
/// `tangents` are those of half its fields of view, `(sin, cos)` that of the angle by which it looks down.
///
/// A point of the rims at azimuth a from the line of sight and height z lies r cos(a) cos + z sin nearer to the camera
/// than the middle, r sin(a) to its side and z cos - r cos(a) sin above it. Horizontally, the sum of the two is largest
/// at tan(a) = 1 / (tangent cos); vertically, at one of a = 0 and a = pi.
fn fitting_distance(
    radius: f64,
    half_height: f64,
    (sin, cos): (f64, f64),
    [tangent_x, tangent_y]: [f64; 2],
) -> f64 {
    let for_width = radius * cos.hypot(1.0 / tangent_x) + half_height * sin.abs();
    let ends = [-radius, radius].into_iter().flat_map(|r| [(r, -half_height), (r, half_height)]);
    let for_height = ends.map(|(r, z)| (z * cos - r * sin).abs() / tangent_y + r * cos + z * sin);
    for_height.fold(for_width, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_is_in_the_middle_and_a_point_above_it_is_higher_in_the_picture() {
        let (eye, target) = (DVec3::new(3.0, -4.0, 1.5), DVec3::new(0.2, 0.1, -0.3));
        for up in [DVec3::Z, 1e200 * DVec3::Z, 1e-200 * DVec3::Z] {
            let camera = Camera::look_at(eye, target, up, 40.0, 640, 480).unwrap();
            assert_eq!(camera.center(), eye);
            let pixel = |point| camera.pixel_from_vehicle(point).unwrap();
            let [u, v] = pixel(target);
            // Pixel coordinates are up to 1e3, with steps of 1e-13.
            assert!((u - 320.0).abs() < 1e-10 && (v - 240.0).abs() < 1e-10, "{u} {v}");
            let above = pixel(target + 0.1 * DVec3::Z);
            assert!((above[0] - 320.0).abs() < 1e-10 && above[1] < 235.0, "{above:?}");
            // Seen from the right side, the vehicle's front is on the right.
            assert!(pixel(target + 0.1 * DVec3::X)[0] > 325.0);
        }
    }

    #[test]
    fn the_field_of_view_reaches_from_the_top_to_the_bottom_row() {
        let camera =
            Camera::look_at(DVec3::new(0.0, -5.0, 0.0), DVec3::ZERO, DVec3::Z, 60.0, 640, 480).unwrap();
        let top = camera.pixel_from_vehicle(DVec3::new(0.0, 0.0, 5.0 * 30f64.to_radians().tan())).unwrap();
        assert!((top[0] - 320.0).abs() < 1e-9 && top[1].abs() < 1e-9, "{top:?}");
    }

    #[test]
    fn views_without_a_direction_are_refused_by_argument() {
        let look = |eye, target, up, fov| Camera::look_at(eye, target, up, fov, 64, 48);
        let (o, x, z) = (DVec3::ZERO, DVec3::X, DVec3::Z);
        for (camera, beginning) in [
            (look(x, x, z, 40.0), "target: "),
            (look(x, o, x, 40.0), "up: "),
            (look(x, o, o, 40.0), "up: "),
            (look(DVec3::NAN, o, z, 40.0), "eye: "),
            (look(x, DVec3::new(f64::INFINITY, 0.0, 0.0), z, 40.0), "target: "),
            (look(x, o, z, 0.0), "fov_y_degrees: "),
            (look(x, o, z, 180.0), "fov_y_degrees: "),
            (look(x, o, z, f64::NAN), "fov_y_degrees: "),
            (look(1e300 * x, -1e300 * x, z, 40.0), "camera.vehicle_from_camera: "),
        ] {
            let error = camera.unwrap_err().to_string();
            assert!(error.starts_with(beginning), "{error}");
        }
    }

    #[test]
    fn a_turntable_has_the_whole_box_in_every_picture_and_begins_in_front() {
        let (low, high) = ([-2.5, -0.9, -0.7], [2.1, 0.8, 0.9]);
        let cases =
            [(12.0, 35.0, 640, 480), (-20.0, 35.0, 300, 900), (80.0, 120.0, 900, 300), (30.0, 170.0, 64, 64)];
        for (elevation_degrees, fov_y_degrees, width, height) in cases {
            let table = Turntable { elevation_degrees, fov_y_degrees };
            let cameras = table.cameras(low, high, 7, width, height).unwrap();
            assert_eq!(cameras.len(), 7);
            let (first, second) = (cameras[0].center(), cameras[1].center());
            // The box's middle is (-0.2, -0.05, 0.1), rounded to f32.
            assert!(first.x > 0.0 && (first.y + 0.05).abs() < 1e-6 && second.y > 0.1, "{first} {second}");
            for camera in &cameras {
                for corner in 0..8 {
                    let side = |k: usize| f64::from(if corner >> k & 1 == 0 { low[k] } else { high[k] });
                    let [u, v] = camera.pixel_from_vehicle(DVec3::new(side(0), side(1), side(2))).unwrap();
                    let inside =
                        (0.0..=f64::from(width)).contains(&u) && (0.0..=f64::from(height)).contains(&v);
                    assert!(inside, "elevation {elevation_degrees}, corner {corner}: {u} {v}");
                }
            }
        }
    }

    #[test]
    fn invalid_turntables_are_refused() {
        let cameras = |table: Turntable, low, count| table.cameras(low, [1.0; 3], count, 64, 48);
        let (usual, low) = (Turntable::default(), [-1.0; 3]);
        for (made, beginning) in [
            (cameras(usual, low, 0), "count: "),
            (cameras(usual, low, 100_001), "count: "),
            (cameras(usual, [-1.0, 2.0, -1.0], 3), "bounds: "),
            (cameras(usual, [f32::NAN; 3], 3), "bounds: "),
            (usual.cameras(low, [1.0; 3], 3, 0, 48), "camera.size: "),
            (usual.cameras(low, [1.0; 3], 3, 64, 8193), "camera.size: "),
            (usual.cameras([-3e38; 3], [3e38; 3], 3, 64, 48), "turntable.vehicle_from_camera: "),
            (cameras(Turntable { elevation_degrees: 89.5, ..usual }, low, 3), "elevation_degrees: "),
            (cameras(Turntable { elevation_degrees: f64::NAN, ..usual }, low, 3), "elevation_degrees: "),
            (cameras(Turntable { fov_y_degrees: 200.0, ..usual }, low, 3), "fov_y_degrees: "),
        ] {
            let error = made.unwrap_err().to_string();
            assert!(error.starts_with(beginning), "{error}");
        }
        assert_eq!(cameras(usual, [1.0; 3], 1).unwrap().len(), 1);
    }
}
