//! A scalar field on a regular grid, symmetric about y = 0, sampled trilinearly.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Limit to which values are clamped, metres: beyond it only the sign matters.
const CLAMP_M: f32 = 1.0;

/// Distance of each grid point inside the hull, metres, negative outside.
#[derive(Clone)]
pub(crate) struct Field {
    low: Vec3,
    voxel: f32,
    /// Points along x, y, z.
    size: [usize; 3],
    /// x fastest. `[nz][ny][nx]`
    values: Vec<f32>,
}

impl Field {
    /// Evaluates `inside` at the points of a grid of spacing `voxel` over the box `low..high`, which is
    /// symmetric in y, and at their mirror points, keeping the smaller value (the mirrored twins carve too).
    pub(crate) fn carve(low: DVec3, high: DVec3, voxel: f64, inside: impl Fn(Vec3) -> f32 + Sync) -> Self {
        let mut field = Self::empty(low, high, voxel);
        let [nx, ny, _] = field.size;
        let (low, voxel) = (field.low, field.voxel);
        field.values.par_chunks_mut(nx * ny).enumerate().for_each(|(k, slab)| {
            for (j, row) in slab.chunks_exact_mut(nx).enumerate() {
                for (i, value) in row.iter_mut().enumerate() {
                    let p = low + voxel * Vec3::new(i as f32, j as f32, k as f32);
                    *value = inside(p).clamp(-CLAMP_M, CLAMP_M);
                }
            }
            // The twin of column j is column ny - 1 - j.
            for j in 0..ny / 2 {
                for i in 0..nx {
                    let (a, b) = (j * nx + i, (ny - 1 - j) * nx + i);
                    let both = slab[a].min(slab[b]);
                    (slab[a], slab[b]) = (both, both);
                }
            }
        });
        field
    }

    /// Evaluates `inside`, which is its own mirror image, at the points of the same grid.
    pub(crate) fn symmetric(
        low: DVec3,
        high: DVec3,
        voxel: f64,
        inside: impl Fn(Vec3) -> f32 + Sync,
    ) -> Self {
        let mut field = Self::empty(low, high, voxel);
        field.adjust(|p, _| inside(p).clamp(-CLAMP_M, CLAMP_M));
        field
    }

    /// Zero everywhere, on the grid of [`Field::carve`].
    fn empty(low: DVec3, high: DVec3, voxel: f64) -> Self {
        let size: [usize; 3] = std::array::from_fn(|k| ((high[k] - low[k]) / voxel).ceil() as usize + 1);
        let half_width = 0.5 * (size[1] - 1) as f64 * voxel;
        let low = Vec3::new(low.x as f32, -half_width as f32, low.z as f32);
        Self { low, voxel: voxel as f32, size, values: vec![0.0; size.iter().product()] }
    }

