//! Models from other programs, transformed to the vehicle's frame so that they can be evaluated in the same way.
//!
//! [`merge_views`] is for programs that return Gaussians for each photograph, background included, in the
//! frame of the cameras (Depth Anything 3); [`place_object`] is for programs that return one object of unknown size and
//! heading (TRELLIS).

mod object;
mod views;

pub use object::{Placed, Up, place_object};
pub use views::merge_views;
