//! Similarities, and the one that best maps known points onto known points (Umeyama 1991).

use super::pose::Pose;
use crate::error::{Error, Result};
use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, SVD};

/// p_to = scale R p_from + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Positive.
    pub scale: f64,
    /// Orthonormal, determinant +1.
    pub rotation: DMat3,
    /// In units of the target frame.
    pub translation: DVec3,
}

impl Similarity {
    /// The transform that changes nothing.
    pub const IDENTITY: Self = Self { scale: 1.0, rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// Converts a row-major 4x4 matrix whose upper-left block is a scaled rotation and whose last row is 0 0 0 1.
    pub fn from_row_major(argument: &str, m: &[f64; 16]) -> Result<Self> {
        if m[12] != 0.0 || m[13] != 0.0 || m[14] != 0.0 || m[15] != 1.0 {
            return Err(Error::argument(argument, format!("last row {:?}", &m[12..]), "0 0 0 1"));
        }
        let block = DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]);
        let determinant = block.determinant();
        let scale = determinant.cbrt();
        if !(scale.is_finite() && scale > 0.0) {
            return Err(Error::argument(
                argument,
                format!("det = {determinant}"),
                "a scaled rotation, determinant > 0",
            ));
        }
        let pose = Pose::new(argument, block * scale.recip(), DVec3::new(m[3], m[7], m[11]))?;
        Ok(Self { scale, rotation: pose.rotation, translation: pose.translation })
    }

    /// The row-major 4x4 matrix.
    pub fn to_row_major(&self) -> [f64; 16] {
        let r = (self.rotation * self.scale).transpose().to_cols_array();
        let t = self.translation;
        [r[0], r[1], r[2], t.x, r[3], r[4], r[5], t.y, r[6], r[7], r[8], t.z, 0.0, 0.0, 0.0, 1.0]
    }

    /// The inverse similarity.
    pub fn inverse(&self) -> Self {
        let (scale, rotation) = (self.scale.recip(), self.rotation.transpose());
        Self { scale, rotation, translation: -scale * (rotation * self.translation) }
    }

    /// Maps a point.
    pub fn transform_point(&self, p: DVec3) -> DVec3 {
        self.scale * (self.rotation * p) + self.translation
    }

    /// Maps `from_from_camera` to `to_from_camera`: the camera keeps its own axes; its position is scaled.
    pub fn transform_pose(&self, pose: &Pose) -> Pose {
        Pose { rotation: self.rotation * pose.rotation, translation: self.transform_point(pose.translation) }
    }

    /// The least-squares similarity that takes `from[i]` to `to[i]` (Umeyama 1991, eqs. 38 to 43).
    /// At least three points that are not on one line.
    pub fn umeyama(from: &[DVec3], to: &[DVec3]) -> Result<Self> {
        if from.len() != to.len() {
            let found = format!("{} to match {}", from.len(), to.len());
            return Err(Error::argument("points", found, "two lists of equal length"));
        }
        if from.len() < 3 {
            return Err(Error::argument("points", format!("{} in each list", from.len()), "at least 3"));
        }
        if from.iter().chain(to).any(|p| !p.is_finite()) {
            return Err(Error::argument("points", "a NaN or infinite coordinate", "finite numbers"));
        }
        let n = from.len() as f64;
        let mean_from = from.iter().sum::<DVec3>() / n;
        let mean_to = to.iter().sum::<DVec3>() / n;
        let mut covariance = Matrix3::<f64>::zeros();
        let mut variance_from = 0.0;
        for (f, t) in from.iter().zip(to) {
            let (f, t) = (*f - mean_from, *t - mean_to);
            variance_from += f.length_squared() / n;
            for row in 0..3 {
                for column in 0..3 {
                    covariance[(row, column)] += t[row] * f[column] / n;
                }
            }
        }
        let svd = SVD::new(covariance, true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            return Err(Error::argument(
                "points",
                "no singular value decomposition",
                "points that span a plane",
            ));
        };
        let d = svd.singular_values;
        // Two distinct directions fix a rotation; a line leaves it free to spin.
        if d[0].is_nan() || d[0] <= 0.0 || d[1] <= 1e-9 * d[0] {
            return Err(Error::argument(
                "points",
                "all on one line or in one place",
                "points that span at least a plane",
            ));
        }
        let mut sign = Matrix3::identity();
        if (u.determinant() * v_t.determinant()) < 0.0 {
            sign[(2, 2)] = -1.0;
        }
        let r = u * sign * v_t;
        let scale = (d[0] + d[1] + sign[(2, 2)] * d[2]) / variance_from;
        let rotation = DMat3::from_cols_slice(r.as_slice());
        Ok(Self { scale, rotation, translation: mean_to - scale * (rotation * mean_from) })
    }
}
