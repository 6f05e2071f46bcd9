//! Points measured on the vehicle, in addition to the photographs: a LiDAR sweep, a scan, triangulated features.

use glam::{DVec3, Vec3};
use std::sync::Arc;
use vg_geometry::{Error, Result, Similarity};

/// Maximum of points of a cloud.
pub const MAX_CLOUD_POINTS: usize = 10_000_000;

/// Points in the vehicle frame, metres, in any order, all finite. Some may be wrong or show something else.
/// Clones share them.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud(Arc<[[f32; 3]]>);

impl Cloud {
    /// A cloud of 1 to [`MAX_CLOUD_POINTS`] points.
    pub fn new(points: Vec<[f32; 3]>) -> Result<Self> {
        Self::check("cloud", &points)?;
        Ok(Self(points.into()))
    }

    /// Checks the number of points and that all are finite; `argument` names them in the error.
    pub fn check(argument: &str, points: &[[f32; 3]]) -> Result<()> {
        if points.is_empty() || points.len() > MAX_CLOUD_POINTS {
            let allowed = format!("1 to {MAX_CLOUD_POINTS} points");
            return Err(Error::argument(argument, format!("{} points", points.len()), allowed));
        }
        if let Some(i) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            let argument = format!("{argument}[{i}]");
            return Err(Error::argument(argument, format!("{:?}", points[i]), "finite, metres"));
        }
        Ok(())
    }

    /// The points, vehicle frame, metres. `[n][3]`
    pub fn points(&self) -> &[[f32; 3]] {
        &self.0
    }

    /// The points in the frame whose pose in the vehicle frame is `vehicle_from_frame`, a rigid motion.
    pub fn in_frame(&self, vehicle_from_frame: &Similarity) -> Self {
        let back = vehicle_from_frame.rotation.transpose();
        let largest = DVec3::splat(f64::from(f32::MAX));
        let point = |p: &[f32; 3]| {
            let p = back * (Vec3::from_array(*p).as_dvec3() - vehicle_from_frame.translation);
            // A rotation can take the largest numbers beyond the range of f32.
            p.clamp(-largest, largest).as_vec3().to_array()
        };
        Self(self.0.iter().map(point).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_too_large_and_non_finite_clouds_are_refused() {
        let error = |points| Cloud::new(points).unwrap_err().to_string();
        assert!(error(vec![]).contains("0 points"));
        assert!(error(vec![[0.0; 3], [0.0, f32::NAN, 0.0]]).contains("cloud[1]"));
        assert!(error(vec![[f32::INFINITY, 0.0, 0.0]]).contains("finite"));
        assert!(error(vec![[0.0; 3]; MAX_CLOUD_POINTS + 1]).contains("10000001"));
        assert_eq!(Cloud::new(vec![[1e30; 3]]).unwrap().points(), [[1e30; 3]]);
    }
}
