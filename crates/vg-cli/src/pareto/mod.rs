//! `vg pareto`: error against run time over a sweep of settings.

mod labels;
mod plot;

use crate::args::ParetoArgs;
use crate::eval::contest::{self, Contest, Row};
use crate::eval::system::System;
use crate::eval::{self, table};
use crate::files::{Kind, Results};
use crate::grid::{Column, Grid, number};
use crate::job::{Outcome, Result};
use crate::{files, raster};
use serde::Serialize;
use vg::onnx::ModelOptions;

/// A point of the sweep that was measured.
#[derive(Serialize)]
struct Point {
    /// Whether no other point is better in both time and PSNR.
    on_front: bool,
    #[serde(flatten)]
    row: Row,
}

/// JSON document.
#[derive(Serialize)]
struct Document<'a> {
    version: &'static str,
    common: &'a str,
    repeat: u32,
    points: &'a [Point],
}

/// Measures all points; a scene or a point that cannot be measured is reported as an error and left out.
pub(crate) fn run(args: &ParetoArgs) -> Result {
    let points = args.points.iter().map(|text| System::read("--point", text, &args.with));
    let systems: Vec<System> = points.collect::<Result<_>>()?;
    let results = Results::new([
        (Kind::Csv, args.csv.as_ref()),
        (Kind::Svg, args.svg.as_ref()),
        (Kind::Png, args.png.as_ref()),
        (Kind::Json, args.json.as_ref()),
    ]);
    results.prepare(&eval::inputs(&args.vehicles, &args.judge, &systems)?)?;
    let contest = contest::run(&args.vehicles, &args.judge, &ModelOptions::default(), &systems, args.repeat)?;
    let complete = contest.is_complete(&systems);
    let Contest { rows, .. } = contest;
    let missing = table::missing(&rows);
    let points = on_front(rows);
    let grid = grid(&points);
    if let Some(path) = &args.csv {
        files::write(path, |out| out.write_all(grid.csv().as_bytes()))?;
    }
    let drawn = plot::draw(&points, &args.title);
    if let Some((path, drawn)) = args.svg.as_ref().zip(drawn.as_ref()) {
        files::write(path, |out| out.write_all(drawn.svg().as_bytes()))?;
    }
    if let Some((path, drawn)) = args.png.as_ref().zip(drawn.as_ref()) {
        let png = raster::png(drawn)?;
        files::write(path, |out| out.write_all(&png))?;
    }
    if let Some(path) = &args.json {
        let version = env!("CARGO_PKG_VERSION");
        let document = Document { version, common: &args.with, repeat: args.repeat, points: &points };
        files::write_json(path, &document)?;
    }
    let text = [grid.text(), missing].into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join("\n");
    Ok(results.outcome(Outcome { text, complete }))
}

/// Seconds and PSNR of a row that has both.
fn place(row: &Row) -> Option<[f64; 2]> {
    Some([row.seconds?, row.mean.as_ref()?.errors.psnr_db])
}

/// Marks the rows that no other row beats in both time and PSNR.
fn on_front(rows: Vec<Row>) -> Vec<Point> {
    let places: Vec<Option<[f64; 2]>> = rows.iter().map(place).collect();
    let beats = |a: [f64; 2], b: [f64; 2]| a[0] <= b[0] && a[1] >= b[1] && a != b;
    let marked = rows.into_iter().zip(&places).map(|(row, own)| {
        let is_beaten = |own: [f64; 2]| places.iter().flatten().any(|other| beats(*other, own));
        Point { on_front: own.is_some_and(|own| !is_beaten(own)), row }
    });
    marked.collect()
}

fn grid(points: &[Point]) -> Grid {
    use Column::{Numbers, Rare, Words};
    let mut grid = Grid::new(&[
        Words("point"),
        Numbers("seconds"),
        Numbers("least"),
        Numbers("most"),
        Numbers("PSNR dB"),
        Rare("+-"),
        Numbers("SSIM"),
        Rare("LPIPS"),
        Numbers("IoU"),
        Rare("depth MAE m"),
        Rare("Chamfer m"),
        Rare("in. PSNR dB"),
        Rare("in. SSIM"),
        Rare("peak MiB"),
        Numbers("Gaussians"),
        Words("front"),
    ]);
    for Point { row, on_front } in points {
        let m = row.mean.as_ref();
        grid.push([
            row.system.clone(),
            number(row.seconds, 3),
            number(row.seconds_range.map(|r| r[0]), 3),
            number(row.seconds_range.map(|r| r[1]), 3),
            number(m.map(|m| m.errors.psnr_db), 3),
            number(row.psnr_standard_error_db, 3),
            number(m.and_then(|m| m.errors.ssim), 4),
            number(m.and_then(|m| m.lpips), 4),
            number(m.map(|m| m.errors.silhouette_iou), 4),
            number(m.and_then(|m| m.errors.depth_mae_m), 4),
            number(m.and_then(|m| m.surface.as_ref().map(|s| s.chamfer_m)), 4),
            number(m.and_then(|m| m.input_psnr_db), 3),
            number(m.and_then(|m| m.input_ssim), 4),
            number(row.peak_bytes.map(|bytes| bytes as f64 / f64::from(1 << 20)), 0),
            number(m.map(|m| m.gaussians), 0),
            if *on_front { "*" } else { "" }.into(),
        ]);
    }
    grid
}
