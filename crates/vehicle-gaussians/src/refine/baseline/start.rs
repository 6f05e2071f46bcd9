//! The first Gaussians of 3DGS: points of a cloud if the scene has one, else points drawn from a box.

use super::super::chance::{Rng, shuffled};
use super::BaselineOptions;
use super::spacing::spacing;
use crate::prior::WorkingBox;
use crate::prior::volume::{KnownBox, Silhouette, find_box};
use glam::DVec3;
use rayon::prelude::*;
use vg_geometry::{Error, Result};
use vg_scene::{Cloud, View};
use vg_splat::Gaussians;
use vg_splat::gaussians::buffer::Gaussian;

/// First opacity.
const OPACITY: f32 = 0.1;

/// Bounds of the first standard deviations, metres: the original's floor, and the largest that is optimised.
const SCALE_M: [f32; 2] = [3.2e-4, 3.0];

/// Streams of random draws, distinct from those of rounds and steps.
const START: u64 = u64::MAX;

/// The first Gaussians and their source.
#[derive(Debug)]
pub(crate) struct Start {
    pub(crate) gaussians: Gaussians,
    /// The box that was filled, without a cloud.
    pub(crate) filled: Option<WorkingBox>,
    /// Points of the cloud that are in no picture.
    pub(crate) strays: usize,
}

impl Start {
    /// Starts from the cloud's points that are in some picture, else from points in the box that bounds the silhouettes,
    /// which has the vehicle's size if that is known.
    pub(crate) fn new(
        views: &[View],
        cloud: Option<&Cloud>,
        known_box: Option<&KnownBox>,
        options: &BaselineOptions,
    ) -> Result<Self> {
        for (i, view) in views.iter().enumerate() {
            if view.mask.is_none() {
                let argument = format!("{}.mask", view.argument(i));
                let allowed = "a mask with the vehicle: the baseline is fitted to the masked photograph";
                return Err(Error::argument(argument, "none", allowed));
            }
        }
        let Some(cloud) = cloud else {
            let silhouettes: Vec<Silhouette> = views.par_iter().map(Silhouette::new).collect();
            let filled = find_box(known_box, views, &silhouettes)?;
            let points = drawn(&filled, options);
            return Ok(Self { gaussians: made(&points, options), filled: Some(filled), strays: 0 });
        };
        let all = cloud.points();
        let is_seen = |p: &&[f32; 3]| views.iter().any(|view| is_in_picture(view, **p));
        let seen: Vec<[f32; 3]> = all.par_iter().filter(is_seen).copied().collect();
        if seen.is_empty() {
            return Err(Error::argument("cloud", "no point in any picture", "points on the vehicle"));
        }
        let order = shuffled(seen.len(), options.seed, START);
        let points: Vec<[f32; 3]> = order.into_iter().take(options.points).map(|i| seen[i]).collect();
        Ok(Self { gaussians: made(&points, options), filled: None, strays: all.len() - seen.len() })
    }
}

/// The original's extent: 1.1 times the distance from the cameras' mean to the farthest of them, metres. For cameras in
/// one place, their distance from the Gaussians.
pub(crate) fn extent_m(views: &[View], gaussians: &Gaussians) -> f32 {
    let centers: Vec<DVec3> = views.iter().map(|v| v.camera.center()).collect();
    let farthest = |from: DVec3| centers.iter().map(|c| (*c - from).length()).fold(0.0, f64::max);
    let across = farthest(centers.iter().sum::<DVec3>() / centers.len().max(1) as f64);
    let means = gaussians.means().iter().map(|m| DVec3::from_array(m.map(f64::from)));
    let middle = means.sum::<DVec3>() / gaussians.len().max(1) as f64;
    let extent = if across > 1e-3 { 1.1 * across } else { farthest(middle) };
    extent.clamp(1e-3, 1e3) as f32
}

fn is_in_picture(view: &View, point: [f32; 3]) -> bool {
    let camera = &view.camera;
    let p = camera.vehicle_from_camera.inverse().transform_point(DVec3::from_array(point.map(f64::from)));
    let size = [camera.width, camera.height].map(f64::from);
    let is_inside = |pixel: [f64; 2]| (0..2).all(|k| (0.0..=size[k]).contains(&pixel[k]));
    p.z > 0.0 && camera.project(p).is_some_and(is_inside)
}

/// Draws points evenly over a box.
fn drawn(of: &WorkingBox, options: &BaselineOptions) -> Vec<[f32; 3]> {
    let point = |i: usize| {
        let mut rng = Rng::new([options.seed, START, i as u64]);
        std::array::from_fn(|k| (of.low[k] + rng.uniform() * (of.high[k] - of.low[k])) as f32)
    };
    (0..options.points).map(point).collect()
}

/// Makes balls as large as the distance between their points, almost grey: the original begins like this without colours.
fn made(points: &[[f32; 3]], options: &BaselineOptions) -> Gaussians {
    let mut gaussians = Gaussians::with_capacity(options.sh_degree, points.len());
    for (i, (mean, spacing)) in points.iter().zip(spacing(points)).enumerate() {
        let mut rng = Rng::new([options.seed, START - 1, i as u64]);
        gaussians.push(&Gaussian {
            mean: *mean,
            rotation: [1.0, 0.0, 0.0, 0.0],
            scale: [spacing.clamp(SCALE_M[0], SCALE_M[1]); 3],
            opacity: OPACITY,
            sh0: [(); 3].map(|()| rng.uniform() as f32 / 255.0),
        });
    }
    gaussians
}
