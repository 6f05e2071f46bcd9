//! Projection of points of the vehicle frame to pixels and back, through the camera's lens.

use super::camera::Camera;
use super::unfolded::Unfolded;
use glam::DVec3;

/// Largest difference, relative to the radius from the axis, between a ray and the one that [`Camera::ray`] returns for
/// its pixel. Beyond a fold of the model these are different rays; before it they differ by the solver's tolerance,
/// 1e-9.
const SAME_RAY: f64 = 1e-6;

/// Number of points from which a table of the lens's folds is faster than undistorting each pixel: the table costs as
/// much as some thousand of them.
const TABLE_PAYS: usize = 5_000;

/// Radius from the axis, x/z, up to which the table reaches where a corner of the picture has no ray: 76 degrees.
const WIDEST_RADIUS: f64 = 4.0;

/// A pixel, and the planar depth of the point seen there, metres.
pub type PixelAndDepth = ([f64; 2], f64);

impl Camera {
    /// Column and row of a point, metres, vehicle frame. `None` where the camera cannot see it: on or behind its plane,
    /// and beyond the angle at which the lens model folds back, where a pixel would show a ghost.
    pub fn pixel_from_vehicle(&self, point_vehicle: DVec3) -> Option<[f64; 2]> {
        self.pixel_and_depth(point_vehicle).map(|(pixel, _)| pixel)
    }

    /// The pixel of a point, as [`Camera::pixel_from_vehicle`], and the point's planar depth, metres along the optical
    /// axis.
    pub fn pixel_and_depth(&self, point_vehicle: DVec3) -> Option<PixelAndDepth> {
        self.pixel_and_depth_by(None, point_vehicle)
    }

    /// The result of [`Camera::pixel_and_depth`] for each of many points, in their order.
    pub fn pixels_and_depths(&self, points_vehicle: &[[f64; 3]]) -> Vec<Option<PixelAndDepth>> {
        let has_table = points_vehicle.len() >= TABLE_PAYS && !self.distortion.is_none();
        let table = has_table.then(|| Unfolded::new(&self.distortion, self.corner_radius()));
        let each = |&point| self.pixel_and_depth_by(table.as_ref(), DVec3::from_array(point));
        points_vehicle.iter().map(each).collect()
    }

    /// Points that `table` contains need no undistortion.
    fn pixel_and_depth_by(&self, table: Option<&Unfolded>, point_vehicle: DVec3) -> Option<PixelAndDepth> {
        let point = self.vehicle_from_camera.inverse().transform_point(point_vehicle);
        let pixel = self.project(point).filter(|p| p.iter().all(|v| v.is_finite()))?;
        let ray = [point.x / point.z, point.y / point.z];
        let seen = self.distortion.is_none()
            || table.is_some_and(|table| table.contains(ray))
            || self.is_seen_along(ray, pixel);
        seen.then_some((pixel, point.z))
    }

