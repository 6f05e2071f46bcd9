//! Error against run time: results with `--budget`, on the bundled sample and on folders with a `split.json`.
//!
//! `cargo bench --bench budget` prints the table of docs/PLAN.md; `-- FOLDER...` adds scenes, or folders of scenes,
//! `--svg FILE` draws the curve, `--runs N` sets the number of runs. `--stages` prints the cost of each stage on one
//! thread instead, from which the constants of the cost model are taken.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;
use vg::io::{SceneOptions, open_scene};
use vg::pipeline::{Options, Reconstruction, reconstruct_on};
use vg::progress::Threads;
use vg::{Error, Result, Scene};
use vg_testing::sample::{self, INPUTS, UNSEEN, errors, median};

/// Seconds.
const BUDGETS: [f64; 8] = [0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0];

const THREADS: usize = 2;

fn main() -> Result<()> {
    let arguments = Arguments::read()?;
    let sedan = Vehicle {
        name: "sedan".into(),
        inputs: sample::open(&INPUTS, false)?,
        tests: sample::open(&UNSEEN, false)?,
    };
    let mut vehicles = vec![sedan];
    for folder in &arguments.folders {
        open_all(folder, &mut vehicles)?;
    }
    if arguments.stages {
        return vehicles.iter().try_for_each(stages);
    }
    let threads = Threads::new(THREADS)?;
    // Weights are read, and the machine is measured, once per process.
    run(&threads, &vehicles[0].inputs, &Options { budget_s: Some(10.0), ..Options::default() })?;
    let mut curves = vec![table("sedan", &vehicles[..1], &threads, arguments.runs)?];
    if vehicles.len() > 1 {
        let name = format!("{} vehicles", vehicles.len() - 1);
        curves.push(table(&name, &vehicles[1..], &threads, arguments.runs)?);
    }
    match &arguments.svg {
        Some(path) => Ok(std::fs::write(path, svg(&curves)).map_err(|e| file_error(path, &e))?),
        None => Ok(()),
    }
}

struct Vehicle {
    name: String,
    inputs: Scene,
    tests: Scene,
}

/// PSNR against time in seconds.
struct Curve {
    name: String,
    points: Vec<(f64, f64)>,
}

fn run(threads: &Threads, scene: &Scene, options: &Options) -> Result<Reconstruction> {
    reconstruct_on(threads, scene, options, &mut |_| ControlFlow::Continue(()))
}

fn table(name: &str, vehicles: &[Vehicle], threads: &Threads, runs: usize) -> Result<Curve> {
    println!("\n{name}: {THREADS} threads, medians of {runs} interleaved runs, errors on the unseen side\n");
    println!(
        "| budget s | predicted s | wall s | CPU s / threads | in budget | settings | PSNR dB | IoU | Gaussians |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut rows: Vec<Row> = BUDGETS.iter().map(|_| Row::default()).collect();
    for round in 0..runs {
        for (row, budget) in rows.iter_mut().zip(BUDGETS) {
            for vehicle in vehicles {
                let options = Options { budget_s: Some(budget), threads: THREADS, ..Options::default() };
                let (start, cpu) = (Instant::now(), cpu_seconds());
                let made = run(threads, &vehicle.inputs, &options)?;
                row.wall.push(start.elapsed().as_secs_f64());
                row.cpu.push((cpu_seconds() - cpu) / THREADS as f64);
                if round == 0 {
                    row.note(&made, vehicle)?;
                }
            }
        }
    }
    let mut points = Vec::new();
    for (row, budget) in rows.iter().zip(BUDGETS) {
        let (wall, cpu) = (median(row.wall.iter().copied()), median(row.cpu.iter().copied()));
        let kept = row.wall.iter().filter(|s| **s <= budget).count();
        let n = vehicles.len() as f64;
        let settings: Vec<&str> = row.settings.keys().map(String::as_str).collect();
        println!(
            "| {budget} | {:.2} | {wall:.2} | {cpu:.2} | {kept} of {} | {} | {:.2} | {:.3} | {:.0} |",
            row.predicted / n,
            row.wall.len(),
            settings.join("; "),
            row.psnr / n,
            row.iou / n,
            row.gaussians / n,
        );
        points.push((cpu, row.psnr / n));
    }
    Ok(Curve { name: name.into(), points })
}

#[derive(Default)]
struct Row {
    wall: Vec<f64>,
    cpu: Vec<f64>,
    settings: BTreeMap<String, usize>,
    predicted: f64,
    psnr: f64,
    iou: f64,
    gaussians: f64,
}

impl Row {
    fn note(&mut self, made: &Reconstruction, vehicle: &Vehicle) -> Result<()> {
        let Some(plan) = &made.report.plan else { return Ok(()) };
        let errors = errors(made, &vehicle.tests)?;
        let chosen = &plan.chosen;
        let mut settings = format!("{} at {}", made.report.prior, chosen.resolution);
        for (name, used) in [("photo", chosen.photo), ("check", chosen.check)] {
            if used {
                let _ = write!(settings, ", {name}");
            }
        }
        if let Some(most) = chosen.max_views {
            let _ = write!(settings, ", {most} views");
        }
        if !plan.fits {
            settings.push_str(" (does not fit)");
        }
        *self.settings.entry(settings).or_default() += 1;
        self.predicted += plan.predicted_s;
        self.psnr += errors.psnr_db;
        self.iou += errors.silhouette_iou;
        self.gaussians += made.gaussians.len() as f64;
        Ok(())
    }
}

/// CPU time of all living threads of this process, from /proc on Linux; elsewhere 0.
fn cpu_seconds() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return 0.0 };
    let nanoseconds = |task: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    1e-9 * tasks.flatten().filter_map(nanoseconds).sum::<f64>()
}

