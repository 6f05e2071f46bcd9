//! Differences of colour, channel by channel.

use super::{Term, check_target, share};
use crate::render::{PictureGradient, Rendered};
use vg_geometry::Result;

/// Mean absolute difference of colour; its gradient is 0 where the difference is 0. `target` `[height * width]` RGB.
pub fn l1(
    picture: &Rendered,
    target: &[[f32; 3]],
    term: Term,
    gradient: &mut PictureGradient,
) -> Result<f64> {
    // `signum` returns 1 for 0.
    let slope = |d: f64| if d == 0.0 { 0.0 } else { d.signum() };
    pixelwise(picture, target, term, gradient, f64::abs, slope)
}

/// Mean square difference of colour. `target` `[height * width]` RGB.
pub fn mse(
    picture: &Rendered,
    target: &[[f32; 3]],
    term: Term,
    gradient: &mut PictureGradient,
) -> Result<f64> {
    pixelwise(picture, target, term, gradient, |d| d * d, |d| 2.0 * d)
}

/// Mean of `value(difference)` over channels and pixels.
fn pixelwise(
    picture: &Rendered,
    target: &[[f32; 3]],
    term: Term,
    gradient: &mut PictureGradient,
    value: impl Fn(f64) -> f64,
    slope: impl Fn(f64) -> f64,
) -> Result<f64> {
    term.validate(picture)?;
    check_target("target", target.as_flattened(), 3, picture)?;
    let pixels = picture.color.len();
    let factor = share(term.weight, 3.0 * (0..pixels).map(|i| term.at(i)).sum::<f64>());
    let out = gradient.color_mut();
    let mut sum = 0.0;
    for i in 0..pixels {
        let here = factor * term.at(i);
        for c in 0..3 {
            let difference = f64::from(picture.color[i][c]) - f64::from(target[i][c]);
            sum += here * value(difference);
            out[i][c] += (here * slope(difference)) as f32;
        }
    }
    Ok(sum)
}
