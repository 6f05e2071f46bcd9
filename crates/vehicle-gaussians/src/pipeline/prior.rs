//! The stage `prior`: metric depth and normals of every view (paper sec. "Metric-Scale Geometry").

use super::guard::{self, Doubt};
use super::options::{Options, PriorChoice};
use super::parts::Parts;
use super::run::Run;
use super::{cost, measured, plan};
use crate::prior::volume::KnownBox;
use crate::prior::{
    DepthPrior, Estimate, Geometry, GivenDepth, HullPrior, NetworkPrior, PriorReport, ShapePrior, WorkingBox,
};
use glam::Vec3;
use vg_geometry::{Error, Result};
use vg_scene::{Cloud, View};

/// Where the depth of a run comes from.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// A prior of this library, not `Auto`.
    BuiltIn(PriorChoice),
    /// A prior of the caller's own.
    Own(&'a dyn DepthPrior),
}

impl<'a> Source<'a> {
    /// The source for views that all have depth or not.
    pub(super) fn new(parts: &Parts<'a>, requested: PriorChoice, all_have_depth: bool) -> Self {
        match parts.prior {
            Some(own) => Self::Own(own),
            None => Self::BuiltIn(plan::prior(requested, all_have_depth)),
        }
    }

    /// Why a size or points that the caller gave were not used.
    pub(super) fn why_unused(&self) -> String {
        match self {
            Self::BuiltIn(_) => "the depth is given, not estimated".into(),
            Self::Own(prior) => format!("the prior {} does not use them", prior.name()),
        }
    }

    /// Whether the depth is measured or predicted pixel by pixel. The other priors make one closed surface of the
    /// silhouettes.
    pub(super) fn is_per_pixel(&self) -> bool {
        match self {
            Self::BuiltIn(choice) => matches!(choice, PriorChoice::Given | PriorChoice::Onnx),
            Self::Own(_) => true,
        }
    }
}

/// The answer of the prior, with normals and without the depth that the guard doubts.
pub(super) struct Surface {
    /// Name of the prior.
    pub(super) prior: &'static str,
    pub(super) geometry: Geometry,
    pub(super) report: PriorReport,
    /// Why the guard removed a depth; empty where it did not run. `[view][pixel]`
    pub(super) doubts: Vec<Vec<Doubt>>,
}

/// Estimates depth, removes what lies on no surface, and computes normals.
pub(super) fn prior(run: &mut Run) -> Result<()> {
    let cloud = points_to_fit(run)?;
    let (plan, views) = (&*run.plan, run.views.modelled());
    let count = cloud.as_ref().map(|cloud| cloud.points().len());
    let built_in;
    let prior: &dyn DepthPrior = match plan.source {
        Source::Own(prior) => prior,
        Source::BuiltIn(choice) => {
            let is_own_frame = plan.place_off_plane().is_some();
            let known_box = plan.known_box.map(|known| KnownBox::in_working_frame(&known, is_own_frame));
            built_in = built_in_prior(choice, cloud, known_box, &plan.options)?;
            built_in.as_ref()
        }
    };
    let Estimate { mut geometry, report } = prior.estimate(views, run.context)?;
    if let Source::Own(own) = plan.source {
        check_answer(&geometry, views).map_err(|what| Error::Reconstruction {
            stage: "prior",
            reason: format!("the prior {} {what}", own.name()),
        })?;
    }
    let doubts = match plan.source.is_per_pixel() && !plan.options.keep.floaters {
        true => run.context.parallel(|| guard::doubtful(views, &mut geometry.depths)),
        false => Vec::new(),
    };
    geometry.find_normals(views, run.context);

    plan::note_size(&mut run.left_out, plan, &geometry);
    run.warnings.extend(geometry.working_box.as_ref().and_then(WorkingBox::warning));
    if let Some(count) = count {
        plan::note_cloud(&mut run.left_out, plan, count, report.points);
    }
    run.surface.set(Surface { prior: prior.name(), geometry, report, doubts });
    Ok(())
}

