//! Backward pass of the projection: from sums over pixels to the gradients of a Gaussian and of the camera, in f64,
//! eight Gaussians at a time, as in the forward `project`.
//!
//! With J R R_q = [pa; pb] (2x3, its columns j_k), S = diag(s), A = J R R_q S and the blurred covariance
//! `Sigma = A A^T + e I = L L^T`, the pixels give `dL/dSigma = 1/2 L^-T Y L^-1`, Y the sum of w times the outer square
//! of the whitened offset. Everything follows from the whitened columns `h_k = L^-1 j_k`:
//!
//! ```text
//! P = H^T Y H (3x3):  dL/ds_k = s_k P_kk,   torque about the Gaussian's axis 1 = P_23 (s_2^2 - s_3^2), cyclic
//! dL/dj_k = s_k^2 L^-T Y h_k  -> J, and through it z, x/z, y/z and R
//! ```
//!
//! * h is bounded by |j| / sqrt(e) and has no cancellation for needles: with p the pivot's row, o the other and
//!   N = pa x pb (sign changed where x is the pivot), the row of h off the pivot is
//!   `(s_i^2 p_i N_j - s_j^2 p_j N_i + e o_k) / sqrt(det c)` for (k, i, j) cyclic.
//! * A sphere's torque is exactly zero.
//! * Antialiased, `d log(compensation)/dSigma_0 = e/2 Sigma_0^-1 Sigma^-1`, written as a sum of squares over
//!   `det_0 det` rather than the difference of two inverses.

use super::super::color::moves;
use super::super::project::{Inputs, LANES, Placed, dot, placed};
use super::super::splat::Splat;
use super::blend::SplatSums;
use super::color::backward as color_backward;
use crate::gaussians::{self, Gaussians};
use crate::render::gradient::narrow;
use crate::render::options::MIN_COMPENSATION;
use crate::render::view::PinholeView;

/// The camera's part: dL/dR at a fixed centre `[3][3]` row by row, dL/dp `[3]` summed over Gaussians, dL/d(centre)
/// through the directions of colour `[3]`, vehicle frame.
pub(super) type CameraSums = [f64; 15];

/// One chunk of the arrays of `Gradients`.
pub(super) struct Chunk<'a> {
    /// Index of the first Gaussian.
    pub(super) first: usize,
    pub(super) means: &'a mut [[f32; 3]],
    pub(super) rotations: &'a mut [[f32; 4]],
    pub(super) scales: &'a mut [[f32; 3]],
    pub(super) opacities: &'a mut [f32],
    /// `[n][stride]`
    pub(super) sh: &'a mut [f32],
}

/// Discrete decisions of the forward pass about a splat, which the backward pass keeps.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Decided {
    /// Whether x is the pivot of its exponent: see [`Splat`].
    pub(in crate::render) pivot_x: bool,
    /// Whether each channel of its colour varies with its coefficients.
    pub(in crate::render) color_moves: [bool; 3],
}

impl Decided {
    #[inline(always)]
    pub(super) fn from_splat(splat: &Splat) -> Self {
        Self { pivot_x: splat.conditional < 0.0, color_moves: moves(splat.color) }
    }
}

/// Fills one chunk from the `sums` of its splats, which must be multiplied by `unscale`.
#[inline(always)]
pub(super) fn project(
    view: &PinholeView,
    gaussians: &Gaussians,
    decided: impl Fn(usize) -> Decided,
    sums: &[SplatSums],
    unscale: f64,
    out: Chunk,
) -> CameraSums {
    let Chunk { first, means, rotations, scales, opacities, sh } = out;
    let stride = gaussians.sh_stride();
    let coefficients = gaussians::sh::coefficients(view.sh_degree);
    let n = opacities.len();
    let mut camera = [0.0; 15];
    let mut next = 0;
    while next < n {
        // The next eight with a gradient; an incomplete last group repeats one.
        let mut index = [0; LANES];
        let mut count = 0;
        while next < n && count < LANES {
            if sums[next] == [0.0; 10] {
                means[next] = [0.0; 3];
                rotations[next] = [0.0; 4];
                scales[next] = [0.0; 3];
                opacities[next] = 0.0;
                sh[next * stride..(next + 1) * stride].fill(0.0);
            } else {
                index[count] = next;
                count += 1;
            }
            next += 1;
        }
        if count == 0 {
            break;
        }
        let mut lanes = Inputs::default();
        let mut upstream = [[0.0; LANES]; 10];
        let mut pivot_x = [false; LANES];
        for l in 0..LANES {
            let i = index[l.min(count - 1)];
            lanes.load(l, gaussians, first + i);
            pivot_x[l] = decided(first + i).pivot_x;
            for k in 0..10 {
                upstream[k][l] = f64::from(sums[i][k]);
            }
        }
        let mut g = Outputs::default();
        for l in 0..LANES {
            project_lane(view, &lanes, &upstream, pivot_x[l], &mut g, l);
        }
        for l in 0..count {
            let i = index[l];
            let mut mean = [g.mean[0][l], g.mean[1][l], g.mean[2][l]];
            let direction = [g.direction[0][l], g.direction[1][l], g.direction[2][l]];
            let moves = decided(first + i).color_moves;
            let color = std::array::from_fn(|c| if moves[c] { upstream[6 + c][l] } else { 0.0 });
            let coefficients_in = &gaussians.sh()[(first + i) * stride..][..3 * coefficients];
            let (coefficients_out, unused) = sh[i * stride..(i + 1) * stride].split_at_mut(3 * coefficients);
            unused.fill(0.0);
            let turn = color_backward(coefficients_in, direction, color, unscale, coefficients_out);
            // d(unit d)/dd = (I - d d^T) / |d|.
            let along = dot(turn, direction);
            for k in 0..3 {
                let toward = (turn[k] - along * direction[k]) * g.inverse_length[l];
                mean[k] += toward;
                camera[12 + k] -= toward;
            }
            for k in 0..12 {
                camera[k] += g.camera[k][l];
            }
            for k in 0..3 {
                means[i][k] = narrow(unscale * mean[k]);
                scales[i][k] = narrow(unscale * g.scale[k][l]);
            }
            for k in 0..4 {
                rotations[i][k] = narrow(unscale * g.rotation[k][l]);
            }
            opacities[i] = narrow(unscale * g.opacity[l]);
        }
    }
    for v in &mut camera {
        *v *= unscale;
    }
    camera
}

