//! What this scene needs, decided before the work is done; each omission has a reason and a count.

use super::options::{Keep, Options, PriorChoice};
use super::report::LeftOut;
use crate::error::{Error, Result};
use crate::prior::Geometry;
use crate::scene::mask::{Label, Mask};
use crate::scene::visibility::{Observer, Sight};
use crate::scene::{Scene, View};
use glam::Vec3;
use rayon::prelude::*;

/// Cameras nearer to each other than this, looking the same way, show the same.
const SAME_CENTER_M: f64 = 1e-3;
/// About 0.06 degrees.
const SAME_ROTATION: f64 = 1e-3;

/// Another view must show a place this much better before a pixel is given up for it.
const BETTER: f32 = 1.1;

/// Two depths belong to one surface when they differ by less than this many pixel footprints.
const SURFACE_FOOTPRINTS: f32 = 6.0;

/// Indices of the views worth using, and what was left out.
pub(super) fn views(scene: &Scene, keep: &Keep) -> Result<(Vec<usize>, Vec<LeftOut>)> {
    let mut used: Vec<usize> = Vec::new();
    let (mut empty, mut duplicate) = (0, 0);
    for (i, view) in scene.views.iter().enumerate() {
        if view.mask.as_ref().is_some_and(|m| m.vehicle_pixels() == 0) {
            empty += 1;
        } else if !keep.duplicate_views && used.iter().any(|&j| same_camera(view, &scene.views[j])) {
            duplicate += 1;
        } else {
            used.push(i);
        }
    }
    if used.is_empty() {
        return Err(Error::argument(
            "views",
            "every mask is empty",
            "at least one view that shows the vehicle",
        ));
    }
    let mut left_out = Vec::new();
    note(&mut left_out, "views", "the mask is empty: the view does not show the vehicle", empty);
    note(&mut left_out, "views", "another view has the same camera", duplicate);
    Ok((used, left_out))
}

fn same_camera(a: &View, b: &View) -> bool {
    let (pa, pb) = (&a.camera.vehicle_from_camera, &b.camera.vehicle_from_camera);
    let turned = (pa.rotation - pb.rotation).to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    (pa.translation - pb.translation).length() < SAME_CENTER_M
        && turned < SAME_ROTATION
        && a.camera.intrinsics == b.camera.intrinsics
        && (a.camera.width, a.camera.height) == (b.camera.width, b.camera.height)
}

/// The depth source for these views.
pub(super) fn prior(views: &[View], options: &Options) -> PriorChoice {
    match options.prior {
        PriorChoice::Auto if views.iter().all(|v| v.depth.is_some()) => PriorChoice::Given,
        PriorChoice::Auto => PriorChoice::Hull,
        chosen => chosen,
    }
}

/// Which pixels become Gaussians: vehicle, with depth, on a surface, and shown best by this view.
pub(super) fn pixels(
    views: &[View],
    geometry: &Geometry,
    keep: &Keep,
    left_out: &mut Vec<LeftOut>,
) -> Vec<Vec<bool>> {
    let observers: Vec<Observer> =
        views.iter().zip(&geometry.depths).map(|(v, d)| Observer::new(v, d)).collect();
    let verdicts: Vec<Vec<Verdict>> = (0..views.len())
        .map(|i| {
            let width = views[i].camera.width as usize;
            let mut verdicts = vec![Verdict::Outside; width * views[i].camera.height as usize];
            verdicts.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
                for (u, verdict) in row.iter_mut().enumerate() {
                    *verdict = judge(views, geometry, &observers, i, u, v, keep);
                }
            });
            verdicts
        })
        .collect();
    let count = |which: Verdict| verdicts.iter().flatten().filter(|v| **v == which).count();
    note(left_out, "pixels", "outside the mask", count(Verdict::Outside));
    note(left_out, "pixels", "no depth measured", count(Verdict::NoDepth));
    note(
        left_out,
        "pixels",
        "on the silhouette's edge, half background; the neighbours' footprints cover it",
        count(Verdict::Edge),
    );
    note(left_out, "pixels", "floating between two surfaces at a depth edge", count(Verdict::Floating));
    note(
        left_out,
        "pixels",
        "another view shows the same surface at a higher resolution",
        count(Verdict::Redundant),
    );
    verdicts.iter().map(|view| view.iter().map(|v| *v == Verdict::Kept).collect()).collect()
}

