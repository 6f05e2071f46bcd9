//! To the frame of a scan: candidates by support functions, told apart and refined by outlines and sparse points.

use super::candidates::turned;
use super::heading::{Heading, asked_view, is_contrary, unknown};
use super::scan::Scan;
use super::silhouettes::Outline;
use super::{candidates, check_sparse, ground, icp, nowhere, outlines, silhouettes, solve};
use glam::DVec3;
use vg_geometry::Result;
use vg_geometry::Similarity;
use vg_geometry::progress::{UNWATCHED, Watch};
use vg_scene::{Cloud, View};

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

/// A scan whose outline misses the masks by more than this on average, where they look out into the open, pixels per 512
/// of picture width, is not of this vehicle, or not in metres: wrong headings miss by 2 and more, right ones by less
/// than 1.
const WORST_PX: f64 = 5.0;

/// What to look at where no alignment fits.
const CHECK: &str = "that the scan is of this vehicle and in metres";

/// Least [`ScanAlignment::confidence`] for which front and back are told apart.
pub const LEAST_CONFIDENCE: f64 = 0.1;

/// Which part of the work is done after each step, by the time that it takes.
const DONE: Done = Done { outlines: 0.05, scan: 0.1, candidates: 0.4, tried: 0.8 };

/// See [`DONE`].
struct Done {
    outlines: f64,
    scan: f64,
    candidates: f64,
    tried: f64,
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
    /// The view that [`Heading`] speaks of.
    pub asked_view: Option<String>,
}

/// The similarity that takes the world of masked views to the frame of a scan.
///
/// `views` carry `world_from_camera` as their camera's pose, the world being any gauge; their pictures are not looked
/// at. `sparse` are points of that world, which may show anything; none are needed. `scan` is in the vehicle's frame,
/// metres, with noise and strays. The result does not depend on the number of threads.
///
/// # Errors
/// Fewer than [`super::FEWEST_VIEWS`] masks, a scan without surface or not of a vehicle's size, an outline that nowhere
/// fits the masks, and front and back that cannot be told apart under [`Heading::Auto`].
pub fn to_scan(views: &[View], sparse: &[DVec3], scan: &Cloud, heading: Heading) -> Result<ScanAlignment> {
    to_scan_watched(views, sparse, scan, heading, &UNWATCHED)
}

/// As [`to_scan`], under `watch`.
///
/// # Errors
/// Those of [`to_scan`], and [`Error::Cancelled`](vg_geometry::Error::Cancelled).
pub fn to_scan_watched(
    views: &[View],
    sparse: &[DVec3],
    scan: &Cloud,
    heading: Heading,
    watch: &Watch,
) -> Result<ScanAlignment> {
    check_sparse(sparse)?;
    let outlines = outlines(views)?;
    watch.report(DONE.outlines)?;
    let scan = Scan::new(scan)?;
    watch.report(DONE.scan)?;
    let up = ground::plane(sparse, &outlines).map(|ground| ground.1);
    let starts = candidates::find(&outlines, &scan, up, watch)?;
    watch.report(DONE.candidates)?;
    let points = icp::of_vehicle(sparse, &outlines);

    let thin: Vec<DVec3> = scan.points.iter().step_by(THINNED).copied().collect();
    let tried = |s: Similarity| {
        let s = refine(&outlines, &scan, &thin, &points, s, &ROUNDS[..FIRST_ROUNDS], watch);
        (s, silhouettes::misses(&outlines, &thin, &s, COMPARED_PX).mean_px)
    };
    let finished = |s: Similarity| {
        let s = refine(&outlines, &scan, &scan.points, &points, s, &ROUNDS[FIRST_ROUNDS..], watch);
        (s, silhouettes::misses(&outlines, &scan.points, &s, COMPARED_PX))
    };
    let first: Vec<(Similarity, f64)> = starts.into_iter().take(TRIED).map(tried).collect();
    let best = best_of(first.iter().copied()).ok_or_else(|| nowhere("no start leads anywhere", CHECK))?;
    // Whatever was found upright the other way round, and the best one exactly turned.
    let is_opposite = |s: &Similarity| {
        let turn = s.rotation * best.rotation.transpose();
        turn.x_axis.x < 0.0 && turn.z_axis.z > 0.0
    };
    let exactly = turned(&best, scan.center);
    let opposite = first.iter().copied().chain([tried(exactly)]).filter(|f| is_opposite(&f.0));
    let other = best_of(opposite).unwrap_or(exactly);
    watch.report(DONE.tried)?;
    let mut both = [finished(best), finished(other)];
    watch.check()?;
    // All points may judge otherwise than every fourth.
    both.sort_by(|a, b| a.1.mean_px.total_cmp(&b.1.mean_px));
    let [(best, misses), (other, other_misses)] = both;
    let worst = WORST_PX * f64::from(views[0].camera.width) / 512.0;
    if !(misses.open_px <= worst && misses.median_m.is_finite()) {
        let reason = format!(
            "the scan's outline misses the masks' edges by {:.1} pixels on average, allowed: {worst:.1}",
            misses.open_px
        );
        return Err(nowhere(&reason, CHECK));
    }
    let contrary = is_contrary(heading, views, &best, scan.center)?;
    let (chosen, misses, other_misses) =
        if contrary { (other, other_misses, misses) } else { (best, misses, other_misses) };
    let confidence = (1.0 - misses.mean_px / other_misses.mean_px.max(1e-9)).clamp(0.0, 1.0);
    if heading == Heading::Auto && confidence < LEAST_CONFIDENCE {
        let why = format!(
            "front and back cannot be told apart: the scan's outline misses the masks by {:.2} pixels one way and by \
             {:.2} the other",
            misses.mean_px, other_misses.mean_px
        );
        return Err(unknown(views, &chosen, scan.center, &why));
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
        asked_view: asked_view(views, &chosen, scan.center).map(|v| v.0.to_owned()),
    })
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
    watch: &Watch,
) -> Similarity {
    let edges: usize = outlines.iter().map(Outline::edge_count).sum();
    let weight = POINTS_SHARE * edges as f64 / sparse.len().max(1) as f64;
    let round = |s, &(reach, bend, near): &(f64, f64, f64)| {
        let system = |s: &Similarity| {
            let edges = silhouettes::fine(outlines, surface, s, scan.center, reach, bend);
            let points = icp::system(sparse, scan, s, near, POINT_NOISE_M, weight.min(1.0));
            solve::System::sum([edges, points])
        };
        solve::descend(s, scan.center, STEPS, watch, system).0
    };
    rounds.iter().fold(start, round)
}
