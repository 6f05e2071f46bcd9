//! The hull prior on a vehicle with known shape.

use std::ops::ControlFlow;
use vg::pipeline::{Options, PriorChoice, Reconstruction, reconstruct};
use vg::prior::volume::KnownBox;
use vg::prior::{DepthPrior, Geometry, HullPrior};
use vg::progress::{Context, Threads};
use vg::scene::mask::Label;
use vg::scene::{Mask, Place, Scene, VehicleBox, View};
use vg_testing::vehicle::{HALF, camera, right_side, view, without_depth};

fn estimate(scene: &Scene, size: Option<[f64; 3]>) -> Geometry {
    let mut proceed = |_| ControlFlow::Continue(());
    let threads = Threads::new(2).unwrap();
    let known_box = size.map(|size| KnownBox { size, center: None });
    HullPrior { known_box, ..HullPrior::default() }
        .estimate(&scene.views, &Context::new(&threads, &mut proceed))
        .unwrap()
        .geometry
}

/// Depth of the hull minus true depth, pixel by pixel, for view i.
fn excess(scene: &Scene, geometry: &Geometry, i: usize) -> Vec<f32> {
    let truth = scene.views[i].depth.as_ref().unwrap();
    let hull = &geometry.depths[i];
    let pixels = truth.depth().iter().zip(hull.depth());
    pixels.filter(|(t, _)| **t > 0.0).map(|(t, h)| h - t).collect()
}

#[test]
fn every_mask_pixel_has_depth_near_the_surface() {
    let scene = right_side(320, 240);
    let geometry = estimate(&without_depth(scene.clone()), None);
    for i in 0..scene.views.len() {
        let mask = scene.views[i].mask.as_ref().unwrap();
        for (label, depth) in mask.labels().iter().zip(geometry.depths[i].depth()) {
            assert_eq!(*label == Label::Vehicle, *depth > 0.0);
        }
        let excess = excess(&scene, &geometry, i);
        let mean = excess.iter().sum::<f32>() / excess.len() as f32;
        assert!((-0.2..0.05).contains(&mean), "view {i}: mean {mean}");
        // The surface is drawn in by 5 cm, which is more along slanted rays.
        let behind = excess.iter().filter(|e| **e > 0.2).count() as f32 / excess.len() as f32;
        assert!(behind < 0.05, "view {i}: {behind} far behind the surface");
    }
}

#[test]
fn the_estimated_box_contains_the_vehicle_and_little_more() {
    let scene = without_depth(right_side(320, 240));
    let size = estimate(&scene, None).working_box.unwrap().size();
    for (k, size) in size.into_iter().enumerate() {
        let truth = 2.0 * HALF[k];
        assert!(size > truth - 0.05 && size < truth + 0.5, "axis {k}: {size} for {truth}");
    }
}

#[test]
fn a_given_box_narrows_the_hull_and_is_reported_as_given() {
    // Two views of the flank bound the width loosely.
    let scene = Scene { views: right_side(320, 240).views[1..3].to_vec(), ..Scene::default() };
    let mean = |geometry: &Geometry| -> f32 {
        let all: Vec<f32> = (0..2).flat_map(|i| excess(&scene, geometry, i)).map(f32::abs).collect();
        all.iter().sum::<f32>() / all.len() as f32
    };
    let (tight, loose) = (estimate(&scene, Some([4.4, 1.8, 1.4])), estimate(&scene, None));
    assert!(mean(&tight) < mean(&loose) - 0.01, "{} against {}", mean(&tight), mean(&loose));
    let report = run(&without_depth(scene), Some([4.4, 1.8, 1.4])).report;
    assert_eq!(serde_json::to_value(&report).unwrap()["working_box"]["source"], "given");
}

fn half(axis: usize) -> f64 {
    HALF[axis]
}

fn true_size() -> [f64; 3] {
    std::array::from_fn(|k| 2.0 * half(k))
}

#[test]
fn a_true_size_is_placed_by_the_silhouettes_and_cuts_nothing_off() {
    let all = right_side(320, 240);
    for kept in [vec![0], vec![1], vec![1, 2], vec![0, 3], vec![0, 1, 2, 3]] {
        let views: Vec<View> = kept.iter().map(|&i| all.views[i].clone()).collect();
        let scene = Scene { views, ..Scene::default() };
        let known = estimate(&scene, Some(true_size())).working_box.unwrap();
        assert_eq!(known.contradicted_m, 0.0, "{kept:?}");
        for k in [0, 2] {
            assert!(
                known.low[k] <= -half(k) + 0.01 && known.high[k] >= half(k) - 0.01,
                "{kept:?}: {known:?}"
            );
        }
    }
}