/// Minimum CPU milliseconds of each part between two progress reports, on one thread.
fn stages(vehicle: &Vehicle) -> Result<()> {
    const RUNS: usize = 3;
    let threads = Threads::new(1)?;
    println!("\n{}", vehicle.name);
    let full = Options::default();
    let settings = [
        ("full", full.clone()),
        ("no photo", Options { photo: false, ..full.clone() }),
        ("0.75", Options { resolution: 0.75, ..full.clone() }),
        ("0.5", Options { resolution: 0.5, ..full.clone() }),
        ("0.5 no photo", Options { resolution: 0.5, photo: false, ..full.clone() }),
        ("0.35 no photo", Options { resolution: 0.35, photo: false, ..full.clone() }),
        ("0.25 no photo", Options { resolution: 0.25, photo: false, ..full.clone() }),
        ("2 views", Options { max_views: Some(2), ..full.clone() }),
        ("hull", Options { prior: vg::pipeline::PriorChoice::Hull, ..full.clone() }),
        ("hull 0.25", Options { prior: vg::pipeline::PriorChoice::Hull, resolution: 0.25, ..full.clone() }),
    ];
    for (name, options) in settings {
        let mut parts: Vec<(String, f64)> = Vec::new();
        let mut quality = (0.0, 0.0);
        for run in 0..RUNS {
            let mut marks: Vec<(String, f64)> = Vec::new();
            let mut mark = |p: vg::progress::Progress| {
                marks.push((format!("{} {:.2}", p.stage, p.fraction), cpu_seconds()));
                ControlFlow::Continue(())
            };
            let made = reconstruct_on(&threads, &vehicle.inputs, &options, &mut mark)?;
            marks.push((String::new(), cpu_seconds()));
            let laps = marks.windows(2).map(|m| (m[0].0.clone(), 1e3 * (m[1].1 - m[0].1)));
            if run == 0 {
                parts = laps.collect();
                let errors = errors(&made, &vehicle.tests)?;
                quality = (errors.psnr_db, errors.silhouette_iou);
            } else {
                parts.iter_mut().zip(laps).for_each(|(part, lap)| part.1 = part.1.min(lap.1));
            }
        }
        let total: f64 = parts.iter().map(|p| p.1).sum();
        let parts: Vec<String> = parts.iter().map(|(name, ms)| format!("{name}: {ms:.1}")).collect();
        println!("{name}: {total:.0} ms, {:.2} dB, IoU {:.3}\n  {}", quality.0, quality.1, parts.join(", "));
    }
    Ok(())
}

/// Opens a scene with a split, or a folder of such scenes.
fn open_all(folder: &Path, vehicles: &mut Vec<Vehicle>) -> Result<()> {
    if folder.join("split.json").is_file() {
        vehicles.push(open(folder)?);
        return Ok(());
    }
    let entries = std::fs::read_dir(folder).map_err(|e| file_error(folder, &e))?;
    let mut inner: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    inner.sort();
    for folder in inner.iter().filter(|f| f.join("split.json").is_file()) {
        vehicles.push(open(folder)?);
    }
    Ok(())
}

