//! The backward pass: from the gradient of a picture to those of the Gaussians, the background and the pose.
//!
//! Stages: `blend` replays each tile onto its `tape` and differentiates it from back to front, `sum` adds the tiles'
//! gradients for each splat, `project` differentiates the projection and the colour. The splats, their order and the
//! lists of tiles are those of the forward pass. The order of summation, tile by tile and chunk by chunk, depends only
//! on the picture, so the bytes are the same for any number of threads.

mod blend;
mod color;
mod project;
mod tape;

use super::bin::{self, Grid, Window};
use super::simd::Lanes;
use super::tile::{TILE_HEIGHT, TILE_WIDTH, Tile};
use super::{Job, Listed, PROJECT_CHUNK, Scratch, TileJob};
use crate::gaussians::Gaussians;
use crate::render::view::PinholeView;
use crate::render::{Gradients, PictureGradient, PoseGradient, RenderOptions};
pub(in crate::render) use blend::SplatSums;
use blend::TileGradient;
use glam::{DMat3, DVec3};
pub(in crate::render) use project::Decided;
use project::{CameraSums, Chunk};
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use tape::Tape;
use vg_geometry::Camera;

/// Maximum number of (tile, splat) pairs whose gradients are held at a time: 184 MB if all of them draw.
const PAIR_BUDGET: u64 = 1 << 22;

/// Magnitude to which the picture's gradient is scaled by a power of two, which is exact: with colours of at most 1e30
/// and 8192 x 8192 pixels no sum leaves f32, and entries 1e-30 of the largest still contribute.
const LARGEST: f64 = 1.0 / (1 << 24) as f64;

/// Wall time of each stage of one backward pass.
#[derive(Clone, Copy, Debug, Default)]
pub struct BackwardTimes {
    /// Replaying and differentiating the tiles.
    pub blend: Duration,
    /// Adding the tiles' shares.
    pub sum: Duration,
    /// Differentiating projection and colour.
    pub project: Duration,
}

/// Working memory, reused from picture to picture.
#[derive(Debug, Default)]
pub(super) struct BackwardScratch {
    tiles: Vec<TileShare>,
    /// `[n]`
    sums: Vec<SplatSums>,
    /// Spare workers, at most one per thread.
    workers: Mutex<Vec<Box<Worker>>>,
}

/// One tile's contribution to the gradients of the splats drawn in it, farthest first.
#[derive(Debug, Default)]
struct TileShare {
    splats: Vec<u32>,
    sums: Vec<SplatSums>,
    background: [f64; 3],
}

/// Working memory of a thread for one tile.
#[derive(Debug)]
struct Worker {
    tile: Tile,
    tape: Tape,
    gradient: TileGradient,
}

/// Computes the gradients of the splats projected and sorted into `scratch`; `listed` tells what its stripes list, if a
/// picture was drawn. `largest` is the largest magnitude in `gradient`. After a stop the contents of `out` are unspecified.
pub(super) fn backward<S: Lanes>(
    simd: S,
    job: Job,
    scratch: &mut Scratch,
    listed: Option<Listed>,
    (gradient, largest): (&PictureGradient, f32),
    out: &mut Gradients,
) -> BackwardTimes {
    let Job { gaussians, camera, options, pair_budget, watch } = job;
    let scale = gradient_scale(largest);
    let grid = Grid::new(camera.width, camera.height);
    let Scratch { splats, splat_from_rank, bounds_from_rank, stripes, backward, .. } = scratch;
    let BackwardScratch { tiles, sums, workers } = backward;
    sums.clear();
    sums.resize(gaussians.len(), [0.0; 10]);

    let mut times = BackwardTimes::default();
    let mut background = [0.0; 3];
    let windows = bin::windows(grid, bounds_from_rank, pair_budget.min(PAIR_BUDGET));
    let whole = windows.len() == 1;
    for window in windows {
        let start = Instant::now();
        if !(whole && listed == Some(Listed::All)) {
            bin::bin(&window, splat_from_rank, bounds_from_rank, stripes);
        }
        let tile_job = TileJob { stripes, splats, options, watch };
        walk_tiles(simd, &window, tile_job, (gradient, scale), workers, tiles);
        if watch.is_stopped() {
            return times;
        }
        let walked = Instant::now();
        add_shares(tiles, sums);
        for tile in tiles.iter() {
            for c in 0..3 {
                background[c] += tile.background[c];
            }
        }
        times.blend += walked - start;
        times.sum += walked.elapsed();
    }

    let start = Instant::now();
    let shares = Shares { sums, background, scale };
    backward_to_gaussians(
        simd,
        gaussians,
        camera,
        options,
        &shares,
        |i| Decided::from_splat(&splats[i]),
        out,
    );
    times.project = start.elapsed();
    times
}

/// Gradients summed over pixels, for each splat and the background.
pub(in crate::render) struct Shares<'a> {
    /// `[n]`
    pub(in crate::render) sums: &'a [SplatSums],
    pub(in crate::render) background: [f64; 3],
    /// Factor by which the picture's gradient was scaled.
    pub(in crate::render) scale: f64,
}

