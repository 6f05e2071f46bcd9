//! What a reconstruction did, how long it took, what it left out, and the error it can know.

use super::budget::BudgetPlan;
use super::options::Options;
use super::size::VehicleSize;
use super::verdict::{Evidence, Reason, Verdict};
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
    /// plan, undistort, calibrate, prior, pixels, head, symmetry, refine, check; of a baseline plan, undistort, start,
    /// refine, check.
    pub name: &'static str,
    /// Wall time, milliseconds.
    pub ms: f64,
}

/// Something the scene did not need.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// What: views, calibration, pixels, SH bands, clones.
    pub what: String,
    /// Why it is not needed.
    pub why: String,
    /// How many.
    pub count: usize,
}

/// The model rendered back into input views, against the masked photographs on white.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InputError {
    /// Full frame, dB; mean over the views.
    pub psnr_db: f64,
    /// Alpha >= 0.5 against the mask; mean over the views.
    pub silhouette_iou: f64,
    /// The part of the mask that is drawn with alpha >= 0.5, 0 to 1; the least of the views.
    pub mask_covered: f64,
}

impl InputError {
    /// Over several views; `None` without any.
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
    /// Drawn by the camera that was used: the calibration's, where it moved the camera.
    #[serde(flatten)]
    pub errors: InputError,
    /// Drawn by the caller's own camera.
    pub by_given_camera: InputError,
}

/// The box the prior looked for the vehicle in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BoxReport {
    /// `given` or `estimated`.
    pub source: BoxSource,
    /// Length, width, height in metres.
    pub size_m: [f64; 3],
    /// Lowest corner, metres.
    pub low_m: [f64; 3],
    /// By how much the size that the caller gave and the silhouettes contradict each other, metres; 0 where they agree.
    pub contradicted_m: f64,
}

impl From<WorkingBox> for BoxReport {
    fn from(b: WorkingBox) -> Self {
        Self { source: b.source, size_m: b.size(), low_m: b.low, contradicted_m: b.contradicted_m }
    }
}

/// The whole report; `serde_json` writes it.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of this library.
    pub version: &'static str,
    /// Depth source that was used; none for a baseline.
    pub prior: &'static str,
    /// Gaussian head that was used; of a baseline its name.
    pub head: &'static str,
    /// Wall time of each stage, in order.
    pub stages: Vec<Stage>,
    /// Wall time of the whole call, milliseconds.
    pub total_ms: f64,
    /// Highest resident memory of the process so far, bytes; `None` where the system does not tell.
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
    /// How the cameras were corrected; `None` if that was switched off or these views cannot be calibrated.
    pub calibration: Option<Calibration>,
    /// How long, wide and high the vehicle is; `None` for a baseline.
    pub vehicle: Option<VehicleSize>,
    /// The box the prior looked for the vehicle in, which is larger, in the corrected frame: its sides are parallel to the
    /// plane of symmetry. The box a baseline's first Gaussians were drawn from.
    pub working_box: Option<BoxReport>,
    /// What the prior made of the scene's cloud.
    pub cloud: Option<PointFit>,
    /// What the photographs said of the prior's surface, where they were asked.
    pub photo: Option<PhotoFit>,
    /// How the prior closed what its surface left open of the masks.
    pub masks: Option<Filled>,
    /// What the network said whose depth was taken, and how far it agrees with the cameras.
    pub network: Option<NetworkFit>,
    /// How the options were chosen, where the caller gave a budget.
    pub plan: Option<BudgetPlan>,
    /// Work this scene did not need.
    pub left_out: Vec<LeftOut>,
    /// What is legal but looks like a mistake, or did not turn out as it was asked for, one sentence each.
    pub warnings: Vec<String>,
    /// How the unseen side was completed.
    pub symmetry: Completion,
    /// The light of the unseen side, where it was estimated.
    pub relight: Option<Relighting>,
    /// What the optimisation did, where it was asked for.
    pub refinement: Option<Refinement>,
    /// Error on the input views, drawn by the cameras that were used, unless the check was switched off.
    pub input_error: Option<InputError>,
    /// The same, drawn by the caller's own cameras; it differs where the calibration moved them.
    pub input_error_by_given_cameras: Option<InputError>,
    /// The errors of each used view, in the order of `views_used`; empty if the check was switched off.
    pub input_views: Vec<CheckedView>,
    /// Whether the model is to be believed.
    pub verdict: Verdict,
    /// Why the verdict is not good, the heaviest reason first.
    pub verdict_reasons: Vec<Reason>,
    /// The numbers that the verdict rests on.
    pub evidence: Evidence,
    /// The options of the call; where it had a budget, those that were chosen: with them and without a budget another
    /// call does the same.
    pub settings: Options,
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

/// Highest resident memory of this process, bytes, from Linux's own account of it.
pub(super) fn peak_rss_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
