//! Scenes on disk: the bundled sedan by both of its descriptions, and small scenes made here.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use vg::io::image::{write_depth16, write_mask, write_rgb8, write_rgba8};
use vg::io::{SceneOptions, list_scene, open_scene, read_vehicle_from_world, vehicle_from_known_centers};
use vg::scene::mask::{Label, Mask};

fn sedan() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/sedan")
}

fn named(views: &[&str]) -> SceneOptions {
    SceneOptions { views: Some(views.iter().map(|v| (*v).to_owned()).collect()), ..SceneOptions::default() }
}

/// The sedan's COLMAP model alone.
fn sedan_colmap() -> SceneOptions {
    let vehicle_from_world = read_vehicle_from_world(&sedan().join("vehicle_from_world.json")).unwrap();
    SceneOptions { vehicle_from_world: Some(vehicle_from_world), ..SceneOptions::default() }
}

#[test]
fn the_sedan_s_two_descriptions_are_one_scene() {
    let poses = open_scene(&sedan(), &SceneOptions::default()).unwrap();
    // transforms.json wins in a folder with both, so the model is named.
    let colmap = open_scene(&sedan().join("sparse/0"), &sedan_colmap()).unwrap();
    assert_eq!((poses.scene.views.len(), colmap.scene.views.len()), (8, 8));
    assert_eq!((&poses.notes, &colmap.notes), (&vec![], &vec![]));
    for (a, b) in poses.scene.views.iter().zip(&colmap.scene.views) {
        assert_eq!(a.name, b.name);
        assert_eq!((&a.image, &a.mask, &a.depth), (&b.image, &b.mask, &b.depth));
        assert!(a.mask.is_some());
        let (p, q) = (a.camera.vehicle_from_camera, b.camera.vehicle_from_camera);
        assert!((p.translation - q.translation).length() < 1e-9, "{}", a.name);
        assert!((p.rotation - q.rotation).to_cols_array().iter().all(|d| d.abs() < 1e-9));
        assert_eq!(a.camera.intrinsics, b.camera.intrinsics);
    }
    // Depth is metres off the camera, whatever the model's gauge.
    let depth = colmap.scene.views[0].depth.as_ref().unwrap().depth();
    let nearest = depth.iter().filter(|d| **d > 0.0).fold(f32::INFINITY, |a, &b| a.min(b));
    assert!((1.0..20.0).contains(&nearest), "{nearest}");
}

#[test]
fn sparse_points_of_the_sedan_lie_on_a_car_in_the_vehicle_frame() {
    let index = list_scene(&sedan().join("sparse/0"), &sedan_colmap()).unwrap();
    let (points, _) = index.sparse_points().unwrap().unwrap();
    assert!(points.len() > 100);
    assert!(points.iter().all(|p| p[0].abs() < 3.0 && p[1].abs() < 1.3 && p[2].abs() < 1.2));
}

#[test]
fn the_gauge_is_found_from_camera_centres() {
    let truth = list_scene(&sedan(), &SceneOptions::default()).unwrap();
    let known: Vec<_> = truth.cameras().iter().map(|c| (c.name.clone(), c.camera.center())).collect();
    let found = vehicle_from_known_centers(&sedan().join("sparse/0"), &known).unwrap();
    assert!(found.residuals.iter().all(|r| *r < 1e-9), "{:?}", found.residuals);
    let expected = sedan_colmap().vehicle_from_world.unwrap();
    assert!((found.similarity.scale / expected.scale - 1.0).abs() < 1e-9);
}

#[test]
fn views_are_chosen_by_path_file_name_or_stem_in_the_order_asked() {
    let chosen = |names: &[&str]| list_scene(&sedan(), &named(names)).map(|i| i.cameras());
    let names: Vec<String> =
        chosen(&["003", "images/001.png", "002.png", "003"]).unwrap().into_iter().map(|c| c.name).collect();
    assert_eq!(names, ["003.png", "001.png", "002.png", "003.png"]);
    let error = chosen(&["000", "door"]).unwrap_err().to_string();
    assert!(error.contains("views[1]") && error.contains("door") && error.contains("007.png"), "{error}");
}

/// A folder with a 4x2 picture `images/a.png` and the keys of its frame.
struct Small {
    dir: tempfile::TempDir,
}

const POSE: &str = "[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]";

