//! Loss terms of a picture, each with its gradient.
//!
//! A term is a mean over pixels, weighted by a mask where there is one, so a weight is independent of the picture's
//! size. It returns `weight` times that mean and adds the gradient of the returned value to the picture's:
//!
//! ```
//! # use vg_splat::render::{CpuRenderer, RenderOptions, loss::{self, Term}};
//! # let (gaussians, camera) = (vg_splat::Gaussians::default(), vg_geometry::Camera::pinhole(16, 16,
//! #     vg_geometry::Intrinsics { fx: 9.0, fy: 9.0, cx: 8.0, cy: 8.0 }, vg_geometry::Pose::IDENTITY)?);
//! # let (photograph, mask) = (vec![[0.5; 3]; 256], vec![1.0; 256]);
//! let (mut picture, mut picture_gradient, mut gradients) = Default::default();
//! let mut value = 0.0;
//! CpuRenderer::new().render_with_gradients_into(
//!     &gaussians,
//!     &camera,
//!     &RenderOptions::default(),
//!     (&mut picture, &mut picture_gradient, &mut gradients),
//!     |picture, gradient| {
//!         value += loss::l1(picture, &photograph, Term::weighing(0.8), gradient)?;
//!         value += loss::dissimilarity(picture, &photograph, Term::weighing(0.2), gradient)?;
//!         value += loss::silhouette(picture, &mask, Term::weighing(0.1), gradient)?;
//!         Ok(())
//!     },
//! )?;
//! # Ok::<(), vg_geometry::Error>(())
//! ```

mod color;
mod depth;
mod silhouette;
mod ssim;

pub use color::{l1, mse};
pub use depth::depth_l1;
pub use silhouette::silhouette;
pub use ssim::{Structure, dissimilarity};

use crate::render::Rendered;
use vg_geometry::{Error, Result};

/// Weight and mask of a term.
#[derive(Clone, Copy, Debug)]
pub struct Term<'a> {
    /// Factor of the term and of its gradient.
    pub weight: f64,
    /// Weight of each pixel, 0 or more; all are equal without a mask. Only ratios matter, and a mask of zeros makes the
    /// term zero. `[height * width]`
    pub mask: Option<&'a [f32]>,
}

impl<'a> Term<'a> {
    /// A term with this weight and no mask.
    pub fn weighing(weight: f64) -> Self {
        Self { weight, mask: None }
    }

    /// This term with `mask`.
    pub fn on(self, mask: &'a [f32]) -> Self {
        Self { mask: Some(mask), ..self }
    }

    /// Weight of pixel `i` by the mask.
    fn at(&self, i: usize) -> f64 {
        self.mask.map_or(1.0, |m| m[i].into())
    }

    fn validate(&self, picture: &Rendered) -> Result<()> {
        check_weight(self.weight)?;
        self.mask.map_or(Ok(()), |mask| check_mask(mask, picture))
    }
}

fn check_weight(weight: f64) -> Result<()> {
    if weight.is_finite() {
        return Ok(());
    }
    Err(Error::argument("term.weight", weight.to_string(), "a finite number"))
}

fn check_mask(mask: &[f32], picture: &Rendered) -> Result<()> {
    check_len("term.mask", mask.len(), picture)?;
    match mask.iter().position(|m| !(m.is_finite() && *m >= 0.0)) {
        Some(i) => Err(Error::argument(format!("term.mask[{i}]"), mask[i].to_string(), "0 or more, finite")),
        None => Ok(()),
    }
}

fn check_len(name: &str, found: usize, picture: &Rendered) -> Result<()> {
    let pixels = picture.width as usize * picture.height as usize;
    if found == pixels {
        return Ok(());
    }
    Err(Error::argument(
        name,
        format!("{found} pixels"),
        format!("{pixels} for a picture of {}x{}", picture.width, picture.height),
    ))
}

/// Checks that `values` `[pixels][channels]` have the picture's size and are finite; the error names `name`.
fn check_target(name: &str, values: &[f32], channels: usize, picture: &Rendered) -> Result<()> {
    check_len(name, values.len() / channels, picture)?;
    match values.iter().position(|v| !v.is_finite()) {
        Some(i) => {
            let argument = format!("{name}[{}]", i / channels);
            Err(Error::argument(argument, values[i].to_string(), "finite numbers"))
        }
        None => Ok(()),
    }
}

/// `weight / total`, or 0 where the total is 0.
fn share(weight: f64, total: f64) -> f64 {
    if total > 0.0 { weight / total } else { 0.0 }
}

#[cfg(test)]
mod tests;
