//! Vehicle Gaussians: a few posed, masked photographs of one side of a vehicle in, a complete metric
//! 3D Gaussian model out, rendered from any camera.
//!
//! Data flows one way: [`scene`] -> [`prior`] -> [`head`] -> [`symmetry`] -> [`gaussians`] -> [`render`], and
//! [`pipeline`] is the walk.
//!
//! # Conventions
//! * Vehicle frame: x forward, y left, z up, metres, right-handed; the symmetry plane is y = 0.
//! * Camera frame: x right, y down, z forward. The top-left pixel's centre is (0.5, 0.5).
//! * Transforms are named `to_from`; `vehicle_from_camera` is what every camera carries.
//! * Quaternions are (w, x, y, z). Scales are standard deviations in metres, opacities lie in [0, 1].
//! * Pictures are 8-bit sRGB and stay so encoded; row 0 is the top row.
//! * Depth is planar z along the optical axis in metres; 0 means none.

#![warn(unreachable_pub)]

pub mod align;
pub mod calibrate;
pub mod head;
pub mod imports;
pub mod metrics;
pub mod pipeline;
pub mod prior;
pub mod refine;
pub mod segment;
pub mod symmetry;

/// Photographs, masks, depth and views: `vg-scene`, and the masks of a network.
pub mod scene {
    pub use crate::segment::{self, Segmenter};
    pub use vg_scene::*;
}

pub use symmetry::relight;
pub use vg_geometry::{self as geometry, Camera, Error, Pose, Result, error, progress, threads};
pub use vg_scene::{Scene, View, io, onnx};
pub use vg_splat::{Gaussians, gaussians, render};

/// Compiles the README's example.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
