//! Clouds of measured points that are named on the command line.

use crate::job::{Failure, Result};
use std::path::Path;
use vg::scene::Cloud;

/// Reads the points of a PLY file, vehicle frame, metres.
pub(crate) fn read(path: &Path) -> Result<Cloud> {
    let (points, _) = vg::io::ply::read_points(path)?;
    Cloud::new(points).map_err(|e| Failure::job(format!("{}: {e}", path.display())))
}
