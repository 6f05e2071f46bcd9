//! The fast renderer: f32 blending on the processor's vectors, rows of ellipses instead of tiles of pixels.
//!
//! Stages, in order: `project` (f64, eight Gaussians at a time), `sort` (depth bits), `bin` (which tile), `blend`.
//! It runs in the current rayon pool and draws the same bytes with any number of threads. `docs/RENDERER.md` has the
//! measurements behind each choice.

pub(super) mod backward;
mod bin;
mod blend;
mod color;
mod gradients;
mod project;
mod simd;
mod sort;
mod splat;
mod tile;
mod watched;

use crate::gaussians::Gaussians;
use crate::render::distorted::LensMap;
use crate::render::view::PinholeView;
use crate::render::{RenderOptions, Rendered, Renderer};
use backward::BackwardScratch;
pub use backward::BackwardTimes;
use bin::{Grid, Stripe};
use blend::NoRecord;
pub use gradients::GradientTimes;
use rayon::prelude::*;
use simd::Lanes;
use splat::{PixelBounds, Splat};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tile::{Planes, TILE_HEIGHT, TILE_WIDTH, Tile};
use vg_geometry::progress::{UNWATCHED, Watch};
use vg_geometry::{Camera, Result};
pub use watched::Watched;

/// Gaussians projected by one task: enough to hide its overhead, few enough to keep threads evenly busy.
const PROJECT_CHUNK: usize = 2048;

/// Instruction set for which the kernels are compiled.
#[derive(Clone, Copy, Debug)]
enum Level {
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    Portable(pulp::Scalar256b),
}

/// Renderer on the CPU. It keeps its working memory from picture to picture and can be shared between threads.
#[derive(Debug)]
pub struct CpuRenderer {
    level: Level,
    /// See `bin::PAIR_BUDGET`; tests lower it.
    pair_budget: u64,
    scratch: Mutex<Vec<Scratch>>,
    /// Map of the last lens drawn: computing it takes longer than drawing.
    lens: Mutex<Option<Arc<LensMap>>>,
}

/// Wall time of each stage of one picture.
#[derive(Clone, Copy, Debug, Default)]
pub struct StageTimes {
    /// Projecting Gaussians to splats, with their colours.
    pub project: Duration,
    /// Sorting by depth.
    pub sort: Duration,
    /// Listing the splats of each tile.
    pub bin: Duration,
    /// Blending, and writing the picture.
    pub blend: Duration,
}

/// Working memory, reused from picture to picture.
#[derive(Debug, Default)]
struct Scratch {
    splats: Vec<Splat>,
    keys: Vec<u32>,
    /// Bounds of each splat. `[n]`
    pixel_bounds: Vec<PixelBounds>,
    entries: Vec<u64>,
    entries_other: Vec<u64>,
    /// Index of the splat at each rank of the depth order. `[drawn]`
    splat_from_rank: Vec<u32>,
    /// Bounds of the splat at each rank of the depth order. `[drawn]`
    bounds_from_rank: Vec<PixelBounds>,
    stripes: Vec<Stripe>,
    backward: BackwardScratch,
}

impl Default for CpuRenderer {
    fn default() -> Self {
        Self::new()
    }
}

impl CpuRenderer {
    /// A renderer with the fastest vectors of this processor: AVX2 and FMA where it has them.
    pub fn new() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(v3) = pulp::x86::V3::try_new() {
            return Self::with_level(Level::Avx2(v3));
        }
        Self::portable()
    }

    /// A renderer with the target's guaranteed instructions only; for tests and for comparison.
    pub fn portable() -> Self {
        Self::with_level(Level::Portable(pulp::Scalar256b))
    }

    fn with_level(level: Level) -> Self {
        Self { level, pair_budget: bin::PAIR_BUDGET, scratch: Mutex::default(), lens: Mutex::default() }
    }

    /// The instructions in use: `"avx2+fma"` or `"portable"`.
    pub fn level(&self) -> &'static str {
        match self.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) => "avx2+fma",
            Level::Portable(_) => "portable",
        }
    }

    /// As [`Renderer::render`], into a picture whose memory is reused. The times are those of a pinhole camera's
    /// stages, and zero through a lens.
    pub fn render_into(
        &self,
        gaussians: &Gaussians,
        camera: &Camera,
        options: &RenderOptions,
        target: &mut Rendered,
    ) -> Result<StageTimes> {
        self.watched(&UNWATCHED).render_into(gaussians, camera, options, target)
    }

    fn pool(&self) -> MutexGuard<'_, Vec<Scratch>> {
        // A panic elsewhere cannot corrupt a list of spare buffers.
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lens_map(&self, camera: &Camera) -> Result<Arc<LensMap>> {
        let known = self.lens.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(map) = known.filter(|map| map.fits(camera)) {
            return Ok(map);
        }
        // The lock is not held here: the map is made in parallel, and a waiting thread may be one of rayon's.
        let map = Arc::new(LensMap::new(camera)?);
        *self.lens.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&map));
        Ok(map)
    }
}

