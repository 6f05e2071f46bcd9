//! The stage `pixels`: the choice of pixels that become Gaussians. They show the vehicle, have depth, lie on a surface,
//! and no other view shows the place better.

use super::frame::InFrame;
use super::guard::Doubt;
use super::options::Keep;
use super::plan::note;
use super::report::LeftOut;
use super::run::{PointCloud, Run};
use crate::prior::Geometry;
use crate::symmetry::BETTER;
use glam::Vec3;
use rayon::prelude::*;
use vg_geometry::Result;
use vg_scene::mask::{Label, Mask};
use vg_scene::visibility::{Observer, Sight};
use vg_scene::{DepthMap, View};

/// Two depths belong to one surface when they differ by less than this many pixel footprints.
const SURFACE_FOOTPRINTS: f32 = 6.0;

/// Chooses the pixels, and makes the coloured points where the caller wants them.
pub(super) fn pixels(run: &mut Run) -> Result<()> {
    let (views, surface, options) = (&*run.views, &*run.surface, &run.plan.options);
    let (geometry, left_out) = (&surface.geometry, &mut run.left_out);
    let kept =
        run.context.parallel(|| kept(views.modelled(), geometry, &surface.doubts, &options.keep, left_out));
    let points = options.points.then(|| InFrame::new(point_cloud(&views.working, geometry)));
    run.kept.set(kept);
    run.points.set(points);
    Ok(())
}

/// Every vehicle pixel with depth, lifted (paper eq. 5).
fn point_cloud(views: &[View], geometry: &Geometry) -> PointCloud {
    let mut cloud = PointCloud::default();
    for (view, depth) in views.iter().zip(&geometry.depths) {
        for (v, u) in (0..view.camera.height).flat_map(|v| (0..view.camera.width).map(move |u| (v, u))) {
            if view.mask.as_ref().is_none_or(|m| m.is_vehicle(u, v))
                && let Some(z) = depth.get(u, v)
            {
                cloud.positions.push(view.lift(u, v, z).to_array());
                cloud.colors.push(view.image.get(u, v));
            }
        }
    }
    cloud
}

/// The decision about a pixel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Kept,
    Outside,
    NoDepth,
    Edge,
    Floating,
    Stray,
    Denied,
    Redundant,
}

/// One flag per pixel of every view; rejected pixels are counted by reason. `doubts` hold why the guard removed a depth
/// from `geometry`; they are empty where the guard did not run.
fn kept(
    views: &[View],
    geometry: &Geometry,
    doubts: &[Vec<Doubt>],
    keep: &Keep,
    left_out: &mut Vec<LeftOut>,
) -> Vec<Vec<bool>> {
    let judge = Judge { views, geometry, doubts, observers: geometry.observers(views), keep };
    let verdicts: Vec<Vec<Verdict>> = (0..views.len())
        .map(|i| {
            (0..views[i].image.pixels().len()).into_par_iter().map(|pixel| judge.verdict(i, pixel)).collect()
        })
        .collect();
    for (verdict, why) in [
        (Verdict::Outside, "outside the mask"),
        (Verdict::NoDepth, "no depth measured"),
        (Verdict::Edge, "on the silhouette's edge, half background; the neighbours' footprints cover it"),
        (Verdict::Floating, "floating between two surfaces at a depth edge"),
        (Verdict::Stray, "a small patch of depth before or behind the vehicle"),
        (Verdict::Denied, "farther outside the vehicle in most other views' masks than poses are wrong"),
        (Verdict::Redundant, "another view shows the same surface at a higher resolution"),
    ] {
        let count = verdicts.iter().flatten().filter(|v| **v == verdict).count();
        note(left_out, "pixels", why, count);
    }
    verdicts.iter().map(|view| view.iter().map(|v| *v == Verdict::Kept).collect()).collect()
}

struct Judge<'a> {
    views: &'a [View],
    geometry: &'a Geometry,
    doubts: &'a [Vec<Doubt>],
    observers: Vec<Observer<'a>>,
    keep: &'a Keep,
}

