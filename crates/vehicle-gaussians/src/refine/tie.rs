//! Built-in symmetry: a clone has no parameters of its own; it is the mirror image of its original in the light of
//! its own side. Gradients of both move the original.

use super::parameters::{Parameters, sigmoid};
use crate::symmetry::MirrorClone;
use rayon::prelude::*;
use vg_splat::gaussians::buffer::ArraysMut;
use vg_splat::gaussians::{Gaussians, sh};
use vg_splat::render::Gradients;

/// Gaussians per task.
const CHUNK: usize = 1 << 12;

/// Computes the Gaussians of these parameters: the originals in order, then the clones.
pub(super) fn made(parameters: &Parameters, clones: &[MirrorClone], out: &mut Gaussians) {
    let n = parameters.len();
    let stride = parameters.stride();
    let ArraysMut { means, rotations, scales, opacities, sh } =
        out.resized_arrays_mut(parameters.sh_degree, n + clones.len());
    let (of_means, means) = means.split_at_mut(n);
    let (of_rotations, rotations) = rotations.split_at_mut(n);
    let (of_scales, scales) = scales.split_at_mut(n);
    let (of_opacities, opacities) = opacities.split_at_mut(n);
    let (of_sh, sh) = sh.split_at_mut(n * stride);
    of_means.copy_from_slice(&parameters.means);
    of_rotations.copy_from_slice(&parameters.rotations);
    of_sh.copy_from_slice(&parameters.sh);
    of_scales.par_iter_mut().enumerate().with_min_len(CHUNK).for_each(|(i, s)| *s = parameters.scales(i));
    of_opacities
        .par_iter_mut()
        .zip(&parameters.logits)
        .with_min_len(CHUNK)
        .for_each(|(o, x)| *o = sigmoid(*x));

    let signs = vg_splat::gaussians::mirror::sh_signs(parameters.sh_degree);
    let frames =
        means.par_iter_mut().zip(rotations).zip(scales).zip(opacities).zip(sh.par_chunks_exact_mut(stride));
    frames.zip(clones).with_min_len(CHUNK).for_each(|(((((mean, q), s), o), color), clone)| {
        let i = clone.of as usize;
        let [x, y, z] = of_means[i];
        *mean = [x, -y, z];
        let [w, x, y, z] = of_rotations[i];
        *q = [w, -x, y, -z];
        *s = of_scales[i];
        *o = of_opacities[i];
        let original = &of_sh[i * stride..(i + 1) * stride];
        for (k, c) in color.iter_mut().enumerate() {
            *c = clone.gain[k % 3] * signs[k] * original[k];
        }
        // Colour is 0.5 + Y0 c: a factor on it scales the 0.5 as well.
        for (c, gain) in color.iter_mut().zip(clone.gain) {
            *c += (gain - 1.0) * 0.5 / sh::Y0;
        }
    });
}

/// Adds the clones' gradients to those of their originals, which come first; the adjoint of [`made`]. Each original has
/// at most one clone, so the order does not matter.
pub(super) fn gather(gradients: &mut Gradients, clones: &[MirrorClone], n: usize, sh_degree: u8) {
    let stride = 3 * sh::coefficients(sh_degree);
    let signs = vg_splat::gaussians::mirror::sh_signs(sh_degree);
    let add = |to: &mut f32, from: f32| *to = (*to + from).clamp(-f32::MAX, f32::MAX);
    for (k, clone) in clones.iter().enumerate() {
        let (i, k) = (clone.of as usize, n + k);
        for (axis, sign) in [1.0, -1.0, 1.0].into_iter().enumerate() {
            let g = sign * gradients.means[k][axis];
            add(&mut gradients.means[i][axis], g);
            let g = gradients.scales[k][axis];
            add(&mut gradients.scales[i][axis], g);
        }
        for (axis, sign) in [1.0, -1.0, 1.0, -1.0].into_iter().enumerate() {
            let g = sign * gradients.rotations[k][axis];
            add(&mut gradients.rotations[i][axis], g);
        }
        let g = gradients.opacities[k];
        add(&mut gradients.opacities[i], g);
        let (originals, clones_sh) = gradients.sh.split_at_mut(n * stride);
        let from = &clones_sh[(k - n) * stride..(k - n + 1) * stride];
        for (c, (to, g)) in originals[i * stride..(i + 1) * stride].iter_mut().zip(from).enumerate() {
            add(to, clone.gain[c % 3] * signs[c] * g);
        }
    }
    gradients.means.truncate(n);
    gradients.rotations.truncate(n);
    gradients.scales.truncate(n);
    gradients.opacities.truncate(n);
    gradients.sh.truncate(n * stride);
}

