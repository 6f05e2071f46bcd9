//! The geometry prior on graphs that contain the exact vehicle.

use glam::{DMat3, DVec3};
use std::ops::ControlFlow;
use vg::onnx::Model;
use vg::pipeline::{Calibrate, Options, PriorChoice, Reconstruction, reconstruct};
use vg::prior::{DepthPrior, Estimate, Geometry, NetworkPrior};
use vg::progress::{Context, Threads};
use vg::{Result, Scene};
use vg_testing::networks::oracle::{Manner, ellipsoid};
use vg_testing::networks::{open, oracle};
use vg_testing::vehicle::{camera, right_side, view, without_depth};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;

fn options(model: &Model) -> Options {
    Options {
        prior: PriorChoice::Onnx,
        prior_model: Some(model.clone()),
        calibrate: Calibrate::Off,
        ..Options::default()
    }
}

fn run(scene: &Scene, model: &Model) -> Result<Reconstruction> {
    reconstruct(scene, &options(model), &mut |_| ControlFlow::Continue(()))
}

fn estimate(scene: &Scene, model: &Model) -> Result<Estimate> {
    let threads = Threads::new(2)?;
    let mut callback = |_| ControlFlow::Continue(());
    let context = Context::new(&threads, &mut callback);
    NetworkPrior::new(model.clone())?.estimate(&scene.views, &context)
}

/// Relative errors in increasing order, of pixels with depth at least two pixels inside the silhouette, where f32 still
/// resolves the intersection of the ray with the ellipsoid.
fn relative_errors(scene: &Scene, geometry: &Geometry) -> Vec<f64> {
    let mut errors = Vec::new();
    for (view, depth) in scene.views.iter().zip(&geometry.depths) {
        let mask = view.mask.as_ref().unwrap();
        for v in 2..view.camera.height - 2 {
            for u in 2..view.camera.width - 2 {
                if (v - 2..=v + 2).all(|y| (u - 2..=u + 2).all(|x| mask.is_vehicle(x, y)))
                    && let Some(found) = depth.get(u, v)
                {
                    let truth = view.depth.as_ref().unwrap().get(u, v).unwrap();
                    errors.push((f64::from(found) / f64::from(truth) - 1.0).abs());
                }
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    errors
}

/// The largest of them, and their number.
fn worst(scene: &Scene, geometry: &Geometry) -> (f64, usize) {
    let errors = relative_errors(scene, geometry);
    (*errors.last().unwrap(), errors.len())
}

#[test]
fn depth_is_exact_in_every_convention() {
    let scene = right_side(WIDTH, HEIGHT);
    for (k, (along_ray, is_metric, unit)) in [
        (false, true, 1.0),
        (true, true, 1.0),
        (false, true, 0.2),
        (true, true, 7.0),
        (false, false, 0.3),
        (true, false, 5.0),
    ]
    .into_iter()
    .enumerate()
    {
        let manner = Manner { along_ray, is_metric, unit };
        let graph = ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), manner);
        let Some(model) = open(&format!("manner{k}"), &graph) else { return };
        let Estimate { geometry, report } = estimate(&scene, &model).unwrap();
        let (error, count) = worst(&scene, &geometry);
        assert!(error < 1e-4 && count > 1000, "{manner:?}: {error:.1e} at {count} pixels");
        let network = report.network.unwrap();
        assert!(network.ray_degrees.unwrap() < 1e-2 && network.warnings.is_empty(), "{network:?}");
        assert_eq!(network.rescaled, !is_metric);
        assert_eq!((network.prior.as_str(), network.size), ("oracle", [WIDTH, HEIGHT]));
        let poses = network.poses.unwrap();
        let expected = if is_metric { 1.0 } else { f64::from(unit) };
        assert!((poses.scale / expected - 1.0).abs() < 1e-5, "{poses:?}");
        assert!(poses.rotation_degrees.iter().all(|d| *d < 0.05) && poses.center_m.iter().all(|m| *m < 1e-4));
    }
}

#[test]
fn pictures_are_scaled_and_cropped_with_their_intrinsics_and_depth_is_resampled_to_their_pixels() {
    // So close that the vehicle fills the width of the picture.
    let views = [-80.0, -100.0].map(|a| view(&format!("{a}"), camera(a, 4.2, 128, 72)));
    let scene = Scene { views: views.into(), ..Scene::default() };
    for (resize, cut) in [("cover_crop", true), ("stretch", false)] {
        // Another aspect ratio than that of the photographs.
        let mut graph = ellipsoid(&scene.views[0].camera, 88, 66, Manner::PLAIN);
        graph.say("vg.resize", resize);
        let Some(model) = open(resize, &graph) else { return };
        let Estimate { geometry, report } = estimate(&scene, &model).unwrap();
        let errors = relative_errors(&scene, &geometry);
        // The ellipsoid is curved between the network's coarser pixels.
        let most = errors[errors.len() * 19 / 20];
        assert!(most < 2e-3 && errors.len() > 4000, "{resize}: {most:.1e} at {} pixels", errors.len());
        let mask = scene.views[0].mask.as_ref().unwrap();
        let lost =
            (0..72).filter(|v| mask.is_vehicle(10, *v) && geometry.depths[0].get(10, *v).is_none()).count();
        assert_eq!(lost > 10, cut, "{resize}: {lost} pixels of column 10");
        assert!(report.network.unwrap().without_depth >= lost);
    }
}

#[test]
fn a_whole_reconstruction_is_as_good_as_with_the_depth_itself() {
    let scene = right_side(WIDTH, HEIGHT);
    let graph = ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN);
    let Some(model) = open("whole", &graph) else { return };
    let bare = without_depth(scene.clone());
    let made = run(&bare, &model).unwrap();
    let given = Options { prior: PriorChoice::Given, prior_model: None, ..options(&model) };
    let given = reconstruct(&scene, &given, &mut |_| ControlFlow::Continue(())).unwrap();
    let db = |made: &Reconstruction| made.report.input_error.unwrap().psnr_db;
    assert!((db(&made) - db(&given)).abs() < 0.2, "{} {}", db(&made), db(&given));
    assert_eq!(made.report.prior, "onnx");
    let json = serde_json::to_value(&made.report).unwrap();
    assert_eq!(json["network"]["prior"], "oracle");
    assert_eq!(json["settings"]["prior"], "onnx");
    assert!(json["settings"]["prior_model"].as_str().unwrap().ends_with("whole.onnx"));
    // A second time, and from two threads at once: the same bytes.
    std::thread::scope(|scope| {
        let again: Vec<_> = (0..2).map(|_| scope.spawn(|| run(&bare, &model).unwrap().gaussians)).collect();
        for thread in again {
            assert_eq!(thread.join().unwrap(), made.gaussians);
        }
    });
}

