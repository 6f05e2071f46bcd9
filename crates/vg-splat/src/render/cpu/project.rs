//! EWA projection of Gaussians to splats (method section 5), eight at a time.
//!
//! With J R R_q S = [a; b] the 2x3 matrix that maps the unit sphere to pixels, the blurred covariance is
//! `[[a.a + e, a.b], [a.b, b.b + e]]` and its determinant, by Cauchy-Binet, `e^2 + e (a.a + b.b) + |a x b|^2`: a sum of
//! squares, exact to rounding for needles, where `ac - b^2` loses every digit.
//! The projection is in f64: it takes a tenth of a picture's time, needs no special handling of scales of 1e-38 or
//! 1e9 m, focal lengths of 1e9 pixels or cameras 1e6 m away, and leaves all of f32's error to the blend.

use super::color;
use super::splat::{PixelBounds, Splat};
use crate::gaussians::{Gaussians, sh};
use crate::render::options::{ALPHA_THRESHOLD, MIN_COMPENSATION};
use crate::render::view::PinholeView;
use std::ops::Range;

/// Sort key of a Gaussian that is not drawn; larger than the bits of any depth.
pub(super) const NOT_DRAWN: u32 = u32::MAX;

/// log2(e) / 2: sigma = 0.5 d^T Sigma^-1 d in base 2.
const HALF_LOG2_E: f64 = 0.5 * std::f64::consts::LOG2_E;

/// Gaussians projected together.
pub(super) const LANES: usize = 8;

/// Projects the Gaussians of `range` into `splats`, `bounds` (the pixels that they may touch) and `keys` (bits of z, or
/// [`NOT_DRAWN`]). Splats of Gaussians that are not drawn are not written.
#[inline(always)]
pub(super) fn project(
    view: &PinholeView,
    gaussians: &Gaussians,
    range: Range<usize>,
    splats: &mut [Splat],
    keys: &mut [u32],
    bounds: &mut [PixelBounds],
) {
    let coefficients = sh::coefficients(view.sh_degree);
    let stride = gaussians.sh_stride();
    let mut start = range.start;
    let groups = splats.chunks_mut(LANES).zip(keys.chunks_mut(LANES)).zip(bounds.chunks_mut(LANES));
    for ((splats, keys), bounds) in groups {
        let mut lanes = Inputs::default();
        // A last group that is not full repeats its last Gaussian.
        for l in 0..LANES {
            let i = (start + l).min(range.end - 1);
            lanes.load(l, gaussians, i);
        }
        let mut out = Outputs::default();
        for l in 0..LANES {
            project_lane(view, &lanes, &mut out, l);
        }
        for l in 0..LANES {
            out.basis[l] = color::basis(out.direction[0][l], out.direction[1][l], out.direction[2][l]);
        }
        for l in 0..keys.len() {
            keys[l] = out.key[l];
            if out.key[l] == NOT_DRAWN {
                continue;
            }
            let sh = &gaussians.sh()[(start + l) * stride..(start + l + 1) * stride];
            bounds[l] = PixelBounds {
                x0: out.bounds[0][l] as u16,
                x1: out.bounds[1][l] as u16,
                y0: out.bounds[2][l] as u16,
                y1: out.bounds[3][l] as u16,
            };
            splats[l] = Splat {
                center: [out.center[0][l], out.center[1][l]],
                center_rest: [out.center_rest[0][l], out.center_rest[1][l]],
                slope: out.slope[l],
                conditional: out.conditional[l],
                marginal: out.marginal[l],
                opacity: out.opacity[l],
                color: color::color(sh, &out.basis[l], coefficients),
                depth: out.depth[l],
                q_max: out.q_max[l],
                center_slope: out.center_slope[l],
                inverse_column: out.inverse_column[l],
                row: out.row[l],
            };
        }
        start += LANES;
    }
}

/// Eight Gaussians, transposed so that each lane is a Gaussian.
#[derive(Default)]
pub(super) struct Inputs {
    pub(super) mean: [[f32; LANES]; 3],
    pub(super) rotation: [[f32; LANES]; 4],
    pub(super) scale: [[f32; LANES]; 3],
    pub(super) opacity: [f32; LANES],
}

impl Inputs {
    #[inline(always)]
    pub(super) fn load(&mut self, l: usize, gaussians: &Gaussians, i: usize) {
        for k in 0..3 {
            self.mean[k][l] = gaussians.means()[i][k];
            self.scale[k][l] = gaussians.scales()[i][k];
        }
        for k in 0..4 {
            self.rotation[k][l] = gaussians.rotations()[i][k];
        }
        self.opacity[l] = gaussians.opacities()[i];
    }
}

