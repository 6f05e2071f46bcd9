//! Value of each omission of the plan: dB on the unseen side, time and Gaussians, with it and without it, on
//! a scene derived from the bundled sample in which it occurs. `cargo bench --bench plan` prints the table of
//! docs/PLAN.md.

use vg::pipeline::{Keep, Options, PriorChoice};
use vg::scene::DepthMap;
use vg::symmetry::SymmetryMode;
use vg::{Result, Scene};
use vg_testing::sample::{self, INPUTS, UNSEEN, errors, median, run};

/// Timed runs of each setting, after one that is not timed.
const RUNS: usize = 7;

fn main() -> Result<()> {
    let unseen = sample::open(&UNSEEN, false)?;
    let base = |prior| Options { prior, threads: 2, check: false, ..Options::default() };
    let keeping = |prior, keep| Options { keep, ..base(prior) };
    println!("2 threads, medians of {RUNS} runs without the check\n");
    println!(
        "| left out | scene | count | PSNR dB, left out / kept | ms, left out / kept | Gaussians, left out / kept |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for prior in [PriorChoice::Hull, PriorChoice::Given] {
        let scene = sample::open(&INPUTS, prior == PriorChoice::Given)?;
        let name = if prior == PriorChoice::Hull { "hull" } else { "given" };

        let twice = Scene {
            views: scene.views.iter().flat_map(|v| [v.clone(), v.clone()]).collect(),
            ..Scene::default()
        };
        let keep = Keep { duplicate_views: true, ..Keep::default() };
        let what = format!("{name}, each view twice");
        row(
            "views with the same camera",
            &what,
            "same camera",
            &twice,
            &unseen,
            &[base(prior), keeping(prior, keep)],
        )?;

        let keep = Keep { overlap: true, ..Keep::default() };
        row(
            "pixels another view shows better",
            name,
            "higher resolution",
            &scene,
            &unseen,
            &[base(prior), keeping(prior, keep)],
        )?;

        let keep = Keep { silhouette_edge: true, ..Keep::default() };
        row(
            "pixels on the silhouette's edge",
            name,
            "silhouette's edge",
            &scene,
            &unseen,
            &[base(prior), keeping(prior, keep)],
        )?;

        let narrow = Scene { views: scene.views[1..2].to_vec(), ..Scene::default() };
        let keep = Keep { sh_bands: true, ..Keep::default() };
        let what = format!("{name}, view 001 alone");
        row("SH bands", &what, "too few to tell", &narrow, &unseen, &[base(prior), keeping(prior, keep)])?;

        let around = sample::open(&["000", "001", "002", "003", "005", "007"], false)?;
        if prior == PriorChoice::Hull {
            let always = Options { symmetry: SymmetryMode::Always, ..base(prior) };
            row(
                "clones of what was seen",
                "hull, 000-003, 005, 007",
                "mirrored place",
                &around,
                &unseen,
                &[base(prior), always],
            )?;
        }
    }
    let scene = floating(sample::open(&INPUTS, true)?)?;
    let keep = Keep { floaters: true, ..Keep::default() };
    let options = [base(PriorChoice::Given), keeping(PriorChoice::Given, keep)];
    row("floating pixels", "given, 1 % of depth off by up to 1 m", "floating", &scene, &unseen, &options)
}

/// One pixel in a hundred moved by up to a metre, as depth cameras do at edges.
fn floating(mut scene: Scene) -> Result<Scene> {
    let mut random = vg_testing::Random::new(7);
    for view in &mut scene.views {
        let depth = view.depth.as_ref().expect("the inputs have depth");
        let (width, height) = (depth.width(), depth.height());
        let mut moved = depth.depth().to_vec();
        for z in moved.iter_mut().filter(|z| **z > 0.0) {
            if random.uniform(0.0, 1.0) < 0.01 {
                *z += random.uniform(-1.0, 1.0) as f32;
            }
        }
        view.depth = Some(DepthMap::new(width, height, moved)?);
    }
    Ok(scene)
}

fn row(
    what: &str,
    scene_name: &str,
    why: &str,
    scene: &Scene,
    unseen: &Scene,
    options: &[Options; 2],
) -> Result<()> {
    let first = run(scene, &options[0])?;
    let count: usize = first.report.left_out.iter().filter(|l| l.why.contains(why)).map(|l| l.count).sum();
    assert!(count > 0, "{what}: no omission on {scene_name}");
    let mut cells = [(0.0, 0.0, 0); 2];
    for (cell, options) in cells.iter_mut().zip(options) {
        let made = run(scene, options)?;
        let db = errors(&made, unseen)?.psnr_db;
        let times: Vec<f64> =
            (0..RUNS).map(|_| Ok(run(scene, options)?.report.total_ms)).collect::<Result<_>>()?;
        *cell = (db, median(times.into_iter()), made.gaussians.len());
    }
    let [(db, ms, n), (kept_db, kept_ms, kept_n)] = cells;
    println!(
        "| {what} | {scene_name} | {count} | {db:.2} / {kept_db:.2} | {ms:.0} / {kept_ms:.0} | {n} / {kept_n} |"
    );
    Ok(())
}