impl Small {
    fn new(frame_keys: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("images/sub")).unwrap();
        let small = Self { dir };
        small.transforms(&format!(
            r#"{{"fl_x": 4, "frames": [{{"file_path": "images/a.png", {frame_keys} "transform_matrix": {POSE}}}]}}"#
        ));
        write_rgb8(&small.path("images/a.png"), 4, 2, &[[9; 3]; 8]).unwrap();
        small
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.dir.path().join(relative)
    }

    fn transforms(&self, text: &str) {
        fs::write(self.path("transforms.json"), text).unwrap();
    }

    fn mask(&self, relative: &str, width: u32) {
        fs::create_dir_all(self.path(relative).parent().unwrap()).unwrap();
        let mut labels = vec![Label::Background; width as usize * 2];
        labels[1] = Label::Vehicle;
        write_mask(&self.path(relative), &Mask::new(width, 2, labels).unwrap()).unwrap();
    }

    fn open(&self) -> vg::Result<vg::io::SceneFiles> {
        open_scene(self.dir.path(), &SceneOptions::default())
    }

    fn vehicle_pixels(&self) -> Option<usize> {
        self.open().unwrap().scene.views[0].mask.as_ref().map(Mask::vehicle_pixels)
    }
}

#[test]
fn without_w_and_h_the_picture_s_size_counts() {
    let camera = Small::new("").open().unwrap().scene.views[0].camera;
    assert_eq!((camera.width, camera.height, camera.intrinsics.cx, camera.intrinsics.cy), (4, 2, 2.0, 1.0));
}

