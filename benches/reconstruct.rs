//! Time of a reconstruction, stage by stage, and its error on the unseen side, on the bundled sample.
//!
//! `cargo bench --bench reconstruct` prints one row per depth source and number of threads: medians over the runs,
//! the share of the cloning in the total time, and the peak memory of the process during these runs.

use vg::pipeline::{Options, PriorChoice, Report};
use vg::symmetry::SymmetryMode;
use vg::{Result, Scene};
use vg_testing::sample::{self, INPUTS, UNSEEN, errors, median, run};

/// Timed runs of each setting, after one that is not timed.
const RUNS: usize = 7;

fn main() -> Result<()> {
    let tests = sample::open(&UNSEEN, false)?;
    println!("{RUNS} runs each, medians in ms; errors on the four unseen views of the other side\n");
    for prior in [PriorChoice::Hull, PriorChoice::Given] {
        let scene = sample::open(&INPUTS, prior == PriorChoice::Given)?;
        for symmetry in [SymmetryMode::Auto, SymmetryMode::Always] {
            for threads in [1, 2] {
                row(&scene, &tests, &Options { prior, symmetry, threads, ..Options::default() })?;
            }
        }
    }
    Ok(())
}

fn row(scene: &Scene, tests: &Scene, options: &Options) -> Result<()> {
    forget_peak_memory();
    let first = run(scene, options)?;
    let errors = errors(&first, tests)?;
    let reports: Vec<Report> = (0..RUNS).map(|_| Ok(run(scene, options)?.report)).collect::<Result<_>>()?;
    let total = median(reports.iter().map(|r| r.total_ms));
    let stages: Vec<(&str, f64)> = (0..first.report.stages.len())
        .map(|i| (first.report.stages[i].name, median(reports.iter().map(|r| r.stages[i].ms))))
        .collect();
    let of = |name: &str| stages.iter().find(|s| s.0 == name).map_or(0.0, |s| s.1);
    let memory = reports.iter().filter_map(|r| r.peak_rss_bytes).max().unwrap_or(0);

    println!(
        "{}, symmetry {}, {} thread{}: {total:.0} ms, PSNR {:.2} dB, SSIM {:.3}, IoU {:.3}, {} Gaussians, peak {:.0} MB",
        first.report.prior,
        format!("{:?}", options.symmetry).to_lowercase(),
        options.threads,
        if options.threads == 1 { "" } else { "s" },
        errors.psnr_db,
        errors.ssim.unwrap_or(f64::NAN),
        errors.silhouette_iou,
        first.gaussians.len(),
        memory as f64 / 1e6,
    );
    let cells: Vec<String> = stages.iter().map(|(name, ms)| format!("{name} {ms:.1}")).collect();
    println!("  {}", cells.join(", "));
    // The check draws the model into its input views; a caller does not need it to get the model.
    let cloning = of("symmetry");
    println!(
        "  cloning takes {:.1} % of the whole, {:.1} % without the check\n",
        100.0 * cloning / total,
        100.0 * cloning / (total - of("check")),
    );
    Ok(())
}

/// Resets the peak memory on Linux; elsewhere each row shows the peak since the start.
fn forget_peak_memory() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}
