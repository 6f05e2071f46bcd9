//! One projected Gaussian, in 64 bytes.

/// First and last column and row that a splat may touch, inside the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PixelBounds {
    pub(super) x0: u16,
    pub(super) x1: u16,
    pub(super) y0: u16,
    pub(super) y1: u16,
}

/// A projected Gaussian. Its exponent is, in base 2 with (dx, dy) from its centre to a pixel's centre,
///
/// ```text
/// pivot Y (c >= a):  q = conditional (dx - slope dy)^2 + marginal dy^2,  slope = b/c
/// pivot X (a > c):   q = conditional (dy - slope dx)^2 + marginal dx^2,  slope = b/a
/// conditional = log2(e)/2 * pivot/det,  marginal = log2(e)/2 / pivot
/// ```
///
/// where `[[a, b], [b, c]]` is the blurred covariance in pixels^2: Cholesky's form with the larger diagonal as
/// pivot. q cannot be negative and the slope lies in [-1, 1].
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct Splat {
    /// Centre in pixels, rounded to integers ...
    pub(super) center: [f32; 2],
    /// ... and the remainder: together they represent the centre to 2^-25 of a pixel on any image.
    pub(super) center_rest: [f32; 2],
    pub(super) slope: f32,
    /// Negative with pivot X.
    pub(super) conditional: f32,
    pub(super) marginal: f32,
    pub(super) opacity: f32,
    pub(super) color: [f32; 3],
    /// Depth z, metres.
    pub(super) depth: f32,
    /// At least log2(255 opacity): where q exceeds this, alpha is below 1/255.
    pub(super) q_max: f32,
    /// The exponent completed to a square in x, whichever the pivot is, for the width of a row:
    /// q = (dx - center_slope dy)^2 / inverse_column + row dy^2, with b/c, det/c 2/log2(e) and log2(e)/2 / c.
    pub(super) center_slope: f32,
    pub(super) inverse_column: f32,
    pub(super) row: f32,
}
