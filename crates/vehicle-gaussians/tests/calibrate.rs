//! Self-calibration: known errors of the plane and of cameras are corrected, exact cameras are unchanged, and excessive
//! errors are refused.

use glam::{DMat3, DQuat, DVec3};
use std::ops::ControlFlow;
use vg::calibrate::{Calibration, Verdict};
use vg::geometry::Pose;
use vg::pipeline::{Calibrate, Options, PriorChoice, Reconstruction, reconstruct};
use vg::scene::Mask;
use vg::scene::mask::Label;
use vg::{Error, Scene};
use vg_testing::sample::{INPUTS, UNSEEN, errors, open, run};
use vg_testing::vehicle::{camera, view, without_depth};

fn options(calibrate: Calibrate) -> Options {
    Options { prior: PriorChoice::Hull, calibrate, check: false, threads: 2, ..Options::default() }
}

fn both(scene: &Scene) -> [Reconstruction; 2] {
    [Calibrate::Off, Calibrate::Auto].map(|calibrate| run(scene, &options(calibrate)).unwrap())
}

fn calibration(made: &Reconstruction) -> &Calibration {
    made.report.calibration.as_ref().unwrap()
}

/// All cameras of a scene, moved by the error of a detector.
fn plane_moved(mut scene: Scene, yaw_degrees: f64, lateral_m: f64) -> Scene {
    let rotation = DMat3::from_rotation_z(yaw_degrees.to_radians());
    let moved = Pose { rotation, translation: DVec3::new(0.0, lateral_m, 0.0) };
    for view in &mut scene.views {
        view.camera.vehicle_from_camera = moved.after(&view.camera.vehicle_from_camera);
    }
    scene
}

/// Every camera independently: 0.3 degrees and 3 cm about every axis, one sigma.
fn jittered(mut scene: Scene, seed: u64) -> Scene {
    let mut random = vg_testing::Random::new(seed);
    for view in &mut scene.views {
        let mut sigma = |s: f64| DVec3::new(random.normal(), random.normal(), random.normal()) * s;
        let turn = DQuat::from_scaled_axis(sigma(0.3f64.to_radians()));
        let pose = &mut view.camera.vehicle_from_camera;
        pose.rotation *= DMat3::from_quat(turn);
        pose.translation += sigma(0.03);
    }
    scene
}

fn with_mask(scene: &mut Scene, i: usize, label: impl Fn(u32, u32, Label) -> Label) {
    let mask = scene.views[i].mask.as_ref().unwrap();
    let (w, h) = (mask.width(), mask.height());
    let labels = mask.labels().iter().enumerate();
    let labels = labels.map(|(k, l)| label(k as u32 % w, k as u32 / w, *l)).collect();
    scene.views[i].mask = Some(Mask::new(w, h, labels).unwrap());
}

#[test]
fn a_plane_two_degrees_and_five_centimetres_off_is_found_and_the_unseen_side_gains() {
    for (yaw, lateral) in [(2.0, 0.05), (-2.0, 0.05)] {
        let input = plane_moved(open(&INPUTS, false).unwrap(), yaw, lateral);
        let unseen = plane_moved(open(&UNSEEN, false).unwrap(), yaw, lateral);
        let made = both(&input);
        let found = calibration(&made[1]);
        assert_eq!(found.verdict, Verdict::Accepted, "{found:?}");
        // The change of the cameras is undone; half a degree moves the bumpers by 2 cm, two pixels.
        assert!((found.yaw_degrees + yaw).abs() < 0.5, "{found:?}");
        assert!((found.lateral_m + lateral).abs() < 0.025, "{found:?}");
        assert!(found.coverage_after > found.coverage_before && found.coverage_after > 0.995, "{found:?}");
        assert!(found.edge_error_after_px < 0.5 * found.edge_error_before_px, "{found:?}");
        // Drawn with the caller's cameras: the model is in the caller's frame.
        let [off, auto] = made.map(|m| errors(&m, &unseen).unwrap());
        assert!(auto.psnr_db > off.psnr_db + 0.3, "{} {}", off.psnr_db, auto.psnr_db);
        assert!(auto.silhouette_iou > off.silhouette_iou + 0.005);
    }
}