fn open(folder: &Path) -> Result<Vehicle> {
    let path = folder.join("split.json");
    let text = std::fs::read_to_string(&path).map_err(|e| file_error(&path, &e))?;
    let broken = |e: String| Error::argument(path.display().to_string(), e, "right_to_left: input, test");
    let mut splits: BTreeMap<String, BTreeMap<String, Vec<String>>> =
        serde_json::from_str(&text).map_err(|e| broken(e.to_string()))?;
    let mut split = splits.remove("right_to_left").ok_or_else(|| broken("no right_to_left".into()))?;
    let mut views = |key: &str| {
        let views = split.remove(key).ok_or_else(|| broken(format!("no {key}")))?;
        let options = SceneOptions { views: Some(views), load_depth: false, ..SceneOptions::default() };
        Ok::<_, Error>(open_scene(folder, &options)?.scene)
    };
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Vehicle { name, inputs: views("input")?, tests: views("test")? })
}

fn file_error(path: &Path, e: &std::io::Error) -> Error {
    Error::argument(path.display().to_string(), e.to_string(), "a file or folder")
}

/// Plot of PSNR over the logarithm of time.
fn svg(curves: &[Curve]) -> String {
    const COLORS: [&str; 2] = ["#1f5fa8", "#c4511d"];
    let all = || curves.iter().flat_map(|c| &c.points);
    let low = all().fold(f64::INFINITY, |l, p| l.min(p.1)).floor();
    let high = all().fold(f64::NEG_INFINITY, |h, p| h.max(p.1)).ceil().max(low + 1.0);
    let x = |s: f64| 60.0 + 500.0 * ((s.max(0.03) / 0.03).log10() / (10.0f64 / 0.03).log10());
    let y = |db: f64| 300.0 - 270.0 * (db - low) / (high - low);
    let mut out = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 600 350\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"600\" height=\"350\" fill=\"white\"/>\n",
    );
    for s in [0.03, 0.1, 0.3, 1.0, 3.0, 10.0] {
        let _ = writeln!(
            out,
            "<path d=\"M{0:.1} 30V300\" stroke=\"#ddd\"/><text x=\"{0:.1}\" y=\"316\" text-anchor=\"middle\">{s}</text>",
            x(s)
        );
    }
    for db in (0..=(high - low) as i32).map(|i| low + f64::from(i)) {
        let _ = writeln!(
            out,
            "<path d=\"M60 {0:.1}H560\" stroke=\"#ddd\"/><text x=\"52\" y=\"{1:.1}\" text-anchor=\"end\">{db}</text>",
            y(db),
            y(db) + 4.0
        );
    }
    out.push_str("<text x=\"310\" y=\"340\" text-anchor=\"middle\">seconds</text><text x=\"60\" y=\"20\">PSNR of the unseen side, dB</text>\n");
    for (i, (curve, color)) in curves.iter().zip(COLORS).enumerate() {
        let points: Vec<String> =
            curve.points.iter().map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/><text x=\"440\" y=\"{}\" fill=\"{color}\">{}</text>",
            points.join(" "),
            262 + 16 * i,
            curve.name
        );
    }
    out.push_str("</svg>\n");
    out
}

struct Arguments {
    folders: Vec<PathBuf>,
    svg: Option<PathBuf>,
    runs: usize,
    stages: bool,
}

impl Arguments {
    fn read() -> Result<Self> {
        let mut out = Self { folders: Vec::new(), svg: None, runs: 5, stages: false };
        let mut words = std::env::args().skip(1);
        while let Some(word) = words.next() {
            match word.as_str() {
                // Passed by cargo itself.
                "--bench" => {}
                "--stages" => out.stages = true,
                "--svg" => out.svg = words.next().map(PathBuf::from),
                "--runs" => {
                    let found = words.next().unwrap_or_default();
                    let bad = || Error::argument("--runs", found.clone(), "a number above 0");
                    out.runs = found.parse().ok().filter(|n| *n > 0).ok_or_else(bad)?;
                }
                flag if flag.starts_with("--") => {
                    return Err(Error::argument(
                        "arguments",
                        flag,
                        "FOLDER..., --svg FILE, --runs N, --stages",
                    ));
                }
                folder => out.folders.push(folder.into()),
            }
        }
        Ok(out)
    }
}
