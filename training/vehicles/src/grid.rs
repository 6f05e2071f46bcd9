//! A vehicle sampled on a grid, and its views from cameras.

use crate::vehicle::Vehicle;
use glam::Vec3;
use vg::geometry::Camera;

/// Nodes along each side of the blocks that are tested as one.
const BLOCK: usize = 4;

/// Half a vehicle as values on nodes, positive inside.
pub struct Grid {
    low: Vec3,
    step: f32,
    nodes: [usize; 3],
    /// x fastest, then |y|, then z.
    values: Vec<f32>,
    /// Corners of the part that is not empty.
    pub low_inside: Vec3,
    pub high_inside: Vec3,
}

impl Grid {
    /// Samples a vehicle with about `finest` metres between nodes, more for long vehicles.
    pub fn from_vehicle(vehicle: &Vehicle, finest: f32) -> Self {
        let extent = vehicle.high - vehicle.low;
        let step = finest.max(extent.x / 220.0);
        let nodes = [extent.x, extent.y, extent.z].map(|e| (e / step).ceil() as usize + 1);
        let low = Vec3::new(vehicle.low.x, 0.0, vehicle.low.z);
        let node = |i: usize, j: usize, k: usize| low + step * Vec3::new(i as f32, j as f32, k as f32);
        let mut values = vec![0.0f32; nodes.iter().product()];
        let mut low_inside = Vec3::splat(f32::INFINITY);
        let mut high_inside = Vec3::splat(f32::NEG_INFINITY);
        let blocks = nodes.map(|n| n.div_ceil(BLOCK));
        for block in 0..blocks.iter().product() {
            let first = [block % blocks[0], block / blocks[0] % blocks[1], block / (blocks[0] * blocks[1])]
                .map(|b| b * BLOCK);
            let middle = node(first[0], first[1], first[2]) + 0.5 * step * (BLOCK - 1) as f32;
            // The function changes by at most about twice the distance: far from the surface one value is enough.
            let f_middle = vehicle.inside(middle);
            let far = f_middle.abs() > 2.0 * step * BLOCK as f32;
            for k in first[2]..(first[2] + BLOCK).min(nodes[2]) {
                for j in first[1]..(first[1] + BLOCK).min(nodes[1]) {
                    for i in first[0]..(first[0] + BLOCK).min(nodes[0]) {
                        let p = node(i, j, k);
                        let f = if far { f_middle } else { vehicle.inside(p) };
                        if f > 0.0 {
                            low_inside = low_inside.min(p);
                            high_inside = high_inside.max(p);
                        }
                        values[(k * nodes[1] + j) * nodes[0] + i] = f.clamp(-0.5, 0.5);
                    }
                }
            }
        }
        Self { low, step, nodes, values, low_inside, high_inside }
    }

    /// Distance of `p` inside the vehicle, metres: the function over its slope, which near the surface is the
    /// distance.
    pub fn distance(&self, p: Vec3) -> f32 {
        let f = self.sample(p);
        if f.abs() >= 0.4 {
            return f;
        }
        let h = self.step;
        let slope = |axis: Vec3| (self.sample(p + h * axis) - self.sample(p - h * axis)) / (2.0 * h);
        f / Vec3::new(slope(Vec3::X), slope(Vec3::Y), slope(Vec3::Z)).length().clamp(0.4, 4.0)
    }

    fn sample(&self, p: Vec3) -> f32 {
        let [nx, ny, nz] = self.nodes;
        let last = Vec3::new((nx - 1) as f32, (ny - 1) as f32, (nz - 1) as f32);
        let g = ((Vec3::new(p.x, p.y.abs(), p.z) - self.low) / self.step).clamp(Vec3::ZERO, last);
        let (i, j, k) = ((g.x as usize).min(nx - 2), (g.y as usize).min(ny - 2), (g.z as usize).min(nz - 2));
        let f = g - Vec3::new(i as f32, j as f32, k as f32);
        let v = &self.values;
        let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let along_x = |at: usize| lerp(v[at], v[at + 1], f.x);
        let along_y = |at: usize| lerp(along_x(at), along_x(at + nx), f.y);
        let base = (k * ny + j) * nx + i;
        lerp(along_y(base), along_y(base + nx * ny), f.z)
    }

    /// Planar depth from `camera`, metres, 0 where the ray misses. `[height * width]`
    pub fn depth(&self, camera: &Camera) -> Vec<f32> {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let mut depth = vec![0.0; width * height];
        let origin = camera.center().as_vec3();
        let rotation = camera.vehicle_from_camera.rotation.as_mat3();
        let high = Vec3::new(self.high_inside.x, self.high_inside.y, self.high_inside.z) + self.step;
        let low = Vec3::new(self.low_inside.x, -self.high_inside.y, self.low_inside.z) - self.step;
        for v in 0..height {
            for u in 0..width {
                let [x, y] = camera.intrinsics.normalized_from_pixel([u as f64 + 0.5, v as f64 + 0.5]);
                let direction = rotation * Vec3::new(x as f32, y as f32, 1.0);
                depth[v * width + u] = self.first_hit(origin, direction, low, high);
            }
        }
        depth
    }

    fn first_hit(&self, origin: Vec3, direction: Vec3, low: Vec3, high: Vec3) -> f32 {
        let (a, b) = ((low - origin) / direction, (high - origin) / direction);
        let enter = a.min(b).max_element().max(0.05);
        let leave = a.max(b).min_element();
        let length = direction.length();
        let (mut z, mut before) = (enter, enter);
        while z < leave {
            let f = self.sample(origin + z * direction);
            if f >= 0.0 {
                let (mut outside, mut inside) = (before, z);
                for _ in 0..5 {
                    let middle = 0.5 * (outside + inside);
                    if self.sample(origin + middle * direction) < 0.0 {
                        outside = middle
                    } else {
                        inside = middle
                    }
                }
                return 0.5 * (outside + inside);
            }
            before = z;
            // The function is a distance only roughly, so steps are short.
            z += (-0.7 * f).clamp(0.5 * self.step, 8.0 * self.step) / length;
        }
        0.0
    }
}
