//! `vg reconstruct`: makes a model from a scene.

use crate::args::{ReconstructArgs, Strict, StrictArgs};
use crate::files::{Kind, Results};
use crate::guard::Inputs;
use crate::job::{Failure, Outcome, Result, note};
use crate::shown::Bar;
use crate::{cloud, files, interrupt, scene, shown};
use std::path::Path;
use vg::io::{ply, splats, vehicle_frame};
use vg::onnx::Model;
use vg::pipeline::{self, CheckedView, InputError, Method, Reconstruction, Report, Verdict};
use vg::progress::Threads;
use vg::scene::Segmenter;
use vg::{Scene, View, io};

/// Opens the scene, reconstructs, and writes the results.
pub(crate) fn run(args: &ReconstructArgs) -> Result {
    if args.end_with_input {
        interrupt::end_with_input();
    }
    // Depth that will not be used is not read.
    let mut options = scene::options(&args.frame, args.depth.depth_scale, args.method.wants_depth())?;
    if let Some(frame) = &args.frame_matrix {
        options.vehicle_from_world =
            Some(vehicle_frame::parse_matrix(frame.as_bytes(), Path::new("--frame-matrix"))?);
    }
    let index = io::list_scene(&args.scene, &scene::named(args.views.names().as_deref(), &options))?;
    let results = Results::new([
        (Kind::Model, Some(&args.output)),
        (Kind::Ply, args.points.as_ref()),
        (Kind::Json, args.report.as_ref()),
    ]);
    let inputs = Inputs::default().files(&scene::view_files(&index)).files(args.method.files());
    let inputs = inputs.files(&args.mask_model).files(&args.frame.vehicle_from_world);
    results.prepare(&inputs.scene(&args.scene))?;

    let threads = Threads::new(args.method.threads)?;
    let mut opened = scene::load(index, &threads)?;
    let masks_by = fill_masks(args, &mut opened.scene.views, &threads)?;
    opened.scene.cloud = args.method.cloud.as_deref().map(cloud::read).transpose()?;
    let mut method = args.method.method()?;
    match &mut method {
        Method::Vehicle(options) => (options.points, options.check) = (args.points.is_some(), !args.no_check),
        Method::Baseline(run) => run.check = !args.no_check,
    }
    let made = reconstruct(&opened.scene, &method, &threads)?;
    note_warnings(&made.report);
    accept(&made.report, &args.strict)?;
    files::write(&args.output, |out| splats::write_to(out, &args.output, &made.gaussians))?;
    if let (Some(path), Some(cloud)) = (&args.points, &made.points) {
        files::write(path, |out| ply::write_points_to(out, &cloud.positions, &cloud.colors))?;
    }
    if let Some(path) = &args.report {
        files::write_json(path, &made.report)?;
    }
    let text = format!("{}: {}{masks_by}{}", shown::path(&args.output), summary(&made), views(&made.report));
    Ok(results.outcome(Outcome::done(text)))
}

/// Records the warnings of a successful reconstruction for the user.
pub(crate) fn note_warnings(report: &Report) {
    for reason in &report.verdict_reasons {
        note(&reason.to_string());
    }
    let network_warnings = report.network.iter().flat_map(|network| &network.warnings);
    for warning in report.warnings.iter().chain(network_warnings) {
        note(warning);
    }
    for left in report.left_out.iter().filter(|left| left.what == pipeline::GAUSSIANS) {
        note(&format!(
            "{}; --max-gaussians N allows more, --resolution SHARE sets another resolution",
            left.why
        ));
    }
}

/// Returns an error if the verdict is one that `--strict` rejects. Its reasons are noted before.
pub(crate) fn accept(report: &Report, strict: &StrictArgs) -> Result<()> {
    let least = match strict.strict {
        None => return Ok(()),
        Some(Strict::Doubtful) => Verdict::Unchecked,
        Some(Strict::Bad) => Verdict::Bad,
    };
    if report.verdict < least {
        return Ok(());
    }
    let verdict = verdict(report.verdict);
    Err(Failure::job(format!("--strict: the result is {verdict}; nothing was written")))
}

