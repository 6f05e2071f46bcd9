//! Report of a reconstruction.

use super::guard::{free, guarded, guarded_value};
use super::read::{self, Versioned};
use super::status::{c_string, one_line, vg_error, vg_status};
use std::ffi::{CString, c_char};
use vg::geometry::Choice;
use vg::pipeline::{PointCloud, PriorChoice, Report, Verdict};

/// What a reconstruction did, how long it took, what it left out, and the error it can know. Owned by the caller,
/// who frees it with `vg_report_free`; it never changes.
pub struct vg_report {
    _private: [u8; 0],
}

/// Type that a `vg_report` points to.
pub(super) struct ReportObject {
    report: Report,
    json: CString,
    /// Reasons of the verdict, one line each.
    reasons: Vec<CString>,
    points: PointCloud,
}

impl ReportObject {
    pub(super) fn new(mut report: Report, points: Option<PointCloud>) -> Self {
        let json = serde_json::to_string_pretty(&report)
            .unwrap_or_else(|e| format!("{{\"error\": {:?}}}", e.to_string()));
        let reasons = report.verdict_reasons.iter().map(|r| c_string(one_line(&r.to_string()))).collect();
        // The text contains the models' paths; a report must not keep a network's memory alive.
        report.settings.release_models();
        Self { report, json: c_string(json), reasons, points: points.unwrap_or_default() }
    }

    pub(super) fn into_raw(self) -> *mut vg_report {
        Box::into_raw(Box::new(self)).cast()
    }
}

unsafe fn object<'a>(report: *const vg_report) -> Option<&'a ReportObject> {
    unsafe { report.cast::<ReportObject>().as_ref() }
}

/// What became of the correction of the cameras.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_calibration {
    /// None was looked for: it was switched off, or these views cannot be calibrated.
    None = 0,
    /// The silhouettes agree already.
    NotNeeded = 1,
    /// The cameras were moved.
    Accepted = 2,
    /// A correction was estimated and thrown away.
    Refused = 3,
}

/// Whether a reconstruction is to be believed.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_verdict {
    /// Nothing looks wrong.
    Good = 0,
    /// Nothing looks wrong, but `vg_options.check` was 0: views were not compared with one another.
    Unchecked = 1,
    /// Something looks wrong; the model may still be of use.
    Doubtful = 2,
    /// The input contradicts itself, or describes no road vehicle.
    Bad = 3,
}

/// The main figures of a report.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_report_figures {
    /// `sizeof(vg_report_figures)`.
    pub struct_size: usize,
    /// Gaussians in the result.
    pub gaussian_count: u64,
    /// How many of them are mirror images.
    pub mirrored_count: u64,
    /// Views used; the JSON tells which, and why others were not.
    pub views_used: u32,
    /// Worker threads.
    pub threads: u32,
    /// The `vg_prior` that was used.
    pub prior: i32,
    /// Degree of the result's spherical harmonics.
    pub sh_degree: i32,
    /// Wall time of the call, milliseconds.
    pub total_ms: f64,
    /// Highest resident memory of the process so far, bytes; 0 where the system does not tell.
    pub peak_rss_bytes: u64,
    /// 1 if the `input_` fields hold the error on the input views, 0 if the check was switched off.
    pub has_input_error: i32,
    /// 1 if the prior looked for the vehicle in a box whose size follows below.
    pub has_box: i32,
    /// Mean PSNR over the used views, drawn by the cameras that were used, on white, full frame, dB.
    pub input_psnr_db: f64,
    /// Mean intersection over union of the model's silhouette and the masks.
    pub input_silhouette_iou: f64,
    /// Length, width, height of the box that the prior looked for the vehicle in, metres: larger than the vehicle, whose own
    /// size is `vehicle_size`.
    pub box_size: [f64; 3],
    /// Lowest corner of the Gaussians' centres, metres.
    pub extent_low: [f64; 3],
    /// Highest corner of the Gaussians' centres, metres.
    pub extent_high: [f64; 3],
    /// Mirror images that were shown in the light of their own side.
    pub relit_count: u64,
    /// Points of the cloud that the prior's surface was moved to.
    pub cloud_used: u64,
    /// Places that the photographs agree on, to which the prior's surface was moved.
    pub photo_found: u64,
    /// A `vg_calibration`.
    pub calibration: i32,
    /// 1 if `uncovered_before` and `uncovered_after` hold what the prior's surface left open of the masks.
    pub has_uncovered: i32,
    /// Rotation about z that brings the plane of symmetry that was found onto y = 0, degrees; of a refused
    /// correction, what was refused.
    pub calibration_yaw_degrees: f64,
    /// Shift along y that does, metres.
    pub calibration_lateral_m: f64,
    /// Part of the vehicle's pixels that the prior's surface did not cover, 0 to 1.
    pub uncovered_before: f64,
    /// The same after the surface was raised to meet them.
    pub uncovered_after: f64,
    /// Steps that the optimisation planned, also for `refine_seconds`; 0 where none was asked for.
    pub refine_iterations: u32,
    /// Steps that the result has seen; 0 if nothing was better than the beginning.
    pub refine_kept: u32,
    /// Length, width, height of the vehicle, metres; outer mirrors are often missing from the width. 0, 0, 0 where
    /// `has_vehicle_size` is 0.
    pub vehicle_size: [f64; 3],
    /// Their expected errors, metres.
    pub vehicle_size_uncertainty: [f64; 3],
    /// 1 if `vehicle_size` holds the vehicle's size.
    pub has_vehicle_size: i32,
    /// 1 if `vg_options.budget_s` was kept, or there was none; 0 if the call took longer.
    pub budget_kept: i32,
    /// The least part of a view's mask that is drawn, 0 to 1, by the cameras that were used.
    pub input_mask_covered: f64,
    /// `input_psnr_db` as drawn by the caller's own cameras: it differs where the calibration moved them.
    pub input_given_psnr_db: f64,
    /// `input_silhouette_iou` as drawn by the caller's own cameras.
    pub input_given_silhouette_iou: f64,
    /// `input_mask_covered` as drawn by the caller's own cameras.
    pub input_given_mask_covered: f64,
    /// A `vg_verdict`; `vg_report_reason` tells why it is not good.
    pub verdict: i32,
    /// How many reasons there are.
    pub reason_count: u32,
}