impl Renderer for CpuRenderer {
    fn render(&self, gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Result<Rendered> {
        let mut target = Rendered::default();
        self.render_into(gaussians, camera, options, &mut target)?;
        Ok(target)
    }
}

/// What is drawn: a camera that is valid and has no lens.
#[derive(Clone, Copy)]
struct Job<'a> {
    gaussians: &'a Gaussians,
    camera: &'a Camera,
    options: &'a RenderOptions,
    pair_budget: u64,
    watch: &'a Watch,
}

/// What every tile of a picture needs.
#[derive(Clone, Copy)]
struct TileJob<'a> {
    stripes: &'a [Stripe],
    splats: &'a [Splat],
    options: &'a RenderOptions,
    watch: &'a Watch,
}

/// Where a slice of the depth order lies in it.
#[derive(Clone, Copy)]
struct Slice {
    is_first: bool,
    is_last: bool,
}

/// What the stripes list once a picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Listed {
    /// Every splat of the picture: it took one slice.
    All,
    /// Those of the last slice.
    LastSlice,
}

fn draw<S: Lanes>(simd: S, job: Job, scratch: &mut Scratch, target: &mut Rendered) -> StageTimes {
    let mut times = prepare(simd, job, scratch);
    blend_in_slices(simd, job, scratch, target, &mut times);
    times
}

/// Computes the splats, their depth order, and their bounds in this order.
fn prepare<S: Lanes>(simd: S, job: Job, scratch: &mut Scratch) -> StageTimes {
    let Job { gaussians, camera, options, watch, .. } = job;
    let view = PinholeView::new(camera, options, gaussians.sh_degree());
    let start = Instant::now();
    project_all(simd, &view, gaussians, watch, scratch);
    let projected = Instant::now();
    sort_by_depth(scratch);
    let sorted = Instant::now();
    bin::bounds_in_order(&scratch.splat_from_rank, &scratch.pixel_bounds, &mut scratch.bounds_from_rank);
    StageTimes {
        project: projected - start,
        sort: sorted - projected,
        bin: sorted.elapsed(),
        blend: Duration::ZERO,
    }
}

/// Draws the prepared splats.
fn blend_in_slices<S: Lanes>(
    simd: S,
    job: Job,
    scratch: &mut Scratch,
    target: &mut Rendered,
    times: &mut StageTimes,
) -> Listed {
    let Job { camera, options, pair_budget, watch, .. } = job;
    let grid = Grid::new(camera.width, camera.height);
    let Scratch { splats, splat_from_rank, bounds_from_rank, stripes, .. } = scratch;
    resize(target, camera.width, camera.height);
    let mut drawn = 0;
    // Runs once for an empty scene too, to draw the background.
    loop {
        let begin = Instant::now();
        let is_first = drawn == 0;
        let slice = drawn..drawn + bin::slice_len(&bounds_from_rank[drawn..], pair_budget);
        drawn = slice.end;
        let is_last = drawn == splat_from_rank.len();
        bin::bin(&grid.window(), &splat_from_rank[slice.clone()], &bounds_from_rank[slice], stripes);
        let binned = Instant::now();
        let tiles = TileJob { stripes, splats, options, watch };
        let unfinished = blend_all(simd, grid, tiles, target, Slice { is_first, is_last });
        times.bin += binned - begin;
        times.blend += binned.elapsed();
        if is_last || watch.is_stopped() {
            return if is_first { Listed::All } else { Listed::LastSlice };
        }
        if !unfinished {
            // Nothing farther is visible; an empty slice completes the picture.
            drawn = splat_from_rank.len();
        }
    }
}

fn project_all<S: Lanes>(
    simd: S,
    view: &PinholeView,
    gaussians: &Gaussians,
    watch: &Watch,
    scratch: &mut Scratch,
) {
    let n = gaussians.len();
    let Scratch { splats, keys, pixel_bounds, .. } = scratch;
    splats.resize(n, Splat::default());
    keys.resize(n, 0);
    pixel_bounds.resize(n, PixelBounds::default());
    let chunks = splats.par_chunks_mut(PROJECT_CHUNK).zip(keys.par_chunks_mut(PROJECT_CHUNK));
    let chunks = chunks.zip(pixel_bounds.par_chunks_mut(PROJECT_CHUNK));
    chunks.enumerate().for_each(|(i, ((splats, keys), bounds))| {
        if watch.is_stopped() {
            // Keys of an earlier picture may belong to Gaussians that no longer exist.
            return keys.fill(project::NOT_DRAWN);
        }
        let range = i * PROJECT_CHUNK..i * PROJECT_CHUNK + keys.len();
        simd.vectorize(
            #[inline(always)]
            || project::project(view, gaussians, range, splats, keys, bounds),
        );
    });
}

