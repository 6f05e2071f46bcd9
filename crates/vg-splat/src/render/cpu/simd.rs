//! Vectors of eight f32 lanes, and their exponential.
//!
//! Kernels are written once, generic over [`Lanes`]: pulp's AVX2 + FMA level, detected at run time, or its plain arrays
//! of eight, which the compiler maps to the target's guaranteed instructions. Both are eight wide, so one memory layout
//! serves both.

use pulp::{Scalar256b, Simd, f32x8, i32x8, m32x8, u32x8};

/// A vector of eight lanes, with operations for which pulp has no suitable one.
pub(super) trait Lanes: Simd<f32s = f32x8, u32s = u32x8, i32s = i32x8, m32s = m32x8> {
    /// The sign bits of the lanes; bit l is that of lane l.
    fn sign_bits(self, a: f32x8) -> u32;

    /// The low bytes of the lanes, lane 0 in the lowest; every lane is below 256.
    fn low_bytes(self, a: u32x8) -> u64;

    /// a b + c, fused where an instruction exists: pulp's own on plain arrays calls the C library for each lane.
    fn mul_add(self, a: f32x8, b: f32x8, c: f32x8) -> f32x8;

    /// The sums of the lanes of each vector; lane l is that of `v[l]`.
    fn sums(self, v: [f32x8; 8]) -> f32x8;
}

impl Lanes for Scalar256b {
    #[inline(always)]
    fn sign_bits(self, a: f32x8) -> u32 {
        let lanes: [u32; 8] = pulp::cast(a);
        let mut bits = 0;
        for (l, lane) in lanes.iter().enumerate() {
            bits |= (lane >> 31) << l;
        }
        bits
    }

    #[inline(always)]
    fn low_bytes(self, a: u32x8) -> u64 {
        let lanes: [u32; 8] = pulp::cast(a);
        let mut bytes = 0;
        for (l, lane) in lanes.iter().enumerate() {
            bytes |= u64::from(*lane) << (8 * l);
        }
        bytes
    }

    #[inline(always)]
    fn mul_add(self, a: f32x8, b: f32x8, c: f32x8) -> f32x8 {
        self.add_f32s(self.mul_f32s(a, b), c)
    }

    #[inline(always)]
    fn sums(self, v: [f32x8; 8]) -> f32x8 {
        let mut out = [0.0; 8];
        for (out, v) in out.iter_mut().zip(v) {
            let v: [f32; 8] = pulp::cast(v);
            *out = ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
        }
        pulp::cast(out)
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V3 {
    #[inline(always)]
    fn sign_bits(self, a: f32x8) -> u32 {
        self.avx._mm256_movemask_ps(pulp::cast(a)) as u32
    }

    #[inline(always)]
    fn low_bytes(self, a: u32x8) -> u64 {
        // Packing works within halves: lanes 0-3 end in the low half's first four bytes, 4-7 in the high half's.
        let words = self.avx2._mm256_packus_epi32(pulp::cast(a), pulp::cast(a));
        let halves: [u32; 8] = pulp::cast(self.avx2._mm256_packus_epi16(words, words));
        u64::from(halves[0]) | u64::from(halves[4]) << 32
    }

    #[inline(always)]
    fn mul_add(self, a: f32x8, b: f32x8, c: f32x8) -> f32x8 {
        self.mul_add_f32s(a, b, c)
    }

    #[inline(always)]
    fn sums(self, v: [f32x8; 8]) -> f32x8 {
        // Add pairs, then fours, within halves; then the two halves.
        let avx = self.avx;
        let v01 = avx._mm256_hadd_ps(pulp::cast(v[0]), pulp::cast(v[1]));
        let v23 = avx._mm256_hadd_ps(pulp::cast(v[2]), pulp::cast(v[3]));
        let v45 = avx._mm256_hadd_ps(pulp::cast(v[4]), pulp::cast(v[5]));
        let v67 = avx._mm256_hadd_ps(pulp::cast(v[6]), pulp::cast(v[7]));
        let low = avx._mm256_hadd_ps(v01, v23);
        let high = avx._mm256_hadd_ps(v45, v67);
        let first = avx._mm256_permute2f128_ps::<0x20>(low, high);
        let second = avx._mm256_permute2f128_ps::<0x31>(low, high);
        pulp::cast(avx._mm256_add_ps(first, second))
    }
}

/// Below this exponent [`exp2`] returns 2^-100, far below every alpha that is drawn.
const SMALLEST_EXPONENT: f32 = -100.0;

/// 1.5 * 2^23: adding it rounds an f32 of magnitude below 2^22 to an integer, held in the low mantissa bits.
const ROUND: f32 = 12_582_912.0;

/// 2^x for x <= 0: 2^round(x) times a polynomial in the rest, which lies in [-0.5, 0.5].
///
/// The polynomial interpolates 2^f at Chebyshev nodes with the constant fixed at 1, so that 2^0 is 1.
#[inline(always)]
pub(super) fn exp2<S: Lanes>(simd: S, x: f32x8) -> f32x8 {
    let x = simd.max_f32s(x, simd.splat_f32s(SMALLEST_EXPONENT));
    let shifted = simd.add_f32s(x, simd.splat_f32s(ROUND));
    let f = simd.sub_f32s(x, simd.sub_f32s(shifted, simd.splat_f32s(ROUND)));
    let mut poly = simd.splat_f32s(EXP2_COEFFICIENTS[0]);
    for c in &EXP2_COEFFICIENTS[1..] {
        poly = simd.mul_add(poly, f, simd.splat_f32s(*c));
    }
    // The integer is in the low bits of `shifted`; shifted into the exponent field it multiplies by 2^n.
    let n = simd.wrapping_dyn_shl_u32s(simd.transmute_u32s_f32s(shifted), simd.splat_u32s(23));
    simd.transmute_f32s_u32s(simd.add_u32s(simd.transmute_u32s_f32s(poly), n))
}

/// Coefficients, highest power first; the largest relative error before rounding is 5.1e-9.
const EXP2_COEFFICIENTS: [f32; 7] = [
    1.545_316_3e-4,
    1.339_086_3e-3,
    9.618_083e-3,
    5.550_357e-2,
    0.240_226_5,
    std::f32::consts::LN_2, // the fit's own coefficient, rounded to f32
    1.0,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp2_is_within_two_ulp_on_every_exponent_that_is_drawn() {
        let mut worst = 0.0f64;
        for i in 0..200_000 {
            let x = -9.0 * i as f32 / 200_000.0;
            let lanes: [f32; 8] = pulp::cast(exp2(Scalar256b, pulp::cast([x; 8])));
            let exact = f64::from(x).exp2();
            let ulp = f64::from(f32::EPSILON) * exact.log2().floor().exp2();
            worst = worst.max((f64::from(lanes[3]) - exact).abs() / ulp);
        }
        assert!(worst <= 2.0, "{worst} ulp");
    }

    #[test]
    fn exp2_of_zero_is_one_and_of_huge_or_nan_exponents_is_finite() {
        let x = [0.0, -0.0, -150.0, -1e30, f32::NEG_INFINITY, f32::NAN, -1.0, -2.0];
        let y: [f32; 8] = pulp::cast(exp2(Scalar256b, pulp::cast(x)));
        assert_eq!([y[0], y[1], y[6], y[7]], [1.0, 1.0, 0.5, 0.25]);
        assert!(y[2..6].iter().all(|v| (0.0..1e-29).contains(v)), "{y:?}");
    }
}