#[derive(Default)]
struct Outputs {
    key: [u32; LANES],
    center: [[f32; LANES]; 2],
    center_rest: [[f32; LANES]; 2],
    slope: [f32; LANES],
    conditional: [f32; LANES],
    marginal: [f32; LANES],
    opacity: [f32; LANES],
    depth: [f32; LANES],
    q_max: [f32; LANES],
    center_slope: [f32; LANES],
    inverse_column: [f32; LANES],
    row: [f32; LANES],
    /// x0, x1, y0, y1
    bounds: [[i32; LANES]; 4],
    /// Unit vector from the camera to the Gaussian.
    direction: [[f32; LANES]; 3],
    /// Lane first, so that the functions of one Gaussian are contiguous.
    basis: [[f32; 16]; LANES],
}

/// One Gaussian before its scale is applied: its place in the camera's frame, and the Jacobian there.
pub(super) struct Placed {
    /// Vector from the camera's centre, vehicle frame.
    pub(super) d: [f64; 3],
    pub(super) depth: f64,
    pub(super) inverse_z: f64,
    /// x/z and y/z.
    pub(super) point: [f64; 2],
    /// x/z and y/z, clamped to where the Jacobian is taken.
    pub(super) clamped: [f64; 2],
    /// fx/z and fy/z.
    pub(super) magnification: [f64; 2],
    /// Rows of J R: f/z (R_x - x/z R_z), with x/z clamped.
    pub(super) jacobian: [[f64; 3]; 2],
    /// (w, x, y, z) as stored.
    pub(super) quaternion: [f64; 4],
    /// 2/|q|^2: the quaternion is unit to f32 only, and this makes R_q a rotation to f64.
    pub(super) two: f64,
    /// Columns of R_q.
    pub(super) columns: [[f64; 3]; 3],
    /// Rows of J R R_q.
    pub(super) rows: [[f64; 3]; 2],
}

/// Computes the part of the projection that the forward and backward pass share.
#[inline(always)]
pub(super) fn placed(view: &PinholeView, g: &Inputs, l: usize) -> Placed {
    // The difference is taken first, so that a distant camera loses no digits.
    let mut d = [0.0; 3];
    for k in 0..3 {
        d[k] = f64::from(g.mean[k][l]) - view.center[k];
    }
    let r = &view.rotation;
    let depth = dot(r[2], d);
    let inverse_z = 1.0 / depth;
    let (x, y) = (dot(r[0], d) * inverse_z, dot(r[1], d) * inverse_z);
    let [xr, yr] = view.jacobian_range;
    let (xc, yc) = (x.max(xr[0]).min(xr[1]), y.max(yr[0]).min(yr[1]));
    let (sx, sy) = (view.intrinsics.fx * inverse_z, view.intrinsics.fy * inverse_z);
    let (mut jx, mut jy) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        jx[k] = sx * (r[0][k] - xc * r[2][k]);
        jy[k] = sy * (r[1][k] - yc * r[2][k]);
    }
    let (w, qx) = (f64::from(g.rotation[0][l]), f64::from(g.rotation[1][l]));
    let (qy, qz) = (f64::from(g.rotation[2][l]), f64::from(g.rotation[3][l]));
    let two = 2.0 / (w * w + qx * qx + qy * qy + qz * qz);
    let columns = [
        [1.0 - two * (qy * qy + qz * qz), two * (qx * qy + w * qz), two * (qx * qz - w * qy)],
        [two * (qx * qy - w * qz), 1.0 - two * (qx * qx + qz * qz), two * (qy * qz + w * qx)],
        [two * (qx * qz + w * qy), two * (qy * qz - w * qx), 1.0 - two * (qx * qx + qy * qy)],
    ];
    let (mut pa, mut pb) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        pa[k] = dot(jx, columns[k]);
        pb[k] = dot(jy, columns[k]);
    }
    Placed {
        d,
        depth,
        inverse_z,
        point: [x, y],
        clamped: [xc, yc],
        magnification: [sx, sy],
        jacobian: [jx, jy],
        quaternion: [w, qx, qy, qz],
        two,
        columns,
        rows: [pa, pb],
    }
}

