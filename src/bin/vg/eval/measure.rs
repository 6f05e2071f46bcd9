//! One split of one scene: reconstruct from its inputs, measure in its test views (method section 7).
//!
//! The photograph is composited on white with its mask, the render is drawn on white with its own alpha, and the
//! full frames are compared. A distorted camera's photograph stays on its own grid; the renderer follows it there.

use super::split::Split;
use super::sweep::sweep;
use crate::job::Result;
use crate::{reconstruct, scene};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use vg::io::SceneOptions;
use vg::metrics::ViewErrors;
use vg::pipeline::{Options, PriorChoice, Reconstruction};
use vg::progress::Threads;
use vg::render::{CpuRenderer, RenderOptions, Rendered, Renderer};
use vg::scene::Cloud;
use vg::{Error, Gaussians, View};

/// The numbers of one split.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measured {
    /// The depth source that was used.
    pub(crate) prior: String,
    /// Means over the test views.
    #[serde(flatten)]
    pub(crate) errors: ViewErrors,
    /// PSNR in the input views, dB.
    pub(crate) input_psnr_db: Option<f64>,
    /// SSIM there.
    pub(crate) input_ssim: Option<f64>,
    /// Depth error in the input views, metres, where they have depth that the method was not shown.
    pub(crate) input_depth_mae_m: Option<f64>,
    /// The 90th percentile there, metres, mean over the views.
    pub(crate) input_depth_p90_m: Option<f64>,
    /// Median over the repeats, milliseconds.
    pub(crate) reconstruct_ms: f64,
    /// Median over the test views, milliseconds.
    pub(crate) render_ms: f64,
    /// In the model.
    pub(crate) gaussians: f64,
    /// Each test view.
    pub(crate) views: Vec<MeasuredView>,
}

/// One test view.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct MeasuredView {
    /// The view.
    pub(crate) name: String,
    /// Its numbers.
    #[serde(flatten)]
    pub(crate) errors: ViewErrors,
}

/// What there is to show to the method.
pub(crate) struct Shown<'a> {
    /// File or folder of the scene.
    pub(crate) scene: &'a Path,
    /// How it is opened.
    pub(crate) options: &'a SceneOptions,
    /// Points measured on the vehicle, all round it.
    pub(crate) cloud: Option<&'a Cloud>,
    /// How many of them are shown, of those that the input cameras see; all of the cloud without.
    pub(crate) cloud_points: Option<usize>,
}

/// Reconstructs `repeat` times and measures once.
pub(crate) fn split(from: &Shown, split: &Split, method: &Options, repeat: u32) -> Result<Measured> {
    let (path, options) = (from.scene, from.options);
    let shown = inputs(from, split, method)?;
    let made = reconstruct::reconstruct(&shown, method)?;
    let mut times = vec![made.report.total_ms];
    for _ in 1..repeat {
        times.push(reconstruct::reconstruct(&shown, method)?.report.total_ms);
    }
    drop(shown);
    // Depth of the test views is for the measure only.
    let with_depth = SceneOptions { load_depth: true, ..options.clone() };
    let judged = scene::open(path, &split.test, &with_depth)?;
    let (_, mut measured) = judge(&made, &judged.scene.views, method.threads)?;
    measured.reconstruct_ms = median(&mut times);
    // Opened again with depth, for this measure only: the prior has done its work without.
    let judged = scene::open(path, &split.input, &with_depth)?;
    let drawn = drawn(&made.gaussians, &judged.scene.views, method.threads)?.0;
    let errors: Vec<_> = drawn.iter().zip(&judged.scene.views).map(|(d, v)| ViewErrors::of(d, v)).collect();
    let mean = ViewErrors::mean(&errors);
    measured.input_psnr_db = mean.map(|mean| mean.psnr_db);
    measured.input_ssim = mean.and_then(|mean| mean.ssim);
    if made.report.prior != "given" {
        measured.input_depth_mae_m = mean.and_then(|mean| mean.depth_mae_m);
        measured.input_depth_p90_m = mean.and_then(|mean| mean.depth_p90_m);
    }
    Ok(measured)
}

/// Milliseconds of one more reconstruction of the same.
pub(crate) fn time(from: &Shown, split: &Split, method: &Options) -> Result<f64> {
    Ok(reconstruct::reconstruct(&inputs(from, split, method)?, method)?.report.total_ms)
}

