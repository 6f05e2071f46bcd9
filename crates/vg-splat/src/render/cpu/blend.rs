//! Front-to-back blending of one tile (method section 5): every splat visits the rows of its own ellipse.
//!
//! On a row at height dy the pixels with alpha >= 1/255 lie within
//! `center_slope dy +- sqrt((q_max - row dy^2) inverse_column)` of the centre, with the exponent completed to a square
//! in x (see [`Splat`]). Only the blocks of eight pixels that this interval touches and that still have an unfinished
//! pixel are evaluated: for a car of 1 cm splats, 25 times fewer than with 16 x 16 tiles.

use super::bin::Entry;
use super::simd::{self, Lanes};
use super::splat::Splat;
use super::tile::{BLOCK, BLOCKS, Block, TILE_WIDTH, Tile};
use crate::render::options::{ALPHA_THRESHOLD, TRANSMITTANCE_THRESHOLD};
use pulp::f32x8;

/// Splats fetched at a time, so that their cache misses overlap.
const BATCH: usize = 32;

/// Receiver of everything that is drawn, in order, for the backward pass.
pub(super) trait Record {
    /// Whether the tile's colour is computed; its transmittance and depth always are.
    const COLOR: bool;

    /// Announces eight rows of a splat: at most 64 blocks.
    fn rows(&mut self);

    /// Records that block `block` of the tile had transmittance `t` (negative: finished) before `alpha` was drawn on
    /// it, which is 0 in lanes that drew nothing.
    fn block<S: Lanes>(&mut self, simd: S, block: usize, alpha: f32x8, t: f32x8);

    /// Records that splat `splat` is complete.
    fn splat(&mut self, splat: usize);
}

/// Records nothing: the picture alone needs no record.
pub(super) struct NoRecord;

impl Record for NoRecord {
    const COLOR: bool = true;

    #[inline(always)]
    fn rows(&mut self) {}

    #[inline(always)]
    fn block<S: Lanes>(&mut self, _: S, _: usize, _: f32x8, _: f32x8) {}

    #[inline(always)]
    fn splat(&mut self, _: usize) {}
}

/// Blends the splats of `tile_entries`, nearest first, into the tile whose first pixel is `origin`.
#[inline(always)]
pub(super) fn blend<S: Lanes, R: Record>(
    simd: S,
    tile: &mut Tile,
    origin: [usize; 2],
    tile_entries: &[Entry],
    splats: &[Splat],
    max_alpha: f32,
    record: &mut R,
) {
    let place = Place { origin, x: block_centers(origin[0]) };
    let mut visible = [Entry::default(); BATCH];
    let mut splat_from_visible = [Splat::default(); BATCH];
    for batch in tile_entries.chunks(BATCH) {
        if !tile.is_live() {
            return;
        }
        let mut count = 0;
        for &entry in batch {
            visible[count] = entry;
            count += usize::from(is_visible(tile, entry));
        }
        // The loop does not depend on the fetched values, so cache misses overlap.
        for (splat, entry) in splat_from_visible.iter_mut().zip(&visible[..count]) {
            *splat = splats[entry.splat()];
        }
        for (entry, splat) in visible[..count].iter().zip(&splat_from_visible) {
            blend_splat(simd, tile, &place, *entry, splat, max_alpha, record);
            record.splat(entry.splat());
        }
    }
}

/// Where a tile lies in the picture.
struct Place {
    /// Column and row of its first pixel.
    origin: [usize; 2],
    /// x of the pixel centres of each block.
    x: [f32x8; BLOCKS],
}

/// Whether the splat may touch an unfinished pixel.
#[inline(always)]
fn is_visible(tile: &Tile, entry: Entry) -> bool {
    let [first, last] = entry.rows();
    let mut live = 0;
    for row in &tile.live[first..=last] {
        live |= row;
    }
    u32::from(live) & entry.blocks() != 0
}

/// The exponent on one row: -q = conditional t^2 + (along_x dx^2 + constant), t = slope_x dx + offset.
struct Rows {
    /// Blocks that the ellipse touches: bit b of byte r is block b of row r.
    blocks: u64,
    offset: [f32; BLOCK],
    constant: [f32; BLOCK],
}

/// Coefficients shared by all [`Rows`] of one splat.
struct Footprint {
    center: [f32x8; 2],
    center_rest: [f32x8; 2],
    /// Factors of -q, see [`Rows`].
    conditional: f32x8,
    along_x: f32x8,
    slope_x: f32x8,
    /// `offset = slope_y dy`, `constant = along_y dy^2`.
    slope_y: f32x8,
    along_y: f32x8,
    /// The completed square in x: `column`'s inverse, `row`, and the slope of its centre line.
    inverse_column: f32x8,
    row: f32x8,
    center_slope: f32x8,
    q_max: f32x8,
}