fn sort_by_depth(scratch: &mut Scratch) {
    let Scratch { keys, entries, entries_other, splat_from_rank, .. } = scratch;
    entries.clear();
    let drawn = keys.iter().enumerate().filter(|(_, k)| **k != project::NOT_DRAWN);
    entries.extend(drawn.map(|(i, &k)| sort::entry(k, i as u32)));
    sort::sort(entries, entries_other);
    splat_from_rank.clear();
    splat_from_rank.extend(entries.iter().map(|&e| sort::index(e)));
}

fn resize(target: &mut Rendered, width: u32, height: u32) {
    let pixels = width as usize * height as usize;
    (target.width, target.height) = (width, height);
    target.color.resize(pixels, [0.0; 3]);
    target.alpha.resize(pixels, 0.0);
    target.depth.resize(pixels, 0.0);
}

/// Blends one slice of the depth order into every tile, a band of rows per task. Returns whether a pixel is unfinished.
fn blend_all<S: Lanes>(simd: S, grid: Grid, job: TileJob, target: &mut Rendered, slice: Slice) -> bool {
    let TileJob { stripes, splats, options, watch } = job;
    let width = target.width as usize;
    let band = TILE_HEIGHT * width;
    let planes = target.color.par_chunks_mut(band).zip(target.alpha.par_chunks_mut(band));
    let bands = planes.zip(target.depth.par_chunks_mut(band)).enumerate();
    let blend_band = |tile: &mut Tile, (row, ((color, alpha), depth))| {
        let mut unfinished = false;
        if watch.is_stopped() {
            return unfinished;
        }
        let mut planes = Planes { color, alpha, depth, width };
        let stripe = bin::stripe_with_row(stripes, row);
        for column in 0..grid.columns {
            let x0 = column * TILE_WIDTH;
            if slice.is_first {
                tile.clear(&planes, x0);
            } else {
                tile.load(&planes, x0);
            }
            let tile_entries = stripe.tile(column, row);
            simd.vectorize(
                #[inline(always)]
                || {
                    let origin = [x0, row * TILE_HEIGHT];
                    blend::blend(simd, tile, origin, tile_entries, splats, options.max_alpha, &mut NoRecord);
                },
            );
            if slice.is_last {
                tile.store_finished(&mut planes, x0, options);
            } else {
                tile.store_unfinished(&mut planes, x0);
            }
            unfinished |= tile.is_live();
        }
        unfinished
    };
    bands.with_max_len(1).map_init(Tile::new, blend_band).reduce(|| false, |a, b| a | b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussians::buffer::Gaussian;
    use vg_geometry::Pose;
    use vg_geometry::camera::Intrinsics;

    #[test]
    fn depth_slices_of_any_size_draw_the_same_bytes() {
        let n = 400;
        let at = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1000) as f32 / 1000.0 - 0.5;
        let means = (0..n).map(|i| [2.0 * at(i, 0), 2.0 * at(i, 1), 4.0 + at(i, 2)]).collect();
        let rotations = (0..n).map(|i| [at(i, 3), at(i, 4), at(i, 5), 1.0]).collect();
        let scales = (0..n).map(|i| [0.3, 0.02, 0.1 + 0.1 * at(i, 6)]).collect();
        let opacities = (0..n).map(|i| 0.5 + at(i, 7)).collect();
        let sh = (0..3 * n).map(|i| at(i, 8)).collect();
        let gaussians = Gaussians::from_arrays(0, means, rotations, scales, opacities, sh).unwrap();
        let intrinsics = Intrinsics { fx: 150.0, fy: 150.0, cx: 75.0, cy: 50.0 };
        let camera = Camera::pinhole(150, 100, intrinsics, Pose::IDENTITY).unwrap();
        let options = RenderOptions::default();
        // A wall in the middle finishes every pixel before the last slice.
        let mut with_wall = gaussians.clone();
        for _ in 0..20 {
            with_wall.push(&Gaussian {
                mean: [0.0, 0.0, 4.0],
                rotation: [1.0, 0.0, 0.0, 0.0],
                scale: [100.0, 100.0, 0.01],
                opacity: 0.9,
                sh0: [0.1, 0.2, 0.3],
            });
        }
        for scene in [gaussians, with_wall] {
            let expected = CpuRenderer::new().render(&scene, &camera, &options).unwrap();
            assert!(expected.alpha.iter().any(|&a| a > 0.999));
            for pair_budget in [1, 10, 100, 1000] {
                let sliced = CpuRenderer { pair_budget, ..CpuRenderer::new() };
                let found = sliced.render(&scene, &camera, &options).unwrap();
                assert!(found == expected, "{pair_budget} pairs");
            }
        }
    }
}