/// The points that the surface is fitted to: those of the scene's cloud, and the depth of some views where the others
/// have none.
fn points_to_fit(run: &mut Run) -> Result<Option<Cloud>> {
    let (plan, views) = (&*run.plan, &run.views.working);
    let in_working_frame = |cloud| run.views.given_from_working.measured_points(cloud).into_inner();
    let cloud = plan.scene.cloud.as_ref().map(in_working_frame);
    let with_depth = views.iter().filter(|v| v.depth.is_some()).count();
    match plan.source {
        Source::BuiltIn(choice)
            if run.requested.prior == PriorChoice::Auto && (1..views.len()).contains(&with_depth) =>
        {
            run.warnings.push(format!(
                "depth: {} of {} views have none: the depth of the others counts as measured points, to which the \
                 prior {} bends; prior given needs it for every view",
                views.len() - with_depth,
                views.len(),
                choice.name()
            ));
            measured::points(views, cloud)
        }
        _ => Ok(cloud),
    }
}

fn built_in_prior(
    choice: PriorChoice,
    cloud: Option<Cloud>,
    known_box: Option<KnownBox>,
    options: &Options,
) -> Result<Box<dyn DepthPrior>> {
    let voxel_m = cost::voxel_m(options.resolution);
    Ok(match choice {
        PriorChoice::Onnx => {
            let model = options.prior_model.clone().expect("options were validated");
            Box::new(NetworkPrior::new(model)?)
        }
        PriorChoice::Given => Box::new(GivenDepth),
        PriorChoice::Hull => Box::new(HullPrior { known_box, cloud, voxel_m }),
        PriorChoice::Shape | PriorChoice::Auto => {
            Box::new(ShapePrior { known_box, cloud, photo: options.photo, voxel_m })
        }
    })
}

/// Whether later stages can use the answer; if not, what is wrong with it, as the end of a sentence about the prior.
fn check_answer(geometry: &Geometry, views: &[View]) -> std::result::Result<(), String> {
    /// Norms of unit vectors differ from 1 by less.
    const UNIT: f32 = 1e-3;
    let Geometry { depths, normals, working_box, ends } = geometry;
    if depths.len() != views.len() {
        return Err(format!("returned {} depth maps for {} views", depths.len(), views.len()));
    }
    for (i, (view, depth)) in views.iter().zip(depths).enumerate() {
        let (found, expected) = ([depth.width(), depth.height()], [view.camera.width, view.camera.height]);
        if found != expected {
            let [[w, h], [width, height]] = [found, expected];
            return Err(format!(
                "returned a depth map of {w}x{h} for {}, which is {width}x{height}",
                view.argument(i)
            ));
        }
        if let Some(c) = depth.confidence().and_then(|all| all.iter().find(|c| !(0.0..=1.0).contains(*c))) {
            return Err(format!("returned a confidence of {c} for {}; allowed: 0 to 1", view.argument(i)));
        }
    }
    if !normals.is_empty() && normals.len() != views.len() {
        return Err(format!(
            "returned {} normal maps for {} views; allowed: none, or one each",
            normals.len(),
            views.len()
        ));
    }
    for (i, ((view, depth), normals)) in views.iter().zip(depths).zip(normals).enumerate() {
        if normals.len() != depth.depth().len() {
            let (found, expected) = (normals.len(), depth.depth().len());
            return Err(format!(
                "returned {found} normals for {}, which has {expected} pixels",
                view.argument(i)
            ));
        }
        let is_good = |(normal, z): &(&Vec3, &f32)| {
            normal.is_finite() && (**z <= 0.0 || (normal.length() - 1.0).abs() <= UNIT)
        };
        if let Some((normal, _)) = normals.iter().zip(depth.depth()).find(|pair| !is_good(pair)) {
            let allowed = "unit vectors where there is depth";
            return Err(format!("returned the normal {normal} for {}; allowed: {allowed}", view.argument(i)));
        }
    }
    let boxes =
        [("working box", working_box.map(|b| (b.low, b.high))), ("surface", ends.map(|e| (e.low, e.high)))];
    for (what, corners) in boxes {
        if let Some((low, high)) = corners
            && !(0..3).all(|k| low[k].is_finite() && high[k].is_finite() && low[k] <= high[k])
        {
            return Err(format!(
                "returned a {what} from {low:?} to {high:?}; allowed: finite, the lower corner first"
            ));
        }
    }
    Ok(())
}
