//! A contact sheet: rows of pictures at half size with thin gaps, an overview of the result.

use crate::job::Result;
use std::path::Path;
use vg::io::image;

/// Space between pictures, pixels of the sheet; a line runs along its middle between rows.
const GAP: usize = 9;

/// Pixels of a picture per pixel of the sheet, each way.
const SHRINK: usize = 2;

/// Rows of white that are kept above and below the vehicles, pixels of a picture.
const MARGIN: usize = 8;

/// Levels of each channel. Fewer than 256 make the file a third smaller without a visible difference.
const LEVELS: usize = 64;

/// The line between rows.
const LINE: [u8; 3] = [208; 3];

/// A picture in 8-bit RGB on white.
pub(crate) struct Tile {
    /// Columns and rows.
    pub(crate) size: (u32, u32),
    /// In row order.
    pub(crate) pixels: Vec<[u8; 3]>,
}

/// Writes the rows, top to bottom, as one PNG. White above and below the vehicles is cut off at the same rows of all
/// pictures, so that pictures above each other can be compared.
pub(crate) fn write(path: &Path, rows: &[Vec<Tile>]) -> Result<()> {
    let tiles = || rows.iter().flatten();
    let (top, bottom) = content(tiles());
    let cell_width = (tiles().map(|t| t.size.0 as usize).max().unwrap_or(0) / SHRINK).max(1);
    let cell_height = ((bottom - top) / SHRINK).max(1);
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let (width, height) = (columns * (cell_width + GAP) - GAP, rows.len().max(1) * (cell_height + GAP) - GAP);

    let mut sheet = vec![[u8::MAX; 3]; width * height];
    for (r, row) in rows.iter().enumerate() {
        let y0 = r * (cell_height + GAP);
        if r > 0 {
            sheet[(y0 - GAP / 2 - 1) * width..][..width].fill(LINE);
        }
        for (c, tile) in row.iter().enumerate() {
            let x0 = c * (cell_width + GAP);
            let inside = (tile.size.1 as usize).min(bottom).saturating_sub(top) / SHRINK;
            for y in 0..inside {
                for x in 0..tile.size.0 as usize / SHRINK {
                    sheet[(y0 + y) * width + x0 + x] = shrunk(tile, x * SHRINK, top + y * SHRINK);
                }
            }
        }
    }
    Ok(image::write_rgb8(path, width as u32, height as u32, &sheet)?)
}

/// First row and the row after the last that is not white in some tile, with the margin.
fn content<'a>(tiles: impl Iterator<Item = &'a Tile>) -> (usize, usize) {
    let (mut top, mut bottom, mut tallest) = (usize::MAX, 0, 0);
    for tile in tiles {
        tallest = tallest.max(tile.size.1 as usize);
        for (v, row) in tile.pixels.chunks(tile.size.0.max(1) as usize).enumerate() {
            if row.iter().any(|pixel| *pixel != [u8::MAX; 3]) {
                (top, bottom) = (top.min(v), bottom.max(v + 1));
            }
        }
    }
    if bottom == 0 {
        return (0, tallest);
    }
    (top.saturating_sub(MARGIN), (bottom + MARGIN).min(tallest))
}

/// Mean of the [`SHRINK`] x [`SHRINK`] pixels from column `u0` and row `v0`, which become one pixel of the sheet.
fn shrunk(tile: &Tile, u0: usize, v0: usize) -> [u8; 3] {
    const AREA: usize = SHRINK * SHRINK;
    let level = |sum: usize| (sum * (LEVELS - 1) * 2 + AREA * 255) / (2 * AREA * 255);
    std::array::from_fn(|c| {
        let pixel = |i: usize| {
            let (u, v) = (u0 + i % SHRINK, v0 + i / SHRINK);
            usize::from(tile.pixels[v * tile.size.0 as usize + u][c])
        };
        (level((0..AREA).map(pixel).sum()) * 255 / (LEVELS - 1)) as u8
    })
}
