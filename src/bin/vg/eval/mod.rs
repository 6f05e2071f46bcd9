//! `vg eval`: error and time of reconstructions from the inputs of splits, measured in their test views.

pub(crate) mod measure;
pub(crate) mod split;
mod sweep;
mod table;

use crate::args::EvalArgs;
use crate::job::{self, Outcome, Result};
use crate::{cloud, files, scene};
use measure::{Measured, Shown};
use serde::Serialize;
use std::path::Path;
use table::Table;
use vg::pipeline::Options;

/// A split that was measured.
#[derive(Serialize)]
struct Row {
    scene: String,
    split: String,
    #[serde(flatten)]
    measured: Measured,
}

/// A scene or a split that could not be.
#[derive(Serialize)]
struct Broken {
    scene: String,
    error: String,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Document<'a> {
    version: &'static str,
    settings: &'a Options,
    repeat: u32,
    splits: &'a [Row],
    mean: Option<Measured>,
    errors: &'a [Broken],
}

/// Every scene that can be evaluated is; the others are errors, and the exit code says that there were some.
pub(crate) fn run(args: &EvalArgs) -> Result {
    args.json.iter().try_for_each(|path| files::prepare(path))?;
    let settings = args.method.options()?;
    let (mut rows, mut errors) = (Vec::new(), Vec::new());
    for path in &args.scenes {
        let shown = path.display().to_string();
        let name = name_of(path);
        match one(path, args, &settings, |split, measured| {
            rows.push(Row { scene: name.clone(), split: split.to_owned(), measured });
        }) {
            Ok(()) => job::warn(),
            // One scene alone is the job itself.
            Err(failure) if args.scenes.len() == 1 => return Err(failure),
            Err(failure) => {
                job::complain(&format!("{shown}: {}", failure.message));
                errors.push(Broken { scene: shown, error: failure.message });
            }
        }
    }
    let mean = measure::mean(&rows.iter().map(|row| &row.measured).collect::<Vec<_>>());
    let mut table = Table::new();
    for row in &rows {
        table.push(&row.scene, &row.split, &row.measured);
    }
    if let Some(mean) = mean.as_ref().filter(|_| rows.len() > 1) {
        table.push("mean", "", mean);
    }
    if let Some(path) = &args.json {
        let version = env!("CARGO_PKG_VERSION");
        let document = Document {
            version,
            settings: &settings,
            repeat: args.repeat,
            splits: &rows,
            mean,
            errors: &errors,
        };
        files::write_json(path, &document)?;
    }
    let text = if rows.is_empty() { String::new() } else { table.text() };
    Ok(Outcome { text, complete: errors.is_empty() })
}

/// All splits of a scene, each handed over as soon as it is measured.
fn one(path: &Path, args: &EvalArgs, settings: &Options, mut done: impl FnMut(&str, Measured)) -> Result<()> {
    let splits = split::read(&split::find(&args.split, path), args.only.as_deref())?;
    let options = scene::options(&args.frame, args.depth.depth_scale, false)?;
    let cloud = args.method.cloud.as_ref().map(|file| cloud::read(&split::find(file, path))).transpose()?;
    let cloud_points = args.cloud_points.map(|n| n as usize);
    for (key, split) in &splits {
        let shown = Shown { scene: path, options: &options, cloud: cloud.as_ref(), cloud_points };
        done(key, measure::split(&shown, split, settings, args.repeat)?);
    }
    Ok(())
}

/// The folder's name, of a file the name of its folder.
fn name_of(scene: &Path) -> String {
    let absolute = std::fs::canonicalize(scene).unwrap_or_else(|_| scene.to_owned());
    let folder = if absolute.is_file() { absolute.parent() } else { Some(absolute.as_path()) };
    let name = folder.and_then(Path::file_name).unwrap_or(scene.as_os_str());
    name.to_string_lossy().into_owned()
}
