//! Backward pass of spherical harmonics: to the coefficients, and through the direction to the positions.

use crate::render::gradient::narrow;

/// Writes the gradient of the coefficients `sh` `[coefficients][3]`, `unscale` times `gradient` times each basis
/// function, and returns dL/d(direction) of the polynomials, not scaled and not yet projected onto the sphere.
///
/// `direction` is a unit vector; `gradient` is dL/d(colour), already zero where the colour is clamped.
#[inline(always)]
pub(super) fn backward(
    sh: &[f32],
    direction: [f64; 3],
    gradient: [f64; 3],
    unscale: f64,
    out: &mut [f32],
) -> [f64; 3] {
    let coefficients = sh.len() / 3;
    let [x, y, z] = direction;
    let basis = super::super::color::basis(x as f32, y as f32, z as f32);
    let scaled = [unscale * gradient[0], unscale * gradient[1], unscale * gradient[2]];
    // dL/dY_k.
    let mut b = [0.0; 16];
    for k in 0..coefficients {
        for c in 0..3 {
            b[k] += gradient[c] * f64::from(sh[3 * k + c]);
            out[3 * k + c] = narrow(f64::from(basis[k]) * scaled[c]);
        }
    }
    let mut turn = [0.0; 3];
    if coefficients < 4 {
        return turn;
    }
    const C1: f64 = 0.488_602_511_902_919_9;
    turn = [-C1 * b[3], -C1 * b[1], C1 * b[2]];
    if coefficients < 9 {
        return turn;
    }
    const C2: [f64; 3] = [1.092_548_430_592_079_2, 0.315_391_565_252_520_05, 0.546_274_215_296_039_6];
    let (xy, yz, zz, xz, xx) = (C2[0] * b[4], -C2[0] * b[5], C2[1] * b[6], -C2[0] * b[7], C2[2] * b[8]);
    turn[0] += xy * y - 2.0 * zz * x + xz * z + 2.0 * xx * x;
    turn[1] += xy * x + yz * z - 2.0 * zz * y - 2.0 * xx * y;
    turn[2] += yz * y + 4.0 * zz * z + xz * x;
    if coefficients < 16 {
        return turn;
    }
    const C3: [f64; 5] = [
        0.590_043_589_926_643_5,
        2.890_611_442_640_554,
        0.457_045_799_464_465_8,
        0.373_176_332_590_115_4,
        1.445_305_721_320_277,
    ];
    let (x2, y2, z2) = (x * x, y * y, z * z);
    turn[0] += -C3[0] * b[9] * 6.0 * x * y + C3[1] * b[10] * y * z + C3[2] * b[11] * 2.0 * x * y
        - C3[3] * b[12] * 6.0 * x * z
        - C3[2] * b[13] * (4.0 * z2 - 3.0 * x2 - y2)
        + C3[4] * b[14] * 2.0 * x * z
        - C3[0] * b[15] * 3.0 * (x2 - y2);
    turn[1] += -C3[0] * b[9] * 3.0 * (x2 - y2) + C3[1] * b[10] * x * z
        - C3[2] * b[11] * (4.0 * z2 - x2 - 3.0 * y2)
        - C3[3] * b[12] * 6.0 * y * z
        + C3[2] * b[13] * 2.0 * x * y
        - C3[4] * b[14] * 2.0 * y * z
        + C3[0] * b[15] * 6.0 * x * y;
    turn[2] += C3[1] * b[10] * x * y - C3[2] * b[11] * 8.0 * y * z
        + C3[3] * b[12] * (6.0 * z2 - 3.0 * x2 - 3.0 * y2)
        - C3[2] * b[13] * 8.0 * x * z
        + C3[4] * b[14] * (x2 - y2);
    turn
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussians::sh;

    #[test]
    fn the_derivative_of_every_basis_function_is_its_central_difference() {
        let d = glam::DVec3::new(0.48, -0.6, 0.64).to_array();
        for k in 0..16 {
            let mut one = [0.0; 48];
            one[3 * k] = 1.0;
            let mut out = [0.0; 48];
            let turn = backward(&one, d, [1.0, 0.0, 0.0], 2.0, &mut out);
            for axis in 0..3 {
                let h = 1e-6;
                let at = |step: f64| {
                    let mut moved = d;
                    moved[axis] += step;
                    sh::basis(moved, 3)[k]
                };
                let difference = (at(h) - at(-h)) / (2.0 * h);
                assert!((turn[axis] - difference).abs() < 1e-8, "Y_{k}, axis {axis}");
            }
            for m in 0..16 {
                let expected = 2.0 * sh::basis(d, 3)[m];
                assert!((f64::from(out[3 * m]) - expected).abs() < 1e-6 && out[3 * m + 1] == 0.0);
            }
        }
    }
}
