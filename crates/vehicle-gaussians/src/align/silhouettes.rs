//! Comparison of the scan with the masks: its outline in every picture must run along the mask's edge.
//!
//! The coarse comparison uses support functions (the extent of mask and scan in a direction of the picture): it ignores
//! concavities but works from any start. The fine one runs along the mask's edge (the outermost projected point
//! next to each piece of edge): it resolves bonnets and windscreens but needs a close start.

use super::WorldView;
use super::scan::Scan;
use super::solve::{Numbers, System, slope};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use vg_geometry::{Intrinsics, Pose, Similarity};
use vg_scene::Mask;
use vg_scene::mask::Label;

/// The number of directions of the support functions.
const DIRECTIONS: usize = 32;

/// Step between the pieces of edge that are used: neighbours are redundant.
const EDGE_STRIDE: usize = 3;

/// Half the side of the window from which an edge's direction is estimated, pixels.
const NORMAL_WINDOW: i64 = 4;

/// Largest distance of a point from a piece of edge, along the edge, pixels.
const BESIDE_PX: f64 = 1.5;

/// Side of a cell of projected points, pixels.
const CELL: f64 = 4.0;

/// The scan's surface continues beyond its outermost point: on average by the gap to the next point where points end
/// abruptly (an edge), by half of it where they are dense (a rounded outline). Without this, scans are placed 0.15 %
/// too small.
const GAP_SHARE: f64 = 0.75;

/// Maximum gap between points, pixels; wider ones are holes in the scan.
const WIDEST_GAP_PX: f64 = 2.0;

/// Maximum width of a gap in an open structure such as a ladder or a rack, pixels: beyond an edge at a gap, the
/// outermost point belongs to another rung.
const OPEN_PX: i32 = 14;

/// Minimum share of open edges; below it, all edges are compared.
const LEAST_OPEN: f64 = 0.1;

/// Nearest depth at which a point is projected, metres.
const NEAR_M: f64 = 0.05;

/// One picture's outline.
pub(super) struct Outline {
    world_from_camera: Pose,
    intrinsics: Intrinsics,
    width: usize,
    height: usize,
    labels: Vec<Label>,
    /// Directions and the mask's extent in them, except where the picture cuts the mask.
    support: Vec<(DVec2, f64)>,
    /// Pieces of edge: middle and outward unit normal.
    edges: Vec<(DVec2, DVec2)>,
    /// Whether each edge is open: no vehicle within [`OPEN_PX`] beyond it.
    open: Vec<bool>,
}

impl Outline {
    /// The outline of a mask of an undistorted view.
    pub(super) fn new(view: &WorldView, mask: &Mask) -> Self {
        let mut outline = Self {
            world_from_camera: view.world_from_camera(),
            intrinsics: view.0.camera.intrinsics,
            width: mask.width() as usize,
            height: mask.height() as usize,
            labels: mask.labels().to_vec(),
            support: Vec::new(),
            edges: Vec::new(),
            open: Vec::new(),
        };
        outline.find_edges();
        outline.find_support();
        outline
    }

    fn label(&self, u: i64, v: i64) -> Label {
        // Pixels beyond the picture are unknown.
        if u < 0 || v < 0 || u >= self.width as i64 || v >= self.height as i64 {
            return Label::Unknown;
        }
        self.labels[v as usize * self.width + u as usize]
    }