#[test]
fn a_size_of_another_vehicle_is_refused_and_one_slightly_off_gives_a_warning() {
    let scene = without_depth(right_side(320, 240));
    let made = |size: [f64; 3]| {
        let options = Options { prior: PriorChoice::Hull, vehicle_size: Some(size), ..Options::default() };
        reconstruct(&scene, &options, &mut |_| ControlFlow::Continue(()))
    };
    let [length, width, height] = true_size();
    for wrong in [[width, length, height], [0.5 * length, width, height], [2.0 * length, width, height]] {
        let error = made(wrong).unwrap_err().to_string();
        assert!(
            error.starts_with("options.vehicle_size: ")
                && error.contains("does not fit the silhouettes anywhere"),
            "{error}"
        );
    }
    let report = made([length - 0.4, width, height]).unwrap().report;
    assert!(report.working_box.unwrap().contradicted_m > 0.1, "{:?}", report.working_box);
    assert!(report.warnings.iter().any(|w| w.contains("contradict each other")), "{:?}", report.warnings);
    assert!(made(true_size()).unwrap().report.warnings.is_empty());
}

#[test]
fn a_box_away_from_the_origin_defines_the_plane_and_the_result_stays_in_the_cameras_frame() {
    let scene = without_depth(right_side(160, 120));
    let place = Place { center: [30.0, -12.0, 4.0], yaw: 2.1 };
    let mut elsewhere = scene.clone();
    for view in &mut elsewhere.views {
        let pose = &mut view.camera.vehicle_from_camera;
        *pose = place.vehicle_from_box().after(pose);
    }
    elsewhere.vehicle_box = Some(VehicleBox { size: true_size(), place: Some(place) });
    let options = Options { prior: PriorChoice::Hull, vehicle_size: Some(true_size()), ..Options::default() };
    let made = |scene: &Scene, options: &Options| {
        reconstruct(scene, options, &mut |_| ControlFlow::Continue(())).unwrap()
    };
    let here = made(&scene, &options);
    let there = made(&elsewhere, &Options { vehicle_size: None, ..options });
    assert_eq!(here.gaussians.len(), there.gaussians.len());
    for (here, there) in here.gaussians.means().iter().zip(there.gaussians.means()) {
        let moved = place.vehicle_from_box().transform_point(glam::Vec3::from_array(*here).as_dvec3());
        // Both are f32, some metres and some tens of metres from their origins.
        assert!((moved - glam::Vec3::from_array(*there).as_dvec3()).length() < 2e-5);
    }
    let (a, b) = (here.report.input_error.unwrap(), there.report.input_error.unwrap());
    assert!((a.psnr_db - b.psnr_db).abs() < 0.01 && (a.silhouette_iou - b.silhouette_iou).abs() < 1e-3);
    let size = there.report.vehicle.unwrap();
    for k in 0..3 {
        assert!((size.size_m[k] - true_size()[k]).abs() < size.uncertainty_m[k], "{size:?}");
    }
}

