//! A silhouette as a signed distance in pixels, and as a bound on the hull in metres.

use glam::{Mat3, Vec3};
use vg_geometry::{Camera, Intrinsics};
use vg_scene::View;
use vg_scene::mask::{Label, Mask};

/// Distance without a feature, pixels; larger than any picture, small enough that its square is exact in f32.
const FAR: f32 = 1e5;

/// One view's silhouette as a signed distance field.
pub struct Silhouette {
    width: usize,
    height: usize,
    /// Signed distance in pixels at pixel centres: positive where the vehicle may be. `[height * width]`
    distance: Vec<f32>,
    /// Whether the picture's left, top, right, bottom border cuts the silhouette: beyond such a side the vehicle may
    /// continue, beyond the others it does not.
    cut: [bool; 4],
    camera_from_vehicle: (Mat3, Vec3),
    intrinsics: Intrinsics,
}

impl Silhouette {
    /// The silhouette of a pinhole view with a mask.
    pub fn new(view: &View) -> Self {
        let mask = view.mask.as_ref().expect("hull views have masks");
        let (width, height) = (mask.width() as usize, mask.height() as usize);
        let may_continue = touches_unknown(mask);
        let background = |i: usize| match mask.labels()[i] {
            Label::Background => true,
            Label::Unknown => !may_continue,
            Label::Vehicle => false,
        };
        let to_background = distance_transform(width, height, background);
        let to_vehicle = distance_transform(width, height, |i| !background(i));
        // The edge runs between two pixel centres, half a pixel from either.
        let distance = to_background
            .iter()
            .zip(&to_vehicle)
            .map(|(&b, &v)| if b > 0.0 { b - 0.5 } else { 0.5 - v })
            .collect();
        let camera_from_vehicle = view.camera.vehicle_from_camera.inverse();
        Self {
            width,
            height,
            distance,
            cut: cut_sides(mask),
            camera_from_vehicle: (
                camera_from_vehicle.rotation.as_mat3(),
                camera_from_vehicle.translation.as_vec3(),
            ),
            intrinsics: view.camera.intrinsics,
        }
    }

    /// Distance of `point` (vehicle frame) inside this view's cone, metres, negative outside; infinite beyond a border
    /// that cuts the silhouette, and behind the camera if any border does.
    pub fn inside(&self, point: Vec3) -> f32 {
        self.inside_camera(self.camera_from_vehicle.0 * point + self.camera_from_vehicle.1)
    }

    /// [`Silhouette::inside`] for a point in the camera's frame, for a camera that is moved.
    pub(crate) fn inside_camera(&self, p: Vec3) -> f32 {
        // Nearest depth at which a point is projected.
        const NEAR_M: f32 = 0.05;
        if p.z < NEAR_M {
            // If the picture shows the whole vehicle, none of it is behind the camera.
            return if self.cut.contains(&true) { f32::INFINITY } else { p.z - NEAR_M - 1.0 };
        }
        let inverse_z = p.z.recip();
        let u = self.intrinsics.fx as f32 * p.x * inverse_z + self.intrinsics.cx as f32;
        let v = self.intrinsics.fy as f32 * p.y * inverse_z + self.intrinsics.cy as f32;
        let beyond = [-u, -v, u - self.width as f32, v - self.height as f32];
        let mut outside = 0.0f32;
        for (side, distance) in beyond.into_iter().enumerate() {
            if distance > 0.0 {
                if self.cut[side] {
                    return f32::INFINITY;
                }
                outside = outside.max(distance);
            }
        }
        let metres_per_pixel = p.z / self.intrinsics.smaller_focal() as f32;
        (self.sample(u - 0.5, v - 0.5) - outside) * metres_per_pixel
    }

    /// Bilinear sample; integer coordinates are pixel centres, edges repeated.
    fn sample(&self, x: f32, y: f32) -> f32 {
        let x = x.clamp(0.0, (self.width - 1) as f32);
        let y = y.clamp(0.0, (self.height - 1) as f32);
        let (u, v) = (x as usize, y as usize);
        let (fx, fy) = (x - u as f32, y - v as f32);
        let (u1, v1) = ((u + 1).min(self.width - 1), (v + 1).min(self.height - 1));
        let at = |u: usize, v: usize| self.distance[v * self.width + u];
        let top = at(u, v) + (at(u1, v) - at(u, v)) * fx;
        let bottom = at(u, v1) + (at(u1, v1) - at(u, v1)) * fx;
        top + (bottom - top) * fy
    }
}

/// Whether vehicle pixels lie at the left, top, right, bottom border.
fn cut_sides(mask: &Mask) -> [bool; 4] {
    let (w, h) = (mask.width(), mask.height());
    [
        (0..h).any(|v| mask.is_vehicle(0, v)),
        (0..w).any(|u| mask.is_vehicle(u, 0)),
        (0..h).any(|v| mask.is_vehicle(w - 1, v)),
        (0..w).any(|u| mask.is_vehicle(u, h - 1)),
    ]
}

