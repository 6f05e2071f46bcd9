//! A vehicle made of boxes in a world of arbitrary position, rotation and scale: masks, sparse points, and a scan with
//! known alignment.

use super::Random;
use glam::{DMat3, DQuat, DVec2, DVec3};
use vg::geometry::{Intrinsics, Pose, Similarity};
use vg::scene::mask::Label;
use vg::scene::{Cloud, Mask, RgbImage};
use vg::{Camera, View};

/// Low and high corner of each box, vehicle frame.
pub type Shape = Vec<[DVec3; 2]>;

fn block(x: [f64; 2], y: [f64; 2], z: [f64; 2]) -> [DVec3; 2] {
    [DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1])]
}

/// A car of 4.2 x 1.8 x 1.5 m on wheels, with the cabin over the rear or over the middle.
pub fn car(cabin_x: [f64; 2]) -> Shape {
    let wheel = |x: f64, y: f64| block([x - 0.3, x + 0.3], [y - 0.1, y + 0.1], [-0.75, -0.3]);
    let body = block([-2.1, 2.1], [-0.9, 0.9], [-0.55, 0.2]);
    let cabin = block(cabin_x, [-0.75, 0.75], [0.2, 0.75]);
    let wheels = [(1.3, 0.8), (1.3, -0.8), (-1.3, 0.8), (-1.3, -0.8)].map(|(x, y)| wheel(x, y));
    [body, cabin].into_iter().chain(wheels).collect()
}

/// A hatchback, whose front and back differ.
pub fn hatchback() -> Shape {
    car([-2.0, 0.6])
}

/// A car with equal front and back.
pub fn symmetric() -> Shape {
    car([-1.2, 1.2])
}

/// The pose and scale of the world, different for each seed.
pub fn gauge(seed: u64) -> Similarity {
    let mut random = Random::new(seed);
    let axis = DVec3::new(random.normal(), random.normal(), random.normal()).normalize();
    let rotation = DMat3::from_quat(DQuat::from_axis_angle(axis, random.uniform(0.0, 3.1)));
    let scale = random.uniform(-1.5, 3.0).exp();
    let mut part = || random.uniform(-4.0, 4.0);
    Similarity { scale, rotation, translation: DVec3::new(part(), part(), part()) }
}

/// The inverse of a similarity such as `vehicle_from_world`.
pub fn inverse(s: &Similarity) -> Similarity {
    let (scale, rotation) = (s.scale.recip(), s.rotation.transpose());
    Similarity { scale, rotation, translation: -scale * (rotation * s.translation) }
}

/// A ring of views with poses in the world, the first from the front left.
pub fn views(shape: &Shape, n: usize, vehicle_from_world: &Similarity) -> Vec<View> {
    let world_from_vehicle = inverse(vehicle_from_world);
    let view = |k: usize| {
        let azimuth = std::f64::consts::TAU * (k as f64 / n as f64 + 0.08);
        let eye = DVec3::new(6.5 * azimuth.cos(), 6.5 * azimuth.sin(), if k % 3 == 2 { 2.6 } else { 0.9 });
        let z = -eye.normalize();
        let x = z.cross(DVec3::Z).normalize();
        let pose = Pose { rotation: DMat3::from_cols(x, z.cross(x), z), translation: eye };
        let (width, height) = (320, 240);
        let intrinsics = Intrinsics { fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0 };
        let mut camera = Camera::pinhole(width, height, intrinsics, pose).unwrap();
        let labels = (0..width * height).map(|i| {
            let pixel = DVec2::new(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
            let ray = pose.rotation * camera.ray(pixel.to_array()).unwrap();
            if shape.iter().any(|b| hits(b, eye, ray)) { Label::Vehicle } else { Label::Background }
        });
        let mask = Some(Mask::new(width, height, labels.collect()).unwrap());
        camera.vehicle_from_camera = world_from_vehicle.transform_pose(&pose);
        let image = RgbImage::new(width, height, vec![[0; 3]; (width * height) as usize]).unwrap();
        View { name: format!("{k:03}.png"), camera, image, mask, depth: None }
    };
    (0..n).map(view).collect()
}

fn hits([low, high]: &[DVec3; 2], eye: DVec3, ray: DVec3) -> bool {
    let (a, b) = ((*low - eye) / ray, (*high - eye) / ray);
    a.min(b).max_element() <= a.max(b).min_element() && a.max(b).min_element() > 0.0
}

/// Points of the surface with noise of 4 mm and one in a hundred anywhere around, in random order.
pub fn scan(shape: &Shape, n: usize, seed: u64) -> Vec<DVec3> {
    let mut random = Random::new(seed);
    let mut points = Vec::with_capacity(n);
    while points.len() < n {
        if random.uniform(0.0, 1.0) < 0.01 {
            let mut part = |half: f64| random.uniform(-half, half);
            points.push(DVec3::new(part(2.6), part(1.2), part(1.0)));
            continue;
        }
        let surface = on_surface(shape, &mut random);
        points.push(surface + 0.004 * DVec3::new(random.normal(), random.normal(), random.normal()));
    }
    points
}

/// A random point of the surface, uniform over the area and not inside another box.
fn on_surface(shape: &Shape, random: &mut Random) -> DVec3 {
    loop {
        let [low, high] = shape[(random.bits() % shape.len() as u64) as usize];
        let size = high - low;
        let axis = (random.bits() % 3) as usize;
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        // The largest face has an area of 8 square metres.
        if random.uniform(0.0, 8.0) > size[u] * size[v] {
            continue;
        }
        let mut point = low;
        point[axis] = if random.bits().is_multiple_of(2) { low[axis] } else { high[axis] };
        point[u] += random.uniform(0.0, size[u]);
        point[v] += random.uniform(0.0, size[v]);
        let inside = |b: &[DVec3; 2]| point.cmpgt(b[0] + 1e-6).all() && point.cmplt(b[1] - 1e-6).all();
        if !shape.iter().any(inside) {
            return point;
        }
    }
}

pub fn cloud(points: &[DVec3]) -> Cloud {
    Cloud::new(points.iter().map(|p| p.as_vec3().to_array()).collect()).unwrap()
}

/// Sparse points in the world: on the vehicle, to a centimetre, on the ground, and some outliers.
pub fn sparse(shape: &Shape, vehicle_from_world: &Similarity, seed: u64) -> Vec<DVec3> {
    let mut random = Random::new(seed);
    let world_from_vehicle = inverse(vehicle_from_world);
    let mut points = Vec::new();
    for _ in 0..300 {
        let noise = 0.01 * DVec3::new(random.normal(), random.normal(), random.normal());
        points.push(on_surface(shape, &mut random) + noise);
        let mut part = |half: f64| random.uniform(-half, half);
        points.push(DVec3::new(part(6.0), part(6.0), -0.75 + part(0.01)));
    }
    for _ in 0..60 {
        let mut part = || random.uniform(-8.0, 8.0);
        points.push(DVec3::new(part(), part(), part()));
    }
    points.iter().map(|p| world_from_vehicle.transform_point(*p)).collect()
}
