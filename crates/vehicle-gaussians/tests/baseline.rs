//! Promises of the baseline, on an ellipsoid with known geometry.

use std::ops::ControlFlow;
use vg::pipeline::{BaselineRun, Method, Reconstruction};
use vg::refine::baseline::BaselineOptions;
use vg::refine::{Amount, Densify, Stop};
use vg::scene::Cloud;
use vg::symmetry::SymmetryMode;
use vg::{Error, Scene};
use vg_testing::vehicle::{HALF, right_side};

fn steps(n: u32) -> BaselineOptions {
    BaselineOptions { amount: Amount::Iterations(n), points: 1_500, ..BaselineOptions::default() }
}

fn options(baseline: BaselineOptions) -> BaselineRun {
    BaselineRun { baseline, threads: 2, ..BaselineRun::default() }
}

fn run(scene: &Scene, options: &BaselineRun) -> Reconstruction {
    Method::from(options.clone()).reconstruct(scene, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn refusal(scene: &Scene, options: &BaselineRun) -> String {
    let made = Method::from(options.clone()).reconstruct(scene, &mut |_| ControlFlow::Continue(()));
    made.unwrap_err().to_string()
}

/// The scene with `n` points of the vehicle's surface, and one far outside.
fn with_cloud(mut scene: Scene, n: usize) -> Scene {
    let point = |i: usize| {
        // A spiral from pole to pole.
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let (turn, radius) = (2.4 * i as f64, (1.0 - z * z).sqrt());
        (HALF * glam::DVec3::new(radius * turn.cos(), radius * turn.sin(), z)).as_vec3().to_array()
    };
    let points = (0..n).map(point).chain([[500.0, 0.0, 0.0]]).collect();
    scene.cloud = Some(Cloud::new(points).unwrap());
    scene
}

#[test]
fn input_views_are_learned_from_a_random_start() {
    let made = run(&right_side(64, 48), &options(steps(600)));
    let report = &made.report;
    let done = report.refinement.as_ref().unwrap();
    assert_eq!((done.iterations, done.made, done.kept, done.stop), (600, 600, 600, Stop::Done));
    assert!(done.psnr_db[0] < 15.0 && done.psnr_db[1] > 28.0, "{:?}", done.psnr_db);
    let densified = done.densified.unwrap();
    assert!(densified.pruned > 0 && densified.cloned + densified.split > 0, "{densified:?}");
    assert_eq!((densified.resets, densified.full), (5, false));
    assert_eq!((report.prior, report.head, report.sh_degree), ("none", "3dgs", 3));
    assert_eq!((report.symmetry.mode, report.symmetry.cloned), (SymmetryMode::Never, 0));
    assert!(report.working_box.is_some() && report.calibration.is_none());
    let checked = report.input_error.unwrap();
    assert!((checked.psnr_db - done.psnr_db[1]).abs() < 0.1, "{checked:?}");
}

#[test]
fn any_number_of_threads_gives_the_same_bytes_and_another_seed_does_not() {
    let scene = right_side(48, 36);
    let of = |threads, seed| {
        run(&scene, &BaselineRun { threads, ..options(BaselineOptions { seed, ..steps(130) }) })
    };
    let (one, four) = (of(1, 0), of(4, 0));
    assert!(one.gaussians == four.gaussians);
    assert_eq!(one.report.refinement, four.report.refinement);
    let densified = one.report.refinement.unwrap().densified.unwrap();
    assert!(densified.cloned > 0 && densified.split > 0 && densified.pruned > 0, "{densified:?}");
    assert!(of(2, 1).gaussians != one.gaussians);
}

#[test]
fn seconds_become_a_number_of_steps_that_can_be_repeated() {
    let scene = right_side(48, 36);
    let made = run(&scene, &options(BaselineOptions { amount: Amount::Seconds(0.6), ..steps(0) }));
    let n = made.report.refinement.as_ref().unwrap().iterations;
    assert!(n >= 8, "{n}");
    assert!(made.gaussians == run(&scene, &options(steps(n))).gaussians, "{n} steps");
}

#[test]
fn there_are_never_more_gaussians_than_allowed() {
    let scene = right_side(48, 36);
    // Every visible Gaussian is to be densified, and none is transparent.
    let densify = Densify { gradient: 0.0, least_opacity: 0.0, most: 1_600, ..Densify::default() };
    let made = run(&scene, &options(BaselineOptions { densify: Some(densify), ..steps(80) }));
    let done = made.report.refinement.unwrap().densified.unwrap();
    assert!(made.gaussians.len() <= 1_600 && done.full, "{} {done:?}", made.gaussians.len());
    let without = run(&scene, &options(BaselineOptions { densify: None, ..steps(80) }));
    assert_eq!(without.gaussians.len(), 1_500);
    assert!(without.report.refinement.unwrap().densified.is_none());
}

#[test]
fn it_starts_from_a_given_cloud() {
    let scene = with_cloud(right_side(64, 48), 2_000);
    let made = run(&scene, &options(steps(0)));
    assert_eq!(made.gaussians.len(), 1_500);
    for m in made.gaussians.means() {
        let on_unit = (glam::Vec3::from_array(*m).as_dvec3() / HALF).length();
        assert!((on_unit - 1.0).abs() < 1e-5, "{m:?}");
    }
    assert!(made.report.working_box.is_none());
    assert!(made.report.left_out.iter().any(|l| l.what == "points" && l.count == 1));
    let learned = run(&scene, &options(steps(200))).report.refinement.unwrap().psnr_db;
    assert!(learned[1] > learned[0] + 3.0, "{learned:?}");
}

#[test]
fn one_view_is_enough() {
    let mut scene = right_side(48, 36);
    scene.views.truncate(1);
    let done = run(&scene, &options(steps(200))).report.refinement.unwrap();
    assert!(done.psnr_db[1] > 25.0, "{:?}", done.psnr_db);
}

#[test]
fn bad_settings_are_refused_by_their_names() {
    let scene = right_side(48, 36);
    let plain = options(steps(1));
    let bad: [(BaselineRun, &str); 7] = [
        (BaselineRun { resolution: 0.0, ..plain.clone() }, "options.resolution: 0; allowed: above 0"),
        (BaselineRun { max_views: Some(0), ..plain.clone() }, "options.max_views: 0; allowed: at least 1"),
        (
            options(BaselineOptions { points: 0, ..steps(1) }),
            "options.baseline.points: 0; allowed: 1 to 300000",
        ),
        (
            options(BaselineOptions { sh_degree: 4, ..steps(1) }),
            "options.baseline.sh_degree: 4; allowed: 0 to 3",
        ),
        (
            options(BaselineOptions { last_means_rate: f32::NAN, ..steps(1) }),
            "options.baseline.last_means_rate: NaN; allowed: above 0",
        ),
        (options(steps(2_000_000)), "options.baseline.iterations: 2000000; allowed: at most 1000000"),
        (
            options(BaselineOptions {
                densify: Some(Densify { gradient: -1.0, ..Densify::default() }),
                ..steps(1)
            }),
            "options.baseline.densify.gradient: -1; allowed: 0 or more",
        ),
    ];
    for (options, expected) in bad {
        let error = refusal(&scene, &options);
        assert!(error.starts_with(expected), "{error}\n{expected}");
    }
    let mut bare = scene.clone();
    bare.views[2].mask = None;
    assert!(refusal(&bare, &plain).contains("mask: none; allowed: a mask"), "{}", refusal(&bare, &plain));
    let mut astray = scene;
    astray.cloud = Some(Cloud::new(vec![[1e30; 3], [900.0, 0.0, 0.0]]).unwrap());
    assert!(refusal(&astray, &plain).starts_with("cloud: no point in any picture"));
}

#[test]
fn a_caller_can_stop_it() {
    let mut losses = Vec::new();
    let method = Method::Baseline(options(steps(1_000)));
    let stopped = method.reconstruct(&right_side(48, 36), &mut |progress| {
        losses.extend(progress.loss);
        if losses.len() > 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(Error::Cancelled { stage: "refine" })));
}
