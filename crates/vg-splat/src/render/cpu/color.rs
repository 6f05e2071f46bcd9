//! Colour from spherical harmonics in f32: `max(0, 0.5 + sum_k sh_k Y_k(d))`.

/// Upper clamp of colours, so that sums over a pixel stay finite whatever the coefficients are.
const MAX_COLOR: f32 = 1e30;

/// All sixteen basis functions at the unit direction (x, y, z), in 3DGS's order and signs.
#[inline(always)]
pub(super) fn basis(x: f32, y: f32, z: f32) -> [f32; 16] {
    const C1: f32 = 0.488_602_52;
    const C2: [f32; 3] = [1.092_548_5, 0.315_391_57, 0.546_274_2];
    const C3: [f32; 5] = [0.590_043_6, 2.890_611_4, 0.457_045_8, 0.373_176_34, 1.445_305_7];
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.282_094_8,
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2[0] * x * y,
        -C2[0] * y * z,
        C2[1] * (2.0 * zz - xx - yy),
        -C2[0] * x * z,
        C2[2] * (xx - yy),
        -C3[0] * y * (3.0 * xx - yy),
        C3[1] * x * y * z,
        -C3[2] * y * (4.0 * zz - xx - yy),
        C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -C3[2] * x * (4.0 * zz - xx - yy),
        C3[4] * z * (xx - yy),
        -C3[0] * x * (xx - 3.0 * yy),
    ]
}

/// Colour of one Gaussian from the first `coefficients` of `sh` `[>= coefficients][3]`.
#[inline(always)]
pub(super) fn color(sh: &[f32], basis: &[f32; 16], coefficients: usize) -> [f32; 3] {
    // Four lanes per coefficient: the three channels and, before them, the last float of the previous coefficient,
    // which is computed and ignored. No load reaches past the end of the array.
    let mut sum = [0.0f32; 4];
    for k in 1..coefficients {
        let four = &sh[3 * k - 1..3 * k + 3];
        for lane in 0..4 {
            sum[lane] += basis[k] * four[lane];
        }
    }
    let mut rgb = [0.0; 3];
    for c in 0..3 {
        let value = 0.5 + (basis[0] * sh[c] + sum[c + 1]);
        // NaN (infinity minus infinity) becomes 0, which `clamp` would not do.
        rgb[c] = if value > 0.0 { value.min(MAX_COLOR) } else { 0.0 };
    }
    rgb
}

/// Whether each channel varies with its coefficients: not at 0 and not at [`MAX_COLOR`], where it is clamped.
#[inline(always)]
pub(super) fn moves(color: [f32; 3]) -> [bool; 3] {
    color.map(|v| v > 0.0 && v < MAX_COLOR)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussians::sh;

    #[test]
    fn f32_colours_are_within_1e_6_of_the_f64_ones_at_every_degree() {
        let coefficients: Vec<f32> = (0..48).map(|i| ((i * 37 % 23) as f32 - 11.0) * 0.03).collect();
        for i in 0..200 {
            let t = f64::from(i);
            let d = glam::DVec3::new((0.7 * t).sin(), (1.3 * t).cos(), (0.37 * t).sin() + 0.01).normalize();
            let b = basis(d.x as f32, d.y as f32, d.z as f32);
            for degree in 0..=3 {
                let found = color(&coefficients, &b, sh::coefficients(degree));
                let exact = sh::color(&coefficients, d.to_array(), degree);
                for c in 0..3 {
                    assert!((f64::from(found[c]) - exact[c]).abs() < 1e-6, "degree {degree}, {d}");
                }
            }
        }
    }

    #[test]
    fn coefficients_near_the_limit_of_f32_give_finite_colours() {
        let coefficients: Vec<f32> = (0..48).map(|i| if i % 2 == 0 { f32::MAX } else { f32::MIN }).collect();
        let found = color(&coefficients, &basis(0.6, 0.0, 0.8), 16);
        assert!(found.iter().all(|c| (0.0..=MAX_COLOR).contains(c)), "{found:?}");
    }
}
