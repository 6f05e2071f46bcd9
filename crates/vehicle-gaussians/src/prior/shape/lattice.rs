//! Input of the shape network: the hull on a coarse lattice over one half of the vehicle, and a few numbers about
//! the views.
//!
//! The lattice is stretched to the vehicle's box, so that a bonnet, a roof and wheels lie at about the same nodes
//! for all vehicles; one half is enough because the hull is its own mirror image.

use super::super::WorkingBox;
use crate::prior::volume::{Silhouette, inside_both};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use vg_scene::View;

/// Nodes along x, |y| and z.
pub const NODES: [usize; 3] = [96, 16, 32];

/// Nodes beyond the box at either end of x, beyond |y|, and at either end of z: mirrors stick out of the box, and
/// the box may be a little small.
const MARGIN: [f64; 3] = [3.0, 3.0, 3.0];

/// Hull values are clamped to this, metres: farther from the surface only the sign matters.
pub const HULL_CLAMP_M: f32 = 0.5;

/// The number of values that describe the box and the views, see [`view_numbers`].
pub const VIEW_NUMBERS: usize = 11;

/// A lattice in the vehicle frame; its first |y| is half a step from the plane of symmetry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The node with the lowest x, |y| and z, metres.
    pub low: Vec3,
    /// Spacing along x, |y|, z, metres.
    pub step: Vec3,
}

impl Lattice {
    /// The lattice over a box and a margin around it.
    pub fn around(working_box: &WorkingBox) -> Self {
        let size = working_box.size();
        let inner = |axis: usize, margins: f64| NODES[axis] as f64 - margins * MARGIN[axis] - 1.0;
        let step_x = size[0] / inner(0, 2.0);
        let step_y = 0.5 * size[1] / (inner(1, 1.0) + 0.5);
        let step_z = size[2] / inner(2, 2.0);
        let low = DVec3::new(
            working_box.low[0] - MARGIN[0] * step_x,
            0.5 * step_y,
            working_box.low[2] - MARGIN[2] * step_z,
        );
        Self { low: low.as_vec3(), step: DVec3::new(step_x, step_y, step_z).as_vec3() }
    }

    /// Node (i, j, k) on the left half, vehicle frame.
    pub fn node(&self, i: usize, j: usize, k: usize) -> Vec3 {
        self.low + self.step * Vec3::new(i as f32, j as f32, k as f32)
    }

    /// Trilinear interpolation of `values` at `p` (either half), clamped to the lattice. `[16][32][96]`
    pub fn sample(&self, values: &[f32], p: Vec3) -> f32 {
        let [nx, ny, nz] = NODES;
        let last = Vec3::new((nx - 1) as f32, (ny - 1) as f32, (nz - 1) as f32);
        // Between the plane and the first node the value is constant.
        let g = ((Vec3::new(p.x, p.y.abs(), p.z) - self.low) / self.step).clamp(Vec3::ZERO, last);
        let (i, j, k) = ((g.x as usize).min(nx - 2), (g.y as usize).min(ny - 2), (g.z as usize).min(nz - 2));
        let f = g - Vec3::new(i as f32, j as f32, k as f32);
        let base = (j * nz + k) * nx + i;
        let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let along_x = |at: usize| lerp(values[at], values[at + 1], f.x);
        let along_z = |at: usize| lerp(along_x(at), along_x(at + nx), f.z);
        lerp(along_z(base), along_z(base + nx * nz), f.y)
    }
}

/// The hull of the silhouettes and their mirrored twins on the nodes: distance inside all cones, metres, negative
/// outside. `[16][32][96]`
pub fn hull_on(lattice: &Lattice, silhouettes: &[Silhouette]) -> Vec<f32> {
    let [nx, ny, nz] = NODES;
    let mut values = vec![0.0f32; nx * ny * nz];
    values.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
        for (i, value) in values.iter_mut().enumerate() {
            let p = lattice.node(i, row / nz, row % nz);
            *value = inside_both(silhouettes, p).clamp(-HULL_CLAMP_M, HULL_CLAMP_M);
        }
    });
    values
}

/// Description of the box and the cameras for the network, each value about 0 to 1: size of the box, number of views,
/// spread of the views around the vehicle, their elevation and their distance.
pub fn view_numbers(working_box: &WorkingBox, views: &[View]) -> [f32; VIEW_NUMBERS] {
    /// Directions, degrees from the front, and the angular distance at which a view still counts for a direction.
    const SECTORS_DEGREES: [f64; 5] = [0.0, 45.0, 90.0, 135.0, 180.0];
    const SECTOR_WIDTH_DEGREES: f64 = 25.0;
    let size = working_box.size();
    let middle: DVec3 = 0.5 * (DVec3::from_array(working_box.low) + DVec3::from_array(working_box.high));
    let n = views.len() as f64;
    let mut numbers = [0.0f64; VIEW_NUMBERS];
    numbers[0] = size[0] / 8.0;
    numbers[1] = size[1] / 2.5;
    numbers[2] = size[2] / 3.0;
    numbers[3] = (n / 8.0).min(1.0);
    for view in views {
        let offset = view.camera.center() - middle;
        let (across, distance) = (offset.x.hypot(offset.y), offset.length());
        let azimuth = offset.y.abs().atan2(offset.x).to_degrees();
        for (number, sector) in numbers[4..9].iter_mut().zip(SECTORS_DEGREES) {
            *number += (-((azimuth - sector) / SECTOR_WIDTH_DEGREES).powi(2)).exp();
        }
        numbers[9] += offset.z.atan2(across) / n;
        numbers[10] += (5.0 / distance.max(1.0)).min(1.0) / n;
    }
    for number in &mut numbers[4..9] {
        *number = 1.0 - (-*number).exp();
    }
    numbers.map(|v| v as f32)
}
