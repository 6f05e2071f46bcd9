//! Cameras, lenses, poses and frames, in f64; and what every crate above needs: errors, progress, threads.
//!
//! * Vehicle frame: x forward, y left, z up, metres, right-handed; the symmetry plane is y = 0.
//! * Camera frame: x right, y down, z forward (OpenCV, COLMAP).
//! * The pixel in column u, row v has its centre at (u + 0.5, v + 0.5) (COLMAP).
//! * A transform is named `to_from`: `vehicle_from_camera` takes camera points to vehicle points.
//! * Quaternions are (w, x, y, z), Hamilton.

#![warn(unreachable_pub)]

pub mod align;
pub mod camera;
pub mod choice;
pub mod descent;
pub mod distortion;
pub mod error;
pub mod frame;
pub mod measures;
pub mod nearest;
pub mod options;
mod pixels;
mod placed;
pub mod pose;
pub mod progress;
pub mod resample;
pub mod robust;
pub mod threads;
pub mod unfolded;

pub use align::Similarity;
pub use camera::{Camera, CameraModel, Intrinsics, OpenCvModel};
pub use choice::Choice;
pub use distortion::Distortion;
pub use error::{Error, Result};
pub use pixels::PixelAndDepth;
pub use placed::Turntable;
pub use pose::{MIRROR_Y, Pose};
pub use robust::RobustFit;
