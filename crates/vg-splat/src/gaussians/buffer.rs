//! The Gaussians of one vehicle: mu, Sigma = R S S^T R^T, opacity, colour as spherical harmonics.

use super::sh;
use std::ops::Range;
use vg_geometry::{Error, Result};

/// Smallest and largest stored standard deviation, metres: normal numbers, whose logarithm a file can hold. Heads keep to
/// a range of their own.
pub const SCALE_RANGE: std::ops::RangeInclusive<f32> = f32::MIN_POSITIVE..=1e9;

/// Gaussians in the vehicle frame (x forward, y left, z up, metres), structure of arrays, f32.
///
/// Invariants, held by every constructor: all arrays have the same length, every number is finite, rotations
/// are unit quaternions, scales are positive, opacities lie in [0, 1].
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Gaussians {
    sh_degree: u8,
    means: Vec<[f32; 3]>,
    rotations: Vec<[f32; 4]>,
    scales: Vec<[f32; 3]>,
    opacities: Vec<f32>,
    sh: Vec<f32>,
}

/// One Gaussian with colour of degree 0, as a head makes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Centre, metres.
    pub mean: [f32; 3],
    /// `vehicle_from_gaussian`, unit quaternion (w, x, y, z).
    pub rotation: [f32; 4],
    /// Standard deviations along the Gaussian's own axes, metres.
    pub scale: [f32; 3],
    /// Peak opacity in [0, 1].
    pub opacity: f32,
    /// SH coefficients of degree 0, RGB.
    pub sh0: [f32; 3],
}

impl Gaussian {
    /// Whether it meets the invariants of [`Gaussians`], except for the norm of its rotation.
    pub fn is_storable(&self) -> bool {
        self.mean.iter().chain(&self.rotation).chain(&self.sh0).all(|v| v.is_finite())
            && self.scale.iter().all(|v| SCALE_RANGE.contains(v))
    }
}

/// The arrays that mirroring and moving change (all but the opacities), keeping the invariants.
pub(super) struct MovedArrays<'a> {
    pub(super) means: &'a mut [[f32; 3]],
    pub(super) rotations: &'a mut [[f32; 4]],
    pub(super) scales: &'a mut [[f32; 3]],
    pub(super) sh: &'a mut [f32],
}

/// The arrays of [`Gaussians`], to be filled by code that keeps their invariants.
#[doc(hidden)]
pub struct ArraysMut<'a> {
    /// Centres, metres. `[n][3]`
    pub means: &'a mut [[f32; 3]],
    /// Unit quaternions (w, x, y, z). `[n][4]`
    pub rotations: &'a mut [[f32; 4]],
    /// Standard deviations, metres. `[n][3]`
    pub scales: &'a mut [[f32; 3]],
    /// Opacities in [0, 1]. `[n]`
    pub opacities: &'a mut [f32],
    /// Coefficients of the colour. `[n][coefficient][3]`
    pub sh: &'a mut [f32],
}

