//! Which splats may touch which tile, nearest first, in bounded memory.
//!
//! The image is cut into tiles, a row of tiles is a band. Depth order is cut into slices that make at most
//! [`PAIR_BUDGET`] (tile, splat) pairs; one slice is the rule, and a picture of 1e6 Gaussians that each cover
//! 8192 x 8192 pixels takes many, one after the other. Within a slice the bands are divided among stripes: every
//! stripe scans the slice once to count and once to fill its own lists, so nothing is shared or merged.

use super::splat::PixelBounds;
use super::tile::{TILE_HEIGHT, TILE_WIDTH};
use rayon::prelude::*;

/// Pairs held at a time: 64 MiB of indices.
const PAIR_BUDGET: u64 = 1 << 24;

/// Tiles of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
}

impl Grid {
    pub(super) fn new(width: u32, height: u32) -> Self {
        Self { columns: (width as usize).div_ceil(TILE_WIDTH), rows: (height as usize).div_ceil(TILE_HEIGHT) }
    }
}

/// Columns and rows of tiles, first and last, that a splat may touch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileBounds {
    x0: u16,
    x1: u16,
    y0: u16,
    y1: u16,
}

impl TileBounds {
    fn new(b: PixelBounds) -> Self {
        const W: u16 = TILE_WIDTH as u16;
        const H: u16 = TILE_HEIGHT as u16;
        Self { x0: b.x0 / W, x1: b.x1 / W, y0: b.y0 / H, y1: b.y1 / H }
    }

    fn pairs(self) -> u64 {
        u64::from(self.x1 - self.x0 + 1) * u64::from(self.y1 - self.y0 + 1)
    }
}

/// Consecutive bands with the list of each of their tiles.
#[derive(Debug, Default)]
pub(super) struct Stripe {
    first_row: usize,
    rows: usize,
    columns: usize,
    /// Where each tile's list ends. `[rows * columns]`
    ends: Vec<u32>,
    /// Splat indices, tile after tile, nearest first.
    splats: Vec<u32>,
}

impl Stripe {
    /// The splats of the tile in column `column` of band `row` of the image, nearest first.
    pub(super) fn tile(&self, column: usize, row: usize) -> &[u32] {
        let tile = (row - self.first_row) * self.columns + column;
        let start = if tile == 0 { 0 } else { self.ends[tile - 1] };
        &self.splats[start as usize..self.ends[tile] as usize]
    }

    fn fill(&mut self, grid: Grid, first_row: usize, rows: usize, order: &[u32], bounds: &[TileBounds]) {
        (self.first_row, self.rows, self.columns) = (first_row, rows, grid.columns);
        let (top, bottom) = (first_row as u16, (first_row + rows - 1) as u16);
        self.ends.clear();
        self.ends.resize(rows * grid.columns, 0);
        let overlapping = |b: &TileBounds| b.y0 <= bottom && b.y1 >= top;
        // Rows of this stripe, as slices of `ends`.
        let tile_rows = |b: &TileBounds| b.y0.max(top) - top..=b.y1.min(bottom) - top;
        for b in bounds.iter().filter(|b| overlapping(b)) {
            for row in tile_rows(b) {
                let row = usize::from(row) * grid.columns;
                for count in &mut self.ends[row + usize::from(b.x0)..=row + usize::from(b.x1)] {
                    *count += 1;
                }
            }
        }
        // Starts now; filling moves each to its end.
        let mut total = 0;
        for count in &mut self.ends {
            total += std::mem::replace(count, total);
        }
        self.splats.resize(total as usize, 0);
        for (b, &splat) in bounds.iter().zip(order).filter(|(b, _)| overlapping(b)) {
            for row in tile_rows(b) {
                let row = usize::from(row) * grid.columns;
                for end in &mut self.ends[row + usize::from(b.x0)..=row + usize::from(b.x1)] {
                    self.splats[*end as usize] = splat;
                    *end += 1;
                }
            }
        }
    }
}

/// Tile bounds in depth order.
pub(super) fn tile_bounds(order: &[u32], pixel_bounds: &[PixelBounds], bounds: &mut Vec<TileBounds>) {
    order
        .par_iter()
        .with_min_len(1 << 12)
        .map(|&i| TileBounds::new(pixel_bounds[i as usize]))
        .collect_into_vec(bounds);
}

/// How many of the nearest splats make at most [`PAIR_BUDGET`] pairs; at least one where there is one.
pub(super) fn slice_len(bounds: &[TileBounds]) -> usize {
    let mut pairs = 0;
    let fitting = bounds.iter().position(|b| {
        pairs += b.pairs();
        pairs > PAIR_BUDGET
    });
    fitting.map_or(bounds.len(), |n| n.max(1))
}

/// Bins one slice of the depth order; `stripes` is reused from picture to picture.
pub(super) fn bin(grid: Grid, order: &[u32], bounds: &[TileBounds], stripes: &mut Vec<Stripe>) {
    // Each stripe scans everything, so no more of them than there are threads.
    let count = rayon::current_num_threads().clamp(1, grid.rows);
    stripes.resize_with(count, Stripe::default);
    stripes.par_iter_mut().enumerate().for_each(|(i, stripe)| {
        let first = i * grid.rows / count;
        let end = (i + 1) * grid.rows / count;
        stripe.fill(grid, first, end - first, order, bounds);
    });
}

/// The stripe that holds band `row`.
pub(super) fn stripe_of(stripes: &[Stripe], row: usize) -> &Stripe {
    let i = stripes.partition_point(|s| s.first_row + s.rows <= row);
    &stripes[i]
}
