//! A box whose size is known, placed where the silhouettes allow it.
//!
//! The size of a tracked box is good to centimetres, its place to decimetres. The place follows from the silhouettes.
//! The vehicle touches every tangent plane of a silhouette and every face of its box. So the box reaches every tangent
//! plane, and its faces lie within the hull. Both conditions are linear in the box's centre (x, z): they leave a
//! polygon of possible centres. The union of the boxes over this polygon bounds the vehicle.

use super::extent::{Extent, extent, inside_all};
use super::silhouette::Silhouette;
use crate::prior::{BoxSource, WorkingBox};
use glam::{DVec2, DVec3};
use vg_geometry::{Error, Result};
use vg_scene::{Mask, VehicleBox, View};

/// Tangents of a silhouette, evenly around it.
const TANGENTS: usize = 48;

/// Step by which the conditions are relaxed until a place is left, metres.
const SLACK_STEP_M: f64 = 0.02;

/// Combined error of masks, poses and sizes, metres: added to the slack that the conditions need.
const TOLERANCE_M: f64 = 0.03;

/// Slack above which the size is doubtful and the silhouettes are used instead, metres.
const DOUBTED_M: f64 = 0.1;

/// Slack above which the size is an error, metres: it belongs to another vehicle.
const CONTRADICTED_M: f64 = 0.25;

/// Gain on a side below which a known box adds nothing to the estimate without it, metres: its possible places differ
/// by as much.
pub const TELLING_M: f64 = 0.2;

/// Tolerance of a place that the caller gave, metres: three standard deviations of a tracked box.
const PLACE_M: f64 = 0.3;

/// The vehicle's box, as far as the caller knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownBox {
    /// Length, width, height, metres.
    pub size: [f64; 3],
    /// x and z of the box's centre, metres, if known; its y is 0.
    pub center: Option<[f64; 2]>,
}

impl KnownBox {
    /// The caller's box in the frame in which the vehicle's middle plane is y = 0. If `is_own_frame`, that is the box's
    /// own frame, about its centre; otherwise the cameras' frame, with the box on its plane y = 0.
    pub fn in_working_frame(known: &VehicleBox, is_own_frame: bool) -> Self {
        let center = known.place.map(|place| match is_own_frame {
            true => [0.0, 0.0],
            false => [place.center[0], place.center[2]],
        });
        Self { size: known.size, center }
    }
}

/// Possible places of a box of known size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Lowest x and z of the centre, metres.
    pub low: DVec2,
    /// Highest x and z of the centre, metres.
    pub high: DVec2,
    /// Slack that the conditions needed, metres.
    pub slack_m: f64,
}

/// The box to look for the vehicle in, bounded by the silhouettes and by a box of known size where that is tighter.
///
/// # Errors
/// [`Error::Reconstruction`] if the silhouettes bound no vehicle, [`Error::Argument`] if the known box fits nowhere.
pub fn find_box(known: Option<&KnownBox>, views: &[View], silhouettes: &[Silhouette]) -> Result<WorkingBox> {
    let inside = |p| inside_all(silhouettes, p);
    let estimated = extent(views, None, inside)?;
    let Some(known) = known else { return estimated.estimated_box() };
    // With a known size the usual proportions of road vehicles are not needed.
    let grown = known.size.map(|side| side + 2.0 * TOLERANCE_M);
    let carved = extent(views, Some(grown), inside)?;
    let placement = place(known, &carved, views)?;
    Ok(bounded(known, &placement, &carved, &estimated))
}

/// The carved extent, limited to the reach of a box of the known size from all its possible places; or the box that is
/// estimated without the size, if that is nearly the same or the size is doubtful.
fn bounded(known: &KnownBox, placement: &Placement, carved: &Extent, estimated: &Extent) -> WorkingBox {
    let half = 0.5 * DVec3::from_array(known.size);
    let reach = half + DVec3::splat(TOLERANCE_M);
    let low = DVec3::new(placement.low.x - reach.x, -reach.y, placement.low.y - reach.z).max(carved.low);
    let high = DVec3::new(placement.high.x + reach.x, reach.y, placement.high.y + reach.z).min(carved.high);
    // Wheels bound the body's width more tightly than a size that may include mirrors. Along the other axes the
    // estimate is too short if the views show only one end of the vehicle.
    let room = estimated.high - estimated.low;
    let ended = |k: usize| k != 1 && room[k] < known.size[k];
    let within = |k: usize, side: f64, estimate: f64, clamp: fn(f64, f64) -> f64| match ended(k) {
        true => side,
        false => clamp(side, estimate),
    };
    let low = [0, 1, 2].map(|k| within(k, low[k], estimated.low[k], f64::max));
    let high = [0, 1, 2].map(|k| within(k, high[k], estimated.high[k], f64::min));
    let closer = (0..3).map(|k| room[k] - (high[k] - low[k])).fold(0.0, f64::max);
    let tells = closer >= TELLING_M || (0..3).any(ended);
    let contradicted_m = placement.slack_m;
    if (!tells || contradicted_m > DOUBTED_M)
        && let Ok(estimated) = estimated.estimated_box()
    {
        return WorkingBox { contradicted_m, ..estimated };
    }
    WorkingBox { low, high, source: BoxSource::Given, contradicted_m }
}

