//! The whole pipeline: its promises about input, output, report and callers.

use std::ops::ControlFlow;
use vg::pipeline::{Keep, Options, PriorChoice, Reason, ReasonCode, Reconstruction, Verdict, reconstruct};
use vg::relight::Relight;
use vg::render::{Background, CpuRenderer, RenderOptions, Renderer};
use vg::scene::mask::Label;
use vg::scene::{DepthMap, Mask, RgbImage};
use vg::symmetry::SymmetryMode;
use vg::{Error, Scene, View, metrics};
use vg_testing::vehicle::{HALF, camera, right_side, view, without_depth};

fn run(scene: &Scene, options: &Options) -> Reconstruction {
    reconstruct(scene, options, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn left_out(made: &Reconstruction, why: &str) -> usize {
    made.report.left_out.iter().filter(|l| l.why.contains(why)).map(|l| l.count).sum()
}

#[test]
fn given_depth_is_used_when_every_view_has_it_and_the_shape_prior_otherwise() {
    let mut scene = right_side(160, 120);
    assert_eq!(run(&scene, &Options::default()).report.prior, "given");
    scene.views[3].depth = None;
    assert_eq!(run(&scene, &Options::default()).report.prior, "shape");
    let asked = Options { prior: PriorChoice::Given, ..Options::default() };
    let error = reconstruct(&scene, &asked, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string();
    assert!(error.starts_with("views[3] (-140).depth"), "{error}");
}

#[test]
fn the_input_views_are_reproduced_and_the_unseen_side_is_reconstructed() {
    let scene = right_side(320, 240);
    for (prior, input_db, unseen_db) in [(PriorChoice::Given, 28.0, 26.0), (PriorChoice::Hull, 24.0, 20.0)] {
        let made = run(&scene, &Options { prior, ..Options::default() });
        let error = made.report.input_error.unwrap();
        assert!(error.psnr_db > input_db && error.silhouette_iou > 0.95, "{prior:?}: {error:?}");
        for azimuth in [50.0, 90.0, 120.0] {
            let unseen = view("unseen", camera(azimuth, 6.5, 320, 240));
            let options = RenderOptions::default();
            let drawn = CpuRenderer::new().render(&made.gaussians, &unseen.camera, &options).unwrap();
            let db = metrics::psnr(&drawn.color, &metrics::on_white(&unseen));
            assert!(db > unseen_db, "{prior:?} at {azimuth}: {db:.2} dB");
        }
    }
}

#[test]
fn no_holes_open_at_twice_the_magnification() {
    let scene = right_side(320, 240);
    let made = run(&scene, &Options::default());
    for view in &scene.views {
        let close = view.camera.scaled_to(640, 480);
        let options = RenderOptions { background: Background::Transparent, ..RenderOptions::default() };
        let drawn = CpuRenderer::new().render(&made.gaussians, &close, &options).unwrap();
        let mask = view.mask.as_ref().unwrap();
        // Two pixels inside the silhouette, beyond the fall-off at the rim. In the middle between four surfels a
        // seventh of the background may show; a hole would show all of it.
        let inside = |u: u32, v: u32| {
            u >= 2
                && v >= 2
                && u + 2 < 320
                && v + 2 < 240
                && (v - 2..=v + 2).all(|y| (u - 2..=u + 2).all(|x| mask.is_vehicle(x, y)))
        };
        for v in 0..480 {
            for u in 0..640 {
                let alpha = drawn.alpha[(v * 640 + u) as usize];
                assert!(!inside(u / 2, v / 2) || alpha > 0.85, "{}: ({u}, {v}) alpha {alpha}", view.name);
            }
        }
    }
}

#[test]
fn one_and_two_threads_give_the_same_bytes() {
    let scene = right_side(160, 120);
    for prior in [PriorChoice::Given, PriorChoice::Hull] {
        let with = |threads| run(&scene, &Options { prior, threads, points: true, ..Options::default() });
        let (one, two, three) = (with(1), with(2), with(3));
        assert!(one.gaussians == two.gaussians && one.gaussians == three.gaussians, "{prior:?}");
        assert_eq!(one.points, two.points);
        assert_eq!(one.report.input_error, two.report.input_error);
    }
}

#[test]
fn the_check_can_be_switched_off() {
    let made = run(&right_side(64, 48), &Options { check: false, ..Options::default() });
    assert_eq!(made.report.input_error, None);
}

#[test]
fn the_error_by_the_given_cameras_uses_the_cameras_of_the_input() {
    // The plane of symmetry is off by 2 degrees and 5 cm: the calibration corrects it, and each camera separately.
    let mut scene = without_depth(right_side(160, 120));
    let turn = glam::DMat3::from_rotation_z(2f64.to_radians());
    for view in &mut scene.views {
        let pose = &mut view.camera.vehicle_from_camera;
        *pose = vg::geometry::Pose { rotation: turn, translation: glam::DVec3::Y * 0.05 }.after(pose);
    }
    // One camera is turned by a degree, which its silhouette contradicts.
    let pose = &mut scene.views[1].camera.vehicle_from_camera;
    pose.rotation *= glam::DMat3::from_rotation_x(1f64.to_radians());
    let made = run(&scene, &Options { prior: PriorChoice::Hull, ..Options::default() });
    let report = &made.report;
    let moved = report.calibration.as_ref().unwrap().views.iter().any(|view| view.pixels > 0.5);
    assert!(moved, "{:?}", report.calibration);

    let names: Vec<&str> = report.input_views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, report.views_used);
    let mut mean = 0.0;
    for (checked, view) in report.input_views.iter().zip(&scene.views) {
        let drawn =
            CpuRenderer::new().render(&made.gaussians, &view.camera, &RenderOptions::default()).unwrap();
        let given = checked.by_given_camera;
        assert_eq!(given.psnr_db, metrics::psnr(&drawn.color, &metrics::on_white(view)), "{}", checked.name);
        assert_eq!(given.silhouette_iou, metrics::silhouette_iou(&drawn.alpha, view));
        assert_eq!(given.mask_covered, metrics::mask_covered(&drawn.alpha, view));
        mean += given.silhouette_iou / 4.0;
    }
    let (used, given) = (report.input_error.unwrap(), report.input_error_by_given_cameras.unwrap());
    assert!((given.silhouette_iou - mean).abs() < 1e-12);
    assert!(used.silhouette_iou > given.silhouette_iou + 0.005, "{used:?} {given:?}");
}

#[test]
fn uncorrected_cameras_have_a_single_error() {
    let report = run(&right_side(64, 48), &Options::default()).report;
    assert_eq!(report.input_error, report.input_error_by_given_cameras);
    assert!(report.input_views.iter().all(|view| view.errors == view.by_given_camera));
}

fn hull() -> Options {
    Options { prior: PriorChoice::Hull, ..Options::default() }
}

/// The verdict on a scene, which is not good, and its reason with this code.
fn reason(scene: &Scene, options: &Options, code: ReasonCode) -> (Verdict, Reason) {
    let report = run(scene, options).report;
    assert!(report.verdict > Verdict::Good && !report.verdict_reasons.is_empty());
    let found = report.verdict_reasons.iter().find(|reason| reason.code == code);
    (report.verdict, found.unwrap_or_else(|| panic!("{:#?}", report.verdict_reasons)).clone())
}

fn inverted(mask: &Mask) -> Mask {
    let other = |label: &Label| if *label == Label::Vehicle { Label::Background } else { Label::Vehicle };
    Mask::new(mask.width(), mask.height(), mask.labels().iter().map(other).collect()).unwrap()
}

fn move_all(scene: &mut Scene, by: &vg::geometry::Pose) {
    for view in &mut scene.views {
        view.camera.vehicle_from_camera = by.after(&view.camera.vehicle_from_camera);
    }
}

fn shift(x: f64, y: f64, z: f64) -> vg::geometry::Pose {
    vg::geometry::Pose { rotation: glam::DMat3::IDENTITY, translation: glam::DVec3::new(x, y, z) }
}

#[test]
fn a_consistent_scene_is_good_with_depth_and_without_and_with_one_view() {
    let scene = right_side(160, 120);
    let one = Scene { views: scene.views[1..2].to_vec(), ..Scene::default() };
    for (scene, options) in [
        (scene.clone(), Options::default()),
        (without_depth(scene.clone()), Options::default()),
        (without_depth(scene), hull()),
        (one.clone(), Options { symmetry: SymmetryMode::Never, ..Options::default() }),
        (without_depth(one), Options::default()),
    ] {
        let report = run(&scene, &options).report;
        assert_eq!((report.verdict, &report.verdict_reasons), (Verdict::Good, &Vec::new()));
    }
}

#[test]
fn without_the_check_no_verdict_is_good_and_a_wrong_size_is_still_bad() {
    let quick = Options { check: false, ..hull() };
    let mut scene = without_depth(right_side(160, 120));
    let report = run(&scene, &quick).report;
    assert_eq!((report.verdict, report.verdict_reasons.len()), (Verdict::Unchecked, 0));
    scene.views.iter_mut().for_each(|v| v.camera.vehicle_from_camera.translation *= 0.18);
    assert_eq!(reason(&scene, &quick, ReasonCode::TooSmall).0, Verdict::Bad);
}

#[test]
fn the_view_with_the_inverted_mask_is_named_by_both_reasons() {
    let mut scene = without_depth(right_side(160, 120));
    scene.views[1].mask = scene.views[1].mask.as_ref().map(inverted);
    let (verdict, found) = reason(&scene, &hull(), ReasonCode::MaskInverted);
    assert_eq!((verdict, found.view.as_deref()), (Verdict::Bad, Some("-75")));
    let (_, found) = reason(&scene, &hull(), ReasonCode::ViewDisagrees);
    assert_eq!(found.view.as_deref(), Some("-75"));
    assert!(found.to_string().starts_with("view -75: ") && !found.to_string().contains('\n'), "{found}");
}

#[test]
fn masks_of_the_next_frame_are_bad() {
    let mut scene = without_depth(right_side(160, 120));
    let masks: Vec<_> = scene.views.iter().map(|view| view.mask.clone()).collect();
    for (i, view) in scene.views.iter_mut().enumerate() {
        view.mask.clone_from(&masks[(i + 1) % 4]);
    }
    assert_eq!(run(&scene, &hull()).report.verdict, Verdict::Bad);
}

#[test]
fn photographs_of_the_next_frame_disagree_though_all_silhouettes_agree() {
    let scene = right_side(160, 120);
    let mut shifted = scene.clone();
    for i in 0..4 {
        shifted.views[i].image = scene.views[(i + 1) % 4].image.clone();
    }
    let (_, found) = reason(&shifted, &Options::default(), ReasonCode::Photographs);
    assert!(found.cause.contains("another order"), "{found}");
    let report = run(&shifted, &Options::default()).report;
    assert!(report.verdict_reasons.iter().all(|r| r.code != ReasonCode::ViewsDisagree));
}

#[test]
fn sizes_below_and_above_those_of_road_vehicles_are_bad() {
    for scale in [0.02, 0.18] {
        let mut small = without_depth(right_side(160, 120));
        small.views.iter_mut().for_each(|v| v.camera.vehicle_from_camera.translation *= scale);
        let (verdict, found) = reason(&small, &hull(), ReasonCode::TooSmall);
        assert_eq!(verdict, Verdict::Bad);
        assert!(found.expected.contains("2.2 x 1.1 x 0.95 m"), "{found}");
    }
    // The depth is scaled with the poses: only the size is wrong.
    let mut large = right_side(160, 120);
    for view in &mut large.views {
        view.camera.vehicle_from_camera.translation *= 6.0;
        let depth = view.depth.as_ref().unwrap().depth().iter().map(|z| 6.0 * z).collect();
        view.depth = Some(DepthMap::new(160, 120, depth).unwrap());
    }
    let (verdict, found) = reason(&large, &Options::default(), ReasonCode::TooLarge);
    assert_eq!(verdict, Verdict::Bad);
    assert!(found.found.contains(&format!("{:.0}.", 12.0 * HALF.x)), "{found}");
}

#[test]
fn a_frame_far_away_is_distinguished_from_a_wrong_size() {
    let mut utm = right_side(160, 120);
    move_all(&mut utm, &shift(4.5e5, 5.4e6, 0.0));
    let (verdict, found) = reason(&utm, &Options::default(), ReasonCode::FarAway);
    assert_eq!(verdict, Verdict::Bad);
    assert!(found.cause.contains("UTM") && found.remedy.contains("vehicle_from_world"), "{found}");
}

#[test]
fn a_plane_beside_the_vehicle_has_the_reason_symmetry() {
    let mut scene = without_depth(right_side(160, 120));
    move_all(&mut scene, &shift(0.0, 1.0, 0.0));
    let (verdict, found) = reason(&scene, &hull(), ReasonCode::Symmetry);
    assert_eq!(verdict, Verdict::Bad);
    assert!(found.cause.contains("plane of symmetry"), "{found}");
    reason(&scene, &hull(), ReasonCode::CalibrationRefused);
}

#[test]
fn depth_of_another_unit_or_another_frame_contradicts_the_silhouettes() {
    let scene = right_side(160, 120);
    for (factor, unit) in [(1000.0, "millimetres"), (3.281, "feet")] {
        let mut wrong = scene.clone();
        for view in &mut wrong.views {
            let depth = view.depth.as_ref().unwrap().depth().iter().map(|z| factor * z).collect();
            view.depth = Some(DepthMap::new(160, 120, depth).unwrap());
        }
        let (verdict, found) = reason(&wrong, &Options::default(), ReasonCode::DepthUnit);
        assert_eq!(verdict, Verdict::Bad);
        assert!(found.cause.contains(unit), "{found}");
    }
    let mut moved = scene.clone();
    let further = scene.views[1].depth.as_ref().unwrap().depth().iter();
    let further = further.map(|z| if *z > 0.0 { z + 2.5 } else { 0.0 }).collect();
    moved.views[1].depth = Some(DepthMap::new(160, 120, further).unwrap());
    let (verdict, found) = reason(&moved, &Options::default(), ReasonCode::DepthOutside);
    assert_eq!((verdict, found.view.as_deref()), (Verdict::Bad, Some("-75")));
}

#[test]
fn a_lens_that_folds_within_the_picture_of_the_vehicle_is_bad_and_named() {
    let mut scene = without_depth(right_side(160, 120));
    scene.views[2].camera.distortion =
        vg::geometry::Distortion::Brown { k: [-44.8, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
    let (verdict, found) = reason(&scene, &hull(), ReasonCode::Lens);
    assert_eq!((verdict, found.view.as_deref()), (Verdict::Bad, Some("-105")));
}

#[test]
fn every_stage_can_be_cancelled_and_the_error_names_it() {
    let scene = without_depth(right_side(160, 120));
    let mut stages: Vec<&'static str> = Vec::new();
    let mut calls = 0;
    reconstruct(&scene, &Options::default(), &mut |p| {
        calls += 1;
        assert!((0.0..=1.0).contains(&p.fraction));
        if stages.last() != Some(&p.stage) {
            stages.push(p.stage);
        }
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(stages, ["plan", "undistort", "calibrate", "prior", "pixels", "head", "symmetry", "check"]);
    for stop in 0..calls {
        let mut call = 0;
        let result = reconstruct(&scene, &Options::default(), &mut |_| {
            call += 1;
            if call > stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(result, Err(Error::Cancelled { stage }) if stages.contains(&stage)), "call {stop}");
    }
}

#[test]
fn progress_is_reported_on_the_calling_thread() {
    let caller = std::thread::current().id();
    reconstruct(&right_side(64, 48), &Options::default(), &mut |_| {
        assert_eq!(std::thread::current().id(), caller);
        ControlFlow::Continue(())
    })
    .unwrap();
}

#[test]
fn the_report_is_json_with_the_promised_keys() {
    let report = run(&without_depth(right_side(160, 120)), &Options::default()).report;
    let json = serde_json::to_value(&report).unwrap();
    for key in [
        "stages",
        "total_ms",
        "peak_rss_bytes",
        "threads",
        "gaussians",
        "views_used",
        "left_out",
        "symmetry",
        "input_error",
        "settings",
        "prior",
        "head",
        "vehicle",
        "working_box",
        "input_error_by_given_cameras",
        "input_views",
        "verdict",
        "verdict_reasons",
        "evidence",
    ] {
        assert!(!json[key].is_null(), "{key}");
    }
    let stages = json["stages"].as_array().unwrap();
    let sum: f64 = stages.iter().map(|s| s["ms"].as_f64().unwrap()).sum();
    assert!((sum - json["total_ms"].as_f64().unwrap()).abs() < 1.0);
    assert_eq!(json["symmetry"]["mode"], "auto");
    assert_eq!(json["symmetry"]["reference_side"], "right");
    assert!(json["symmetry"]["cloned"].as_u64().unwrap() > 0);
    assert_eq!(json["working_box"]["source"], "estimated");
    assert_eq!(report.views_used, ["-40", "-75", "-105", "-140"]);
}

// The omissions of the plan, each on a scene where it occurs.

#[test]
fn the_size_of_a_model_is_bounded_by_its_masks_before_the_work() {
    let scene = right_side(96, 72);
    let with = |max_gaussians| run(&scene, &Options { max_gaussians, ..Options::default() });
    let whole = with(None);
    assert_eq!(whole.gaussians, run(&scene, &Options::default()).gaussians);
    for share in [4, 20] {
        let cap = whole.gaussians.len() / share;
        let made = with(Some(cap));
        assert!((cap / 6..=cap).contains(&made.gaussians.len()), "{} of {cap}", made.gaussians.len());
        assert!(left_out(&made, &format!("max_gaussians, {cap}: the views are resampled to 0.")) > 0);
        assert!(left_out(&made, "averaged into fewer") > 0);
        // Repeated with the settings of the report, which hold the requested options.
        assert_eq!(made.report.settings.vehicle().unwrap().resolution, 1.0);
    }
    let error = error(&scene, &Options { max_gaussians: Some(1), ..Options::default() });
    assert!(error.contains("options.max_gaussians: 1, where the masks allow for"), "{error}");
    // More views of the same surface do not make a larger model.
    let largest = scene.views.iter().map(|v| v.mask.as_ref().unwrap().vehicle_pixels()).max().unwrap();
    let enough = with(Some(6 * largest));
    assert!(enough.gaussians == whole.gaussians && left_out(&enough, "max_gaussians") == 0);
}

#[test]
fn a_view_with_an_empty_mask_is_left_out() {
    let mut scene = right_side(160, 120);
    scene.views[1].mask = Some(Mask::new(160, 120, vec![Label::Background; 160 * 120]).unwrap());
    let made = run(&scene, &Options::default());
    assert_eq!(made.report.views_used, ["-40", "-105", "-140"]);
    assert_eq!(left_out(&made, "the mask is empty"), 1);
}

#[test]
fn a_duplicate_camera_is_used_once() {
    let mut scene = right_side(160, 120);
    let once = run(&scene, &Options::default());
    scene.views.push(scene.views[0].clone());
    let twice = run(&scene, &Options::default());
    assert_eq!(left_out(&twice, "the same camera"), 1);
    assert_eq!(once.gaussians, twice.gaussians);
    let keep = Keep { duplicate_views: true, ..Keep::default() };
    assert_eq!(run(&scene, &Options { keep, ..Options::default() }).report.views_used.len(), 5);
}

#[test]
fn pixels_another_view_shows_better_are_left_out_and_cost_little() {
    let scene = right_side(320, 240);
    let thin = run(&scene, &Options::default());
    let keep = Keep { overlap: true, ..Keep::default() };
    let all = run(&scene, &Options { keep, ..Options::default() });
    assert!(left_out(&thin, "higher resolution") > 1000);
    assert!(thin.gaussians.len() * 10 < all.gaussians.len() * 9);
    let db = |made: &Reconstruction| made.report.input_error.unwrap().psnr_db;
    assert!(db(&thin) > db(&all) - 1.0);
}

#[test]
fn a_floating_pixel_between_two_surfaces_is_left_out() {
    let mut scene = right_side(160, 120);
    let mut depth = scene.views[0].depth.as_ref().unwrap().depth().to_vec();
    let middle = 60 * 160 + 80;
    depth[middle] -= 0.7;
    scene.views[0].depth = Some(DepthMap::new(160, 120, depth).unwrap());
    let made = run(&scene, &Options::default());
    assert_eq!(left_out(&made, "floating"), 1);
}

/// Length, width, height.
fn extent(made: &Reconstruction) -> [f32; 3] {
    let (low, high) = made.gaussians.bounds().unwrap();
    std::array::from_fn(|k| high[k] - low[k])
}

/// The scene with each view's depth changed, `change(depths, column, row)`.
fn with_depth(
    scene: &Scene,
    views: usize,
    change: impl Fn(&dyn Fn(i32, i32) -> f32, i32, i32) -> f32,
) -> Scene {
    let mut scene = scene.clone();
    for view in &mut scene.views[..views] {
        let depth = view.depth.take().unwrap();
        let (w, h) = (depth.width() as i32, depth.height() as i32);
        let at = |u: i32, v: i32| depth.depth()[(v.clamp(0, h - 1) * w + u.clamp(0, w - 1)) as usize];
        let changed = (0..w * h).map(|i| change(&at, i % w, i / w)).collect();
        view.depth = Some(DepthMap::new(depth.width(), depth.height(), changed).unwrap());
    }
    scene
}

#[test]
fn depth_with_edges_mixed_by_a_resize_does_not_enlarge_the_vehicle() {
    let clean = right_side(160, 120);
    let expected = extent(&run(&clean, &Options::default()));
    // Means of three by three pixels, with missing depth as 0, and with a wall behind.
    for behind in [0.0, 25.0] {
        let blurred = with_depth(&clean, 4, |at, u, v| {
            let around = (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (du, dv)));
            around.map(|(du, dv)| at(u + du, v + dv)).map(|z| if z > 0.0 { z } else { behind }).sum::<f32>()
                / 9.0
        });
        let made = run(&blurred, &Options::default());
        assert!(left_out(&made, "floating") > 300, "{:?}", made.report.left_out);
        let kept = Options { keep: Keep { floaters: true, ..Keep::default() }, ..Options::default() };
        let (found, unguarded) = (extent(&made), extent(&run(&blurred, &kept)));
        for k in 0..3 {
            assert!((found[k] - expected[k]).abs() < 0.3, "{behind}: {found:?} for {expected:?}");
        }
        assert!((0..3).any(|k| unguarded[k] > expected[k] + 0.5), "{behind}: {unguarded:?}");
    }
}

#[test]
fn stray_pixels_and_depth_outside_the_other_masks_do_not_enlarge_the_vehicle() {
    let clean = right_side(160, 120);
    let expected = extent(&run(&clean, &Options::default()));
    for (side, why) in [(1, "floating"), (2, "before or behind the vehicle"), (20, "most other views' masks")]
    {
        let inside = move |u: i32, v: i32| (80..80 + side).contains(&u) && (60..60 + side).contains(&v);
        let stray = with_depth(&clean, 1, |at, u, v| if inside(u, v) { 12.0 } else { at(u, v) });
        let made = run(&stray, &Options::default());
        assert!(
            left_out(&made, why) >= (side * side * 3 / 4).max(1) as usize,
            "{side}: {:?}",
            made.report.left_out
        );
        let found = extent(&made);
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 0.05), "{side}: {found:?} for {expected:?}");
    }
}

#[test]
fn views_from_one_direction_give_no_view_dependence() {
    let narrow = Scene {
        views: vec![view("a", camera(-90.0, 6.5, 160, 120)), view("b", camera(-93.0, 6.5, 160, 120))],
        ..Scene::default()
    };
    let made = run(&narrow, &Options::default());
    assert_eq!(made.gaussians.sh_degree(), 0);
    assert_eq!(left_out(&made, "too few to tell"), 2);
    assert_eq!(run(&right_side(160, 120), &Options::default()).gaussians.sh_degree(), 2);
}

#[test]
fn with_both_sides_seen_only_missing_parts_are_cloned() {
    let around = |a: &f64| view(&format!("{a}"), camera(*a, 6.5, 160, 120));
    let scene = Scene {
        views: [-140.0, -90.0, -40.0, 40.0, 90.0, 140.0].iter().map(around).collect(),
        ..Scene::default()
    };
    let both = run(&scene, &Options::default());
    let one = run(&right_side(160, 120), &Options::default());
    let share = |r: &Reconstruction| r.report.symmetry.cloned as f64 / r.report.gaussians as f64;
    assert!(share(&both) < 0.05 && share(&one) > 0.3, "{} {}", share(&both), share(&one));
    assert!(left_out(&both, "mirrored place") > 1000);
}

#[test]
fn flipped_photographs_are_used_as_additional_views() {
    let scene = right_side(160, 120);
    let flip = Options { symmetry: SymmetryMode::Flip, points: true, ..Options::default() };
    let made = run(&scene, &flip);
    let symmetry = &made.report.symmetry;
    assert_eq!((symmetry.mode, symmetry.cloned, symmetry.replaced), (SymmetryMode::Flip, 0, 0));
    assert_eq!(made.report.views_used, ["-40", "-75", "-105", "-140"]);
    // The cloud has only measured points; the model is complete.
    assert!(made.points.unwrap().positions.iter().all(|p| p[1] < 0.3));
    let unseen = view("unseen", camera(90.0, 6.5, 160, 120));
    let drawn =
        CpuRenderer::new().render(&made.gaussians, &unseen.camera, &RenderOptions::default()).unwrap();
    let db = metrics::psnr(&drawn.color, &metrics::on_white(&unseen));
    let cloned = run(&scene, &Options { symmetry: SymmetryMode::Always, ..Options::default() });
    let drawn =
        CpuRenderer::new().render(&cloned.gaussians, &unseen.camera, &RenderOptions::default()).unwrap();
    let cloned_db = metrics::psnr(&drawn.color, &metrics::on_white(&unseen));
    assert!((db - cloned_db).abs() < 1.0, "{db:.2} dB flipped, {cloned_db:.2} cloned");
    // Also with silhouettes alone.
    assert!(run(&without_depth(scene), &flip).report.gaussians > 1000);
}

/// Mean absolute difference of colour within `band` metres of the plane and beyond it, and the least alpha within, two
/// pixels and more inside the silhouette; at front and rear and above the sill, because no view shows the middle of the
/// roof.
fn seam(made: &Reconstruction, truth: &View, band: f32) -> (f32, f32, f32) {
    let transparent = RenderOptions { background: Background::Transparent, ..RenderOptions::default() };
    let drawn = CpuRenderer::new().render(&made.gaussians, &truth.camera, &transparent).unwrap();
    let (mask, depth) = (truth.mask.as_ref().unwrap(), truth.depth.as_ref().unwrap());
    let (width, height) = (truth.camera.width, truth.camera.height);
    let (mut near, mut far, mut least) = ((0.0, 0.0f32), (0.0, 0.0f32), 1.0f32);
    for (v, u) in (2..height - 2).flat_map(|v| (2..width - 2).map(move |u| (v, u))) {
        if (v - 2..=v + 2).all(|y| (u - 2..=u + 2).all(|x| mask.is_vehicle(x, y))) {
            let i = (v * width + u) as usize;
            let expected = truth.image.get(u, v).map(|c| f32::from(c) / 255.0);
            let error: f32 = drawn.color[i].iter().zip(expected).map(|(a, b)| (a - b).abs() / 3.0).sum();
            let place = truth.lift(u, v, depth.get(u, v).unwrap());
            if place.x.abs() < 1.6 || place.z < -0.2 {
                continue;
            }
            let side = if place.y.abs() < band { &mut near } else { &mut far };
            *side = (side.0 + error, side.1 + 1.0);
            if place.y.abs() < band {
                least = least.min(drawn.alpha[i]);
            }
        }
    }
    assert!(near.1 > 100.0 && far.1 > 100.0, "the view does not show the seam");
    (near.0 / near.1, far.0 / far.1, least)
}

#[test]
fn front_and_rear_have_no_gap_and_no_double_surface_along_the_plane() {
    let scene = right_side(320, 240);
    for (symmetry, azimuth) in
        [SymmetryMode::Auto, SymmetryMode::Always].into_iter().flat_map(|s| [(s, 8.0), (s, 172.0)])
    {
        let made = run(&scene, &Options { symmetry, ..Options::default() });
        let truth = view("across", camera(azimuth, 6.5, 320, 240));
        let (near, far, least) = seam(&made, &truth, 0.05);
        assert!(near < 0.02 && near < far, "{symmetry:?} at {azimuth}: {near} beside {far}");
        assert!(least > 0.9, "{symmetry:?} at {azimuth}: alpha {least}");
        // The test notices a seam with a gap of two surfels.
        let mut torn = made.clone();
        let closed: Vec<bool> = torn.gaussians.means().iter().map(|m| m[1].abs() > 0.03).collect();
        torn.gaussians.retain(&closed);
        assert!(seam(&torn, &truth, 0.05).2 < 0.5);
    }
}

#[test]
fn clones_are_relit_unless_that_is_switched_off() {
    // A right side that is darker than front, rear and top, as with the sun on the left.
    let mut scene = right_side(160, 120);
    for view in &mut scene.views {
        let (depth, camera) = (view.depth.clone().unwrap(), view.camera);
        let shade = |i: usize| {
            let (u, v) = (i as u32 % camera.width, i as u32 / camera.width);
            let normal = depth.get(u, v).map(|z| {
                let p = view.lift(u, v, z).as_dvec3();
                (p / vg_testing::vehicle::HALF / vg_testing::vehicle::HALF).normalize()
            });
            let sun = glam::DVec3::new(0.3, 0.6, 0.7).normalize();
            let light = normal.map_or(1.0, |n| 0.2 * (1.0 + 3.0 * n.dot(sun).max(0.0)));
            [(255.0 * (0.5 * light).powf(1.0 / 2.2)) as u8; 3]
        };
        let pixels = (0..(camera.width * camera.height) as usize).map(shade).collect();
        view.image = RgbImage::new(camera.width, camera.height, pixels).unwrap();
    }
    let relit = run(&scene, &Options::default());
    let mirrored = run(&scene, &Options { relight: Relight::Never, ..Options::default() });
    let done = relit.report.relight.unwrap();
    assert!(done.left_over_right > 1.1 && done.sun[1] > 0.1, "{done:?}");
    assert_eq!(done.clones, relit.report.symmetry.cloned);
    assert_eq!(mirrored.report.relight, None);
    let observed = relit.gaussians.len() - done.clones;
    let stride = relit.gaussians.sh().len() / relit.gaussians.len();
    let (a, b) = (relit.gaussians.sh(), mirrored.gaussians.sh());
    assert_eq!(a[..observed * stride], b[..observed * stride]);
    let mean = |sh: &[f32]| sh.chunks(stride).map(|c| c[0]).sum::<f32>() / done.clones as f32;
    assert!(mean(&a[observed * stride..]) > mean(&b[observed * stride..]) + 0.05);
    let never = Options { symmetry: SymmetryMode::Never, ..Options::default() };
    assert_eq!(run(&scene, &never).report.relight, None);
}

// Extreme input (method section 8): an error that names the argument, or a finite result.

fn is_finite(made: &Reconstruction) -> bool {
    let g = &made.gaussians;
    g.means().iter().flatten().chain(g.rotations().iter().flatten()).all(|v| v.is_finite())
        && g.scales().iter().flatten().chain(g.sh()).all(|v| v.is_finite())
}

fn error(scene: &Scene, options: &Options) -> String {
    reconstruct(scene, options, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
}

#[test]
fn no_views_or_only_empty_masks_are_errors() {
    assert!(error(&Scene::default(), &Options::default()).starts_with("views: 0"));
    let mut scene = right_side(16, 12);
    for view in &mut scene.views {
        view.mask = Some(Mask::new(16, 12, vec![Label::Background; 16 * 12]).unwrap());
    }
    assert!(error(&scene, &Options::default()).contains("every mask is empty"));
}

#[test]
fn a_missing_mask_is_replaced_by_the_outline_of_depth_of_the_vehicle_alone_or_refused() {
    let masked = right_side(64, 48);
    let mut scene = masked.clone();
    scene.views[2].mask = None;
    let made = run(&scene, &Options::default());
    assert_eq!(left_out(&made, "the outline of the view's depth"), 1);
    assert_eq!(made.gaussians, run(&masked, &Options::default()).gaussians);
    // A wall behind the vehicle, as in the depth of a depth camera.
    let wall = |z: &f32| if *z > 0.0 { *z } else { 20.0 };
    let depth = scene.views[2].depth.as_ref().unwrap().depth().iter().map(wall).collect();
    scene.views[2].depth = Some(DepthMap::new(64, 48, depth).unwrap());
    let text = error(&scene, &Options::default());
    assert!(
        text.starts_with("views[2] (-105).mask: none, and its depth reaches the picture's border"),
        "{text}"
    );
    let text = error(&without_depth(scene), &Options::default());
    assert!(text.starts_with("views[2] (-105).mask: none"), "{text}");
}

#[test]
fn sizes_that_disagree_name_the_view_and_both_sizes() {
    let mut scene = right_side(32, 24);
    scene.views[1].mask = Some(Mask::new(16, 24, vec![Label::Vehicle; 16 * 24]).unwrap());
    let text = error(&scene, &Options::default());
    assert!(text.contains("views[1] (-75).mask: 16x24") && text.contains("32x24"), "{text}");
}

#[test]
fn one_to_sixty_four_views_give_a_vehicle() {
    for n in [1, 2, 3, 8, 64] {
        let azimuth = |i: usize| -20.0 - 140.0 * (i as f64 + 0.5) / n as f64;
        let views = (0..n).map(|i| view(&i.to_string(), camera(azimuth(i), 6.5, 80, 60))).collect();
        let scene = Scene { views, ..Scene::default() };
        for prior in [PriorChoice::Given, PriorChoice::Hull] {
            let made = run(&scene, &Options { prior, ..Options::default() });
            assert!(made.report.gaussians > 500 && is_finite(&made), "{n} views, {prior:?}");
        }
    }
}

#[test]
fn pictures_and_masks_of_one_pixel_give_a_result_or_an_error() {
    let tiny = Scene { views: vec![view("tiny", camera(-90.0, 6.5, 1, 1))], ..Scene::default() };
    for scene in [tiny.clone(), without_depth(tiny)] {
        match reconstruct(&scene, &Options::default(), &mut |_| ControlFlow::Continue(())) {
            Ok(made) => assert!(is_finite(&made)),
            Err(e) => assert!(matches!(e, Error::Reconstruction { .. }), "{e}"),
        }
    }
    let mut scene = right_side(64, 48);
    for view in &mut scene.views {
        let mut labels = vec![Label::Background; 64 * 48];
        labels[24 * 64 + 32] = Label::Vehicle;
        view.mask = Some(Mask::new(64, 48, labels).unwrap());
    }
    for scene in [scene.clone(), without_depth(scene)] {
        match reconstruct(&scene, &Options::default(), &mut |_| ControlFlow::Continue(())) {
            Ok(made) => assert!(is_finite(&made)),
            Err(e) => assert!(matches!(e, Error::Reconstruction { .. }), "{e}"),
        }
    }
}

#[test]
fn full_masks_give_a_result_or_an_error() {
    let mut scene = without_depth(right_side(64, 48));
    for view in &mut scene.views {
        view.mask = Some(Mask::new(64, 48, vec![Label::Vehicle; 64 * 48]).unwrap());
    }
    match reconstruct(&scene, &Options::default(), &mut |_| ControlFlow::Continue(())) {
        Ok(made) => assert!(is_finite(&made)),
        Err(e) => assert!(matches!(e, Error::Reconstruction { .. }), "{e}"),
    }
}

#[test]
fn invalid_depth_is_counted_and_left_out() {
    let mut scene = right_side(64, 48);
    let mut depth = scene.views[0].depth.as_ref().unwrap().depth().to_vec();
    let vehicle: Vec<usize> = (0..depth.len()).filter(|&i| depth[i] > 0.0).collect();
    for (k, &i) in vehicle.iter().enumerate().filter(|(k, _)| k % 5 == 0) {
        depth[i] = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e9][k / 5 % 5];
    }
    scene.views[0].depth = Some(DepthMap::new(64, 48, depth).unwrap());
    let made = run(&scene, &Options::default());
    assert!(is_finite(&made));
    assert!(left_out(&made, "no depth") >= vehicle.len() / 6, "{:?}", made.report.left_out);
}

#[test]
fn focal_lengths_from_one_to_a_million_pixels_give_a_finite_result_or_an_error() {
    for focal in [1.0, 10.0, 1e4, 1e6] {
        let mut scene = right_side(64, 48);
        for view in &mut scene.views {
            view.camera.intrinsics.fx = focal;
            view.camera.intrinsics.fy = focal;
        }
        for scene in [scene.clone(), without_depth(scene)] {
            match reconstruct(&scene, &Options::default(), &mut |_| ControlFlow::Continue(())) {
                Ok(made) => assert!(is_finite(&made), "{focal}"),
                Err(e) => assert!(matches!(e, Error::Reconstruction { .. }), "{focal}: {e}"),
            }
        }
    }
}

#[test]
fn world_coordinates_instead_of_vehicle_coordinates_are_an_error() {
    for offset in [1e4, 1e6, 7e6] {
        let mut scene = without_depth(right_side(64, 48));
        for view in &mut scene.views {
            view.camera.vehicle_from_camera.translation += glam::DVec3::new(offset, offset, 100.0);
        }
        let text = error(&scene, &Options::default());
        assert!(text.starts_with("prior: ") && text.contains("y = 0"), "{text}");
    }
}

#[test]
fn the_callers_scene_is_unchanged() {
    let scene = right_side(64, 48);
    let before: Vec<View> = scene.views.clone();
    run(&scene, &Options::default());
    for (a, b) in before.iter().zip(&scene.views) {
        assert!(a.image == b.image && a.mask == b.mask && a.depth == b.depth && a.camera == b.camera);
    }
}

#[test]
fn symmetry_never_leaves_the_unseen_side_empty_and_always_mirrors_it() {
    let scene = right_side(160, 120);
    let with = |symmetry| run(&scene, &Options { symmetry, relight: Relight::Never, ..Options::default() });
    let never = with(SymmetryMode::Never);
    let always = with(SymmetryMode::Always);
    assert_eq!(never.report.symmetry.cloned, 0);
    let n = always.gaussians.len();
    assert_eq!(always.report.symmetry.cloned * 2, n);
    let half = always.gaussians.filtered(&(0..n).map(|i| i < n / 2).collect::<Vec<bool>>());
    let other = always.gaussians.filtered(&(0..n).map(|i| i >= n / 2).collect::<Vec<bool>>());
    assert_eq!(half.mirrored(), other);
}

#[test]
fn grey_and_black_pictures_keep_their_colour() {
    for value in [0u8, 128, 255] {
        let mut scene = right_side(64, 48);
        for view in &mut scene.views {
            view.image = RgbImage::new(64, 48, vec![[value; 3]; 64 * 48]).unwrap();
        }
        let made = run(&scene, &Options::default());
        let drawn = CpuRenderer::new()
            .render(
                &made.gaussians,
                &scene.views[1].camera,
                &RenderOptions { background: Background::Transparent, ..RenderOptions::default() },
            )
            .unwrap();
        let middle = 24 * 64 + 32;
        let color = drawn.color[middle][0] / drawn.alpha[middle];
        assert!((color - f32::from(value) / 255.0).abs() < 0.01, "{value}: {color}");
    }
}

#[test]
fn a_huge_budget_changes_no_byte_and_no_setting() {
    let scene = without_depth(right_side(96, 72));
    let free = run(&scene, &Options::default());
    let made = run(&scene, &Options { budget_s: Some(1e6), ..Options::default() });
    assert!(made.gaussians == free.gaussians);
    assert_eq!(made.report.settings, Options::default().into());
    assert_eq!(made.report.left_out, free.report.left_out);
    let plan = made.report.plan.clone().unwrap();
    assert!(plan.fits && plan.budget_s == 1e6 && plan.predicted_s > 0.0 && plan.machine.serial > 0.0);
    assert!(plan.kept && plan.took_s > 0.0 && made.report.warnings.is_empty(), "{plan:?}");
    assert_eq!(free.report.plan, None);
}

#[test]
fn an_impossible_budget_gives_the_cheapest_plan_and_a_warning() {
    for (scene, prior) in [
        (without_depth(right_side(160, 120)), "hull"),
        (right_side(160, 120), "given"),
        (
            Scene { views: without_depth(right_side(160, 120)).views[1..2].to_vec(), ..Scene::default() },
            "hull",
        ),
    ] {
        let made = run(&scene, &Options { budget_s: Some(1e-6), ..Options::default() });
        let plan = made.report.plan.clone().unwrap();
        assert!(!plan.fits && plan.predicted_s > 1e-6, "{plan:?}");
        assert!(!plan.kept && plan.took_s > 1e-6, "{plan:?}");
        let warnings = &made.report.warnings;
        assert!(
            warnings.iter().any(|w| w.contains("was not kept") && w.contains("all was left out")),
            "{warnings:?}"
        );
        assert_eq!(made.report.prior, prior);
        assert!(plan.chosen.resolution <= 0.25 && !plan.chosen.check && made.report.input_error.is_none());
        assert_eq!(made.report.views_used.len(), 1);
        assert!(left_out(&made, "budget of 0.000001 s") >= 3, "{:?}", made.report.left_out);
        assert!(left_out(&made, "working resolution") > 0);
        assert!(left_out(&made, "max_views") == scene.views.len() - 1);
    }
}

#[test]
fn the_settings_that_a_budget_chose_give_the_same_bytes_without_it() {
    let scene = without_depth(right_side(160, 120));
    let full = run(&scene, &Options { budget_s: Some(1e6), ..Options::default() }).report.plan.unwrap();
    for part in [0.8, 0.5, 0.3, 0.1, 1e-4] {
        let budget_s = Some(part * full.predicted_s);
        let chosen = run(&scene, &Options { budget_s, points: true, ..Options::default() });
        let settings = chosen.report.settings.vehicle().unwrap();
        assert_ne!(*settings, Options { points: true, ..Options::default() }, "{part}");
        assert_eq!(settings.budget_s, None);
        let again = run(&scene, settings);
        assert!(again.gaussians == chosen.gaussians && again.points == chosen.points, "{part}");
        assert_eq!(again.report.settings, chosen.report.settings);
        assert_eq!(again.report.input_error, chosen.report.input_error);
    }
}

#[test]
fn a_lower_resolution_makes_a_coarser_model_of_the_same_vehicle() {
    let scene = right_side(320, 240);
    for prior in [PriorChoice::Given, PriorChoice::Hull, PriorChoice::Shape] {
        let at = |resolution| run(&scene, &Options { prior, resolution, ..Options::default() });
        let (full, half) = (at(1.0), at(0.5));
        let part = half.gaussians.len() as f64 / full.gaussians.len() as f64;
        assert!((0.2..0.35).contains(&part), "{prior:?}: {part}");
        let (a, b) = (full.report.extent_m.unwrap(), half.report.extent_m.unwrap());
        for k in 0..3 {
            assert!(
                (a.0[k] - b.0[k]).abs() < 0.15 && (a.1[k] - b.1[k]).abs() < 0.15,
                "{prior:?}: {a:?} {b:?}"
            );
        }
        let unseen = view("unseen", camera(90.0, 6.5, 320, 240));
        let psnr = |made: &Reconstruction| {
            let options = RenderOptions::default();
            let drawn = CpuRenderer::new().render(&made.gaussians, &unseen.camera, &options).unwrap();
            metrics::psnr(&drawn.color, &metrics::on_white(&unseen))
        };
        assert!(psnr(&half) > psnr(&full) - 4.0, "{prior:?}: {} {}", psnr(&half), psnr(&full));
    }
}

#[test]
fn max_views_limits_the_views_even_with_pictures_of_one_pixel() {
    let scene = right_side(96, 72);
    let made = run(&scene, &Options { max_views: Some(2), ..Options::default() });
    assert_eq!(made.report.views_used.len(), 2);
    assert_eq!(left_out(&made, "max_views"), scene.views.len() - 2);

    let dot = right_side(1, 1);
    for budget_s in [None, Some(1e-6), Some(1e6)] {
        let options = Options { budget_s, resolution: 0.1, ..Options::default() };
        // One pixel may give a vehicle or an error, but no panic.
        match reconstruct(&dot, &options, &mut |_| ControlFlow::Continue(())) {
            Ok(made) => assert!(!made.gaussians.is_empty()),
            Err(e) => assert!(!e.to_string().is_empty()),
        }
    }
}

#[test]
fn invalid_budgets_resolutions_and_numbers_of_views_are_refused() {
    let scene = right_side(16, 12);
    let refused = |options: Options, argument: &str| {
        let error = reconstruct(&scene, &options, &mut |_| ControlFlow::Continue(())).unwrap_err();
        assert!(error.to_string().starts_with(argument), "{error}");
    };
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused(Options { budget_s: Some(wrong), ..Options::default() }, "options.budget_s: ");
        refused(Options { resolution: wrong, ..Options::default() }, "options.resolution: ");
    }
    refused(Options { resolution: 1.01, ..Options::default() }, "options.resolution: ");
    refused(Options { max_views: Some(0), ..Options::default() }, "options.max_views: 0");
}
