//! Points measured on the vehicle, from the depth that some views have and others do not.
//!
//! The given depth is metric and the missing depth is estimated. The estimate is fitted to the points, so that all
//! views show one surface: the measured one where there is one.

use vg_geometry::Result;
use vg_scene::{Cloud, View};

/// The most points: one for every 5 mm of a car's side. More add no information.
const MOST_POINTS: usize = 300_000;

/// The points of `cloud` and the lifted vehicle pixels with depth, in the frame of the views; `None` without any.
pub(super) fn points(views: &[View], cloud: Option<Cloud>) -> Result<Option<Cloud>> {
    let pixels: usize = views.iter().map(|view| vehicle_pixels(view).count()).sum();
    let mut points: Vec<[f32; 3]> = cloud.as_ref().map_or_else(Vec::new, |cloud| cloud.points().to_vec());
    let lifted = views
        .iter()
        .flat_map(|view| vehicle_pixels(view).map(move |(u, v, depth)| view.lift(u, v, depth).to_array()));
    points.extend(lifted.step_by(pixels.div_ceil(MOST_POINTS).max(1)));
    // Points too far away for f32 are not on the vehicle.
    points.retain(|point| point.iter().all(|c| c.is_finite()));
    match points.is_empty() {
        true => Ok(cloud),
        false => Cloud::new(points).map(Some),
    }
}

/// Columns, rows and depths of the vehicle pixels with depth.
fn vehicle_pixels(view: &View) -> impl Iterator<Item = (u32, u32, f32)> {
    let maps = view.mask.as_ref().zip(view.depth.as_ref());
    maps.into_iter().flat_map(|(mask, depth)| {
        let pixels = (0..mask.height()).flat_map(|v| (0..mask.width()).map(move |u| (u, v)));
        pixels.filter(|&(u, v)| mask.is_vehicle(u, v)).filter_map(|(u, v)| Some((u, v, depth.get(u, v)?)))
    })
}
