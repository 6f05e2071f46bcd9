//! PLY: Gaussians in the 3DGS layout, and coloured point clouds.

mod gaussians;
mod header;
mod memory;
mod points;
mod rows;

pub use gaussians::{PlyNotes, read, read_from, size_of, write, write_to};
pub use memory::{from_bytes, to_bytes};
pub use points::{ColoredPoints, read_points, read_points_from, write_points};
