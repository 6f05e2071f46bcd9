//! Which splats may touch which tile, nearest first, in bounded memory.
//!
//! The image is cut into tiles, a row of tiles is a band. Depth order is cut into slices that make at most
//! [`PAIR_BUDGET`] (tile, splat) pairs; one slice is the rule, and a picture of 1e6 Gaussians that each cover
//! 8192 x 8192 pixels takes many, one after the other. Within a slice the bands are divided among stripes: every
//! stripe scans the slice once to count and once to fill its own lists, so nothing is shared or merged.

use super::splat::PixelBounds;
use super::tile::{BLOCK, TILE_HEIGHT, TILE_WIDTH};
use rayon::prelude::*;
use std::ops::Range;

/// Pairs held at a time: 128 MiB of entries.
pub(super) const PAIR_BUDGET: u64 = 1 << 24;

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

/// One splat in one tile: its index, and the rows and blocks of the tile that it may touch. Splats behind a
/// finished part of the picture are told by the entry alone, without fetching them from memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Entry(u64);

impl Entry {
    fn new(splat: u32, b: PixelBounds, left: usize, top: usize) -> Self {
        let row = |y: u16| usize::from(y).saturating_sub(top).min(TILE_HEIGHT - 1) as u64;
        let block = |x: u16| (usize::from(x).saturating_sub(left).min(TILE_WIDTH - 1) / BLOCK) as u64;
        let touched = row(b.y0) | row(b.y1) << 4 | block(b.x0) << 8 | block(b.x1) << 12;
        Self(u64::from(splat) << 32 | touched)
    }

    /// Index of the splat.
    #[inline(always)]
    pub(super) fn splat(self) -> usize {
        (self.0 >> 32) as usize
    }

    /// First and last row of the tile.
    #[inline(always)]
    pub(super) fn rows(self) -> [usize; 2] {
        [self.0 as usize & 15, (self.0 >> 4) as usize & 15]
    }

    /// One bit per block of a row.
    #[inline(always)]
    pub(super) fn blocks(self) -> u32 {
        (2u32 << ((self.0 >> 12) & 7)) - (1u32 << ((self.0 >> 8) & 7))
    }
}

/// Columns, then rows, of tiles that pixels lie in.
fn tile_columns(b: &PixelBounds) -> Range<usize> {
    usize::from(b.x0) / TILE_WIDTH..usize::from(b.x1) / TILE_WIDTH + 1
}

fn tile_rows(b: &PixelBounds) -> Range<usize> {
    usize::from(b.y0) / TILE_HEIGHT..usize::from(b.y1) / TILE_HEIGHT + 1
}

fn pairs(b: &PixelBounds) -> u64 {
    (tile_columns(b).len() * tile_rows(b).len()) as u64
}

/// Consecutive bands with the list of each of their tiles.
#[derive(Debug, Default)]
pub(super) struct Stripe {
    first_row: usize,
    rows: usize,
    columns: usize,
    /// Where each tile's list ends. `[rows * columns]`
    ends: Vec<u32>,
    /// Tile after tile, nearest first.
    entries: Vec<Entry>,
}

impl Stripe {
    /// The splats of the tile in column `column` of band `row` of the image, nearest first.
    pub(super) fn tile(&self, column: usize, row: usize) -> &[Entry] {
        let tile = (row - self.first_row) * self.columns + column;
        let start = if tile == 0 { 0 } else { self.ends[tile - 1] };
        &self.entries[start as usize..self.ends[tile] as usize]
    }

    fn fill(&mut self, grid: Grid, first_row: usize, rows: usize, order: &[u32], bounds: &[PixelBounds]) {
        (self.first_row, self.rows, self.columns) = (first_row, rows, grid.columns);
        let own_rows = |b: &PixelBounds| {
            let all = tile_rows(b);
            all.start.max(first_row)..all.end.min(first_row + rows)
        };
        self.ends.clear();
        self.ends.resize(rows * grid.columns, 0);
        for b in bounds {
            for row in own_rows(b) {
                for column in tile_columns(b) {
                    self.ends[(row - first_row) * grid.columns + column] += 1;
                }
            }
        }
        // Starts now; filling moves each to its end.
        let mut total = 0;
        for count in &mut self.ends {
            total += std::mem::replace(count, total);
        }
        self.entries.resize(total as usize, Entry::default());
        for (b, &splat) in bounds.iter().zip(order) {
            for row in own_rows(b) {
                for column in tile_columns(b) {
                    let end = &mut self.ends[(row - first_row) * grid.columns + column];
                    self.entries[*end as usize] =
                        Entry::new(splat, *b, column * TILE_WIDTH, row * TILE_HEIGHT);
                    *end += 1;
                }
            }
        }
    }
}

/// The splats' bounds in depth order.
pub(super) fn bounds_in_order(order: &[u32], bounds: &[PixelBounds], sorted: &mut Vec<PixelBounds>) {
    order.par_iter().with_min_len(1 << 12).map(|&i| bounds[i as usize]).collect_into_vec(sorted);
}

/// How many of the nearest splats make at most `budget` pairs; at least one where there is one.
pub(super) fn slice_len(bounds: &[PixelBounds], budget: u64) -> usize {
    let mut total = 0;
    let fitting = bounds.iter().position(|b| {
        total += pairs(b);
        total > budget
    });
    fitting.map_or(bounds.len(), |n| n.max(1))
}

/// Bins one slice of the depth order; `stripes` is reused from picture to picture.
pub(super) fn bin(grid: Grid, order: &[u32], bounds: &[PixelBounds], stripes: &mut Vec<Stripe>) {
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
