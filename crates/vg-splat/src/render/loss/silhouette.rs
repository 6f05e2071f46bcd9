//! Alpha against a silhouette.

use super::{Term, check_target, share};
use crate::render::{PictureGradient, Rendered};
use vg_geometry::Result;

/// Mean square difference of alpha and `target`, which is 1 on the vehicle and 0 elsewhere. `[height * width]`
///
/// It is the square, not the cross-entropy: alpha is exactly 0 where nothing is drawn and at most 1 - 1e-4, and a
/// logarithm would count these limits of the renderer as errors.
pub fn silhouette(
    picture: &Rendered,
    target: &[f32],
    term: Term,
    gradient: &mut PictureGradient,
) -> Result<f64> {
    term.validate(picture)?;
    check_target("target", target, 1, picture)?;
    let pixels = picture.alpha.len();
    let factor = share(term.weight, (0..pixels).map(|i| term.at(i)).sum());
    let out = gradient.alpha_mut();
    let mut sum = 0.0;
    for i in 0..pixels {
        let here = factor * term.at(i);
        let difference = f64::from(picture.alpha[i]) - f64::from(target[i]);
        sum += here * difference * difference;
        out[i] += (here * 2.0 * difference) as f32;
    }
    Ok(sum)
}
