//! A contact sheet: rows of pictures at half size with thin gaps, to see at a glance what was made.

use crate::job::Result;
use std::path::Path;
use vg::io::image;

/// White between pictures, pixels.
const GAP: usize = 6;

/// Full-size pixels per pixel of the sheet, each way.
const SHRINK: usize = 2;

/// A picture in 8-bit RGB.
pub(crate) struct Tile {
    /// Columns and rows.
    pub(crate) size: (u32, u32),
    /// In row order.
    pub(crate) pixels: Vec<[u8; 3]>,
}

/// Writes the rows, top to bottom, as one PNG. Pictures keep their place in a grid of the largest.
pub(crate) fn write(path: &Path, rows: &[Vec<Tile>]) -> Result<()> {
    let tiles = || rows.iter().flatten();
    let largest = |side: fn(&Tile) -> u32| tiles().map(side).max().unwrap_or(1) as usize / SHRINK;
    let (cell_width, cell_height) = (largest(|t| t.size.0).max(1), largest(|t| t.size.1).max(1));
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let width = columns * (cell_width + GAP) - GAP;
    let height = rows.len().max(1) * (cell_height + GAP) - GAP;
    let mut sheet = vec![[255u8; 3]; width * height];
    for (r, row) in rows.iter().enumerate() {
        for (c, tile) in row.iter().enumerate() {
            let (x0, y0) = (c * (cell_width + GAP), r * (cell_height + GAP));
            for y in 0..tile.size.1 as usize / SHRINK {
                for x in 0..tile.size.0 as usize / SHRINK {
                    sheet[(y0 + y) * width + x0 + x] = shrunk(tile, x, y);
                }
            }
        }
    }
    Ok(image::write_rgb8(path, width as u32, height as u32, &sheet)?)
}

/// Mean of the pixels that one pixel of the sheet stands for.
fn shrunk(tile: &Tile, x: usize, y: usize) -> [u8; 3] {
    const AREA: usize = SHRINK * SHRINK;
    std::array::from_fn(|c| {
        let pixel = |i: usize| {
            let (u, v) = (x * SHRINK + i % SHRINK, y * SHRINK + i / SHRINK);
            usize::from(tile.pixels[v * tile.size.0 as usize + u][c])
        };
        (((0..AREA).map(pixel).sum::<usize>() + AREA / 2) / AREA) as u8
    })
}
