//! Depth against measured depth.

use super::{Term, check_target, share};
use crate::render::{PictureGradient, Rendered};
use vg_geometry::Result;

/// Mean absolute difference of depth, metres, over the pixels where `target` is above 0: 0 means no measurement.
/// `[height * width]`
///
/// The picture must have `DepthMode::Expected`; where nothing is drawn its depth is 0 and has no gradient.
pub fn depth_l1(
    picture: &Rendered,
    target: &[f32],
    term: Term,
    gradient: &mut PictureGradient,
) -> Result<f64> {
    term.validate(picture)?;
    check_target("target", target, 1, picture)?;
    let pixels = picture.depth.len();
    let at = |i: usize| if target[i] > 0.0 { term.at(i) } else { 0.0 };
    let factor = share(term.weight, (0..pixels).map(at).sum());
    let out = gradient.depth_mut();
    let mut sum = 0.0;
    for i in 0..pixels {
        let here = factor * at(i);
        let difference = f64::from(picture.depth[i]) - f64::from(target[i]);
        if here != 0.0 && difference != 0.0 {
            sum += here * difference.abs();
            out[i] += (here * difference.signum()) as f32;
        }
    }
    Ok(sum)
}
