//! The report: what a reconstruction did, how long it took, what it left out, and its error in the input views.

use super::budget::BudgetPlan;
use super::check::Checked;
use super::frame::InFrame;
use super::method::Method;
use super::prior::Surface;
use super::run::{Reconstruction, Run};
use super::size::VehicleSize;
use super::symmetry::Symmetry;
use super::verdict::{self, Evidence, Reason, Verdict};
use crate::calibrate::Calibration;
use crate::prior::{BoxSource, Filled, NetworkFit, PhotoFit, PointFit, WorkingBox};
use crate::refine::Refinement;
use crate::relight::Relighting;
use crate::symmetry::Completion;
use serde::Serialize;
use std::time::Instant;

/// One stage of the run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// plan, undistort, calibrate, prior, pixels, head, symmetry, refine, check; for a baseline plan, undistort, start,
    /// refine, check.
    pub name: &'static str,
    /// Wall time, milliseconds.
    pub ms: f64,
}

/// Work that the scene did not need.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// The kind: views, calibration, pixels, SH bands, clones and others.
    pub what: String,
    /// The reason.
    pub why: String,
    /// The number of things left out.
    pub count: usize,
}

/// The model rendered back into input views, against the masked photographs on white.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InputError {
    /// Full frame, dB; mean over the views.
    pub psnr_db: f64,
    /// Intersection over union of alpha >= 0.5 and the mask; mean over the views.
    pub silhouette_iou: f64,
    /// Share of the mask that is drawn with alpha >= 0.5, 0 to 1; smallest of the views.
    pub mask_covered: f64,
}

impl InputError {
    /// The error over several views; `None` without any.
    pub(super) fn over(errors: impl ExactSizeIterator<Item = Self>) -> Option<Self> {
        let n = errors.len();
        let start = Self { psnr_db: 0.0, silhouette_iou: 0.0, mask_covered: 1.0 };
        let over = errors.fold(start, |over, one| Self {
            psnr_db: over.psnr_db + one.psnr_db / n as f64,
            silhouette_iou: over.silhouette_iou + one.silhouette_iou / n as f64,
            mask_covered: over.mask_covered.min(one.mask_covered),
        });
        (n > 0).then_some(over)
    }
}

/// The model rendered back into one input view.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckedView {
    /// The view's name.
    pub name: String,
    /// Errors of the picture by the camera that was used, which the calibration may have moved.
    #[serde(flatten)]
    pub errors: InputError,
    /// Errors of the picture by the caller's own camera.
    pub by_given_camera: InputError,
}

/// The box that the prior searched for the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BoxReport {
    /// `given` or `estimated`.
    pub source: BoxSource,
    /// Length, width, height in metres.
    pub size_m: [f64; 3],
    /// Lowest corner, metres.
    pub low_m: [f64; 3],
    /// Contradiction between the caller's size and the silhouettes, metres; 0 where they agree.
    pub contradicted_m: f64,
}

impl From<WorkingBox> for BoxReport {
    fn from(b: WorkingBox) -> Self {
        Self { source: b.source, size_m: b.size(), low_m: b.low, contradicted_m: b.contradicted_m }
    }
}

