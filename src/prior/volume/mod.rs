//! What silhouettes say of space: how far inside each cone a point is, the box that bounds them all, the hull they
//! carve as a field on a grid, and where rays meet its surface.

pub(crate) mod extent;
pub(crate) mod field;
pub(crate) mod fill;
pub(crate) mod march;
pub(crate) mod points;
pub(crate) mod relax;
pub(crate) mod silhouette;

pub(crate) use extent::{estimate_box, inside_all, inside_box, place_box};
pub(crate) use field::Field;
pub use fill::Filled;
pub(crate) use fill::{fill_masks, hold_masks};
pub use points::PointFit;
pub(crate) use points::fit_points;
pub(crate) use silhouette::Silhouette;
