//! What a view's picture should be, and how far one is from it.
//!
//! Pictures are drawn on nothing, so that exposure acts on the vehicle alone; photograph and picture are compared on
//! white, as everywhere (`metrics::on_white`). Pixels of which nothing is known count for nothing.

use super::RefineOptions;
use crate::metrics;
use crate::render::{PictureGradient, Rendered};
use crate::scene::View;
use crate::scene::mask::Label;

/// A view's photograph, ready to be compared with.
#[derive(Debug)]
pub(super) struct Target {
    /// On white. `[height * width]`
    color: Vec<[f32; 3]>,
    /// 1 where vehicle, 0 where background, NaN where unknown. `[height * width]`
    alpha: Vec<f32>,
    /// Metres, as drawn at the beginning; 0 where nothing holds it. `[height * width]`
    depth: Vec<f32>,
    /// 1 / pixels that count.
    share: f32,
}

/// What a picture lacks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Loss {
    /// The weighted sum of all terms.
    pub(super) total: f64,
    /// Mean squared error of colour on white.
    pub(super) mse: f64,
    /// Gradient of the exposure's factors.
    pub(super) of_exposure: [f32; 3],
}

impl Loss {
    pub(super) fn psnr_db(&self) -> f64 {
        -10.0 * self.mse.max(1e-12).log10()
    }
}

impl Target {
    pub(super) fn of(view: &View) -> Self {
        let label = |i: usize| view.mask.as_ref().map_or(Label::Vehicle, |m| m.labels()[i]);
        let pixels = view.camera.width as usize * view.camera.height as usize;
        let alpha: Vec<f32> = (0..pixels)
            .map(|i| match label(i) {
                Label::Vehicle => 1.0,
                Label::Background => 0.0,
                Label::Unknown => f32::NAN,
            })
            .collect();
        let known = alpha.iter().filter(|a| !a.is_nan()).count().max(1);
        Self { color: metrics::on_white(view), alpha, depth: Vec::new(), share: 1.0 / known as f32 }
    }

    /// Holds the surface where this picture has it, inside the mask.
    pub(super) fn hold(&mut self, picture: &Rendered) {
        let drawn = picture.alpha.iter().zip(&picture.depth).zip(&self.alpha);
        let held = |((drawn, depth), alpha): ((&f32, &f32), &f32)| {
            if *drawn > 0.5 && *alpha == 1.0 { *depth } else { 0.0 }
        };
        self.depth = drawn.map(held).collect();
    }

    /// The loss of a picture drawn on nothing and shown with `factor`; adds to its gradient where one is wanted.
    pub(super) fn loss(
        &self,
        picture: &Rendered,
        factor: [f32; 3],
        options: &RefineOptions,
        mut gradient: Option<&mut PictureGradient>,
    ) -> Loss {
        let mut loss = Loss::default();
        if let Some(gradient) = gradient.as_deref_mut() {
            gradient.color_mut();
            gradient.alpha_mut();
            if options.depth > 0.0 {
                gradient.depth_mut();
            }
        }
        let third = self.share / 3.0;
        for i in 0..self.alpha.len() {
            if self.alpha[i].is_nan() {
                continue;
            }
            let alpha = picture.alpha[i];
            let mut of_alpha = options.silhouette * self.share * (alpha - self.alpha[i]).signum();
            loss.total += f64::from(options.silhouette * self.share * (alpha - self.alpha[i]).abs());
            for c in 0..3 {
                let shown = factor[c] * picture.color[i][c] + 1.0 - alpha;
                let off = shown - self.color[i][c];
                loss.total += f64::from(third * off.abs());
                loss.mse += f64::from(third * off * off);
                let of_shown = third * off.signum();
                of_alpha -= of_shown;
                loss.of_exposure[c] += of_shown * picture.color[i][c];
                if let Some(gradient) = gradient.as_deref_mut() {
                    gradient.color[i][c] += factor[c] * of_shown;
                }
            }
            if let Some(gradient) = gradient.as_deref_mut() {
                gradient.alpha[i] += of_alpha;
                if options.depth > 0.0 && self.depth[i] > 0.0 {
                    let off = picture.depth[i] - self.depth[i];
                    gradient.depth[i] += options.depth * self.share * off.signum();
                    loss.total += f64::from(options.depth * self.share * off.abs());
                }
            }
        }
        loss
    }
}
