//! Rigid transforms `to_from`: p_to = R p_from + t (paper eq. 4).

use crate::error::{Error, Result};
use glam::{DMat3, DQuat, DVec3, Vec3};

/// Largest entry of `R^T R - I` that is taken for noise and removed (poses written with three digits).
pub const MAX_ORTHONORMALITY_ERROR: f64 = 1e-2;

/// Times this a point of the vehicle frame is its mirror image across y = 0.
pub const MIRROR_Y: Vec3 = Vec3::new(1.0, -1.0, 1.0);

/// A rotation and a translation in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Orthonormal, determinant +1.
    pub rotation: DMat3,
    /// Metres.
    pub translation: DVec3,
}

impl Pose {
    /// The transform that changes nothing.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// Makes a pose from a matrix that is a rotation up to noise of [`MAX_ORTHONORMALITY_ERROR`], which is removed
    /// (nearest rotation). Reflections, scales and non-finite numbers are errors that name `argument`.
    pub fn new(argument: &str, rotation: DMat3, translation: DVec3) -> Result<Self> {
        if !rotation.is_finite() || !translation.is_finite() {
            return Err(Error::argument(argument, "a NaN or infinite entry", "finite numbers"));
        }
        let defect = rotation.transpose() * rotation - DMat3::IDENTITY;
        let worst = defect.to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let determinant = rotation.determinant();
        if worst > MAX_ORTHONORMALITY_ERROR || determinant <= 0.0 {
            return Err(Error::argument(
                argument,
                format!("|R^T R - I| = {worst:.3e}, det R = {determinant:.4}"),
                format!(
                    "a rotation: |R^T R - I| <= {MAX_ORTHONORMALITY_ERROR}, det R > 0 (no scale, no mirror)"
                ),
            ));
        }
        Ok(Self { rotation: nearest_rotation(rotation), translation })
    }

    /// From the upper three rows of a 4x4 matrix, row-major `[R | t]`.
    pub fn from_row_major(argument: &str, m: &[f64; 12]) -> Result<Self> {
        let rotation = DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]);
        Self::new(argument, rotation, DVec3::new(m[3], m[7], m[11]))
    }

    /// Makes a pose from a quaternion (w, x, y, z) of any non-zero finite norm.
    pub fn from_wxyz(argument: &str, wxyz: [f64; 4], translation: DVec3) -> Result<Self> {
        // Divide by the largest entry first, so that norms of 1e-200 and 1e200 neither vanish nor overflow.
        let largest = wxyz.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if !(largest > 0.0 && wxyz.iter().all(|x| x.is_finite()) && translation.is_finite()) {
            return Err(Error::argument(
                argument,
                format!("quaternion {wxyz:?}, translation {translation}"),
                "finite numbers and a quaternion that is not zero",
            ));
        }
        let [w, x, y, z] = wxyz.map(|v| v / largest);
        let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        Ok(Self { rotation, translation })
    }

    /// The row-major matrix `[R | t]`.
    pub fn to_row_major(&self) -> [f64; 12] {
        let r = self.rotation.transpose().to_cols_array();
        let t = self.translation;
        [r[0], r[1], r[2], t.x, r[3], r[4], r[5], t.y, r[6], r[7], r[8], t.z]
    }

    /// The inverse transform: `from_to` of this `to_from`.
    #[inline]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Maps a point, metres.
    #[inline]
    pub fn transform_point(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.translation
    }

    /// `self` after `first`: `c_from_b.after(&b_from_a)` is `c_from_a`.
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            translation: self.transform_point(first.translation),
        }
    }

    /// The mirrored pose across y = 0 with the camera's x axis flipped too, so that it stays a rotation:
    /// M R diag(-1,1,1), M t. It sees the mirrored vehicle as the horizontally flipped picture.
    pub fn mirrored(&self) -> Self {
        let m = DMat3::from_diagonal(MIRROR_Y.as_dvec3());
        let flip = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        Self { rotation: m * self.rotation * flip, translation: m * self.translation }
    }
}

/// The rotation nearest to a nearly orthonormal matrix (polar factor), by Newton's iteration
/// X <- (X + X^-T) / 2, which converges quadratically from inside the accepted noise.
fn nearest_rotation(mut r: DMat3) -> DMat3 {
    for _ in 0..8 {
        let next = (r + r.inverse().transpose()) * 0.5;
        let change = (next - r).to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
        r = next;
        if change < 1e-16 {
            break;
        }
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_noise_is_removed_and_a_mirror_or_a_scale_is_refused() {
        let r = DMat3::from_euler(glam::EulerRot::ZYX, 0.3, -0.2, 0.1);
        let mut noisy = r;
        noisy.x_axis.y += 1e-3;
        let pose = Pose::new("pose", noisy, DVec3::ZERO).unwrap();
        let defect = pose.rotation.transpose() * pose.rotation - DMat3::IDENTITY;
        assert!(defect.to_cols_array().iter().all(|x| x.abs() < 1e-14));
        assert!((pose.rotation - r).to_cols_array().iter().all(|x| x.abs() < 1.1e-3));

        let mirror = r * DMat3::from_diagonal(MIRROR_Y.as_dvec3());
        let error = Pose::new("views[0].pose", mirror, DVec3::ZERO).unwrap_err().to_string();
        assert!(error.contains("views[0].pose") && error.contains("det R"), "{error}");
        assert!(Pose::new("pose", r * 1.1, DVec3::ZERO).is_err());
        assert!(Pose::new("pose", r, DVec3::new(f64::NAN, 0.0, 0.0)).is_err());
    }

    #[test]
    fn quaternions_of_any_norm_give_the_same_rotation() {
        let q = [0.5, -0.5, 0.5, 0.5];
        let one = Pose::from_wxyz("q", q, DVec3::ZERO).unwrap();
        for scale in [1e-300, 1e-30, 1e30, 1e300] {
            let other = Pose::from_wxyz("q", q.map(|x| x * scale), DVec3::ZERO).unwrap();
            assert!((one.rotation - other.rotation).to_cols_array().iter().all(|x| x.abs() < 1e-15));
        }
        assert!(Pose::from_wxyz("q", [0.0; 4], DVec3::ZERO).is_err());
    }

    #[test]
    fn a_mirrored_camera_sees_mirrored_points_at_flipped_columns() {
        let r = DMat3::from_euler(glam::EulerRot::ZYX, 0.7, -0.4, 1.1);
        let pose = Pose::new("pose", r, DVec3::new(1.0, -5.0, 0.7)).unwrap();
        let p = DVec3::new(0.3, 0.8, -0.2);
        let seen = pose.inverse().transform_point(p);
        let seen_mirrored = pose.mirrored().inverse().transform_point(DVec3::new(p.x, -p.y, p.z));
        assert!((seen_mirrored - DVec3::new(-seen.x, seen.y, seen.z)).length() < 1e-12);
        assert!((pose.mirrored().rotation.determinant() - 1.0).abs() < 1e-12);
    }
}
