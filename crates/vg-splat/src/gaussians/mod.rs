//! 3D Gaussians as a structure of arrays, and the algebra on them, which does not depend on their origin.

pub mod buffer;
mod covariance;
pub mod mirror;
mod select;
pub mod sh;
pub mod transform;

pub use buffer::Gaussians;
