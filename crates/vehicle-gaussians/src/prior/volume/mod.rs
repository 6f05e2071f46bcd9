//! What silhouettes say of space: how far inside each cone a point is, the box that bounds them all, the hull they
//! carve as a field on a grid, how fields are bent to what else is known, and where rays meet their surface.

pub mod extent;
pub(crate) mod field;
pub(crate) mod fill;
pub mod known_box;
pub(crate) mod march;
pub(crate) mod points;
pub(crate) mod relax;
pub mod silhouette;

pub use extent::{Extent, inside_all, inside_both, inside_box, inside_known, whereabouts};
pub(crate) use field::Field;
pub use fill::Filled;
pub(crate) use fill::{denied, fill_masks};
pub use known_box::{KnownBox, find_box};
pub use points::PointFit;
pub(crate) use points::fit_cloud;
pub use silhouette::Silhouette;