    /// Replaces every value by the mean over the cube that reaches `radius` metres (rounded to grid points) to
    /// either side, cut at the border of the grid.
    pub(crate) fn smooth(&mut self, radius: f32) {
        let reach = (radius / self.voxel).round() as usize;
        let [nx, ny, nz] = self.size;
        // A mean over a cube is a mean along each axis in turn.
        for (stride, n) in [(1, nx), (nx, ny), (nx * ny, nz)] {
            let before = self.values.clone();
            self.values.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
                for (i, value) in values.iter_mut().enumerate() {
                    let index = row * nx + i;
                    let position = index / stride % n;
                    let (first, last) = (position.saturating_sub(reach), (position + reach).min(n - 1));
                    let start = index - position * stride;
                    let sum: f32 = (first..=last).map(|k| before[start + k * stride]).sum();
                    *value = sum / (last - first + 1) as f32;
                }
            });
        }
    }

    /// Replaces every value by `new(point, value)`, a function that is even in y. It is evaluated at y >= 0 only, so
    /// that a field that is its own mirror image remains so to the bit.
    pub(crate) fn adjust(&mut self, new: impl Fn(Vec3, f32) -> f32 + Sync) {
        let ([nx, ny, _], low, voxel) = (self.size, self.low, self.voxel);
        self.values.par_chunks_mut(nx * ny).enumerate().for_each(|(k, slab)| {
            for j in 0..ny.div_ceil(2) {
                for i in 0..nx {
                    let p = low + voxel * Vec3::new(i as f32, j as f32, k as f32);
                    let p = Vec3::new(p.x, p.y.abs(), p.z);
                    let (a, b) = (j * nx + i, (ny - 1 - j) * nx + i);
                    let one = new(p, slab[a]);
                    // Equal values on both sides stay equal, for half the work.
                    let other = if slab[b] == slab[a] { one } else { new(p, slab[b]) };
                    (slab[a], slab[b]) = (one, other);
                }
            }
        });
    }

    /// The values, x fastest. `[nz][ny][nx]`
    #[cfg(test)]
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Points along x, y, z.
    #[cfg(test)]
    pub(crate) fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Grid spacing, metres.
    pub(crate) fn voxel(&self) -> f32 {
        self.voxel
    }

    /// Both ends of the zero surface along each axis, interpolated, and the grid points that reach farthest:
    /// `[axis][low, high]`; `None` if no point is inside.
    pub(crate) fn surface_ends(&self) -> Option<[[(f32, Vec3); 2]; 3]> {
        let [nx, ny, nz] = self.size;
        let strides = [1, nx, nx * ny];
        // The largest value of each slice and where it is.
        let mut slices = self.size.map(|n| vec![(f32::NEG_INFINITY, 0usize); n]);
        for (index, &value) in self.values.iter().enumerate() {
            for (axis, slices) in slices.iter_mut().enumerate() {
                let slice = &mut slices[index / strides[axis] % [nx, ny, nz][axis]];
                if value > slice.0 {
                    *slice = (value, index);
                }
            }
        }
        let point = |index: usize| {
            self.low
                + self.voxel
                    * Vec3::new((index % nx) as f32, (index / nx % ny) as f32, (index / (nx * ny)) as f32)
        };
        let end = |axis: usize, from: usize, outward: isize| {
            let (inside, index) = slices[axis][from];
            let beyond = from.checked_add_signed(outward).and_then(|k| slices[axis].get(k));
            // At the border of the grid the surface ends at the grid point.
            let way = beyond.map_or(0.0, |(outside, _)| inside / (inside - outside).max(1e-6));
            let at = point(index);
            (at[axis] + outward as f32 * way * self.voxel, at)
        };
        let mut ends = [[(0.0, Vec3::ZERO); 2]; 3];
        for (axis, ends) in ends.iter_mut().enumerate() {
            let first = slices[axis].iter().position(|(value, _)| *value > 0.0)?;
            let last = slices[axis].iter().rposition(|(value, _)| *value > 0.0)?;
            *ends = [end(axis, first, -1), end(axis, last, 1)];
        }
        Some(ends)
    }

    /// Lowest and highest grid point.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        let extent = Vec3::from_array(self.size.map(|n| (n - 1) as f32)) * self.voxel;
        (self.low, self.low + extent)
    }

    /// Trilinear interpolation, clamped to the grid.
    pub(crate) fn sample(&self, p: Vec3) -> f32 {
        let [nx, ny, nz] = self.size;
        let g = ((p - self.low) / self.voxel)
            .clamp(Vec3::ZERO, Vec3::new((nx - 1) as f32, (ny - 1) as f32, (nz - 1) as f32));
        let cell = |v: f32, n: usize| (v as usize).min(n.saturating_sub(2));
        let (i, j, k) = (cell(g.x, nx), cell(g.y, ny), cell(g.z, nz));
        let (fx, fy, fz) = (g.x - i as f32, g.y - j as f32, g.z - k as f32);
        let (sx, sy, sz) =
            (usize::from(nx > 1), if ny > 1 { nx } else { 0 }, if nz > 1 { nx * ny } else { 0 });
        let base = (k * ny + j) * nx + i;
        let v = &self.values;
        let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let x0 = lerp(v[base], v[base + sx], fx);
        let x1 = lerp(v[base + sy], v[base + sy + sx], fx);
        let x2 = lerp(v[base + sz], v[base + sz + sx], fx);
        let x3 = lerp(v[base + sz + sy], v[base + sz + sy + sx], fx);
        lerp(lerp(x0, x1, fy), lerp(x2, x3, fy), fz)
    }

    /// Lowest and highest grid point whose value exceeds `level`, or `None` if there is none.
    pub(crate) fn bounds_above(&self, level: f32) -> Option<(DVec3, DVec3)> {
        let [nx, ny, _] = self.size;
        let mut bounds: Option<([usize; 3], [usize; 3])> = None;
        for (index, _) in self.values.iter().enumerate().filter(|(_, v)| **v > level) {
            let ijk = [index % nx, index / nx % ny, index / (nx * ny)];
            let (low, high) = bounds.get_or_insert((ijk, ijk));
            for axis in 0..3 {
                low[axis] = low[axis].min(ijk[axis]);
                high[axis] = high[axis].max(ijk[axis]);
            }
        }
        let point =
            |ijk: [usize; 3]| (self.low + self.voxel * Vec3::from_array(ijk.map(|v| v as f32))).as_dvec3();
        bounds.map(|(low, high)| (point(low), point(high)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_ball_are_its_radius_from_its_middle() {
        let middle = Vec3::new(0.1, 0.0, -0.05);
        let ball = Field::carve(DVec3::splat(-0.7), DVec3::splat(0.7), 0.03, |p| 0.413 - p.distance(middle));
        let ends = ball.surface_ends().unwrap();
        for axis in 0..3 {
            let [(low, _), (high, _)] = ends[axis];
            assert!(
                (low - (middle[axis] - 0.413)).abs() < 2e-3 && (high - (middle[axis] + 0.413)).abs() < 2e-3
            );
        }
        assert!(Field::carve(DVec3::splat(-0.5), DVec3::splat(0.5), 0.1, |_| -1.0).surface_ends().is_none());
    }

    fn wedge() -> Field {
        // Inside where x < 0 and z < 0: a crease along y.
        Field::carve(DVec3::splat(-0.5), DVec3::splat(0.5), 0.02, |p| (-p.x).min(-p.z))
    }

    #[test]
    fn smoothing_leaves_flat_faces_and_rounds_creases() {
        let mut field = wedge();
        field.smooth(0.06);
        let face = field.sample(Vec3::new(-0.003, 0.0, -0.3));
        assert!((face - 0.003).abs() < 1e-4, "{face}");
        assert!(field.sample(Vec3::new(-0.005, 0.0, -0.005)) < 0.0);
    }

    #[test]
    fn the_field_is_its_own_mirror_image() {
        let field = Field::carve(DVec3::splat(-0.5), DVec3::splat(0.5), 0.05, |p| p.y + 0.2);
        for y in [0.0, 0.13, 0.4] {
            let (left, right) = (field.sample(Vec3::new(0.1, y, 0.1)), field.sample(Vec3::new(0.1, -y, 0.1)));
            assert!((left - right).abs() < 1e-6 && (right - (0.2 - y)).abs() < 1e-3, "{left} {right}");
        }
    }
}
