//! The bundled sample, and the errors of a reconstruction on its unseen side.

use std::ops::ControlFlow;
use vg::io::{SceneOptions, open_scene};
use vg::metrics::ViewErrors;
use vg::pipeline::{Options, Reconstruction, reconstruct};
use vg::render::{CpuRenderer, RenderOptions, Renderer};
use vg::{Result, Scene};

/// The four views of the right side.
pub const INPUTS: [&str; 4] = ["000", "001", "002", "003"];

/// The four views of the left side.
pub const UNSEEN: [&str; 4] = ["004", "005", "006", "007"];

/// Opens views of the sample, with or without their measured depth.
pub fn open(names: &[&str], load_depth: bool) -> Result<Scene> {
    let folder = crate::root().join("tests/data/sedan");
    let views = Some(names.iter().map(ToString::to_string).collect());
    open_scene(&folder, &SceneOptions { views, load_depth, ..SceneOptions::default() }).map(|s| s.scene)
}

pub fn run(scene: &Scene, options: &Options) -> Result<Reconstruction> {
    reconstruct(scene, options, &mut |_| ControlFlow::Continue(()))
}

/// Mean errors of the model in the views of `tests`.
pub fn errors(made: &Reconstruction, tests: &Scene) -> Result<ViewErrors> {
    let renderer = CpuRenderer::new();
    let errors: Vec<ViewErrors> = tests
        .views
        .iter()
        .map(|view| {
            let drawn = renderer.render(&made.gaussians, &view.camera, &RenderOptions::default())?;
            Ok(ViewErrors::of(&drawn, view))
        })
        .collect::<Result<_>>()?;
    Ok(ViewErrors::mean(&errors).expect("at least one view"))
}

pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