#[inline(always)]
fn blend_splat<S: Lanes, R: Record>(
    simd: S,
    tile: &mut Tile,
    Place { origin: [left, top], x }: &Place,
    entry: Entry,
    splat: &Splat,
    max_alpha: f32,
    record: &mut R,
) {
    let (left, top) = (*left, *top);
    let [first_row, last_row] = entry.rows();
    let footprint = Footprint::new(simd, splat);
    let [red, green, blue] = splat.color;
    let color = [simd.splat_f32s(red), simd.splat_f32s(green), simd.splat_f32s(blue)];
    let depth = simd.splat_f32s(splat.depth);
    let opacity = simd.splat_f32s(splat.opacity);
    let max_alpha = simd.splat_f32s(max_alpha);
    // The entry's blocks, repeated for each of eight rows.
    let columns = u64::from(entry.blocks()) * 0x0101_0101_0101_0101;
    for row in (first_row..=last_row).step_by(BLOCK) {
        record.rows();
        let rows = footprint.rows(simd, left, top + row);
        let mut live = [0; BLOCK];
        live.copy_from_slice(&tile.live[row..row + BLOCK]);
        // One loop over all blocks of eight rows: its end is mispredicted once, not once per row.
        let mut blocks = rows.blocks & columns & u64::from_le_bytes(live);
        while blocks != 0 {
            let block_in_rows = blocks.trailing_zeros() as usize;
            blocks &= blocks - 1;
            let block_in_tile = row * BLOCKS + block_in_rows;
            let (row_in_rows, column) = (block_in_rows / BLOCKS, block_in_rows % BLOCKS);
            let offset = simd.splat_f32s(rows.offset[row_in_rows]);
            let constant = simd.splat_f32s(rows.constant[row_in_rows]);
            let exponent = footprint.exponent(simd, x[column], offset, constant);
            let alpha = simd.mul_f32s(opacity, simd::exp2(simd, exponent));
            let alpha = simd.min_f32s(alpha, max_alpha);
            let block = &mut tile.blocks[block_in_tile];
            let t = block.transmittance;
            let drawn = composite::<S, R>(simd, block, alpha, color, depth);
            record.block(simd, block_in_tile, drawn, t);
            if simd.sign_bits(block.transmittance) == 0xff {
                tile.live[row + row_in_rows] &= !(1 << column);
            }
        }
    }
}

/// x coordinates of the pixel centres of each block of a tile that begins at column `left`.
#[inline(always)]
pub(super) fn block_centers(left: usize) -> [f32x8; BLOCKS] {
    let mut x = [pixel_centers(left); BLOCKS];
    for (column, x) in x.iter_mut().enumerate() {
        *x = pixel_centers(left + column * BLOCK);
    }
    x
}

/// x coordinates of the centres of eight pixels.
#[inline(always)]
fn pixel_centers(left: usize) -> f32x8 {
    let x = left as f32 + 0.5;
    f32x8(x, x + 1.0, x + 2.0, x + 3.0, x + 4.0, x + 5.0, x + 6.0, x + 7.0)
}

impl Footprint {
    #[inline(always)]
    fn new<S: Lanes>(simd: S, s: &Splat) -> Self {
        let pivot_x = s.conditional < 0.0;
        let conditional = s.conditional.abs();
        let (slope_x, slope_y) = if pivot_x { (-s.slope, 1.0) } else { (1.0, -s.slope) };
        let (along_x, along_y) = if pivot_x { (-s.marginal, 0.0) } else { (0.0, -s.marginal) };
        Self {
            center: [simd.splat_f32s(s.center[0]), simd.splat_f32s(s.center[1])],
            center_rest: [simd.splat_f32s(s.center_rest[0]), simd.splat_f32s(s.center_rest[1])],
            conditional: simd.splat_f32s(-conditional),
            along_x: simd.splat_f32s(along_x),
            slope_x: simd.splat_f32s(slope_x),
            slope_y: simd.splat_f32s(slope_y),
            along_y: simd.splat_f32s(along_y),
            inverse_column: simd.splat_f32s(s.inverse_column),
            row: simd.splat_f32s(s.row),
            center_slope: simd.splat_f32s(s.center_slope),
            q_max: simd.splat_f32s(s.q_max),
        }
    }

