//! `vg refine`: a model and photographs in, the model moved towards the photographs out.

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

/// What `--report` writes.
#[derive(Serialize)]
struct Document<'a> {
    version: &'static str,
    settings: &'a RefineOptions,
    refinement: &'a Refinement,
}

/// Opens, refines, writes.
pub(crate) fn run(args: &RefineArgs) -> Result {
    let options = scene::options(&args.frame, None, false)?;
    let index = io::list_scene(&args.scene, &scene::named(args.views.names().as_deref(), &options))?;
    let results = Results::new([(Kind::Model, Some(&args.output)), (Kind::Json, args.report.as_ref())]);
    let inputs = Inputs::default().files(&scene::files_of(&index)).files([&args.asset]);
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
        densify: args.densify.then(Densify::of_refinement),
        backend: args.backend,
        ..RefineOptions::default()
    };
    let bar = Bar::of_reconstruction();
    let mut show = |progress| bar.show(progress);
    let (refined, done) = refine::model_on(&threads, &gaussians, &opened.scene, &settings, &mut show)?;
    drop(bar);
    match done.stop {
        Stop::Unseen => job::note("no view sees anything of the model: it is as it was"),
        Stop::Diverged => job::note("the error grew; the best of the states before is returned"),
        Stop::Done | Stop::HeldOut => {}
    }
    files::write(&args.output, |out| splats::write_to(out, &args.output, &refined))?;
    if let Some(path) = &args.report {
        let version = env!("CARGO_PKG_VERSION");
        files::write_json(path, &Document { version, settings: &settings, refinement: &done })?;
    }
    let gaussians = shown::count(refined.len());
    let text = format!("{}: {gaussians} Gaussians, {}", shown::path(&args.output), summary(&done));
    Ok(results.outcome(Outcome::done(text)))
}

/// One line.
fn summary(done: &Refinement) -> String {
    let [before, after] = done.psnr_db;
    format!("{} steps, PSNR of these views {before:.2} -> {after:.2} dB", done.kept)
}
