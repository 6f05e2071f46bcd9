//! COLMAP models written by pycolmap 4 (tests/make_colmap_models.py) have the values that pycolmap reads.

use glam::DMat4;
use serde_json::Value;
use std::path::{Path, PathBuf};
use vg_scene::io::colmap::{read_model, read_points};
use vg_scene::io::{SceneOptions, list_scene};

fn data() -> PathBuf {
    vg_testing::root().join("tests/data/colmap")
}

fn expected() -> Value {
    serde_json::from_slice(&std::fs::read(data().join("expected.json")).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn cameras_of_all_seven_models_and_images_of_rigs_read_as_pycolmap_wrote_them() {
    let expected = expected();
    for kind in ["bin", "txt"] {
        let model = read_model(&data().join(kind)).unwrap();
        assert_eq!(model.cameras.len(), 8);
        for (id, camera) in &model.cameras {
            let e = &expected["cameras"][id.to_string()];
            assert_eq!(e["model"], camera.model.name());
            assert_eq!(numbers(&e["size"]), [f64::from(camera.width), f64::from(camera.height)]);
            assert_eq!(numbers(&e["params"]), camera.params);
        }
        assert_eq!(model.images.len(), 8);
        assert!(model.images.is_sorted_by(|a, b| a.name < b.name));
        for image in &model.images {
            let e = &expected["images"][image.name.to_str().unwrap()];
            assert_eq!((&e["id"], &e["camera_id"]), (&image.id.into(), &image.camera_id.into()));
            let found = image.world_from_camera.to_row_major();
            let rows: Vec<f64> =
                e["world_from_camera"].as_array().unwrap().iter().flat_map(numbers).collect();
            for (a, b) in found.iter().zip(&rows) {
                // Both files hold every bit; the inverse is computed once for each.
                assert!((a - b).abs() < 1e-14, "{kind} {}: {a} {b}", image.name.display());
            }
            model.camera_of(image).unwrap();
        }
    }
}

#[test]
fn sparse_points_read_as_pycolmap_wrote_them() {
    for kind in ["bin", "txt"] {
        let points = read_points(&data().join(kind)).unwrap().unwrap();
        let mut rows: Vec<Vec<f64>> = points
            .positions
            .iter()
            .zip(&points.colors)
            .map(|(p, c)| p.iter().copied().chain(c.map(f64::from)).collect())
            .collect();
        rows.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let expected: Vec<Vec<f64>> = expected()["points"].as_array().unwrap().iter().map(numbers).collect();
        assert_eq!(rows, expected);
    }
}

#[test]
fn a_model_of_a_version_without_rigs_gives_the_same_result() {
    let dir = tempfile::tempdir().unwrap();
    for file in ["cameras.bin", "images.bin"] {
        std::fs::copy(data().join("bin").join(file), dir.path().join(file)).unwrap();
    }
    assert_eq!(read_model(dir.path()).unwrap(), read_model(&data().join("bin")).unwrap());
    assert_eq!(read_points(dir.path()).unwrap(), None);
}

#[test]
fn binary_files_take_precedence_over_text_files() {
    let dir = tempfile::tempdir().unwrap();
    for file in ["cameras.bin", "images.bin"] {
        std::fs::copy(data().join("bin").join(file), dir.path().join(file)).unwrap();
    }
    for file in ["cameras.txt", "images.txt"] {
        std::fs::write(dir.path().join(file), "broken").unwrap();
    }
    read_model(dir.path()).unwrap();
}

#[test]
fn a_model_without_a_gauge_is_refused_and_with_one_is_scaled_turned_and_moved() {
    let dir = tempfile::tempdir().unwrap();
    let model = dir.path().join("sparse/0");
    std::fs::create_dir_all(&model).unwrap();
    for file in ["cameras.bin", "images.bin", "points3D.bin"] {
        std::fs::copy(data().join("bin").join(file), model.join(file)).unwrap();
    }
    let error = list_scene(dir.path(), &SceneOptions::default()).unwrap_err().to_string();
    assert!(error.contains("vehicle_from_world") && error.contains("--vehicle-from-world"), "{error}");

    let m = [0.0, -2.0, 0.0, 1.5, 2.0, 0.0, 0.0, -1.0, 0.0, 0.0, 2.0, 0.25, 0.0, 0.0, 0.0, 1.0];
    let vehicle_from_world = vg_geometry::Similarity::from_row_major("m", &m).unwrap();
    let options = SceneOptions { vehicle_from_world: Some(vehicle_from_world), ..SceneOptions::default() };
    // The folder above, the model's own, and those between them are one scene.
    for path in ["", "sparse", "sparse/0"] {
        let index = list_scene(&dir.path().join(path), &options).unwrap();
        assert_eq!(index.views.len(), 8);
        let world = read_model(&model).unwrap();
        let matrix = DMat4::from_cols_array(&m).transpose();
        for (view, image) in index.views.iter().zip(&world.images) {
            let expected = matrix.transform_point3(image.world_from_camera.translation);
            assert!((view.camera.center() - expected).length() < 1e-12);
            assert!((view.camera.vehicle_from_camera.rotation.determinant() - 1.0).abs() < 1e-12);
        }
        let (points, colors) = index.sparse_points().unwrap().unwrap();
        assert_eq!((points.len(), colors.len()), (6, 6));
    }
}

#[test]
fn images_with_spaces_in_their_names_are_read_with_or_without_features() {
    use vg_scene::io::colmap::images_from_text;
    let record = |id: u32, name: &str| format!("{id} 1 0 0 0 0 0 {id}.5 1 {name}\n");
    let names = ["two  spaces here.png", "a b c.png", "plain.png"];
    let path = Path::new("images.txt");
    for features in ["\n", "1.5 2.5 -1 3 4 18446744073709551615\n"] {
        let text: String =
            names.iter().enumerate().map(|(i, name)| record(i as u32 + 1, name) + features).collect();
        // The last image's line of features may be missing with its end.
        for text in [text.clone(), text.strip_suffix(features).unwrap().to_owned()] {
            let found = images_from_text(text.as_bytes(), path).unwrap();
            assert_eq!(found.iter().map(|i| i.name.to_str().unwrap()).collect::<Vec<_>>(), names);
        }
    }
    // Twelve words in a line that is the next image are not four features.
    let squeezed: String = names.iter().enumerate().map(|(i, name)| record(i as u32 + 1, name)).collect();
    let error = images_from_text(squeezed.as_bytes(), path).unwrap_err().to_string();
    assert!(error.contains("images.txt: line 2: not POINTS2D"), "{error}");
}
