//! Deforms a field smoothly until it has given values at scattered points.
//!
//! Given pulls (a point, the value the field should have there), finds the correction d, trilinear on a lattice
//! and even in y, that minimises
//!
//! ```text
//! sum_i w_i rho((t_i - F(p_i) - d(p_i)) / c) + stiffness sum_edges (d_a - d_b)^2 + fade sum_nodes d_a^2
//! ```
//!
//! and adds it to the field. rho is the Cauchy loss, minimised by iteratively reweighted least squares, each solved by
//! conjugate gradients. A membrane held at a few points in space only dimples around them, so the lattice is refined
//! from coarse to fine, and every level fits the residual of the coarser ones: far from the pulls the correction fades
//! at the coarsest spacing, and detail remains where there are enough pulls to determine it. Multilevel approximation
//! of scattered data goes back to Lee, Wolberg and Shin (1997).
//!
//! Sums run in a fixed order on one thread: the systems are small, and the result is the same on any machine.

use super::field::Field;
use glam::Vec3;
use std::collections::HashSet;

/// Reweightings at each level: weights change little after the third.
const REWEIGHTINGS: usize = 3;

/// Maximum of conjugate gradient steps; coarser levels leave only short wavelengths to each level.
const MOST_STEPS: usize = 30;

/// Residual of the normal equations at which a solve ends, relative to its start.
const SOLVED: f64 = 1e-3;

/// Distance from a pull, in cells, up to which a level changes nodes: beyond, its change has faded.
const REACH: usize = 2;

/// Maximum of nodes of a lattice: for boxes much larger than a vehicle (hostile input) the finest levels are left out.
const MOST_NODES: usize = 400_000;

/// The value that the field should have at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pull {
    /// Vehicle frame, metres; its mirror image is pulled as well.
    pub(crate) point: Vec3,
    /// The target value, metres inside.
    pub(crate) target: f32,
    /// Whether the target is exact or a lower bound.
    pub(crate) kind: PullKind,
    /// Weight against the other pulls, about 1.
    pub(crate) weight: f32,
}

/// Meaning of a [`Pull`]'s target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PullKind {
    /// The surface is here.
    Exact,
    /// The vehicle reaches at least this far.
    AtLeast,
}

/// Weights and scales of [`relax`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Relaxation {
    /// Node spacing of the first level, metres, halved from level to level.
    pub(crate) coarsest: f32,
    /// No level is finer than this, metres.
    pub(crate) finest: f32,
    /// A level is left out, and all finer ones, where occupied cells hold fewer exact pulls than this on
    /// average.
    pub(crate) pulls_per_cell: f32,
    /// Residuals well beyond this count as outliers, metres. A level whose residuals are mostly larger uses
    /// their own spread: before the first correction all pulls look like outliers.
    pub(crate) scale: f32,
    /// Weight of a difference between neighbouring nodes.
    pub(crate) stiffness: f64,
    /// Weight that holds the correction at zero.
    pub(crate) fade: f64,
}

/// How much too thin a hull of silhouettes can be, metres: masks and poses are not exact.
pub(crate) const HULL_SLACK_M: f32 = 0.02;

/// Upper bound for raised values of a field.
#[derive(Clone, Copy)]
pub(crate) struct Ceiling<'a> {
    /// The field that contains the vehicle.
    pub(crate) hull: &'a Field,
    /// Tolerance above the hull, metres.
    pub(crate) slack: f32,
}

/// Deforms `field` towards `pulls`; without any, the field is unchanged. A value above the ceiling is not raised
/// further.
pub(crate) fn relax(field: &mut Field, ceiling: Option<Ceiling>, pulls: &[Pull], how: &Relaxation) {
    let Some(correction) = solve(field, pulls, how) else { return };
    field.adjust(|p, before| {
        let change = correction.sample(p);
        match ceiling {
            Some(c) if change > 0.0 => (before + change).min((c.hull.sample(p) + c.slack).max(before)),
            _ => before + change,
        }
    });
}

