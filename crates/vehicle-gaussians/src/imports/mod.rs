//! Models that other programs made, brought to the vehicle's frame: to be measured by the same measures.
//!
//! [`merge_views`] is for programs that answer a cloud of Gaussians for each photograph, background included, in the
//! frame of the cameras (Depth Anything 3); [`place_object`] for those that answer one object of no known size and
//! heading (TRELLIS).

mod object;
mod views;

pub use object::{Placed, Up, place_object};
pub use views::merge_views;
