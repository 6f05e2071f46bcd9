//! Lists of the splats that may touch each tile, nearest first, in bounded memory.
//!
//! The image is cut into tiles; a row of tiles is a band. The depth order is cut into slices of at most [`PAIR_BUDGET`]
//! (tile, splat) pairs. One slice is the normal case; a picture of 1e6 Gaussians that each cover 8192 x 8192 pixels
//! takes many, one after the other. Within a slice the bands are divided among stripes: every stripe scans the slice
//! once to count and once to fill its own lists, so nothing is shared or merged.

use super::splat::PixelBounds;
use super::tile::{BLOCK, TILE_HEIGHT, TILE_WIDTH};
use rayon::prelude::*;
use std::ops::Range;

/// Maximum number of pairs held at a time: 128 MiB of entries.
pub(super) const PAIR_BUDGET: u64 = 1 << 24;

/// The tiles of an image.
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

/// A rectangle of tiles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
}

impl Grid {
    /// All tiles.
    pub(super) fn window(self) -> Window {
        Window { columns: 0..self.columns, rows: 0..self.rows }
    }
}

/// One splat in one tile: its index, and the rows and blocks of the tile that it may touch. The entry alone is enough
/// to skip splats behind a finished part of the picture, without fetching them from memory.
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

    /// The blocks of a row, one bit each.
    #[inline(always)]
    pub(super) fn blocks(self) -> u32 {
        (2u32 << ((self.0 >> 12) & 7)) - (1u32 << ((self.0 >> 8) & 7))
    }
}

/// Columns of tiles that contain the pixels.
fn tile_columns(b: &PixelBounds) -> Range<usize> {
    usize::from(b.x0) / TILE_WIDTH..usize::from(b.x1) / TILE_WIDTH + 1
}

fn intersection(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    a.start.max(b.start)..a.end.min(b.end)
}

/// Rows of tiles that contain the pixels.
fn tile_rows(b: &PixelBounds) -> Range<usize> {
    usize::from(b.y0) / TILE_HEIGHT..usize::from(b.y1) / TILE_HEIGHT + 1
}

/// Number of (tile, splat) pairs of one splat.
fn pairs(b: &PixelBounds) -> u64 {
    (tile_columns(b).len() * tile_rows(b).len()) as u64
}

/// Consecutive bands with the lists of their tiles.
#[derive(Debug, Default)]
pub(super) struct Stripe {
    columns: Range<usize>,
    rows: Range<usize>,
    /// End of each tile's list in `entries`. `[rows * columns]`
    end_from_tile: Vec<u32>,
    /// Lists of all tiles, one after the other, nearest first.
    entries: Vec<Entry>,
}

impl Stripe {
    /// The splats of the tile in column `column` of band `row` of the image, nearest first.
    pub(super) fn tile(&self, column: usize, row: usize) -> &[Entry] {
        let tile = (row - self.rows.start) * self.columns.len() + (column - self.columns.start);
        let start = if tile == 0 { 0 } else { self.end_from_tile[tile - 1] };
        &self.entries[start as usize..self.end_from_tile[tile] as usize]
    }

    fn fill(&mut self, window: Window, splat_from_rank: &[u32], bounds: &[PixelBounds]) {
        let Window { columns, rows } = window;
        // Tile (row, column) is number `row * width + column - first`.
        let width = columns.len();
        let first = rows.start * width + columns.start;
        self.end_from_tile.clear();
        self.end_from_tile.resize(rows.len() * width, 0);
        for b in bounds {
            let own_columns = intersection(&tile_columns(b), &columns);
            for row in intersection(&tile_rows(b), &rows) {
                for column in own_columns.clone() {
                    self.end_from_tile[row * width + column - first] += 1;
                }
            }
        }
        // The counts become starts; filling moves each to its end.
        let mut total = 0;
        for count in &mut self.end_from_tile {
            total += std::mem::replace(count, total);
        }
        self.entries.resize(total as usize, Entry::default());
        for (b, &splat) in bounds.iter().zip(splat_from_rank) {
            let own_columns = intersection(&tile_columns(b), &columns);
            for row in intersection(&tile_rows(b), &rows) {
                for column in own_columns.clone() {
                    let end = &mut self.end_from_tile[row * width + column - first];
                    self.entries[*end as usize] =
                        Entry::new(splat, *b, column * TILE_WIDTH, row * TILE_HEIGHT);
                    *end += 1;
                }
            }
        }
        (self.columns, self.rows) = (columns, rows);
    }
}

/// Sorts the splats' bounds by depth rank.
pub(super) fn bounds_in_order(
    splat_from_rank: &[u32],
    bounds: &[PixelBounds],
    sorted: &mut Vec<PixelBounds>,
) {
    splat_from_rank.par_iter().with_min_len(1 << 12).map(|&i| bounds[i as usize]).collect_into_vec(sorted);
}

