//! `vg reconstruct`: a scene in, a model out.

use crate::args::ReconstructArgs;
use crate::job::{Outcome, Result, note};
use crate::shown::Bar;
use crate::{cloud, files, scene, shown};
use vg::io::ply;
use vg::onnx::Model;
use vg::pipeline::{self, BudgetPlan, Options, Reconstruction, Report};
use vg::progress::Threads;
use vg::scene::Segmenter;
use vg::{Scene, View, io};

/// Opens, reconstructs, writes.
pub(crate) fn run(args: &ReconstructArgs) -> Result {
    let outputs: Vec<_> = [Some(&args.output), args.points.as_ref(), args.report.as_ref()]
        .into_iter()
        .flatten()
        .cloned()
        .collect();
    // Depth that will not be used is not read either.
    let options = scene::options(&args.frame, args.depth.depth_scale, args.method.wants_depth())?;
    let index = io::list_scene(&args.scene, &scene::named(args.views.views.as_deref(), &options))?;
    let read: Vec<_> = scene::files_of(&index)
        .into_iter()
        .chain(
            [&args.method.cloud, &args.method.prior_model, &args.method.head_model, &args.mask_model]
                .into_iter()
                .flatten()
                .cloned(),
        )
        .collect();
    files::refuse_clashes(&outputs, &read)?;
    outputs.iter().try_for_each(|path| files::prepare(path))?;

    let threads = Threads::new(args.method.threads)?;
    let mut opened = scene::load(index, &threads)?;
    let masks_by = fill_masks(args, &mut opened.scene.views, &threads)?;
    opened.scene.cloud = args.method.cloud.as_deref().map(cloud::read).transpose()?;
    let settings = Options { points: args.points.is_some(), check: !args.no_check, ..args.method.options()? };
    let made = reconstruct(&opened.scene, &settings, &threads)?;
    note_warnings(&made.report);
    ply::write(&args.output, &made.gaussians)?;
    if let (Some(path), Some(cloud)) = (&args.points, &made.points) {
        ply::write_points(path, &cloud.positions, &cloud.colors)?;
    }
    if let Some(path) = &args.report {
        files::write_json(path, &made.report)?;
    }
    Ok(Outcome::done(format!("{}: {}{masks_by}", args.output.display(), summary(&made))))
}

/// What a user should hear of a reconstruction that went well.
pub(crate) fn note_warnings(report: &Report) {
    for warning in report.network.iter().flat_map(|network| &network.warnings) {
        note(warning);
    }
    if let Some(plan) = report.plan.as_ref().filter(|plan| !plan.fits) {
        let BudgetPlan { budget_s, predicted_s, .. } = plan;
        note(&format!("the budget of {budget_s} s cannot be kept: the least takes about {predicted_s:.2} s"));
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