/// The clones after a growth: each new Gaussian has one if its source in `sources` had one.
pub(super) fn followed(clones: &[MirrorClone], sources: &[u32], originals: usize) -> Vec<MirrorClone> {
    let mut gains: Vec<Option<[f32; 3]>> = vec![None; originals];
    clones.iter().for_each(|clone| gains[clone.of as usize] = Some(clone.gain));
    let tied =
        |(i, source): (usize, &u32)| gains[*source as usize].map(|gain| MirrorClone { of: i as u32, gain });
    sources.iter().enumerate().filter_map(tied).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random numbers in (-1, 1).
    fn numbers(n: usize, seed: u32) -> Vec<f32> {
        (0..n).map(|i| ((i as f32 + 1.0) * 12.9898 + seed as f32 * 78.233).sin()).collect()
    }

    fn threes(n: usize, seed: u32) -> Vec<[f32; 3]> {
        numbers(3 * n, seed).chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect()
    }

    fn fours(n: usize, seed: u32) -> Vec<[f32; 4]> {
        numbers(4 * n, seed).chunks_exact(4).map(|v| [v[0], v[1], v[2], v[3]]).collect()
    }

    fn some(n: usize, degree: u8) -> Parameters {
        Parameters {
            sh_degree: degree,
            means: threes(n, 1),
            rotations: fours(n, 2),
            log_scales: threes(n, 3),
            logits: numbers(n, 4),
            sh: numbers(n * 3 * sh::coefficients(degree), 5),
        }
    }

    const CLONES: [MirrorClone; 3] = [
        MirrorClone { of: 4, gain: [1.0, 1.0, 1.0] },
        MirrorClone { of: 0, gain: [0.5, 1.25, 2.0] },
        MirrorClone { of: 2, gain: [0.9, 0.8, 0.7] },
    ];

    #[test]
    fn clones_equal_mirrored_originals() {
        let parameters = some(5, 2);
        let mut all = Gaussians::default();
        made(&parameters, &CLONES, &mut all);
        let mut originals = all.clone();
        originals.truncate(5);
        let mirrored = originals.mirrored();
        for (k, clone) in CLONES.iter().enumerate() {
            let (at, of) = (5 + k, clone.of as usize);
            assert_eq!(all.means()[at], mirrored.means()[of]);
            assert_eq!(all.rotations()[at], mirrored.rotations()[of]);
            assert_eq!(all.scales()[at], mirrored.scales()[of]);
            assert_eq!(all.opacities()[at], mirrored.opacities()[of]);
        }
        // The gain of the first is 1.
        let stride = all.sh_stride();
        assert_eq!(all.sh()[5 * stride..6 * stride], mirrored.sh()[4 * stride..5 * stride]);
        // The second is 0.5, 1.25 and 2 times as bright from every direction.
        let from = [0.6, -0.64, 0.48];
        let color = |g: &Gaussians, i: usize| sh::color(&g.sh()[i * stride..(i + 1) * stride], from, 2);
        for (c, gain) in [0.5, 1.25, 2.0].into_iter().enumerate() {
            let (clone, original) = (color(&all, 6)[c], color(&mirrored, 0)[c]);
            assert!(original <= 0.0 || (clone - gain * original).abs() < 1e-5, "{clone} {original}");
        }
    }

    #[test]
    fn clones_come_and_go_with_their_originals() {
        let expected = [
            MirrorClone { of: 0, gain: CLONES[2].gain },
            MirrorClone { of: 2, gain: CLONES[0].gain },
            MirrorClone { of: 3, gain: CLONES[0].gain },
        ];
        assert_eq!(followed(&CLONES, &[2, 3, 4, 4], 5), expected);
        assert_eq!(followed(&CLONES, &[1, 3], 5), []);
    }

    #[test]
    fn gathering_is_the_adjoint_of_making() {
        let n = 5;
        let degree = 3;
        let stride = 3 * sh::coefficients(degree);
        let all = n + CLONES.len();
        let of_all = Gradients {
            means: threes(all, 11),
            rotations: fours(all, 12),
            scales: threes(all, 13),
            opacities: numbers(all, 14),
            sh: numbers(all * stride, 15),
            ..Gradients::default()
        };
        let dot = |g: &Gaussians, of: &Gradients| -> f64 {
            let sum = |a: &[f32], b: &[f32]| -> f64 {
                assert_eq!(a.len(), b.len());
                a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
            };
            sum(g.means().as_flattened(), of.means.as_flattened())
                + sum(g.rotations().as_flattened(), of.rotations.as_flattened())
                + sum(g.scales().as_flattened(), of.scales.as_flattened())
                + sum(g.opacities(), &of.opacities)
                + sum(g.sh(), &of.sh)
        };
        // `made` is affine in the Gaussians' values: two states differ by J (x - y).
        let mut other = some(n, degree);
        other.means = threes(n, 21);
        other.rotations = fours(n, 22);
        other.log_scales = threes(n, 23);
        other.logits = numbers(n, 24);
        other.sh = numbers(n * stride, 25);
        let difference = |clones: &[MirrorClone], of: &Gradients| {
            let (mut x, mut y) = (Gaussians::default(), Gaussians::default());
            made(&some(n, degree), clones, &mut x);
            made(&other, clones, &mut y);
            dot(&x, of) - dot(&y, of)
        };
        let expected = difference(&CLONES, &of_all);
        let mut gathered = of_all;
        gather(&mut gathered, &CLONES, n, degree);
        let found = difference(&[], &gathered);
        assert!((found - expected).abs() < 1e-4 * expected.abs().max(1.0), "{found} {expected}");
    }
}
