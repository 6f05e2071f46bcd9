//! `vg refine`: optimises a model against photographs.

use crate::args::RefineArgs;
use crate::files::{Kind, Results};
use crate::guard::Inputs;
use crate::job::{self, Failure, Outcome, Result};
use crate::shown::{self, Bar};
use crate::{files, info, scene};
use serde::Serialize;
use vg::io::{self, splats};
use vg::progress::Threads;
use vg::refine::{self, Densify, RefineOptions, Refinement, Stop};

/// JSON document of `--report`.
#[derive(Serialize)]
struct Document<'a> {
    version: &'static str,
    settings: &'a RefineOptions,
    refinement: &'a Refinement,
}

/// Opens model and scene, refines, and writes the results.
pub(crate) fn run(args: &RefineArgs) -> Result {
    let options = scene::options(&args.frame, None, false)?;
    let index = io::list_scene(&args.scene, &scene::named(args.views.names().as_deref(), &options))?;
    let results = Results::new([(Kind::Model, Some(&args.output)), (Kind::Json, args.report.as_ref())]);
    let inputs = Inputs::default().files(&scene::view_files(&index)).files([&args.asset]);
    results.prepare(&inputs.files(&args.frame.vehicle_from_world).scene(&args.scene))?;

    let (gaussians, _) = splats::read(files::input(&args.asset))?;
    info::linear_numbers(&gaussians).iter().for_each(|sign| job::note(sign));
    if gaussians.is_empty() {
        return Err(Failure::job(format!("{}: no Gaussians to refine", args.asset.display())));
    }
    let threads = Threads::new(args.threads)?;
    let opened = scene::load(index, &threads)?;
    let settings = RefineOptions {
        amount: args.amount,
        hold_out: args.hold_out,
        densify: args.densify.then(Densify::for_refinement),
        backend: args.backend,
        ..RefineOptions::default()
    };
    let bar = Bar::for_reconstruction();
    let mut show = |progress| bar.show(progress);
    let (refined, done) = refine::model_on(&threads, &gaussians, &opened.scene, &settings, &mut show)?;
    drop(bar);
    match done.stop {
        Stop::Unseen => job::note("no view sees the model, which is written unchanged"),
        Stop::Diverged => job::note("the error grew, so the best earlier state of the model is written"),
        Stop::Done | Stop::HeldOut => {}
    }
    files::write(&args.output, |out| splats::write_to(out, &args.output, &refined))?;
    if let Some(path) = &args.report {
        let version = env!("CARGO_PKG_VERSION");
        files::write_json(path, &Document { version, settings: &settings, refinement: &done })?;
    }
    let gaussians = shown::counted(refined.len(), "Gaussian");
    let text = format!("{}: {gaussians}, {}", shown::path(&args.output), summary(&done));
    Ok(results.outcome(Outcome::done(text)))
}

/// Summary of the refinement on one line.
fn summary(done: &Refinement) -> String {
    let [before, after] = done.psnr_db;
    let steps = shown::counted(done.kept as usize, "step");
    format!("{steps}, PSNR of these views {before:.2} -> {after:.2} dB")
}
