//! The stage `plan`: the views, the depth source and the settings for this scene, chosen before the work is done. Each
//! omission has a reason and a count.

use super::budget::{self, BudgetPlan};
use super::options::{Keep, Options, PriorChoice};
use super::prior::Source;
use super::report::LeftOut;
use super::run::Run;
use super::spread::spread;
use super::{cost, outline};
use crate::prior::volume::known_box::TELLING_M;
use crate::prior::{BoxSource, Geometry, PointFit, WorkingBox};
use glam::DVec3;
use vg_geometry::{Camera, Error, Result};
use vg_scene::{Place, Scene, VehicleBox, View};

/// Cameras nearer to each other than this, with the same rotation, show the same.
const SAME_CENTER_M: f64 = 1e-3;
/// About 0.06 degrees.
const SAME_ROTATION: f64 = 1e-3;

/// Views within this angle show the same colour: there is no view dependence to represent, degrees.
const NARROW_DEGREES: f64 = 10.0;

/// Views within this angle determine a linear change of colour with direction and nothing finer, degrees.
const WIDE_DEGREES: f64 = 40.0;

/// The settings and the input of the later stages.
pub(super) struct Plan<'a> {
    /// The caller's options; where there was a budget, those that it led to.
    pub(super) options: Options,
    /// How a budget was resolved.
    pub(super) budget: Option<BudgetPlan>,
    /// The caller's scene, with a mask for each used view that needs one.
    pub(super) scene: Scene,
    /// Indices of the used views.
    pub(super) used: Vec<usize>,
    /// Where depth comes from.
    pub(super) source: Source<'a>,
    /// The vehicle's box, where the caller knows it.
    pub(super) known_box: Option<VehicleBox>,
}

impl Plan<'_> {
    /// The place of a known box that stands off the plane y = 0: its middle plane is then the plane of symmetry.
    pub(super) fn place_off_plane(&self) -> Option<Place> {
        self.known_box.and_then(|known| known.place).filter(|place| !place.is_on_the_plane())
    }
}

/// Chooses the options that fit the budget, the views, and the depth source.
pub(super) fn plan(run: &mut Run) -> Result<()> {
    let Run { scene, requested, context, .. } = *run;
    let (options, budget) =
        budget::resolved(scene, requested, context, || run.clock.elapsed(), &mut run.left_out);
    context.follow(cost::course(&budget::load(scene), &options, context.threads()));
    let used = views(scene, &options.keep, &mut run.left_out)?;
    let used = chosen_views(scene, used, &options, &mut run.left_out);
    let all_have_depth = used.iter().all(|&i| scene.views[i].depth.is_some());
    let source = Source::new(&run.parts, options.prior, all_have_depth);
    let scene = outline::masked(scene, &used, &source, &mut run.left_out)?;
    let known_box = options.vehicle_box(&scene);
    run.plan.set(Plan { options, budget, scene, used, source, known_box });
    Ok(())
}

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

/// As many of the used views as the caller allows.
pub(super) fn chosen_views(
    scene: &Scene,
    used: Vec<usize>,
    options: &Options,
    left_out: &mut Vec<LeftOut>,
) -> Vec<usize> {
    let Some(most) = options.max_views.filter(|most| *most < used.len()) else { return used };
    let views: Vec<View> = used.iter().map(|&i| scene.views[i].clone()).collect();
    let why = format!("more than max_views, {most}: those that were kept spread best around the vehicle");
    note(left_out, "views", &why, used.len() - most);
    spread(&views, most).into_iter().map(|i| used[i]).collect()
}

fn same_camera(a: &View, b: &View) -> bool {
    let (pa, pb) = (a.camera.vehicle_from_camera, b.camera.vehicle_from_camera);
    let turned = (pa.rotation - pb.rotation).to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    (pa.translation - pb.translation).length() < SAME_CENTER_M
        && turned < SAME_ROTATION
        && Camera { vehicle_from_camera: pa, ..b.camera } == a.camera
}

/// The prior that `Auto` stands for, by whether all views have depth.
pub(super) fn prior(requested: PriorChoice, all_have_depth: bool) -> PriorChoice {
    match requested {
        PriorChoice::Auto if all_have_depth => PriorChoice::Given,
        PriorChoice::Auto => PriorChoice::Shape,
        chosen => chosen,
    }
}

/// An explanation why no pixel became a Gaussian, the most frequent reason first.
pub(super) fn nothing_kept(left_out: &[LeftOut]) -> String {
    let mut pixels: Vec<&LeftOut> = left_out.iter().filter(|l| l.what == "pixels").collect();
    pixels.sort_by_key(|l| std::cmp::Reverse(l.count));
    let reasons: Vec<String> = pixels.iter().map(|l| format!("{} {}", l.count, l.why)).collect();
    format!(
        "no pixel is left to make a Gaussian of: {}; check that masks and depth overlap",
        reasons.join(", ")
    )
}

/// The SH degree that the viewing directions support: 0 for a single direction. Bands of degree l vary over angles of
/// about pi / l, so a narrow fan of views determines low bands only.
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

/// Notes a size that the caller gave and the prior did not need.
pub(super) fn note_size(left_out: &mut Vec<LeftOut>, plan: &Plan, geometry: &Geometry) {
    let why = match geometry.working_box {
        Some(WorkingBox { source: BoxSource::Given, .. }) => return,
        Some(WorkingBox { contradicted_m, .. }) if contradicted_m > 0.0 => {
            format!("the silhouettes contradict it by {contradicted_m:.2} m")
        }
        Some(_) => format!("the silhouettes bound the vehicle as closely, to {TELLING_M} m"),
        None => plan.source.why_unused(),
    };
    note(left_out, "vehicle size", &why, usize::from(plan.known_box.is_some()));
}

/// Notes the points, of `count`, that the surface was not fitted to.
pub(super) fn note_cloud(left_out: &mut Vec<LeftOut>, plan: &Plan, count: usize, fit: Option<PointFit>) {
    match fit {
        Some(fit) => note(left_out, "points", "outside the silhouettes: not the vehicle's", fit.outside),
        None => note(left_out, "points", &plan.source.why_unused(), count),
    }
}

/// Adds an omission of `count` things to the report, unless it is 0.
pub(super) fn note(left_out: &mut Vec<LeftOut>, what: &str, why: &str, count: usize) {
    if count > 0 {
        left_out.push(LeftOut { what: what.into(), why: why.into(), count });
    }
}
