//! `vg pareto`: error against run time over a sweep of settings.
//!
//! Repeats are interleaved: every point once, then every point again, so that a machine that is busy for a while does
//! not wrong one of them. Results are deterministic, so errors are measured in the first round only.

mod plot;
mod point;

use crate::args::ParetoArgs;
use crate::eval::measure::{self, Shown};
use crate::eval::split;
use crate::job::{self, Outcome, Result};
use crate::{files, scene};
use point::{Point, Row, Runs};
use serde::Serialize;
use std::path::Path;
use vg::io::SceneOptions;

/// What `--json` writes.
#[derive(Serialize)]
struct Document<'a> {
    version: &'static str,
    common: &'a str,
    repeat: u32,
    points: &'a [Row],
}

/// A scene that cannot be evaluated is an error, and the others go on without it.
pub(crate) fn run(args: &ParetoArgs) -> Result {
    let outputs: Vec<_> = [&args.csv, &args.svg, &args.json].into_iter().flatten().cloned().collect();
    files::refuse_clashes(&outputs, &[])?;
    outputs.iter().try_for_each(|path| files::prepare(path))?;
    let points = args.points.iter().map(|text| Point::read(text, &args.with));
    let points: Vec<Point> = points.collect::<Result<_>>()?;

    let mut runs: Vec<Runs> = points.iter().map(|_| Runs::default()).collect();
    let mut complete = true;
    for path in &args.scenes {
        match one(path, args, &points) {
            Ok(of_scene) => {
                for (runs, of_scene) in runs.iter_mut().zip(of_scene) {
                    runs.measured.extend(of_scene.measured);
                    runs.seconds.extend(of_scene.seconds);
                }
                job::warn();
            }
            Err(failure) if args.scenes.len() == 1 => return Err(failure),
            Err(failure) => {
                job::complain(&format!("{}: {}", path.display(), failure.message));
                complete = false;
            }
        }
    }
    let rows = runs.into_iter().zip(&points).filter_map(|(runs, point)| runs.row(&point.name));
    let mut rows: Vec<Row> = rows.collect();
    point::mark_front(&mut rows);
    if let Some(path) = &args.csv {
        files::write(path, csv(&rows).as_bytes())?;
    }
    if let Some(path) = args.svg.as_ref().filter(|_| !rows.is_empty()) {
        files::write(path, plot::svg(&rows, &args.title).as_bytes())?;
    }
    if let Some(path) = &args.json {
        let version = env!("CARGO_PKG_VERSION");
        let document = Document { version, common: &args.with, repeat: args.repeat, points: &rows };
        files::write_json(path, &document)?;
    }
    Ok(Outcome { text: table(&rows), complete })
}

/// Every point in every split of a scene.
fn one(path: &Path, args: &ParetoArgs, points: &[Point]) -> Result<Vec<Runs>> {
    let splits = split::read(&split::find(&args.split, path), args.only.as_deref())?;
    let opened = |point: &Point| scene::options(&args.frame, point.depth_scale, false);
    let options: Vec<SceneOptions> = points.iter().map(opened).collect::<Result<_>>()?;
    let shown = |options| Shown { scene: path, options, cloud: None, cloud_points: None };
    let mut runs: Vec<Runs> = points.iter().map(|_| Runs::default()).collect();
    for split in splits.values() {
        for ((runs, point), options) in runs.iter_mut().zip(points).zip(&options) {
            let measured = measure::split(&shown(options), split, &point.settings, 1)?;
            runs.seconds.push(vec![measured.reconstruct_ms / 1e3]);
            runs.measured.push(measured);
        }
        for _ in 1..args.repeat {
            for ((runs, point), options) in runs.iter_mut().zip(points).zip(&options) {
                let seconds = measure::time(&shown(options), split, &point.settings)? / 1e3;
                runs.seconds.last_mut().expect("the first round made it").push(seconds);
            }
        }
    }
    Ok(runs)
}

/// Names and values of a row, as CSV and the table have them.
fn cells(row: &Row) -> [(&'static str, String); 13] {
    let m = &row.measured;
    let number = |value: Option<f64>, digits: usize| value.map_or(String::new(), |v| format!("{v:.digits$}"));
    [
        ("point", row.point.clone()),
        ("seconds", number(Some(row.seconds), 3)),
        ("least", number(Some(row.seconds_range[0]), 3)),
        ("most", number(Some(row.seconds_range[1]), 3)),
        ("PSNR dB", number(Some(m.errors.psnr_db), 3)),
        ("+-", number(row.psnr_standard_error_db, 3)),
        ("SSIM", number(m.errors.ssim, 4)),
        ("IoU", number(Some(m.errors.silhouette_iou), 4)),
        ("depth MAE m", number(m.errors.depth_mae_m, 4)),
        ("in. PSNR dB", number(m.input_psnr_db, 3)),
        ("in. SSIM", number(m.input_ssim, 4)),
        ("Gaussians", format!("{:.0}", m.gaussians)),
        ("front", if row.on_front { "*" } else { "" }.into()),
    ]
}

fn csv(rows: &[Row]) -> String {
    let quoted = |text: &str| {
        let plain = !text.contains([',', '"', '\n', '\r']);
        if plain { text.to_owned() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
    };
    let mut out = String::new();
    for (i, row) in rows.iter().enumerate() {
        let cells = cells(row);
        if i == 0 {
            out += &cells.iter().map(|c| c.0).collect::<Vec<_>>().join(",");
            out.push('\n');
        }
        out += &cells.iter().map(|c| quoted(&c.1)).collect::<Vec<_>>().join(",");
        out.push('\n');
    }
    out
}

fn table(rows: &[Row]) -> String {
    let rows: Vec<[(&str, String); 13]> = rows.iter().map(cells).collect();
    let Some(first) = rows.first() else { return String::new() };
    let width = |c: usize| {
        rows.iter().map(|r| r[c].1.chars().count()).max().unwrap_or(0).max(first[c].0.chars().count())
    };
    let widths: Vec<usize> = (0..first.len()).map(width).collect();
    let line = |texts: Vec<&str>| {
        let cells = texts.iter().zip(&widths).enumerate().map(|(c, (text, &width))| {
            if c == 0 { format!("{text:<width$}") } else { format!("{text:>width$}") }
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let mut lines = vec![line(first.iter().map(|c| c.0).collect())];
    lines.extend(rows.iter().map(|row| line(row.iter().map(|c| c.1.as_str()).collect())));
    lines.join("\n")
}