    /// Finds the pieces of edge, each between a vehicle pixel and a background neighbour.
    fn find_edges(&mut self) {
        let mut edges = Vec::new();
        for v in 0..self.height as i64 {
            for u in 0..self.width as i64 {
                if self.label(u, v) != Label::Vehicle {
                    continue;
                }
                for (du, dv) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                    if self.label(u + du, v + dv) != Label::Background {
                        continue;
                    }
                    let middle =
                        DVec2::new(u as f64 + 0.5 + 0.5 * du as f64, v as f64 + 0.5 + 0.5 * dv as f64);
                    edges.extend(self.normal(u, v).map(|n| (middle, n)));
                }
            }
        }
        self.edges = edges.into_iter().step_by(EDGE_STRIDE).collect();
        self.open = self.edges.iter().map(|edge| self.is_open(edge)).collect();
    }

    fn is_open(&self, &(middle, normal): &(DVec2, DVec2)) -> bool {
        // The first two pixels may belong to the rough edge itself.
        (2..=OPEN_PX).all(|step| {
            let pixel = middle + f64::from(step) * normal;
            self.label(pixel.x.floor() as i64, pixel.y.floor() as i64) != Label::Vehicle
        })
    }

    /// Direction away from the vehicle pixels around; `None` near unknown pixels or the picture's border, and for
    /// specks.
    fn normal(&self, u: i64, v: i64) -> Option<DVec2> {
        let mut sum = DVec2::ZERO;
        for dv in -NORMAL_WINDOW..=NORMAL_WINDOW {
            for du in -NORMAL_WINDOW..=NORMAL_WINDOW {
                match self.label(u + du, v + dv) {
                    Label::Vehicle => sum -= DVec2::new(du as f64, dv as f64),
                    Label::Background => {}
                    Label::Unknown => return None,
                }
            }
        }
        (sum.length() > 20.0).then(|| sum.normalize())
    }

    fn find_support(&mut self) {
        let mut rim = Vec::new();
        for v in 0..self.height as i64 {
            for u in 0..self.width as i64 {
                let around = [(1, 0), (-1, 0), (0, 1), (0, -1)].map(|(du, dv)| self.label(u + du, v + dv));
                if self.label(u, v) == Label::Vehicle && around.iter().any(|l| *l != Label::Vehicle) {
                    rim.push((DVec2::new(u as f64 + 0.5, v as f64 + 0.5), around.contains(&Label::Unknown)));
                }
            }
        }
        for k in 0..DIRECTIONS {
            let (s, c) = (std::f64::consts::TAU * k as f64 / DIRECTIONS as f64).sin_cos();
            let direction = DVec2::new(c, s);
            let reach = |p: &DVec2| p.dot(direction);
            let farthest = rim.iter().copied().reduce(|a, b| if reach(&b.0) > reach(&a.0) { b } else { a });
            if let Some((pixel, false)) = farthest {
                // The edge is half a pixel beyond the last centre inside.
                self.support.push((direction, reach(&pixel) + 0.5));
            }
        }
    }

    /// The camera's position and the direction through the middle of the mask, world.
    pub(super) fn central_ray(&self) -> Option<(DVec3, DVec3)> {
        let middle = self.edges.iter().map(|e| e.0).sum::<DVec2>() / self.edges.len() as f64;
        let [x, y] = self.intrinsics.normalized_from_pixel(middle.to_array());
        let direction = self.world_from_camera.rotation * DVec3::new(x, y, 1.0).normalize();
        direction.is_finite().then_some((self.world_from_camera.translation, direction))
    }

    /// Half the mean width of the mask, over the directions in which the picture does not cut it, as the tangent of an
    /// angle.
    pub(super) fn angular_radius(&self) -> Option<f64> {
        let opposite = |d: DVec2| self.support.iter().find(|s| s.0.dot(d) < -0.999).map(|s| s.1);
        let widths: Vec<f64> = self.support.iter().filter_map(|&(d, h)| Some(h + opposite(d)?)).collect();
        let mean = widths.iter().sum::<f64>() / widths.len() as f64;
        (mean > 0.0).then(|| 0.5 * mean / self.intrinsics.smaller_focal())
    }

    /// The camera's pose in the world.
    pub(super) fn pose(&self) -> &Pose {
        &self.world_from_camera
    }

    /// The number of pieces of edge.
    pub(super) fn edge_count(&self) -> usize {
        self.edges.len()
    }

    /// Whether a point of the world projects to a vehicle pixel; `None` if the label is unknown.
    pub(super) fn shows_vehicle(&self, world: DVec3) -> Option<bool> {
        let p = self.world_from_camera.inverse().transform_point(world);
        if p.z <= 0.0 {
            return None;
        }
        let [u, v] = self.intrinsics.pixel_from_normalized([p.x / p.z, p.y / p.z]);
        if !(u.abs() < 1e6 && v.abs() < 1e6) {
            return None;
        }
        match self.label(u.floor() as i64, v.floor() as i64) {
            Label::Unknown => None,
            label => Some(label == Label::Vehicle),
        }
    }

    fn pixel(&self, p: DVec3) -> Option<DVec2> {
        (p.z > NEAR_M)
            .then(|| DVec2::from_array(self.intrinsics.pixel_from_normalized([p.x / p.z, p.y / p.z])))
    }

    /// Derivatives of the pixel of `point` along `direction` with respect to the seven parameters. The similarity moves
    /// the cameras; relative to them the point moves the opposite way.
    fn pixel_slope(&self, point: DVec3, pose: &Pose, center: DVec3, direction: DVec2) -> Numbers {
        let p = pose.rotation.transpose() * (point - pose.translation);
        let (fx, fy) = (self.intrinsics.fx * direction.x, self.intrinsics.fy * direction.y);
        let along = DVec3::new(fx / p.z, fy / p.z, -(fx * p.x + fy * p.y) / (p.z * p.z));
        -slope(point, center, pose.rotation * along)
    }

    /// Differences of the support functions of scan and mask, pixels.
    fn coarse(&self, scan: &Scan, s: &Similarity, bend: f64) -> System {
        let mut system = System::new();
        let pose = s.transform_pose(&self.world_from_camera);
        let camera_from_vehicle = pose.inverse();
        let pixels: Vec<Option<DVec2>> =
            scan.corners.iter().map(|p| self.pixel(camera_from_vehicle.transform_point(*p))).collect();
        if pixels.iter().any(Option::is_none) {
            // The camera is inside the vehicle or looks away from it.
            system.add_constant(1e6 * self.support.len() as f64);
            return system;
        }
        for &(direction, reach) in &self.support {
            let mut farthest = (f64::NEG_INFINITY, 0);
            for (i, pixel) in pixels.iter().enumerate() {
                let here = pixel.map_or(f64::NEG_INFINITY, |p| p.dot(direction));
                if here > farthest.0 {
                    farthest = (here, i);
                }
            }
            let slope = self.pixel_slope(scan.corners[farthest.1], &pose, scan.center, direction);
            system.add(farthest.0 - reach, &slope, 1.0, bend);
        }
        system
    }

    /// The scan's outline at each piece of edge; `None` if no point is within `reach` pixels.
    fn misses(&self, points: &[DVec3], pose: &Pose, reach: f64) -> Vec<Option<Miss>> {
        let camera_from_vehicle = pose.inverse();
        let cells = Cells::new(self, points.iter().map(|p| camera_from_vehicle.transform_point(*p)));
        let outermost = |&(middle, normal): &(DVec2, DVec2)| {
            let along = normal.perp();
            let mut last = [(f64::NEG_INFINITY, 0); 2];
            cells.around(middle, reach + BESIDE_PX, |pixel, index| {
                let d = pixel - middle;
                let out = d.dot(normal);
                if d.dot(along).abs() <= BESIDE_PX && out.abs() <= reach && out > last[1].0 {
                    last[1] = (out, index);
                    if out > last[0].0 {
                        last.swap(0, 1);
                    }
                }
            });
            let [(out, index), (before, _)] = last;
            let gap = if before.is_finite() { (out - before).min(WIDEST_GAP_PX) } else { 0.0 };
            out.is_finite().then(|| Miss {
                out: out + GAP_SHARE * gap,
                index,
                distance: camera_from_vehicle.transform_point(points[index]).z,
            })
        };
        self.edges.iter().map(outermost).collect()
    }

    /// Distances between the outlines of scan and mask, pixels.
    fn fine(&self, points: &[DVec3], s: &Similarity, center: DVec3, reach: f64, bend: f64) -> System {
        let mut system = System::new();
        let pose = s.transform_pose(&self.world_from_camera);
        for (miss, edge) in self.misses(points, &pose, reach).into_iter().zip(&self.edges) {
            match miss {
                Some(miss) => {
                    let slope = self.pixel_slope(points[miss.index], &pose, center, edge.1);
                    system.add(miss.out, &slope, 1.0, bend);
                }
                None => system.add_constant(bend * (reach - 0.5 * bend)),
            }
        }
        system
    }
}

