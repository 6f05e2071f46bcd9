//! Record of everything drawn in a tile: the blend writes it front to back, and the backward pass reads it back to
//! front, so that it has the exact transmittances and never divides by 1 - alpha.
//!
//! Its size is bounded for any scene. A pixel draws at most 2,344 layers: each leaves at most 254/255 of the
//! transmittance, which stops at 1e-4. A record holds eight pixels, of which at least one draws: at most 18,752 records
//! per block and 156 MB per tile, and 20 MB where neighbouring pixels draw the same layers.

use super::super::blend::Record;
use super::super::simd::Lanes;
use super::super::tile::{BLOCKS, TILE_HEIGHT};
use pulp::f32x8;

/// Maximum number of blocks drawn between two calls of [`Record::rows`].
const MOST_PER_CALL: usize = 64;

/// Eight pixels of one splat.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Drawn {
    /// Alpha, 0 in lanes that drew nothing.
    pub(super) alpha: f32x8,
    /// Transmittance before drawing; of either sign where nothing was drawn.
    pub(super) transmittance: f32x8,
}

/// A splat that drew.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Layer {
    /// Index of the splat.
    pub(super) splat: u32,
    /// End of its records; they begin at the end of the previous layer.
    pub(super) end: u32,
}

/// One tile's tape, reused from tile to tile.
#[derive(Debug)]
pub(super) struct Tape {
    /// Records, of which the first `len` are in use.
    drawn: Vec<Drawn>,
    /// Block of the tile of each record.
    blocks: Vec<u8>,
    len: usize,
    layers: Vec<Layer>,
    /// Sum of T alpha of each block. It is alpha without the cancellation of 1 - T, which loses 1.5e-5 of 1/255.
    covered: [f32x8; BLOCKS * TILE_HEIGHT],
}

const ZERO: f32x8 = f32x8(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

impl Tape {
    pub(super) fn new() -> Self {
        Self {
            drawn: Vec::new(),
            blocks: Vec::new(),
            len: 0,
            layers: Vec::new(),
            covered: [ZERO; BLOCKS * TILE_HEIGHT],
        }
    }

    pub(super) fn clear(&mut self) {
        self.len = 0;
        self.layers.clear();
        self.covered.fill(ZERO);
    }

    /// Alpha of each block's pixels.
    pub(super) fn covered(&self) -> &[f32x8; BLOCKS * TILE_HEIGHT] {
        &self.covered
    }

    pub(super) fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Records of layer `i`, and their blocks.
    #[inline(always)]
    pub(super) fn records(&self, i: usize) -> (&[Drawn], &[u8]) {
        let start = if i == 0 { 0 } else { self.layers[i - 1].end as usize };
        let end = self.layers[i].end as usize;
        (&self.drawn[start..end], &self.blocks[start..end])
    }
}

impl Record for Tape {
    const COLOR: bool = false;

    #[inline(always)]
    fn rows(&mut self) {
        let needed = self.len + MOST_PER_CALL;
        if needed > self.drawn.len() {
            let size = needed.max(2 * self.drawn.len());
            self.drawn.resize(size, Drawn { alpha: ZERO, transmittance: ZERO });
            self.blocks.resize(size, 0);
        }
    }

    #[inline(always)]
    fn block<S: Lanes>(&mut self, simd: S, block: usize, alpha: f32x8, t: f32x8) {
        self.covered[block] = simd.mul_add(alpha, t, self.covered[block]);
        // Always written, but kept only where a lane drew: no branch to mispredict.
        self.drawn[self.len] = Drawn { alpha, transmittance: t };
        self.blocks[self.len] = block as u8;
        let any = simd.sign_bits(simd.sub_f32s(simd.splat_f32s(0.0), alpha)) != 0;
        self.len += usize::from(any);
    }

    #[inline(always)]
    fn splat(&mut self, splat: usize) {
        let end = self.len as u32;
        if self.layers.last().map_or(0, |l| l.end) < end {
            self.layers.push(Layer { splat: splat as u32, end });
        }
    }
}