/// Centres that a box of the known size can have.
fn place(known: &KnownBox, extent: &Extent, views: &[View]) -> Result<Placement> {
    let conditions = conditions(known, extent, views);
    let most = (CONTRADICTED_M / SLACK_STEP_M).round() as usize;
    for step in 0..=most {
        let slack_m = step as f64 * SLACK_STEP_M;
        if polygon(&conditions, extent, slack_m).is_some()
            && let Some((low, high)) = polygon(&conditions, extent, slack_m + TOLERANCE_M)
        {
            return Ok(Placement { low, high, slack_m });
        }
    }
    let [length, width, height] = known.size;
    let shown = extent.high - extent.low;
    let at = known.center.map_or_else(String::new, |[x, z]| format!(" around x = {x:.2} m, z = {z:.2} m"));
    Err(Error::argument(
        "options.vehicle_size",
        format!("{length} x {width} x {height} m, which does not fit the silhouettes anywhere{at}"),
        format!(
            "length, width and height, to {CONTRADICTED_M} m, of a vehicle within the silhouettes' bounds of {:.1} x \
             {:.1} x {:.1} m; leave the size out if it is not known",
            shown.x, shown.y, shown.z
        ),
    ))
}

/// normal . (x, z) + offset >= 0 for the centre of the box; lengths in metres.
#[derive(Clone, Copy, Debug)]
struct Condition {
    normal: DVec2,
    offset: f64,
}

fn conditions(known: &KnownBox, extent: &Extent, views: &[View]) -> Vec<Condition> {
    let half = 0.5 * DVec3::from_array(known.size);
    let reaches = views.iter().flat_map(tangent_planes).map(|(normal, camera)| Condition {
        normal: DVec2::new(normal.x, normal.z),
        offset: half.dot(normal.abs()) - normal.dot(camera),
    });
    let above = |axis: DVec2, least: f64| Condition { normal: axis, offset: -least };
    let below = |axis: DVec2, most: f64| Condition { normal: -axis, offset: most };
    let mut all: Vec<Condition> = reaches.collect();
    for (axis, low, high, half) in
        [(DVec2::X, extent.low.x, extent.high.x, half.x), (DVec2::Y, extent.low.z, extent.high.z, half.z)]
    {
        all.extend([above(axis, low + half), below(axis, high - half)]);
    }
    if let Some([x, z]) = known.center {
        for (axis, at) in [(DVec2::X, x), (DVec2::Y, z)] {
            all.extend([above(axis, at - PLACE_M), below(axis, at + PLACE_M)]);
        }
    }
    all
}

/// Lowest and highest corner of the polygon that the conditions leave with a slack of `slack_m`.
fn polygon(conditions: &[Condition], extent: &Extent, slack_m: f64) -> Option<(DVec2, DVec2)> {
    let (low, high) = (extent.low, extent.high);
    let mut corners = vec![
        DVec2::new(low.x, low.z),
        DVec2::new(high.x, low.z),
        DVec2::new(high.x, high.z),
        DVec2::new(low.x, high.z),
    ];
    for condition in conditions {
        corners = clipped(&corners, |p| condition.normal.dot(p) + condition.offset + slack_m);
    }
    let first = *corners.first()?;
    Some(corners.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p))))
}

/// The part of a convex polygon where `inside` is not negative (Sutherland and Hodgman 1974).
fn clipped(corners: &[DVec2], inside: impl Fn(DVec2) -> f64) -> Vec<DVec2> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (i, &here) in corners.iter().enumerate() {
        let next = corners[(i + 1) % corners.len()];
        let (a, b) = (inside(here), inside(next));
        if a >= 0.0 {
            kept.push(here);
        }
        if (a >= 0.0) != (b >= 0.0) {
            kept.push(here + (next - here) * (a / (a - b)));
        }
    }
    kept
}

/// Planes through the camera that touch the silhouette from outside: the unit normal, which points away from the
/// vehicle, and the camera's centre, vehicle frame. The vehicle reaches each of them even where a border or an occluder
/// cuts the silhouette, because the ray of the outermost pixel lies in the plane.
fn tangent_planes(view: &View) -> Vec<(DVec3, DVec3)> {
    let Some(mask) = &view.mask else { return Vec::new() };
    let rows = rows(mask);
    let (i, pose) = (view.camera.intrinsics, view.camera.vehicle_from_camera);
    let plane = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / TANGENTS as f64).sin_cos();
        let corner = |&(v, first, last): &(u32, u32, u32)| {
            let u = if cos > 0.0 { last + 1 } else { first };
            cos * f64::from(u) + sin * f64::from(if sin > 0.0 { v + 1 } else { v })
        };
        let support = rows.iter().map(corner).max_by(f64::total_cmp)?;
        let normal = DVec3::new(cos * i.fx, sin * i.fy, cos * i.cx + sin * i.cy - support).normalize();
        Some((pose.rotation * normal, pose.translation))
    };
    (0..TANGENTS).filter_map(plane).collect()
}

/// The rows that show the vehicle, each with its first and last vehicle column.
fn rows(mask: &Mask) -> Vec<(u32, u32, u32)> {
    let shows = |v: u32| {
        let first = (0..mask.width()).find(|&u| mask.is_vehicle(u, v))?;
        let last = (0..mask.width()).rev().find(|&u| mask.is_vehicle(u, v))?;
        Some((v, first, last))
    };
    (0..mask.height()).filter_map(shows).collect()
}