/// The scan's outline at a piece of edge.
struct Miss {
    /// Distance of the outline outside the mask's edge, pixels.
    out: f64,
    /// Index of the outermost point.
    index: usize,
    /// Depth of the outermost point, metres.
    distance: f64,
}

/// Projected points by cells of the picture, as one linked list per cell.
struct Cells {
    columns: usize,
    rows: usize,
    first: Vec<u32>,
    /// Pixel, index of the point, and position of the next entry of the cell.
    seen: Vec<(DVec2, u32, u32)>,
}

impl Cells {
    fn new(outline: &Outline, points_camera: impl Iterator<Item = DVec3>) -> Self {
        let (width, height) = (outline.width as f64, outline.height as f64);
        let (columns, rows) = ((width / CELL) as usize + 1, (height / CELL) as usize + 1);
        let mut cells = Self { columns, rows, first: vec![u32::MAX; columns * rows], seen: Vec::new() };
        for (point, index) in points_camera.zip(0u32..) {
            let Some(pixel) = outline.pixel(point) else { continue };
            if pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < width && pixel.y < height {
                let first = &mut cells.first[(pixel.y / CELL) as usize * columns + (pixel.x / CELL) as usize];
                cells.seen.push((pixel, index, *first));
                *first = cells.seen.len() as u32 - 1;
            }
        }
        cells
    }

