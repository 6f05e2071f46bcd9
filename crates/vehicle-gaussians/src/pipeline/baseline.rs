//! The baseline: 3D Gaussian splatting of the input views alone. Cameras are taken as they are.

use super::check::checked;
use super::frame::{Given, InFrame};
use super::method::Method;
use super::options::{Keep, Options};
use super::report::{CheckedView, Clock, InputError, LeftOut, Report, peak_rss_bytes};
use super::run::Reconstruction;
use super::stage::{Made, Stage, walk};
use super::undistort::undistorted;
use super::verdict::{self, Evidence, Examined, Judged, Reason};
use super::{budget, cost, plan};
use crate::prior::WorkingBox;
use crate::prior::volume::KnownBox;
use crate::refine::Refinement;
use crate::refine::baseline::{self, BaselineOptions, Start};
use crate::symmetry::{self, SymmetryMode};
use vg_geometry::Result;
use vg_geometry::progress::{Context, ProgressCallback, Threads};
use vg_scene::{Place, Scene, View};
use vg_splat::Gaussians;

/// Settings of a run of the baseline.
#[derive(Clone, Debug, PartialEq)]
pub struct BaselineRun {
    /// Settings of 3D Gaussian splatting.
    pub baseline: BaselineOptions,
    /// Length, width, height in metres, where known: bounds the box that the first Gaussians are drawn from. Overrides
    /// [`Scene::vehicle_box`].
    pub vehicle_size: Option<[f64; 3]>,
    /// The place of a box of `vehicle_size`, to a few decimetres.
    pub vehicle_place: Option<Place>,
    /// Whether views whose camera another view already has are kept.
    pub duplicate_views: bool,
    /// Whether to draw the model into its input views and report the error there.
    pub check: bool,
    /// Views are resampled to this share of their width and height first, above 0 to 1.
    pub resolution: f64,
    /// The most views to use; those that spread best around the vehicle are kept.
    pub max_views: Option<usize>,
    /// Worker threads; 0 means one per core.
    pub threads: usize,
}

impl Default for BaselineRun {
    fn default() -> Self {
        let Options { vehicle_size, vehicle_place, keep, check, resolution, max_views, threads, .. } =
            Options::default();
        Self {
            baseline: BaselineOptions::default(),
            vehicle_size,
            vehicle_place,
            duplicate_views: keep.duplicate_views,
            check,
            resolution,
            max_views,
            threads,
        }
    }
}

impl BaselineRun {
    /// Checks that each field is in its range.
    ///
    /// # Errors
    /// [`Error::Argument`](vg_geometry::Error::Argument) with the field's name.
    pub fn validate(&self) -> Result<()> {
        self.as_options().validate()?;
        self.baseline.validate()
    }

    /// The settings that both methods have, and the defaults of the others, as reports hold them.
    pub(super) fn as_options(&self) -> Options {
        Options {
            vehicle_size: self.vehicle_size,
            vehicle_place: self.vehicle_place,
            keep: Keep { duplicate_views: self.duplicate_views, ..Keep::default() },
            check: self.check,
            resolution: self.resolution,
            max_views: self.max_views,
            threads: self.threads,
            ..Options::default()
        }
    }
}

/// The work of a stage.
type Work = fn(&mut Run) -> Result<()>;

/// The baseline in its order.
const STAGES: [Stage<Work>; 5] = [
    Stage::new("plan", plan),
    Stage::new("undistort", undistort),
    Stage::new("start", start),
    // Reports its own progress, and the loss with it.
    Stage::optional("refine", refine),
    Stage::optional("check", check),
];

/// Runs the baseline on existing threads.
pub(super) fn reconstruct_on<'a>(
    threads: &'a Threads,
    scene: &Scene,
    settings: &BaselineRun,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<Reconstruction> {
    threads.check_process()?;
    settings.validate()?;
    scene.validate()?;
    let context = Context::new(threads, progress);
    let mut run = Run {
        context: &context,
        scene,
        settings,
        options: settings.as_options(),
        clock: Clock::start(),
        left_out: Vec::new(),
        used: Made::by("plan"),
        views: Made::by("undistort"),
        filled: Made::by("start"),
        gaussians: Made::by("start"),
        refinement: Made::by("refine"),
        checked: Made::by("check"),
    };
    walk(&mut run, &STAGES, &context, |run| &mut run.clock)?;
    let made = report(run);
    context.report_end()?;
    Ok(made)
}