    /// Largest radius (x/z, y/z) of the picture's corners.
    fn corner_radius(&self) -> f64 {
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let corners = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]];
        let radius = |pixel| self.ray(pixel).map_or(WIDEST_RADIUS, |ray| ray.x.hypot(ray.y));
        corners.into_iter().map(radius).fold(0.0, f64::max).min(WIDEST_RADIUS)
    }

    /// Whether the ray of this pixel is the one that was projected to it.
    fn is_seen_along(&self, [x, y]: [f64; 2], pixel: [f64; 2]) -> bool {
        self.ray(pixel).is_some_and(|ray| (ray.x - x).hypot(ray.y - y) <= SAME_RAY * (1.0 + x.hypot(y)))
    }

    /// Lifts a pixel to the point at planar depth `depth_m`, metres, vehicle frame. `None` where the lens has no ray to
    /// the pixel, and where the depth is not finite or not above 0, which means no measurement.
    pub fn vehicle_from_pixel(&self, pixel: [f64; 2], depth_m: f64) -> Option<DVec3> {
        if depth_m.is_nan() || depth_m <= 0.0 {
            return None;
        }
        let point = self.vehicle_from_camera.transform_point(self.ray(pixel)? * depth_m);
        point.is_finite().then_some(point)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Distortion, Intrinsics, Pose};
    use super::*;

    fn camera(distortion: Distortion) -> Camera {
        let intrinsics = Intrinsics { fx: 500.0, fy: 510.0, cx: 320.25, cy: 239.5 };
        let pose =
            Pose::look_at("", DVec3::new(3.0, -4.0, 1.5), DVec3::new(0.1, 0.2, 0.3), DVec3::Z).unwrap();
        Camera { width: 640, height: 480, intrinsics, distortion, vehicle_from_camera: pose }
    }

    const BROWN: Distortion = Distortion::Brown { k: [-0.2, 0.05, 0.0, 0.0, 0.0, 0.0], p: [1e-3, -2e-3] };
    const FISHEYE: Distortion = Distortion::Fisheye { k: [0.02, -0.01, 0.003, 0.0] };

    #[test]
    fn pixels_with_their_depths_are_the_points_they_were_projected_from() {
        for distortion in [Distortion::None, BROWN, FISHEYE] {
            let camera = camera(distortion);
            for i in 0..100 {
                let t = f64::from(i);
                let point = DVec3::new((0.7 * t).sin(), (1.3 * t).cos(), 0.5 * (0.3 * t).sin());
                let (pixel, depth) = camera.pixel_and_depth(point).unwrap();
                let back = camera.vehicle_from_pixel(pixel, depth).unwrap();
                // Rays are accurate to 1e-9, distances are about 6.
                assert!((back - point).length() < 1e-8, "{distortion:?} {point} {back}");
            }
        }
    }

    #[test]
    fn a_point_beyond_the_fold_of_the_lens_has_no_pixel() {
        // r (1 - r^2 / 3) turns back at r = 1: the ray at 1.2 would share a pixel with the one at 0.78.
        let fold = Distortion::Brown { k: [-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
        let camera = Camera { vehicle_from_camera: Pose::IDENTITY, ..camera(fold) };
        let at = |r: f64| camera.pixel_from_vehicle(DVec3::new(r, 0.0, 1.0));
        assert!(at(0.78).is_some() && at(1.2).is_none());
        assert!(camera.project(DVec3::new(1.2, 0.0, 1.0)).is_some(), "the lens model alone has one");
    }

    #[test]
    fn many_points_have_the_pixels_of_each() {
        // The last of them folds within the points' angles.
        let fold = Distortion::Brown { k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], p: [1e-3, 0.0] };
        for distortion in [Distortion::None, BROWN, FISHEYE, fold] {
            let camera = camera(distortion);
            let point = |i: usize| {
                let t = i as f64;
                [4.0 * (0.7 * t).sin(), 4.0 * (1.3 * t).cos(), 3.0 * (0.3 * t).sin()]
            };
            let points: Vec<[f64; 3]> = (0..TABLE_PAYS).map(point).collect();
            let many = camera.pixels_and_depths(&points);
            let each: Vec<_> = points.iter().map(|p| camera.pixel_and_depth(DVec3::from_array(*p))).collect();
            assert_eq!(many, each, "{distortion:?}");
            assert!(many.iter().flatten().count() > TABLE_PAYS / 2);
        }
    }

    #[test]
    fn points_behind_the_camera_or_not_finite_have_no_pixel_and_invalid_depths_give_no_point() {
        let camera = camera(BROWN);
        for point in [DVec3::new(6.0, -8.0, 2.7), camera.center(), DVec3::NAN, DVec3::INFINITY] {
            assert_eq!(camera.pixel_from_vehicle(point), None, "{point}");
        }
        for depth in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(camera.vehicle_from_pixel([10.0, 20.0], depth), None, "{depth}");
        }
        assert_eq!(camera.vehicle_from_pixel([f64::NAN, 20.0], 1.0), None);
    }
}
