//! One split of one scene: reconstruct from its inputs, measure in its test views (method section 7).
//!
//! The photograph is composited on white with its mask, the render is drawn on white with its own alpha, and the
//! full frames are compared. A distorted camera's photograph stays on its own grid; the renderer follows it there.

use super::judge::References;
use super::split::Split;
use super::sweep::sweep;
use crate::job::Result;
use crate::{reconstruct, scene};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use vg::io::SceneOptions;
use vg::metrics::{SurfaceErrors, ViewErrors};
use vg::pipeline::{Method, PriorChoice, Verdict};
use vg::progress::Threads;
use vg::render::{CpuRenderer, RenderOptions, Rendered, Renderer};
use vg::scene::Cloud;
use vg::{Error, Gaussians, View};

/// Measurements of one split.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measured {
    /// The depth source that was used.
    pub(crate) prior: String,
    /// Means over the test views.
    #[serde(flatten)]
    pub(crate) errors: ViewErrors,
    /// LPIPS, mean over the test views, where a network for it was given.
    pub(crate) lpips: Option<f64>,
    /// The model's surface against a scan, where there is one.
    pub(crate) surface: Option<SurfaceErrors>,
    /// PSNR in the input views, dB.
    pub(crate) input_psnr_db: Option<f64>,
    /// SSIM in the input views.
    pub(crate) input_ssim: Option<f64>,
    /// Mean absolute depth error in the input views, metres, where they have depth that the method did not use.
    pub(crate) input_depth_mae_m: Option<f64>,
    /// 90th percentile of the depth error in the input views, metres, mean over the views.
    pub(crate) input_depth_p90_m: Option<f64>,
    /// Reconstruction time, milliseconds; `None` for imports without a given time.
    pub(crate) reconstruct_ms: Option<f64>,
    /// Render time of one picture, median over the test views, milliseconds.
    pub(crate) render_ms: f64,
    /// Number of Gaussians in the model.
    pub(crate) gaussians: f64,
    /// The method's own verdict on its input and result, the worst over several splits; `None` for imports.
    pub(crate) verdict: Option<Verdict>,
    /// Each test view.
    pub(crate) views: Vec<MeasuredView>,
}

/// One test view.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct MeasuredView {
    /// Name of the view.
    pub(crate) name: String,
    /// Errors in the view.
    #[serde(flatten)]
    pub(crate) errors: ViewErrors,
    /// LPIPS, where a network for it was given.
    pub(crate) lpips: Option<f64>,
}

/// Data of a vehicle from which a method's input is taken.
pub(crate) struct MethodInput<'a> {
    /// File or folder of the scene.
    pub(crate) scene: &'a Path,
    /// Options with which it is opened.
    pub(crate) options: &'a SceneOptions,
    /// Points measured all around the vehicle.
    pub(crate) cloud: Option<&'a Cloud>,
    /// Number of points to use, of those that the input cameras see; `None` means the whole cloud.
    pub(crate) cloud_points: Option<usize>,
}

impl<'a> MethodInput<'a> {
    /// Input without a cloud.
    pub(crate) fn plain(scene: &'a Path, options: &'a SceneOptions) -> Self {
        Self { scene, options, cloud: None, cloud_points: None }
    }
}

/// Reconstructs and measures once.
pub(crate) fn split(
    from: &MethodInput,
    split: &Split,
    method: &Method,
    judge: &References,
    threads: &Threads,
) -> Result<Measured> {
    let shown = inputs(from, split, method, threads)?;
    let made = reconstruct::reconstruct(&shown, method, threads)?;
    drop(shown);
    let mut measured = model(from, split, &made.gaussians, judge, threads)?;
    measured.prior = made.report.prior.to_owned();
    measured.reconstruct_ms = Some(made.report.total_ms);
    measured.verdict = Some(made.report.verdict);
    if made.report.prior == "given" {
        (measured.input_depth_mae_m, measured.input_depth_p90_m) = (None, None);
    }
    Ok(measured)
}

/// Measures a model of any origin in a split's views.
pub(crate) fn model(
    from: &MethodInput,
    split: &Split,
    made: &Gaussians,
    by: &References,
    threads: &Threads,
) -> Result<Measured> {
    // This depth is for the measurement only; the model is already made.
    let with_depth = SceneOptions { load_depth: true, ..from.options.clone() };
    let judged = scene::open(from.scene, &split.test, &with_depth, threads)?;
    let (drawn_tests, mut measured) = judge(made, &judged.scene.views, threads)?;
    if let Some(lpips) = by.lpips {
        for ((view, drawn), truth) in measured.views.iter_mut().zip(&drawn_tests).zip(&judged.scene.views) {
            view.lpips = threads.run(|| lpips.of(drawn, truth))?;
        }
        measured.lpips = mean_of(measured.views.iter().filter_map(|view| view.lpips));
    }
    drop((drawn_tests, judged));
    if let Some(scan) = &by.scan {
        measured.surface = Some(threads.run(|| SurfaceErrors::of(made, scan.points()))?);
    }
    let judged = scene::open(from.scene, &split.input, &with_depth, threads)?;
    let drawn = drawn(made, &judged.scene.views, threads)?.0;
    let mean = ViewErrors::mean(&errors_of(&drawn, &judged.scene.views, threads));
    measured.input_psnr_db = mean.map(|mean| mean.psnr_db);
    measured.input_ssim = mean.and_then(|mean| mean.ssim);
    measured.input_depth_mae_m = mean.and_then(|mean| mean.depth_mae_m);
    measured.input_depth_p90_m = mean.and_then(|mean| mean.depth_p90_m);
    Ok(measured)
}

