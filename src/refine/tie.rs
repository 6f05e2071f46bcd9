//! Symmetry built in: a clone has no parameters of its own, it is the mirror image of its original in the light of
//! its own side. What a view says of either moves the original.

use super::parameters::{Parameters, sigmoid};
use crate::gaussians::buffer::ArraysMut;
use crate::gaussians::{Gaussians, sh};
use crate::render::Gradients;
use rayon::prelude::*;

/// A Gaussian that is the mirror image of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clone {
    /// Index of its original.
    pub(crate) of: u32,
    /// Factor on the stored colour, per channel (`relight`).
    pub(crate) gain: [f32; 3],
}

/// Gaussians one task works on.
const CHUNK: usize = 1 << 12;

/// The Gaussians of these parameters: the originals in order, then the clones.
pub(super) fn made(parameters: &Parameters, clones: &[Clone], out: &mut Gaussians) {
    let n = parameters.len();
    let stride = parameters.stride();
    let ArraysMut { means, rotations, scales, opacities, sh } =
        out.arrays_of(parameters.sh_degree, n + clones.len());
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

    let signs = crate::gaussians::mirror::sh_signs(parameters.sh_degree);
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
        // Colour is 0.5 + Y0 c: a factor on it moves the half as well.
        for (c, gain) in color.iter_mut().zip(clone.gain) {
            *c += (gain - 1.0) * 0.5 / sh::Y0;
        }
    });
}

/// Adds what the clones feel to their originals, whose gradients come first; the adjoint of [`made`]. One clone at
/// most has each original, so that no order matters.
pub(super) fn gather(gradients: &mut Gradients, clones: &[Clone], n: usize, sh_degree: u8) {
    let stride = 3 * sh::coefficients(sh_degree);
    let signs = crate::gaussians::mirror::sh_signs(sh_degree);
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
