//! `vg eval`: error and time of reconstructions from the input views of splits, measured in their test views.

pub(crate) mod contest;
mod import;
pub(crate) mod judge;
pub(crate) mod measure;
pub(crate) mod split;
mod sweep;
pub(crate) mod system;
pub(crate) mod table;
mod tables;
pub(crate) mod vehicles;

use crate::args::{EvalArgs, JudgeArgs, TableName, VehiclesArgs};
use crate::files::{self, Kind, Results};
use crate::guard::Inputs;
use crate::job::{Failure, Outcome, Result, USAGE};
use contest::{Aligned, Broken, Contest, Row};
use measure::Measured;
use serde::Serialize;
use std::path::PathBuf;
use system::{Maker, Method, SplitFilter, System};
use vg::onnx::Model;
use vg::pipeline;

/// JSON document of one system.
#[derive(Serialize)]
struct Document<'a> {
    version: &'static str,
    settings: &'a pipeline::Method,
    repeat: u32,
    splits: &'a [contest::InSplit],
    mean: Option<&'a Measured>,
    aligned: &'a [Aligned],
    errors: &'a [Broken],
}

/// JSON document of several systems.
#[derive(Serialize)]
struct Comparison<'a> {
    version: &'static str,
    table: Option<String>,
    common: &'a str,
    repeat: u32,
    lpips_net: Option<&'a str>,
    systems: &'a [Row],
    aligned: &'a [Aligned],
    errors: &'a [Broken],
}

/// Evaluates every scene that can be evaluated; the others are reported as errors and make the exit code 1.
pub(crate) fn run(args: &EvalArgs) -> Result {
    if args.table.is_none() && args.systems.is_empty() && args.imports.is_empty() {
        return run_single(args);
    }
    if !args.method.is_silent() || args.depth.depth_scale.is_some() || args.cloud_points.is_some() {
        let message = "reconstruction options cannot stand next to --table, --system or --import; put them into \
                       --with \"...\" for all rows, or into one --system";
        return Err(Failure { message: message.into(), code: USAGE });
    }
    run_comparison(args)
}

fn results(args: &EvalArgs) -> Results {
    Results::new([(Kind::Json, args.json.as_ref()), (Kind::Markdown, args.markdown.as_ref())])
}

/// Files that a measurement reads: scenes, the files that belong to them, and models.
pub(crate) fn inputs(vehicles: &VehiclesArgs, judge: &JudgeArgs, systems: &[System]) -> Result<Inputs> {
    let mut inputs = Inputs::default().files(&judge.lpips);
    let methods = || {
        systems.iter().filter_map(|system| match &system.maker {
            Maker::Method(method) => Some(method),
            _ => None,
        })
    };
    for method in methods() {
        let options = method.settings.vehicle();
        let models =
            options.into_iter().flat_map(|options| [&options.prior_model, &options.head_model]).flatten();
        inputs = inputs.files(models.map(Model::path));
    }
    for scene in vehicles::found(&vehicles.scenes)? {
        let scan = vehicles.align.as_ref().and_then(|named| named.as_ref());
        let beside =
            [Some(&vehicles.split), vehicles.frame.vehicle_from_world.as_ref(), scan, judge.scan.as_ref()];
        let named = beside.into_iter().flatten().chain(methods().filter_map(|method| method.cloud.as_ref()));
        let found: Vec<PathBuf> = named.map(|file| split::find(file, &scene)).collect();
        let imported: Vec<PathBuf> =
            systems.iter().flat_map(|system| system.imported(vehicles, &scene)).collect();
        inputs = inputs.files(&found).files(&imported).scene(&scene);
    }
    Ok(inputs)
}

/// Makes a table of one system with a row for each split.
fn run_single(args: &EvalArgs) -> Result {
    if !args.with.is_empty() {
        let message = "--with needs --table, --system or --import; without them, give its options directly";
        return Err(Failure { message: message.into(), code: USAGE });
    }
    let method = Method {
        settings: args.method.method()?,
        depth_scale: args.depth.depth_scale,
        cloud: args.method.cloud.clone(),
        cloud_points: args.cloud_points.map(|n| n as usize),
        words: None,
    };
    let settings = method.settings.clone();
    let system = System {
        name: "this".into(),
        maker: Maker::Method(Box::new(method)),
        splits: SplitFilter::default(),
    };
    let results = results(args);
    results.prepare(&inputs(&args.vehicles, &args.judge, std::slice::from_ref(&system))?)?;
    let contest = contest::run(
        &args.vehicles,
        &args.judge,
        &args.method.model_options(),
        std::slice::from_ref(&system),
        args.repeat,
    )?;
    let row = &contest.rows[0];
    let each = row.each.iter().map(contest::InSplit::parts);
    let mean = row.mean.as_ref().filter(|_| row.each.len() > 1).map(|mean| ("mean", "", mean));
    let grid = table::by_split(each.chain(mean));
    if let Some(path) = &args.markdown {
        files::write(path, |out| out.write_all(grid.markdown().as_bytes()))?;
    }
    if let Some(path) = &args.json {
        let document = Document {
            version: env!("CARGO_PKG_VERSION"),
            settings: &settings,
            repeat: args.repeat,
            splits: &row.each,
            mean: row.mean.as_ref(),
            aligned: &contest.aligned,
            errors: &contest.errors,
        };
        files::write_json(path, &document)?;
    }
    let complete = contest.is_complete(std::slice::from_ref(&system));
    Ok(results.outcome(Outcome { text: grid.text(), complete }))
}

/// Makes a table with a row for each system.
fn run_comparison(args: &EvalArgs) -> Result {
    let systems = tables::systems(args)?;
    let results = results(args);
    results.prepare(&inputs(&args.vehicles, &args.judge, &systems)?)?;
    let model_options = args.method.model_options();
    let contest = contest::run(&args.vehicles, &args.judge, &model_options, &systems, args.repeat)?;
    let Contest { rows, errors, aligned, lpips_net } = &contest;
    let grid = table::by_system(rows, args.table == Some(TableName::Omissions));
    let missing = table::missing(rows);
    if let Some(path) = &args.markdown {
        let lines: String = missing.lines().map(|line| format!("- {line}\n")).collect();
        let text = if lines.is_empty() { grid.markdown() } else { format!("{}\n{lines}", grid.markdown()) };
        files::write(path, |out| out.write_all(text.as_bytes()))?;
    }
    if let Some(path) = &args.json {
        let document = Comparison {
            version: env!("CARGO_PKG_VERSION"),
            table: args.table.map(|t| format!("{t:?}").to_lowercase()),
            common: &args.with,
            repeat: args.repeat,
            lpips_net: lpips_net.as_deref(),
            systems: rows,
            aligned,
            errors,
        };
        files::write_json(path, &document)?;
    }
    let text = [grid.text(), missing].into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join("\n");
    Ok(results.outcome(Outcome { text, complete: contest.is_complete(&systems) }))
}
