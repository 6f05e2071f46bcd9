//! A vehicle with known geometry: a textured ellipsoid standing on the ground, seen by cameras around it.

use glam::{DMat3, DVec3};
use vg::geometry::{Intrinsics, Pose};
use vg::scene::mask::Label;
use vg::scene::{DepthMap, Mask, RgbImage};
use vg::{Camera, Scene, View};

/// Half axes, metres: 4.4 x 1.8 x 1.4 m.
pub const HALF: DVec3 = DVec3::new(2.2, 0.9, 0.7);

/// A pinhole camera of `width` x `height` at `azimuth` degrees (0 in front, 90 at the left), `distance` metres away
/// and 0.8 m above the middle, looking at it.
pub fn camera(azimuth: f64, distance: f64, width: u32, height: u32) -> Camera {
    let (s, c) = azimuth.to_radians().sin_cos();
    let eye = DVec3::new(distance * c, distance * s, 0.8);
    let z = -eye.normalize();
    let x = z.cross(DVec3::Z).normalize();
    let pose = Pose::new("camera", DMat3::from_cols(x, z.cross(x), z), eye).unwrap();
    let focal = f64::from(width) * 1.0;
    let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    Camera::pinhole(width, height, Intrinsics { fx: focal, fy: focal, cx, cy }, pose).unwrap()
}

/// The view of the ellipsoid from a camera: picture, exact mask, exact planar depth.
pub fn view(name: &str, camera: Camera) -> View {
    let (mut pixels, mut labels, mut depth) = (Vec::new(), Vec::new(), Vec::new());
    for v in 0..camera.height {
        for u in 0..camera.width {
            let ray = camera.ray([f64::from(u) + 0.5, f64::from(v) + 0.5]).unwrap();
            let direction = camera.vehicle_from_camera.rotation * ray;
            let hit = hit(camera.center(), direction);
            labels.push(if hit.is_some() { Label::Vehicle } else { Label::Background });
            depth.push(hit.unwrap_or(0.0) as f32);
            pixels.push(hit.map_or([40, 90, 40], |z| color(camera.center() + z * direction)));
        }
    }
    let (width, height) = (camera.width, camera.height);
    View {
        name: name.into(),
        camera,
        image: RgbImage::new(width, height, pixels).unwrap(),
        mask: Some(Mask::new(width, height, labels).unwrap()),
        depth: Some(DepthMap::new(width, height, depth).unwrap()),
    }
}

/// Four views of the right side.
pub fn right_side(width: u32, height: u32) -> Scene {
    let views = [-40.0, -75.0, -105.0, -140.0];
    Scene {
        views: views.iter().map(|a| view(&format!("{a}"), camera(*a, 6.5, width, height))).collect(),
        ..Scene::default()
    }
}

/// The scene without depth.
pub fn without_depth(mut scene: Scene) -> Scene {
    scene.views.iter_mut().for_each(|v| v.depth = None);
    scene
}

/// First z >= 0 with `origin + z direction` on the ellipsoid.
fn hit(origin: DVec3, direction: DVec3) -> Option<f64> {
    let (o, d) = (origin / HALF, direction / HALF);
    let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
    let z = (-b - (b * b - a * c).sqrt()) / a;
    (z >= 0.0).then_some(z)
}

/// Smooth paint that is the same on both sides.
fn color(p: DVec3) -> [u8; 3] {
    let wave = |x: f64| (127.5 + 90.0 * x.sin()) as u8;
    [wave(2.0 * p.x), wave(3.0 * p.z + p.x), wave(4.0 * p.y.abs() + 1.0)]
}