/// The whole report, written by `serde_json`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of this library.
    pub version: &'static str,
    /// Name of the depth source; `none` for a baseline.
    pub prior: &'static str,
    /// Name of the Gaussian head, or of the baseline.
    pub head: &'static str,
    /// Wall time of each stage, in order.
    pub stages: Vec<Stage>,
    /// Wall time of the whole call, milliseconds.
    pub total_ms: f64,
    /// Peak resident memory of the process so far, bytes; `None` where the system does not report it.
    pub peak_rss_bytes: Option<u64>,
    /// Worker threads.
    pub threads: usize,
    /// Gaussians in the result.
    pub gaussians: usize,
    /// SH degree of the result.
    pub sh_degree: u8,
    /// Lowest and highest centre in the caller's vehicle frame, metres.
    pub extent_m: Option<([f32; 3], [f32; 3])>,
    /// Names of the views that were used.
    pub views_used: Vec<String>,
    /// The correction of the cameras; `None` if it was switched off or these views cannot be calibrated.
    pub calibration: Option<Calibration>,
    /// Length, width and height of the vehicle; `None` for a baseline.
    pub vehicle: Option<VehicleSize>,
    /// The box that the prior searched for the vehicle, which is larger than the vehicle, in the corrected frame: its
    /// sides are parallel to the plane of symmetry. For a baseline, the box that the first Gaussians were drawn from.
    pub working_box: Option<BoxReport>,
    /// How the prior's surface was fitted to the scene's cloud.
    pub cloud: Option<PointFit>,
    /// How the prior's surface was moved to where the photographs agree, where that was switched on.
    pub photo: Option<PhotoFit>,
    /// How the prior's surface was extended to fill the masks.
    pub masks: Option<Filled>,
    /// The depth network, and how far its answer agrees with the cameras.
    pub network: Option<NetworkFit>,
    /// How the options were chosen, where the caller set a budget.
    pub plan: Option<BudgetPlan>,
    /// Work this scene did not need.
    pub left_out: Vec<LeftOut>,
    /// Input that is legal but looks like a mistake, and requests that could not be met, one sentence each.
    pub warnings: Vec<String>,
    /// How the unseen side was completed.
    pub symmetry: Completion,
    /// The light of the unseen side, where it was estimated.
    pub relight: Option<Relighting>,
    /// Report of the optimisation, where it was switched on.
    pub refinement: Option<Refinement>,
    /// Error on the input views, drawn by the cameras that were used, unless the check was switched off.
    pub input_error: Option<InputError>,
    /// Error on the input views, drawn by the caller's own cameras; it differs where the calibration moved them.
    pub input_error_by_given_cameras: Option<InputError>,
    /// The errors of each used view, in the order of `views_used`; empty if the check was switched off.
    pub input_views: Vec<CheckedView>,
    /// Whether the model can be trusted.
    pub verdict: Verdict,
    /// Why the verdict is not good, the most severe reason first.
    pub verdict_reasons: Vec<Reason>,
    /// The numbers that the verdict rests on.
    pub evidence: Evidence,
    /// The method and its settings; where there was a budget, the settings that were chosen. Another call with them,
    /// and without a budget, does the same.
    pub settings: Method,
}

/// The result of a run whose stages are done.
pub(super) fn finished(mut run: Run) -> Reconstruction {
    let Checked { gaussians, points, size, evidence, input_views, reasons } = run.checked.take();
    let Surface { prior, geometry, report: found, .. } = run.surface.take();
    let Symmetry { completion, relighting, .. } = run.symmetry.take();
    let plan = run.plan.take();
    let views = run.views.take();
    let gaussians = gaussians.into_inner();
    let (stages, total_ms) = run.clock.finish();
    let budget = plan.budget.map(|budget| budget.after(&stages));
    let mut warnings = run.warnings;
    warnings.extend(budget.as_ref().and_then(BudgetPlan::warning));
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        prior,
        head: *run.head,
        stages,
        total_ms,
        peak_rss_bytes: peak_rss_bytes(),
        threads: run.context.threads(),
        gaussians: gaussians.len(),
        sh_degree: gaussians.sh_degree(),
        extent_m: gaussians.bounds(),
        views_used: views.in_given_frame().iter().map(|v| v.name.clone()).collect(),
        calibration: views.report,
        vehicle: size,
        working_box: geometry.working_box.map(Into::into),
        cloud: found.points,
        photo: found.photo,
        masks: found.masks,
        network: found.network,
        plan: budget,
        left_out: run.left_out,
        warnings,
        symmetry: completion,
        relight: relighting,
        refinement: run.refinement.take(),
        input_error: InputError::over(input_views.iter().map(|view| view.errors)),
        input_error_by_given_cameras: InputError::over(input_views.iter().map(|view| view.by_given_camera)),
        input_views,
        verdict: verdict::verdict(&reasons, plan.options.check),
        verdict_reasons: reasons,
        evidence,
        settings: Method::Vehicle(plan.options),
    };
    Reconstruction { gaussians, points: points.map(InFrame::into_inner), report }
}

/// Times the stages.
pub(super) struct Clock {
    start: Instant,
    last: Instant,
    stages: Vec<Stage>,
}

impl Clock {
    pub(super) fn start() -> Self {
        let now = Instant::now();
        Self { start: now, last: now, stages: Vec::new() }
    }

    /// Ends the stage that has run since the last call.
    pub(super) fn lap(&mut self, name: &'static str) {
        let now = Instant::now();
        self.stages.push(Stage { name, ms: (now - self.last).as_secs_f64() * 1e3 });
        self.last = now;
    }

    pub(super) fn elapsed(&self) -> std::time::Duration {
        self.start.elapsed()
    }

    pub(super) fn finish(self) -> (Vec<Stage>, f64) {
        let total = self.start.elapsed().as_secs_f64() * 1e3;
        (self.stages, total)
    }
}

/// Peak resident memory of this process, bytes, from Linux's status file.
pub(super) fn peak_rss_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
