//! `vg demo`: the whole pipeline on the bundled sample, with pictures.

use crate::args::DemoArgs;
use crate::contact::{self, Tile};
use crate::eval::judge::References;
use crate::eval::measure::{self, Measured, MethodInput};
use crate::eval::split;
use crate::guard::{self, Inputs};
use crate::job::{Failure, Outcome, Result};
use crate::{files, reconstruct, render, sample, scene, shown};
use std::path::{Path, PathBuf};
use vg::View;
use vg::io::{SceneOptions, ply, splats};
use vg::pipeline::{Options, PriorChoice};
use vg::progress::Threads;
use vg::render::{RenderOptions, Rendered};

/// Reconstructs from four photographs of the right side; renders the left side and measures the errors there.
pub(crate) fn run(args: &DemoArgs) -> Result {
    let folder = &args.folder;
    let (scene_folder, unseen) = (folder.join("scene"), folder.join("unseen"));
    let [asset, points, report, sheet] =
        ["asset.ply", "points.ply", "report.json", "contact.png"].map(|name| folder.join(name));
    guard::refuse_clashes(&[&asset, &points, &report, &sheet].map(PathBuf::clone), &Inputs::default())?;
    files::prepare_folder(folder)?;
    sample::write(&scene_folder)?;

    let splits = split::read(&scene_folder.join("split.json"), None)?;
    let split = splits.into_values().next().ok_or_else(|| Failure::job("the sample has no split"))?;
    let names = render::picture_names(split.test.iter().map(String::as_str));
    let pictures: Vec<PathBuf> = names.iter().map(|name| unseen.join(name)).collect();
    guard::refuse_clashes(&pictures, &Inputs::default().scene(&scene_folder))?;
    files::prepare_folder(&unseen)?;
    // Input is photographs, masks and cameras; the sample's depth is only for the comparison below.
    let without_depth = SceneOptions { load_depth: false, ..SceneOptions::default() };
    let shape =
        Options { prior: PriorChoice::Shape, threads: args.threads, points: true, ..Options::default() };
    let threads = Threads::new(args.threads)?;
    let inputs = scene::open(&scene_folder, &split.input, &without_depth, &threads)?;
    let made = reconstruct::reconstruct(&inputs.scene, &shape.clone().into(), &threads)?;

    let tests = scene::open(&scene_folder, &split.test, &without_depth, &threads)?;
    let (drawn, mut measured) = measure::judge(&made.gaussians, &tests.scene.views, &threads)?;
    measured.reconstruct_ms = Some(made.report.total_ms);
    splats::write(&asset, &made.gaussians)?;
    if let Some(cloud) = &made.points {
        ply::write_points(&points, &cloud.positions, &cloud.colors)?;
    }
    files::write_json(&report, &made.report)?;
    let white = RenderOptions::default().background;
    for (path, picture) in pictures.iter().zip(&drawn) {
        render::write(path, picture, white)?;
    }
    let rows = [
        inputs.scene.views.iter().map(photograph).collect(),
        drawn.iter().map(rendered).collect(),
        tests.scene.views.iter().map(photograph).collect::<Vec<_>>(),
    ];
    contact::write(&sheet, &rows)?;

    let given = Options { prior: PriorChoice::Given, ..shape };
    let input = MethodInput::plain(&scene_folder, &without_depth);
    let bound = measure::split(&input, &split, &given.into(), &References::default(), &threads)?;
    Ok(Outcome::done(text(folder, &split, &measured, &bound)))
}

/// The masked photograph on white.
fn photograph(view: &View) -> Tile {
    let pixels = vg::metrics::on_white(view).iter().map(|c| c.map(|v| (v * 255.0).round() as u8)).collect();
    Tile { size: (view.camera.width, view.camera.height), pixels }
}

fn rendered(picture: &Rendered) -> Tile {
    Tile { size: (picture.width, picture.height), pixels: picture.to_rgb8() }
}

/// The main figures and the files written.
fn text(folder: &Path, split: &split::Split, shape: &Measured, given: &Measured) -> String {
    let row = |name: &str, m: &Measured| {
        format!(
            "  {name:<30} {:>7.2} {:>6.3} {:>6.3} {:>9.2} {:>10.1} {:>10}",
            m.errors.psnr_db,
            m.errors.ssim.unwrap_or(f64::NAN),
            m.errors.silhouette_iou,
            m.reconstruct_ms.unwrap_or(f64::NAN) / 1e3,
            m.render_ms,
            shown::count(m.gaussians as usize),
        )
    };
    let written = [
        ("contact.png", "rows: inputs; renders of the unseen side; its photographs"),
        ("unseen", "the renders at full size"),
        ("asset.ply", "the model, for any viewer of 3D Gaussians"),
        ("points.ply", "the metric coloured point cloud of the inputs"),
        ("report.json", "stage times, counts, what was left out and why"),
        ("scene", "the sample itself, for trying the other commands"),
    ];
    let files = written.map(|(name, what)| format!("  {name:<12} {what}"));
    [
        format!(
            "input: {} photographs of the right side; errors against {} photographs of the left side:",
            split.input.len(),
            split.test.len()
        ),
        format!(
            "  {:<30} {:>7} {:>6} {:>6} {:>9} {:>10} {:>10}",
            "depth from", "PSNR dB", "SSIM", "IoU", "time s", "ms/picture", "Gaussians"
        ),
        row("silhouettes (--prior shape)", shape),
        row("the scene (--prior given)", given),
        "The second row uses the true depth of the inputs. Files of the first row,".into(),
        format!("in {}:", shown::path(folder)),
        files.join("\n"),
    ]
    .join("\n")
}
