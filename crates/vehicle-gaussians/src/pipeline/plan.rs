//! What this scene needs, decided before the work is done; each omission has a reason and a count.

use super::options::{Keep, Options, PriorChoice};
use super::report::LeftOut;
use crate::prior::volume::known_box::TELLING_M;
use crate::prior::{BoxSource, Geometry, PointFit, WorkingBox};
use glam::DVec3;
use vg_geometry::Camera;
use vg_geometry::{Error, Result};
use vg_scene::{Scene, View};

/// Cameras nearer to each other than this, looking the same way, show the same.
const SAME_CENTER_M: f64 = 1e-3;
/// About 0.06 degrees.
const SAME_ROTATION: f64 = 1e-3;

/// Views within this see the same colour: no view dependence to hold, degrees.
const NARROW_DEGREES: f64 = 10.0;

/// Within this a linear change of colour with direction is all that can be told, degrees.
const WIDE_DEGREES: f64 = 40.0;

/// Indices of the views worth using.
pub(super) fn views(scene: &Scene, keep: &Keep, left_out: &mut Vec<LeftOut>) -> Result<Vec<usize>> {
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
    note(left_out, "views", "the mask is empty: the view does not show the vehicle", empty);
    note(left_out, "views", "another view has the same camera", duplicate);
    Ok(used)
}

fn same_camera(a: &View, b: &View) -> bool {
    let (pa, pb) = (a.camera.vehicle_from_camera, b.camera.vehicle_from_camera);
    let turned = (pa.rotation - pb.rotation).to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    (pa.translation - pb.translation).length() < SAME_CENTER_M
        && turned < SAME_ROTATION
        && Camera { vehicle_from_camera: pa, ..b.camera } == a.camera
}

/// The depth source that was asked for, for views that all have depth or not.
pub(super) fn prior(asked: PriorChoice, all_have_depth: bool) -> PriorChoice {
    match asked {
        PriorChoice::Auto if all_have_depth => PriorChoice::Given,
        PriorChoice::Auto => PriorChoice::Shape,
        chosen => chosen,
    }
}

/// Why no pixel became a Gaussian, the most frequent reason first.
pub(super) fn nothing_kept(left_out: &[LeftOut]) -> String {
    let mut pixels: Vec<&LeftOut> = left_out.iter().filter(|l| l.what == "pixels").collect();
    pixels.sort_by_key(|l| std::cmp::Reverse(l.count));
    let reasons: Vec<String> = pixels.iter().map(|l| format!("{} {}", l.count, l.why)).collect();
    format!(
        "no pixel is left to make a Gaussian of: {}; check that masks and depth overlap",
        reasons.join(", ")
    )
}

/// The SH degree that the directions the vehicle is seen from can support: none for one direction; bands of
/// degree l bend over angles of about pi / l, so a narrow fan of views determines low bands only.
pub(super) fn sh_degree(
    views: &[View],
    geometry: &Geometry,
    options: &Options,
    left_out: &mut Vec<LeftOut>,
) -> u8 {
    if options.keep.sh_bands {
        return options.sh_degree;
    }
    let middle = geometry.middle(views);
    let directions: Vec<DVec3> =
        views.iter().map(|v| (middle - v.camera.center()).normalize_or(DVec3::X)).collect();
    let spread = directions
        .iter()
        .flat_map(|a| directions.iter().map(move |b| a.angle_between(*b).to_degrees()))
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

/// A size that the caller gave and the prior did not need.
pub(super) fn note_size(left_out: &mut Vec<LeftOut>, is_known: bool, geometry: &Geometry) {
    let why = match geometry.working_box {
        Some(WorkingBox { source: BoxSource::Given, .. }) => return,
        Some(WorkingBox { contradicted_m, .. }) if contradicted_m > 0.0 => {
            format!("the silhouettes contradict it by {contradicted_m:.2} m")
        }
        Some(_) => format!("the silhouettes bound the vehicle as closely, to {TELLING_M} m"),
        None => "the depth is given, not estimated".into(),
    };
    note(left_out, "vehicle size", &why, usize::from(is_known));
}

/// Points of a cloud of `count` that moved no surface.
pub(super) fn note_cloud(left_out: &mut Vec<LeftOut>, count: usize, fit: Option<PointFit>) {
    match fit {
        Some(fit) => note(left_out, "points", "outside the silhouettes: not the vehicle's", fit.outside),
        None => note(left_out, "points", "the depth is given, not estimated", count),
    }
}

pub(super) fn note(left_out: &mut Vec<LeftOut>, what: &str, why: &str, count: usize) {
    if count > 0 {
        left_out.push(LeftOut { what: what.into(), why: why.into(), count });
    }
}
