//! 1 - SSIM, as `metrics::ssim` computes it, with its exact adjoint.

use super::{Term, check_len, check_mask, check_target, check_weight, share};
use crate::quality::{Reference, WINDOW};
use crate::render::{PictureGradient, Rendered};
use vg_geometry::{Error, Result};

/// Structural dissimilarity: the mean of 1 - SSIM over channels and over pixels whose 11x11 window lies inside the
/// picture, which the mask weighs by the window's middle. Without a mask it is 1 - [`crate::quality::ssim`].
///
/// Colours are clamped to [0, 1] first, as on a display; outside there is no gradient. `target` `[height * width]` RGB;
/// pictures smaller than the window are an error. To compare many pictures with one target, make a [`Structure`] of it.
pub fn dissimilarity(
    picture: &Rendered,
    target: &[[f32; 3]],
    term: Term,
    gradient: &mut PictureGradient,
) -> Result<f64> {
    check_target("target", target.as_flattened(), 3, picture)?;
    let structure = Structure::new(target, [picture.width, picture.height], term.mask.map(<[f32]>::to_vec))?;
    structure.dissimilarity(picture, term.weight, gradient)
}

/// A target of [`dissimilarity`] with precomputed windows, which saves a third of the work.
#[derive(Clone, Debug)]
pub struct Structure {
    size: [u32; 2],
    reference: Reference,
    mask: Option<Vec<f32>>,
    /// Sum of the mask over the middles of all windows.
    total: f64,
}

impl Structure {
    /// Prepares `target` `[height * width]` RGB of `[width, height]`; `mask` as in [`Term`].
    ///
    /// # Errors
    /// A number is not finite, an array has another size, or the picture is smaller than the window.
    pub fn new(target: &[[f32; 3]], [width, height]: [u32; 2], mask: Option<Vec<f32>>) -> Result<Self> {
        let picture = Rendered { width, height, ..Rendered::default() };
        check_target("target", target.as_flattened(), 3, &picture)?;
        mask.iter().try_for_each(|mask| check_mask(mask, &picture))?;
        let (w, h) = (width as usize, height as usize);
        if w < WINDOW || h < WINDOW {
            return Err(Error::argument(
                "picture.size",
                format!("{w}x{h}"),
                format!("{WINDOW}x{WINDOW} or larger"),
            ));
        }
        let margin = WINDOW / 2;
        let total = match &mask {
            None => ((w + 1 - WINDOW) * (h + 1 - WINDOW)) as f64,
            Some(mask) => (margin..h - margin)
                .flat_map(|v| &mask[v * w + margin..(v + 1) * w - margin])
                .map(|m| f64::from(*m))
                .sum(),
        };
        Ok(Self { size: [width, height], reference: Reference::new(target, w, h), mask, total })
    }

    /// Computes [`dissimilarity`] for this target and its mask, times `weight`.
    pub fn dissimilarity(
        &self,
        picture: &Rendered,
        weight: f64,
        gradient: &mut PictureGradient,
    ) -> Result<f64> {
        check_weight(weight)?;
        if [picture.width, picture.height] != self.size {
            let [width, height] = self.size;
            return Err(Error::argument(
                "picture.size",
                format!("{}x{}", picture.width, picture.height),
                format!("{width}x{height}, the target's"),
            ));
        }
        check_len("picture.color", picture.color.len(), picture)?;
        let factor = share(weight, 3.0 * self.total);
        let slopes = gradient.color_mut();
        Ok(self.reference.dissimilarity(&picture.color, factor, self.mask.as_deref(), Some(slopes)))
    }
}