impl Gaussians {
    /// Resizes to `len` Gaussians of this degree, reusing memory, and returns the arrays; their values must be
    /// overwritten.
    #[doc(hidden)]
    pub fn resized_arrays_mut(&mut self, sh_degree: u8, len: usize) -> ArraysMut<'_> {
        self.sh_degree = sh_degree;
        self.means.resize(len, [0.0; 3]);
        self.rotations.resize(len, [1.0, 0.0, 0.0, 0.0]);
        self.scales.resize(len, [1.0; 3]);
        self.opacities.resize(len, 0.0);
        self.sh.resize(len * 3 * sh::coefficients(sh_degree), 0.0);
        ArraysMut {
            means: &mut self.means,
            rotations: &mut self.rotations,
            scales: &mut self.scales,
            opacities: &mut self.opacities,
            sh: &mut self.sh,
        }
    }

    /// The rotations, and the SH coefficients, which must stay finite.
    pub fn rotations_and_colors_mut(&mut self) -> (&[[f32; 4]], &mut [f32]) {
        (&self.rotations, &mut self.sh)
    }

    /// An empty set with room for `capacity` Gaussians, with colour of SH degree `sh_degree` (0 to 3).
    pub fn with_capacity(sh_degree: u8, capacity: usize) -> Self {
        assert!(sh_degree <= sh::MAX_DEGREE, "SH degree {sh_degree} is above {}", sh::MAX_DEGREE);
        Self {
            sh_degree,
            means: Vec::with_capacity(capacity),
            rotations: Vec::with_capacity(capacity),
            scales: Vec::with_capacity(capacity),
            opacities: Vec::with_capacity(capacity),
            sh: Vec::with_capacity(capacity * sh::coefficients(sh_degree) * 3),
        }
    }

    /// Makes n Gaussians from arrays. Quaternions (w, x, y, z) of any non-zero norm are normalised; those of unit norm
    /// to the rounding of f32 are kept, so a copy through arrays has the same bytes. Any other broken invariant is an
    /// error that names the array and the index.
    ///
    /// `means` `[n][3]` metres, `rotations` `[n][4]`, `scales` `[n][3]` standard deviations in metres,
    /// `opacities` `[n]`, `sh` `[n][(sh_degree + 1)^2][3]` RGB innermost.
    pub fn from_arrays(
        sh_degree: u8,
        means: Vec<[f32; 3]>,
        mut rotations: Vec<[f32; 4]>,
        scales: Vec<[f32; 3]>,
        opacities: Vec<f32>,
        sh: Vec<f32>,
    ) -> Result<Self> {
        if sh_degree > sh::MAX_DEGREE {
            return Err(Error::argument("sh_degree", sh_degree.to_string(), "0 to 3"));
        }
        let n = means.len();
        let per_gaussian = sh::coefficients(sh_degree) * 3;
        let lengths = [
            ("rotations", rotations.len(), n),
            ("scales", scales.len(), n),
            ("opacities", opacities.len(), n),
            ("sh", sh.len(), n * per_gaussian),
        ];
        for (name, found, expected) in lengths {
            if found != expected {
                return Err(Error::argument(
                    name,
                    format!("{found} entries"),
                    format!("{expected} for {n} means"),
                ));
            }
        }
        for (i, mean) in means.iter().enumerate() {
            if !mean.iter().all(|v| v.is_finite()) {
                return Err(Error::argument(format!("means[{i}]"), format!("{mean:?}"), "finite numbers"));
            }
        }
        for (i, q) in rotations.iter_mut().enumerate().filter(|(_, q)| !is_unit(**q)) {
            *q = normalize_quaternion(*q).ok_or_else(|| {
                Error::argument(
                    format!("rotations[{i}]"),
                    format!("{q:?}"),
                    "a finite quaternion that is not zero",
                )
            })?;
        }
        for (i, scale) in scales.iter().enumerate() {
            if !scale.iter().all(|v| SCALE_RANGE.contains(v)) {
                return Err(Error::argument(
                    format!("scales[{i}]"),
                    format!("{scale:?}"),
                    "above 0, to 1e9 m",
                ));
            }
        }
        for (i, opacity) in opacities.iter().enumerate() {
            if !(0.0..=1.0).contains(opacity) {
                return Err(Error::argument(format!("opacities[{i}]"), opacity.to_string(), "0 to 1"));
            }
        }
        if let Some(i) = sh.iter().position(|v| !v.is_finite()) {
            return Err(Error::argument(
                format!("sh[{}]", i / per_gaussian),
                sh[i].to_string(),
                "finite numbers",
            ));
        }
        Ok(Self { sh_degree, means, rotations, scales, opacities, sh })
    }

    /// Appends one Gaussian that meets the invariants; bands above degree 0 become zero.
    #[inline]
    pub fn push(&mut self, g: &Gaussian) {
        debug_assert!(g.is_storable(), "{g:?}");
        self.means.push(g.mean);
        self.rotations.push(g.rotation);
        self.scales.push(g.scale);
        self.opacities.push(g.opacity);
        self.sh.extend_from_slice(&g.sh0);
        let rest = (sh::coefficients(self.sh_degree) - 1) * 3;
        self.sh.resize(self.sh.len() + rest, 0.0);
    }

    /// Appends one Gaussian that meets the invariants with all its coefficients, `[(degree + 1)^2][3]`.
    pub fn push_with_sh(&mut self, g: &Gaussian, sh: &[f32]) {
        self.push(g);
        let start = self.sh.len() - self.sh_stride();
        self.sh[start..].copy_from_slice(sh);
    }

    /// Appends all of `other`, which has the same SH degree.
    pub fn append(&mut self, other: &Self) {
        assert_eq!(self.sh_degree, other.sh_degree, "appending Gaussians of another SH degree");
        self.means.extend_from_slice(&other.means);
        self.rotations.extend_from_slice(&other.rotations);
        self.scales.extend_from_slice(&other.scales);
        self.opacities.extend_from_slice(&other.opacities);
        self.sh.extend_from_slice(&other.sh);
    }

    /// These Gaussians followed by those of `other`, at the higher of their SH degrees; missing bands are zero, which
    /// leaves the colours unchanged.
    pub fn merged(&self, other: &Self) -> Self {
        let mut out = Self::with_capacity(self.sh_degree.max(other.sh_degree), self.len() + other.len());
        let stride = out.sh_stride();
        for part in [self, other] {
            out.means.extend_from_slice(&part.means);
            out.rotations.extend_from_slice(&part.rotations);
            out.scales.extend_from_slice(&part.scales);
            out.opacities.extend_from_slice(&part.opacities);
            append_padded(&mut out.sh, &part.sh, part.sh_stride(), stride);
        }
        out
    }

    /// Removes the Gaussians without `keep[index]`, in place, keeping the order.
    pub fn retain(&mut self, keep: &[bool]) {
        assert_eq!(keep.len(), self.len(), "one flag per Gaussian");
        let runs = runs(keep);
        let stride = self.sh_stride();
        rayon::join(
            || compact(&mut self.sh, &runs, stride),
            || {
                compact(&mut self.means, &runs, 1);
                compact(&mut self.rotations, &runs, 1);
                compact(&mut self.scales, &runs, 1);
                compact(&mut self.opacities, &runs, 1);
            },
        );
    }

    /// Keeps the first `len` Gaussians.
    pub fn truncate(&mut self, len: usize) {
        let stride = self.sh_stride();
        self.means.truncate(len);
        self.rotations.truncate(len);
        self.scales.truncate(len);
        self.opacities.truncate(len);
        self.sh.truncate(len * stride);
    }

    /// The Gaussians with `keep[index]`, in order.
    pub fn filtered(&self, keep: &[bool]) -> Self {
        assert_eq!(keep.len(), self.len(), "one flag per Gaussian");
        let runs = runs(keep);
        Self {
            sh_degree: self.sh_degree,
            means: gather(&self.means, &runs, 1),
            rotations: gather(&self.rotations, &runs, 1),
            scales: gather(&self.scales, &runs, 1),
            opacities: gather(&self.opacities, &runs, 1),
            sh: gather(&self.sh, &runs, self.sh_stride()),
        }
    }

    /// The Gaussians at these indices, which must be below the length, in this order.
    pub(super) fn gathered(&self, indices: &[usize]) -> Self {
        let stride = self.sh_stride();
        Self {
            sh_degree: self.sh_degree,
            means: indices.iter().map(|&i| self.means[i]).collect(),
            rotations: indices.iter().map(|&i| self.rotations[i]).collect(),
            scales: indices.iter().map(|&i| self.scales[i]).collect(),
            opacities: indices.iter().map(|&i| self.opacities[i]).collect(),
            sh: indices.iter().flat_map(|&i| &self.sh[i * stride..(i + 1) * stride]).copied().collect(),
        }
    }

    /// The arrays that a move changes.
    pub(super) fn moved_arrays_mut(&mut self) -> MovedArrays<'_> {
        MovedArrays {
            means: &mut self.means,
            rotations: &mut self.rotations,
            scales: &mut self.scales,
            sh: &mut self.sh,
        }
    }

    /// Appends a copy of the Gaussians with `which[index]`, in order.
    pub(super) fn append_copies(&mut self, which: &[bool]) {
        assert_eq!(which.len(), self.len(), "one flag per Gaussian");
        let runs = runs(which);
        let stride = self.sh_stride();
        // Colour takes most of a Gaussian's memory, so this split balances the traffic.
        rayon::join(
            || append_runs(&mut self.sh, &runs, stride),
            || {
                append_runs(&mut self.means, &runs, 1);
                append_runs(&mut self.rotations, &runs, 1);
                append_runs(&mut self.scales, &runs, 1);
                append_runs(&mut self.opacities, &runs, 1);
            },
        );
    }

    /// The number of Gaussians.
    #[inline]
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// Whether there are no Gaussians.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Highest SH degree stored, 0 to 3.
    #[inline]
    pub fn sh_degree(&self) -> u8 {
        self.sh_degree
    }

    /// Floats of SH per Gaussian: (degree + 1)^2 * 3.
    #[inline]
    pub fn sh_stride(&self) -> usize {
        sh::coefficients(self.sh_degree) * 3
    }

    /// Centres in metres. `[n][3]`
    #[inline]
    pub fn means(&self) -> &[[f32; 3]] {
        &self.means
    }

    /// `vehicle_from_gaussian`, unit quaternions (w, x, y, z). `[n][4]`
    #[inline]
    pub fn rotations(&self) -> &[[f32; 4]] {
        &self.rotations
    }

    /// Standard deviations in metres. `[n][3]`
    #[inline]
    pub fn scales(&self) -> &[[f32; 3]] {
        &self.scales
    }

    /// Peak opacities in [0, 1]. `[n]`
    #[inline]
    pub fn opacities(&self) -> &[f32] {
        &self.opacities
    }

    /// SH coefficients, `[n][(degree + 1)^2][3]`, RGB innermost.
    #[inline]
    pub fn sh(&self) -> &[f32] {
        &self.sh
    }

    /// Lowest and highest centre, metres, or `None` when empty.
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let first = *self.means.first()?;
        Some(self.means.iter().fold((first, first), |(mut lo, mut hi), m| {
            for k in 0..3 {
                lo[k] = lo[k].min(m[k]);
                hi[k] = hi[k].max(m[k]);
            }
            (lo, hi)
        }))
    }
}

