//! Surface normals from a depth map.

use glam::Vec3;
use rayon::prelude::*;
use vg_geometry::Camera;
use vg_scene::DepthMap;

/// Unit normals in the camera frame, towards the camera; zero where there is no depth. `[height * width]`
pub fn normals(camera: &Camera, depth: &DepthMap) -> Vec<Vec3> {
    let width = camera.width as usize;
    let inverse: Vec<f32> = depth.depth().iter().map(|&z| if z > 0.0 { z.recip() } else { 0.0 }).collect();
    let mut out = vec![Vec3::ZERO; inverse.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        for (u, normal) in row.iter_mut().enumerate() {
            if inverse[v * width + u] > 0.0 {
                *normal = normal_at(camera, &inverse, u, v);
            }
        }
    });
    out
}

/// Inverse depth is linear in pixel coordinates on a plane, so its gradient (a, b) gives the plane's normal:
/// with n . p = 1 and p = z (x, y, 1), 1/z = n_x x + n_y y + n_z, hence n_x = a fx and n_y = b fy.
fn normal_at(camera: &Camera, inverse: &[f32], u: usize, v: usize) -> Vec3 {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let here = inverse[v * width + u];
    let at = |du: isize, dv: isize| {
        let (u, v) = (u.checked_add_signed(du)?, v.checked_add_signed(dv)?);
        let value = if u < width && v < height { inverse[v * width + u] } else { 0.0 };
        (value > 0.0).then_some(value)
    };
    let slope =
        |du: isize, dv: isize| {
            let forward = one_sided(here, |k| at(k * du, k * dv));
            let backward = one_sided(here, |k| at(-k * du, -k * dv)).map(|s| -s);
            match (forward, backward) {
                // At a crease or a depth edge the smaller slope belongs to this pixel's own surface.
                (Some(f), Some(b)) if (f - b).abs() > f.abs().min(b.abs()) + 0.01 * here => {
                    if f.abs() < b.abs() { f } else { b }
                }
                (Some(f), Some(b)) => 0.5 * (f + b),
                (Some(s), None) | (None, Some(s)) => s,
                (None, None) => 0.0,
            }
        };
    let i = camera.intrinsics;
    let ray = i.pixel_ray(u as u32, v as u32).as_vec3();
    let (nx, ny) = (slope(1, 0) * i.fx as f32, slope(0, 1) * i.fy as f32);
    let plane = Vec3::new(nx, ny, here - nx * ray.x - ny * ray.y);
    // 1/z > 0 means plane . ray > 0: it points away from the camera.
    -plane.try_normalize().unwrap_or(Vec3::Z)
}

/// Slope of inverse depth per pixel towards neighbours at one and two steps.
fn one_sided(here: f32, at: impl Fn(isize) -> Option<f32>) -> Option<f32> {
    let near = at(1)? - here;
    Some(at(2).map_or(near, |far| 0.5 * (far - here)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::{Intrinsics, Pose};

    #[test]
    fn the_normal_of_a_slanted_plane_is_exact() {
        let i = Intrinsics { fx: 100.0, fy: 120.0, cx: 8.0, cy: 6.0 };
        let camera = Camera::pinhole(16, 12, i, Pose::IDENTITY).unwrap();
        let n = Vec3::new(0.3, -0.4, -0.8).normalize();
        let depth = (0..16 * 12)
            .map(|k| {
                // n . p = -5
                (-5.0 / n.dot(i.pixel_ray(k % 16, k / 16).as_vec3())).max(0.0)
            })
            .collect();
        let depth = DepthMap::new(16, 12, depth).unwrap();
        for found in normals(&camera, &depth) {
            assert!(found.dot(n) > 0.999_99, "{found}");
        }
    }
}