#[test]
fn cameras_with_sizes_are_listed_without_any_picture() {
    let small = Small::new(r#""w": 4, "h": 2,"#);
    fs::remove_file(small.path("images/a.png")).unwrap();
    assert_eq!(list_scene(small.dir.path(), &SceneOptions::default()).unwrap().cameras().len(), 1);
    let error = small.open().unwrap_err().to_string();
    assert!(error.contains("images/a.png"), "{error}");
}

#[test]
fn a_picture_of_another_size_is_an_error_that_names_both_sizes() {
    let error = Small::new(r#""w": 8, "h": 4,"#).open().unwrap_err().to_string();
    assert!(error.contains("a.png: size: 4x2") && error.contains("8x4"), "{error}");
    let small = Small::new("");
    small.mask("masks/a.png", 3);
    let error = small.open().unwrap_err().to_string();
    assert!(error.contains("masks/a.png: size: 3x2") && error.contains("4x2"), "{error}");
}

#[test]
fn masks_are_found_by_stem_by_file_name_and_in_subfolders() {
    assert_eq!(Small::new("").vehicle_pixels(), None);
    for path in ["masks/a.png", "masks/a.png.png", "masks/images/a.png"] {
        let small = Small::new("");
        small.mask(path, 4);
        assert_eq!(small.vehicle_pixels(), Some(1), "{path}");
    }
    let small = Small::new("");
    small.transforms(&format!(
        r#"{{"fl_x": 4, "frames": [{{"file_path": "./images/sub/b.png", "transform_matrix": {POSE}}}]}}"#
    ));
    write_rgb8(&small.path("images/sub/b.png"), 4, 2, &[[9; 3]; 8]).unwrap();
    small.mask("masks/sub/b.png", 4);
    assert_eq!(small.vehicle_pixels(), Some(1));
    assert_eq!(small.open().unwrap().index.views[0].name, "sub/b.png");
}

#[test]
fn alpha_is_the_mask_where_there_is_no_other_and_full_alpha_says_nothing() {
    let small = Small::new("");
    let mut pixels = [[1, 2, 3, 255]; 8];
    write_rgba8(&small.path("images/a.png"), 4, 2, &pixels).unwrap();
    assert_eq!(small.vehicle_pixels(), None);
    pixels[0][3] = 127;
    pixels[1][3] = 128;
    write_rgba8(&small.path("images/a.png"), 4, 2, &pixels).unwrap();
    assert_eq!(small.vehicle_pixels(), Some(7));
    small.mask("masks/a.png", 4);
    assert_eq!(small.vehicle_pixels(), Some(1));
}

#[test]
fn a_mask_of_zeros_and_ones_is_empty_and_noted() {
    let small = Small::new(r#""mask_path": "m.png","#);
    let gray = [[0u8; 3], [1; 3], [1; 3], [0; 3], [0; 3], [0; 3], [0; 3], [0; 3]];
    write_rgb8(&small.path("m.png"), 4, 2, &gray).unwrap();
    let opened = small.open().unwrap();
    assert_eq!(opened.scene.views[0].mask.as_ref().unwrap().vehicle_pixels(), 0);
    assert!(opened.notes[0].contains("m.png: the largest value is 1"), "{:?}", opened.notes);
}

#[test]
fn depth_is_millimetres_unless_the_scene_or_the_caller_says_otherwise() {
    let metres = [0.0, 1.234, 60.0, 70.0, f32::NAN, -1.0, 1e-5, 2.0];
    for (top, asked, expected) in [("", None, 1.234), ("2e-3", None, 2.468), ("2e-3", Some(1e-2), 12.34)] {
        let small = Small::new("");
        let unit =
            if top.is_empty() { String::new() } else { format!(r#""depth_unit_scale_factor": {top},"#) };
        small.transforms(&format!(
            r#"{{"fl_x": 4, {unit} "frames": [{{"file_path": "images/a.png", "depth_file_path": "d.png", "transform_matrix": {POSE}}}]}}"#
        ));
        // 70 m do not fit in 16 bits of millimetres.
        assert_eq!(write_depth16(&small.path("d.png"), 4, 2, &metres).unwrap(), 1);
        let options = SceneOptions { depth_scale: asked, ..SceneOptions::default() };
        let opened = open_scene(small.dir.path(), &options).unwrap();
        let depth = opened.scene.views[0].depth.as_ref().unwrap().depth().to_vec();
        assert_eq!(depth[1], expected);
        assert_eq!((depth[0], depth[3], depth[4], depth[5]), (0.0, 0.0, 0.0, 0.0));
        assert!(depth[6] > 0.0, "a measurement below half a millimetre stays one");
        let options = SceneOptions { load_depth: false, ..options };
        assert!(open_scene(small.dir.path(), &options).unwrap().scene.views[0].depth.is_none());
    }
}

#[test]
fn poses_that_were_moved_need_the_vehicle_frame() {
    let small = Small::new("");
    let text = fs::read_to_string(small.path("transforms.json")).unwrap();
    small.transforms(&text.replacen('{', r#"{"applied_transform": [[0,1,0,0],[1,0,0,0],[0,0,-1,0]],"#, 1));
    let error = small.open().unwrap_err().to_string();
    assert!(error.contains("applied_transform") && error.contains("--vehicle-from-world"), "{error}");
    let options = sedan_colmap();
    open_scene(small.dir.path(), &options).unwrap();
}

#[test]
fn the_shared_scenes_open_by_both_descriptions() {
    let root = std::env::var_os("VG_SHARED_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    if !root.join("carset").is_dir() {
        common::say(&format!("skipped: {} has no carset (VG_SHARED_DATA says where it is)", root.display()));
        return;
    }
    for instance in fs::read_dir(root.join("carset")).unwrap().map(|e| e.unwrap().path()) {
        if !instance.join("transforms.json").is_file() {
            continue;
        }
        let posed = open_scene(&instance, &SceneOptions::default()).unwrap();
        assert_eq!(posed.scene.views.len(), 40);
        assert!(posed.scene.views.iter().all(|v| v.mask.is_some() && v.depth.is_some()));
        // The model is a real reconstruction: its centres fit the true ones to a few centimetres.
        let registered = vg::io::colmap::read_model(&instance.join("sparse/0")).unwrap();
        let registered: Vec<_> = registered.images.iter().map(|i| i.name.to_str().unwrap()).collect();
        let known: Vec<_> = posed
            .index
            .cameras()
            .into_iter()
            .filter(|c| registered.contains(&c.name.as_str()))
            .map(|c| (c.name, c.camera.center()))
            .collect();
        let model = instance.join("sparse/0");
        let found = vehicle_from_known_centers(&model, &known).unwrap();
        let rms = (found.residuals.iter().map(|r| r * r).sum::<f64>() / known.len() as f64).sqrt();
        assert!(rms < 0.1, "{}: {rms} m", instance.display());
        let options = SceneOptions { vehicle_from_world: Some(found.similarity), ..SceneOptions::default() };
        let opened = open_scene(&model, &options).unwrap();
        assert_eq!(opened.scene.views.len(), known.len());
        let points = opened.index.sparse_points().unwrap().unwrap().0.len();
        println!("{}: {} views, {points} points, {rms:.4} m", instance.display(), known.len());
    }
    for sample in fs::read_dir(root.join("nurec_sample")).unwrap().map(|e| e.unwrap().path()) {
        let opened = open_scene(&sample, &SceneOptions::default()).unwrap();
        assert_eq!(opened.scene.views.len(), 5);
    }
}
