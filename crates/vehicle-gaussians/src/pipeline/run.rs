//! The run: the paper's method as a list of stages over one `Run`.

use super::calibrate::{self, CalibratedViews};
use super::check::{self, Checked};
use super::frame::{Given, InFrame, Working};
use super::options::Options;
use super::parts::Parts;
use super::plan::{self, Plan};
use super::prior::{self, Surface};
use super::report::{self, Clock, LeftOut, Report};
use super::stage::{Made, Stage, walk};
use super::symmetry::{self, Symmetry};
use super::{head, pixels, refine, undistort};
use crate::refine::Refinement;
use glam::Vec3;
use vg_geometry::progress::{Context, ProgressCallback, Threads};
use vg_geometry::{Result, Similarity};
use vg_scene::{Scene, View};
use vg_splat::Gaussians;

/// The work of a stage.
type Work = fn(&mut Run) -> Result<()>;

/// The method in its order. Each stage is in the file of its name.
const STAGES: [Stage<Work>; 9] = [
    // The views worth using, the depth source, and what a time budget leaves out.
    Stage::new("plan", plan::plan),
    // Pinhole images at the resolution to work at.
    Stage::new("undistort", undistort::undistort),
    // The plane of symmetry at y = 0, and the cameras, corrected until the silhouettes agree.
    Stage::new("calibrate", calibrate::calibrate),
    // Metric depth and normals per pixel (paper sec. "Metric-Scale Geometry").
    Stage::new("prior", prior::prior),
    // The pixels that become Gaussians.
    Stage::new("pixels", pixels::pixels),
    // One Gaussian per pixel (paper sec. "Gaussian Attribute Estimation").
    Stage::new("head", head::head),
    // The unseen side, as the mirror image of the seen one (paper sec. "Symmetry-Aware Gaussian Cloning").
    Stage::new("symmetry", symmetry::symmetry),
    // The Gaussians optimised against the photographs.
    Stage::optional("refine", refine::refine),
    // The model in the caller's frame, compared with the photographs.
    Stage::optional("check", check::check),
];

/// One reconstruction: the input, the record of the run, and the products of its stages.
pub(super) struct Run<'r, 'c> {
    /// The caller's scene.
    pub(super) scene: &'r Scene,
    /// The caller's options. Stages after `plan` read those of the plan.
    pub(super) requested: &'r Options,
    /// Stages of the caller's own.
    pub(super) parts: Parts<'r>,
    /// Worker threads and the progress callback.
    pub(super) context: &'r Context<'c>,

    /// Times of the stages.
    pub(super) clock: Clock,
    /// Work this scene did not need.
    pub(super) left_out: Vec<LeftOut>,
    /// Sentences for the caller.
    pub(super) warnings: Vec<String>,

    pub(super) plan: Made<Plan<'r>>,
    /// The used views as pinholes, with the caller's cameras.
    pub(super) pinholes: Made<InFrame<Given, Vec<View>>>,
    pub(super) views: Made<CalibratedViews>,
    pub(super) surface: Made<Surface>,
    /// One flag per pixel. `[view][pixel]`
    pub(super) kept: Made<Vec<Vec<bool>>>,
    /// The coloured points, where the caller wants them.
    pub(super) points: Made<Option<InFrame<Working, PointCloud>>>,
    /// Name of the head.
    pub(super) head: Made<&'static str>,
    /// By `head`; `symmetry` and `refine` replace them.
    pub(super) gaussians: Made<InFrame<Working, Gaussians>>,
    pub(super) symmetry: Made<Symmetry>,
    /// Report of the optimisation, where it was switched on.
    pub(super) refinement: Made<Option<Refinement>>,
    pub(super) checked: Made<Checked>,
}

