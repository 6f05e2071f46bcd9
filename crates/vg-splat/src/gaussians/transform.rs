//! Gaussians moved into another frame by a similarity p_to = s R p_from + t.
//!
//! mu' = s R mu + t and Sigma' = s^2 R Sigma R^T: the Gaussian's own rotation is multiplied by R from the left, its
//! standard deviations by s. The moved Gaussian has along R d the colour that the given one has along d. Under a
//! rotation, band l of the harmonics mixes only within itself, so this is one orthogonal (2l + 1)-matrix per band.

use super::buffer::{Gaussians, MovedArrays, SCALE_RANGE};
use super::sh;
use glam::{DMat3, DQuat, DVec3, Vec3};
use rayon::prelude::*;
use vg_geometry::{Error, Pose, Result, Similarity};

/// Limit of the coordinates of means, metres. An f32 has 24 significant bits: from 2^e to 2^(e + 1) its step is
/// 2^(e - 23), which is 0.98 mm below 2^14 m and 1.95 mm from there on.
pub const MAX_COORDINATE_M: f32 = 16_384.0;

impl Gaussians {
    /// These Gaussians in another frame, in the same order. The identity returns the same bytes, a translation does not
    /// change rotations and colours, and the result is the same for any number of threads.
    ///
    /// Everything is computed in f64 and stored in f32; the colour along a rotated direction equals the original one to
    /// 1e-6 of the length of the coefficients.
    ///
    /// # Errors
    /// The similarity is not finite, not a rotation with a positive scale, or would move
    /// * a mean to [`MAX_COORDINATE_M`] or beyond, where an f32 cannot represent a millimetre: leave the Gaussians in
    ///   the vehicle frame then, and move the cameras, whose poses are f64;
    /// * a standard deviation out of [`SCALE_RANGE`];
    /// * an SH coefficient beyond the largest f32.
    pub fn transformed(&self, to_from_vehicle: &Similarity) -> Result<Self> {
        if *to_from_vehicle == Similarity::IDENTITY {
            return Ok(self.clone());
        }
        let similarity = checked(to_from_vehicle)?;
        let mut out = self.clone();
        let (degree, stride) = (self.sh_degree(), self.sh_stride());
        let MovedArrays { means, rotations, scales, sh } = out.moved_arrays_mut();
        means.par_chunks_mut(CHUNK).for_each(|means| move_means(means, &similarity));
        scales.par_chunks_mut(CHUNK).for_each(|scales| grow_scales(scales, similarity.scale));
        if similarity.rotation != DMat3::IDENTITY {
            let turn = DQuat::from_mat3(&similarity.rotation);
            rotations.par_chunks_mut(CHUNK).for_each(|rotations| turn_rotations(rotations, turn));
            if degree > 0 {
                let bands = BandRotations::new(similarity.rotation);
                sh.par_chunks_mut(CHUNK * stride).for_each(|sh| bands.turn_colors(sh, stride));
            }
        }
        check_moved(&out)?;
        Ok(out)
    }
}

/// Gaussians per parallel chunk: small enough to keep all threads busy.
const CHUNK: usize = 1 << 13;

const ARGUMENT: &str = "to_from_vehicle";

/// Checks the similarity, whose public fields may hold anything, and removes noise from its rotation.
fn checked(similarity: &Similarity) -> Result<Similarity> {
    let scale = similarity.scale;
    if !(scale.is_finite() && scale > 0.0) {
        return Err(Error::argument(format!("{ARGUMENT}.scale"), scale.to_string(), "above 0, finite"));
    }
    let pose = Pose::new(ARGUMENT, similarity.rotation, similarity.translation)?;
    Ok(Similarity { scale, rotation: pose.rotation, translation: pose.translation })
}

fn move_means(means: &mut [[f32; 3]], similarity: &Similarity) {
    for m in means {
        *m = similarity.transform_point(Vec3::from_array(*m).as_dvec3()).as_vec3().to_array();
    }
}

fn grow_scales(scales: &mut [[f32; 3]], factor: f64) {
    for s in scales {
        *s = s.map(|s| (f64::from(s) * factor) as f32);
    }
}

fn turn_rotations(rotations: &mut [[f32; 4]], turn: DQuat) {
    for wxyz in rotations {
        let [w, x, y, z] = wxyz.map(f64::from);
        let q = (turn * DQuat::from_xyzw(x, y, z, w)).normalize();
        *wxyz = [q.w, q.x, q.y, q.z].map(|v| v as f32);
    }
}

/// Checks that the moved Gaussians still meet the invariants. The error names the first that does not, whatever the
/// number of threads.
fn check_moved(moved: &Gaussians) -> Result<()> {
    // Written so that NaN fails.
    let held = |c: &f32| c.abs() < MAX_COORDINATE_M;
    if let Some(i) = moved.means().par_iter().position_first(|m| !m.iter().all(held)) {
        return Err(Error::argument(
            ARGUMENT,
            format!("puts means[{i}] at {:?} m", moved.means()[i]),
            format!("coordinates below {MAX_COORDINATE_M} m, where an f32 still holds 1 mm"),
        ));
    }
    let held = |s: &f32| SCALE_RANGE.contains(s);
    if let Some(i) = moved.scales().par_iter().position_first(|s| !s.iter().all(held)) {
        return Err(Error::argument(
            ARGUMENT,
            format!("makes scales[{i}] {:?} m", moved.scales()[i]),
            "above 0, to 1e9 m",
        ));
    }
    if let Some(i) = moved.sh().par_iter().position_first(|v| !v.is_finite()) {
        return Err(Error::argument(
            ARGUMENT,
            format!("makes sh[{}] {}", i / moved.sh_stride(), moved.sh()[i]),
            "coefficients that a rotation keeps below the largest f32",
        ));
    }
    Ok(())
}

