//! A picture of vehicles of every class, shaded by the slope of their depth.

use crate::cameras::looking_at;
use crate::grid::Grid;
use crate::vehicle::{self, CLASSES};
use glam::DVec3;
use image::{GrayImage, Luma};
use std::path::Path;
use vg::geometry::Camera;

const SIZE: (u32, u32) = (240, 150);
const PER_CLASS: u32 = 6;

pub fn draw(seed: u64, output: &Path) -> std::io::Result<()> {
    let mut picture = GrayImage::from_pixel(SIZE.0 * PER_CLASS, SIZE.1 * CLASSES.len() as u32, Luma([255]));
    for (row, (class, _)) in CLASSES.iter().enumerate() {
        for column in 0..PER_CLASS {
            let mut rng = crate::random(seed, row * 100 + column as usize);
            let vehicle = vehicle::draw_class(*class, &mut rng);
            let grid = Grid::from_vehicle(&vehicle, 0.025);
            let camera = camera(&grid, 40.0 + 20.0 * f64::from(column));
            let depth = grid.depth(&camera);
            for (x, y, shade) in shades(&camera, &depth) {
                picture.put_pixel(column * SIZE.0 + x, row as u32 * SIZE.1 + y, Luma([shade]));
            }
        }
    }
    picture.save(output).map_err(std::io::Error::other)
}

/// A camera at `azimuth` degrees, a little above.
fn camera(grid: &Grid, azimuth: f64) -> Camera {
    let middle = 0.5 * (grid.low_inside + grid.high_inside).as_dvec3() * DVec3::new(1.0, 0.0, 1.0);
    let size = f64::from(grid.high_inside.x - grid.low_inside.x);
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let center = middle + size * DVec3::new(2.2 * cos, 2.2 * sin, 0.35);
    looking_at(middle, center, 0.0, 1.75 * f64::from(SIZE.0), SIZE)
}

/// Light from the upper left.
fn shades(camera: &Camera, depth: &[f32]) -> Vec<(u32, u32, u8)> {
    let (w, h) = (camera.width, camera.height);
    let at = |x: u32, y: u32| depth[(y * w + x) as usize];
    let f = camera.intrinsics.fx as f32;
    let mut out = Vec::new();
    for y in 1..h - 1 {
        for x in 1..w - 1 {
            let z = at(x, y);
            if z <= 0.0 {
                continue;
            }
            let slope = |a: f32, b: f32| if a > 0.0 && b > 0.0 { (a - b) * f / (2.0 * z) } else { 0.0 };
            let n =
                glam::Vec3::new(slope(at(x + 1, y), at(x - 1, y)), slope(at(x, y + 1), at(x, y - 1)), -1.0)
                    .normalize();
            let light = n.dot(glam::Vec3::new(-0.4, -0.6, -0.7).normalize()).max(0.0);
            out.push((x, y, (40.0 + 190.0 * light) as u8));
        }
    }
    out
}