#[derive(Default)]
struct Outputs {
    mean: [[f64; LANES]; 3],
    rotation: [[f64; LANES]; 4],
    scale: [[f64; LANES]; 3],
    opacity: [f64; LANES],
    /// dL/dR, then dL/dp.
    camera: [[f64; LANES]; 12],
    /// Unit vector from the camera to the Gaussian.
    direction: [[f64; LANES]; 3],
    inverse_length: [f64; LANES],
}

/// Differentiates one lane, without branches or closures, so that the compiler vectorises the loop over lanes.
#[inline(always)]
fn project_lane(
    view: &PinholeView,
    g: &Inputs,
    upstream: &[[f64; LANES]; 10],
    pivot_x: bool,
    out: &mut Outputs,
    l: usize,
) {
    let placed = placed(view, g, l);
    let Placed {
        d, inverse_z, point: [x, y], clamped: [xc, yc], magnification: [sx, sy], two, columns, ..
    } = placed;
    let Placed { jacobian: [jx, jy], quaternion: [w, qx, qy, qz], rows: [pa, pb], .. } = placed;
    let (r, i) = (&view.rotation, &view.intrinsics);
    let [xr, yr] = view.jacobian_range;
    let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
    let (mut s, mut s2) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        s[k] = f64::from(g.scale[k][l]);
        s2[k] = s[k] * s[k];
        a[k] = pa[k] * s[k];
        b[k] = pb[k] * s[k];
    }
    // N = pa x pb, and a x b = (s_2 s_3 N_1, ...).
    let n = [pa[1] * pb[2] - pa[2] * pb[1], pa[2] * pb[0] - pa[0] * pb[2], pa[0] * pb[1] - pa[1] * pb[0]];
    let normal = [s[1] * s[2] * n[0], s[2] * s[0] * n[1], s[0] * s[1] * n[2]];
    let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
    let determinant_before = dot(normal, normal);
    let e = view.blur;
    let determinant = e * e + e * (aa + bb) + determinant_before;
    let (variance_x, variance_y) = (aa + e, bb + e);

    // L^-1: t = (o - slope p) / deviation_t, s = p / deviation_s for an offset (o, p), p along the pivot.
    let c = if pivot_x { variance_x } else { variance_y };
    let inverse_s = (1.0 / c).sqrt();
    let inverse_t = (c / determinant).sqrt();
    let slope = ab / c;
    let sign = if pivot_x { -1.0 } else { 1.0 };
    let (mut h_t, mut h_s) = ([0.0; 3], [0.0; 3]);
    let inverse_residual = inverse_t / c;
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (p_i, p_j, p_k) = if pivot_x { (pa[i], pa[j], pa[k]) } else { (pb[i], pb[j], pb[k]) };
        let o_k = if pivot_x { pb[k] } else { pa[k] };
        h_t[k] = (sign * (s2[i] * p_i * n[j] - s2[j] * p_j * n[i]) + e * o_k) * inverse_residual;
        h_s[k] = p_k * inverse_s;
    }

    // The sums use base-2 whitened offsets: sigma = ln 2 q = half the square of sqrt(2 ln 2) (t, s).
    const SQUARE: f64 = 2.0 * std::f64::consts::LN_2;
    let root = SQUARE.sqrt();
    let total = upstream[0][l];
    let (g_t, g_s) = (root * upstream[1][l], root * upstream[2][l]);
    let (y_tt, y_ts, y_ss) = (SQUARE * upstream[3][l], SQUARE * upstream[4][l], SQUARE * upstream[5][l]);

    // Centre: L^-T (g_t, g_s).
    let center_o = g_t * inverse_t;
    let center_p = g_s * inverse_s - slope * center_o;
    let (gu, gv) = if pivot_x { (center_p, center_o) } else { (center_o, center_p) };

    // P = H^T Y H, and dL/dA's columns over s: L^-T Y h_k.
    let (mut p, mut column_a, mut column_b) = ([[0.0; 3]; 3], [0.0; 3], [0.0; 3]);
    let (mut yh_t, mut yh_s) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        yh_t[k] = y_tt * h_t[k] + y_ts * h_s[k];
        yh_s[k] = y_ts * h_t[k] + y_ss * h_s[k];
        let o = yh_t[k] * inverse_t;
        let q = yh_s[k] * inverse_s - slope * o;
        column_a[k] = if pivot_x { q } else { o };
        column_b[k] = if pivot_x { o } else { q };
    }
    for k in 0..3 {
        for m in 0..3 {
            p[k][m] = h_t[k] * yh_t[m] + h_s[k] * yh_s[m];
        }
    }

    // Antialiased: opacity * sqrt(det_0 / det), unless it is at its floor.
    let floor = f64::from(MIN_COMPENSATION * MIN_COMPENSATION);
    let ratio = determinant_before / determinant;
    let compensated = view.antialiased & (ratio > floor);
    let factor = if compensated { total * e / (determinant_before * determinant) } else { 0.0 };
    let (mut across, mut z_a, mut z_b) = ([[0.0; 3]; 3], [0.0; 3], [0.0; 3]);
    across[0] = [0.0, s[1] * n[2], -s[2] * n[1]];
    across[1] = [-s[0] * n[2], 0.0, s[2] * n[0]];
    across[2] = [s[0] * n[1], -s[1] * n[0], 0.0];
    for k in 0..3 {
        z_a[k] = dot(across[k], b);
        z_b[k] = -dot(across[k], a);
        column_a[k] += factor * (bb * z_a[k] - ab * z_b[k] + e * z_a[k]);
        column_b[k] += factor * (aa * z_b[k] - ab * z_a[k] + e * z_b[k]);
    }
    for k in 0..3 {
        for m in 0..3 {
            p[k][m] += factor * (z_a[k] * z_a[m] + z_b[k] * z_b[m] + e * dot(across[k], across[m]));
        }
    }

    // Scale, opacity, rotation: dL/dq = 2 q (0, torque) / |q|^2.
    for k in 0..3 {
        out.scale[k][l] = s[k] * p[k][k];
    }
    // The opacity is at least 1/255, because the Gaussian was drawn.
    out.opacity[l] = total / f64::from(g.opacity[l]);
    let torque = [p[1][2] * (s2[1] - s2[2]), p[2][0] * (s2[2] - s2[0]), p[0][1] * (s2[0] - s2[1])];
    out.rotation[0][l] = -two * (qx * torque[0] + qy * torque[1] + qz * torque[2]);
    out.rotation[1][l] = two * (w * torque[0] + qy * torque[2] - qz * torque[1]);
    out.rotation[2][l] = two * (w * torque[1] + qz * torque[0] - qx * torque[2]);
    out.rotation[3][l] = two * (w * torque[2] + qx * torque[1] - qy * torque[0]);

    // Rows of J R: dL/djx = sum_k dL/dpa_k R_q's column k.
    let (mut gx, mut gy) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let (da, db) = (s2[k] * column_a[k], s2[k] * column_b[k]);
        for m in 0..3 {
            gx[m] += da * columns[k][m];
            gy[m] += db * columns[k][m];
        }
    }
    // jx = fx/z (R_x - x/z R_z), x/z clamped; u = fx x/z + cx, not clamped.
    let (free_x, free_y) = ((xr[0] <= x) & (x <= xr[1]), (yr[0] <= y) & (y <= yr[1]));
    let bend_x = if free_x { -sx * dot(gx, r[2]) } else { 0.0 };
    let bend_y = if free_y { -sy * dot(gy, r[2]) } else { 0.0 };
    let (ratio_x, ratio_y) = (i.fx * gu + bend_x, i.fy * gv + bend_y);
    let point = [
        ratio_x * inverse_z,
        ratio_y * inverse_z,
        upstream[9][l] - (dot(gx, jx) + dot(gy, jy) + ratio_x * x + ratio_y * y) * inverse_z,
    ];
    for m in 0..3 {
        out.mean[m][l] = point[0] * r[0][m] + point[1] * r[1][m] + point[2] * r[2][m];
        out.camera[m][l] = point[0] * d[m] + sx * gx[m];
        out.camera[3 + m][l] = point[1] * d[m] + sy * gy[m];
        out.camera[6 + m][l] = point[2] * d[m] - sx * xc * gx[m] - sy * yc * gy[m];
        out.camera[9 + m][l] = point[m];
    }

    let inverse_length = 1.0 / dot(d, d).sqrt().max(f64::MIN_POSITIVE);
    out.inverse_length[l] = inverse_length;
    for k in 0..3 {
        out.direction[k][l] = d[k] * inverse_length;
    }
}