/// Whether the vehicle may continue in unknown pixels: one of them has a vehicle neighbour.
fn touches_unknown(mask: &Mask) -> bool {
    let (w, h) = (mask.width(), mask.height());
    let unknown = |u: u32, v: u32| mask.labels()[(v * w + u) as usize] == Label::Unknown;
    (0..h).any(|v| {
        (0..w).any(|u| {
            mask.is_vehicle(u, v)
                && ((u > 0 && unknown(u - 1, v))
                    || (u + 1 < w && unknown(u + 1, v))
                    || (v > 0 && unknown(u, v - 1))
                    || (v + 1 < h && unknown(u, v + 1)))
        })
    })
}

/// A ray through the centre of the silhouette, vehicle frame: origin and unit direction.
pub fn central_ray(camera: &Camera, bounds: [u32; 4]) -> (glam::DVec3, glam::DVec3) {
    let pixel = [0.5 * f64::from(bounds[0] + bounds[2] + 1), 0.5 * f64::from(bounds[1] + bounds[3] + 1)];
    let [x, y] = camera.intrinsics.normalized_from_pixel(pixel);
    let direction = camera.vehicle_from_camera.rotation * glam::DVec3::new(x, y, 1.0).normalize();
    (camera.center(), direction)
}

/// Exact Euclidean distance in pixels from every pixel to the nearest one with `is_feature` (Felzenszwalb and
/// Huttenlocher 2012): lower envelopes of parabolas along columns, then along rows.
fn distance_transform(width: usize, height: usize, is_feature: impl Fn(usize) -> bool) -> Vec<f32> {
    let mut squared = vec![FAR * FAR; width * height];
    // Along columns distances are integers: two sweeps suffice.
    for u in 0..width {
        let mut since = FAR;
        for v in (0..height).chain((0..height).rev()) {
            since = if is_feature(v * width + u) { 0.0 } else { since + 1.0 };
            let cell = &mut squared[v * width + u];
            *cell = cell.min((since * since).min(FAR * FAR));
        }
    }
    let mut envelope = Envelope::new(width);
    for row in squared.chunks_exact_mut(width) {
        envelope.transform(row);
    }
    squared.iter().map(|d| d.sqrt().min(FAR)).collect()
}

/// Buffers of the one-dimensional transform.
struct Envelope {
    input: Vec<f32>,
    vertices: Vec<usize>,
    starts: Vec<f32>,
}

impl Envelope {
    fn new(n: usize) -> Self {
        Self { input: vec![0.0; n], vertices: vec![0; n], starts: vec![0.0; n + 1] }
    }

    /// Replaces row[x] by the minimum over q of row[q] + (x - q)^2.
    fn transform(&mut self, row: &mut [f32]) {
        let f = &mut self.input;
        f.copy_from_slice(row);
        let (vertices, starts) = (&mut self.vertices, &mut self.starts);
        let mut k = 0;
        vertices[0] = 0;
        starts[0] = f32::NEG_INFINITY;
        starts[1] = f32::INFINITY;
        for q in 1..f.len() {
            let crossing = |p: usize| {
                let (p, q, fp, fq) = (p as f64, q as f64, f64::from(f[p]), f64::from(f[q]));
                ((fq + q * q - fp - p * p) / (2.0 * (q - p))) as f32
            };
            let mut s = crossing(vertices[k]);
            while s <= starts[k] {
                k -= 1;
                s = crossing(vertices[k]);
            }
            k += 1;
            vertices[k] = q;
            starts[k] = s;
            starts[k + 1] = f32::INFINITY;
        }
        k = 0;
        for (x, out) in row.iter_mut().enumerate() {
            while starts[k + 1] < x as f32 {
                k += 1;
            }
            let d = x as f32 - vertices[k] as f32;
            *out = f[vertices[k]] + d * d;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_transform_equals_brute_force() {
        let (w, h) = (23, 17);
        let feature = |i: usize| (i * 7919 + 13).is_multiple_of(41);
        let fast = distance_transform(w, h, feature);
        for v in 0..h {
            for u in 0..w {
                let brute = (0..w * h)
                    .filter(|&i| feature(i))
                    .map(|i| ((i % w) as f32 - u as f32).hypot((i / w) as f32 - v as f32))
                    .fold(FAR, f32::min);
                assert!((fast[v * w + u] - brute).abs() < 1e-4, "({u}, {v})");
            }
        }
        assert!(distance_transform(5, 4, |_| false).iter().all(|&d| d >= 1e4));
    }
}