/// The correction; `None` if no pull is active.
fn solve(field: &Field, pulls: &[Pull], how: &Relaxation) -> Option<Lattice> {
    // Residual of each pull.
    let mut lack: Vec<f64> = pulls.iter().map(|p| f64::from(p.target - field.sample(p.point))).collect();
    if !pulls.iter().zip(&lack).any(|(pull, lack)| pull.is_active(*lack)) {
        return None;
    }
    let (low, high) = field.bounds();
    let mut correction = Lattice::over(low, high, how.coarsest);
    let mut spacing = how.coarsest;
    loop {
        let mut rows: Vec<Row> = pulls.iter().map(|p| correction.row(p.point)).collect();
        let mesh = Mesh::around(&mut rows, correction.size);
        let change = level(&mesh, &rows, pulls, &lack, how);
        for (row, lack) in rows.iter().zip(&mut lack) {
            *lack -= row.interpolate(&change);
        }
        mesh.nodes.iter().zip(&change).for_each(|(node, change)| correction.values[*node as usize] += change);
        spacing *= 0.5;
        let finer = correction.size.map(|n| 2 * n).iter().product::<usize>();
        let too_fine = spacing < 0.99 * how.finest || finer > MOST_NODES;
        if too_fine || pulls_per_cell(pulls, spacing) < how.pulls_per_cell {
            return Some(correction);
        }
        correction = correction.refined();
    }
}

impl Pull {
    fn is_active(&self, lack: f64) -> bool {
        self.kind == PullKind::Exact || lack > 0.0
    }
}

/// The change of the mesh's values that fits the residuals `lack` best.
fn level(mesh: &Mesh, rows: &[Row], pulls: &[Pull], lack: &[f64], how: &Relaxation) -> Vec<f64> {
    let mut change = vec![0.0; mesh.nodes.len()];
    let mut weights = vec![0.0; rows.len()];
    for _ in 0..REWEIGHTINGS {
        let left: Vec<f64> =
            rows.iter().zip(lack).map(|(row, lack)| lack - row.interpolate(&change)).collect();
        let scale = f64::from(how.scale).max(spread(pulls, &left));
        for ((weight, pull), left) in weights.iter_mut().zip(pulls).zip(&left) {
            *weight = match pull.is_active(*left) {
                true => f64::from(pull.weight) / (1.0 + (left / scale).powi(2)),
                false => 0.0,
            };
        }
        System { mesh, rows, weights: &weights, how }.solve(lack, &mut change);
    }
    change
}

/// Standard deviation of the residuals of active pulls, estimated from their median, which outliers do not affect.
fn spread(pulls: &[Pull], left: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = pulls
        .iter()
        .zip(left)
        .filter(|(pull, left)| pull.is_active(**left))
        .map(|(_, left)| left.abs())
        .collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Exact pulls in cells of this size, on average over the cells that hold any.
fn pulls_per_cell(pulls: &[Pull], size: f32) -> f32 {
    let exact = || pulls.iter().filter(|p| p.kind == PullKind::Exact);
    let cell = |p: &Pull| (Vec3::new(p.point.x, p.point.y.abs(), p.point.z) / size).floor().as_ivec3();
    let occupied: HashSet<_> = exact().map(cell).collect();
    exact().count() as f32 / occupied.len().max(1) as f32
}

/// The nodes of a lattice near the pulls; all others keep their value.
struct Mesh {
    /// Indices in the lattice, ascending.
    nodes: Vec<u32>,
    /// Pairs of neighbours, as positions in `nodes`.
    edges: Vec<[u32; 2]>,
    /// The number of each node's neighbours that keep their value.
    held: Vec<f64>,
}

impl Mesh {
    /// The mesh of all nodes up to [`REACH`] cells from those of `rows`, whose nodes become positions in the mesh.
    fn around(rows: &mut [Row], size: [usize; 3]) -> Self {
        const OUT: u32 = u32::MAX;
        let [nx, ny, nz] = size;
        let mut near = vec![false; nx * ny * nz];
        rows.iter().flat_map(|row| row.nodes).for_each(|node| near[node as usize] = true);
        let axes = [(1, nx), (nx, ny), (nx * ny, nz)];
        for (stride, n) in axes {
            let before = near.clone();
            for a in (0..near.len()).filter(|&a| before[a]) {
                let position = a / stride % n;
                let (back, on) = (position.min(REACH), (n - 1 - position).min(REACH));
                (a - back * stride..=a + on * stride).step_by(stride).for_each(|b| near[b] = true);
            }
        }
        let nodes: Vec<u32> = (0..near.len() as u32).filter(|&a| near[a as usize]).collect();
        let mut place = vec![OUT; near.len()];
        nodes.iter().enumerate().for_each(|(i, a)| place[*a as usize] = i as u32);
        rows.iter_mut().flat_map(|row| &mut row.nodes).for_each(|node| *node = place[*node as usize]);

        let mut edges = Vec::with_capacity(3 * nodes.len());
        let mut held = vec![0.0; nodes.len()];
        for (i, &a) in nodes.iter().enumerate() {
            let a = a as usize;
            for (stride, n) in axes {
                let position = a / stride % n;
                if position + 1 < n {
                    match place[a + stride] {
                        OUT => held[i] += 1.0,
                        b => edges.push([i as u32, b]),
                    }
                }
                if position > 0 && place[a - stride] == OUT {
                    held[i] += 1.0;
                }
            }
        }
        Self { nodes, edges, held }
    }
}

/// The normal equations of one reweighting.
struct System<'a> {
    mesh: &'a Mesh,
    rows: &'a [Row],
    weights: &'a [f64],
    how: &'a Relaxation,
}

