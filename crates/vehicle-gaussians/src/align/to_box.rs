//! Alignment by the vehicle's size and the ground alone: the hull of the masks is turned upright, its outline from
//! above gives the axes, and the box the scale.

use super::footprint::Footprint;
use super::heading::{Heading, heading_view, is_contrary, unknown};
use super::{candidates, check_sparse, ground, hull, nowhere, outlines};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;
use vg_geometry::progress::{UNWATCHED, Watch};
use vg_geometry::{Error, Result, Similarity};
use vg_scene::View;

/// Half the side of the cube around the vehicle, in mean radii of its masks: a car's half diagonal is less than
/// twice its mean radius.
const CUBE: f64 = 2.2;

/// Allowed sides of a box, metres.
const SIDES_M: std::ops::RangeInclusive<f64> = 0.2..=30.0;

/// Largest misfit of a box of this vehicle, as a share of its longest side.
const WORST_SHARE: f64 = 0.15;

/// Progress after each step, by the time that it takes.
const DONE: Done = Done { outlines: 0.2, ground: 0.4, hull: 0.95 };

/// See [`DONE`].
struct Done {
    outlines: f64,
    ground: f64,
    hull: f64,
}

/// A similarity found with a box, and the quality of its fit.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxAlignment {
    /// Similarity from the views' world to the vehicle's frame, metres; its origin is the box's middle.
    pub vehicle_from_world: Similarity,
    /// Length, width and height of the masks' hull under this scale, metres.
    pub found_m: [f64; 3],
    /// Root mean square difference of `found_m` from the box's sides, metres.
    pub residual_m: f64,
    /// 1 - residual / the residual with length and width exchanged, 0 to 1.
    pub confidence: f64,
    /// The number of views whose masks were used.
    pub views: usize,
    /// Name of the view that distinguished front from back.
    pub heading_view: String,
}

/// Aligns the world of masked views to the frame of a box of length, width and height `size` that stands on the ground,
/// metres.
///
/// `views` carry `world_from_camera` as their camera's pose. `sparse` are points of that world, some of them on the
/// ground. A box has the same shape from ahead and from behind, so `heading` must distinguish them. The result does not
/// depend on the number of threads.
///
/// # Errors
/// A size that no vehicle has, too few masks, no ground among the points, [`Heading::Auto`], and a hull of other
/// proportions.
pub fn to_box(views: &[View], sparse: &[DVec3], size: [f64; 3], heading: Heading) -> Result<BoxAlignment> {
    to_box_watched(views, sparse, size, heading, &UNWATCHED)
}

/// [`to_box`] under `watch`.
///
/// # Errors
/// The errors of [`to_box`], and [`Error::Cancelled`].
pub fn to_box_watched(
    views: &[View],
    sparse: &[DVec3],
    size: [f64; 3],
    heading: Heading,
    watch: &Watch,
) -> Result<BoxAlignment> {
    if !size.iter().all(|side| SIDES_M.contains(side)) {
        let allowed = format!("length, width and height of {} to {} m", SIDES_M.start(), SIDES_M.end());
        return Err(Error::argument("size", format!("{size:?}"), allowed));
    }
    check_sparse(sparse)?;
    let outlines = outlines(views)?;
    watch.report(DONE.outlines)?;
    let Some((on_ground, up)) = ground::plane(sparse, &outlines) else {
        let found = format!("{} points that show no ground", sparse.len());
        return Err(Error::argument("sparse", found, "points of a level ground around the vehicle"));
    };
    let upright = candidates::upright(up, 0.0);
    let middle = candidates::middle(&outlines)?;
    let radii =
        outlines.iter().filter_map(|o| Some(o.angular_radius()? * o.pose().translation.distance(middle)));
    let radii: Vec<f64> = radii.collect();
    watch.report(DONE.ground)?;
    let half = CUBE * super::scan::median(&radii);
    let (points, between) = hull::surface(&outlines, upright, middle, half, watch);
    watch.report(DONE.hull)?;
    let ground = up.dot(on_ground);
    let points: Vec<DVec3> = points.into_iter().filter(|p| p.z > ground).collect();
    if points.is_empty() {
        return Err(nowhere("no point above the ground lies inside all masks", "the sparse points"));
    }
    let top = points.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max) + 0.5 * between;
    let footprint = Footprint::new(points.iter().map(|p| p.truncate()).collect());

    let size = DVec3::from_array(size);
    let turn = footprint.smallest_turn();
    let [mut fit, mut other] = [turn, turn + FRAC_PI_2].map(|turn| {
        let axis = footprint.axis(turn);
        let (middle, sides) = footprint.rectangle(axis);
        Fit::new(axis, middle, (sides + DVec2::splat(between)).extend(top - ground), size)
    });
    if other.residual < fit.residual {
        std::mem::swap(&mut fit, &mut other);
    }
    if fit.residual > WORST_SHARE * size.max_element() {
        let [l, w, h] = fit.found.to_array();
        let reason = format!(
            "a box of {:.2} x {:.2} x {:.2} m does not fit the masks' hull of at best {l:.2} x {w:.2} x {h:.2} m",
            size.x, size.y, size.z
        );
        return Err(nowhere(&reason, "that the size is of this vehicle and in metres"));
    }
    let rotation = DMat3::from_rotation_z(-fit.axis) * upright;
    let center = fit.middle.extend(ground);
    let translation = DVec3::new(0.0, 0.0, -0.5 * size.z) - fit.scale * center;
    let mut found = Similarity { scale: fit.scale, rotation, translation };
    if heading == Heading::Auto {
        return Err(unknown(views, &found, DVec3::ZERO, "a box is the same from ahead and from behind"));
    }
    if is_contrary(heading, views, &found, DVec3::ZERO)? {
        found = candidates::turned(&found, DVec3::ZERO);
    }
    let heading_view = heading_view(views, &found, DVec3::ZERO).map_or("", |v| v.0).to_owned();
    Ok(BoxAlignment {
        vehicle_from_world: found,
        found_m: fit.found.to_array(),
        residual_m: fit.residual,
        confidence: (1.0 - fit.residual / other.residual.max(1e-9)).clamp(0.0, 1.0),
        views: outlines.len(),
        heading_view,
    })
}

/// The scale under which three sides fit those of a box best.
struct Fit {
    /// Direction of the first side, upright coordinates.
    axis: f64,
    /// Middle, in coordinates along the axis.
    middle: DVec2,
    scale: f64,
    /// The scaled sides.
    found: DVec3,
    /// Root mean square difference of the sides.
    residual: f64,
}

impl Fit {
    fn new(axis: f64, middle: DVec2, sides: DVec3, size: DVec3) -> Self {
        let scale = sides.dot(size) / sides.length_squared();
        let found = scale * sides;
        Self { axis, middle, scale, found, residual: (found - size).length() / 3.0f64.sqrt() }
    }
}
