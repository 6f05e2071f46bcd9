//! 3D Gaussians as a structure of arrays, and the algebra on them that knows nothing of where they came from.

pub mod buffer;
mod covariance;
pub mod mirror;
mod select;
pub mod sh;
pub mod transform;

pub use buffer::Gaussians;
