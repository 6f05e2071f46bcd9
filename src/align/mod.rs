//! From the arbitrary gauge of a structure-from-motion model to the metric vehicle frame.
//!
//! [`to_scan`] takes a scanned point cloud in the vehicle's frame and masked views: the scan's outline must run along
//! every mask's edge, and the sparse points of the vehicle must lie on the scan's surface. Measured in docs/ALIGN.md.

mod candidates;
mod ground;
mod icp;
mod scan;
mod silhouettes;
mod solve;
mod tree;

use crate::error::{Error, Result};
use crate::geometry::Similarity;
use crate::scene::undistort::undistorted;
use crate::scene::{Cloud, View};
use candidates::{turn_between, turned};
use glam::DVec3;
use rayon::prelude::*;
use scan::Scan;
use silhouettes::Outline;

/// Fewer masks leave scale or place open.
pub const FEWEST_VIEWS: usize = 3;

/// Fewer pieces of edge in all masks together are no outline.
const FEWEST_EDGES: usize = 60;

/// Coarse alignments that are tried with the first rounds.
const TRIED: usize = 4;

/// Rounds of refinement that tell which coarse alignment is right, on every [`THINNED`]th point.
const FIRST_ROUNDS: usize = 2;

/// See [`FIRST_ROUNDS`]: points twice as far apart.
const THINNED: usize = 4;

/// Rounds of refinement: how far from the edge the outline is looked for and where the loss bends, pixels; how far
/// from the scan a sparse point counts, metres.
const ROUNDS: [(f64, f64, f64); 3] = [(16.0, 6.0, 0.3), (8.0, 2.0, 0.1), (4.0, 1.0, 0.04)];

/// Steps of a round.
const STEPS: usize = 12;

/// Alignments are compared with points this near to the edges, pixels.
const COMPARED_PX: f64 = 12.0;

/// Noise of a sparse point that is on the surface, metres.
const POINT_NOISE_M: f64 = 0.01;

/// All sparse points together weigh at most as much as all edges.
const POINTS_SHARE: f64 = 1.0;

/// A scan whose outline misses the masks by more than this on average, pixels per 512 of picture width, is not of this
/// vehicle, or not in metres: wrong headings miss by 2 and more, right ones by less than 1.
const WORST_PX: f64 = 5.0;

/// Least [`ScanAlignment::confidence`] for which front and back are told apart.
pub const LEAST_CONFIDENCE: f64 = 0.1;

/// How front and back are told apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Heading {
    /// By shape; where that fits as well the other way round, it is an error.
    #[default]
    Auto,
    /// The first view, by name, was taken from ahead of the vehicle's middle.
    Forward,
    /// It was taken from behind the middle.
    Backward,
}

/// A similarity found with a scan, and how well it fits.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanAlignment {
    /// From the views' world to the scan's frame, metres.
    pub vehicle_from_world: Similarity,
    /// Median distance between the outlines of scan and masks, metres at the vehicle.
    pub residual_m: f64,
    /// Mean distance between them, pixels.
    pub residual_px: f64,
    /// The same for the best alignment with front and back exchanged.
    pub other_px: f64,
    /// 1 - residual / the other way round's, 0 to 1: 0 where front and back fit equally well.
    pub confidence: f64,
    /// Views whose masks were used.
    pub views: usize,
    /// Sparse points on the scan's surface, and their root mean square distance from it, metres.
    pub points: usize,
    /// See `points`; 0 without any.
    pub points_m: f64,
}

