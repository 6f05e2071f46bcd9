//! What silhouettes say of space: how far inside each cone a point is, the box that bounds them all, the hull they
//! carve as a field on a grid, and where rays meet its surface.

pub(crate) mod extent;
pub(crate) mod field;
pub(crate) mod march;
pub(crate) mod silhouette;

pub(crate) use extent::{estimate_box, inside_all, inside_box, place_box, whereabouts};
pub(crate) use field::Field;
pub(crate) use silhouette::Silhouette;
