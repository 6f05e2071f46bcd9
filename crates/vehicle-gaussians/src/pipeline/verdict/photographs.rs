//! Whether the photographs show the same places in the same brightness: a photograph of another camera does not.

use crate::prior::Geometry;
use glam::Vec3;
use rayon::prelude::*;
use vg_scene::View;
use vg_scene::visibility::{SURFACE_M, Sight};

/// The most vehicle pixels of each view that are compared with the others.
const MOST_PER_VIEW: usize = 1500;

/// Shared places that a correlation needs to be meaningful.
const LEAST_SHARED: usize = 60;

/// Neighbours in the list that a view is compared with, where there are many views.
const MOST_PARTNERS: usize = 16;

/// The correlation of each view's brightness with that of the view that agrees best, over the places that both show;
/// `None` where no other view shows enough of the same places.
pub(super) fn agreement(views: &[View], geometry: &Geometry) -> Vec<Option<f64>> {
    let observers = geometry.observers(views);
    let brightness = |color: Vec3| f64::from(color.dot(Vec3::splat(1.0 / 3.0)));
    let pair = |places: &[(Vec3, f64)], other: usize| {
        let seen =
            places.iter().filter(|(place, _)| observers[other].sight(*place, SURFACE_M) == Sight::Surface);
        let both: Vec<[f64; 2]> =
            seen.map(|(place, own)| [*own, brightness(observers[other].color_at(*place))]).collect();
        (both.len() >= LEAST_SHARED).then(|| correlation(&both))
    };
    let of_view = |i: usize| {
        let (view, depth) = (&views[i], geometry.depths[i].depth());
        let width = view.camera.width as usize;
        let with_depth = || (0..depth.len()).filter(|&pixel| depth[pixel] > 0.0 && is_vehicle(view, pixel));
        let every = with_depth().count().div_ceil(MOST_PER_VIEW).max(1);
        let places: Vec<(Vec3, f64)> = with_depth()
            .step_by(every)
            .map(|pixel| {
                let place = view.lift((pixel % width) as u32, (pixel / width) as u32, depth[pixel]);
                (place, brightness(observers[i].color_at(place)))
            })
            .collect();
        let n = views.len();
        let near = |j: &usize| j.abs_diff(i).min(n - j.abs_diff(i)) <= MOST_PARTNERS / 2;
        (0..n).filter(|j| *j != i && near(j)).filter_map(|j| pair(&places, j)).max_by(f64::total_cmp)
    };
    (0..views.len()).into_par_iter().map(of_view).collect()
}

fn is_vehicle(view: &View, pixel: usize) -> bool {
    let width = view.camera.width as usize;
    view.mask.as_ref().is_none_or(|mask| mask.is_vehicle((pixel % width) as u32, (pixel / width) as u32))
}

/// Pearson's correlation; 0 where either variable is constant.
fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |k: usize| pairs.iter().map(|p| p[k]).sum::<f64>() / n;
    let means = [mean(0), mean(1)];
    let product =
        |a: usize, b: usize| pairs.iter().map(|p| (p[a] - means[a]) * (p[b] - means[b])).sum::<f64>();
    let spread = (product(0, 0) * product(1, 1)).sqrt();
    if spread > 0.0 { product(0, 1) / spread } else { 0.0 }
}
