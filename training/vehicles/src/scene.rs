//! A photographed vehicle: views as input of the library, and their true values.

use crate::cameras::{self, HEIGHT, WIDTH};
use crate::grid::Grid;
use crate::noise::Noise;
use glam::Vec3;
use rand::Rng;
use vg::View;
use vg::scene::{DepthMap, Mask, RgbImage};

/// Views with noise in their masks and poses; `View::depth` is true. `None` if some view shows too little of the
/// vehicle.
pub fn draw(grid: &Grid, rng: &mut impl Rng) -> Option<Vec<View>> {
    let low = Vec3::new(grid.low_inside.x, -grid.high_inside.y, grid.low_inside.z).as_dvec3();
    let high = grid.high_inside.as_dvec3();
    let cameras = cameras::draw(high - low, 0.5 * (low + high), rng);
    let noise = Noise::draw(rng);
    let image = RgbImage::new(WIDTH, HEIGHT, vec![[128; 3]; (WIDTH * HEIGHT) as usize]).expect("of its size");
    let mut views = Vec::new();
    for camera in &cameras {
        let depth = grid.depth(camera);
        let mask = noise.mask(&depth, rng);
        if mask.iter().filter(|m| **m > 0).count() < 400 {
            return None;
        }
        views.push(View {
            name: String::new(),
            camera: noise.noisy_camera(camera, rng),
            image: image.clone(),
            mask: Some(
                Mask::from_strided("mask", &mask, WIDTH, HEIGHT, WIDTH as usize).expect("of its size"),
            ),
            depth: Some(DepthMap::new(WIDTH, HEIGHT, depth).expect("of its size")),
        });
    }
    Some(views)
}