/// Maximal runs of set flags. There are few, because pixels of views are stored row by row.
fn runs(keep: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (i, _) in keep.iter().enumerate().filter(|(_, k)| **k) {
        match runs.last_mut() {
            Some(run) if run.end == i => run.end = i + 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs
}

/// Moves the runs together at the front and truncates the rest.
fn compact<T: Copy>(values: &mut Vec<T>, runs: &[Range<usize>], stride: usize) {
    let mut end = 0;
    for run in runs {
        let (start, stop) = (run.start * stride, run.end * stride);
        if start != end {
            values.copy_within(start..stop, end);
        }
        end += stop - start;
    }
    values.truncate(end);
}

/// Appends copies of the runs.
fn append_runs<T: Copy>(values: &mut Vec<T>, runs: &[Range<usize>], stride: usize) {
    values.reserve(runs.iter().map(|r| r.len() * stride).sum());
    for run in runs {
        values.extend_from_within(run.start * stride..run.end * stride);
    }
}

/// Copies pieces of `stride` values to the end, each filled up with zeros to `padded` values.
fn append_padded(values: &mut Vec<f32>, pieces: &[f32], stride: usize, padded: usize) {
    if stride == padded {
        return values.extend_from_slice(pieces);
    }
    for piece in pieces.chunks_exact(stride) {
        values.extend_from_slice(piece);
        values.resize(values.len() + padded - stride, 0.0);
    }
}

/// The concatenated runs.
fn gather<T: Copy>(values: &[T], runs: &[Range<usize>], stride: usize) -> Vec<T> {
    let mut out = Vec::with_capacity(runs.iter().map(|r| r.len() * stride).sum());
    for run in runs {
        out.extend_from_slice(&values[run.start * stride..run.end * stride]);
    }
    out
}

/// The unit quaternion along `q`; `None` if it is zero or not finite. Computed in f64, where the square of a finite f32
/// neither overflows nor underflows.
#[inline]
pub fn normalize_quaternion(q: [f32; 4]) -> Option<[f32; 4]> {
    let norm = q.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    (norm > 0.0 && norm.is_finite()).then(|| q.map(|v| (f64::from(v) / norm) as f32))
}

/// Whether the norm of `q` is 1 to the rounding of f32.
fn is_unit(q: [f32; 4]) -> bool {
    // Rounding each entry once moves the square of the norm by 2^-23; rotations that heads compute in f32 are off by up
    // to twice that.
    const SQUARED: f64 = 8.0 * f32::EPSILON as f64;
    (q.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() - 1.0).abs() <= SQUARED
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(rotation: [f32; 4], scale: [f32; 3], opacity: f32) -> Result<Gaussians> {
        Gaussians::from_arrays(0, vec![[0.0; 3]], vec![rotation], vec![scale], vec![opacity], vec![0.0; 3])
    }

    #[test]
    fn quaternions_of_norm_1e_minus_30_and_1e30_are_normalised_and_zero_is_refused() {
        for scale in [1e-30f32, 1e30] {
            let g = one([0.0, scale, 0.0, -scale], [1.0; 3], 1.0).unwrap();
            let h = std::f32::consts::FRAC_1_SQRT_2;
            assert_eq!(g.rotations()[0], [0.0, h, 0.0, -h]);
        }
        assert!(one([0.0; 4], [1.0; 3], 1.0).unwrap_err().to_string().starts_with("rotations[0]"));
    }

    #[test]
    fn a_copy_through_arrays_has_the_same_bytes() {
        // Normalising these twice would change the last bits of about every fourth.
        let rotation = |i: u32| [1.0, 0.3, -0.7, 0.2].map(|v: f32| (v * (i as f32 + 0.5) * 1.7).sin());
        let rotations: Vec<_> = (0..200).map(|i| normalize_quaternion(rotation(i)).unwrap()).collect();
        assert!(rotations.iter().any(|&q| normalize_quaternion(q) != Some(q)));
        for q in rotations {
            assert_eq!(one(q, [1.0; 3], 1.0).unwrap().rotations()[0], q);
        }
        let longer = [0.5f32, 0.5, 0.5, 0.500_01];
        assert_eq!(one(longer, [1.0; 3], 1.0).unwrap().rotations()[0], normalize_quaternion(longer).unwrap());
    }

    #[test]
    fn retaining_and_filtering_keep_the_same_in_order() {
        let n = 100;
        let sh: Vec<f32> = (0..n * 12).map(|i| i as f32).collect();
        let means = (0..n).map(|i| [i as f32, 0.0, 0.0]).collect();
        let unit = vec![[1.0, 0.0, 0.0, 0.0]; n];
        let all = Gaussians::from_arrays(1, means, unit, vec![[0.1; 3]; n], vec![0.5; n], sh).unwrap();
        let keep: Vec<bool> = (0..n).map(|i| i % 7 > 2).collect();
        let mut retained = all.clone();
        retained.retain(&keep);
        assert_eq!(retained, all.filtered(&keep));
        let expected: Vec<usize> = (0..n).filter(|&i| keep[i]).collect();
        assert_eq!(retained.len(), expected.len());
        for (k, &i) in expected.iter().enumerate() {
            assert_eq!(retained.means()[k], all.means()[i]);
            assert_eq!(retained.sh()[k * 12..][..12], all.sh()[i * 12..][..12]);
        }
    }

    #[test]
    fn merging_keeps_the_order_and_fills_the_missing_bands_with_zeros() {
        let unit = [1.0, 0.0, 0.0, 0.0];
        let low = one(unit, [0.1; 3], 0.3).unwrap();
        let sh: Vec<f32> = (1..=12).map(|v| v as f32).collect();
        let high =
            Gaussians::from_arrays(1, vec![[1.0; 3]], vec![unit], vec![[0.2; 3]], vec![0.7], sh.clone())
                .unwrap();
        let both = low.merged(&high);
        assert_eq!((both.len(), both.sh_degree()), (2, 1));
        assert_eq!(both.means(), [[0.0; 3], [1.0; 3]]);
        assert_eq!(
            (both.scales(), both.opacities()),
            ([[0.1; 3], [0.2; 3]].as_slice(), [0.3, 0.7].as_slice())
        );
        assert_eq!(both.sh(), [[0.0; 12].as_slice(), sh.as_slice()].concat());
        let swapped = high.merged(&low);
        assert_eq!(swapped.sh(), [sh.as_slice(), [0.0; 12].as_slice()].concat());
        assert_eq!(swapped.opacities(), [0.7, 0.3]);
    }

    #[test]
    fn merging_with_none_returns_the_same_bytes_and_merging_equals_appending() {
        let some = one([0.5; 4], [0.1; 3], 0.3).unwrap();
        let none = Gaussians::default();
        assert_eq!(some.merged(&none), some);
        assert_eq!(none.merged(&some), some);
        let mut appended = some.clone();
        appended.append(&some);
        assert_eq!(some.merged(&some), appended);
    }

    #[test]
    fn each_broken_invariant_is_an_error_that_names_the_array() {
        let unit = [1.0, 0.0, 0.0, 0.0];
        assert!(one(unit, [1.0, 0.0, 1.0], 1.0).unwrap_err().to_string().starts_with("scales[0]"));
        assert!(one(unit, [1.0; 3], 1.5).unwrap_err().to_string().starts_with("opacities[0]"));
        assert!(one(unit, [f32::NAN; 3], 1.0).is_err());
        assert!(one([f32::INFINITY, 0.0, 0.0, 0.0], [1.0; 3], 1.0).is_err());
        assert!(Gaussians::from_arrays(4, vec![], vec![], vec![], vec![], vec![]).is_err());
        assert!(Gaussians::from_arrays(0, vec![[0.0; 3]], vec![], vec![], vec![], vec![]).is_err());
    }
}
