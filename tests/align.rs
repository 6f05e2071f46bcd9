//! Alignment of an arbitrary gauge to the vehicle's frame.

mod common;

use common::say;
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};
use std::time::Instant;
use vg::align::{Heading, to_scan};
use vg::geometry::Similarity;
use vg::scene::Cloud;

/// The ray-traced vehicles with true poses, or `None`, which is printed.
fn carset() -> Option<PathBuf> {
    let folder = std::env::var_os("VG_CARSET").map(PathBuf::from);
    if folder.is_none() {
        let line = "skipped: no vehicles with true poses (VG_CARSET says where they are)";
        say(line);
        assert!(std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
    }
    folder
}

/// The similarity from COLMAP's camera centres to the true ones.
fn truth(folder: &Path) -> Similarity {
    let vehicle: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("vehicle.json")).unwrap()).unwrap();
    let model = vg::io::colmap::read_model(&folder.join("sparse/0")).unwrap();
    let (mut from, mut to) = (Vec::new(), Vec::new());
    for image in &model.images {
        let view = vehicle["views"].as_array().unwrap().iter();
        let view = view.clone().find(|v| v["file"].as_str() == image.name.to_str()).unwrap();
        let at = |row: usize| view["T_vc"][row][3].as_f64().unwrap();
        from.push(image.world_from_camera.translation);
        to.push(DVec3::new(at(0), at(1), at(2)));
    }
    Similarity::umeyama(&from, &to).unwrap()
}

/// Scale error (1), rotation error (degrees), and how far the vehicle's middle is moved (metres).
fn errors(found: &Similarity, truth: &Similarity) -> (f64, f64, f64) {
    let scale = found.scale / truth.scale - 1.0;
    let r: DMat3 = found.rotation * truth.rotation.transpose();
    let trace = r.x_axis.x + r.y_axis.y + r.z_axis.z;
    let angle = (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees();
    let middle = truth.rotation.transpose() * (-truth.translation / truth.scale);
    (scale, angle, found.transform_point(middle).length())
}

#[test]
fn ten_vehicles_are_aligned_within_half_a_percent_half_a_degree_and_three_centimetres() {
    let Some(carset) = carset() else { return };
    let mut folders: Vec<PathBuf> = std::fs::read_dir(&carset).unwrap().map(|e| e.unwrap().path()).collect();
    folders.retain(|f| f.join("pcd.ply").is_file());
    folders.sort();
    for folder in &folders {
        let start = Instant::now();
        let scene = vg::io::read_masked(&folder.join("sparse/0")).unwrap();
        let (points, _) = vg::io::ply::read_points(&folder.join("pcd.ply")).unwrap();
        let cloud = Cloud::new(points).unwrap();
        let found = to_scan(&scene.views, &scene.points, &cloud, Heading::Auto);
        let seconds = start.elapsed().as_secs_f64();
        let name = folder.file_name().unwrap().to_string_lossy();
        let found = match found {
            Ok(found) => found,
            Err(e) => {
                say(&format!("| {name} | {e}"));
                continue;
            }
        };
        let vehicle: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("vehicle.json")).unwrap()).unwrap();
        let size = ["length_m", "width_m", "height_m"].map(|k| vehicle[k].as_f64().unwrap());
        for h in [Heading::Forward, Heading::Backward] {
            let start = Instant::now();
            match vg::align::to_box(&scene.views, &scene.points, size, h) {
                Ok(b) => say(&format!(
                    "{:?} {:?} {:?} {:?} {size:?} {}",
                    start.elapsed(),
                    errors(&b.vehicle_from_world, &truth(folder)),
                    b.confidence,
                    b.found_m,
                    b.asked_view
                )),
                Err(e) => say(&e.to_string()),
            }
        }
        let (scale, angle, position) = errors(&found.vehicle_from_world, &truth(folder));
        say(&format!(
            "| {name} | {:+.3} | {angle:.3} | {:.2} | {:.1} mm | {:.2} px / {:.2} | {:.2} | {} ({:.1} mm) | {seconds:.1} |",
            100.0 * scale,
            100.0 * position,
            1e3 * found.residual_m,
            found.residual_px,
            found.other_px,
            found.confidence,
            found.points,
            1e3 * found.points_m
        ));
    }
}