/// Repeats the reconstruction and returns its milliseconds.
pub(crate) fn time(from: &MethodInput, split: &Split, method: &Method, threads: &Threads) -> Result<f64> {
    let shown = inputs(from, split, method, threads)?;
    Ok(reconstruct::reconstruct(&shown, method, threads)?.report.total_ms)
}

/// The method's input views, with depth only where the method uses it.
fn inputs(from: &MethodInput, split: &Split, method: &Method, threads: &Threads) -> Result<vg::Scene> {
    let options = SceneOptions { load_depth: method.uses_given_depth(), ..from.options.clone() };
    let mut shown = scene::open(from.scene, &split.input, &options, threads)?.scene;
    shown.cloud = match (from.cloud, from.cloud_points) {
        (Some(cloud), Some(count)) => Some(Cloud::new(sweep(cloud.points(), &shown.views, count))?),
        (cloud, _) => cloud.cloned(),
    };
    let is_auto = method.vehicle().is_some_and(|options| options.prior == PriorChoice::Auto);
    if is_auto && shown.views.iter().any(|v| v.depth.is_none()) {
        shown.views.iter_mut().for_each(|view| view.depth = None);
    }
    Ok(shown)
}

/// Renders the model into these views and measures the errors against their photographs.
pub(crate) fn judge(
    made: &Gaussians,
    views: &[View],
    threads: &Threads,
) -> Result<(Vec<Rendered>, Measured)> {
    let (drawn, render_ms) = drawn(made, views, threads)?;
    let each = errors_of(&drawn, views, threads);
    let none = || Error::argument("test", "no view", "at least one view");
    let measured = Measured {
        prior: String::new(),
        lpips: None,
        surface: None,
        errors: ViewErrors::mean(&each).ok_or_else(none)?,
        input_psnr_db: None,
        input_ssim: None,
        input_depth_mae_m: None,
        input_depth_p90_m: None,
        reconstruct_ms: None,
        render_ms,
        gaussians: made.len() as f64,
        verdict: None,
        views: views
            .iter()
            .zip(each)
            .map(|(v, errors)| MeasuredView { name: v.name.clone(), errors, lpips: None })
            .collect(),
    };
    Ok((drawn, measured))
}

fn errors_of(drawn: &[Rendered], views: &[View], threads: &Threads) -> Vec<ViewErrors> {
    threads.run(|| drawn.iter().zip(views).map(|(d, v)| ViewErrors::of(d, v)).collect())
}

/// Renders of the model on white from these views' cameras, and the median time of one picture, milliseconds.
fn drawn(gaussians: &Gaussians, views: &[View], threads: &Threads) -> Result<(Vec<Rendered>, f64)> {
    let (renderer, options) = (CpuRenderer::new(), RenderOptions::default());
    // The first picture also allocates the memory that later ones reuse: it is not timed.
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

/// Median: the mean of the middle two for an even number of values, 0 for no values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

/// Means over several splits; `None` for no splits.
pub(crate) fn mean(all: &[&Measured]) -> Option<Measured> {
    let errors: Vec<ViewErrors> = all.iter().map(|m| m.errors).collect();
    let errors = ViewErrors::mean(&errors)?;
    let of = |get: fn(&Measured) -> f64| mean_of(all.iter().map(|m| get(m)));
    let same_prior = all.iter().all(|m| m.prior == all[0].prior);
    Some(Measured {
        prior: if same_prior { all[0].prior.clone() } else { "mixed".into() },
        errors,
        lpips: mean_of(all.iter().filter_map(|m| m.lpips)),
        surface: SurfaceErrors::mean(&all.iter().filter_map(|m| m.surface).collect::<Vec<_>>()),
        input_psnr_db: mean_of(all.iter().filter_map(|m| m.input_psnr_db)),
        input_ssim: mean_of(all.iter().filter_map(|m| m.input_ssim)),
        input_depth_mae_m: mean_of(all.iter().filter_map(|m| m.input_depth_mae_m)),
        input_depth_p90_m: mean_of(all.iter().filter_map(|m| m.input_depth_p90_m)),
        reconstruct_ms: mean_of(all.iter().filter_map(|m| m.reconstruct_ms)),
        render_ms: of(|m| m.render_ms)?,
        gaussians: of(|m| m.gaussians)?.round(),
        verdict: all.iter().filter_map(|m| m.verdict).max(),
        views: Vec::new(),
    })
}

/// Mean of the values; `None` for no values.
fn mean_of(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    (n > 0.0).then(|| sum / n)
}
