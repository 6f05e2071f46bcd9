//! `vg report`: one run on one self-contained page: inputs, result, errors, times, and what was left out.

mod chart;
mod compare;
mod facts;
mod page;
mod pictures;
mod text;

use crate::args::ReportArgs;
use crate::eval::split;
use crate::files::{Kind, Results};
use crate::guard::Inputs;
use crate::job::{self, Failure, Outcome, Result};
use crate::{cloud, files, reconstruct, scene, shown};
use compare::{Compared, Role};
use std::path::{Path, PathBuf};
use vg::io::{SceneOptions, list_scene};
use vg::progress::Threads;

/// Opens the scene, reconstructs, renders, and writes the page.
pub(crate) fn run(args: &ReportArgs) -> Result {
    let chosen = Chosen::from_args(args)?;
    let options = scene::options(&args.frame, args.depth.depth_scale, args.method.wants_depth())?;
    let inputs = list_scene(&args.scene, &scene::named(chosen.inputs.as_deref(), &options))?;
    // Depth of the test views is used only for the measurement.
    let with_depth = SceneOptions { load_depth: true, ..options };
    let tests = match chosen.tests.as_slice() {
        [] => None,
        names => Some(list_scene(&args.scene, &scene::named(Some(names), &with_depth))?),
    };
    let cloud_file = args.method.cloud.as_deref().map(|file| split::find(file, &args.scene));
    let method = &args.method;
    let results = Results::new([(Kind::Html, Some(&args.output))]);
    let listed: Vec<PathBuf> =
        [Some(&inputs), tests.as_ref()].into_iter().flatten().flat_map(scene::view_files).collect();
    let read = Inputs::default().files(&listed).files(method.files()).files(&cloud_file).files(&chosen.file);
    results.prepare(&read.files(&args.frame.vehicle_from_world).scene(&args.scene))?;

    let threads = Threads::new(method.threads)?;
    let mut opened = scene::load(inputs, &threads)?.scene;
    opened.cloud = cloud_file.as_deref().map(cloud::read).transpose()?;
    let made = reconstruct::reconstruct(&opened, &method.method()?, &threads)?;
    reconstruct::note_warnings(&made.report);
    reconstruct::accept(&made.report, &args.strict)?;

    let inputs = compare::views(&made.gaussians, &opened.views, Role::Input, &threads)?;
    let counts = facts::counts(&opened.views, &made.report);
    drop(opened);
    let tests = match tests {
        Some(tests) => {
            compare::views(&made.gaussians, &scene::load(tests, &threads)?.scene.views, Role::Test, &threads)?
        }
        None => Vec::new(),
    };
    let page = page::html(&page::Run {
        vehicle: scene::name(&args.scene),
        chosen: &chosen.how,
        inputs: &inputs,
        tests: &tests,
        turntable: pictures::turntable(&made.gaussians, &threads)?,
        report: &made.report,
        counts: &counts,
        warnings: &job::noted(),
        command: text::command(std::env::args_os().skip(1)),
    });
    files::write(&args.output, |out| out.write_all(page.as_bytes()))?;
    Ok(results.outcome(Outcome::done(summary(&args.output, page.len(), &inputs, &tests))))
}

/// Choice of input and test views.
struct Chosen {
    /// Input views; all if `None`.
    inputs: Option<Vec<String>>,
    tests: Vec<String>,
    /// Description of the choice.
    how: String,
    /// File of the split.
    file: Option<PathBuf>,
}

impl Chosen {
    fn from_args(args: &ReportArgs) -> Result<Self> {
        let alone = |inputs: Option<Vec<String>>, why: &str| {
            let how = format!("{why}, so the model is compared only with the photographs it was made from.");
            Ok(Self { inputs, tests: Vec::new(), how, file: None })
        };
        if let Some(names) = args.views.names() {
            return alone(Some(names), "The views were chosen by --views");
        }
        let named = args.split.as_deref().unwrap_or(Path::new("split.json"));
        let file = split::find(named, &args.scene);
        match (&args.split, &args.only) {
            (None, Some(only)) if !file.is_file() => {
                let message =
                    format!("--only {only}: no split.json here or in the scene's folder; give --split FILE");
                return Err(Failure::job(message));
            }
            (None, None) if !file.is_file() => return alone(None, "There is no split of the views"),
            _ => {}
        }
        let splits = split::read(&file, args.only.as_deref())?;
        let keys = splits.len();
        let (key, split) = splits.into_iter().next().ok_or_else(|| Failure::job("the split is empty"))?;
        let first = match keys {
            1 => String::new(),
            _ => format!(", the first of {keys} (--only chooses another)"),
        };
        let how = format!(
            "Split {key} of {}{first}: {}, and {} that the method did not use.",
            file.display(),
            shown::counted(split.input.len(), "input view"),
            shown::counted(split.test.len(), "test view")
        );
        Ok(Self { inputs: Some(split.input), tests: split.test, how, file: Some(file) })
    }
}

/// Summary of the run on one line.
fn summary(output: &Path, bytes: usize, inputs: &[Compared], tests: &[Compared]) -> String {
    let (judged, what) = if tests.is_empty() { (inputs, "input view") } else { (tests, "test view") };
    let errors = compare::mean(judged).map_or_else(String::new, |mean| {
        format!(
            "; in {} PSNR {} dB, silhouette IoU {:.3}",
            shown::counted(judged.len(), what),
            text::psnr(mean.psnr_db),
            mean.silhouette_iou
        )
    });
    format!("{}: {} kB{errors}", shown::path(output), shown::count(bytes.div_ceil(1000)))
}
