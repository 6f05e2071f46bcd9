//! Textbook projection of one Gaussian to the image plane: covariance multiplied out, its inverse as adjugate over
//! determinant (f64 has digits to spare), in any type of number.

use super::Parameters;
use super::dual::Number;
use crate::render::RenderOptions;
use crate::render::options::{MIN_COMPENSATION, PROJECTION_MARGIN};

/// A Gaussian on the image plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projected<T> {
    pub(super) depth: T,
    pub(super) center: [T; 2],
    /// Inverse covariance, 1 / pixels^2: xx, xy, yy.
    pub(super) conic: [T; 3],
    pub(super) opacity: T,
    pub(super) color: [T; 3],
    /// Values of the basis functions, for the coefficients' gradients; zero beyond the degree.
    pub(super) basis: [f64; 16],
    /// Whether each channel is above its clamp at zero.
    pub(super) shown: [bool; 3],
}

/// The variables of a projection: a Gaussian and the view.
pub(super) struct Variables<T> {
    pub(super) mean: [T; 3],
    pub(super) rotation: [T; 4],
    pub(super) scale: [T; 3],
    pub(super) opacity: T,
    /// `[R | t]`, `p_camera = R (p_vehicle - origin) + t`.
    pub(super) view: [[T; 4]; 3],
}

/// Projects Gaussian `i` with the given variables; `None` where its centre is not between near and far.
pub(super) fn project<T: Number>(
    parameters: &Parameters,
    i: usize,
    v: &Variables<T>,
    options: &RenderOptions,
) -> Option<Projected<T>> {
    let number = |x: f64| T::constant(x);
    let row = |r: usize| [v.view[r][0], v.view[r][1], v.view[r][2]];
    let from_origin = [0, 1, 2].map(|k| v.mean[k] - number(parameters.origin[k]));
    let p = [0, 1, 2].map(|r| dot(row(r), from_origin) + v.view[r][3]);
    if !(p[2].value() > f64::from(options.near) && p[2].value() < f64::from(options.far)) {
        return None;
    }

    // Sigma = R_q S S^T R_q^T in the camera frame.
    let [w, x, y, z] = v.rotation;
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    let [w, x, y, z] = [w / norm, x / norm, y / norm, z / norm];
    let (one, two) = (number(1.0), number(2.0));
    let rotation = [
        [one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y)],
    ];
    let column = |k: usize| [rotation[0][k], rotation[1][k], rotation[2][k]];
    let half = [0, 1, 2].map(|r| [0, 1, 2].map(|k| dot(row(r), column(k)) * v.scale[k]));
    let covariance = [0, 1, 2].map(|a| [0, 1, 2].map(|b| dot(half[a], half[b])));

    // J of the pinhole at (x', y', z), with the ray clamped to the image and 15 % around it.
    let k = parameters.intrinsics;
    let clamped = |ratio: T, f: f64, c: f64, size: u32| {
        let margin = f64::from(PROJECTION_MARGIN) * f64::from(size);
        let (low, high) = ((0.0 - c - margin) / f, (f64::from(size) - c + margin) / f);
        match ratio.value() {
            r if r < low => number(low),
            r if r > high => number(high),
            _ => ratio,
        }
    };
    let (ratio_x, ratio_y) = (p[0] / p[2], p[1] / p[2]);
    let (fx, fy, zero) = (number(k.fx), number(k.fy), number(0.0));
    let row_x = [fx / p[2], zero, -fx * clamped(ratio_x, k.fx, k.cx, parameters.width) / p[2]];
    let row_y = [zero, fy / p[2], -fy * clamped(ratio_y, k.fy, k.cy, parameters.height) / p[2]];
    let form =
        |a: [T; 3], b: [T; 3]| dot(a, [dot(covariance[0], b), dot(covariance[1], b), dot(covariance[2], b)]);
    let (a, b, c) = (form(row_x, row_x), form(row_x, row_y), form(row_y, row_y));

    let blur = number(f64::from(options.blur));
    let (blurred_a, blurred_c) = (a + blur, c + blur);
    let mut determinant = blurred_a * blurred_c - b * b;
    // The blur's own determinant is the lower bound; rounding must not go below it.
    if determinant.value() < (blur * blur).value() {
        determinant = blur * blur;
    }
    let mut opacity = v.opacity;
    if options.antialiased {
        let ratio = (a * c - b * b) / determinant;
        let floor = f64::from(MIN_COMPENSATION);
        let compensation = if ratio.value() > floor * floor { ratio.sqrt() } else { number(floor) };
        opacity = opacity * compensation;
    }

    // Colour is seen from -R^T (t - R origin), which is the origin where R is a rotation and t is zero.
    let origin = parameters.origin.map(number);
    let turned = [0, 1, 2].map(|r| dot(row(r), origin) - v.view[r][3]);
    let d = [0, 1, 2].map(|k| {
        let back = v.view[0][k] * turned[0] + v.view[1][k] * turned[1] + v.view[2][k] * turned[2];
        from_origin[k] + (origin[k] - back)
    });
    let length = dot(d, d).sqrt();
    let degree = options.sh_degree.min(parameters.sh_degree);
    let basis = basis([d[0] / length, d[1] / length, d[2] / length], degree);
    let sh = parameters.coefficients(i);
    let mut color = [number(0.5); 3];
    for (k, y) in basis.iter().enumerate().take(sh.len() / 3) {
        for ch in 0..3 {
            color[ch] = color[ch] + *y * number(sh[3 * k + ch]);
        }
    }
    let shown = color.map(|c| c.value() > 0.0);
    for ch in 0..3 {
        if !shown[ch] {
            color[ch] = zero;
        }
    }
    Some(Projected {
        depth: p[2],
        center: [fx * ratio_x + number(k.cx), fy * ratio_y + number(k.cy)],
        conic: [blurred_c / determinant, -b / determinant, blurred_a / determinant],
        opacity,
        color,
        basis: basis.map(Number::value),
        shown,
    })
}

