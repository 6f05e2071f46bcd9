//! Measures all systems in all splits of all vehicles.
//!
//! Repeats are interleaved: every system once, then every system again, so that a temporary load on the machine does
//! not bias the times of one system. Results are deterministic, so errors are measured in the first round only.

use super::judge::{Judge, References};
use super::measure::{self, Measured, MethodInput};
use super::split::{self, Split};
use super::system::{Maker, Method, Side, SplitFilter, System};
use super::vehicles::{self, Vehicle};
use crate::args::{JudgeArgs, VehiclesArgs};
use crate::job::{self, Failure, Result};
use crate::{cloud, memory, scene};
use serde::Serialize;
use std::collections::HashSet;
use std::ffi::OsString;
use std::path::Path;
use vg::io::FitQuality;
use vg::onnx::ModelOptions;
use vg::progress::Threads;
use vg::scene::Cloud;

/// Result of one system.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    pub(crate) system: String,
    /// Number of splits that were measured.
    pub(crate) splits: usize,
    /// Reasons why all or some splits have no numbers.
    pub(crate) missing: Vec<String>,
    /// Mean over the splits of the median over the repeats; for an import, the time that was given with it.
    pub(crate) seconds: Option<f64>,
    /// Smallest and largest over the repeats of the mean over the splits.
    pub(crate) seconds_range: Option<[f64; 2]>,
    /// Standard error of the mean PSNR over the splits; `None` for a single split.
    pub(crate) psnr_standard_error_db: Option<f64>,
    /// Peak memory of a process that reads the first split's views and reconstructs from them, bytes; `None` where the
    /// operating system does not report it, and for imports.
    pub(crate) peak_bytes: Option<u64>,
    /// Means over the splits.
    #[serde(flatten)]
    pub(crate) mean: Option<Measured>,
    /// Each split.
    pub(crate) each: Vec<InSplit>,
}

/// Result of one system in one split.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct InSplit {
    scene: String,
    split: String,
    /// Seconds of each repeat.
    seconds: Vec<f64>,
    #[serde(flatten)]
    measured: Measured,
}

impl InSplit {
    /// The scene, the split and the numbers.
    pub(crate) fn parts(&self) -> (&str, &str, &Measured) {
        (&self.scene, &self.split, &self.measured)
    }
}

/// Quality of a vehicle's alignment to its scan.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Aligned {
    scene: String,
    residual_m: f64,
    confidence: f64,
}

/// A vehicle that could not be measured at all.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Broken {
    pub(crate) scene: String,
    pub(crate) error: String,
}

/// Rows in the order of the systems, and the vehicles that failed.
pub(crate) struct Contest {
    pub(crate) rows: Vec<Row>,
    pub(crate) errors: Vec<Broken>,
    /// How well each vehicle fits the scan that it was aligned to.
    pub(crate) aligned: Vec<Aligned>,
    /// Name of the LPIPS network, where LPIPS was measured.
    pub(crate) lpips_net: Option<String>,
}

impl Contest {
    /// Whether everything that could be measured was measured.
    pub(crate) fn is_complete(&self, systems: &[System]) -> bool {
        let is_whole = |(row, system): (&Row, &System)| {
            row.missing.is_empty() || matches!(system.maker, Maker::Missing(_))
        };
        self.errors.is_empty() && self.rows.iter().zip(systems).all(is_whole)
    }
}

/// Measurements of one system so far.
#[derive(Default)]
struct Runs {
    each: Vec<InSplit>,
    missing: Vec<String>,
    /// Peak memory of the first split.
    peak_bytes: Option<u64>,
}

