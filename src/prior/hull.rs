//! The weight-free prior: a visual hull of the silhouettes and their mirrored twins, marched per pixel.
//!
//! A mirrored camera sees the mirrored vehicle, and the vehicle is its own mirror image: N one-sided
//! silhouettes carve like 2N all round. The hull is the zero level of F(p) = min over all 2N views of the
//! signed distance from p's pixel to the silhouette's edge, in metres at p's depth. A view says nothing of
//! points behind it, nor beyond a border of its picture that cuts the vehicle, so such a mask carves nothing there.
//!
//! Where two cones cross, the hull has a crease that the vehicle inside it has not: F is smoothed before its zero
//! level is taken. And the vehicle touches its hull at the rims of the silhouettes only; elsewhere it lies
//! decimetres inside. The surface is drawn in everywhere and then raised again, smoothly, where the rays of
//! vehicle pixels pass it by, so that every mask is filled. Measured points, where there are some, pull it to them.

use super::volume::{
    Field, Silhouette, estimate_box, fill_masks, fit_points, hold_masks, inside_all, inside_box, march,
    place_box,
};
use super::{DepthPrior, Geometry, VehicleBox};
use crate::error::{Error, Result};
use crate::progress::Context;
use crate::scene::{Cloud, View};
use rayon::prelude::*;

/// Finest useful grid spacing, metres: a pixel's footprint at the usual distances.
const FINEST_VOXEL_M: f64 = 0.02;

/// Grid points along the longest side; bounds memory at about 2 M points for a car's proportions.
const MOST_POINTS: f64 = 224.0;

/// Reach of the smoothing, metres: on ten ray-traced vehicles 0.05 gains 0.3 dB on the unseen side over none, and
/// no more from 0.075 on, where depth begins to lose.
const SMOOTHING_M: f32 = 0.05;

/// How far the smoothed hull is drawn in before the masks are filled again, metres: on ten ray-traced vehicles
/// 0.03 to 0.05 gain most on the unseen side, see docs/SHAPE.md.
const INSET_M: f32 = 0.05;

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct HullPrior {
    /// Length, width, height in metres, where the caller knows them.
    pub size: Option<[f64; 3]>,
    /// Points measured on the vehicle, where there are some.
    pub cloud: Option<Cloud>,
}

impl DepthPrior for HullPrior {
    fn name(&self) -> &'static str {
        "hull"
    }

    fn estimate(&self, views: &[View], context: &Context) -> Result<Geometry> {
        for (i, view) in views.iter().enumerate() {
            if view.mask.as_ref().is_none_or(|m| m.vehicle_pixels() == 0) {
                return Err(Error::argument(
                    format!("{}.mask", view.argument(i)),
                    if view.mask.is_some() { "no vehicle pixel" } else { "none" },
                    "a mask with the vehicle: the hull prior knows nothing but silhouettes",
                ));
            }
        }
        let silhouettes: Vec<Silhouette> =
            context.parallel(|| views.par_iter().map(Silhouette::new).collect());
        context.report("prior", 0.15)?;
        let vehicle_box = context.parallel(|| self.find_box(views, &silhouettes))?;
        context.report("prior", 0.3)?;
        let hull = context.parallel(|| carve(&silhouettes, &vehicle_box));
        context.report("prior", 0.5)?;
        let mut field = hull.clone();
        let masks = context.parallel(|| {
            field.smooth(SMOOTHING_M);
            field.adjust(|_, inside| inside - INSET_M);
            fill_masks(&mut field, Some(&hull), views)
        });
        context.report("prior", 0.55)?;
        let points = self.cloud.as_ref().map(|cloud| {
            context.parallel(|| {
                let held = hold_masks(&field, views);
                fit_points(&mut field, Some(&hull), cloud.points(), &held)
            })
        });
        context.report("prior", 0.6)?;
        let mut depths = Vec::with_capacity(views.len());
        for (i, view) in views.iter().enumerate() {
            depths.push(context.parallel(|| march::march(view, &field))?);
            context.report("prior", 0.6 + 0.4 * (i + 1) as f64 / views.len() as f64)?;
        }
        Ok(Geometry { points, masks: Some(masks), ..Geometry::new(depths, Some(vehicle_box)) })
    }
}

impl HullPrior {
    fn find_box(&self, views: &[View], silhouettes: &[Silhouette]) -> Result<VehicleBox> {
        let estimated = estimate_box(views, |p| inside_all(silhouettes, p))?;
        Ok(self.size.map_or(estimated, |size| place_box(size, &estimated)))
    }
}

/// The hull in its box, with a margin so that the surface lies inside the grid.
fn carve(silhouettes: &[Silhouette], vehicle_box: &VehicleBox) -> Field {
    let (low, high) = (glam::DVec3::from_array(vehicle_box.low), glam::DVec3::from_array(vehicle_box.high));
    let voxel = ((high - low).max_element() / MOST_POINTS).max(FINEST_VOXEL_M);
    let margin = glam::DVec3::splat(2.0 * voxel);
    Field::carve(low - margin, high + margin, voxel, |p| {
        inside_all(silhouettes, p).min(inside_box(vehicle_box, p))
    })
}