#[test]
fn cameras_far_from_the_origin_are_never_rounded_to_f32() {
    let mut scene = right_side(WIDTH, HEIGHT);
    let graph = ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN);
    let Some(model) = open("far", &graph) else { return };
    let near = estimate(&scene, &model).unwrap().geometry;
    // Six thousand kilometres, as in ECEF.
    let offset = DVec3::new(4.1e6, 6.2e5, 4.8e6);
    scene.views.iter_mut().for_each(|v| v.camera.vehicle_from_camera.translation += offset);
    let far = estimate(&scene, &model).unwrap().geometry;
    assert!(worst(&scene, &near).0 < 1e-4 && worst(&scene, &far).0 < 1e-4);
}

#[test]
fn a_metric_network_that_is_off_by_a_tenth_is_corrected_by_its_own_cameras() {
    let scene = right_side(WIDTH, HEIGHT);
    // A network that declares metres, but has units of 1.1 m.
    let manner = Manner { is_metric: true, unit: 1.1, along_ray: false };
    let mut graph = ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), manner);
    oracle::set_output(&mut graph, "scale", 1.0);
    let Some(model) = open("tenth", &graph) else { return };
    let Estimate { geometry, report } = estimate(&scene, &model).unwrap();
    assert!(worst(&scene, &geometry).0 < 1e-4);
    let network = report.network.unwrap();
    assert!(network.rescaled && (network.poses.unwrap().scale - 1.1).abs() < 1e-4);
}

