//! Distances of reconstructed surfaces from scans, and the time to compute them.
//!
//! `cargo bench --bench surface -- FOLDER` uses the vehicles in a folder: each has a `transforms.json`, a `split.json`
//! with `input` views, and a scan in metres in the vehicle's frame, `pcd.ply`. Reconstructs each with the default
//! options on two threads and prints a Markdown table, one row per vehicle with the mean over its splits.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;
use vg::io::{SceneOptions, open_scene, ply};
use vg::metrics::SurfaceErrors;
use vg::pipeline::{Options, reconstruct_on};
use vg::progress::Threads;
use vg::{Error, Result};

#[derive(Deserialize)]
struct Split {
    input: Vec<String>,
}

type Measure = fn(&SurfaceErrors) -> f64;

/// Columns, and the source of their numbers.
const COLUMNS: [(&str, Measure); 9] = [
    ("accuracy m", |e| e.accuracy_m),
    ("completeness m", |e| e.completeness_m),
    ("Chamfer m", |e| e.chamfer_m),
    ("precision", |e| e.precision),
    ("recall", |e| e.recall),
    ("F-score", |e| e.f_score),
    ("length %", |e| e.length_error_percent),
    ("width %", |e| e.width_error_percent),
    ("height %", |e| e.height_error_percent),
];

fn main() -> Result<()> {
    let Some(folder) = std::env::args().skip(1).find(|a| a != "--bench") else {
        println!("skipped: cargo bench --bench surface -- FOLDER");
        return Ok(());
    };
    let names: Vec<&str> = COLUMNS.iter().map(|c| c.0).collect();
    println!("| vehicle | {} | ms |", names.join(" | "));
    println!("| --- |{}", " --- |".repeat(COLUMNS.len() + 1));
    let threads = Threads::new(2)?;
    let mut all = Vec::new();
    for vehicle in vehicles(Path::new(&folder))? {
        let measured = measured(&vehicle, &threads)?;
        row(&vehicle.file_name().unwrap_or_default().to_string_lossy(), &measured);
        all.extend(measured);
    }
    row("mean", &all);
    Ok(())
}

fn vehicles(folder: &Path) -> Result<Vec<PathBuf>> {
    let listed = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    let mut found: Vec<PathBuf> = listed.flatten().map(|e| e.path()).collect();
    found.retain(|p| p.join("split.json").is_file() && p.join("pcd.ply").is_file());
    found.sort();
    Ok(found)
}

/// The errors of each split, and the milliseconds to compute them.
fn measured(vehicle: &Path, threads: &Threads) -> Result<Vec<(SurfaceErrors, f64)>> {
    let path = vehicle.join("split.json");
    let text = std::fs::read(&path).map_err(|e| Error::io(&path, e))?;
    let splits: BTreeMap<String, Split> =
        serde_json::from_slice(&text).map_err(|e| Error::format(&path, "split", e.to_string()))?;
    let (scan, _) = ply::read_points(&vehicle.join("pcd.ply"))?;
    let of_split = |split: Split| {
        let options = SceneOptions { views: Some(split.input), load_depth: false, ..SceneOptions::default() };
        let scene = open_scene(&vehicle.join("transforms.json"), &options)?.scene;
        let mut progress = |_: vg::progress::Progress| ControlFlow::Continue(());
        let made = reconstruct_on(threads, &scene, &Options::default(), &mut progress)?;
        let start = Instant::now();
        let errors = threads.run(|| SurfaceErrors::of(&made.gaussians, &scan))?;
        Ok((errors, start.elapsed().as_secs_f64() * 1e3))
    };
    splits.into_values().map(of_split).collect()
}

fn row(name: &str, measured: &[(SurfaceErrors, f64)]) {
    let mean = |get: &dyn Fn(&(SurfaceErrors, f64)) -> f64| {
        measured.iter().map(get).sum::<f64>() / measured.len().max(1) as f64
    };
    let digits = |k: usize| if k < 6 { 3 } else { 1 };
    let cells: Vec<String> = COLUMNS
        .iter()
        .enumerate()
        .map(|(k, (_, get))| format!("{:.*}", digits(k), mean(&|(e, _)| get(e))))
        .collect();
    println!("| {name} | {} | {:.0} |", cells.join(" | "), mean(&|(_, ms)| *ms));
}