    /// Visits all points in the cells that the square around `middle` with half side `reach` touches.
    fn around(&self, middle: DVec2, reach: f64, mut visit: impl FnMut(DVec2, usize)) {
        let range = |x: f64, n: usize| {
            let low = ((x - reach) / CELL).max(0.0) as usize;
            low..=(((x + reach) / CELL).max(0.0) as usize).min(n - 1)
        };
        for row in range(middle.y, self.rows) {
            for column in range(middle.x, self.columns) {
                let mut at = self.first[row * self.columns + column];
                while let Some(&(pixel, index, next)) = self.seen.get(at as usize) {
                    visit(pixel, index as usize);
                    at = next;
                }
            }
        }
    }
}

/// Sum of [`Outline::coarse`] over all pictures.
pub(super) fn coarse(outlines: &[&Outline], scan: &Scan, s: &Similarity, bend: f64) -> System {
    System::sum(outlines.par_iter().map(|o| o.coarse(scan, s, bend)).collect::<Vec<_>>())
}

/// Sum of [`Outline::fine`] over all pictures.
pub(super) fn fine(
    outlines: &[Outline],
    points: &[DVec3],
    s: &Similarity,
    center: DVec3,
    reach: f64,
    bend: f64,
) -> System {
    let fine = |o: &Outline| o.fine(points, s, center, reach, bend);
    System::sum(outlines.par_iter().map(fine).collect::<Vec<_>>())
}

/// Distance between the outlines of scan and mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Misses {
    /// Mean over all pieces of edge, pixels; a piece without a point counts as the reach.
    pub(super) mean_px: f64,
    /// Mean over the open pieces, which can be compared for any structure, pixels.
    pub(super) open_px: f64,
    /// Median, metres at the point's distance; infinite if most pieces have no point.
    pub(super) median_m: f64,
}

/// Measures the distance between the outlines with points up to `reach` pixels from the edge.
pub(super) fn misses(outlines: &[Outline], points: &[DVec3], s: &Similarity, reach: f64) -> Misses {
    let sizes_in = |o: &Outline| {
        let found = o.misses(points, &s.transform_pose(&o.world_from_camera), reach);
        let focal = o.intrinsics.smaller_focal();
        let far = (reach, f64::INFINITY);
        let sizes = |m: Option<Miss>| m.map_or(far, |m| (m.out.abs(), m.out.abs() * m.distance / focal));
        let sizes = |(m, open): (Option<Miss>, &bool)| {
            let (pixels, metres) = sizes(m);
            (pixels, metres, *open)
        };
        found.into_iter().zip(&o.open).map(sizes).collect::<Vec<_>>()
    };
    let all: Vec<(f64, f64, bool)> =
        outlines.par_iter().map(sizes_in).collect::<Vec<_>>().into_iter().flatten().collect();
    let metres: Vec<f64> = all.iter().map(|m| m.1).collect();
    let mean = |chosen: &dyn Fn(bool) -> bool| {
        let chosen = all.iter().filter(|m| chosen(m.2)).map(|m| m.0);
        let (sum, n) = chosen.fold((0.0, 0usize), |(sum, n), m| (sum + m, n + 1));
        (sum / n.max(1) as f64, n)
    };
    let ((mean_px, n), (open_px, open)) = (mean(&|_| true), mean(&|open| open));
    let open_px = if open as f64 >= LEAST_OPEN * n as f64 { open_px } else { mean_px };
    Misses { mean_px, open_px, median_m: super::scan::median(&metres) }
}
