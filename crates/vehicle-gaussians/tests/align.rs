//! Alignment of worlds of arbitrary position, rotation and scale to the vehicle's frame, on vehicles made of boxes and
//! on ray-traced ones.

use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};
use std::time::Instant;
use vg::align::{Heading, to_box, to_scan};
use vg::geometry::Similarity;
use vg::scene::Cloud;
use vg_testing::boxes::{car, cloud, gauge, hatchback, inverse, scan, sparse, symmetric, views};
use vg_testing::say;

/// Scale error (1), rotation error (degrees), and shift of the vehicle's middle (metres).
fn errors(found: &Similarity, truth: &Similarity) -> (f64, f64, f64) {
    let scale = found.scale / truth.scale - 1.0;
    let r: DMat3 = found.rotation * truth.rotation.transpose();
    let trace = r.x_axis.x + r.y_axis.y + r.z_axis.z;
    let angle = (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees();
    let middle = inverse(truth).translation;
    (scale, angle, found.transform_point(middle).length())
}

/// Asserts half a per cent, half a degree, three centimetres.
fn assert_close(what: &str, found: &Similarity, truth: &Similarity) {
    let (scale, angle, position) = errors(found, truth);
    let close = scale.abs() <= 0.005 && angle <= 0.5 && position <= 0.03;
    assert!(close, "{what}: scale {:+.3} %, {angle:.3} degrees, {position:.4} m", 100.0 * scale);
}

/// The similarity with front and back exchanged.
fn turned(s: &Similarity) -> Similarity {
    let half = DMat3::from_rotation_z(std::f64::consts::PI);
    Similarity { rotation: half * s.rotation, translation: half * s.translation, ..*s }
}

#[test]
fn a_noisy_scan_with_strays_is_found_from_any_gauge() {
    let shape = hatchback();
    let points = cloud(&scan(&shape, 20_000, 1));
    for seed in 0..4 {
        let truth = gauge(seed);
        let views = views(&shape, 12, &truth);
        // Half of the worlds have no sparse points at all.
        let sparse = if seed % 2 == 0 { sparse(&shape, &truth, seed) } else { Vec::new() };
        let found = to_scan(&views, &sparse, &points, Heading::Auto).unwrap();
        assert_close(&format!("gauge {seed}"), &found.vehicle_from_world, &truth);
        assert!(found.confidence > 0.3 && found.residual_m < 0.02 && found.views == 12, "{found:?}");
        assert!((found.vehicle_from_world.rotation.determinant() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let (shape, truth) = (hatchback(), gauge(7));
    let (views, sparse) = (views(&shape, 8, &truth), sparse(&shape, &truth, 7));
    let points = cloud(&scan(&shape, 8_000, 7));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let box_ = to_box(&views, &sparse, [4.2, 1.8, 1.5], Heading::Forward).unwrap();
            (to_scan(&views, &sparse, &points, Heading::Auto).unwrap(), box_)
        })
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn equal_ends_are_refused_unless_a_heading_is_given() {
    let (shape, truth) = (symmetric(), gauge(2));
    let (views, sparse) = (views(&shape, 12, &truth), sparse(&shape, &truth, 2));
    let points = cloud(&scan(&shape, 12_000, 2));
    let error = to_scan(&views, &sparse, &points, Heading::Auto).unwrap_err().to_string();
    assert!(error.starts_with("heading: auto, but front and back cannot be told apart"), "{error}");
    assert!(error.contains("forward if 000.png was taken from ahead"), "{error}");
    // The first view stands 29 degrees left of straight ahead.
    let forward = to_scan(&views, &sparse, &points, Heading::Forward).unwrap();
    assert_eq!(forward.heading_view.as_deref(), Some("000.png"));
    assert!(forward.confidence < 0.1);
    assert_close("forward", &forward.vehicle_from_world, &truth);
    let backward = to_scan(&views, &sparse, &points, Heading::Backward).unwrap();
    assert_close("backward", &backward.vehicle_from_world, &turned(&truth));
}

#[test]
fn a_mirrored_scan_is_never_fitted_by_a_reflection() {
    // A box on the left side makes left and right differ.
    let mut shape = hatchback();
    shape.push([DVec3::new(-1.8, 0.9, -0.4), DVec3::new(-0.2, 1.5, 0.5)]);
    let truth = gauge(3);
    let views = views(&shape, 12, &truth);
    let right = scan(&shape, 12_000, 3);
    let mirrored: Vec<DVec3> = right.iter().map(|p| DVec3::new(p.x, -p.y, p.z)).collect();
    let fits = to_scan(&views, &[], &cloud(&right), Heading::Auto).unwrap();
    assert_close("crate", &fits.vehicle_from_world, &truth);
    if let Ok(found) = to_scan(&views, &[], &cloud(&mirrored), Heading::Auto) {
        assert!((found.vehicle_from_world.rotation.determinant() - 1.0).abs() < 1e-9);
        assert!(found.residual_px > 2.0 * fits.residual_px, "{found:?}");
    }
}

/// A hatchback with rows of bars on its roof, 10 cm apart, like the superstructure of a ladder truck.
fn with_open_structure() -> vg_testing::boxes::Shape {
    let mut shape = hatchback();
    for k in 0..26 {
        let x = -2.0 + 0.14 * f64::from(k);
        for y in [-0.7, 0.66] {
            shape.push([DVec3::new(x, y, 0.2), DVec3::new(x + 0.04, y + 0.04, 1.9)]);
        }
    }
    shape
}

#[test]
fn a_vehicle_with_open_structures_is_judged_by_edges_against_open_background() {
    let (shape, truth) = (with_open_structure(), gauge(5));
    let all = views(&shape, 12, &truth);
    let found = to_scan(&all, &[], &cloud(&scan(&shape, 20_000, 5)), Heading::Auto).unwrap();
    // Confusing a bar with its neighbour leaves a larger residual than a closed vehicle has.
    let (scale, angle, position) = errors(&found.vehicle_from_world, &truth);
    assert!(scale.abs() <= 0.01 && angle <= 0.5 && position <= 0.03, "{scale} {angle} {position}");
    // The mean alone exceeds the limit, 5 pixels of a picture 512 wide.
    assert!(found.residual_px > 5.0 * 320.0 / 512.0, "{found:?}");
}

#[test]
fn impossible_alignments_are_refused_with_the_reason() {
    let (shape, truth) = (hatchback(), gauge(4));
    let all = views(&shape, 8, &truth);
    let points = scan(&shape, 8_000, 4);
    let refused = |views: &[vg::View], points: &[DVec3], words: [&str; 2]| {
        let error = to_scan(views, &[], &cloud(points), Heading::Auto).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    refused(&all[..2], &points, ["views: 2", "at least 3"]);
    let unmasked: Vec<_> = all.iter().cloned().map(|v| vg::View { mask: None, ..v }).collect();
    refused(&unmasked, &points, ["views: 0", "at least 3"]);
    refused(&all, &points[..50], ["scan: 50 points", "at least 200"]);
    let millimetres: Vec<DVec3> = points.iter().map(|p| 1000.0 * *p).collect();
    refused(&all, &millimetres, ["scan: a box of", "a vehicle in metres"]);
    // A tall cabinet is not the vehicle of the masks.
    let cabinet = vec![[DVec3::new(-0.4, -0.4, -1.5), DVec3::new(0.4, 0.4, 1.5)]];
    refused(&all, &scan(&cabinet, 8_000, 4), ["outline misses the masks", "of this vehicle and in metres"]);
}

#[test]
fn a_box_on_the_ground_gives_the_frame_once_the_front_is_known() {
    let (shape, truth) = (hatchback(), gauge(5));
    let (views, points) = (views(&shape, 16, &truth), sparse(&shape, &truth, 5));
    let size = [4.2, 1.8, 1.5];
    let found = to_box(&views, &points, size, Heading::Forward).unwrap();
    let (scale, angle, position) = errors(&found.vehicle_from_world, &truth);
    // Flat faces that no view looks along are the worst case: the hull bulges beyond them.
    assert!(scale.abs() < 0.06 && angle < 1.0 && position < 0.1, "{scale} {angle} {position}");
    assert!(found.confidence > 0.8 && found.residual_m < 0.15, "{found:?}");
    let back = to_box(&views, &points, size, Heading::Backward).unwrap();
    assert!(errors(&back.vehicle_from_world, &turned(&truth)).1 < 2.0);

    let refused = |points: &[DVec3], size, heading, word: &str| {
        let error = to_box(&views, points, size, heading).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    };
    refused(&points, size, Heading::Auto, "heading: auto, but a box is the same");
    refused(&[], size, Heading::Forward, "sparse: 0 points that show no ground");
    refused(&points, [4.2, 1.8, 0.0], Heading::Forward, "size");
    let other = [3.0, 3.0, 3.0];
    refused(&points, other, Heading::Forward, "does not fit the masks' hull");
    refused(&points, other, Heading::Forward, "check that the size is of this vehicle and in metres");
}

#[test]
fn a_cabin_slightly_off_the_middle_distinguishes_front_from_back() {
    let (shape, truth) = (car([-1.5, 0.9]), gauge(6));
    let points = cloud(&scan(&shape, 12_000, 6));
    let found = to_scan(&views(&shape, 12, &truth), &[], &points, Heading::Auto).unwrap();
    assert_close("off the middle", &found.vehicle_from_world, &truth);
}

/// The ray-traced vehicles with true poses. Prints a line if there are none.
fn carset() -> Option<PathBuf> {
    let folder = std::env::var_os("VG_CARSET").map(PathBuf::from);
    if folder.is_none() {
        // These are data, not a tool, so VG_NO_SKIP does not require them.
        say("skipped: no ray-traced vehicles with true poses (VG_CARSET is their folder)");
    }
    folder
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The best similarity from COLMAP's camera centres to the true ones, and its root mean square residual, metres.
fn truth(folder: &Path) -> (Similarity, f64) {
    let vehicle = json(&folder.join("vehicle.json"));
    let model = vg::io::colmap::read_model(&folder.join("sparse/0")).unwrap();
    let (mut from, mut to) = (Vec::new(), Vec::new());
    for image in &model.images {
        let mut views = vehicle["views"].as_array().unwrap().iter();
        let view = views.find(|v| v["file"].as_str() == image.name.to_str()).unwrap();
        let at = |row: usize| view["T_vc"][row][3].as_f64().unwrap();
        from.push(image.world_from_camera.translation);
        to.push(DVec3::new(at(0), at(1), at(2)));
    }
    let best = Similarity::umeyama(&from, &to).unwrap();
    let squares: f64 = from.iter().zip(&to).map(|(f, t)| best.transform_point(*f).distance_squared(*t)).sum();
    (best, (squares / from.len() as f64).sqrt())
}

#[test]
fn ten_vehicles_are_aligned_within_half_a_percent_half_a_degree_and_three_centimetres() {
    let Some(carset) = carset() else { return };
    let mut folders: Vec<PathBuf> = std::fs::read_dir(&carset).unwrap().map(|e| e.unwrap().path()).collect();
    folders.retain(|f| f.join("pcd.ply").is_file());
    folders.sort();
    assert_eq!(folders.len(), 10);
    say(
        "| vehicle | scale | rotation | position | residual | confidence | points off the scan | COLMAP's centres | time |",
    );
    let mut boxes = Vec::new();
    for folder in &folders {
        let start = Instant::now();
        // The folder has true poses in its transforms.json as well, so the model is named.
        let scene = vg::io::read_masked(&folder.join("sparse/0")).unwrap();
        let (points, _) = vg::io::ply::read_points(&folder.join("pcd.ply")).unwrap();
        let points = Cloud::new(points).unwrap();
        let found = to_scan(&scene.views, &scene.points, &points, Heading::Auto).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let name = folder.file_name().unwrap().to_string_lossy();
        let (truth, centers_m) = truth(folder);
        let (scale, angle, position) = errors(&found.vehicle_from_world, &truth);
        say(&format!(
            "| {name} | {:+.2} % | {angle:.2}° | {:.1} cm | {:.1} mm | {:.2} | {:.0} mm | {:.1} mm | {seconds:.1} s |",
            100.0 * scale,
            100.0 * position,
            1e3 * found.residual_m,
            found.confidence,
            1e3 * found.points_m,
            1e3 * centers_m,
        ));
        assert_close(&name, &found.vehicle_from_world, &truth);
        assert!(found.confidence > 0.5, "{name}: {found:?}");

        // With a box alone, after giving the heading of the first view.
        let vehicle = json(&folder.join("vehicle.json"));
        let size = ["length_m", "width_m", "height_m"].map(|key| vehicle[key].as_f64().unwrap());
        let fits = [Heading::Forward, Heading::Backward].map(|heading| {
            let found = to_box(&scene.views, &scene.points, size, heading).unwrap();
            (errors(&found.vehicle_from_world, &truth), found)
        });
        let ((scale, angle, position), found) = if fits[0].0.1 < fits[1].0.1 { &fits[0] } else { &fits[1] };
        boxes.push(format!(
            "| {name} | {:+.1} % | {angle:.1}° | {:.0} cm | {:.0} mm | {:.2} |",
            100.0 * scale,
            100.0 * position,
            1e3 * found.residual_m,
            found.confidence
        ));
        assert!(scale.abs() < 0.03 && *angle < 3.0 && *position < 0.12, "{name}: {fits:?}");
    }
    say("by its box:\n| vehicle | scale | rotation | position | residual | confidence |");
    boxes.iter().for_each(|line| say(line));
}
