//! Alpha-blended splatting (method section 5): options, targets, and the renderers behind one trait.

mod asset;
pub mod backend;
pub mod cpu;
pub mod distorted;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod gradient;
pub mod loss;
pub mod options;
pub mod output;
mod picture;
pub mod reference;
mod view;

pub use asset::{AssetRenderer, WORTH_A_DEVICE};
pub use backend::{Backend, Choice};
pub use cpu::CpuRenderer;
#[cfg(feature = "gpu")]
pub use gpu::{Adapter, GpuAsset, GpuRenderer};
pub use gradient::{Differentiable, Gradients, PictureGradient, PoseGradient};
pub use options::{Background, DepthMode, RenderOptions};
pub use output::{Rendered, Rgba8};
pub use picture::Picture;
pub use reference::{Reference, ReferenceGradients};

use crate::gaussians::Gaussians;
use vg_geometry::{Camera, Result};

/// Renders Gaussians as a camera sees them.
pub trait Renderer {
    /// Renders one picture. The camera may be distorted; it is validated.
    fn render(&self, gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Result<Rendered>;
}
