//! Registration of one object of unknown size, position and heading to a scan; photographs distinguish front and back.
//!
//! A similarity with scale is fitted from four headings, each by trimmed ICP on pairs in both directions: pairs from
//! the object to the scan alone would be shortest for an object that has shrunk into the scan.

use crate::metrics::{on_white, psnr};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use vg_geometry::nearest::Nearest;
use vg_geometry::{Error, Result, Similarity};
use vg_scene::{Cloud, View};
use vg_splat::Gaussians;
use vg_splat::render::{CpuRenderer, RenderOptions, Renderer};

/// The up axis of the object's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// z.
    Z,
    /// -y, as in PLY files of TRELLIS: (x, y, z) is (x, -z, y) in the file.
    MinusY,
}

/// An object in the vehicle's frame.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Gaussians in the vehicle's frame, metres.
    pub gaussians: Gaussians,
    /// Similarity from the object's own frame.
    pub vehicle_from_object: Similarity,
    /// Mean distance of the pairs that were used, metres.
    pub residual_m: f64,
}

/// The number of headings tried.
const HEADINGS: u32 = 4;

/// Minimum opacity of Gaussians that represent the surface.
const FAINTEST: f32 = 0.1;

/// Maximum of points on either side.
const MOST_POINTS: usize = 6000;

/// Share of the nearest pairs that is used in each direction: stray points, the underside and interiors have no
/// partner.
const KEPT_SHARE: f64 = 0.8;

const STEPS: usize = 80;

/// Ratio to the best residual up to which the photographs decide between headings.
const NEARLY: f64 = 1.5;

/// Share of points that is ignored at each end of each axis when extents are measured.
const STRAYS: f64 = 0.02;

/// Fits `object` to `scan`, which is in the vehicle's frame, metres; `views` distinguish front and back.
///
/// # Errors
/// Fewer than 100 points or Gaussians, and an object that does not fit.
pub fn place_object(object: &Gaussians, up: Up, scan: &Cloud, views: &[View]) -> Result<Placed> {
    let upright = Similarity { rotation: rotation(up), ..Similarity::IDENTITY };
    let model: Vec<DVec3> = object
        .means()
        .iter()
        .zip(object.opacities())
        .filter(|(_, opacity)| **opacity >= FAINTEST)
        .map(|(mean, _)| upright.transform_point(DVec3::from_array(mean.map(f64::from))))
        .collect();
    let scan: Vec<DVec3> = scan.points().iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
    for (name, count) in [("object", model.len()), ("scan", scan.len())] {
        if count < FEWEST {
            return Err(Error::argument(name, format!("{count} points"), format!("at least {FEWEST}")));
        }
    }
    let (model, scan) = (Side::new(&model), Side::new(&scan));
    let mut fits: Vec<Fit> = (0..HEADINGS)
        .map(|k| fit(&model, &scan, std::f64::consts::TAU * f64::from(k) / f64::from(HEADINGS)))
        .filter(|fit| fit.residual_m.is_finite())
        .collect();
    fits.sort_by(|a, b| a.residual_m.total_cmp(&b.residual_m));
    let least = fits.first().map_or(f64::INFINITY, |fit| fit.residual_m);
    fits.retain(|fit| fit.residual_m <= NEARLY * least);

    let mut best: Option<(f64, Placed)> = None;
    for fit in fits {
        let rotation = fit.similarity.rotation * upright.rotation;
        let vehicle_from_object = Similarity { rotation, ..fit.similarity };
        let gaussians = object.transformed(&vehicle_from_object)?;
        let likeness = likeness(&gaussians, views)?;
        if best.as_ref().is_none_or(|(other, _)| likeness > *other) {
            best = Some((likeness, Placed { gaussians, vehicle_from_object, residual_m: fit.residual_m }));
        }
    }
    best.map(|(_, placed)| placed).ok_or_else(|| Error::Reconstruction {
        stage: "import",
        reason: "the object does not fit the scan for any heading; check the scan and the object's up axis"
            .into(),
    })
}

/// Minimum of points on either side.
const FEWEST: usize = 100;