/// The SH degree that the directions the views look from can support: none for one direction; bands of
/// degree l bend over angles of about pi / l, so a narrow fan of views determines low bands only.
pub(super) fn sh_degree(views: &[View], options: &Options, left_out: &mut Vec<LeftOut>) -> u8 {
    if options.keep.sh_bands {
        return options.sh_degree;
    }
    let directions: Vec<_> = views.iter().map(|v| v.camera.vehicle_from_camera.rotation.z_axis).collect();
    let spread = directions
        .iter()
        .flat_map(|a| directions.iter().map(move |b| a.dot(*b).clamp(-1.0, 1.0).acos().to_degrees()))
        .fold(0.0f64, f64::max);
    let supported = match spread {
        s if s < NARROW_DEGREES => 0,
        s if s < WIDE_DEGREES => 1,
        _ => 3,
    };
    let degree = options.sh_degree.min(supported);
    let why = format!("the views span {spread:.0} degrees, too few to tell these bands apart");
    note(left_out, "SH bands", &why, usize::from(options.sh_degree - degree));
    degree
}

/// Views within this see the same colour: no view dependence to hold, degrees.
const NARROW_DEGREES: f64 = 10.0;

/// Within this a linear change of colour with direction is all that can be told, degrees.
const WIDE_DEGREES: f64 = 40.0;

/// What becomes of a pixel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Kept,
    Outside,
    NoDepth,
    Edge,
    Floating,
    Redundant,
}

fn judge(
    views: &[View],
    geometry: &Geometry,
    observers: &[Observer],
    i: usize,
    u: usize,
    v: usize,
    keep: &Keep,
) -> Verdict {
    let (view, depth) = (&views[i], &geometry.depths[i]);
    let pixel = v * view.camera.width as usize + u;
    if view.mask.as_ref().is_some_and(|m| m.labels()[pixel] != Label::Vehicle) {
        return Verdict::Outside;
    }
    if !keep.silhouette_edge && view.mask.as_ref().is_some_and(|m| is_at_edge(m, u as i32, v as i32)) {
        return Verdict::Edge;
    }
    let Some(z) = depth.get(u as u32, v as u32) else { return Verdict::NoDepth };
    let normal_camera = geometry.normals[i][pixel];
    let footprint = footprint(view, z);
    if !keep.floaters && is_floating(depth, u as i32, v as i32, z, footprint, normal_camera) {
        return Verdict::Floating;
    }
    if !keep.overlap {
        let point = view.lift(u as u32, v as u32, z);
        let normal = view.camera.vehicle_from_camera.rotation.as_mat3() * normal_camera;
        let own = observers[i].resolution(point, normal);
        let tolerance = SURFACE_FOOTPRINTS * footprint;
        let better = observers.iter().enumerate().any(|(j, other)| {
            j != i
                && other.resolution(point, normal) > BETTER * own
                && matches!(other.sight(point, tolerance), Sight::Surface { .. })
        });
        if better {
            return Verdict::Redundant;
        }
    }
    Verdict::Kept
}

/// Size of a pixel at depth z, metres.
fn footprint(view: &View, z: f32) -> f32 {
    z / view.camera.intrinsics.fx.min(view.camera.intrinsics.fy) as f32
}

/// A vehicle pixel between background and a pixel that is vehicle all round: its colour is partly the
/// background's, and its surfel would spill over the silhouette by its own footprint; the neighbour's footprint
/// covers it. A structure so thin that it has no such inside keeps its pixels.
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

/// A pixel that fewer than three of its neighbours share a surface with hangs between two surfaces.
fn is_floating(
    depth: &crate::scene::DepthMap,
    u: i32,
    v: i32,
    z: f32,
    footprint: f32,
    normal_camera: Vec3,
) -> bool {
    const SUPPORT: usize = 3;
    // A slanted surface changes depth by footprint * tan(obliquity) from pixel to pixel.
    let slant = 1.0 / normal_camera.z.abs().max(0.1);
    let jump = SURFACE_FOOTPRINTS * footprint * slant;
    let mut support = 0;
    for (du, dv) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
        let (nu, nv) = (u + du, v + dv);
        if nu >= 0 && nv >= 0 && nu < depth.width() as i32 && nv < depth.height() as i32 {
            let same = depth.get(nu as u32, nv as u32).is_some_and(|other| (other - z).abs() <= jump);
            support += usize::from(same);
        }
    }
    support < SUPPORT
}

pub(super) fn note(left_out: &mut Vec<LeftOut>, what: &str, why: &str, count: usize) {
    if count > 0 {
        left_out.push(LeftOut { what: what.into(), why: why.into(), count });
    }
}