#[test]
fn corrected_cameras_that_were_off_independently_fill_the_masks() {
    let unseen = open(&UNSEEN, false).unwrap();
    for seed in [1, 2] {
        let made = both(&jittered(open(&INPUTS, false).unwrap(), seed));
        let found = calibration(&made[1]);
        assert_eq!(found.verdict, Verdict::Accepted, "{found:?}");
        assert!(1.0 - found.coverage_after < 0.5 * (1.0 - found.coverage_before), "{found:?}");
        assert!(found.views.iter().any(|v| v.metres > 0.01 && v.pixels > 0.5), "{found:?}");
        let [off, auto] = made.map(|m| errors(&m, &unseen).unwrap().psnr_db);
        assert!(auto > off - 0.1, "seed {seed}: {off} {auto}");
    }
}

#[test]
fn exact_cameras_are_unchanged_and_give_the_model_of_calibrate_off() {
    let [off, auto] = both(&open(&INPUTS, false).unwrap());
    let found = calibration(&auto);
    assert_eq!(found.verdict, Verdict::NotNeeded, "{found:?}");
    assert!(found.coverage_before > 0.995 && found.coverage_before == found.coverage_after);
    assert!(auto.report.left_out.iter().any(|l| l.what == "calibration"));
    assert_eq!(off.gaussians, auto.gaussians);
    assert!(off.report.calibration.is_none() && off.report.left_out.iter().all(|l| l.what != "calibration"));
}