unsafe impl Versioned for vg_report_figures {
    const NAME: &'static str = "vg_report_figures";
    const FIRST_SIZE: usize = 152;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            gaussian_count: 0,
            mirrored_count: 0,
            views_used: 0,
            threads: 0,
            prior: 0,
            sh_degree: 0,
            total_ms: 0.0,
            peak_rss_bytes: 0,
            has_input_error: 0,
            has_box: 0,
            input_psnr_db: 0.0,
            input_silhouette_iou: 0.0,
            box_size: [0.0; 3],
            extent_low: [0.0; 3],
            extent_high: [0.0; 3],
            relit_count: 0,
            cloud_used: 0,
            photo_found: 0,
            calibration: vg_calibration::None as i32,
            has_uncovered: 0,
            calibration_yaw_degrees: 0.0,
            calibration_lateral_m: 0.0,
            uncovered_before: 0.0,
            uncovered_after: 0.0,
            refine_iterations: 0,
            refine_kept: 0,
            vehicle_size: [0.0; 3],
            vehicle_size_uncertainty: [0.0; 3],
            has_vehicle_size: 0,
            budget_kept: 0,
            input_mask_covered: 0.0,
            input_given_psnr_db: 0.0,
            input_given_silhouette_iou: 0.0,
            input_given_mask_covered: 0.0,
            verdict: Verdict::default().number(),
            reason_count: 0,
        }
    }
}

