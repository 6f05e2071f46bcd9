//! Mirroring across the symmetry plane y = 0 (paper eqs. 10, 11, with the rotation corrected).
//!
//! With M = diag(1, -1, 1): mu~ = M mu and Sigma~ = M Sigma M. The paper stores R~ = M R, which has determinant
//! -1 and is no rotation; since S S^T is diagonal, M R M gives the same Sigma~ and is one: the quaternion
//! (w, x, y, z) becomes (w, -x, y, -z). Colour: exactly the SH functions that are odd in y change sign.

use super::buffer::{Gaussians, MovedArrays};
use super::sh;
use rayon::prelude::*;

impl Gaussians {
    /// The mirror image across y = 0. Only signs change, so mirroring twice gives the same bytes.
    pub fn mirrored(&self) -> Self {
        let mut out = self.clone();
        out.mirror_from(0);
        out
    }

    /// Appends the mirror image of all Gaussians: n become 2n (G_reference U G_flip).
    pub fn append_mirrored(&mut self) {
        self.append_mirrored_of(&vec![true; self.len()]);
    }

    /// Appends the mirror images of the Gaussians with `which[index]`, in order.
    pub fn append_mirrored_of(&mut self, which: &[bool]) {
        let n = self.len();
        self.append_copies(which);
        self.mirror_from(n);
    }

    /// Mirrors the Gaussians from index `start` on, in place.
    fn mirror_from(&mut self, start: usize) {
        // Small pieces keep all threads busy; large ones keep the loop vectorised.
        const CHUNK: usize = 1 << 13;
        let (degree, stride) = (self.sh_degree(), self.sh_stride());
        let signs = sh_signs(degree);
        let MovedArrays { means, rotations, sh, .. } = self.moved_arrays_mut();
        let (means, rotations) = (&mut means[start..], &mut rotations[start..]);
        means.par_chunks_mut(CHUNK).zip(rotations.par_chunks_mut(CHUNK)).for_each(|(means, rotations)| {
            mirror_frames(means, rotations);
        });
        if degree > 0 {
            let sh = &mut sh[start * stride..];
            sh.par_chunks_mut(CHUNK * stride).for_each(|chunk| mirror_colors(chunk, &signs[..stride]));
        }
    }
}

/// Sign of each of the `[16][3]` coefficients under y -> -y.
pub fn sh_signs(degree: u8) -> [f32; 48] {
    let mut signs = [1.0; 48];
    for k in 0..sh::coefficients(degree) {
        if sh::ODD_IN_Y[k] {
            signs[3 * k..3 * k + 3].fill(-1.0);
        }
    }
    signs
}

fn mirror_frames(means: &mut [[f32; 3]], rotations: &mut [[f32; 4]]) {
    for m in means {
        m[1] = -m[1];
    }
    for q in rotations {
        q[1] = -q[1];
        q[3] = -q[3];
    }
}

fn mirror_colors(sh: &mut [f32], signs: &[f32]) {
    for one in sh.chunks_exact_mut(signs.len()) {
        for (v, s) in one.iter_mut().zip(signs) {
            *v *= s;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DQuat, DVec3};
    use vg_geometry::MIRROR_Y;

    fn two() -> Gaussians {
        let q = DQuat::from_xyzw(0.3, -0.5, 0.1, 0.7).normalize();
        let sh: Vec<f32> = (0..96).map(|i| ((i * 37 % 19) as f32 - 9.0) * 0.1).collect();
        Gaussians::from_arrays(
            3,
            vec![[1.0, 0.5, 0.2], [-0.3, -0.8, 0.1]],
            vec![[q.w as f32, q.x as f32, q.y as f32, q.z as f32], [1.0, 0.0, 0.0, 0.0]],
            vec![[0.3, 0.02, 0.1]; 2],
            vec![0.9, 0.4],
            sh,
        )
        .unwrap()
    }

    fn covariance(q: [f32; 4], s: [f32; 3]) -> DMat3 {
        let r = DMat3::from_quat(
            DQuat::from_xyzw(q[1].into(), q[2].into(), q[3].into(), q[0].into()).normalize(),
        );
        let s = DMat3::from_diagonal(DVec3::new(s[0].into(), s[1].into(), s[2].into()));
        r * s * s * r.transpose()
    }

    #[test]
    fn mirroring_twice_returns_the_same_bytes() {
        let g = two();
        assert_eq!(g.mirrored().mirrored(), g);
    }

    #[test]
    fn the_covariance_is_m_sigma_m() {
        let g = two();
        let mirrored = g.mirrored();
        let m = DMat3::from_diagonal(MIRROR_Y.as_dvec3());
        for i in 0..g.len() {
            let expected = m * covariance(g.rotations()[i], g.scales()[i]) * m;
            let found = covariance(mirrored.rotations()[i], mirrored.scales()[i]);
            assert!((expected - found).to_cols_array().iter().all(|v| v.abs() < 1e-12));
        }
    }

    #[test]
    fn the_mirrored_colour_along_the_mirrored_direction_is_the_colour() {
        let g = two();
        let mirrored = g.mirrored();
        for i in 0..200 {
            let t = f64::from(i);
            let d = DVec3::new((t * 0.7).sin(), (t * 1.3).cos(), (t * 0.37).sin() + 0.01).normalize();
            let seen = sh::color(&g.sh()[..48], d.to_array(), 3);
            let seen_mirrored = sh::color(&mirrored.sh()[..48], [d.x, -d.y, d.z], 3);
            for c in 0..3 {
                assert!((seen[c] - seen_mirrored[c]).abs() < 1e-14, "direction {d}");
            }
        }
    }

    #[test]
    fn appending_the_mirror_image_equals_mirroring() {
        let g = two();
        let mut both = g.clone();
        both.append_mirrored();
        let mut expected = g.clone();
        expected.append(&g.mirrored());
        assert_eq!(both, expected);
    }
}
