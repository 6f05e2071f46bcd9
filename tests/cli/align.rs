//! `vg align`: from known camera centres to the file that `--vehicle-from-world` reads.

use super::*;
use std::fs;

#[test]
fn known_centers_of_the_sample_give_its_similarity_and_small_residuals() {
    let scene = copy_of_sample(&["sparse"]);
    let truth = vg::io::list_scene(&sample(), &vg::io::SceneOptions::default()).unwrap();
    let centers: serde_json::Map<_, _> = truth
        .cameras()
        .into_iter()
        .map(|c| (c.name, serde_json::json!(c.camera.center().to_array())))
        .collect();
    fs::write(scene.path().join("centers.json"), serde_json::to_vec(&centers).unwrap()).unwrap();
    let out = succeed(scene.path(), "align {} --known-centers {}/centers.json -o {}/v.json").out;
    assert!(out.contains("rms residual 0.0000 m") && out.contains("007.png"), "{out}");
    let found = vg::io::read_vehicle_from_world(&scene.path().join("v.json")).unwrap();
    let expected = vg::io::read_vehicle_from_world(&sample().join("vehicle_from_world.json")).unwrap();
    let pairs = found.to_row_major().into_iter().zip(expected.to_row_major());
    // The model's poses are written with 17 digits.
    assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-9);
}

#[test]
fn too_few_centers_and_unknown_names_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("two.json"), r#"{"000.png": [0, 0, 0], "001.png": [1, 0, 0]}"#).unwrap();
    fs::write(at.join("other.json"), r#"{"900.png": [0, 0, 0], "001.png": [1, 0, 0], "002.png": [0, 1, 0]}"#)
        .unwrap();
    fs::write(at.join("words.json"), r#"{"000.png": "here"}"#).unwrap();
    fail(at, "align . --known-centers {}/two.json -o {}/v.json", 1, &["two.json", "at least 3"]);
    fail(at, "align . --known-centers {}/other.json -o {}/v.json", 1, &["900.png", "000.png"]);
    fail(at, "align . --known-centers {}/words.json -o {}/v.json", 1, &["words.json", "000.png"]);
    assert!(!at.join("v.json").exists());
}
