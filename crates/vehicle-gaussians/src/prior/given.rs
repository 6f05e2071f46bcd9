//! Depth that the caller measured: LiDAR, a depth camera, or any model run elsewhere.

use super::{DepthPrior, Estimate, Geometry};
use vg_geometry::progress::Context;
use vg_geometry::{Error, Result};
use vg_scene::View;

/// Returns the depth that the views carry.
#[derive(Clone, Copy, Debug, Default)]
pub struct GivenDepth;

impl DepthPrior for GivenDepth {
    fn name(&self) -> &'static str {
        "given"
    }

    fn estimate(&self, views: &[View], _context: &Context) -> Result<Estimate> {
        let depth_of = |(i, view): (usize, &View)| {
            view.depth.clone().ok_or_else(|| {
                Error::argument(
                    format!("{}.depth", view.argument(i)),
                    "none",
                    "metric depth for every used view (for a scene on disk: depth_file_path, or depth/{stem,name,stem_depth,stem.depth}.{png,npy,pfm,exr}, or these names in depths/), or another prior",
                )
            })
        };
        let depths = views.iter().enumerate().map(depth_of).collect::<Result<_>>()?;
        Ok(Geometry::new(depths, None).into())
    }
}