/// The views the method sees, with depth only where it is to use it.
fn inputs(from: &Shown, split: &Split, method: &Options) -> Result<vg::Scene> {
    let load_depth =
        matches!(method.prior, PriorChoice::Auto | PriorChoice::Given) && method.baseline.is_none();
    let options = SceneOptions { load_depth, ..from.options.clone() };
    let mut shown = scene::open(from.scene, &split.input, &options)?.scene;
    shown.cloud = match (from.cloud, from.cloud_points) {
        (Some(cloud), Some(count)) => Some(Cloud::new(sweep(cloud.points(), &shown.views, count))?),
        (cloud, _) => cloud.cloned(),
    };
    if method.prior == PriorChoice::Auto && shown.views.iter().any(|v| v.depth.is_none()) {
        shown.views.iter_mut().for_each(|view| view.depth = None);
    }
    Ok(shown)
}

/// The model drawn into these views, and how far that is from their photographs.
pub(crate) fn judge(
    made: &Reconstruction,
    views: &[View],
    threads: usize,
) -> Result<(Vec<Rendered>, Measured)> {
    let (drawn, render_ms) = drawn(&made.gaussians, views, threads)?;
    let each: Vec<ViewErrors> = drawn.iter().zip(views).map(|(d, v)| ViewErrors::of(d, v)).collect();
    let none = || Error::argument("test", "no view", "at least one");
    let measured = Measured {
        prior: made.report.prior.to_owned(),
        errors: ViewErrors::mean(&each).ok_or_else(none)?,
        input_psnr_db: made.report.input_error.map(|error| error.psnr_db),
        input_ssim: None,
        input_depth_mae_m: None,
        input_depth_p90_m: None,
        reconstruct_ms: made.report.total_ms,
        render_ms,
        gaussians: made.gaussians.len() as f64,
        views: views
            .iter()
            .zip(each)
            .map(|(v, errors)| MeasuredView { name: v.name.clone(), errors })
            .collect(),
    };
    Ok((drawn, measured))
}

/// The model as these views' cameras see it, on white, and the median time of one picture, milliseconds.
fn drawn(gaussians: &Gaussians, views: &[View], threads: usize) -> Result<(Vec<Rendered>, f64)> {
    let threads = Threads::new(threads)?;
    let (renderer, options) = (CpuRenderer::new(), RenderOptions::default());
    // The first picture also pays for memory that later ones reuse.
    if let Some(first) = views.first() {
        threads.run(|| renderer.render(gaussians, &first.camera, &options))?;
    }
    let mut times = Vec::with_capacity(views.len());
    let mut pictures = Vec::with_capacity(views.len());
    for view in views {
        let start = Instant::now();
        pictures.push(threads.run(|| renderer.render(gaussians, &view.camera, &options))?);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok((pictures, median(&mut times)))
}

/// Of an even number of values the mean of the middle two; of none 0.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

/// Means over several splits; `None` of nothing.
pub(crate) fn mean(all: &[&Measured]) -> Option<Measured> {
    let errors: Vec<ViewErrors> = all.iter().map(|m| m.errors).collect();
    let errors = ViewErrors::mean(&errors)?;
    let mean = |values: Vec<f64>| {
        let n = values.len();
        (n > 0).then(|| values.iter().sum::<f64>() / n as f64)
    };
    let of = |get: fn(&Measured) -> f64| mean(all.iter().map(|m| get(m)).collect());
    let same_prior = all.iter().all(|m| m.prior == all[0].prior);
    Some(Measured {
        prior: if same_prior { all[0].prior.clone() } else { "mixed".into() },
        errors,
        input_psnr_db: mean(all.iter().filter_map(|m| m.input_psnr_db).collect()),
        input_ssim: mean(all.iter().filter_map(|m| m.input_ssim).collect()),
        input_depth_mae_m: mean(all.iter().filter_map(|m| m.input_depth_mae_m).collect()),
        input_depth_p90_m: mean(all.iter().filter_map(|m| m.input_depth_p90_m).collect()),
        reconstruct_ms: of(|m| m.reconstruct_ms)?,
        render_ms: of(|m| m.render_ms)?,
        gaussians: of(|m| m.gaussians)?.round(),
        views: Vec::new(),
    })
}