/// The verdict as text.
pub(crate) fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Unchecked => "unchecked",
        Verdict::Doubtful => "doubtful",
        Verdict::Bad => "bad",
    }
}

/// Fills missing masks by a network, which is opened only if there are any; returns a text for the summary.
fn fill_masks(args: &ReconstructArgs, views: &mut [View], threads: &Threads) -> Result<String> {
    let Some(path) = &args.mask_model else { return Ok(String::new()) };
    if views.iter().all(|view| view.mask.is_some()) {
        note(&format!("{}: not used, because every view has a mask", path.display()));
        return Ok(String::new());
    }
    let segmenter = Segmenter::new(Model::open(path, &args.method.model_options())?)?;
    let filled = threads.run(|| segmenter.fill(views))?;
    for view in views.iter().filter(|v| v.mask.as_ref().is_some_and(|m| m.vehicle_pixels() == 0)) {
        note(&format!("{}: the network found no vehicle in this view", view.name));
    }
    Ok(format!("; masks of {} by {}", shown::counted(filled, "view"), segmenter.name()))
}

/// Reconstructs with a progress bar on a terminal.
pub(crate) fn reconstruct(scene: &Scene, method: &Method, threads: &Threads) -> Result<Reconstruction> {
    let bar = Bar::for_reconstruction();
    Ok(method.reconstruct_on(threads, scene, &mut |progress| bar.show(progress))?)
}

/// Summary of the reconstruction on one line.
pub(crate) fn summary(made: &Reconstruction) -> String {
    let report = &made.report;
    let size = report.vehicle.map_or_else(String::new, |v| format!("{}, ", shown::size(&v)));
    format!(
        "{}, {size}SH degree {}, prior {}, {}, {:.2} s{}; verdict: {}",
        shown::counted(report.gaussians, "Gaussian"),
        report.sh_degree,
        report.prior,
        shown::counted(report.views_used.len(), "view"),
        report.total_ms / 1e3,
        check(report),
        verdict(report.verdict),
    )
}

/// Result of the check over all views.
fn check(report: &Report) -> String {
    let Some(InputError { psnr_db, silhouette_iou, mask_covered }) = report.input_error else {
        return String::new();
    };
    let given = report.input_error_by_given_cameras.filter(|given| Some(*given) != report.input_error);
    let given = given.map_or_else(String::new, |given| {
        format!(" ({:.2} dB, {:.3} by the cameras as given)", given.psnr_db, given.silhouette_iou)
    });
    format!(
        "; on these views PSNR {psnr_db:.2} dB, silhouette IoU {silhouette_iou:.3}{given}, at least {:.1} % of each \
         mask covered",
        100.0 * mask_covered
    )
}

/// Result of the check in each view, one line each.
fn views(report: &Report) -> String {
    /// Largest number of views that are printed.
    const MOST: usize = 16;
    let line = |view: &CheckedView| {
        let CheckedView { name, errors, by_given_camera: given } = view;
        let given = match given == errors {
            true => String::new(),
            false => {
                format!(" ({:.2} dB, {:.3} by the camera as given)", given.psnr_db, given.silhouette_iou)
            }
        };
        let InputError { psnr_db, silhouette_iou, mask_covered } = errors;
        format!(
            "\n  {name}: {psnr_db:.2} dB, IoU {silhouette_iou:.3}{given}, {:.1} % covered",
            100.0 * mask_covered
        )
    };
    let more = match report.input_views.len().saturating_sub(MOST) {
        0 => String::new(),
        more => format!("\n  and {more} more; --report R.json lists all"),
    };
    report.input_views.iter().take(MOST).map(line).collect::<String>() + &more
}
