//! Promises of per-scene refinement, on an ellipsoid with known geometry.

use std::ops::ControlFlow;
use vg::metrics::ViewErrors;
use vg::pipeline::{Calibrate, Options, PriorChoice, Reconstruction, reconstruct};
use vg::progress::Threads;
use vg::refine::{self, Amount, Densify, Rates, RefineOptions, Stop};
use vg::relight::Relight;
use vg::render::{CpuRenderer, RenderOptions, Renderer};
use vg::symmetry::SymmetryMode;
use vg::{Error, Gaussians, Scene};
use vg_testing::vehicle::{HALF, right_side, without_depth};

fn options(refine: RefineOptions) -> Options {
    Options {
        prior: PriorChoice::Given,
        symmetry: SymmetryMode::Always,
        relight: Relight::Never,
        calibrate: Calibrate::Off,
        refine: Some(refine),
        threads: 2,
        ..Options::default()
    }
}

fn steps(n: u32) -> RefineOptions {
    RefineOptions { amount: Amount::Iterations(n), ..RefineOptions::default() }
}

fn run(scene: &Scene, options: &Options) -> Reconstruction {
    reconstruct(scene, options, &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn pictures_improve_and_both_sides_stay_mirror_images() {
    let scene = right_side(96, 72);
    let made = run(&scene, &options(steps(60)));
    let done = made.report.refinement.as_ref().unwrap();
    assert_eq!((done.iterations, done.made, done.stop), (60, 60, Stop::Done));
    assert!(done.psnr_db[1] > done.psnr_db[0] + 1.0, "{:?}", done.psnr_db);
    assert!(done.loss[1] < done.loss[0]);
    let (g, n) = (&made.gaussians, made.gaussians.len() / 2);
    for i in 0..n {
        let [x, y, z] = g.means()[i];
        assert_eq!(g.means()[n + i], [x, -y, z]);
        assert_eq!((g.scales()[n + i], g.opacities()[n + i]), (g.scales()[i], g.opacities()[i]));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes_and_zero_steps_change_almost_nothing() {
    let scene = right_side(64, 48);
    let of = |threads: usize| run(&scene, &Options { threads, ..options(steps(12)) });
    let (one, two, five) = (of(1), of(2), of(5));
    assert!(one.gaussians == two.gaussians && two.gaussians == five.gaussians);
    assert_eq!(one.report.refinement, five.report.refinement);
    let plain = run(&scene, &Options { refine: None, ..options(steps(0)) });
    let none = run(&scene, &options(steps(0)));
    assert_eq!(plain.gaussians.means(), none.gaussians.means());
    assert!(plain.report.refinement.is_none() && none.report.refinement.unwrap().kept == 0);
}

#[test]
fn seconds_become_a_number_of_steps_that_can_be_repeated() {
    let scene = right_side(64, 48);
    let timed = RefineOptions { amount: Amount::Seconds(0.3), ..RefineOptions::default() };
    let made = run(&scene, &options(timed));
    let n = made.report.refinement.as_ref().unwrap().iterations;
    assert!(n >= 8, "{n}");
    let again = run(&scene, &options(steps(n)));
    assert!(made.gaussians == again.gaussians, "{n} steps");
}

#[test]
fn a_held_out_view_determines_when_to_stop() {
    let scene = right_side(64, 48);
    let held = RefineOptions { hold_out: true, ..steps(40) };
    let made = run(&scene, &options(held));
    let done = made.report.refinement.unwrap();
    let view = done.held_out.unwrap();
    assert_eq!(view.view, scene.views[2].name);
    assert!(view.psnr_db[1] >= view.psnr_db[0], "{:?}", view.psnr_db);
    // With two views, neither is held out.
    let two = Scene { views: scene.views[..2].to_vec(), ..Scene::default() };
    assert!(run(&two, &options(held)).report.refinement.unwrap().held_out.is_none());
}

#[test]
fn densified_gaussians_keep_their_mirror_images() {
    let scene = right_side(64, 48);
    // Every visible Gaussian is to be densified.
    let densify = Some(Densify { gradient: 0.0, most: 9_000, ..Densify::for_refinement() });
    let of =
        |threads: usize| run(&scene, &Options { threads, ..options(RefineOptions { densify, ..steps(60) }) });
    let made = of(2);
    assert!(made.gaussians == of(3).gaussians);
    let done = made.report.refinement.as_ref().unwrap().densified.unwrap();
    assert!(done.split > 0 && done.resets == 0, "{done:?}");
    let (g, n) = (&made.gaussians, made.gaussians.len() / 2);
    assert!(g.len() <= 9_000 && g.len() > made.report.symmetry.cloned, "{}", g.len());
    for i in 0..n {
        let [x, y, z] = g.means()[i];
        assert_eq!(g.means()[n + i], [x, -y, z]);
        assert_eq!((g.scales()[n + i], g.opacities()[n + i]), (g.scales()[i], g.opacities()[i]));
    }
}

#[test]
fn far_too_large_steps_give_finite_results_and_a_reason() {
    let scene = right_side(64, 48);
    let times = |factor: f32| {
        let RefineOptions { rates, .. } = RefineOptions::default();
        Rates {
            means: factor * rates.means,
            rotations: factor * rates.rotations,
            scales: factor * rates.scales,
            opacities: factor * rates.opacities,
            colors: factor * rates.colors,
            view_dependence: factor * rates.view_dependence,
            exposure: factor * rates.exposure,
        }
    };
    for (factor, diverges) in [(3.0, false), (100.0, true)] {
        let made = run(&scene, &options(RefineOptions { rates: times(factor), ..steps(60) }));
        let done = made.report.refinement.unwrap();
        assert_eq!(done.stop == Stop::Diverged, diverges, "{factor}: {done:?}");
        assert!(done.psnr_db[1] >= done.psnr_db[0], "{factor}: {done:?}");
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        let g = &made.gaussians;
        assert!(finite(g.means().as_flattened()) && finite(g.scales().as_flattened()) && finite(g.sh()));
    }
}

#[test]
fn exposures_are_estimated() {
    // The second photograph is darker than the others by a quarter.
    let mut scene = right_side(96, 72);
    let darker = |rgb: &[u8; 3]| rgb.map(|c| (f32::from(c) * 0.75).round() as u8);
    let image = &scene.views[1].image;
    let pixels = image.pixels().iter().map(darker).collect();
    scene.views[1].image = vg::scene::RgbImage::new(image.width(), image.height(), pixels).unwrap();
    let exposures = |exposure: bool| {
        let made = run(&scene, &options(RefineOptions { exposure, ..steps(200) }));
        made.report.refinement.unwrap()
    };
    let (with, without) = (exposures(true), exposures(false));
    let others = [0, 2, 3].map(|v| with.exposures[v][1]).iter().sum::<f32>() / 3.0;
    let ratio = with.exposures[1][1] / others;
    assert!((0.68..0.85).contains(&ratio), "{ratio}: {:?}", with.exposures);
    assert!(without.exposures.iter().flatten().all(|e| *e == 1.0));
    assert!(with.psnr_db[1] > without.psnr_db[1], "{:?} {:?}", with.psnr_db, without.psnr_db);
}

#[test]
fn silhouettes_alone_can_be_refined() {
    let scene = without_depth(right_side(64, 48));
    let iou = |n: u32| {
        let hull = Options { prior: PriorChoice::Hull, ..options(steps(n)) };
        run(&scene, &hull).report.input_error.unwrap().silhouette_iou
    };
    let (before, after) = (iou(0), iou(40));
    assert!(after > before + 0.002, "{before} {after}");
}

#[test]
fn without_masks_the_background_has_no_effect() {
    let mut scene = right_side(96, 72);
    scene.views.iter_mut().for_each(|view| view.mask = None);
    let made = run(&scene, &options(steps(40)));
    let done = made.report.refinement.unwrap();
    assert!(done.psnr_db[1] > done.psnr_db[0], "{:?}", done.psnr_db);
    let (low, high) = made.gaussians.bounds().unwrap();
    for (k, half) in HALF.to_array().into_iter().enumerate() {
        let size = f64::from(high[k] - low[k]);
        // The outline of the depth is the mask, and its edge is dropped: two pixels of 7 cm each on both sides.
        assert!((2.0 * half - 0.32..2.0 * half + 0.03).contains(&size), "axis {k}: {size} of {}", 2.0 * half);
    }
}

#[test]
fn mirrored_photographs_refine_both_sides() {
    let scene = right_side(64, 48);
    let flip = Options { symmetry: SymmetryMode::Flip, ..options(steps(16)) };
    let done = run(&scene, &flip).report.refinement.unwrap();
    assert_eq!(done.exposures.len(), 8);
    assert!(done.psnr_db[1] > done.psnr_db[0], "{:?}", done.psnr_db);
}

#[test]
fn a_model_from_anywhere_is_refined_on_given_threads_and_improves_in_every_view() {
    let scene = right_side(64, 48);
    let given = run(&scene, &Options { refine: None, ..options(steps(0)) }).gaussians;
    let threads = Threads::new(2).unwrap();
    let (refined, done) =
        refine::model_on(&threads, &given, &scene, &steps(40), &mut |_| ControlFlow::Continue(())).unwrap();
    let (own, _) = refine::model(&given, &scene, &steps(40), 3, &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(refined == own && done.made == 40);
    let errors = |model: &Gaussians| ViewErrors::of_scene(model, &scene, &threads).unwrap();
    let (before, after) = (errors(&given), errors(&refined));
    assert_eq!((before.len(), after.len()), (scene.views.len(), scene.views.len()));
    assert!(before.iter().zip(&after).all(|(b, a)| a.psnr_db > b.psnr_db), "{before:?} {after:?}");
    let view = &scene.views[2];
    let drawn = CpuRenderer::new().render(&refined, &view.camera, &RenderOptions::default()).unwrap();
    assert_eq!(after[2], ViewErrors::of(&drawn, view));
    assert!(ViewErrors::of_scene(&refined, &Scene::default(), &threads).is_err());
}

#[test]
fn invalid_options_are_refused_by_name() {
    let scene = right_side(48, 36);
    let bad: [(RefineOptions, &str); 5] = [
        (steps(2_000_000), "options.refine.iterations: 2000000; allowed: at most 1000000"),
        (
            RefineOptions { amount: Amount::Seconds(f64::NAN), ..steps(0) },
            "options.refine.seconds: NaN; allowed: above 0",
        ),
        (RefineOptions { amount: Amount::Seconds(0.0), ..steps(0) }, "options.refine.seconds: 0; allowed"),
        (RefineOptions { silhouette: -1.0, ..steps(1) }, "options.refine.silhouette: -1; allowed: 0 to 1"),
        (
            RefineOptions {
                rates: Rates { scales: f32::INFINITY, ..RefineOptions::default().rates },
                ..steps(1)
            },
            "options.refine.rates.scales: inf; allowed: 0 to 10",
        ),
    ];
    for (refine, expected) in bad {
        let error = reconstruct(&scene, &options(refine), &mut |_| ControlFlow::Continue(())).unwrap_err();
        assert!(error.to_string().starts_with(expected), "{error}\n{expected}");
    }
}

#[test]
fn a_caller_can_stop_it() {
    let scene = right_side(48, 36);
    let mut losses = Vec::new();
    let stopped = reconstruct(&scene, &options(steps(1000)), &mut |progress| {
        losses.extend(progress.loss);
        if losses.len() > 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(Error::Cancelled { stage: "refine" })));
}
