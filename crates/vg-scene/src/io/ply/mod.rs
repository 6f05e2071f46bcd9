//! PLY: Gaussians in the 3DGS layout, and coloured point clouds.

mod content;
mod foreign;
mod gaussians;
mod header;
mod memory;
mod points;
mod rows;
mod variant;

pub(super) use content::content;
pub use content::{Content, OtherGaussians, read_content};
pub use gaussians::{FORMAT, PlyNotes, read, read_from, size_of, write, write_to};
pub use memory::{from_bytes, to_bytes};
pub use points::{ColoredPoints, read_points, read_points_from, write_points, write_points_to};
