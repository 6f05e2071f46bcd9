//! Real spherical harmonics in the order and with the signs of 3DGS, and colour from them.
//!
//! Colour seen along unit direction d (from the camera to the Gaussian) is
//! `max(0, 0.5 + sum_k sh_k Y_k(d))`.

/// Highest degree supported.
pub const MAX_DEGREE: u8 = 3;

/// 1 / (2 sqrt(pi)), the constant function Y_0.
pub const Y0: f32 = 0.282_094_79;

/// Number of coefficients per colour channel up to `degree`.
#[inline]
pub const fn coefficients(degree: u8) -> usize {
    (degree as usize + 1) * (degree as usize + 1)
}

/// Whether basis function `k` is odd in y (order m < 0), so that it changes sign under y -> -y.
pub const ODD_IN_Y: [bool; 16] = [
    false, // l = 0
    true, false, false, // l = 1
    true, true, false, false, false, // l = 2
    true, true, true, false, false, false, false, // l = 3
];

/// Coefficient of degree 0 of colour `rgb` in [0, 1], RGB2SH (paper eq. 9): 2 sqrt(pi) (rgb - 0.5).
#[inline]
pub fn from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    rgb.map(|c| (c - 0.5) / Y0)
}

/// Colour of a coefficient of degree 0.
pub fn to_rgb(sh0: [f32; 3]) -> [f32; 3] {
    sh0.map(|c| c * Y0 + 0.5)
}

/// All basis functions up to `degree` at the unit direction (x, y, z); the rest of the array is zero.
#[inline]
pub fn basis([x, y, z]: [f64; 3], degree: u8) -> [f64; 16] {
    let mut b = [0.0; 16];
    b[0] = 0.282_094_791_773_878_14;
    if degree >= 1 {
        const C: f64 = 0.488_602_511_902_919_9;
        b[1] = -C * y;
        b[2] = C * z;
        b[3] = -C * x;
    }
    let (xx, yy, zz) = (x * x, y * y, z * z);
    if degree >= 2 {
        const C: [f64; 3] = [1.092_548_430_592_079_2, 0.315_391_565_252_520_05, 0.546_274_215_296_039_6];
        b[4] = C[0] * x * y;
        b[5] = -C[0] * y * z;
        b[6] = C[1] * (2.0 * zz - xx - yy);
        b[7] = -C[0] * x * z;
        b[8] = C[2] * (xx - yy);
    }
    if degree >= 3 {
        const C: [f64; 5] = [
            0.590_043_589_926_643_5,
            2.890_611_442_640_554,
            0.457_045_799_464_465_8,
            0.373_176_332_590_115_4,
            1.445_305_721_320_277,
        ];
        b[9] = -C[0] * y * (3.0 * xx - yy);
        b[10] = C[1] * x * y * z;
        b[11] = -C[2] * y * (4.0 * zz - xx - yy);
        b[12] = C[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        b[13] = -C[2] * x * (4.0 * zz - xx - yy);
        b[14] = C[4] * z * (xx - yy);
        b[15] = -C[0] * x * (xx - 3.0 * yy);
    }
    b
}

/// Colour of one Gaussian, `sh` `[(stored degree + 1)^2][3]`, along `direction`, using bands up to `degree`.
pub fn color(sh: &[f32], direction: [f64; 3], degree: u8) -> [f64; 3] {
    let b = basis(direction, degree);
    let mut rgb = [0.5; 3];
    for k in 0..coefficients(degree) {
        for c in 0..3 {
            rgb[c] += b[k] * f64::from(sh[3 * k + c]);
        }
    }
    rgb.map(|v: f64| v.max(0.0))
}
