//! The shape prior on the bundled sample, with known depth, and on shapes outside its training data.

use std::ops::ControlFlow;
use vg::pipeline::{Options, PriorChoice, Reconstruction};
use vg::prior::{DepthPrior, Estimate, Geometry, HullPrior, ShapePrior};
use vg::progress::{Context, Threads};
use vg::scene::mask::Label;
use vg::scene::{Mask, Scene, View};
use vg_testing::sample::{self, INPUTS, UNSEEN};
use vg_testing::vehicle::{right_side, without_depth};

fn answer(prior: &dyn DepthPrior, views: &[View]) -> Estimate {
    let mut proceed = |_| ControlFlow::Continue(());
    let threads = Threads::new(2).unwrap();
    prior.estimate(views, &Context::new(&threads, &mut proceed)).unwrap()
}

fn estimate(prior: &dyn DepthPrior, views: &[View]) -> Geometry {
    answer(prior, views).geometry
}

fn shape(photo: bool) -> ShapePrior {
    ShapePrior { photo, ..ShapePrior::default() }
}

/// Mean absolute difference to the true depth, metres, over all pixels of all views.
fn depth_error(truth: &Scene, geometry: &Geometry) -> f64 {
    let pixels = truth.views.iter().zip(&geometry.depths).flat_map(|(view, found)| {
        let truth = view.depth.as_ref().unwrap().depth();
        truth.iter().zip(found.depth()).filter(|(t, f)| **t > 0.0 && **f > 0.0)
    });
    let (sum, count) = pixels.fold((0.0, 0), |(sum, n), (t, f)| (sum + f64::from(t - f).abs(), n + 1));
    sum / f64::from(count)
}

fn run(scene: &Scene, prior: PriorChoice) -> Reconstruction {
    sample::run(scene, &Options { prior, ..Options::default() }).unwrap()
}

#[test]
fn depth_of_the_sample_is_twice_as_good_as_the_hulls_and_photographs_improve_it() {
    let truth = sample::open(&INPUTS, true).unwrap();
    let hull = depth_error(&truth, &estimate(&HullPrior::default(), &truth.views));
    let learned = depth_error(&truth, &estimate(&shape(false), &truth.views));
    let photo = depth_error(&truth, &estimate(&shape(true), &truth.views));
    assert!(learned < 0.6 * hull, "shape {learned:.4} m, hull {hull:.4} m");
    assert!(photo < learned && photo < 0.05, "with photographs {photo:.4} m, without {learned:.4} m");
}

#[test]
fn the_unseen_side_of_the_sample_improves_without_a_depth_file() {
    let (inputs, tests) = (sample::open(&INPUTS, false).unwrap(), sample::open(&UNSEEN, false).unwrap());
    let error = |prior| sample::errors(&run(&inputs, prior), &tests).unwrap();
    let (auto, hull) = (error(PriorChoice::Auto), error(PriorChoice::Hull));
    assert_eq!(run(&inputs, PriorChoice::Auto).report.prior, "shape");
    assert!(auto.psnr_db > hull.psnr_db + 0.3, "{auto:?} {hull:?}");
    assert!(auto.silhouette_iou > hull.silhouette_iou - 0.002, "{auto:?} {hull:?}");
}

#[test]
fn every_vehicle_pixel_has_depth_with_a_confidence_and_masks_are_filled() {
    let scene = sample::open(&INPUTS, false).unwrap();
    let Estimate { geometry, report } = answer(&shape(true), &scene.views);
    for (view, depth) in scene.views.iter().zip(&geometry.depths) {
        let labels = view.mask.as_ref().unwrap().labels();
        let confidence = depth.confidence().unwrap();
        for ((label, z), c) in labels.iter().zip(depth.depth()).zip(confidence) {
            assert_eq!(*label == Label::Vehicle, *z > 0.0);
            assert_eq!(*z > 0.0, *c > 0.0 && *c <= 1.0, "depth {z}, confidence {c}");
        }
    }
    assert!(report.masks.unwrap().uncovered_after < 0.01, "{:?}", report.masks);
}

