//! Alignment to the frame of a scan: candidates by support functions, selected and refined by outlines and sparse
//! points.

use super::candidates::turned;
use super::heading::{Heading, heading_view, is_contrary, unknown};
use super::scan::Scan;
use super::silhouettes::Outline;
use super::{candidates, check_sparse, ground, icp, nowhere, outlines, silhouettes, solve};
use glam::DVec3;
use vg_geometry::progress::{UNWATCHED, Watch};
use vg_geometry::{Result, Similarity};
use vg_scene::{Cloud, View};

/// The number of coarse alignments tried in the first rounds.
const TRIED: usize = 4;

/// Rounds of refinement that select the right coarse alignment, on every [`THINNED`]th point.
const FIRST_ROUNDS: usize = 2;

/// Thinning in the first rounds, which doubles the distance between points.
const THINNED: usize = 4;

/// Rounds of refinement: largest distance of the outline from the edge and start of the linear loss, pixels; largest
/// distance of a sparse point from the scan, metres.
const ROUNDS: [(f64, f64, f64); 3] = [(16.0, 6.0, 0.3), (8.0, 2.0, 0.1), (4.0, 1.0, 0.04)];

/// Maximum of steps of a round.
const STEPS: usize = 12;

/// Largest distance of points from the edges when alignments are compared, pixels.
const COMPARED_PX: f64 = 12.0;

/// Noise of a sparse point on the surface, metres.
const POINT_NOISE_M: f64 = 0.01;

/// Maximum weight of all sparse points together, relative to all edges.
const POINTS_SHARE: f64 = 1.0;

/// Largest mean distance between the outline and open edges, pixels per 512 of picture width. A larger one means that
/// the scan shows another vehicle or is not in metres: wrong headings miss by 2 and more, right ones by less than 1.
const WORST_PX: f64 = 5.0;

/// The input to check if no alignment fits.
const CHECK: &str = "that the scan is of this vehicle and in metres";

/// Minimum [`ScanAlignment::confidence`] at which front and back are distinguished.
pub const LEAST_CONFIDENCE: f64 = 0.1;

/// Progress after each step, by the time that it takes.
const DONE: Done = Done { outlines: 0.05, scan: 0.1, candidates: 0.4, tried: 0.8 };

/// See [`DONE`].
struct Done {
    outlines: f64,
    scan: f64,
    candidates: f64,
    tried: f64,
}

/// A similarity found with a scan, and the quality of its fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanAlignment {
    /// Similarity from the views' world to the scan's frame, metres.
    pub vehicle_from_world: Similarity,
    /// Median distance between the outlines of scan and masks, metres at the vehicle.
    pub residual_m: f64,
    /// Mean distance between the outlines, pixels.
    pub residual_px: f64,
    /// Mean distance for the best alignment with front and back exchanged, pixels.
    pub other_px: f64,
    /// 1 - `residual_px` / `other_px`, 0 to 1: 0 if front and back fit equally well.
    pub confidence: f64,
    /// The number of views whose masks were used.
    pub views: usize,
    /// The number of sparse points on the scan's surface.
    pub points: usize,
    /// Root mean square distance of these points from the surface, metres; 0 without any.
    pub points_m: f64,
    /// Name of the view that [`Heading`] refers to.
    pub heading_view: Option<String>,
}

/// Aligns the world of masked views to the frame of a scan.
///
/// `views` carry `world_from_camera` as their camera's pose, in any gauge; their pictures are not read. `sparse` are
/// points of that world, which may show anything and may be empty. `scan` is in the vehicle's frame, metres; noise and
/// stray points are allowed. The result does not depend on the number of threads.
///
/// # Errors
/// Fewer than [`super::FEWEST_VIEWS`] masks, a scan without surface or not of a vehicle's size, an outline that fits
/// the masks nowhere, and front and back that cannot be told apart under [`Heading::Auto`].
pub fn to_scan(views: &[View], sparse: &[DVec3], scan: &Cloud, heading: Heading) -> Result<ScanAlignment> {
    to_scan_watched(views, sparse, scan, heading, &UNWATCHED)
}

/// [`to_scan`] under `watch`.
///
/// # Errors
/// The errors of [`to_scan`], and [`Error::Cancelled`](vg_geometry::Error::Cancelled).
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
    let points = icp::vehicle_points(sparse, &outlines);

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
    let best =
        best_of(first.iter().copied()).ok_or_else(|| nowhere("no coarse alignment was found", CHECK))?;
    // Candidates for the opposite heading: those found upright the other way round, and the best one turned by 180
    // degrees.
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
    // The order may differ between all points and every fourth.
    both.sort_by(|a, b| a.1.mean_px.total_cmp(&b.1.mean_px));
    let [(best, misses), (other, other_misses)] = both;
    let worst = WORST_PX * f64::from(views[0].camera.width) / 512.0;
    if !(misses.open_px <= worst && misses.median_m.is_finite()) {
        let reason = format!(
            "the scan's outline misses the masks' edges by {:.1} pixels on average, allowed: at most {worst:.1}",
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
        heading_view: heading_view(views, &chosen, scan.center).map(|v| v.0.to_owned()),
    })
}

fn best_of(found: impl Iterator<Item = (Similarity, f64)>) -> Option<Similarity> {
    found.min_by(|a, b| a.1.total_cmp(&b.1)).map(|f| f.0)
}

/// Refines an alignment. `surface` are points of the scan, `sparse` points of the world that show the vehicle.
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