/// Number of nearest splats that make at most `budget` pairs; at least one where there is one.
pub(super) fn slice_len(bounds: &[PixelBounds], budget: u64) -> usize {
    let mut total = 0;
    let fitting = bounds.iter().position(|b| {
        total += pairs(b);
        total > budget
    });
    fitting.map_or(bounds.len(), |n| n.max(1))
}

/// Cuts the picture, row by row, into windows of at most `budget` pairs each, or of one tile.
pub(super) fn windows(grid: Grid, bounds: &[PixelBounds], budget: u64) -> Vec<Window> {
    // Pairs in each band: added where a splat begins, subtracted after it ends.
    let mut steps = vec![0i64; grid.rows + 1];
    for b in bounds {
        let (columns, rows) = (tile_columns(b).len() as i64, tile_rows(b));
        steps[rows.start] += columns;
        steps[rows.end] -= columns;
    }
    let mut windows: Vec<Window> = Vec::new();
    let (mut in_band, mut in_window) = (0, 0);
    for row in 0..grid.rows {
        in_band += steps[row];
        let pairs = in_band as u64;
        if pairs > budget {
            windows.extend(windows_of_band(grid, bounds, budget, row));
            // No band may join this window.
            in_window = budget + 1;
        } else if let Some(last) = windows.last_mut().filter(|_| in_window + pairs <= budget) {
            last.rows.end = row + 1;
            in_window += pairs;
        } else {
            windows.push(Window { columns: 0..grid.columns, rows: row..row + 1 });
            in_window = pairs;
        }
    }
    windows
}

fn windows_of_band(grid: Grid, bounds: &[PixelBounds], budget: u64, row: usize) -> Vec<Window> {
    let mut steps = vec![0i64; grid.columns + 1];
    for b in bounds.iter().filter(|b| tile_rows(b).contains(&row)) {
        let columns = tile_columns(b);
        steps[columns.start] += 1;
        steps[columns.end] -= 1;
    }
    let mut windows: Vec<Window> = Vec::new();
    let (mut in_tile, mut in_window) = (0, 0);
    for column in 0..grid.columns {
        in_tile += steps[column];
        let pairs = in_tile as u64;
        match windows.last_mut() {
            Some(last) if in_window + pairs <= budget => {
                last.columns.end = column + 1;
                in_window += pairs;
            }
            _ => {
                windows.push(Window { columns: column..column + 1, rows: row..row + 1 });
                in_window = pairs;
            }
        }
    }
    windows
}

/// Bins one slice of the depth order, or one window of the whole order; `stripes` is reused from picture to picture.
pub(super) fn bin(
    window: &Window,
    splat_from_rank: &[u32],
    bounds: &[PixelBounds],
    stripes: &mut Vec<Stripe>,
) {
    // Each stripe scans everything, so no more of them than there are threads.
    let rows = window.rows.len();
    let count = rayon::current_num_threads().clamp(1, rows);
    stripes.resize_with(count, Stripe::default);
    stripes.par_iter_mut().enumerate().for_each(|(i, stripe)| {
        let own = window.rows.start + i * rows / count..window.rows.start + (i + 1) * rows / count;
        stripe.fill(Window { columns: window.columns.clone(), rows: own }, splat_from_rank, bounds);
    });
}

/// The stripe that contains band `row`.
pub(super) fn stripe_with_row(stripes: &[Stripe], row: usize) -> &Stripe {
    let i = stripes.partition_point(|s| s.rows.end <= row);
    &stripes[i]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_hold_every_tile_once_in_order_and_no_more_pairs_than_allowed() {
        let grid = Grid::new(300, 100);
        let at = |i: usize, k: usize, n: usize| ((i * 7919 + k * 104_729) % 1009 % n) as u16;
        let bounds: Vec<PixelBounds> = (0..500)
            .map(|i| {
                let (x0, y0) = (at(i, 0, 300), at(i, 1, 100));
                let (x1, y1) = ((x0 + at(i, 2, 150)).min(299), (y0 + at(i, 3, 40)).min(99));
                PixelBounds { x0, x1, y0, y1 }
            })
            .collect();
        let mut pairs = vec![0; grid.rows * grid.columns];
        for b in &bounds {
            for row in tile_rows(b) {
                tile_columns(b).for_each(|column| pairs[row * grid.columns + column] += 1);
            }
        }
        for budget in [1, 100, 400, 1000, 5000, 1_000_000] {
            let windows = windows(grid, &bounds, budget);
            let mut seen = Vec::new();
            for Window { columns, rows } in windows {
                let before = seen.len();
                rows.for_each(|r| seen.extend(columns.clone().map(|c| r * grid.columns + c)));
                let held: u64 = seen[before..].iter().map(|&tile| pairs[tile]).sum();
                assert!(held <= budget || seen.len() == before + 1, "{held} of {budget}");
            }
            assert_eq!(seen, (0..pairs.len()).collect::<Vec<usize>>(), "{budget}");
        }
    }
}
