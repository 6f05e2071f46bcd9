//! Cameras like those of photographers and cars: one to eight views of one side.

use glam::{DMat3, DVec3};
use rand::Rng;
use rand_distr::{Distribution, Normal};
use vg::geometry::{Camera, Intrinsics, Pose};

/// Size of the pictures in pixels; they resolve more than the network's lattice.
pub const WIDTH: u32 = 256;
pub const HEIGHT: u32 = 192;

/// Random cameras around a vehicle of `size` metres whose middle is `middle`; the ground is z = 0.
pub fn draw(size: DVec3, middle: DVec3, rng: &mut impl Rng) -> Vec<Camera> {
    let n = match rng.random_range(0..100) {
        0..8 => 1,
        8..20 => 2,
        20..32 => 3,
        32..76 => 4,
        76..84 => 5,
        84..92 => 6,
        _ => 8,
    };
    let close = rng.random_bool(0.06);
    // From a handheld ring around the vehicle to a sensor that passes far away.
    let radius = 0.5 * size.x.hypot(size.y);
    let nearest = (radius + 1.5).max(4.0);
    let far = rng.random_bool(0.3);
    let distance = if far {
        rng.random_range(nearest..30.0f64.max(nearest + 1.0))
    } else {
        nearest + rng.random_range(0.0..3.0)
    };
    let height = rng.random_range(1.0..2.5);
    // Azimuth from the front to one side; the fan may be wide or narrow, and lean to one end.
    let fan = if n == 1 { 0.0 } else { rng.random_range(25.0..155.0f64).max(12.0 * (n - 1) as f64) };
    let middle_azimuth = 90.0 + rng.random_range(-0.5..0.5) * (200.0 - fan).max(30.0);
    let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    // The whole vehicle is in the picture, as with photographers.
    let filled = rng.random_range(0.45..0.95) * if close { 1.6 } else { 1.0 };
    let same_lens = rng.random_bool(0.8);
    let spread = Normal::new(0.0, 1.0).expect("a deviation above 0");
    let mut focal = 0.0;
    (0..n)
        .map(|i| {
            let t = if n == 1 { 0.0 } else { i as f64 / (n - 1) as f64 - 0.5 };
            let azimuth = (middle_azimuth + t * fan + 4.0 * spread.sample(rng)).to_radians();
            let d = distance * (1.0 + 0.06 * spread.sample(rng)).clamp(0.8, 1.25);
            let z = (height + 0.15 * spread.sample(rng)).clamp(0.6, 3.0);
            let center = DVec3::new(middle.x + d * azimuth.cos(), side * d * azimuth.sin(), z);
            let wobble = if close { 0.3 } else { 0.06 };
            let aim =
                middle + wobble * size * DVec3::from_array(std::array::from_fn(|_| 0.5 * spread.sample(rng)));
            let roll = (0.01 * spread.sample(rng)).clamp(-0.05, 0.05);
            // Angular width of the vehicle from here.
            let across = size.x * azimuth.sin().abs() + size.y * azimuth.cos().abs();
            let needed = (across / (d - 0.3 * across).max(1.0) / f64::from(WIDTH))
                .max(size.z / (d - 0.4 * across).max(1.0) / f64::from(HEIGHT));
            if !same_lens || focal == 0.0 {
                focal = filled / needed;
            }
            // The lens must not cut a vehicle that is to be complete.
            let f = if close { focal } else { focal.min(0.97 / needed) };
            looking_at(aim, center, roll, f, (WIDTH, HEIGHT))
        })
        .collect()
}

/// A camera at `center` with its optical axis through `aim`, turned by `roll` radians about it.
pub fn looking_at(aim: DVec3, center: DVec3, roll: f64, focal: f64, (width, height): (u32, u32)) -> Camera {
    let forward = (aim - center).normalize();
    let right = forward.cross(DVec3::Z).normalize();
    let down = forward.cross(right);
    let (s, c) = roll.sin_cos();
    let rotation = DMat3::from_cols(c * right + s * down, c * down - s * right, forward);
    let intrinsics =
        Intrinsics { fx: focal, fy: focal, cx: 0.5 * f64::from(width), cy: 0.5 * f64::from(height) };
    Camera::pinhole(width, height, intrinsics, Pose { rotation, translation: center })
        .expect("a valid camera")
}