impl vg_report_figures {
    pub(super) fn of(report: &Report) -> Self {
        // A baseline has none.
        let prior = PriorChoice::from_name("prior", report.prior).unwrap_or_default();
        let calibration = report.calibration.as_ref().map(|c| c.verdict.number());
        let given = report.input_error_by_given_cameras;
        let (low, high) = report.extent_m.unwrap_or_default();
        Self {
            gaussian_count: report.gaussians as u64,
            mirrored_count: report.symmetry.cloned as u64,
            views_used: report.views_used.len() as u32,
            threads: report.threads as u32,
            prior: prior.number(),
            sh_degree: i32::from(report.sh_degree),
            total_ms: report.total_ms,
            peak_rss_bytes: report.peak_rss_bytes.unwrap_or(0),
            has_input_error: i32::from(report.input_error.is_some()),
            has_box: i32::from(report.working_box.is_some()),
            input_psnr_db: report.input_error.map_or(0.0, |e| e.psnr_db),
            input_silhouette_iou: report.input_error.map_or(0.0, |e| e.silhouette_iou),
            box_size: report.working_box.map_or([0.0; 3], |b| b.size_m),
            extent_low: low.map(f64::from),
            extent_high: high.map(f64::from),
            relit_count: report.relight.map_or(0, |r| r.clones as u64),
            cloud_used: report.cloud.map_or(0, |c| c.used as u64),
            photo_found: report.photo.map_or(0, |p| p.found as u64),
            calibration: calibration.unwrap_or(vg_calibration::None as i32),
            has_uncovered: i32::from(report.masks.is_some()),
            calibration_yaw_degrees: report.calibration.as_ref().map_or(0.0, |c| c.yaw_degrees),
            calibration_lateral_m: report.calibration.as_ref().map_or(0.0, |c| c.lateral_m),
            uncovered_before: report.masks.map_or(0.0, |m| m.uncovered_before),
            uncovered_after: report.masks.map_or(0.0, |m| m.uncovered_after),
            refine_iterations: report.refinement.as_ref().map_or(0, |r| r.iterations),
            refine_kept: report.refinement.as_ref().map_or(0, |r| r.kept),
            vehicle_size: report.vehicle.map_or([0.0; 3], |v| v.size_m),
            vehicle_size_uncertainty: report.vehicle.map_or([0.0; 3], |v| v.uncertainty_m),
            has_vehicle_size: i32::from(report.vehicle.is_some()),
            budget_kept: i32::from(report.plan.as_ref().is_none_or(|plan| plan.kept)),
            input_mask_covered: report.input_error.map_or(0.0, |e| e.mask_covered),
            input_given_psnr_db: given.map_or(0.0, |e| e.psnr_db),
            input_given_silhouette_iou: given.map_or(0.0, |e| e.silhouette_iou),
            input_given_mask_covered: given.map_or(0.0, |e| e.mask_covered),
            verdict: report.verdict.number(),
            reason_count: report.verdict_reasons.len() as u32,
            ..Self::initial()
        }
    }
}

/// Sets `*figures` to zeros. `size`: `sizeof *figures`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_figures_init(figures: *mut vg_report_figures, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("figures", figures, size)) }
}

/// The main figures.
///
/// - report: not NULL.
/// - out: a struct that `vg_report_figures_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_get_figures(
    report: *const vg_report,
    out: *mut vg_report_figures,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let object = read::handle("report", report.cast::<ReportObject>(), "a report")?;
            read::fill("out", out, &vg_report_figures::of(&object.report))
        })
    }
}

/// The whole report as JSON. Lives as long as the report. NULL: an empty string. Never NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_json(report: *const vg_report) -> *const c_char {
    guarded_value(c"".as_ptr(), || unsafe { object(report) }.map_or(c"".as_ptr(), |r| r.json.as_ptr()))
}

/// Why the verdict is not good, the heaviest reason first: one line of UTF-8 that names the view where one is concerned,
/// what was found, what is expected, the likely cause and the way out. `index`: below `vg_report_figures.reason_count`;
/// beyond it an empty string. Lives as long as the report; the JSON has the parts, as `verdict_reasons`. NULL: an empty
/// string. Never NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_reason(report: *const vg_report, index: usize) -> *const c_char {
    guarded_value(c"".as_ptr(), || {
        unsafe { object(report) }
            .and_then(|r| r.reasons.get(index))
            .map_or(c"".as_ptr(), |line| line.as_ptr())
    })
}

/// How many points the metric coloured point cloud has; 0 unless `vg_options.points` was 1. NULL: 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_point_count(report: *const vg_report) -> usize {
    guarded_value(0, || unsafe { object(report) }.map_or(0, |r| r.points.positions.len()))
}

/// Positions of the points, float32 `[count][3]`, metres, vehicle frame. Lives as long as the report. NULL where
/// there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_point_positions(report: *const vg_report) -> *const f32 {
    guarded_value(std::ptr::null(), || {
        unsafe { object(report) }.map_or(std::ptr::null(), |r| read::address(&r.points.positions))
    })
}

/// Colours of the points, uint8 `[count][3]`, sRGB. Lives as long as the report. NULL where there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_point_colors(report: *const vg_report) -> *const u8 {
    guarded_value(std::ptr::null(), || {
        unsafe { object(report) }.map_or(std::ptr::null(), |r| read::address(&r.points.colors))
    })
}

/// Frees a report. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_report_free(report: *mut vg_report) {
    unsafe { free(report.cast::<ReportObject>()) }
}
