//! Gaussian heads: attributes for every kept pixel of every view (paper sec. "Gaussian Attribute Estimation").

pub mod appearance;
pub mod attributes;
pub mod network;
pub mod surfel;

pub use network::NetworkHead;
pub use surfel::SurfelHead;

use crate::prior::Geometry;
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::View;
use vg_splat::Gaussians;

/// Turns pixels with depth into Gaussians. Implement it to reconstruct with a head of your own, see
/// [`crate::pipeline::reconstruct_with`].
///
/// ```
/// use vg::Gaussians;
/// use vg::gaussians::{buffer::Gaussian, sh};
/// use vg::head::GaussianHead;
/// use vg::prior::Geometry;
/// use vg::progress::Context;
/// use vg::scene::View;
///
/// /// A ball of one size for every pixel.
/// struct Balls {
///     radius_m: f32,
/// }
///
/// impl GaussianHead for Balls {
///     fn name(&self) -> &'static str {
///         "balls"
///     }
///
///     fn predict(
///         &self,
///         views: &[View],
///         geometry: &Geometry,
///         kept: &[Vec<bool>],
///         _context: &Context,
///     ) -> vg::Result<Gaussians> {
///         let mut all = Gaussians::with_capacity(0, 0);
///         for ((view, depth), kept) in views.iter().zip(&geometry.depths).zip(kept) {
///             for pixel in (0..kept.len()).filter(|pixel| kept[*pixel]) {
///                 let (u, v) = (pixel as u32 % depth.width(), pixel as u32 / depth.width());
///                 let Some(z) = depth.get(u, v) else { continue };
///                 all.push(&Gaussian {
///                     mean: view.lift(u, v, z).to_array(),
///                     rotation: [1.0, 0.0, 0.0, 0.0],
///                     scale: [self.radius_m; 3],
///                     opacity: 0.9,
///                     sh0: sh::from_rgb(view.image.get(u, v).map(|c| f32::from(c) / 255.0)),
///                 });
///             }
///         }
///         Ok(all)
///     }
/// }
/// ```
pub trait GaussianHead {
    /// Name in reports and error messages.
    fn name(&self) -> &'static str;

    /// Predicts one Gaussian per kept pixel, view by view in row order, in the frame of the views' cameras.
    ///
    /// The views are pinholes: lens distortion is removed. `kept[i]` has one flag per pixel of `views[i]` in row order;
    /// a kept pixel has depth and a normal in `geometry`. A pixel whose Gaussian cannot be stored may be left out. Long
    /// work should call [`Context::report`] with the stage `"head"` now and then, and return its error, which is how a
    /// caller cancels.
    fn predict(
        &self,
        views: &[View],
        geometry: &Geometry,
        kept: &[Vec<bool>],
        context: &Context,
    ) -> Result<Gaussians>;
}