/// Differentiates the projection and the colour of each Gaussian that was drawn.
pub(super) fn backward_to_gaussians<S: Lanes>(
    simd: S,
    gaussians: &Gaussians,
    camera: &Camera,
    options: &RenderOptions,
    shares: &Shares,
    decided: impl Fn(usize) -> Decided + Sync,
    out: &mut Gradients,
) {
    let view = PinholeView::new(camera, options, gaussians.sh_degree());
    let unscale = 1.0 / shares.scale;
    let total = project_all(simd, &view, gaussians, decided, shares.sums, unscale, out);
    out.background = shares.background.map(|v| v * unscale);
    out.pose = pose_gradient(camera, &total);
}

/// The power of two that scales `largest` to about [`LARGEST`].
pub(in crate::render) fn gradient_scale(largest: f32) -> f64 {
    let ratio = if largest > 0.0 { LARGEST / f64::from(largest) } else { 1.0 };
    f64::from_bits(ratio.to_bits() & 0xfff0_0000_0000_0000)
}

/// Replays and differentiates every tile of `window`.
fn walk_tiles<S: Lanes>(
    simd: S,
    window: &Window,
    job: TileJob,
    (gradient, scale): (&PictureGradient, f64),
    workers: &Mutex<Vec<Box<Worker>>>,
    tiles: &mut Vec<TileShare>,
) {
    let TileJob { stripes, splats, options, watch } = job;
    let columns = window.columns.len();
    tiles.resize_with(window.rows.len() * columns, TileShare::default);
    tiles.par_iter_mut().with_max_len(1).enumerate().for_each(|(i, share)| {
        if watch.is_stopped() {
            return;
        }
        let (row, column) = (window.rows.start + i / columns, window.columns.start + i % columns);
        let origin = [column * TILE_WIDTH, row * TILE_HEIGHT];
        let tile_entries = bin::stripe_with_row(stripes, row).tile(column, row);
        let pool = || workers.lock().unwrap_or_else(PoisonError::into_inner);
        let spare = pool().pop();
        let mut worker = spare.unwrap_or_else(Worker::new);
        let Worker { tile, tape, gradient: behind } = &mut *worker;
        share.splats.clear();
        share.sums.clear();
        tape.clear();
        tile.clear_part(gradient.width as usize - origin[0], gradient.height as usize - origin[1]);
        simd.vectorize(
            #[inline(always)]
            || super::blend::blend(simd, tile, origin, tile_entries, splats, options.max_alpha, tape),
        );
        share.background = simd.vectorize(
            #[inline(always)]
            || behind.start((tile, tape), origin, options, gradient, scale),
        );
        simd.vectorize(
            #[inline(always)]
            || behind.walk(simd, tape, origin, splats, options.max_alpha, share),
        );
        pool().push(worker);
    });
}

impl Worker {
    fn new() -> Box<Self> {
        Box::new(Self { tile: Tile::new(), tape: Tape::new(), gradient: TileGradient::new() })
    }
}

/// Adds the tiles' shares to `sums`, in the order of the tiles. Each task owns a range of splats and scans all tiles,
/// so the division into ranges changes no sum.
fn add_shares(tiles: &[TileShare], sums: &mut [SplatSums]) {
    let len = sums.len().div_ceil(rayon::current_num_threads()).max(1);
    sums.par_chunks_mut(len).enumerate().for_each(|(i, sums)| {
        let first = (i * len) as u32;
        for tile in tiles {
            for (&splat, share) in tile.splats.iter().zip(&tile.sums) {
                // A splat before the range wraps around to a huge index.
                let at = splat.wrapping_sub(first) as usize;
                if let Some(sum) = sums.get_mut(at) {
                    for k in 0..10 {
                        sum[k] += share[k];
                    }
                }
            }
        }
    });
}

fn project_all<S: Lanes>(
    simd: S,
    view: &PinholeView,
    gaussians: &Gaussians,
    decided: impl Fn(usize) -> Decided + Sync,
    sums: &[SplatSums],
    unscale: f64,
    out: &mut Gradients,
) -> CameraSums {
    out.resize(gaussians);
    let stride = gaussians.sh_stride();
    let chunks = out
        .means
        .par_chunks_mut(PROJECT_CHUNK)
        .zip(out.rotations.par_chunks_mut(PROJECT_CHUNK))
        .zip(out.scales.par_chunks_mut(PROJECT_CHUNK))
        .zip(out.opacities.par_chunks_mut(PROJECT_CHUNK))
        .zip(out.sh.par_chunks_mut(PROJECT_CHUNK * stride))
        .zip(sums.par_chunks(PROJECT_CHUNK));
    let cameras: Vec<CameraSums> = chunks
        .enumerate()
        .map(|(i, (((((means, rotations), scales), opacities), sh), sums))| {
            let chunk = Chunk { first: i * PROJECT_CHUNK, means, rotations, scales, opacities, sh };
            simd.vectorize(
                #[inline(always)]
                || project::project(view, gaussians, &decided, sums, unscale, chunk),
            )
        })
        .collect();
    let mut total = [0.0; 15];
    for camera in cameras {
        for k in 0..15 {
            total[k] += camera[k];
        }
    }
    total
}

fn pose_gradient(camera: &Camera, total: &CameraSums) -> PoseGradient {
    let pose = &camera.vehicle_from_camera;
    let rows = |k: usize| DVec3::new(total[k], total[k + 1], total[k + 2]);
    let entries = DMat3::from_cols(rows(0), rows(3), rows(6)).transpose();
    PoseGradient::new(pose, entries, rows(9), rows(12))
}