fn run(scene: &Scene, vehicle_size: Option<[f64; 3]>) -> Reconstruction {
    let options = Options { prior: PriorChoice::Hull, vehicle_size, ..Options::default() };
    reconstruct(scene, &options, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// The view with everything left of column `from` cut off, as if the camera's picture began there.
fn cropped(view: &View, from: u32) -> View {
    let (w, h) = (view.camera.width - from, view.camera.height);
    let columns = |v: u32| (from..view.camera.width).map(move |u| (v * view.camera.width + u) as usize);
    let index: Vec<usize> = (0..h).flat_map(columns).collect();
    let mut camera = view.camera;
    camera.width = w;
    camera.intrinsics.cx -= f64::from(from);
    let pixels = index.iter().map(|&i| view.image.pixels()[i]).collect();
    let labels = index.iter().map(|&i| view.mask.as_ref().unwrap().labels()[i]).collect();
    View {
        camera,
        image: vg::scene::RgbImage::new(w, h, pixels).unwrap(),
        mask: Some(Mask::new(w, h, labels).unwrap()),
        depth: None,
        ..view.clone()
    }
}

#[test]
fn a_mask_cut_by_the_border_carves_nothing_beyond_it() {
    let mut scene = without_depth(right_side(320, 240));
    let whole = estimate(&scene, None).working_box.unwrap();
    let [u0, _, u1, _] = scene.views[1].mask.as_ref().unwrap().bounds().unwrap();
    scene.views[1] = cropped(&scene.views[1], (u0 + u1) / 2);
    let cut = estimate(&scene, None);
    let cut_box = cut.working_box.unwrap();
    for k in 0..3 {
        assert!(cut_box.size()[k] > whole.size()[k] - 0.1, "axis {k} lost: {cut_box:?} {whole:?}");
    }
    // With the other views there is a surface under every pixel, about where it was.
    for i in [0, 2, 3] {
        let mask = scene.views[i].mask.as_ref().unwrap();
        let filled = mask
            .labels()
            .iter()
            .zip(cut.depths[i].depth())
            .all(|(l, d)| (*l == Label::Vehicle) == (*d > 0.0));
        assert!(filled, "view {i}");
    }
}

#[test]
fn one_side_view_alone_gets_a_plausible_width() {
    let scene = Scene { views: vec![view("side", camera(-90.0, 6.5, 320, 240))], ..Scene::default() };
    let size = estimate(&without_depth(scene), None).working_box.unwrap().size();
    assert!(size[1] > 1.5 && size[1] < 2.6, "{size:?}");
}

#[test]
fn silhouettes_that_meet_nowhere_are_an_error_with_what_to_check() {
    let mut scene = without_depth(right_side(160, 120));
    // The third camera looks away from the vehicle.
    scene.views[2].camera.vehicle_from_camera.translation.x += 40.0;
    let error = reconstruct(&scene, &Options::default(), &mut |_| ControlFlow::Continue(())).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("silhouettes") && text.contains("poses"), "{text}");
}

#[test]
fn measured_points_correct_the_hull_and_points_outside_it_are_counted() {
    let scene = right_side(320, 240);
    let error = |geometry: &Geometry| -> f32 {
        let all: Vec<f32> = (0..4).flat_map(|i| excess(&scene, geometry, i)).map(f32::abs).collect();
        all.iter().sum::<f32>() / all.len() as f32
    };
    let views = without_depth(scene.clone());
    // Points of the true ellipsoid's right side, and some of the road.
    let on_surface = |i: usize| {
        let (s, c) = (std::f64::consts::PI * (i as f64 * 0.618_034).fract()).sin_cos();
        let z = -0.9 + 1.8 * (i as f64 + 0.5) / 400.0;
        let r = (1.0 - z * z).sqrt();
        [HALF.x * r * c, -HALF.y * r * s, HALF.z * z].map(|v| v as f32)
    };
    let mut points: Vec<[f32; 3]> = (0..400).map(on_surface).collect();
    points.extend((0..30).map(|i| [i as f32 - 15.0, -4.0, -0.7]));
    let with = Scene { cloud: Some(vg::scene::Cloud::new(points).unwrap()), ..views.clone() };
    let threads = Threads::new(2).unwrap();
    let mut proceed = |_| ControlFlow::Continue(());
    let context = Context::new(&threads, &mut proceed);
    let of = |scene: &Scene| {
        HullPrior { cloud: scene.cloud.clone(), ..HullPrior::default() }
            .estimate(&scene.views, &context)
            .unwrap()
    };
    let (corrected, plain) = (of(&with), of(&views));
    let (bent, unbent) = (error(&corrected.geometry), error(&plain.geometry));
    assert!(bent < 0.6 * unbent, "{bent} {unbent}");
    let fit = corrected.report.points.unwrap();
    assert!(fit.outside >= 30 && fit.used + fit.outside == 430 && fit.after_m < 0.01, "{fit:?}");

    let report = run(&with, None).report;
    assert_eq!(report.cloud, Some(fit));
    assert!(report.left_out.iter().any(|l| l.what == "points" && l.count == fit.outside));
    // Given depth ignores points, and the report has an entry for that.
    let given = Scene { cloud: with.cloud, ..scene.clone() };
    let made = reconstruct(&given, &Options::default(), &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(made.report.left_out.iter().any(|l| l.what == "points" && l.count == 430));
}
