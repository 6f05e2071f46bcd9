//! Preparation of the scan: removes stray points, smooths noise, and finds a normal for every point and the points that
//! can be outermost in a picture.

use glam::{DVec3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;
use vg_geometry::nearest::Nearest;
use vg_geometry::robust::scramble;
use vg_geometry::{Error, Result};
use vg_scene::Cloud;

/// Maximum of points; a random sample is drawn from a larger scan.
const MOST_POINTS: usize = 60_000;

/// Minimum of points on the surface.
const FEWEST_POINTS: usize = 200;

/// The number of neighbours that define a point's plane: two or three spacings wide, within which a body panel is flat.
const NEIGHBOURS: usize = 12;

/// Distance of a stray point's neighbours over the median distance.
const ALONE: f64 = 3.0;

/// Distance of a stray point from its neighbours' plane, over the median distance and over the neighbours' own.
const OFF: f64 = 6.0;

/// Distance of neighbours from their own plane, over the median, from which they lie across an edge. Their plane would
/// cut the edge off, and outlines consist of edges.
const ACROSS_EDGE: f64 = 1.5;

/// Allowed sizes of a vehicle, metres: the longest side of the scan's box.
const SIZES_M: std::ops::RangeInclusive<f64> = 1.0..=25.0;

/// The number of directions in which the outermost points are searched for.
const DIRECTIONS: usize = 1000;

/// A scan of a vehicle in the vehicle's frame, metres.
pub(super) struct Scan {
    pub(super) points: Vec<DVec3>,
    /// Unit normals of either sign.
    pub(super) normals: Vec<DVec3>,
    pub(super) tree: Nearest,
    /// Middle of the bounding box.
    pub(super) center: DVec3,
    /// Approximate corners of the convex hull, the only points that can be outermost in a picture.
    pub(super) corners: Vec<DVec3>,
}

impl Scan {
    pub(super) fn new(cloud: &Cloud) -> Result<Self> {
        // Scanners write in rows: after a shuffle, any part of the points shows the whole vehicle.
        let mut shuffled: Vec<usize> = (0..cloud.points().len()).collect();
        shuffled.sort_by_key(|&i| scramble(i as u64));
        shuffled.truncate(MOST_POINTS);
        let all: Vec<DVec3> =
            shuffled.into_iter().map(|i| Vec3::from_array(cloud.points()[i]).as_dvec3()).collect();
        let dense = without_isolated(&all);
        let (points, normals) = smoothed(&dense);
        if points.len() < FEWEST_POINTS {
            let found = format!("{} points, of which {} lie on a surface", all.len(), points.len());
            return Err(Error::argument("scan", found, format!("at least {FEWEST_POINTS} on a surface")));
        }
        let low = points.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
        let high = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
        let size = high - low;
        if !SIZES_M.contains(&size.max_element()) {
            return Err(Error::argument(
                "scan",
                format!("a box of {:.3} x {:.3} x {:.3}", size.x, size.y, size.z),
                format!("a vehicle in metres, {} to {} m long", SIZES_M.start(), SIZES_M.end()),
            ));
        }
        let corners = corners(&points);
        let tree = Nearest::new(points.iter().copied());
        Ok(Self { points, normals, tree, center: 0.5 * (low + high), corners })
    }
}

fn without_isolated(points: &[DVec3]) -> Vec<DVec3> {
    let tree = Nearest::new(points.iter().copied());
    let reach = |p: &DVec3| tree.k_nearest(*p, NEIGHBOURS / 2).last().map_or(0.0, |n| n.squared.sqrt());
    let reaches: Vec<f64> = points.par_iter().map(reach).collect();
    let limit = ALONE * median(&reaches);
    points.iter().zip(&reaches).filter(|(_, r)| **r <= limit).map(|(p, _)| *p).collect()
}

/// Points moved to the plane of their neighbours where that is flat, with the plane's normal; points far from it are
/// dropped.
fn smoothed(points: &[DVec3]) -> (Vec<DVec3>, Vec<DVec3>) {
    let tree = Nearest::new(points.iter().copied());
    let plane = |p: &DVec3| {
        let around: Vec<DVec3> = tree.k_nearest(*p, NEIGHBOURS).iter().map(|n| points[n.index]).collect();
        let others = &around[1.min(around.len())..];
        let (middle, normal) = plane_of(others);
        let squares: f64 = others.iter().map(|q| normal.dot(*q - middle).powi(2)).sum();
        Plane { normal, off: normal.dot(*p - middle), thickness: (squares / others.len() as f64).sqrt() }
    };
    let planes: Vec<Plane> = points.par_iter().map(plane).collect();
    let usual = |of: fn(&Plane) -> f64| median(&planes.iter().map(of).collect::<Vec<f64>>());
    let (off, thickness) = (usual(|p| p.off.abs()), usual(|p| p.thickness));
    let is_of_surface =
        |plane: &Plane| plane.off.abs() <= OFF * off.max(plane.thickness) + 1e-6 && plane.normal.is_finite();
    let kept = points.iter().zip(&planes).filter(|(_, plane)| is_of_surface(plane));
    let settled = |(p, plane): (&DVec3, &Plane)| {
        // The point itself is one of the samples of the surface.
        let share = (NEIGHBOURS - 1) as f64 / NEIGHBOURS as f64;
        let is_flat = plane.thickness <= ACROSS_EDGE * thickness + 1e-6;
        (if is_flat { *p - share * plane.off * plane.normal } else { *p }, plane.normal)
    };
    kept.map(settled).unzip()
}

/// The plane of a point's neighbours.
struct Plane {
    normal: DVec3,
    /// Signed distance of the point from the plane.
    off: f64,
    /// Root mean square distance of the neighbours from the plane.
    thickness: f64,
}

/// Middle and unit normal of the plane through points.
pub(super) fn plane_of(points: &[DVec3]) -> (DVec3, DVec3) {
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let mut spread = Matrix3::zeros();
    for p in points {
        let d = *p - middle;
        spread += Matrix3::from_fn(|row, column| d[row] * d[column]);
    }
    (middle, smallest_axis(spread))
}

/// Eigenvector of a symmetric matrix's smallest eigenvalue.
pub(super) fn smallest_axis(matrix: Matrix3<f64>) -> DVec3 {
    let eigen = SymmetricEigen::new(matrix);
    let k = eigen.eigenvalues.imin();
    DVec3::new(eigen.eigenvectors[(0, k)], eigen.eigenvectors[(1, k)], eigen.eigenvectors[(2, k)])
}

/// The outermost points in directions spread evenly (a Fibonacci sphere).
fn corners(points: &[DVec3]) -> Vec<DVec3> {
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    let outermost = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / DIRECTIONS as f64;
        let (s, c) = (golden * k as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        let d = DVec3::new(r * c, r * s, z);
        let farthest = |a: usize, b: usize| if points[b].dot(d) > points[a].dot(d) { b } else { a };
        (0..points.len()).reduce(farthest).unwrap_or(0)
    };
    let mut indices: Vec<usize> = (0..DIRECTIONS).into_par_iter().map(outermost).collect();
    indices.sort_unstable();
    indices.dedup();
    indices.into_iter().map(|i| points[i]).collect()
}

/// Median; 0 for an empty slice.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    match values.len() {
        0 => 0.0,
        _ => *values.select_nth_unstable_by(middle, f64::total_cmp).1,
    }
}
