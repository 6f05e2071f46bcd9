//! Covariances of Gaussians: Sigma = R S S^T R^T.

use super::buffer::Gaussians;
use glam::{DMat3, DQuat, DVec3};

impl Gaussians {
    /// Covariance matrices in the vehicle frame, square metres: xx, xy, xz, yy, yz, zz of each, in the order of 3D
    /// Gaussian Splatting. Computed in f64; values below the smallest f32 become 0. `[n][6]`
    pub fn covariances(&self) -> Vec<[f32; 6]> {
        self.rotations().iter().zip(self.scales()).map(|(q, s)| covariance(*q, *s)).collect()
    }
}

fn covariance(rotation_wxyz: [f32; 4], scale: [f32; 3]) -> [f32; 6] {
    let [w, x, y, z] = rotation_wxyz.map(f64::from);
    let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    let half = rotation * DMat3::from_diagonal(DVec3::from_array(scale.map(f64::from)));
    let m = half * half.transpose();
    [m.x_axis.x, m.x_axis.y, m.x_axis.z, m.y_axis.y, m.y_axis.z, m.z_axis.z].map(|v| v as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariances_have_the_scales_squared_along_the_turned_axes() {
        // A quarter turn about z: the Gaussian's x axis is the vehicle's y axis.
        let quarter = std::f32::consts::FRAC_1_SQRT_2;
        let rotations = vec![[quarter, 0.0, 0.0, quarter], [0.8, 0.2, -0.4, 0.4]];
        let scales = vec![[2.0, 3.0, 0.5], [0.1, 0.02, 1e-3]];
        let g = Gaussians::from_arrays(0, vec![[0.0; 3]; 2], rotations, scales, vec![1.0; 2], vec![0.0; 6])
            .unwrap();
        let [first, second] = g.covariances().try_into().unwrap();
        let near = |a: f32, b: f64, tolerance: f64| (f64::from(a) - b).abs() <= tolerance;
        // Quaternions are accurate to 6e-8.
        let expected = [9.0, 0.0, 0.0, 4.0, 0.0, 0.25];
        assert!(first.iter().zip(expected).all(|(a, b)| near(*a, b, 2e-6)), "{first:?}");
        // By hand: the columns of R for (0.8, 0.2, -0.4, 0.4), 2 (x y + w z) = 2 (-0.08 + 0.32) for one.
        let axes = [[0.36, 0.48, 0.8], [-0.8, 0.6, 0.0], [-0.48, -0.64, 0.6]];
        let variances = [1e-2, 4e-4, 1e-6];
        let entry = |a: usize, b: usize| (0..3).map(|k| variances[k] * axes[k][a] * axes[k][b]).sum::<f64>();
        let expected = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        assert!(second.iter().zip(expected).all(|(a, b)| near(*a, b, 1e-8)), "{second:?} {expected:?}");
    }
}