#[test]
fn poses_of_other_pictures_give_a_warning_and_rays_of_another_lens_are_refused() {
    let mut scene = right_side(WIDTH, HEIGHT);
    let graph = ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN);
    let Some(right) = open("poses", &graph) else { return };
    // A network with its own poses: those of a rig whose last camera is turned by 12 degrees.
    let mut turned = graph.clone();
    turned.rename_output_of("cam_to_ref_pred", "before");
    let (s, c) = 12f32.to_radians().sin_cos();
    let mut matrix = [0.0f32; 16];
    for (at, value) in [(0, c), (2, s), (5, 1.0), (8, -s), (10, c), (15, 1.0)] {
        matrix[at] = value;
    }
    turned.floats("turn", &[4, 4], &matrix).node("MatMul", &["before", "turn"], "cam_to_ref_pred", &[]);
    let model = open("turned", &turned).unwrap();
    let network = estimate(&scene, &model).unwrap().report.network.unwrap();
    assert!(network.warnings.iter().any(|w| w.contains("12.0 degrees")), "{:?}", network.warnings);

    // A network with its own rays: constants of the right lens, while the caller's is another.
    let i = &mut scene.views[1].camera.intrinsics;
    (i.fx, i.fy) = (2.0 * i.fx, 2.0 * i.fy);
    let network = estimate(&scene, &right).unwrap().report.network.unwrap();
    // The test graph uses the given intrinsics: rays agree, views do not.
    assert!(network.ray_degrees.unwrap() < 1e-2);
    let mut fixed = graph;
    let rays: Vec<f32> = (0..HEIGHT * WIDTH)
        .flat_map(|p| {
            let (u, v) = (f64::from(p % WIDTH) + 0.5, f64::from(p / WIDTH) + 0.5);
            let ray = DVec3::new((u - 48.0) / 192.0, (v - 36.0) / 192.0, 1.0).normalize();
            ray.to_array().map(|x| x as f32)
        })
        .collect();
    fixed.rename_output_of("rays", "before");
    fixed.floats("own", &[1, HEIGHT.into(), WIDTH.into(), 3], &rays).floats("nothing", &[1], &[0.0]);
    fixed.node("Mul", &["before", "nothing"], "none", &[]).node("Add", &["none", "own"], "rays", &[]);
    let scene = right_side(WIDTH, HEIGHT);
    let model = open("lens", &fixed).unwrap();
    let text = estimate(&scene, &model).unwrap_err().to_string();
    assert!(
        text.starts_with("prior: the network's rays differ from those of the intrinsics by ")
            && text.contains("another lens"),
        "{text}"
    );
}

#[test]
fn a_network_without_metres_needs_two_places() {
    let one = Scene { views: vec![view("one", camera(-90.0, 6.5, WIDTH, HEIGHT))], ..Scene::default() };
    let manner = Manner { is_metric: false, ..Manner::PLAIN };
    let graph = ellipsoid(&one.views[0].camera, WIDTH.into(), HEIGHT.into(), manner);
    let Some(model) = open("one", &graph) else { return };
    let text = estimate(&one, &model).unwrap_err().to_string();
    assert!(text.contains("the vehicle's size cannot be determined"), "{text}");
    let graph = ellipsoid(&one.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN);
    let network = estimate(&one, &open("metric one", &graph).unwrap()).unwrap().report.network.unwrap();
    assert!(network.warnings.iter().any(|w| w.contains("the network's own scale")), "{:?}", network.warnings);
}

#[test]
fn a_view_with_another_scale_is_scaled_to_the_others() {
    let scene = right_side(WIDTH, HEIGHT);
    let mut graph = ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN);
    graph.rename_output_of("depth", "before");
    graph.floats("off", &[4, 1, 1], &[1.0, 1.08, 1.0, 1.0]).node("Mul", &["before", "off"], "depth", &[]);
    let Some(model) = open("view", &graph) else { return };
    let fit = estimate(&scene, &model).unwrap().report.network.unwrap().views.unwrap();
    assert!(fit.after < 0.5 * fit.before, "{fit:?}");
    assert!((fit.scales[1] * 1.08 - 1.0).abs() < 0.03, "{fit:?}");
}

#[test]
fn the_first_camera_gets_the_identity() {
    // Otherwise the test graph would be off by its first pose; a rotation of the whole world changes nothing.
    let mut scene = right_side(WIDTH, HEIGHT);
    let graph = ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN);
    let Some(model) = open("turned world", &graph) else { return };
    let turn = DMat3::from_rotation_z(2.0);
    for view in &mut scene.views {
        let pose = &mut view.camera.vehicle_from_camera;
        (pose.rotation, pose.translation) = (turn * pose.rotation, turn * pose.translation);
    }
    assert!(worst(&scene, &estimate(&scene, &model).unwrap().geometry).0 < 1e-4);
}
