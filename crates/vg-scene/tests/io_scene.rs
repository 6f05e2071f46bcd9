//! Scenes on disk: the bundled sedan by both of its descriptions, and small scenes that the tests make.

use std::fs;
use std::path::{Path, PathBuf};
use vg_scene::io::image::{write_depth16, write_mask, write_rgb8, write_rgba8};
use vg_scene::io::{
    SceneOptions, list_scene, open_scene, read_vehicle_from_world, vehicle_from_known_centers,
};
use vg_scene::mask::{Label, Mask};

fn sedan() -> PathBuf {
    vg_testing::root().join("tests/data/sedan")
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
fn the_two_descriptions_of_the_sedan_give_the_same_scene() {
    let poses = open_scene(&sedan(), &SceneOptions::default()).unwrap();
    // transforms.json takes precedence in a folder with both, so the model is named.
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
    // Depth is in metres from the camera, whatever the scale of the model.
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
fn the_similarity_is_found_from_camera_centres() {
    let truth = list_scene(&sedan(), &SceneOptions::default()).unwrap();
    let known: Vec<_> = truth.cameras().iter().map(|c| (c.name.clone(), c.camera.center())).collect();
    let found = vehicle_from_known_centers(&sedan().join("sparse/0"), &known).unwrap();
    assert!(found.residuals.iter().all(|r| *r < 1e-9), "{:?}", found.residuals);
    let expected = sedan_colmap().vehicle_from_world.unwrap();
    assert!((found.similarity.scale / expected.scale - 1.0).abs() < 1e-9);
}

#[test]
fn views_are_chosen_by_path_file_name_or_stem_in_the_given_order() {
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

    fn open(&self) -> vg_geometry::Result<vg_scene::io::SceneFiles> {
        open_scene(self.dir.path(), &SceneOptions::default())
    }

    fn vehicle_pixels(&self) -> Option<usize> {
        self.open().unwrap().scene.views[0].mask.as_ref().map(Mask::vehicle_pixels)
    }
}

#[test]
fn without_w_and_h_the_size_of_the_picture_is_used() {
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
fn alpha_is_the_mask_if_there_is_no_other_and_opaque_alpha_is_ignored() {
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
fn a_mask_of_zeros_and_ones_is_read_and_one_of_classes_is_an_error_with_the_rule() {
    let small = Small::new(r#""mask_path": "m.png","#);
    let grey = |values: [u8; 8]| write_rgb8(&small.path("m.png"), 4, 2, &values.map(|v| [v; 3])).unwrap();
    grey([0, 1, 1, 0, 0, 0, 0, 0]);
    assert_eq!((small.vehicle_pixels(), small.open().unwrap().notes), (Some(2), vec![]));
    grey([0, 1, 2, 0, 0, 0, 0, 0]);
    let error = small.open().unwrap_err().to_string();
    assert!(error.contains("m.png: mask: largest value 2") && error.contains("128 and above"), "{error}");
}

#[test]
fn masks_are_found_by_every_name_in_use() {
    let names = [
        "masks/a.png",
        "masks/a.png.png",
        "masks/a_mask.png",
        "masks/a.mask.png",
        "mask/a.PNG",
        "Masks/A.png",
        "mask/images/a.png",
    ];
    for name in names {
        let small = Small::new("");
        small.mask(name, 4);
        assert_eq!(small.vehicle_pixels(), Some(1), "{name}");
        assert_eq!(small.open().unwrap().notes, Vec::<String>::new());
    }
    let small = Small::new("");
    fs::create_dir(small.path("mask")).unwrap();
    // Grey blocks of 8 pixels survive JPEG.
    let half = image::GrayImage::from_fn(4, 2, |_, v| image::Luma([if v == 0 { 255 } else { 0 }]));
    half.save(small.path("mask/a.jpg")).unwrap();
    assert!(small.open().unwrap().scene.views[0].mask.is_some());
    // In a folder that all pictures share, masks need not repeat it; with several folders they must.
    let frames = |paths: [&str; 2]| {
        let frame = |p| format!(r#"{{"file_path": "{p}", "transform_matrix": {POSE}}}"#);
        format!(r#"{{"fl_x": 4, "frames": [{}]}}"#, paths.map(frame).join(","))
    };
    for (paths, mask, masked) in [
        (["rgb/a.png", "rgb/b.png"], "masks/b.png", [false, true]),
        (["cam0/a.png", "cam1/a.png"], "masks/a.png", [false, false]),
        (["cam0/a.png", "cam1/a.png"], "masks/cam1/a.png", [false, true]),
    ] {
        let small = Small::new("");
        small.transforms(&frames(paths));
        for path in paths {
            fs::create_dir_all(small.path(path).parent().unwrap()).unwrap();
            write_rgb8(&small.path(path), 4, 2, &[[9; 3]; 8]).unwrap();
        }
        small.mask(mask, 4);
        let found: Vec<bool> = small.open().unwrap().scene.views.iter().map(|v| v.mask.is_some()).collect();
        assert_eq!(found, masked, "{mask}");
    }
}

#[test]
fn missing_files_give_one_note_with_every_name_that_was_tried() {
    let small = Small::new("");
    assert_eq!(
        small.open().unwrap().notes,
        [
            "no view has a mask; searched for masks/{a,a.png,a_mask,a.mask}.{png,jpg,jpeg,npy}, and the same in mask/"
        ]
    );
    let frame = |name: &str| format!(r#"{{"file_path": "images/{name}.png", "transform_matrix": {POSE}}}"#);
    let frames = ["a", "b", "c"].map(frame).join(",");
    small.transforms(&format!(r#"{{"fl_x": 4, "frames": [{frames}]}}"#));
    for name in ["b", "c"] {
        write_rgb8(&small.path(&format!("images/{name}.png")), 4, 2, &[[9; 3]; 8]).unwrap();
    }
    small.mask("masks/b.png", 4);
    let notes = small.open().unwrap().notes;
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert!(
        notes[0].starts_with("a.png, c.png: no mask, although other views have one; searched for masks/{a,")
    );
    small.transforms(&format!(
        r#"{{"fl_x": 4, "w": 4, "h": 2, "frames": [{{"file_path": "images/x.v1", "transform_matrix": {POSE}}}]}}"#
    ));
    let error = small.open().unwrap_err().to_string();
    assert!(
        error.ends_with("images/x.v1: picture: no such file, and none with .png, .jpg, .jpeg added"),
        "{error}"
    );
}

#[test]
fn pictures_are_found_without_their_extension_in_other_cases_and_with_backslashes() {
    for (written, file) in [
        ("images/b", "images/b.jpg"),
        ("images/b", "images/b.JPEG"),
        ("images/b.v2", "images/b.v2.png"),
        ("images/b.jpg", "images/B.JPG"),
        (r"images\\sub\\b.png", "images/sub/b.png"),
    ] {
        let small = Small::new("");
        small.transforms(&format!(
            r#"{{"fl_x": 4, "frames": [{{"file_path": "{written}", "transform_matrix": {POSE}}}]}}"#
        ));
        image::RgbImage::new(4, 2).save(small.path(file)).unwrap();
        small.mask(
            &format!("masks/{}.png", file.strip_prefix("images/").unwrap().rsplit_once('.').unwrap().0),
            4,
        );
        let opened = small.open().unwrap_or_else(|e| panic!("{written}: {e}"));
        assert_eq!(opened.index.views[0].image, small.path(file));
        assert_eq!(small.vehicle_pixels(), Some(1), "{written}");
    }
    let small = Small::new("");
    small.transforms(&format!(
        r#"{{"fl_x": 4, "frames": [{{"file_path": "..\\..\\a.png", "transform_matrix": {POSE}}}]}}"#
    ));
    assert!(small.open().unwrap_err().to_string().contains("leads out of the scene's folder"));
}

/// A NumPy array of two rows of four numbers of this type.
fn npy(descr: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (2, 4), }}");
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

#[test]
fn depth_next_to_a_transforms_json_that_lists_none_is_found_in_its_own_unit() {
    let floats: Vec<u8> = [2.5f32; 8].iter().flat_map(|v| v.to_le_bytes()).collect();
    let integers: Vec<u8> = [2500u16; 8].iter().flat_map(|v| v.to_le_bytes()).collect();
    let cases = [
        ("depth/a.npy", npy("<f4", &floats)),
        ("depth/a.npy", npy("<u2", &integers)),
        ("Depths/a_depth.NPY", npy("<f4", &floats)),
    ];
    for (name, bytes) in &cases {
        let small = Small::new("");
        fs::create_dir(small.path(name).parent().unwrap()).unwrap();
        fs::write(small.path(name), bytes).unwrap();
        let depth = small.open().unwrap().scene.views[0].depth.clone().unwrap();
        assert_eq!(depth.depth(), [2.5; 8], "{name}");
    }
    // Listed depth is read the same way; the scene or the caller can set another unit.
    let small = Small::new(r#""depth_file_path": "d.npy","#);
    fs::write(small.path("d.npy"), &cases[0].1).unwrap();
    assert_eq!(small.open().unwrap().scene.views[0].depth.as_ref().unwrap().depth(), [2.5; 8]);
    let options = SceneOptions { depth_scale: Some(2.0), ..SceneOptions::default() };
    let opened = open_scene(small.dir.path(), &options).unwrap();
    assert_eq!(opened.scene.views[0].depth.as_ref().unwrap().depth(), [5.0; 8]);
    // A file that lists depth for one frame has none for the others.
    let frames = [r#""depth_file_path": "d.npy","#, ""];
    let frame =
        |(i, keys)| format!(r#"{{"file_path": "images/{i}.png", {keys} "transform_matrix": {POSE}}}"#);
    let frames = frames.into_iter().enumerate().map(frame).collect::<Vec<_>>().join(",");
    small.transforms(&format!(r#"{{"fl_x": 4, "frames": [{frames}]}}"#));
    fs::create_dir(small.path("depth")).unwrap();
    for i in 0..2 {
        write_rgb8(&small.path(&format!("images/{i}.png")), 4, 2, &[[9; 3]; 8]).unwrap();
        fs::write(small.path(&format!("depth/{i}.npy")), &cases[0].1).unwrap();
    }
    let views = small.open().unwrap().scene.views;
    assert!(views[0].depth.is_some() && views[1].depth.is_none());
}

#[test]
fn the_largest_of_several_colmap_models_is_used_with_a_note() {
    let dir = tempfile::tempdir().unwrap();
    for (model, images) in
        [("0", "1 1 0 0 0 0 0 0 1 a.png\n\n"), ("1", ""), ("10", "1 1 0 0 0 0 0 0 1 a.png\n\n")]
    {
        let folder = dir.path().join("sparse").join(model);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("cameras.txt"), "1 PINHOLE 4 2 4 4 2 1\n").unwrap();
        let two = "1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 0 0 1 1 b.png\n";
        fs::write(folder.join("images.txt"), if model == "1" { two } else { images }).unwrap();
    }
    let index = list_scene(dir.path(), &sedan_colmap()).unwrap();
    assert_eq!(index.source, dir.path().join("sparse/1"));
    assert_eq!(index.views.len(), 2);
    let note = &index.notes[0];
    assert!(note.contains("sparse/1: chosen among 3 COLMAP models, with 2 images"), "{note}");
    assert!(note.contains("sparse/0 has 1") && note.contains("sparse/10 has 1"), "{note}");
    // A model that is named is the one that is read.
    let named = list_scene(&dir.path().join("sparse/10"), &sedan_colmap()).unwrap();
    assert_eq!((named.views.len(), named.notes.len()), (1, 0));
}

#[test]
fn a_rotated_picture_is_refused_if_the_convention_of_its_camera_is_unknown() {
    // EXIF orientation 3: turned by 180 degrees.
    let exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0\0\0\0\0\0\0";
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(4, 2).write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    let jpeg = jpeg.into_inner();
    let turned = [&jpeg[..2], &[0xff, 0xe1, 0, exif.len() as u8 + 2], exif, &jpeg[2..]].concat();
    for size in ["", r#""w": 4, "h": 2,"#] {
        let small = Small::new(size);
        fs::write(small.path("images/a.png"), &turned).unwrap();
        let error = small.open().unwrap_err().to_string();
        assert!(error.contains("images/a.png: EXIF orientation: 3") && error.contains("exiftool"), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_and_not_waited_for() {
    let pipe = |path: &Path| {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let _ = fs::remove_file(path);
        let made = std::process::Command::new("mkfifo").arg(path).status().unwrap();
        assert!(made.success());
    };
    for name in ["images/a.png", "masks/a.png", "depth/a.png", "transforms.json"] {
        let small = Small::new("");
        pipe(&small.path(name));
        let error = small.open().unwrap_err().to_string();
        assert!(
            error.ends_with(&format!(
                "{name}: file: is a pipe, a socket or a device; allowed: a regular file"
            )),
            "{error}"
        );
    }
    let small = Small::new(r#""mask_path": "m.png","#);
    std::os::unix::fs::symlink("/dev/zero", small.path("m.png")).unwrap();
    assert!(small.open().unwrap_err().to_string().contains("m.png: file: is a pipe, a socket or a device"));
}

#[test]
fn a_picture_of_the_wrong_size_is_refused_by_its_header() {
    let small = Small::new(r#""w": 8, "h": 4, "mask_path": "m.png", "depth_file_path": "d.png","#);
    // A header of 4x2 without pixels: decoding it would be another error.
    let whole = fs::read(small.path("images/a.png")).unwrap();
    for name in ["images/a.png", "m.png", "d.png"] {
        write_rgb8(&small.path("images/a.png"), 8, 4, &[[9; 3]; 32]).unwrap();
        write_rgb8(&small.path("m.png"), 8, 4, &[[0; 3]; 32]).unwrap();
        write_depth16(&small.path("d.png"), 8, 4, &[2.0; 32]).unwrap();
        small.open().unwrap();
        fs::write(small.path(name), &whole[..whole.len() - 20]).unwrap();
        let error = small.open().unwrap_err().to_string();
        assert!(error.contains(&format!("{name}: size: 4x2, but its")), "{error}");
    }
}

#[test]
fn depth_is_in_millimetres_unless_the_scene_or_the_caller_sets_another_unit() {
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
        .map_or_else(|| vg_testing::root().join("../shared/data"), PathBuf::from);
    if !root.join("carset").is_dir() {
        vg_testing::say(&format!("skipped: {} has no carset (VG_SHARED_DATA is its folder)", root.display()));
        return;
    }
    for instance in fs::read_dir(root.join("carset")).unwrap().map(|e| e.unwrap().path()) {
        if !instance.join("transforms.json").is_file() {
            continue;
        }
        let posed = open_scene(&instance, &SceneOptions::default()).unwrap();
        assert_eq!(posed.scene.views.len(), 40);
        assert!(posed.scene.views.iter().all(|v| v.mask.is_some() && v.depth.is_some()));
        // The model is a real reconstruction: its centres match the true ones to a few centimetres.
        let registered = vg_scene::io::colmap::read_model(&instance.join("sparse/0")).unwrap();
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