/// Matrices by which bands 1 to 3 mix: moved = matrix given, row-major.
struct BandRotations {
    one: [[f64; 3]; 3],
    two: [[f64; 5]; 5],
    three: [[f64; 7]; 7],
}

impl BandRotations {
    fn new(rotation: DMat3) -> Self {
        Self { one: band_rotation(rotation), two: band_rotation(rotation), three: band_rotation(rotation) }
    }

    /// Rotates the coefficients `[n][stride / 3][3]`.
    fn turn_colors(&self, sh: &mut [f32], stride: usize) {
        for one in sh.as_chunks_mut::<3>().0.chunks_exact_mut(stride / 3) {
            turn_band(&self.one, &mut one[1..]);
            if stride >= 3 * sh::coefficients(2) {
                turn_band(&self.two, &mut one[4..]);
            }
            if stride >= 3 * sh::coefficients(3) {
                turn_band(&self.three, &mut one[9..]);
            }
        }
    }
}

fn turn_band<const N: usize>(matrix: &[[f64; N]; N], band: &mut [[f32; 3]]) {
    let given: [[f64; 3]; N] = std::array::from_fn(|k| band[k].map(f64::from));
    for (row, moved) in matrix.iter().zip(band) {
        let mut sum = [0.0; 3];
        for (weight, rgb) in row.iter().zip(&given) {
            for c in 0..3 {
                sum[c] += weight * rgb[c];
            }
        }
        *moved = sum.map(|v| v as f32);
    }
}

/// The matrix of the band of N = 2l + 1 functions. The moved colour along e is the given one along R^T e; the basis is
/// orthonormal, so entry j, k is the integral of Y_j(e) Y_k(R^T e) over the sphere. An exact quadrature avoids the sign
/// conventions of the usual recursions and any inversion: it is right for the basis of `sh::basis`, whatever its signs
/// and order, to the rounding of f64.
fn band_rotation<const N: usize>(rotation: DMat3) -> [[f64; N]; N] {
    let first = (N / 2) * (N / 2); // functions in the bands below
    let from_to = rotation.transpose();
    let mut matrix = [[0.0; N]; N];
    for (direction, weight) in sphere_nodes() {
        let moved = sh::basis(direction.to_array(), sh::MAX_DEGREE);
        let given = sh::basis((from_to * direction).to_array(), sh::MAX_DEGREE);
        for j in 0..N {
            for k in 0..N {
                matrix[j][k] += weight * moved[first + j] * given[first + k];
            }
        }
    }
    matrix
}

/// Directions and weights that integrate polynomials of degree up to 7 over the sphere exactly; two functions of
/// band 3 make one of degree 6. Four Gauss-Legendre nodes in z times eight even steps of azimuth.
fn sphere_nodes() -> impl Iterator<Item = (DVec3, f64)> {
    const AZIMUTHS: u32 = 8;
    let step = std::f64::consts::TAU / f64::from(AZIMUTHS);
    let ring = |inner: bool| {
        let sign = if inner { 1.0 } else { -1.0 };
        let z = (3.0 / 7.0 - sign * 2.0 / 7.0 * 1.2f64.sqrt()).sqrt();
        (z, (18.0 + sign * 30.0f64.sqrt()) / 36.0)
    };
    let heights = [ring(true), ring(false)].into_iter().flat_map(|(z, weight)| [(z, weight), (-z, weight)]);
    heights.flat_map(move |(z, weight)| {
        let radius = (1.0 - z * z).sqrt();
        (0..AZIMUTHS).map(move |k| {
            let (sin, cos) = (step * f64::from(k)).sin_cos();
            (DVec3::new(radius * cos, radius * sin, z), weight * step)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest entry of M^T M - I.
    fn defect<const N: usize>(m: &[[f64; N]; N]) -> f64 {
        let dot = |a: usize, b: usize| (0..N).map(|k| m[k][a] * m[k][b]).sum::<f64>();
        (0..N * N).fold(0.0, |worst, i| {
            let (a, b) = (i / N, i % N);
            worst.max((dot(a, b) - if a == b { 1.0 } else { 0.0 }).abs())
        })
    }

    #[test]
    fn band_rotations_are_orthogonal_to_the_rounding_of_f64() {
        for i in 0..50 {
            let t = f64::from(i);
            let r = DMat3::from_euler(glam::EulerRot::ZYX, 0.7 * t, 1.3 * t, 0.37 * t);
            let BandRotations { one, two, three } = BandRotations::new(r);
            // 32 summands, each a product of rounded polynomials, twice.
            assert!(defect(&one).max(defect(&two)).max(defect(&three)) < 1e-14, "rotation {i}");
        }
    }

    #[test]
    fn the_weights_cover_the_sphere_once() {
        let area: f64 = sphere_nodes().map(|(_, weight)| weight).sum();
        // 32 sums below 12.6, each rounded by half of 1.8e-15 at most.
        assert!((area - 4.0 * std::f64::consts::PI).abs() < 3e-14, "{area}");
        assert!(sphere_nodes().all(|(d, _)| (d.length() - 1.0).abs() < 1e-15));
    }

    #[test]
    fn an_f32_step_is_below_a_millimetre_up_to_the_limit_and_above_it_from_there() {
        let step = |v: f32| f64::from(v.next_up()) - f64::from(v);
        assert!(step(MAX_COORDINATE_M.next_down()) < 1e-3 && step(MAX_COORDINATE_M) > 1e-3);
    }
}
