//! The numbers that the verdict is based on: how far masks, lenses, silhouettes, depth and photographs agree with one
//! another.

use super::coherence::{self, Coherence};
use super::photographs;
use crate::prior::Geometry;
use serde::Serialize;
use vg_geometry::progress::Context;
use vg_scene::mask::Label;
use vg_scene::{Mask, View};
use vg_splat::Gaussians;

/// The numbers that the verdict is based on. Those that compare views with one another are `None` where the check was
/// switched off, where a view has no mask, and where there is no other view.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Evidence {
    /// Length, width and height between the lowest and the highest half per cent of the Gaussians' centres, metres.
    pub size_m: Option<[f64; 3]>,
    /// Distance from the nearest camera to the middle of the Gaussians, metres.
    pub nearest_camera_m: Option<f64>,
    /// Approximate factor from the depth to the surface that the silhouettes bound; 1 for a depth that agrees.
    pub depth_scale: Option<f64>,
    /// The numbers of each used view, in the order of `views_used`.
    pub views: Vec<ViewEvidence>,
}

/// The numbers of one view. Shares are 0 to 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ViewEvidence {
    /// The view's name; where it has none, its position among the used views.
    pub name: String,
    /// Pixels of the picture.
    pub pixels: f64,
    /// Share of the picture that the mask labels as vehicle.
    pub mask_share: f64,
    /// Share of the picture's border pixels that the mask labels as vehicle.
    pub border_share: f64,
    /// Share of the mask's pixels for which the lens model has no ray.
    pub without_ray: f64,
    /// Share of the mask's pixels whose rays meet the intersection of the other views' silhouettes.
    pub coherent: Option<f64>,
    /// Share of the mask's pixels whose rays meet the intersection of the other views' silhouettes and of all
    /// silhouettes mirrored at the plane of symmetry.
    pub coherent_mirrored: Option<f64>,
    /// Share of the other views' pixels whose rays would meet without this view's silhouette.
    pub blamed: Option<f64>,
    /// Share of the pixels with depth whose lifted points lie inside the other views' silhouettes.
    pub depth_inside: Option<f64>,
    /// Correlation of the brightness that this view and another one show of the same places; the highest over the
    /// others.
    pub photographs: Option<f64>,
}

/// The input of the examination.
pub(in crate::pipeline) struct Examined<'a> {
    /// The used views as the caller gave them, with lens distortion.
    pub(in crate::pipeline) given: &'a [&'a View],
    /// The undistorted views with the cameras and masks that were used; y = 0 is the plane of symmetry.
    pub(in crate::pipeline) used: &'a [View],
    /// The depth of the used views; further views (mirrored ones) follow in its list.
    pub(in crate::pipeline) geometry: Option<&'a Geometry>,
}

/// Compares views with one another.
pub(in crate::pipeline) fn compare(examined: &Examined, context: &Context) -> Evidence {
    context.parallel(|| {
        let Examined { used, geometry, .. } = examined;
        let mut evidence = glance(examined);
        if let Some(Coherence { views, depth_scale }) = coherence::measure(used, *geometry) {
            evidence.depth_scale = depth_scale;
            for (view, found) in evidence.views.iter_mut().zip(views) {
                view.coherent = found.coherent;
                view.coherent_mirrored = Some(found.coherent_mirrored);
                view.blamed = found.blamed;
                view.depth_inside = found.depth_inside;
            }
        }
        if let Some(geometry) = geometry {
            let agreement = photographs::agreement(used, geometry);
            evidence.views.iter_mut().zip(agreement).for_each(|(view, found)| view.photographs = found);
        }
        evidence
    })
}

/// Measures each view by itself.
pub(in crate::pipeline) fn glance(examined: &Examined) -> Evidence {
    let all_used = examined.given.len() == examined.used.len();
    let measured = |(i, used): (usize, &View)| {
        // Views that show no vehicle at the working resolution are given and not used.
        let given = match all_used {
            true => examined.given.get(i),
            false => examined.given.iter().find(|view| view.name == used.name),
        };
        let mask = given.and_then(|view| view.mask.as_ref());
        ViewEvidence {
            name: match used.name.as_str() {
                "" => format!("{} of those used", i + 1),
                name => name.to_owned(),
            },
            pixels: used.image.pixels().len() as f64,
            mask_share: mask.map_or(1.0, |m| m.vehicle_pixels() as f64 / m.labels().len() as f64),
            border_share: mask.map_or(1.0, border_share),
            without_ray: given.map_or(0.0, |view| without_ray(view)),
            ..ViewEvidence::default()
        }
    };
    Evidence { views: examined.used.iter().enumerate().map(measured).collect(), ..Evidence::default() }
}

fn border_share(mask: &Mask) -> f64 {
    let (w, h) = (mask.width(), mask.height());
    let rows = (0..w).flat_map(|u| [(u, 0), (u, h - 1)]);
    let columns = (0..h).flat_map(|v| [(0, v), (w - 1, v)]);
    let vehicle = rows.chain(columns).filter(|&(u, v)| mask.is_vehicle(u, v)).count();
    vehicle as f64 / f64::from(2 * (w + h))
}

/// Share of the mask's pixels for which the lens model has no ray, from a sample.
fn without_ray(view: &View) -> f64 {
    /// Approximate size of the sample, enough to detect a share of 1 %.
    const SAMPLES: usize = 400;
    if view.camera.distortion.is_none() {
        return 0.0;
    }
    let labels = view.mask.as_ref().map(Mask::labels);
    let is_vehicle = |pixel: &usize| labels.is_none_or(|labels| labels[*pixel] == Label::Vehicle);
    let vehicle = || (0..view.image.pixels().len()).filter(is_vehicle);
    let every = (vehicle().count() / SAMPLES).max(1);
    let (mut sampled, mut lost) = (0usize, 0usize);
    let width = view.camera.width as usize;
    for pixel in vehicle().step_by(every) {
        let at = [(pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5];
        sampled += 1;
        lost += usize::from(view.camera.ray(at).is_none());
    }
    lost as f64 / sampled.max(1) as f64
}

impl Evidence {
    /// Adds the size and the distance of the model, in the caller's frame.
    pub(in crate::pipeline) fn with_model(mut self, gaussians: &Gaussians, views: &[View]) -> Self {
        /// Share of the centres at either end that are ignored as strays.
        const STRAYS: f64 = 0.005;
        let n = gaussians.len();
        if n == 0 {
            return self;
        }
        let rank = ((n - 1) as f64 * STRAYS) as usize;
        let (mut size, mut middle) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            let mut along: Vec<f32> = gaussians.means().iter().map(|mean| mean[k]).collect();
            let low = f64::from(*along.select_nth_unstable_by(rank, f32::total_cmp).1);
            let high = f64::from(*along.select_nth_unstable_by(n - 1 - rank, f32::total_cmp).1);
            (size[k], middle[k]) = (high - low, 0.5 * (high + low));
        }
        let distance = |view: &View| (view.camera.center() - glam::DVec3::from_array(middle)).length();
        self.size_m = Some(size);
        self.nearest_camera_m = views.iter().map(distance).min_by(f64::total_cmp);
        self
    }
}
