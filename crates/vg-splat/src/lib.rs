//! 3D Gaussian splatting: Gaussians, renderers with gradients, and the quality of pictures. Nothing here is about
//! vehicles.

#![warn(unreachable_pub)]

pub mod gaussians;
pub mod quality;
pub mod render;

pub use gaussians::Gaussians;
