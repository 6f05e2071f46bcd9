//! A tile of the picture while it is being blended: 20 KiB, so that it stays in L1.

use crate::render::{Background, DepthMode, RenderOptions};
use pulp::f32x8;

/// Pixels in one vector.
pub(super) const BLOCK: usize = 8;
/// Vectors in a row of a tile.
pub(super) const BLOCKS: usize = 8;
/// Columns of a tile.
pub(super) const TILE_WIDTH: usize = BLOCK * BLOCKS;
/// Rows of a tile. 64 x 16 pixels of 20 bytes leave half of a 48 KiB L1 for the splats.
pub(super) const TILE_HEIGHT: usize = 16;

/// Eight neighbouring pixels of one row.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Block {
    /// Transmittance; negative where the pixel is finished.
    pub(super) transmittance: f32x8,
    /// Sum of T alpha colour.
    pub(super) color: [f32x8; 3],
    /// Sum of T alpha z.
    pub(super) depth: f32x8,
}

const ZERO: f32x8 = f32x8(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

/// Transmittance, colour and depth of 64 x 16 pixels.
#[derive(Debug)]
pub(super) struct Tile {
    /// Row by row.
    pub(super) blocks: [Block; BLOCKS * TILE_HEIGHT],
    /// Bit b of entry r: block b of row r has an unfinished pixel. Eight rows beyond the last are never live, so that
    /// eight can be read from any row on.
    pub(super) live: [u8; TILE_HEIGHT + 8],
}

/// One tile's rows in the picture's planes.
pub(super) struct Planes<'a> {
    /// Rows of one band, `width` pixels each.
    pub(super) color: &'a mut [[f32; 3]],
    pub(super) alpha: &'a mut [f32],
    pub(super) depth: &'a mut [f32],
    pub(super) width: usize,
}

impl Planes<'_> {
    fn rows(&self) -> usize {
        self.alpha.len() / self.width
    }

    fn columns(&self, x0: usize) -> usize {
        (self.width - x0).min(TILE_WIDTH)
    }
}

impl Tile {
    pub(super) fn new() -> Self {
        let block = Block { transmittance: ZERO, color: [ZERO; 3], depth: ZERO };
        Self { blocks: [block; BLOCKS * TILE_HEIGHT], live: [0; TILE_HEIGHT + 8] }
    }

    /// Resets the tile to nothing drawn. Pixels outside the picture count as finished.
    pub(super) fn clear(&mut self, planes: &Planes, x0: usize) {
        self.clear_part(planes.columns(x0), planes.rows());
    }

    /// Resets the first `columns` and `rows` to nothing drawn; pixels beyond them count as finished.
    pub(super) fn clear_part(&mut self, columns: usize, rows: usize) {
        for (r, row) in self.blocks.chunks_exact_mut(BLOCKS).enumerate() {
            let mut live = 0;
            for (b, block) in row.iter_mut().enumerate() {
                let inside = if r < rows { columns.saturating_sub(b * BLOCK).min(BLOCK) } else { 0 };
                let t: [f32; BLOCK] = std::array::from_fn(|l| if l < inside { 1.0 } else { -1.0 });
                *block = Block { transmittance: pulp::cast(t), color: [ZERO; 3], depth: ZERO };
                live |= u8::from(inside > 0) << b;
            }
            self.live[r] = live;
        }
    }

    /// Whether a pixel is unfinished.
    #[inline(always)]
    pub(super) fn is_live(&self) -> bool {
        self.live != [0; TILE_HEIGHT + 8]
    }

    /// Loads the sums of an earlier slice of the depth order (see [`Tile::store_unfinished`]).
    pub(super) fn load(&mut self, planes: &Planes, x0: usize) {
        self.clear(planes, x0);
        for r in 0..planes.rows() {
            let start = r * planes.width + x0;
            for x in 0..planes.columns(x0) {
                let block = &mut self.blocks[r * BLOCKS + x / BLOCK];
                let l = x % BLOCK;
                lanes_mut(&mut block.transmittance)[l] = planes.alpha[start + x];
                for c in 0..3 {
                    lanes_mut(&mut block.color[c])[l] = planes.color[start + x][c];
                }
                lanes_mut(&mut block.depth)[l] = planes.depth[start + x];
            }
            for b in 0..BLOCKS {
                let finished =
                    lanes(&self.blocks[r * BLOCKS + b].transmittance).iter().all(|t| t.is_sign_negative());
                if finished {
                    self.live[r] &= !(1 << b);
                }
            }
        }
    }

    /// Stores the intermediate sums, with the signed transmittance in the plane of alpha.
    pub(super) fn store_unfinished(&self, planes: &mut Planes, x0: usize) {
        self.store(planes, x0, |t, color, depth| (color, t, depth));
    }

    /// Stores the picture: with the background, alpha = 1 - T, and depth by the options.
    pub(super) fn store_finished(&self, planes: &mut Planes, x0: usize, options: &RenderOptions) {
        let behind = match options.background {
            Background::Color(rgb) => rgb,
            Background::Transparent => [0.0; 3],
        };
        let expected = options.depth_mode == DepthMode::Expected;
        self.store(planes, x0, |t, color, depth| {
            let t = t.abs();
            let alpha = 1.0 - t;
            let color = std::array::from_fn(|c| color[c] + t * behind[c]);
            let depth = match expected {
                true if alpha > 0.0 => depth / alpha,
                true => 0.0,
                false => depth,
            };
            (color, alpha, depth)
        });
    }

    #[inline(always)]
    fn store(
        &self,
        planes: &mut Planes,
        x0: usize,
        pixel: impl Fn(f32, [f32; 3], f32) -> ([f32; 3], f32, f32),
    ) {
        let columns = planes.columns(x0);
        for r in 0..planes.rows() {
            let start = r * planes.width + x0;
            let color = &mut planes.color[start..start + columns];
            let alpha = &mut planes.alpha[start..start + columns];
            let depth = &mut planes.depth[start..start + columns];
            let out = color.chunks_mut(BLOCK).zip(alpha.chunks_mut(BLOCK)).zip(depth.chunks_mut(BLOCK));
            for (block, ((color, alpha), depth)) in self.blocks[r * BLOCKS..].iter().zip(out) {
                let t = lanes(&block.transmittance);
                let [red, green, blue] = [0, 1, 2].map(|c| lanes(&block.color[c]));
                let z = lanes(&block.depth);
                for l in 0..alpha.len() {
                    (color[l], alpha[l], depth[l]) = pixel(t[l], [red[l], green[l], blue[l]], z[l]);
                }
            }
        }
    }
}

pub(super) fn lanes(v: &f32x8) -> &[f32; BLOCK] {
    bytemuck::cast_ref(v)
}

fn lanes_mut(v: &mut f32x8) -> &mut [f32; BLOCK] {
    bytemuck::cast_mut(v)
}