#[test]
fn confidence_is_lower_where_the_depth_is_wrong() {
    let truth = sample::open(&INPUTS, true).unwrap();
    let geometry = estimate(&shape(false), &truth.views);
    let mut pixels: Vec<(f32, f32)> = Vec::new();
    for (view, found) in truth.views.iter().zip(&geometry.depths) {
        let errors =
            view.depth.as_ref().unwrap().depth().iter().zip(found.depth()).map(|(t, f)| (t, (t - f).abs()));
        let both = errors.zip(found.confidence().unwrap());
        pixels.extend(both.filter(|((t, _), c)| **t > 0.0 && **c > 0.0).map(|((_, e), c)| (*c, e.min(0.5))));
    }
    pixels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = |part: &[(f32, f32)]| part.iter().map(|p| f64::from(p.1)).sum::<f64>() / part.len() as f64;
    let (unsure, sure) = pixels.split_at(pixels.len() / 2);
    assert!(mean(unsure) > 1.5 * mean(sure), "{:.4} m and {:.4} m", mean(unsure), mean(sure));
}

#[test]
fn one_two_and_three_threads_give_the_same_bytes() {
    let scene = without_depth(right_side(160, 120));
    let with = |threads| {
        let options = Options { prior: PriorChoice::Shape, threads, ..Options::default() };
        sample::run(&scene, &options).unwrap().gaussians
    };
    let one = with(1);
    assert!(one == with(2) && one == with(3));
}

#[test]
fn an_ellipsoid_is_not_turned_into_a_vehicle() {
    // The masks are a bound: the error may exceed that of the hull only slightly.
    let scene = right_side(320, 240);
    let hull = depth_error(&scene, &estimate(&HullPrior::default(), &scene.views));
    let shape = depth_error(&scene, &estimate(&shape(true), &scene.views));
    assert!(shape < hull + 0.03, "shape {shape:.3} m, hull {hull:.3} m");
}

/// The masks with a thin tower on the roof, such as a ladder or a crane.
fn with_tower(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for view in &mut scene.views {
        let camera = view.camera;
        let camera_from_vehicle = camera.vehicle_from_camera.inverse();
        let mut labels = view.mask.as_ref().unwrap().labels().to_vec();
        let inside = |p: glam::DVec3| p.x.abs() < 0.25 && p.y.abs() < 0.12 && (0.4..1.35).contains(&p.z);
        // Points of the tower, dense enough to cover every pixel.
        let steps = |low: f64, high: f64| (0..=60).map(move |i| low + (high - low) * f64::from(i) / 60.0);
        for x in steps(-0.249, 0.249) {
            for y in steps(-0.119, 0.119).step_by(10) {
                for z in steps(0.401, 1.349).chain(steps(0.41, 1.34)) {
                    let p = glam::DVec3::new(x, y, z);
                    assert!(inside(p));
                    if let Some([u, v]) = camera.project(camera_from_vehicle.transform_point(p))
                        && (0.0..f64::from(camera.width)).contains(&u)
                        && (0.0..f64::from(camera.height)).contains(&v)
                    {
                        labels[v as usize * camera.width as usize + u as usize] = Label::Vehicle;
                    }
                }
            }
        }
        view.mask = Some(Mask::new(camera.width, camera.height, labels).unwrap());
    }
    scene
}

#[test]
fn parts_unlike_the_training_data_are_kept_if_the_masks_show_them() {
    let scene = with_tower(&without_depth(right_side(320, 240)));
    let Estimate { geometry, report } = answer(&shape(true), &scene.views);
    assert!(report.masks.unwrap().uncovered_after < 0.03, "{:?}", report.masks);
    // Lifted pixels of the tower lie above the roof, near the middle.
    let (view, depth) = (&scene.views[1], &geometry.depths[1]);
    let mut seen = 0;
    for (u, v) in (0..view.camera.height).flat_map(|v| (0..view.camera.width).map(move |u| (u, v))) {
        if let Some(z) = depth.get(u, v) {
            let p = view.lift(u, v, z);
            if p.z > 0.95 {
                seen += 1;
                assert!(p.y.abs() < 0.8 && p.x.abs() < 0.8, "{p}");
            }
        }
    }
    assert!(seen > 100, "{seen} pixels of the tower");
}

#[test]
fn a_damaged_or_missing_mask_is_an_error_that_names_the_view() {
    let mut scene = without_depth(right_side(64, 48));
    scene.views[2].mask = None;
    let options = Options { prior: PriorChoice::Shape, ..Options::default() };
    let text = sample::run(&scene, &options).unwrap_err().to_string();
    assert!(text.starts_with("views[2]") && text.contains("mask"), "{text}");
}