impl Judge<'_> {
    fn verdict(&self, i: usize, pixel: usize) -> Verdict {
        let (view, depth) = (&self.views[i], &self.geometry.depths[i]);
        let (u, v) = (pixel as u32 % view.camera.width, pixel as u32 / view.camera.width);
        if view.mask.as_ref().is_some_and(|m| m.labels()[pixel] != Label::Vehicle) {
            return Verdict::Outside;
        }
        let Some(z) = depth.get(u, v) else {
            return match self.doubts.get(i).map_or(Doubt::None, |doubts| doubts[pixel]) {
                Doubt::None => Verdict::NoDepth,
                Doubt::Floating => Verdict::Floating,
                Doubt::Stray => Verdict::Stray,
                Doubt::Denied => Verdict::Denied,
            };
        };
        if !self.keep.silhouette_edge && view.mask.as_ref().is_some_and(|m| is_at_edge(m, u as i32, v as i32))
        {
            return Verdict::Edge;
        }
        let tolerance = SURFACE_FOOTPRINTS * z / view.camera.intrinsics.smaller_focal() as f32;
        if !self.keep.floaters && is_floating(depth, &self.geometry.normals[i], u, v, tolerance) {
            return Verdict::Floating;
        }
        if !self.keep.overlap && self.is_shown_better(i, pixel, view.lift(u, v, z), tolerance) {
            return Verdict::Redundant;
        }
        Verdict::Kept
    }

    /// Whether another view shows the same place at a higher resolution.
    fn is_shown_better(&self, i: usize, pixel: usize, place: Vec3, tolerance: f32) -> bool {
        let rotation = self.views[i].camera.vehicle_from_camera.rotation.as_mat3();
        let normal = rotation * self.geometry.normals[i][pixel];
        let enough = BETTER * self.observers[i].resolution(place, normal);
        self.observers.iter().enumerate().any(|(j, other)| {
            j != i
                && other.resolution(place, normal) > enough
                && other.sight(place, tolerance) == Sight::Surface
        })
    }
}

/// Whether a vehicle pixel lies between the background and a pixel with vehicle on all sides. Its colour is partly the
/// background's, and its surfel would extend beyond the silhouette by its own footprint; the footprint of the neighbour
/// covers it. A structure too thin to have such an inside keeps its pixels.
fn is_at_edge(mask: &Mask, u: i32, v: i32) -> bool {
    const CROSS: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
    let label = |u: i32, v: i32| {
        let inside = u >= 0 && v >= 0 && u < mask.width() as i32 && v < mask.height() as i32;
        inside.then(|| mask.labels()[v as usize * mask.width() as usize + u as usize])
    };
    let beside_background =
        |u: i32, v: i32| CROSS.iter().any(|(du, dv)| label(u + du, v + dv) == Some(Label::Background));
    let has_inner_neighbour = || {
        (-1..=1).any(|dv| {
            (-1..=1)
                .any(|du| label(u + du, v + dv) == Some(Label::Vehicle) && !beside_background(u + du, v + dv))
        })
    };
    beside_background(u, v) && has_inner_neighbour()
}

/// Whether a pixel lies between two surfaces: fewer than three of its neighbours share a surface with it. The depth of
/// a slanted surface changes from pixel to pixel by footprint / cos(obliquity), which is computed from the normal of
/// the neighbour, since a floating pixel has no valid normal.
fn is_floating(depth: &DepthMap, normals: &[Vec3], u: u32, v: u32, tolerance: f32) -> bool {
    const SUPPORT: usize = 3;
    const LEAST_COS: f32 = 0.1;
    let (width, height) = (depth.width(), depth.height());
    let here = depth.depth()[(v * width + u) as usize];
    let mut support = 0;
    for y in v.saturating_sub(1)..(v + 2).min(height) {
        for x in u.saturating_sub(1)..(u + 2).min(width) {
            let neighbour = (y * width + x) as usize;
            let z = depth.depth()[neighbour];
            let allowed = tolerance / normals[neighbour].z.abs().max(LEAST_COS);
            support += usize::from((x, y) != (u, v) && z > 0.0 && (z - here).abs() <= allowed);
        }
    }
    support < SUPPORT
}
