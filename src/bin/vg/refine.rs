//! `vg refine`: a model and photographs in, the model moved towards the photographs out.

use crate::args::RefineArgs;
use crate::job::{self, Failure, Outcome, Result};
use crate::shown::{self, Bar};
use crate::{files, scene};
use serde::Serialize;
use vg::io::{self, ply};
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
    let index = io::list_scene(&args.scene, &scene::named(args.views.views.as_deref(), &options))?;
    let outputs: Vec<_> = [Some(&args.output), args.report.as_ref()].into_iter().flatten().cloned().collect();
    let mut inputs = scene::files_of(&index);
    inputs.push(args.asset.clone());
    files::refuse_clashes(&outputs, &inputs)?;
    outputs.iter().try_for_each(|path| files::prepare(path))?;

    let (gaussians, _) = ply::read(&args.asset)?;
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
    ply::write(&args.output, &refined)?;
    if let Some(path) = &args.report {
        let version = env!("CARGO_PKG_VERSION");
        files::write_json(path, &Document { version, settings: &settings, refinement: &done })?;
    }
    let gaussians = shown::count(refined.len());
    Ok(Outcome::done(format!("{}: {gaussians} Gaussians, {}", args.output.display(), summary(&done))))
}

/// One line.
fn summary(done: &Refinement) -> String {
    let [before, after] = done.psnr_db;
    format!("{} steps, PSNR of these views {before:.2} -> {after:.2} dB", done.kept)
}
