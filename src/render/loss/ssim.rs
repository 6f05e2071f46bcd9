//! 1 - SSIM, as `metrics::ssim` measures it, with its exact adjoint.

use super::{Term, check_target, share};
use crate::error::{Error, Result};
use crate::metrics::{SsimMaps, WINDOW};
use crate::render::{PictureGradient, Rendered};
use rayon::prelude::*;

/// Structural dissimilarity: the mean of 1 - SSIM over channels and over pixels whose 11x11 window lies inside the
/// picture, which the mask weighs by the window's middle. Without a mask it is 1 - [`crate::metrics::ssim`].
///
/// Colours are clamped to [0, 1] first, as a display would; outside there is no gradient. `target` `[height * width]`
/// RGB; pictures smaller than the window are an error.
pub fn dissimilarity(
    picture: &Rendered,
    target: &[[f32; 3]],
    term: Term,
    gradient: &mut PictureGradient,
) -> Result<f64> {
    term.validate(picture)?;
    check_target("target", target.as_flattened(), 3, picture)?;
    let (w, h) = (picture.width as usize, picture.height as usize);
    if w < WINDOW || h < WINDOW {
        return Err(Error::argument(
            "picture.size",
            format!("{w}x{h}"),
            format!("{WINDOW}x{WINDOW} or larger"),
        ));
    }
    let (inner, margin) = (w + 1 - WINDOW, WINDOW / 2);
    let middle = |i: usize| (i / inner + margin) * w + i % inner + margin;
    let windows = inner * (h + 1 - WINDOW);
    let total: f64 = (0..windows).map(|i| term.at(middle(i))).sum();
    let factor = share(term.weight, 3.0 * total);
    let channel = |c: usize| {
        let plane = |image: &[[f32; 3]]| -> Vec<f64> {
            image.iter().map(|p| f64::from(p[c].clamp(0.0, 1.0))).collect()
        };
        let maps = SsimMaps::new(plane(&picture.color), plane(target), w, h);
        let weights: Vec<f64> = (0..windows).map(|i| -factor * term.at(middle(i))).collect();
        let value: f64 = maps.ssim().zip(&weights).map(|(s, weight)| weight * (s - 1.0)).sum();
        (value, maps.adjoint(&weights))
    };
    let channels: Vec<(f64, Vec<f64>)> = (0..3).into_par_iter().map(channel).collect();
    let out = gradient.color_mut();
    let mut sum = 0.0;
    for (c, (value, slopes)) in channels.iter().enumerate() {
        sum += value;
        for ((out, slope), color) in out.iter_mut().zip(slopes).zip(&picture.color) {
            if (0.0..=1.0).contains(&color[c]) {
                out[c] += *slope as f32;
            }
        }
    }
    Ok(sum)
}