/// One run of the baseline.
struct Run<'r, 'c> {
    context: &'r Context<'c>,
    scene: &'r Scene,
    settings: &'r BaselineRun,
    /// The settings that both methods have.
    options: Options,
    clock: Clock,
    left_out: Vec<LeftOut>,
    /// Indices of the used views.
    used: Made<Vec<usize>>,
    /// The used views as pinholes.
    views: Made<InFrame<Given, Vec<View>>>,
    /// The box that the first Gaussians were drawn from; `None` where they are points of a cloud.
    filled: Made<Option<WorkingBox>>,
    /// By `start`, then moved by `refine`.
    gaussians: Made<InFrame<Given, Gaussians>>,
    refinement: Made<Refinement>,
    checked: Made<Checked>,
}

struct Checked {
    evidence: Evidence,
    input_views: Vec<CheckedView>,
    reasons: Vec<Reason>,
}

/// Chooses the views.
fn plan(run: &mut Run) -> Result<()> {
    let load = budget::load(run.scene);
    let course = cost::course_of_baseline(&load, &run.options, &run.settings.baseline, run.context.threads());
    run.context.follow(course);
    let used = plan::views(run.scene, &run.options.keep, &mut run.left_out)?;
    run.used.set(plan::chosen_views(run.scene, used, &run.options, &mut run.left_out));
    Ok(())
}

/// Turns the views into pinholes at the resolution to work at.
fn undistort(run: &mut Run) -> Result<()> {
    let views = undistorted(run.scene, &run.used, run.options.resolution, &mut run.left_out, run.context)?;
    run.views.set(InFrame::new(views));
    Ok(())
}

/// Makes the first Gaussians.
fn start(run: &mut Run) -> Result<()> {
    let cloud = run.scene.cloud.as_ref();
    let known_box = run.options.vehicle_box(run.scene);
    let known_box = known_box.map(|known| KnownBox::in_working_frame(&known, false));
    let (views, how) = (&*run.views, &run.settings.baseline);
    let Start { gaussians, filled, strays } =
        run.context.parallel(|| Start::new(views, cloud, known_box.as_ref(), how))?;
    plan::note(&mut run.left_out, "points", "in no picture", strays);
    run.gaussians.set(InFrame::new(gaussians));
    run.filled.set(filled);
    Ok(())
}

/// Moves, divides and removes Gaussians until their pictures are the photographs.
fn refine(run: &mut Run) -> Result<()> {
    let (gaussians, done) = baseline::fit(&run.gaussians, &run.views, &run.settings.baseline, run.context)?;
    run.gaussians.set(InFrame::new(gaussians));
    run.refinement.set(done);
    Ok(())
}

/// Compares the model with the photographs, and the views with one another.
fn check(run: &mut Run) -> Result<()> {
    let (gaussians, views) = (&**run.gaussians, &**run.views);
    let originals: Vec<_> = run.used.iter().map(|&i| &run.scene.views[i]).collect();
    let examined = Examined { given: &originals, used: views, geometry: None };
    let (evidence, input_views) = match run.options.check {
        true => (verdict::compare(&examined, run.context), checked(gaussians, views, views, run.context)?),
        false => (verdict::glance(&examined), Vec::new()),
    };
    let evidence = evidence.with_model(gaussians, views);
    let reasons = verdict::judge(&Judged {
        evidence: &evidence,
        checked: &input_views,
        calibration: None,
        has_depth: true,
        is_completed: false,
    });
    run.checked.set(Checked { evidence, input_views, reasons });
    Ok(())
}

fn report(mut run: Run) -> Reconstruction {
    let views = run.views.take().into_inner();
    let Checked { evidence, input_views, reasons } = run.checked.take();
    let cameras: Vec<_> = views.iter().map(|v| v.camera).collect();
    let (gaussians, completion, _) =
        symmetry::complete(run.gaussians.take().into_inner(), SymmetryMode::Never, &cameras, |_| Vec::new());
    let (stages, total_ms) = run.clock.finish();
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        prior: "none",
        head: "3dgs",
        stages,
        total_ms,
        peak_rss_bytes: peak_rss_bytes(),
        threads: run.context.threads(),
        gaussians: gaussians.len(),
        sh_degree: gaussians.sh_degree(),
        extent_m: gaussians.bounds(),
        views_used: views.into_iter().map(|v| v.name).collect(),
        calibration: None,
        vehicle: None,
        working_box: run.filled.take().map(Into::into),
        cloud: None,
        photo: None,
        masks: None,
        network: None,
        plan: None,
        left_out: run.left_out,
        warnings: Vec::new(),
        symmetry: completion,
        relight: None,
        refinement: Some(run.refinement.take()),
        input_error: InputError::over(input_views.iter().map(|view| view.errors)),
        input_error_by_given_cameras: InputError::over(input_views.iter().map(|view| view.by_given_camera)),
        input_views,
        verdict: verdict::verdict(&reasons, run.options.check),
        verdict_reasons: reasons,
        evidence,
        settings: Method::Baseline(run.settings.clone()),
    };
    Reconstruction { gaussians, points: None, report }
}