fn dot<T: Number>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Real spherical harmonics in the order and signs of 3DGS, as `gaussians::sh::basis`; zero above `degree`.
fn basis<T: Number>([x, y, z]: [T; 3], degree: u8) -> [T; 16] {
    let c = |v: f64| T::constant(v);
    let mut b = [c(0.0); 16];
    b[0] = c(0.282_094_791_773_878_14);
    if degree >= 1 {
        let c1 = c(0.488_602_511_902_919_9);
        (b[1], b[2], b[3]) = (-c1 * y, c1 * z, -c1 * x);
    }
    let (xx, yy, zz) = (x * x, y * y, z * z);
    if degree >= 2 {
        let c2 = c(1.092_548_430_592_079_2);
        b[4] = c2 * x * y;
        b[5] = -c2 * y * z;
        b[6] = c(0.315_391_565_252_520_05) * (c(2.0) * zz - xx - yy);
        b[7] = -c2 * x * z;
        b[8] = c(0.546_274_215_296_039_6) * (xx - yy);
    }
    if degree >= 3 {
        let (c30, c32) = (c(0.590_043_589_926_643_5), c(0.457_045_799_464_465_8));
        b[9] = -c30 * y * (c(3.0) * xx - yy);
        b[10] = c(2.890_611_442_640_554) * x * y * z;
        b[11] = -c32 * y * (c(4.0) * zz - xx - yy);
        b[12] = c(0.373_176_332_590_115_4) * z * (c(2.0) * zz - c(3.0) * xx - c(3.0) * yy);
        b[13] = -c32 * x * (c(4.0) * zz - xx - yy);
        b[14] = c(1.445_305_721_320_277) * z * (xx - yy);
        b[15] = -c30 * x * (xx - c(3.0) * yy);
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussians::sh;

    #[test]
    fn the_basis_is_the_librarys() {
        let d = [0.48, -0.6, 0.64];
        for degree in 0..=3 {
            assert_eq!(basis(d, degree), sh::basis(d, degree));
        }
    }
}
