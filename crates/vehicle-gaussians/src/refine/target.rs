//! The target of a view's picture, and the loss of a picture relative to it.
//!
//! Pictures are rendered on a transparent background, so that exposure acts on the vehicle alone, and compared with the
//! photograph on white, as everywhere (`metrics::on_white`). Unknown pixels have weight zero.

use super::RefineOptions;
use crate::metrics;
use vg_geometry::Result;
use vg_scene::View;
use vg_scene::mask::Label;
use vg_splat::render::loss::{self, Structure, Term};
use vg_splat::render::{PictureGradient, Rendered};

/// A view's photograph, prepared for the loss.
#[derive(Debug)]
pub(super) struct Target {
    /// Colour on white. `[height * width]`
    color: Vec<[f32; 3]>,
    /// 1 for vehicle pixels, else 0. `[height * width]`
    alpha: Vec<f32>,
    /// 0 for unknown pixels, else 1. `[height * width]`
    known: Vec<f32>,
    /// Initial rendered depth, metres; 0 where depth is not held. `[height * width]`
    depth: Vec<f32>,
    /// Whether the view has a mask; without one, pixels are known where the initial picture is opaque.
    has_mask: bool,
    /// Precomputed SSIM terms; `None` before [`Target::hold`], and for pictures smaller than the SSIM window.
    structure: Option<Structure>,
}

/// The loss of a picture.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Loss {
    /// Weighted sum of all terms.
    pub(super) total: f64,
    /// Gradient of the exposure's factors.
    pub(super) of_exposure: [f32; 3],
}

impl Target {
    pub(super) fn new(view: &View) -> Self {
        let pixels = view.camera.width as usize * view.camera.height as usize;
        let labels = (0..pixels).map(|i| view.mask.as_ref().map_or(Label::Vehicle, |m| m.labels()[i]));
        let flags =
            |label: Label, all: &[Label]| all.iter().map(|l| f32::from(u8::from(*l == label))).collect();
        let labels: Vec<Label> = labels.collect();
        let unknown: Vec<f32> = flags(Label::Unknown, &labels);
        Self {
            color: metrics::on_white(view),
            alpha: flags(Label::Vehicle, &labels),
            known: unknown.into_iter().map(|u| 1.0 - u).collect(),
            depth: vec![0.0; pixels],
            has_mask: view.mask.is_some(),
            structure: None,
        }
    }

    /// Holds the surface at this picture's depth, inside the mask.
    pub(super) fn hold(&mut self, picture: &Rendered) -> Result<()> {
        if !self.has_mask {
            self.known = picture.alpha.iter().map(|drawn| f32::from(u8::from(*drawn > 0.5))).collect();
        }
        let drawn = picture.alpha.iter().zip(&picture.depth).zip(&self.alpha);
        let held = |((drawn, depth), alpha): ((&f32, &f32), &f32)| match *drawn > 0.5 && *alpha == 1.0 {
            true => *depth,
            false => 0.0,
        };
        self.depth = drawn.map(held).collect();
        let size = [picture.width, picture.height];
        if size.into_iter().all(|side| side as usize >= vg_splat::quality::WINDOW) {
            self.structure = Some(Structure::new(&self.color, size, Some(self.known.clone()))?);
        }
        Ok(())
    }

    /// The loss of a picture on a transparent background under the exposure `factor`; adds to the picture's gradient.
    pub(super) fn loss(
        &self,
        picture: &Rendered,
        factor: [f32; 3],
        options: &RefineOptions,
        shown: &mut Shown,
        gradient: &mut PictureGradient,
    ) -> Result<Loss> {
        shown.show(picture, factor);
        let Shown { picture: on_white, gradient: of_white } = shown;
        let weighing = |weight: f32| Term::weighing(weight.into());
        let colors = weighing(1.0 - options.ssim).on(&self.known);
        let mut total = loss::l1(on_white, &self.color, colors, of_white)?;
        if let Some(structure) = self.structure.as_ref().filter(|_| options.ssim > 0.0) {
            total += structure.dissimilarity(on_white, options.ssim.into(), of_white)?;
        }
        if options.silhouette > 0.0 {
            let term = weighing(options.silhouette).on(&self.known);
            total += loss::silhouette(on_white, &self.alpha, term, of_white)?;
        }
        if options.depth > 0.0 {
            total += loss::depth_l1(picture, &self.depth, weighing(options.depth), gradient)?;
        }

        // shown = factor colour + 1 - alpha
        let mut of_exposure = [0.0f64; 3];
        let of_alpha = of_white.alpha_mut().to_vec();
        let of_shown = of_white.color_mut();
        for (to, (of, color)) in gradient.color_mut().iter_mut().zip(of_shown.iter().zip(&picture.color)) {
            for c in 0..3 {
                to[c] += factor[c] * of[c];
                of_exposure[c] += f64::from(of[c] * color[c]);
            }
        }
        for (to, (of, of_alpha)) in gradient.alpha_mut().iter_mut().zip(of_shown.iter().zip(of_alpha)) {
            *to += of_alpha - of.iter().sum::<f32>();
        }
        Ok(Loss { total, of_exposure: of_exposure.map(|g| g as f32) })
    }

    /// PSNR of a picture under the exposure `factor`, over the known pixels, dB.
    pub(super) fn psnr_db(&self, picture: &Rendered, factor: [f32; 3], shown: &mut Shown) -> f64 {
        shown.show(picture, factor);
        let mut sum = 0.0;
        for ((a, b), known) in shown.picture.color.iter().zip(&self.color).zip(&self.known) {
            let off = |c: usize| f64::from(a[c].clamp(0.0, 1.0) - b[c]);
            sum += f64::from(*known) * (0..3).map(|c| off(c).powi(2)).sum::<f64>();
        }
        let known: f64 = self.known.iter().map(|k| f64::from(*k)).sum();
        -10.0 * (sum / (3.0 * known).max(1.0)).max(1e-12).log10()
    }
}

/// A picture as it is compared: under its exposure, on white. Its memory is reused.
#[derive(Debug, Default)]
pub(super) struct Shown {
    picture: Rendered,
    gradient: PictureGradient,
}

impl Shown {
    fn show(&mut self, picture: &Rendered, factor: [f32; 3]) {
        let shown =
            |(color, alpha): (&[f32; 3], &f32)| std::array::from_fn(|c| factor[c] * color[c] + 1.0 - alpha);
        (self.picture.width, self.picture.height) = (picture.width, picture.height);
        self.picture.color.clear();
        self.picture.color.extend(picture.color.iter().zip(&picture.alpha).map(shown));
        self.picture.alpha.clone_from(&picture.alpha);
        self.gradient.reset(picture);
    }
}