/// Measures all systems; vehicles and systems that fail are reported and left out.
pub(crate) fn run(
    vehicles: &VehiclesArgs,
    judge: &JudgeArgs,
    models: &ModelOptions,
    systems: &[System],
    repeat: u32,
) -> Result<Contest> {
    let judge = Judge::open(judge, models)?;
    let scenes = vehicles::found(&vehicles.scenes)?;
    let threads = Threads::new(most_threads(systems))?;
    let mut runs: Vec<Runs> = systems.iter().map(|_| Runs::default()).collect();
    let (mut errors, mut aligned) = (Vec::new(), Vec::new());
    for scene in &scenes {
        let measured = Vehicle::open(scene, vehicles, &threads).and_then(|vehicle| {
            aligned.extend(vehicle.fit.map(|FitQuality { residual_m, confidence }| {
                let scene = vehicle.name.clone();
                Aligned { scene, residual_m, confidence }
            }));
            measure_vehicle(&vehicle, &judge, systems, repeat, &threads, &mut runs)
        });
        match measured {
            Ok(()) => job::print_warnings(),
            // With a single scene, its failure is the command's failure.
            Err(failure) if scenes.len() == 1 => return Err(failure),
            Err(failure) => {
                let shown = scene.display().to_string();
                job::print_error(&format!("{shown}: {}", failure.message));
                errors.push(Broken { scene: shown, error: failure.message });
            }
        }
    }
    let rows = runs.into_iter().zip(systems).map(|(runs, system)| runs.row(system)).collect();
    Ok(Contest { rows, errors, aligned, lpips_net: judge.lpips_net().map(Into::into) })
}

/// Largest thread count of the systems; 0 (all cores) where one of them asks for all cores.
fn most_threads(systems: &[System]) -> usize {
    let threads = |system: &System| match &system.maker {
        Maker::Method(method) => method.settings.threads(),
        Maker::Import(_) | Maker::Missing(_) => 0,
    };
    let all: Vec<usize> = systems.iter().map(threads).collect();
    if all.contains(&0) { 0 } else { all.into_iter().max().unwrap_or(0) }
}

/// Runs `work` on the number of threads that the method sets; on `threads` where that pool has as many.
fn on_threads<T>(method: &Method, threads: &Threads, work: impl FnOnce(&Threads) -> Result<T>) -> Result<T> {
    match method.settings.threads() {
        // Where a method asks for all cores, `threads` has all of them.
        count if count == 0 || count == threads.count() => work(threads),
        count => work(&Threads::new(count)?),
    }
}

/// Measures all systems in a vehicle's splits. A method runs on its own number of threads, the rest on `threads`.
fn measure_vehicle(
    vehicle: &Vehicle,
    judge: &Judge,
    systems: &[System],
    repeat: u32,
    threads: &Threads,
    runs: &mut [Runs],
) -> Result<()> {
    let judge: References = judge.references(&vehicle.scene)?;
    // A cause that several systems share is reported once.
    let mut reported = HashSet::new();
    for (key, split) in &vehicle.splits {
        // Errors of the photographs are the vehicle's, not a system's: open them first.
        let views = split.input.iter().chain(&split.test).cloned().collect::<Vec<_>>();
        scene::open(&vehicle.scene, &views, &vehicle.options(None), threads)?;
        let mut timed = Vec::new();
        for (system, runs) in systems.iter().zip(runs.iter_mut()) {
            let Some(split) = system.splits.apply(vehicle, split)? else { continue };
            let measured = match &system.maker {
                Maker::Missing(_) => continue,
                Maker::Import(import) => import
                    .model(vehicle, key, &split, judge.scan.as_ref(), threads)
                    .and_then(|made| {
                        let options = vehicle.options(None);
                        let from = MethodInput::plain(&vehicle.scene, &options);
                        measure::model(&from, &split, &made, &judge, threads)
                    })
                    .map(|m| Measured { reconstruct_ms: import.seconds.map(|s| 1e3 * s), ..m }),
                Maker::Method(method) => on_threads(method, threads, |own| {
                    with_input(vehicle, method, |input| {
                        measure::split(input, &split, &method.settings, &judge, own)
                    })
                }),
            };
            match measured {
                Ok(measured) => {
                    let seconds = measured.reconstruct_ms.map(|ms| ms / 1e3).into_iter().collect();
                    let scene = vehicle.name.clone();
                    runs.each.push(InSplit { scene, split: key.clone(), seconds, measured });
                    if let Maker::Method(method) = &system.maker {
                        if runs.each.len() == 1 {
                            runs.peak_bytes = peak_bytes(vehicle, &split, method);
                        }
                        timed.push((method, split, runs));
                    }
                }
                // With a single system, its failure is the command's failure.
                Err(failure) if systems.len() == 1 => return Err(failure),
                Err(failure) => {
                    if reported.insert(failure.message.clone()) {
                        job::print_error(&format!(
                            "{}, {key}, {}: {}",
                            vehicle.name, system.name, failure.message
                        ));
                    }
                    runs.missing.push(format!("{}, {key}: {}", vehicle.name, failure.message));
                }
            }
        }
        for _ in 1..repeat {
            for (method, split, runs) in &mut timed {
                let ms = on_threads(method, threads, |own| {
                    with_input(vehicle, method, |input| measure::time(input, split, &method.settings, own))
                })?;
                runs.each.last_mut().expect("the first round made it").seconds.push(ms / 1e3);
            }
        }
    }
    Ok(())
}