/// The similarity that takes the world of masked views to the frame of a scan.
///
/// `views` carry `world_from_camera` as their camera's pose, the world being any gauge; their pictures are not looked
/// at. `sparse` are points of that world, which may show anything; none are needed. `scan` is in the vehicle's frame,
/// metres, with noise and strays. The result does not depend on the number of threads.
///
/// # Errors
/// Fewer than [`FEWEST_VIEWS`] masks, a scan without surface or not of a vehicle's size, an outline that nowhere
/// fits the masks, and front and back that cannot be told apart under [`Heading::Auto`].
pub fn to_scan(views: &[View], sparse: &[DVec3], scan: &Cloud, heading: Heading) -> Result<ScanAlignment> {
    let outlines = outlines(views)?;
    let scan = Scan::new(scan)?;
    let ground = ground::normal(sparse, &outlines);
    let starts = candidates::find(&outlines, &scan, ground)?;
    let points = icp::of_vehicle(sparse, &outlines);

    let thin: Vec<DVec3> = scan.points.iter().step_by(THINNED).copied().collect();
    let tried = |s: Similarity| {
        let s = refine(&outlines, &scan, &thin, &points, s, &ROUNDS[..FIRST_ROUNDS]);
        (s, silhouettes::misses(&outlines, &thin, &s, COMPARED_PX).mean_px)
    };
    let finished = |s: Similarity| {
        let s = refine(&outlines, &scan, &scan.points, &points, s, &ROUNDS[FIRST_ROUNDS..]);
        (s, silhouettes::misses(&outlines, &scan.points, &s, COMPARED_PX))
    };
    let first: Vec<(Similarity, f64)> = starts.into_iter().take(TRIED).map(tried).collect();
    let best = best_of(first.iter().copied()).ok_or_else(|| nowhere("no start leads anywhere"))?;
    // Whatever was found the other way round, and the best one exactly turned.
    let is_opposite = |s: &Similarity| turn_between(s, &best) > std::f64::consts::FRAC_PI_2;
    let exactly = turned(&best, scan.center);
    let opposite = first.iter().copied().chain([tried(exactly)]).filter(|f| is_opposite(&f.0));
    let other = best_of(opposite).unwrap_or(exactly);
    let ((best, misses), (other, other_misses)) = (finished(best), finished(other));
    let ((chosen, misses), other_misses) = match heading {
        Heading::Auto => ((best, misses), other_misses),
        asked => {
            let first = first_camera(views);
            match (ahead(&best, first, &scan)? == (asked == Heading::Forward), ahead(&other, first, &scan)?) {
                (true, _) => ((best, misses), other_misses),
                _ => ((other, other_misses), misses),
            }
        }
    };
    let confidence = (1.0 - misses.mean_px / other_misses.mean_px.max(1e-9)).clamp(0.0, 1.0);
    let worst = WORST_PX * f64::from(views[0].camera.width) / 512.0;
    if !(misses.mean_px <= worst && misses.median_m.is_finite()) {
        return Err(nowhere(&format!(
            "the scan's outline misses the masks' edges by {:.1} pixels on average, allowed: {worst:.1}",
            misses.mean_px
        )));
    }
    if heading == Heading::Auto && confidence < LEAST_CONFIDENCE {
        return Err(Error::Reconstruction {
            stage: "align",
            reason: format!(
                "front and back cannot be told apart: the scan's outline misses the masks by {:.2} pixels one way \
                 and by {:.2} the other; say which it is (--heading forward where the first picture shows the \
                 vehicle from ahead, backward where from behind)",
                misses.mean_px, other_misses.mean_px
            ),
        });
    }
    let (points_m, on_surface) = icp::residual(&points, &scan, &chosen, ROUNDS[2].2);
    Ok(ScanAlignment {
        vehicle_from_world: chosen,
        residual_m: misses.median_m,
        residual_px: misses.mean_px,
        other_px: other_misses.mean_px,
        confidence,
        views: outlines.len(),
        points: on_surface,
        points_m,
    })
}

fn outlines(views: &[View]) -> Result<Vec<Outline>> {
    let of = |view: &View| {
        let view = undistorted(view)?;
        Ok(view.mask.as_ref().map(|mask| Outline::new(&view, mask)))
    };
    let all: Vec<Option<Outline>> = views.par_iter().map(of).collect::<Result<_>>()?;
    let seen: Vec<Outline> = all.into_iter().flatten().filter(|o| o.edge_count() > 0).collect();
    let edges: usize = seen.iter().map(Outline::edge_count).sum();
    if seen.len() < FEWEST_VIEWS || edges < FEWEST_EDGES {
        let found = format!("{} with a mask that shows an outline, of {}", seen.len(), views.len());
        return Err(Error::argument("views", found, format!("at least {FEWEST_VIEWS}")));
    }
    Ok(seen)
}

fn nowhere(reason: &str) -> Error {
    Error::Reconstruction {
        stage: "align",
        reason: format!("{reason}; check that the scan is of this vehicle and in metres, and the masks"),
    }
}

fn best_of(found: impl Iterator<Item = (Similarity, f64)>) -> Option<Similarity> {
    found.min_by(|a, b| a.1.total_cmp(&b.1)).map(|f| f.0)
}

/// `surface` are points of the scan, `sparse` points of the world that show the vehicle.
fn refine(
    outlines: &[Outline],
    scan: &Scan,
    surface: &[DVec3],
    sparse: &[DVec3],
    start: Similarity,
    rounds: &[(f64, f64, f64)],
) -> Similarity {
    let edges: usize = outlines.iter().map(Outline::edge_count).sum();
    let weight = POINTS_SHARE * edges as f64 / sparse.len().max(1) as f64;
    let round = |s, &(reach, bend, near): &(f64, f64, f64)| {
        let system = |s: &Similarity| {
            let edges = silhouettes::fine(outlines, surface, s, scan.center, reach, bend);
            let points = icp::system(sparse, scan, s, near, POINT_NOISE_M, weight.min(1.0));
            solve::System::sum([edges, points])
        };
        solve::descend(s, scan.center, STEPS, system).0
    };
    rounds.iter().fold(start, round)
}

fn first_camera(views: &[View]) -> DVec3 {
    let first = views.iter().min_by(|a, b| a.name.cmp(&b.name));
    first.map_or(DVec3::ZERO, |v| v.camera.center())
}

/// Whether a camera stands ahead of the scan's middle.
fn ahead(s: &Similarity, camera: DVec3, scan: &Scan) -> Result<bool> {
    /// Nearer to abeam than this, ahead and behind mean nothing: sine of 6 degrees.
    const ABEAM: f64 = 0.1;
    let seen = (s.transform_point(camera) - scan.center).normalize_or_zero();
    if seen.x.abs() < ABEAM {
        return Err(Error::Reconstruction {
            stage: "align",
            reason: "--heading: the first picture was taken from abeam, neither from ahead nor from behind"
                .into(),
        });
    }
    Ok(seen.x > 0.0)
}