    /// Evaluates eight rows from image row `top` on, of a tile that begins at column `left`.
    #[inline(always)]
    fn rows<S: Lanes>(&self, simd: S, left: usize, top: usize) -> Rows {
        let dy = simd.sub_f32s(simd.sub_f32s(pixel_centers(top), self.center[1]), self.center_rest[1]);
        let dy2 = simd.mul_f32s(dy, dy);
        let zero = simd.splat_f32s(0.0);

        // Interval of x in tile pixels; a pixel centre at x covers [x, x + 1) in block arithmetic.
        let rest = simd.sub_f32s(self.q_max, simd.mul_f32s(self.row, dy2));
        let half = simd.sqrt_f32s(simd.mul_f32s(simd.max_f32s(rest, zero), self.inverse_column));
        let center = simd.sub_f32s(self.center[0], simd.splat_f32s(left as f32 + 0.5));
        let center = simd.add_f32s(center, self.center_rest[0]);
        let center = simd.mul_add(self.center_slope, dy, center);
        // A generous bound of the rounding above; excess pixels are rejected by alpha < 1/255.
        let magnitude = simd.add_f32s(simd.max_f32s(center, simd.sub_f32s(zero, center)), half);
        let slack = simd.mul_add(magnitude, simd.splat_f32s(1e-6), simd.splat_f32s(0.01));
        let half = simd.add_f32s(half, slack);
        let low = simd.sub_f32s(center, half);
        let high = simd.add_f32s(center, half);
        let last = simd.splat_f32s((TILE_WIDTH - 1) as f32);
        let touched = simd.and_m32s(
            simd.greater_than_or_equal_f32s(rest, zero),
            simd.and_m32s(
                simd.less_than_or_equal_f32s(low, last),
                simd.greater_than_or_equal_f32s(high, zero),
            ),
        );
        let low = simd.max_f32s(low, zero);
        let high = simd.min_f32s(high, last);
        // Bits `low / 8` to `high / 8` of a block mask.
        let two = simd.wrapping_dyn_shl_u32s(simd.splat_u32s(2), block_of(simd, high));
        let one = simd.wrapping_dyn_shl_u32s(simd.splat_u32s(1), block_of(simd, low));
        let blocks = simd.select_u32s(touched, simd.sub_u32s(two, one), simd.splat_u32s(0));

        Rows {
            blocks: simd.low_bytes(blocks),
            offset: pulp::cast(simd.mul_f32s(self.slope_y, dy)),
            constant: pulp::cast(simd.mul_f32s(self.along_y, dy2)),
        }
    }

    /// -q at eight pixels.
    #[inline(always)]
    fn exponent<S: Lanes>(&self, simd: S, x: f32x8, offset: f32x8, constant: f32x8) -> f32x8 {
        let dx = simd.sub_f32s(simd.sub_f32s(x, self.center[0]), self.center_rest[0]);
        let t = simd.mul_add(self.slope_x, dx, offset);
        let rest = simd.mul_add(self.along_x, simd.mul_f32s(dx, dx), constant);
        simd.mul_add(self.conditional, simd.mul_f32s(t, t), rest)
    }
}

/// floor(x / 8) for x in [0, 64), as an integer; an exact multiple of 8 may round to the block before it.
#[inline(always)]
fn block_of<S: Lanes>(simd: S, x: f32x8) -> pulp::u32x8 {
    const ROUND: f32 = 8_388_608.0; // 2^23: its last mantissa bit is 1
    let eighth = simd.mul_add(x, simd.splat_f32s(1.0 / BLOCK as f32), simd.splat_f32s(-0.5));
    let rounded = simd.add_f32s(simd.max_f32s(eighth, simd.splat_f32s(0.0)), simd.splat_f32s(ROUND));
    simd.and_u32s(simd.transmute_u32s_f32s(rounded), simd.splat_u32s(BLOCKS as u32 - 1))
}

/// C += T alpha colour, D += T alpha z, T *= 1 - alpha where alpha is large enough and does not finish the pixel.
/// Returns alpha where it was drawn, else 0.
#[inline(always)]
fn composite<S: Lanes, R: Record>(
    simd: S,
    block: &mut Block,
    alpha: f32x8,
    color: [f32x8; 3],
    depth: f32x8,
) -> f32x8 {
    let t = block.transmittance;
    let next = simd.mul_f32s(t, simd.sub_f32s(simd.splat_f32s(1.0), alpha));
    // False for NaN, which an overflowed exponent may produce.
    let counts = simd.greater_than_or_equal_f32s(alpha, simd.splat_f32s(ALPHA_THRESHOLD));
    // A finished pixel's transmittance is negative, so its next one is too.
    let open = simd.greater_than_f32s(next, simd.splat_f32s(TRANSMITTANCE_THRESHOLD));
    let drawn = simd.and_m32s(counts, open);

    // For the picture the weight is the decrease of T: it sums exactly to the 1 - T by which depth is divided, T alpha
    // only up to rounding.
    let weight = if R::COLOR { simd.sub_f32s(t, next) } else { simd.mul_f32s(t, alpha) };
    let weight = simd.select_f32s(drawn, weight, simd.splat_f32s(0.0));
    if R::COLOR {
        for c in 0..3 {
            block.color[c] = simd.mul_add(weight, color[c], block.color[c]);
        }
    }
    block.depth = simd.mul_add(weight, depth, block.depth);
    let closed = simd.select_f32s(counts, simd.or_f32s(t, simd.splat_f32s(-0.0)), t);
    block.transmittance = simd.select_f32s(drawn, next, closed);
    simd.select_f32s(drawn, alpha, simd.splat_f32s(0.0))
}