/// Projects one lane, without branches or closures, so that the compiler vectorises the loop over lanes.
#[inline(always)]
fn project_lane(view: &PinholeView, g: &Inputs, out: &mut Outputs, l: usize) {
    let Placed { d, depth: z, point: [x, y], rows: [pa, pb], .. } = placed(view, g, l);
    let (opacity, depth) = (f64::from(g.opacity[l]), z as f32);
    let i = &view.intrinsics;
    let (u, v) = (i.fx * x + i.cx, i.fy * y + i.cy);
    // Rows of J R R_q S.
    let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let scale = f64::from(g.scale[k][l]);
        a[k] = pa[k] * scale;
        b[k] = pb[k] * scale;
    }

    // Covariance, determinant and pivot.
    let (aa, bb, covariance_xy) = (dot(a, a), dot(b, b), dot(a, b));
    let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let determinant_before = dot(normal, normal);
    let e = view.blur;
    let determinant = e * e + e * (aa + bb) + determinant_before;
    let (variance_x, variance_y) = (aa + e, bb + e);
    let pivot_x = variance_x > variance_y;
    let pivot = if pivot_x { variance_x } else { variance_y };
    let inverse_pivot = 1.0 / pivot;
    let conditional = HALF_LOG2_E * pivot / determinant;

    // Opacity, and the distance from the centre up to which alpha reaches the threshold.
    let floor = f64::from(MIN_COMPENSATION * MIN_COMPENSATION);
    let compensation = (determinant_before / determinant).max(floor).sqrt();
    let opacity = if view.antialiased { opacity * compensation } else { opacity } as f32;
    let q_max = log2_at_least(opacity * (1.0 / ALPHA_THRESHOLD));
    let reach = f64::from(q_max) / HALF_LOG2_E;
    let (reach_x, reach_y) = ((reach * variance_x).sqrt(), (reach * variance_y).sqrt());

    // Pixel u is sampled at u + 0.5; clamping in f64 keeps the conversion in range.
    let (last_x, last_y) = (f64::from(view.width) - 1.0, f64::from(view.height) - 1.0);
    let x0 = (u - reach_x - 0.5).ceil().max(0.0).min(last_x + 1.0);
    let x1 = (u + reach_x - 0.5).floor().max(-1.0).min(last_x);
    let y0 = (v - reach_y - 0.5).ceil().max(0.0).min(last_y + 1.0);
    let y1 = (v + reach_y - 0.5).floor().max(-1.0).min(last_y);

    let drawn =
        (depth > view.near) & (depth < view.far) & (opacity >= ALPHA_THRESHOLD) & (x0 <= x1) & (y0 <= y1);
    out.key[l] = if drawn { depth.to_bits() } else { NOT_DRAWN };
    out.bounds[0][l] = x0 as i32;
    out.bounds[1][l] = x1 as i32;
    out.bounds[2][l] = y0 as i32;
    out.bounds[3][l] = y1 as i32;

    let (whole_u, whole_v) = (u.round_ties_even() as f32, v.round_ties_even() as f32);
    out.center[0][l] = whole_u;
    out.center[1][l] = whole_v;
    out.center_rest[0][l] = (u - f64::from(whole_u)) as f32;
    out.center_rest[1][l] = (v - f64::from(whole_v)) as f32;
    out.slope[l] = (covariance_xy * inverse_pivot) as f32;
    out.conditional[l] = if pivot_x { -conditional } else { conditional } as f32;
    out.marginal[l] = (HALF_LOG2_E * inverse_pivot) as f32;
    out.opacity[l] = opacity;
    out.depth[l] = depth;
    out.q_max[l] = q_max;
    let inverse_y = 1.0 / variance_y;
    out.center_slope[l] = (covariance_xy * inverse_y) as f32;
    // Clamped to stay finite in f32: infinity times 0 would be NaN and lose the splat's rows.
    out.inverse_column[l] = (determinant * inverse_y * (1.0 / HALF_LOG2_E)).min(1e38) as f32;
    out.row[l] = (HALF_LOG2_E * inverse_y) as f32;

    let inverse_length = 1.0 / dot(d, d).sqrt().max(f64::MIN_POSITIVE);
    for k in 0..3 {
        out.direction[k][l] = (d[k] * inverse_length) as f32;
    }
}

#[inline(always)]
pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// An upper bound of log2(x), at most 0.03 above it, for normal x; unspecified for other x.
#[inline(always)]
fn log2_at_least(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let m = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000);
    // A parabola through log2 on [1, 2], wrong by less than 0.01, lifted by 0.015.
    let log2_m = -0.335_828_78 * m * m + 2.0 * m - (1.658_71 - 0.015);
    exponent as f32 + log2_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_is_never_too_small_and_at_most_0_03_too_large() {
        for i in 0..100_000 {
            let x = 1.0 + 254.0 * i as f32 / 100_000.0;
            let excess = f64::from(log2_at_least(x)) - f64::from(x).log2();
            assert!((0.0..0.03).contains(&excess), "log2({x}) is {excess} too large");
        }
    }
}
