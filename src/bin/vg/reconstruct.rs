//! `vg reconstruct`: a scene in, a model out.

use crate::args::ReconstructArgs;
use crate::files::{Kind, Results};
use crate::guard::Inputs;
use crate::job::{Outcome, Result, note};
use crate::shown::Bar;
use crate::{cloud, files, interrupt, scene, shown};
use std::path::Path;
use vg::io::{ply, vehicle_frame};
use vg::onnx::Model;
use vg::pipeline::{self, BudgetPlan, Options, Reconstruction, Report};
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
    let index = io::list_scene(&args.scene, &scene::named(args.views.views.as_deref(), &options))?;
    let results = Results::new([
        (Kind::Ply, Some(&args.output)),
        (Kind::Ply, args.points.as_ref()),
        (Kind::Json, args.report.as_ref()),
    ]);
    let inputs = Inputs::default().files(&scene::files_of(&index)).files(args.method.files());
    let inputs = inputs.files(&args.mask_model).files(&args.frame.vehicle_from_world);
    results.prepare(&inputs.scene(&args.scene))?;

    let mut opened = scene::load(index)?;
    let masks_by = fill_masks(args, &mut opened.scene.views)?;
    opened.scene.cloud = args.method.cloud.as_deref().map(cloud::read).transpose()?;
    let settings = Options { points: args.points.is_some(), check: !args.no_check, ..args.method.options()? };
    let made = reconstruct(&opened.scene, &settings)?;
    note_warnings(&made.report);
    files::write(&args.output, |out| ply::write_to(out, &made.gaussians))?;
    if let (Some(path), Some(cloud)) = (&args.points, &made.points) {
        files::write(path, |out| ply::write_points_to(out, &cloud.positions, &cloud.colors))?;
    }
    if let Some(path) = &args.report {
        files::write_json(path, &made.report)?;
    }
    let text = format!("{}: {}{masks_by}", shown::path(&args.output), summary(&made));
    Ok(results.outcome(Outcome::done(text)))
}

/// What a user should hear of a reconstruction that went well.
pub(crate) fn note_warnings(report: &Report) {
    for warning in report.network.iter().flat_map(|network| &network.warnings) {
        note(warning);
    }
    for left in report.left_out.iter().filter(|left| left.what == pipeline::GAUSSIANS) {
        note(&format!("{}; --max-gaussians N allows more, --resolution SHARE chooses another", left.why));
    }
    if let Some(plan) = report.plan.as_ref().filter(|plan| !plan.fits) {
        let BudgetPlan { budget_s, predicted_s, .. } = plan;
        note(&format!("the budget of {budget_s} s cannot be kept: the least takes about {predicted_s:.2} s"));
    }
}

/// Masks of a network for the views that have none, and what to say of it. The network is opened only then.
fn fill_masks(args: &ReconstructArgs, views: &mut [View]) -> Result<String> {
    let Some(path) = &args.mask_model else { return Ok(String::new()) };
    if views.iter().all(|view| view.mask.is_some()) {
        note(&format!("{}: not opened, every view has a mask", path.display()));
        return Ok(String::new());
    }
    let segmenter = Segmenter::new(Model::open(path, &args.method.model_options())?)?;
    let filled = Threads::new(args.method.threads)?.run(|| segmenter.fill(views))?;
    for view in views.iter().filter(|v| v.mask.as_ref().is_some_and(|m| m.vehicle_pixels() == 0)) {
        note(&format!("{}: no vehicle pixel in its mask", view.name));
    }
    Ok(format!("; masks of {filled} views by {}", segmenter.name()))
}

/// With progress on a terminal.
pub(crate) fn reconstruct(scene: &Scene, options: &Options) -> Result<Reconstruction> {
    let bar = Bar::of_reconstruction();
    Ok(pipeline::reconstruct(scene, options, &mut |progress| bar.show(progress))?)
}

/// One line.
pub(crate) fn summary(made: &Reconstruction) -> String {
    let report = &made.report;
    let extent = report.extent_m.as_ref().map_or_else(String::new, |e| format!("{}, ", shown::extent(e)));
    let check = report.input_error.map_or_else(String::new, |e| {
        format!(
            "; on these views PSNR {:.2} dB, silhouette IoU {:.3}, at least {:.1} % of each mask covered",
            e.psnr_db,
            e.silhouette_iou,
            100.0 * e.mask_covered
        )
    });
    format!(
        "{} Gaussians, {extent}SH degree {}, prior {}, {} views, {:.2} s{check}",
        shown::count(report.gaussians),
        report.sh_degree,
        report.prior,
        report.views_used.len(),
        report.total_ms / 1e3,
    )
}