/// Rotation from the object's axes to z up.
fn rotation(up: Up) -> DMat3 {
    match up {
        Up::Z => DMat3::IDENTITY,
        // (X, Y, Z) of the file is (X, Z, -Y): the columns are the images of the file's axes.
        Up::MinusY => DMat3::from_cols(DVec3::X, DVec3::new(0.0, 0.0, -1.0), DVec3::new(0.0, 1.0, 0.0)),
    }
}

/// Points of one side, with a search tree.
struct Side {
    points: Vec<DVec3>,
    tree: Nearest,
    low: DVec3,
    high: DVec3,
}

impl Side {
    fn new(all: &[DVec3]) -> Self {
        let step = all.len().div_ceil(MOST_POINTS);
        let points: Vec<DVec3> = all.iter().copied().step_by(step).collect();
        let at = |axis: usize, share: f64| {
            let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
            let rank = ((values.len() - 1) as f64 * share).round() as usize;
            *values.select_nth_unstable_by(rank, f64::total_cmp).1
        };
        let (low, high) = ([0, 1, 2].map(|a| at(a, STRAYS)), [0, 1, 2].map(|a| at(a, 1.0 - STRAYS)));
        Self { tree: Nearest::new(points.iter().copied()), points, low: low.into(), high: high.into() }
    }

    fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    fn longest(&self) -> f64 {
        (self.high - self.low).max_element()
    }
}

/// Result of one heading.
struct Fit {
    similarity: Similarity,
    residual_m: f64,
}

/// A point of the object in its frame, a point of the scan, and their squared distance, square metres.
type Pair = (DVec3, DVec3, f64);

fn fit(model: &Side, scan: &Side, heading: f64) -> Fit {
    let (scale, rotation) = (scan.longest() / model.longest(), DMat3::from_rotation_z(heading));
    let translation = scan.center() - scale * (rotation * model.center());
    let mut fit = Fit { similarity: Similarity { scale, rotation, translation }, residual_m: f64::INFINITY };
    for _ in 0..STEPS {
        let pairs = pairs(model, scan, &fit.similarity);
        let residual_m = pairs.iter().map(|pair| pair.2.sqrt()).sum::<f64>() / pairs.len() as f64;
        let (from, to): (Vec<_>, Vec<_>) = pairs.into_iter().map(|(from, to, _)| (from, to)).unzip();
        let Ok(similarity) = Similarity::umeyama(&from, &to) else { break };
        let gained = fit.residual_m - residual_m;
        fit = Fit { similarity, residual_m };
        if gained.abs() < 1e-6 * residual_m {
            break;
        }
    }
    fit
}

/// Nearest neighbours in both directions, without the farthest pairs of each.
fn pairs(model: &Side, scan: &Side, s: &Similarity) -> Vec<Pair> {
    let inverse = s.inverse();
    let forth = model.points.par_iter().map(|p| {
        let found = scan.tree.nearest(s.transform_point(*p)).expect("a side has points");
        (*p, scan.points[found.index], found.squared)
    });
    let back = scan.points.par_iter().map(|q| {
        let found = model.tree.nearest(inverse.transform_point(*q)).expect("a side has points");
        (model.points[found.index], *q, found.squared * s.scale * s.scale)
    });
    let mut all = trimmed(forth.collect());
    all.extend(trimmed(back.collect()));
    all
}

fn trimmed(mut pairs: Vec<Pair>) -> Vec<Pair> {
    pairs.sort_by(|a, b| a.2.total_cmp(&b.2));
    pairs.truncate((KEPT_SHARE * pairs.len() as f64).ceil() as usize);
    pairs
}

/// Mean PSNR over the views, dB; 0 without any.
fn likeness(gaussians: &Gaussians, views: &[View]) -> Result<f64> {
    let (renderer, options) = (CpuRenderer::new(), RenderOptions::default());
    let mut sum = 0.0;
    for view in views {
        let drawn = renderer.render(gaussians, &view.camera, &options)?;
        sum += psnr(&drawn.color, &on_white(view));
    }
    Ok(sum / views.len().max(1) as f64)
}
