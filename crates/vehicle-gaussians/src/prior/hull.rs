//! The weight-free prior: a visual hull of the silhouettes and their mirrored twins, marched per pixel.
//!
//! A mirrored camera sees the mirrored vehicle, and the vehicle is its own mirror image: N one-sided
//! silhouettes carve like 2N all round. The hull is the zero level of F(p) = min over all 2N views of the
//! signed distance from p's pixel to the silhouette's edge, in metres at p's depth. A mask carves nothing behind
//! its camera, and nothing beyond a border of its picture that cuts the vehicle.
//!
//! Where two cones cross, the hull has a crease that the vehicle does not have: F is smoothed before its zero
//! level is taken. The vehicle touches its hull only at the rims of the silhouettes; elsewhere it lies
//! decimetres inside. The surface is drawn in everywhere and then raised again, smoothly, where the rays of
//! vehicle pixels miss it, so that every mask is filled. Measured points, if there are any, pull it towards them.

use super::volume::{
    Field, KnownBox, Silhouette, fill_masks, find_box, fit_cloud, inside_all, inside_box, march,
};
use super::{DepthPrior, Ends, Estimate, Geometry, PriorReport, WorkingBox};
use rayon::prelude::*;
use vg_geometry::progress::Context;
use vg_geometry::{Error, Result};
use vg_scene::{Cloud, View};

/// Finest useful grid spacing, metres: a pixel's footprint at the usual distances.
pub(crate) const FINEST_VOXEL_M: f64 = 0.02;

/// Grid points along the longest side; bounds memory at about 2 M points for a car's proportions.
const MOST_POINTS: f64 = 224.0;

/// Radius of the smoothing, metres: on ten ray-traced vehicles 0.05 gains 0.3 dB on the unseen side over no
/// smoothing; from 0.075 on it gains no more and depth gets worse.
const SMOOTHING_M: f32 = 0.05;

/// How far the smoothed hull is drawn in before the masks are filled again, metres: on ten ray-traced vehicles
/// 0.03 to 0.05 gain most on the unseen side, see docs/SHAPE.md.
const INSET_M: f32 = 0.05;

/// Expected error of the hull's ends, metres: a little more than its surface's on average, see docs/SHAPE.md.
const END_ERROR_M: f64 = 0.1;

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct HullPrior {
    /// The vehicle's box, as far as the caller knows it.
    pub known_box: Option<KnownBox>,
    /// Points measured on the vehicle, if there are any.
    pub cloud: Option<Cloud>,
    /// Grid spacing, metres, if coarser than the finest useful one.
    pub voxel_m: Option<f64>,
}

impl DepthPrior for HullPrior {
    fn name(&self) -> &'static str {
        "hull"
    }

    fn estimate(&self, views: &[View], context: &Context) -> Result<Estimate> {
        require_masks(views)?;
        let silhouettes: Vec<Silhouette> =
            context.parallel(|| views.par_iter().map(Silhouette::new).collect());
        context.report("prior", 0.15)?;
        let working_box = context.parallel(|| find_box(self.known_box.as_ref(), views, &silhouettes))?;
        context.report("prior", 0.3)?;
        let hull = context.parallel(|| carve(&silhouettes, &working_box, self.voxel_m));
        context.report("prior", 0.5)?;
        let mut field = hull.clone();
        let masks = context.parallel(|| {
            field.smooth(SMOOTHING_M);
            field.adjust(|_, inside| inside - INSET_M);
            fill_masks(&mut field, Some(&hull), views)
        });
        context.report("prior", 0.55)?;
        let points = context.parallel(|| fit_cloud(&mut field, &hull, views, self.cloud.as_ref()));
        context.report("prior", 0.6)?;
        let mut depths = Vec::with_capacity(views.len());
        for (i, view) in views.iter().enumerate() {
            depths.push(context.parallel(|| march::march(view, &field))?);
            context.report("prior", 0.6 + 0.4 * (i + 1) as f64 / views.len() as f64)?;
        }
        let ends = context.parallel(|| Ends::of_field(&field, |_| END_ERROR_M));
        Ok(Estimate {
            geometry: Geometry { ends, ..Geometry::new(depths, Some(working_box)) },
            report: PriorReport { points, masks: Some(masks), ..PriorReport::default() },
        })
    }
}

/// Returns an error if a view has no silhouette.
pub(super) fn require_masks(views: &[View]) -> Result<()> {
    for (i, view) in views.iter().enumerate() {
        if view.mask.as_ref().is_none_or(|m| m.vehicle_pixels() == 0) {
            return Err(Error::argument(
                format!("{}.mask", view.argument(i)),
                if view.mask.is_some() { "no vehicle pixel" } else { "none" },
                "a mask that shows the vehicle, your own or from a segmentation network (mask model): without depth the shape comes from the silhouettes alone",
            ));
        }
    }
    Ok(())
}

/// Grid spacing for a vehicle of this size, metres, but no finer than `coarser`.
pub(super) fn voxel(working_box: &WorkingBox, coarser: Option<f64>) -> f64 {
    let longest = working_box.size().into_iter().fold(0.0, f64::max);
    (longest / MOST_POINTS).max(coarser.unwrap_or(FINEST_VOXEL_M)).max(FINEST_VOXEL_M)
}

/// The hull in its box, with a margin so that the surface lies inside the grid.
fn carve(silhouettes: &[Silhouette], working_box: &WorkingBox, coarser: Option<f64>) -> Field {
    let (low, high) = (glam::DVec3::from_array(working_box.low), glam::DVec3::from_array(working_box.high));
    let voxel = voxel(working_box, coarser);
    let margin = glam::DVec3::splat(2.0 * voxel);
    Field::carve(low - margin, high + margin, voxel, |p| {
        inside_all(silhouettes, p).min(inside_box(working_box, p))
    })
}
