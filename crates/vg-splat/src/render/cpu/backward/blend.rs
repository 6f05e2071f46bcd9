//! Backward pass of blending: one tile's tape, from the farthest layer to the nearest.
//!
//! Every output of a pixel is a sum over its layers, `sum_k T_k alpha_k f_k + T_end f_end`, with f the colour, z or 1.
//! Weighted by the picture's gradient (gc, ga, gd) they are one sum, of `phi_k = gc . c_k + gd z_k` before
//! `phi_end = gc . background - ga`. With S_k its part from layer k on, composited from the back,
//!
//! ```text
//! S_k = alpha_k phi_k + (1 - alpha_k) S_{k+1},   S_end = phi_end
//! dL/dalpha_k = T_k (phi_k - S_{k+1}),   dL/dc_k = T_k alpha_k gc,   dL/dz_k = T_k alpha_k gd
//! ```
//!
//! without a division. (The usual form recovers T by dividing by 1 - alpha and subtracts sums.) Expected depth D/A is D
//! with `gd / A` and a background at depth D/A, because `d(D/A) = (dD - D/A dA) / A`.

use super::super::blend::block_centers;
use super::super::simd::Lanes;
use super::super::splat::Splat;
use super::super::tile::{BLOCK, BLOCKS, TILE_HEIGHT, TILE_WIDTH, Tile, lanes};
use super::TileShare;
use super::tape::Tape;
use crate::render::{Background, DepthMode, PictureGradient, RenderOptions};
use pulp::f32x8;

/// One tile's contribution to the gradient of one splat, summed over pixels with
/// `w = alpha dL/dalpha = dL/d(log alpha)`, zero where alpha is clamped, and (t, s) the offset from the splat's centre
/// whitened by the form of [`Splat`]: exponent `q = t^2 + s^2`, t along the axis that is not the pivot. Where a pixel
/// is drawn q < 8, so all of these have the magnitude of w.
///
/// `[w, w t, w s, w t t, w t s, w s s, red, green, blue, depth]`
pub(in crate::render) type SplatSums = [f32; 10];

/// The gradient of eight pixels, and the composite behind the current layer.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Behind {
    /// gc
    color: [f32x8; 3],
    /// gd
    depth: f32x8,
    /// S_{k+1}
    sum: f32x8,
}

