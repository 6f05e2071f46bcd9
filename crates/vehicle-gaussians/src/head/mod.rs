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

/// Turns pixels with depth into Gaussians in the vehicle frame.
pub trait GaussianHead {
    /// Name in options and reports.
    fn name(&self) -> &'static str;

    /// One Gaussian per kept pixel, view by view in row order. `kept[i]` has one flag per pixel of `views[i]`;
    /// a kept pixel has depth. Views are undistorted.
    fn predict(
        &self,
        views: &[View],
        geometry: &Geometry,
        kept: &[Vec<bool>],
        context: &Context,
    ) -> Result<Gaussians>;
}
