//! COLMAP's sparse models, binary and text: cameras and posed images, and the sparse points.
//!
//! Versions 3.12 and later write `rigs` and `frames` in addition to `cameras` and `images`; the images keep their own
//! poses, so that the two files that all versions have are enough.

mod binary;
mod model;
mod text;

pub use binary::{cameras_from_binary, images_from_binary, points_from_binary};
pub(super) use model::{Found, find};
pub use model::{Model, ModelCamera, ModelImage, SparsePoints, find_model, read_model, read_points};
pub use text::{cameras_from_text, images_from_text, points_from_text};