impl<'r, 'c> Run<'r, 'c> {
    fn new(scene: &'r Scene, requested: &'r Options, parts: Parts<'r>, context: &'r Context<'c>) -> Self {
        Self {
            scene,
            requested,
            parts,
            context,
            clock: Clock::start(),
            left_out: Vec::new(),
            warnings: Vec::new(),
            plan: Made::by("plan"),
            pinholes: Made::by("undistort"),
            views: Made::by("calibrate"),
            surface: Made::by("prior"),
            kept: Made::by("pixels"),
            points: Made::by("pixels"),
            head: Made::by("head"),
            gaussians: Made::by("head"),
            symmetry: Made::by("symmetry"),
            refinement: Made::by("refine"),
            checked: Made::by("check"),
        }
    }
}

/// Reconstructs the vehicle of `scene`. `progress` is called on this thread at the beginning of each stage, inside the
/// long ones, and at the end; if it breaks, the call returns [`Error::Cancelled`](vg_geometry::Error::Cancelled).
///
/// # Errors
/// [`Error::Argument`](vg_geometry::Error::Argument) for bad options or a bad scene, else the error of the stage that
/// failed.
pub fn reconstruct<'a>(
    scene: &Scene,
    options: &Options,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<Reconstruction> {
    reconstruct_on(&Threads::new(options.threads)?, scene, options, progress)
}

/// Reconstructs the vehicle of `scene` on existing threads; `options.threads` is ignored.
///
/// # Errors
/// Those of [`reconstruct`].
pub fn reconstruct_on<'a>(
    threads: &'a Threads,
    scene: &Scene,
    options: &Options,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<Reconstruction> {
    reconstruct_with(&Parts::default(), threads, scene, options, progress)
}

/// Reconstructs the vehicle of `scene` (paper eq. 1) with a depth prior or a Gaussian head of the caller's own. The
/// report names them by their `name()`.
///
/// ```
/// use std::ops::ControlFlow;
/// use vg::pipeline::{Options, Parts, reconstruct_with};
/// use vg::prior::DepthPrior;
/// use vg::progress::Threads;
///
/// fn reconstruct_by(prior: &dyn DepthPrior, scene: &vg::Scene) -> vg::Result<vg::Gaussians> {
///     let parts = Parts { prior: Some(prior), ..Parts::default() };
///     let mut progress = |_| ControlFlow::Continue(());
///     let made = reconstruct_with(&parts, &Threads::new(0)?, scene, &Options::default(), &mut progress)?;
///     assert_eq!(made.report.prior, prior.name());
///     Ok(made.gaussians)
/// }
/// ```
///
/// # Errors
/// Those of [`reconstruct`]. An answer that later stages cannot use (maps of another number or size, values that are
/// not finite) is an [`Error::Reconstruction`](vg_geometry::Error::Reconstruction) that names the prior or the head.
pub fn reconstruct_with<'a>(
    parts: &Parts,
    threads: &'a Threads,
    scene: &Scene,
    options: &Options,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<Reconstruction> {
    threads.check_process()?;
    options.validate()?;
    parts.validate(options)?;
    scene.validate()?;
    let context = Context::new(threads, progress);
    let mut run = Run::new(scene, options, *parts, &context);
    walk(&mut run, &STAGES, &context, |run| &mut run.clock)?;
    let made = report::finished(run);
    context.report_end()?;
    Ok(made)
}

/// A finished reconstruction.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The vehicle.
    pub gaussians: Gaussians,
    /// The metric coloured point cloud (paper eq. 5), where the caller wants it: positions in metres and 8-bit
    /// colours.
    pub points: Option<PointCloud>,
    /// How the model was made, and how good it is.
    pub report: Report,
}

/// Points in the vehicle frame with their colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Metres. `[n][3]`
    pub positions: Vec<[f32; 3]>,
    /// sRGB. `[n][3]`
    pub colors: Vec<[u8; 3]>,
}

impl PointCloud {
    pub(super) fn transformed(mut self, to_from: &Similarity) -> Self {
        for p in &mut self.positions {
            *p = to_from.transform_point(Vec3::from_array(*p).as_dvec3()).as_vec3().to_array();
        }
        self
    }
}