#[test]
fn half_a_mask_behind_an_occluder_is_recognised_and_the_plane_is_still_found() {
    for moved in [false, true] {
        let (yaw, lateral) = if moved { (2.0, 0.05) } else { (0.0, 0.0) };
        let mut input = plane_moved(open(&INPUTS, false).unwrap(), yaw, lateral);
        let [u0, _, u1, _] = input.views[1].mask.as_ref().unwrap().bounds().unwrap();
        with_mask(&mut input, 1, |u, _, l| if u > (u0 + u1) / 2 { Label::Background } else { l });
        let made = both(&input);
        let found = calibration(&made[1]).clone();
        let ignored: Vec<bool> = found.views.iter().map(|v| v.ignored).collect();
        assert_eq!(ignored, [false, true, false, false], "{found:?}");
        assert_eq!(found.verdict == Verdict::Accepted, moved, "{found:?}");
        if moved {
            assert!((found.yaw_degrees + yaw).abs() < 0.6, "{found:?}");
            assert!((found.lateral_m + lateral).abs() < 0.03, "{found:?}");
        }
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_threads() {
    let input = jittered(plane_moved(open(&INPUTS, false).unwrap(), 1.5, -0.03), 5);
    let made = [1, 2]
        .map(|threads| run(&input, &Options { threads, points: true, ..options(Calibrate::Auto) }).unwrap());
    assert_eq!(calibration(&made[0]).verdict, Verdict::Accepted);
    assert_eq!(calibration(&made[0]), calibration(&made[1]));
    assert!(made[0].gaussians == made[1].gaussians && made[0].points == made[1].points);
}

#[test]
fn the_point_cloud_lies_on_the_rays_of_the_corrected_cameras_in_the_callers_frame() {
    let input = plane_moved(open(&INPUTS, false).unwrap(), 2.0, 0.05);
    let made = run(&input, &Options { points: true, ..options(Calibrate::Auto) }).unwrap();
    let found = calibration(&made);
    assert_eq!(found.verdict, Verdict::Accepted);
    let points = &made.points.as_ref().unwrap().positions;
    let pose = Pose::from_row_major("pose", &found.views[0].vehicle_from_camera).unwrap();
    let i = input.views[0].camera.intrinsics;
    // The first view's pixels come first, in rows.
    let mask = input.views[0].mask.as_ref().unwrap();
    let first = (0..mask.height()).flat_map(|v| (0..mask.width()).map(move |u| (u, v)));
    for ((u, v), point) in first.filter(|&(u, v)| mask.is_vehicle(u, v)).zip(points).take(5000) {
        let p = pose.inverse().transform_point(glam::Vec3::from_array(*point).as_dvec3());
        let [x, y] = i.pixel_from_normalized([p.x / p.z, p.y / p.z]);
        // Points are f32, some metres from the origin: a millionth of a metre, a thousandth of a pixel.
        assert!(
            (x - f64::from(u) - 0.5).abs() < 0.01 && (y - f64::from(v) - 0.5).abs() < 0.01,
            "{u} {v} {x} {y}"
        );
    }
}

#[test]
fn one_silhouette_determines_no_plane_and_the_report_has_the_reason() {
    let scene = open(&INPUTS[..1], false).unwrap();
    let [off, auto] = both(&scene);
    assert!(auto.report.calibration.is_none());
    let why = &auto.report.left_out.iter().find(|l| l.what == "calibration").unwrap().why;
    assert!(why.contains("mirror image"), "{why}");
    assert_eq!(off.gaussians, auto.gaussians);
}

#[test]
fn views_without_masks_are_calibrated_with_the_outlines_of_their_depth() {
    let mut scene = open(&INPUTS, true).unwrap();
    scene.views.iter_mut().for_each(|v| v.mask = None);
    let made = run(&scene, &Options { prior: PriorChoice::Given, ..options(Calibrate::Auto) }).unwrap();
    let masked = run(
        &open(&INPUTS, true).unwrap(),
        &Options { prior: PriorChoice::Given, ..options(Calibrate::Auto) },
    );
    let (found, expected) = (made.report.calibration.unwrap(), masked.unwrap().report.calibration.unwrap());
    assert_eq!(found.verdict, expected.verdict);
    assert!((found.coverage_before - expected.coverage_before).abs() < 0.01);
}

#[test]
fn errors_larger_than_a_detectors_are_refused_and_reported() {
    let input = plane_moved(open(&INPUTS, false).unwrap(), 9.0, 0.0);
    let [off, auto] = both(&input);
    let found = calibration(&auto);
    assert_eq!(found.verdict, Verdict::Refused, "{found:?}");
    assert!(!found.why.is_empty());
    assert_eq!(off.gaussians, auto.gaussians);
    let json = serde_json::to_value(&auto.report).unwrap();
    assert_eq!(json["calibration"]["verdict"], "refused");
}

#[test]
fn degenerate_masks_give_finite_numbers_or_the_error_of_the_prior() {
    let base = || Scene {
        views: [-40.0, -140.0].map(|a| view(&format!("{a}"), camera(a, 6.5, 64, 48))).to_vec(),
        ..Scene::default()
    };
    let masks: [fn(u32, u32, Label) -> Label; 4] = [
        |_, _, _| Label::Vehicle,
        |u, v, _| if (u, v) == (32, 24) { Label::Vehicle } else { Label::Background },
        |u, v, _| if (u + v) % 2 == 0 { Label::Vehicle } else { Label::Background },
        |u, v, l| if u < 20 && v < 20 { Label::Unknown } else { l },
    ];
    for change in masks {
        let mut scene = without_depth(base());
        (0..2).for_each(|i| with_mask(&mut scene, i, change));
        match reconstruct(&scene, &options(Calibrate::Auto), &mut |_| ControlFlow::Continue(())) {
            Ok(made) => {
                let means = made.gaussians.means().as_flattened();
                assert!(means.iter().all(|m| m.is_finite()));
                if let Some(found) = &made.report.calibration {
                    let numbers = [found.yaw_degrees, found.lateral_m, found.coverage_after];
                    assert!(numbers.iter().all(|n| n.is_finite()), "{found:?}");
                }
            }
            Err(e) => assert!(matches!(e, Error::Reconstruction { .. }), "{e}"),
        }
    }
}
