//! Measures a scene's picture and gradients in f32 against f64, and the f64 gradients against central differences.

use crate::cases::{self, Case, DIFFERENCES, RESOLUTION};
use std::sync::OnceLock;
use std::time::Instant;
use vg::render::reference::Parameters;
use vg::render::{CpuRenderer, PictureGradient, Reference};
use vg_testing::gradients::{
    all_finite, difference, gradient_entry, largest, largest_of, noise, sampled, tensors,
};
use vg_testing::{Random, is_finite};

/// Largest and root mean square error.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Error {
    pub max: f64,
    pub rms: f64,
}

/// Results for a case.
#[derive(Clone, Debug)]
pub(crate) struct Figures {
    pub finite: bool,
    pub drawn: bool,
    /// Relative to the largest colour, at least 1.
    pub color: Error,
    pub alpha: Error,
    /// Relative to the depth itself.
    pub depth: Error,
    /// Relative to the largest entry of its tensor, over all tensors; and the name of the worst tensor.
    pub gradient: (f64, &'static str),
    /// Error of the f64 gradient against central differences, in the same form.
    pub differences: (f64, &'static str),
    /// Time of a picture with its gradients, f32.
    pub ms: f64,
}

fn error(found: impl Iterator<Item = f64>) -> Error {
    let (mut max, mut squares, mut n) = (0.0f64, 0.0, 0);
    for e in found {
        // Keeps NaN.
        max = if e.abs() > max || e.is_nan() { e.abs() } else { max };
        squares += e * e;
        n += 1;
    }
    Error { max, rms: (squares / f64::from(n)).sqrt() }
}

/// Results for every case, measured once.
pub fn all() -> &'static [Figures] {
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
    let relative = |(a, e): (&f32, &f64)| if *e == 0.0 { f64::from(*a) } else { f64::from(*a) / e - 1.0 };

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
        depth: error(depths.map(relative)),
        gradient: worst,
        differences: differences(case),
        ms,
    }
}

/// Gradient of the loss: random weights on the planes that it depends on.
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
    // Half as many if each takes a second.
    let variables = if gaussians.len() < 100_000 { 14 } else { 7 };
    for (tensor, v) in sampled(&mut Random::new(7), gaussians).into_iter().take(variables) {
        let scale = largest_of(&g, tensor);
        let found = difference(&p, v, options, &cuts, &gradient, *step);
        let error = (found - gradient_entry(&g, v)).abs();
        let relative = error / scale.max(RESOLUTION / step);
        worst = if relative > worst.0 { (relative, tensor) } else { worst };
    }
    worst
}

#[test]
fn every_stiff_scene_is_finite_and_within_its_bound_of_f64() {
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
