//! `vg reconstruct`: a scene in, a model out.

use crate::args::{ReconstructArgs, Strict, StrictArgs};
use crate::files::{Kind, Results};
use crate::guard::Inputs;
use crate::job::{Failure, Outcome, Result, note};
use crate::shown::Bar;
use crate::{cloud, files, interrupt, scene, shown};
use std::path::Path;
use vg::io::{ply, splats, vehicle_frame};
use vg::onnx::Model;
use vg::pipeline::{self, CheckedView, InputError, Options, Reconstruction, Report, Verdict};
use vg::progress::Threads;
use vg::scene::Segmenter;
use vg::{Scene, View, io};

/// Opens, reconstructs, writes.
pub(crate) fn run(args: &ReconstructArgs) -> Result {
    if args.end_with_input {
        interrupt::end_with_input();
    }
    // Depth that will not be used is not read either.
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
    let inputs = Inputs::default().files(&scene::files_of(&index)).files(args.method.files());
    let inputs = inputs.files(&args.mask_model).files(&args.frame.vehicle_from_world);
    results.prepare(&inputs.scene(&args.scene))?;

    let threads = Threads::new(args.method.threads)?;
    let mut opened = scene::load(index, &threads)?;
    let masks_by = fill_masks(args, &mut opened.scene.views, &threads)?;
    opened.scene.cloud = args.method.cloud.as_deref().map(cloud::read).transpose()?;
    let settings = Options { points: args.points.is_some(), check: !args.no_check, ..args.method.options()? };
    let made = reconstruct(&opened.scene, &settings, &threads)?;
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

/// What a user should hear of a reconstruction that went well.
pub(crate) fn note_warnings(report: &Report) {
    for reason in &report.verdict_reasons {
        note(&reason.to_string());
    }
    let of_network = report.network.iter().flat_map(|network| &network.warnings);
    for warning in report.warnings.iter().chain(of_network) {
        note(warning);
    }
    for left in report.left_out.iter().filter(|left| left.what == pipeline::GAUSSIANS) {
        note(&format!("{}; --max-gaussians N allows more, --resolution SHARE chooses another", left.why));
    }
}

/// An error where the caller does not want what the verdict says. The reasons were noted.
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
    Err(Failure::job(format!("--strict: the result is {verdict}, and nothing was written")))
}

/// As users read it.
pub(crate) fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Unchecked => "unchecked",
        Verdict::Doubtful => "doubtful",
        Verdict::Bad => "bad",
    }
}

/// Masks of a network for the views that have none, and what to say of it. The network is opened only then.
fn fill_masks(args: &ReconstructArgs, views: &mut [View], threads: &Threads) -> Result<String> {
    let Some(path) = &args.mask_model else { return Ok(String::new()) };
    if views.iter().all(|view| view.mask.is_some()) {
        note(&format!("{}: not opened, every view has a mask", path.display()));
        return Ok(String::new());
    }
    let segmenter = Segmenter::new(Model::open(path, &args.method.model_options())?)?;
    let filled = threads.run(|| segmenter.fill(views))?;
    for view in views.iter().filter(|v| v.mask.as_ref().is_some_and(|m| m.vehicle_pixels() == 0)) {
        note(&format!("{}: no vehicle pixel in its mask", view.name));
    }
    Ok(format!("; masks of {filled} views by {}", segmenter.name()))
}

/// With progress on a terminal.
pub(crate) fn reconstruct(scene: &Scene, options: &Options, threads: &Threads) -> Result<Reconstruction> {
    let bar = Bar::of_reconstruction();
    Ok(pipeline::reconstruct_on(threads, scene, options, &mut |progress| bar.show(progress))?)
}

/// One line.
pub(crate) fn summary(made: &Reconstruction) -> String {
    let report = &made.report;
    let size = report.vehicle.map_or_else(String::new, |v| format!("{}, ", shown::size(&v)));
    format!(
        "{} Gaussians, {size}SH degree {}, prior {}, {} views, {:.2} s{}; verdict: {}",
        shown::count(report.gaussians),
        report.sh_degree,
        report.prior,
        report.views_used.len(),
        report.total_ms / 1e3,
        check(report),
        verdict(report.verdict),
    )
}

/// What the check says of all views.
fn check(report: &Report) -> String {
    let Some(InputError { psnr_db, silhouette_iou, mask_covered }) = report.input_error else {
        return String::new();
    };
    let given = report.input_error_by_given_cameras.filter(|given| Some(*given) != report.input_error);
    let given = given.map_or_else(String::new, |given| {
        format!(" ({:.2} dB, {:.3} by the cameras as given)", given.psnr_db, given.silhouette_iou)
    });
    format!(
        "; on these views PSNR {psnr_db:.2} dB, silhouette IoU {silhouette_iou:.3}{given}, at least {:.1} % of each mask \
         covered",
        100.0 * mask_covered
    )
}

/// What the check says of each view, a line each.
fn views(report: &Report) -> String {
    /// More are for the report.
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
        more => format!("\n  and {more} more, which --report tells"),
    };
    report.input_views.iter().take(MOST).map(line).collect::<String>() + &more
}
