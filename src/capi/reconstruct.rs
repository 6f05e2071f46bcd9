//! Reconstruction.

use super::context::{CallContext, in_context};
use super::gaussians::{self, vg_gaussians};
use super::guard::{clear, guarded};
use super::options::{Log, vg_log_level, vg_options};
use super::read;
use super::report::{ReportObject, vg_report};
use super::status::{vg_error, vg_status};
use super::view::{self, vg_view};
use super::watched::ProgressCallback;
use vg::Result;
use vg::pipeline::{self, Reconstruction, Report};
use vg::progress::Progress;
use vg::scene::Scene;

/// Makes a complete vehicle of photographs of one side.
///
/// - views, view_count: 1 to 4096 views; nothing they point to is changed, or looked at after the call.
/// - options: NULL for the default values.
/// - out_gaussians: receives the vehicle; the caller frees it. NULL on failure.
/// - out_report: NULL, or receives the report; the caller frees it. NULL on failure.
/// - out_error: NULL, or receives the error.
///
/// The same views and options give the same bytes with any number of threads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_reconstruct(
    views: *const vg_view,
    view_count: usize,
    options: *const vg_options,
    out_gaussians: *mut *mut vg_gaussians,
    out_report: *mut *mut vg_report,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        clear(out_gaussians);
        clear(out_report);
        guarded(out_error, || {
            read::not_null("out_gaussians", out_gaussians, "where to put the Gaussians")?;
            let options = read::optional("options", options)?;
            let settings = options.to_options()?;
            let mut scene = view::scene(views, view_count)?;
            scene.cloud = options.to_cloud()?;
            let made = in_context(options.context, |context| run(context, &scene, &settings, &options))?;
            // From the first handle that is written on, nothing can fail.
            let report = (!out_report.is_null()).then(|| ReportObject::new(made.report, made.points));
            out_gaussians.write(gaussians::into_raw(made.gaussians));
            if let Some(report) = report {
                out_report.write(report.into_raw());
            }
            Ok(())
        })
    }
}

unsafe fn run(
    context: &CallContext,
    scene: &Scene,
    settings: &pipeline::Options,
    options: &vg_options,
) -> Result<Reconstruction> {
    let callback = ProgressCallback { function: options.progress, user: options.progress_user };
    let mut progress = |at: Progress| {
        if !options.progress_overall.is_null() {
            unsafe { options.progress_overall.write_unaligned(at.overall) };
        }
        unsafe { callback.report(at) }
    };
    let settings = pipeline::Options { threads: context.threads.count(), ..settings.clone() };
    let made = pipeline::reconstruct_on(&context.threads, scene, &settings, &mut progress)?;
    unsafe { log(Log { callback: options.log, user: options.log_user }, &made.report) };
    Ok(made)
}

unsafe fn log(log: Log, report: &Report) {
    unsafe {
        for reason in &report.verdict_reasons {
            log.line(vg_log_level::Warning, || reason.to_string());
        }
        let network_warnings = report.network.iter().flat_map(|network| &network.warnings);
        for warning in report.warnings.iter().chain(network_warnings) {
            log.line(vg_log_level::Warning, || warning.clone());
        }
        for left in &report.left_out {
            log.line(vg_log_level::Info, || format!("left out {} {}: {}", left.count, left.what, left.why));
        }
        for stage in &report.stages {
            log.line(vg_log_level::Debug, || format!("{}: {:.1} ms", stage.name, stage.ms));
        }
        log.line(vg_log_level::Info, || {
            format!(
                "{} Gaussians from depth prior {} in {:.1} ms",
                report.gaussians, report.prior, report.total_ms
            )
        });
    }
}