const ZERO: f32x8 = f32x8(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

/// The state of a tile's pixels in the backward pass.
#[derive(Debug)]
pub(super) struct TileGradient {
    blocks: [Behind; BLOCKS * TILE_HEIGHT],
}

impl TileGradient {
    pub(super) fn new() -> Self {
        Self { blocks: [Behind { color: [ZERO; 3], depth: ZERO, sum: ZERO }; BLOCKS * TILE_HEIGHT] }
    }

    /// Starts behind the last layer of `tile`, which has been blended onto `tape`, with `scale` times the picture's
    /// gradient. Returns the gradient of the background's colour.
    #[inline(always)]
    pub(super) fn start(
        &mut self,
        (tile, tape): (&Tile, &Tape),
        [left, top]: [usize; 2],
        options: &RenderOptions,
        gradient: &PictureGradient,
        scale: f64,
    ) -> [f64; 3] {
        let behind = match options.background {
            Background::Color(rgb) => rgb,
            Background::Transparent => [0.0; 3],
        };
        let (width, height) = (gradient.width as usize, gradient.height as usize);
        let (rows, columns) = ((height - top).min(TILE_HEIGHT), (width - left).min(TILE_WIDTH));
        let expected = options.depth_mode == DepthMode::Expected;
        let mut background = [0.0; 3];
        for r in 0..TILE_HEIGHT {
            for b in 0..BLOCKS {
                let (at, x0) = (r * BLOCKS + b, b * BLOCK);
                let inside = if r < rows { columns.saturating_sub(x0).min(BLOCK) } else { 0 };
                let first = (top + r) * width + left + x0;
                let t = lanes(&tile.blocks[at].transmittance);
                let (mut color, mut depth, mut sum) = ([[0.0; BLOCK]; 3], [0.0; BLOCK], [0.0; BLOCK]);
                if inside > 0 && !gradient.color.is_empty() {
                    let mut total = [0.0; 3];
                    for (l, gc) in gradient.color[first..first + inside].iter().enumerate() {
                        for c in 0..3 {
                            color[c][l] = (scale * f64::from(gc[c])) as f32;
                            sum[l] += color[c][l] * behind[c];
                            total[c] += color[c][l] * t[l].abs();
                        }
                    }
                    for c in 0..3 {
                        background[c] += f64::from(total[c]);
                    }
                }
                if inside > 0 && !gradient.alpha.is_empty() {
                    for (l, ga) in gradient.alpha[first..first + inside].iter().enumerate() {
                        sum[l] -= (scale * f64::from(*ga)) as f32;
                    }
                }
                if inside > 0 && !gradient.depth.is_empty() {
                    for (l, gd) in gradient.depth[first..first + inside].iter().enumerate() {
                        depth[l] = (scale * f64::from(*gd)) as f32;
                    }
                    if expected {
                        let covered = lanes(&tape.covered()[at]);
                        let total = lanes(&tile.blocks[at].depth);
                        for l in 0..BLOCK {
                            let alpha = covered[l];
                            let inverse = if alpha > 0.0 { 1.0 / alpha } else { 0.0 };
                            depth[l] *= inverse;
                            sum[l] += depth[l] * (total[l] * inverse);
                        }
                    }
                }
                self.blocks[at] = Behind {
                    color: [pulp::cast(color[0]), pulp::cast(color[1]), pulp::cast(color[2])],
                    depth: pulp::cast(depth),
                    sum: pulp::cast(sum),
                };
            }
        }
        if options.background == Background::Transparent { [0.0; 3] } else { background }
    }

    /// Walks `tape` from back to front; appends the splats that were drawn and their sums.
    #[inline(always)]
    pub(super) fn walk<S: Lanes>(
        &mut self,
        simd: S,
        tape: &Tape,
        [left, top]: [usize; 2],
        splats: &[Splat],
        max_alpha: f32,
        share: &mut TileShare,
    ) {
        let x = block_centers(left);
        let max_alpha = simd.splat_f32s(max_alpha);
        let one = simd.splat_f32s(1.0);
        for layer_index in (0..tape.layers().len()).rev() {
            let layer = tape.layers()[layer_index];
            let splat = &splats[layer.splat as usize];
            let form = Form::new(splat);
            let center_x = simd.splat_f32s(form.center[0]);
            let rest_x = simd.splat_f32s(form.center_rest[0]);
            let slope_x = simd.splat_f32s(form.slope[0]);
            let whiten_t = simd.splat_f32s(form.whiten_t);
            let whiten_s_x = simd.splat_f32s(form.whiten_s[0]);
            let color = [
                simd.splat_f32s(splat.color[0]),
                simd.splat_f32s(splat.color[1]),
                simd.splat_f32s(splat.color[2]),
            ];
            let depth = simd.splat_f32s(splat.depth);
            let mut sum = [ZERO; 10];
            let (drawn, blocks) = tape.records(layer_index);
            for (drawn, &block) in drawn.iter().zip(blocks) {
                let block = usize::from(block);
                let (row, column) = (block / BLOCKS, block % BLOCKS);
                // The offset's coordinates, computed as by the blend.
                let dy = ((top + row) as f32 + 0.5 - form.center[1]) - form.center_rest[1];
                let offset = simd.splat_f32s(form.slope[1] * dy);
                let s_y = simd.splat_f32s(form.whiten_s[1] * dy);
                let dx = simd.sub_f32s(simd.sub_f32s(x[column], center_x), rest_x);
                let t = simd.mul_f32s(whiten_t, simd.mul_add(slope_x, dx, offset));
                let s = simd.mul_add(whiten_s_x, dx, s_y);

                let behind = &mut self.blocks[block];
                let alpha = drawn.alpha;
                let mut phi = simd.mul_f32s(behind.depth, depth);
                for c in 0..3 {
                    phi = simd.mul_add(behind.color[c], color[c], phi);
                }
                // Zero where nothing was drawn, because alpha is.
                let weight = simd.mul_f32s(drawn.transmittance, alpha);
                let w = simd.mul_f32s(weight, simd.sub_f32s(phi, behind.sum));
                let w = simd.select_f32s(simd.less_than_f32s(alpha, max_alpha), w, ZERO);
                behind.sum = simd.mul_add(simd.sub_f32s(one, alpha), behind.sum, simd.mul_f32s(alpha, phi));

                let (wt, ws) = (simd.mul_f32s(w, t), simd.mul_f32s(w, s));
                sum[0] = simd.add_f32s(sum[0], w);
                sum[1] = simd.add_f32s(sum[1], wt);
                sum[2] = simd.add_f32s(sum[2], ws);
                sum[3] = simd.mul_add(wt, t, sum[3]);
                sum[4] = simd.mul_add(wt, s, sum[4]);
                sum[5] = simd.mul_add(ws, s, sum[5]);
                for c in 0..3 {
                    sum[6 + c] = simd.mul_add(weight, behind.color[c], sum[6 + c]);
                }
                sum[9] = simd.mul_add(weight, behind.depth, sum[9]);
            }
            let [w, wt, ws, wtt, wts, wss, red, green, blue, depth] = sum;
            let first: [f32; 8] = pulp::cast(simd.sums([w, wt, ws, wtt, wts, wss, red, green]));
            let rest: [f32; 8] = pulp::cast(simd.sums([blue, depth, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO]));
            share.splats.push(layer.splat);
            share.sums.push([
                first[0], first[1], first[2], first[3], first[4], first[5], first[6], first[7], rest[0],
                rest[1],
            ]);
        }
    }
}

/// Distance from the picture, pixels, beyond which the square of an offset could leave f32.
const FARTHEST_CENTER: f32 = 1e15;

/// A splat's exponent as whitened coordinates, linear in the offset (dx, dy).
struct Form {
    center: [f32; 2],
    center_rest: [f32; 2],
    /// `t = whiten_t (slope[0] dx + slope[1] dy)`
    slope: [f32; 2],
    whiten_t: f32,
    /// `s = whiten_s[0] dx + whiten_s[1] dy`
    whiten_s: [f32; 2],
}

impl Form {
    #[inline(always)]
    fn new(s: &Splat) -> Self {
        let (t, marginal) = (s.conditional.abs().sqrt(), s.marginal.sqrt());
        let near = s.center[0].abs().max(s.center[1].abs()) < FARTHEST_CENTER;
        if !near || !t.is_finite() {
            // The splat is drawn, but its shape and place get no gradient.
            return Self {
                center: [0.0; 2],
                center_rest: [0.0; 2],
                slope: [0.0; 2],
                whiten_t: 0.0,
                whiten_s: [0.0; 2],
            };
        }
        let (center, center_rest) = (s.center, s.center_rest);
        if s.conditional < 0.0 {
            Self { center, center_rest, slope: [-s.slope, 1.0], whiten_t: t, whiten_s: [marginal, 0.0] }
        } else {
            Self { center, center_rest, slope: [1.0, -s.slope], whiten_t: t, whiten_s: [0.0, marginal] }
        }
    }
}