/// Peak memory of the reconstruction, bytes; `None` for settings that `vg reconstruct` does not have.
fn peak_bytes(vehicle: &Vehicle, split: &Split, method: &Method) -> Option<u64> {
    let words = method.words.as_ref().filter(|_| method.cloud_points.is_none())?;
    let source = vehicle.source().ok()?;
    let mut all: Vec<OsString> = vec![source.into(), "--views".into(), split.input.join(",").into()];
    all.extend(words.iter().cloned());
    memory::reconstruction_peak(all, vehicle.vehicle_from_world.as_ref())
}

/// Opens a method's input of a vehicle and runs `work` on it.
fn with_input<T>(
    vehicle: &Vehicle,
    method: &Method,
    work: impl FnOnce(&MethodInput) -> Result<T>,
) -> Result<T> {
    let read = |file: &std::path::PathBuf| cloud::read(&split::find(file, &vehicle.scene));
    let cloud: Option<Cloud> = method.cloud.as_ref().map(read).transpose()?;
    let (scene, options): (&Path, _) = (&vehicle.scene, &vehicle.options(method.depth_scale));
    work(&MethodInput { scene, options, cloud: cloud.as_ref(), cloud_points: method.cloud_points })
}

impl SplitFilter {
    /// The split with this system's test views; `None` if the system is not measured in it.
    fn apply(self, vehicle: &Vehicle, split: &Split) -> Result<Option<Split>> {
        if let Some(side) = self.side {
            let is_left = vehicle.side(&split.input)? > 0.0;
            if is_left != (side == Side::Left) {
                return Ok(None);
            }
        }
        if !self.all_tests {
            return Ok(Some(split.clone()));
        }
        let mut test: Vec<String> = vehicle.splits.values().flat_map(|s| s.test.iter().cloned()).collect();
        test.sort();
        test.dedup();
        test.retain(|view| !split.input.contains(view));
        if test.is_empty() {
            return Err(Failure::job(
                "every test view is also an input view; expected at least one that is not",
            ));
        }
        Ok(Some(Split { input: split.input.clone(), test }))
    }
}

impl Runs {
    fn row(self, system: &System) -> Row {
        let mut missing = self.missing;
        if let Maker::Missing(why) = &system.maker {
            missing.push(why.clone());
        } else if self.each.is_empty() && missing.is_empty() {
            missing.push("no vehicle has a split with input views on this side".into());
        }
        let measured: Vec<&Measured> = self.each.iter().map(|e| &e.measured).collect();
        let mean = measure::mean(&measured);
        let count = self.each.len() as f64;
        let psnr = mean.as_ref().map_or(0.0, |mean| mean.errors.psnr_db);
        let squares = measured.iter().map(|m| (m.errors.psnr_db - psnr).powi(2)).sum::<f64>();

        let repeats = self.each.iter().map(|e| e.seconds.len()).min().unwrap_or(0);
        let mean_of_repeat = |r: usize| self.each.iter().map(|e| e.seconds[r]).sum::<f64>() / count;
        let means: Vec<f64> = (0..repeats).map(mean_of_repeat).collect();
        let medians = self.each.iter().map(|e| measure::median(&mut e.seconds.clone()));
        let least = means.iter().copied().fold(f64::INFINITY, f64::min);
        let most = means.iter().copied().fold(0.0, f64::max);
        Row {
            system: system.name.clone(),
            splits: self.each.len(),
            missing,
            peak_bytes: self.peak_bytes,
            seconds: (repeats > 0).then(|| medians.sum::<f64>() / count),
            seconds_range: (repeats > 0).then_some([least, most]),
            psnr_standard_error_db: (count > 1.0).then(|| (squares / (count - 1.0) / count).sqrt()),
            mean,
            each: self.each,
        }
    }
}