impl System<'_> {
    /// Conjugate gradients from the initial `x`, preconditioned by the diagonal.
    fn solve(&self, lack: &[f64], x: &mut [f64]) {
        let mut residual = vec![0.0; x.len()];
        for ((row, weight), lack) in self.rows.iter().zip(self.weights).zip(lack) {
            row.add(weight * lack, &mut residual);
        }
        let goal = SOLVED * SOLVED * dot(&residual, &residual);
        let mut product = vec![0.0; x.len()];
        self.apply(x, &mut product);
        residual.iter_mut().zip(&product).for_each(|(r, p)| *r -= p);
        let diagonal = self.diagonal();
        let mut scaled: Vec<f64> = residual.iter().zip(&diagonal).map(|(r, d)| r / d).collect();
        let mut direction = scaled.clone();
        let mut energy = dot(&residual, &scaled);
        for _ in 0..MOST_STEPS {
            if dot(&residual, &residual) <= goal {
                break;
            }
            self.apply(&direction, &mut product);
            let step = energy / dot(&direction, &product);
            for i in 0..x.len() {
                x[i] += step * direction[i];
                residual[i] -= step * product[i];
                scaled[i] = residual[i] / diagonal[i];
            }
            let next = dot(&residual, &scaled);
            let keep = next / energy;
            direction.iter_mut().zip(&scaled).for_each(|(d, s)| *d = s + keep * *d);
            energy = next;
        }
    }

    /// `out = (J^T W J + stiffness L + fade) x`.
    fn apply(&self, x: &[f64], out: &mut [f64]) {
        let Relaxation { stiffness, fade, .. } = *self.how;
        for ((out, x), held) in out.iter_mut().zip(x).zip(&self.mesh.held) {
            *out = (fade + stiffness * held) * x;
        }
        for &[a, b] in &self.mesh.edges {
            let slope = stiffness * (x[b as usize] - x[a as usize]);
            out[a as usize] -= slope;
            out[b as usize] += slope;
        }
        for (row, weight) in self.rows.iter().zip(self.weights) {
            row.add(weight * row.interpolate(x), out);
        }
    }

    /// The matrix's diagonal.
    fn diagonal(&self) -> Vec<f64> {
        let Relaxation { stiffness, fade, .. } = *self.how;
        let mut out: Vec<f64> = self.mesh.held.iter().map(|held| fade + stiffness * held).collect();
        self.mesh.edges.iter().flatten().for_each(|node| out[*node as usize] += stiffness);
        for (row, weight) in self.rows.iter().zip(self.weights) {
            for (node, share) in row.nodes.iter().zip(row.shares) {
                out[*node as usize] += weight * share * share;
            }
        }
        out
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The eight nodes around a point, of the lattice or of a mesh, and their interpolation weights.
struct Row {
    nodes: [u32; 8],
    shares: [f64; 8],
}

impl Row {
    fn interpolate(&self, values: &[f64]) -> f64 {
        (0..8).map(|k| self.shares[k] * values[self.nodes[k] as usize]).sum()
    }

    fn add(&self, amount: f64, out: &mut [f64]) {
        (0..8).for_each(|k| out[self.nodes[k] as usize] += self.shares[k] * amount);
    }
}

/// Values at the nodes of one half space, y >= 0; the other half is their mirror image.
struct Lattice {
    low: Vec3,
    spacing: f32,
    /// Nodes along x, y, z, at least two each.
    size: [usize; 3],
    /// x fastest. `[nz][ny][nx]`
    values: Vec<f64>,
}

impl Lattice {
    fn over(low: Vec3, high: Vec3, spacing: f32) -> Self {
        let low = Vec3::new(low.x, 0.0, low.z);
        let cells = ((high - low) / spacing).to_array();
        let size = cells.map(|c| c.ceil().max(1.0) as usize + 1);
        Self { low, spacing, size, values: vec![0.0; size.iter().product()] }
    }

    /// This function on a lattice of half the spacing.
    fn refined(&self) -> Self {
        let mut finer = Self {
            low: self.low,
            spacing: 0.5 * self.spacing,
            size: self.size.map(|n| 2 * n - 1),
            values: Vec::new(),
        };
        let [nx, ny, nz] = finer.size;
        finer.values.reserve(nx * ny * nz);
        let [mx, my, _] = self.size;
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    // An odd node lies between two nodes of the coarser lattice, along each axis.
                    let mut sum = 0.0;
                    for corner in 0..8 {
                        let at = |n: usize, bit: usize| n / 2 + (n % 2) * (corner >> bit & 1);
                        sum += self.values[(at(k, 2) * my + at(j, 1)) * mx + at(i, 0)];
                    }
                    finer.values.push(sum / 8.0);
                }
            }
        }
        finer
    }

    /// The cell of `p` or of its mirror image, and the position in it, clamped to the lattice.
    fn cell(&self, p: Vec3) -> (usize, Vec3) {
        let p = Vec3::new(p.x, p.y.abs(), p.z);
        let last = Vec3::from_array(self.size.map(|n| (n - 1) as f32));
        let g = ((p - self.low) / self.spacing).clamp(Vec3::ZERO, last);
        let [i, j, k]: [usize; 3] = std::array::from_fn(|axis| (g[axis] as usize).min(self.size[axis] - 2));
        let base = (k * self.size[1] + j) * self.size[0] + i;
        (base, g - Vec3::new(i as f32, j as f32, k as f32))
    }

    fn corner(&self, base: usize, corner: usize) -> usize {
        let [nx, ny, _] = self.size;
        base + (corner & 1) + (corner >> 1 & 1) * nx + (corner >> 2 & 1) * nx * ny
    }

    fn row(&self, p: Vec3) -> Row {
        let (base, f) = self.cell(p);
        let f = f.as_dvec3().to_array();
        let share = |corner: usize| {
            (0..3).map(|axis| if corner >> axis & 1 == 1 { f[axis] } else { 1.0 - f[axis] }).product()
        };
        Row {
            nodes: std::array::from_fn(|c| self.corner(base, c) as u32),
            shares: std::array::from_fn(share),
        }
    }

    fn sample(&self, p: Vec3) -> f32 {
        let (base, f) = self.cell(p);
        let v: [f32; 8] = std::array::from_fn(|c| self.values[self.corner(base, c)] as f32);
        let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let x = [lerp(v[0], v[1], f.x), lerp(v[2], v[3], f.x), lerp(v[4], v[5], f.x), lerp(v[6], v[7], f.x)];
        lerp(lerp(x[0], x[1], f.y), lerp(x[2], x[3], f.y), f.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use vg_geometry::progress::Threads;

    /// Half the size of the true box, metres.
    const TRUE: Vec3 = Vec3::new(1.0, 0.6, 0.5);

    const HOW: Relaxation = Relaxation {
        coarsest: 0.64,
        finest: 0.08,
        pulls_per_cell: 2.0,
        scale: 0.03,
        stiffness: 0.3,
        fade: 0.02,
    };

    /// A box that is `by` metres larger than the true one on all sides.
    fn fat(by: f32) -> Field {
        Field::carve(DVec3::new(-1.5, -1.1, -1.0), DVec3::new(1.5, 1.1, 1.0), 0.04, |p| {
            (TRUE + by - p.abs()).min_element()
        })
    }

    fn random(i: usize) -> f32 {
        (i as f32 * 12.9898).sin().mul_add(43_758.547, 0.0).rem_euclid(1.0)
    }

    /// Pulls on the true right face, y = -0.6, but every `wrong`-th anywhere in the fat box.
    fn face(count: usize, wrong: usize) -> Vec<Pull> {
        let pull = |i: usize| {
            let r = Vec3::new(random(3 * i), random(3 * i + 1), random(3 * i + 2)) * 2.0 - 1.0;
            let point = match i.is_multiple_of(wrong) {
                true => r * (TRUE + 0.2),
                false => Vec3::new(r.x * TRUE.x, -TRUE.y, r.z * TRUE.z),
            };
            Pull { point, target: 0.0, kind: PullKind::Exact, weight: 1.0 }
        };
        (0..count).map(pull).collect()
    }

    /// Distance of the field's surface from the true face, metres: median and maximum over places well inside the face.
    fn error(field: &Field, side: f32) -> (f32, f32) {
        let surface = |x: f32, z: f32| {
            let inside = |k: &usize| field.sample(Vec3::new(x, side * (1.0 - 0.001 * *k as f32), z)) >= 0.0;
            1.0 - 0.001 * (0..1000).find(inside).unwrap() as f32
        };
        let places = (-8..=8).flat_map(|i| (-4..=4).map(move |k| (0.1 * i as f32, 0.1 * k as f32)));
        let mut errors: Vec<f32> = places.map(|(x, z)| (surface(x, z) - TRUE.y).abs()).collect();
        errors.sort_by(f32::total_cmp);
        (errors[errors.len() / 2], errors[errors.len() - 1])
    }

    #[test]
    fn a_box_too_fat_moves_onto_its_points_on_both_sides() {
        for (wrong, allowed) in [(usize::MAX, 0.02), (10, 0.04)] {
            let mut field = fat(0.2);
            assert!(error(&field, -1.0).0 > 0.19);
            relax(&mut field, None, &face(1500, wrong), &HOW);
            let (median, worst) = error(&field, -1.0);
            assert!(median < 0.02 && worst < allowed, "one in {wrong} wrong: {median} {worst}");
            assert_eq!(error(&field, 1.0), (median, worst));
        }
    }

    #[test]
    fn the_mirror_image_is_kept_to_the_bit_with_any_number_of_threads() {
        let made = |threads: usize| {
            Threads::new(threads).unwrap().run(|| {
                let mut field = fat(0.2);
                relax(&mut field, None, &face(300, 10), &HOW);
                field
            })
        };
        let (one, two) = (made(1), made(2));
        assert!(one.values().iter().zip(two.values()).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert!(one.values() != fat(0.2).values());
        let [nx, ny, _] = one.size();
        for (i, value) in one.values().iter().enumerate() {
            let (x, y, rest) = (i % nx, i / nx % ny, i / (nx * ny));
            let twin = one.values()[(rest * ny + ny - 1 - y) * nx + x];
            assert_eq!(value.to_bits(), twin.to_bits());
        }
    }

    #[test]
    fn without_active_pulls_the_field_is_unchanged() {
        let inactive = Pull { point: Vec3::ZERO, target: 0.0, kind: PullKind::AtLeast, weight: 1.0 };
        for pulls in [vec![], vec![inactive]] {
            let mut field = fat(0.2);
            relax(&mut field, None, &pulls, &HOW);
            assert_eq!(field.values(), fat(0.2).values());
        }
    }

    #[test]
    fn nothing_is_raised_above_the_ceiling() {
        let (mut field, hull) = (fat(0.0), fat(0.05));
        let far = |i: usize| Pull {
            point: Vec3::new(0.02 * i as f32 - 0.5, -0.8, 0.0),
            target: 0.0,
            kind: PullKind::AtLeast,
            weight: 1.0,
        };
        let pulls: Vec<Pull> = (0..50).map(far).collect();
        relax(&mut field, Some(Ceiling { hull: &hull, slack: 0.01 }), &pulls, &HOW);
        assert!(field.values().iter().zip(hull.values()).all(|(f, h)| *f <= h + 0.0101));
        let face = field.sample(Vec3::new(0.0, -0.655, 0.0));
        assert!(face > 0.0, "not raised to the ceiling: {face}");
    }

    #[test]
    fn hostile_pulls_give_finite_fields() {
        let pull = |x: f32| Pull { point: Vec3::splat(x), target: 0.0, kind: PullKind::Exact, weight: 1.0 };
        for pulls in [vec![pull(1e30)], vec![pull(-1e30); 7], vec![pull(0.3); 10_000]] {
            let mut field = fat(0.2);
            relax(&mut field, None, &pulls, &HOW);
            assert!(field.values().iter().all(|v| v.is_finite()));
        }
    }
}
