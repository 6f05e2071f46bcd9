//! A scene's picture and gradients in f32 against f64, and the f64 gradients against central differences.

use crate::cases::{self, Case, DIFFERENCES, RESOLUTION};
use std::sync::OnceLock;
use std::time::Instant;
use vg::render::reference::Parameters;
use vg::render::{CpuRenderer, PictureGradient, Reference};
use vg_testing::Random;
use vg_testing::gradients::{
    all_finite, difference, largest, largest_of, noise, of_variable, sampled, tensors,
};
use vg_testing::is_finite;

/// Largest error and root of the mean square.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Error {
    pub max: f64,
    pub rms: f64,
}

/// What was found of a case.
#[derive(Clone, Debug)]
pub(crate) struct Figures {
    pub finite: bool,
    pub drawn: bool,
    /// Of the largest colour, at least 1.
    pub color: Error,
    pub alpha: Error,
    /// Of the depth itself.
    pub depth: Error,
    /// Of the largest in its tensor, over all tensors; and which.
    pub gradient: (f64, &'static str),
    /// Of the f64 gradient against central differences, likewise.
    pub differences: (f64, &'static str),
    /// Of a picture with its gradients, f32.
    pub ms: f64,
}

fn error(found: impl Iterator<Item = f64>) -> Error {
    let (mut max, mut squares, mut n) = (0.0f64, 0.0, 0);
    for e in found {
        // NaN stays.
        max = if e.abs() > max || e.is_nan() { e.abs() } else { max };
        squares += e * e;
        n += 1;
    }
    Error { max, rms: (squares / f64::from(n)).sqrt() }
}

/// Of every case, measured once.
pub(crate) fn all() -> &'static [Figures] {
    static FIGURES: OnceLock<Vec<Figures>> = OnceLock::new();
    FIGURES.get_or_init(|| cases::all().iter().map(measure).collect())
}

fn measure(case: &Case) -> Figures {
    let Case { gaussians, camera, options, .. } = case;
    let gradient = weights(case);
    let renderer = CpuRenderer::new();
    let run =
        || renderer.render_with_gradients(gaussians, camera, options, |_| Ok(gradient.clone())).unwrap();
    let (picture, found) = run();
    let begin = Instant::now();
    run();
    let ms = begin.elapsed().as_secs_f64() * 1e3;

    let exact = Reference.render_f64(gaussians, camera, options).unwrap();
    let scale = largest(exact.color.as_flattened()).max(1.0);
    let colors = picture.color.as_flattened().iter().zip(exact.color.as_flattened());
    let alphas = picture.alpha.iter().zip(&exact.alpha);
    let depths = picture.depth.iter().zip(&exact.depth);
    let of_itself = |(a, e): (&f32, &f64)| if *e == 0.0 { f64::from(*a) } else { f64::from(*a) / e - 1.0 };

    let of_exact = Reference.backward_f64(gaussians, camera, options, &gradient).unwrap();
    let mut worst = (0.0, "-");
    for (name, found, exact) in tensors(&found, &of_exact, camera) {
        let error: Vec<f64> = found.iter().zip(&exact).map(|(a, b)| a - b).collect();
        let (error, scale) = (largest(&error), largest(&exact));
        let relative = if scale == 0.0 { error } else { error / scale };
        worst = if relative > worst.0 { (relative, name) } else { worst };
    }
    Figures {
        finite: is_finite(&picture) && all_finite(&found),
        drawn: picture.alpha.iter().any(|a| *a > 0.0),
        color: error(colors.map(|(a, e)| (f64::from(*a) - e) / scale)),
        alpha: error(alphas.map(|(a, e)| f64::from(*a) - e)),
        depth: error(depths.map(of_itself)),
        gradient: worst,
        differences: differences(case),
        ms,
    }
}

/// Gradient of the loss: noise on the planes that it looks at.
fn weights(case: &Case) -> PictureGradient {
    let mut out = noise(1, &case.camera);
    if !case.depth_in_loss {
        out.depth.clear();
    }
    out
}

/// The f64 gradients against central differences with the cuts held, two variables of each tensor.
fn differences(case: &Case) -> (f64, &'static str) {
    let Case { gaussians, camera, options, step, .. } = case;
    let gradient = weights(case);
    let g = Reference.backward_f64(gaussians, camera, options, &gradient).unwrap();
    let p = Parameters::new(gaussians, camera, options).unwrap();
    let cuts = Reference.cuts(&p, options);
    let mut worst = (0.0, "-");
    // Half as many where each costs a second.
    let variables = if gaussians.len() < 100_000 { 14 } else { 7 };
    for (tensor, v) in sampled(&mut Random::new(7), gaussians).into_iter().take(variables) {
        let scale = largest_of(&g, tensor);
        let found = difference(&p, v, options, &cuts, &gradient, *step);
        let error = (found - of_variable(&g, v)).abs();
        let relative = error / scale.max(RESOLUTION / step);
        worst = if relative > worst.0 { (relative, tensor) } else { worst };
    }
    worst
}

#[test]
fn every_stiff_scene_is_finite_and_as_near_to_f64_as_is_promised() {
    let mut failures = Vec::new();
    for (case, f) in cases::all().iter().zip(all()) {
        println!("{:45} {f:?}", case.condition);
        let kept = [
            ("finite", f.finite),
            ("drawn", f.drawn == case.drawn),
            ("colour", f.color.max <= case.picture),
            ("alpha", f.alpha.max <= case.picture),
            ("depth", f.depth.max <= case.depth),
            ("gradient", f.gradient.0 <= case.gradient),
            ("differences", f.differences.0 <= DIFFERENCES),
        ];
        let broken: Vec<&str> = kept.iter().filter(|(_, kept)| !kept).map(|(name, _)| *name).collect();
        if !broken.is_empty() {
            failures.push(format!("{}: {broken:?} {f:?}", case.condition));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
