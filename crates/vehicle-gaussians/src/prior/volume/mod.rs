//! Volumes from silhouettes: the distance of a point inside each cone, the box that bounds all cones, the hull they
//! carve as a field on a grid, the deformation of fields to further evidence, and where rays meet their surface.

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
pub(crate) use fill::{fill_masks, uncovered_places};
pub use known_box::{KnownBox, find_box};
pub use points::PointFit;
pub(crate) use points::fit_cloud;
pub use silhouette::Silhouette;
