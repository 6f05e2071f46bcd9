//! `vg align`: from a scan, known camera centres, a box or a matrix to the file that `--vehicle-from-world` reads.

use super::*;
use std::fs;
use vg::geometry::Similarity;
use vg::scene::mask::Label;

fn truth() -> Similarity {
    vg::io::read_vehicle_from_world(&sample().join("vehicle_from_world.json")).unwrap()
}

fn centers() -> serde_json::Map<String, serde_json::Value> {
    let truth = vg::io::list_scene(&sample(), &vg::io::SceneOptions::default()).unwrap();
    let cameras = truth.cameras().into_iter();
    cameras.map(|c| (c.name, serde_json::json!(c.camera.center().to_array()))).collect()
}

/// The sample's surface: the points of its depth maps of the right side, and their mirror image.
pub(crate) fn write_scan(path: &Path) {
    let scene = vg::io::open_scene(&sample(), &vg::io::SceneOptions::default()).unwrap().scene;
    let mut points = Vec::new();
    for view in &scene.views {
        let Some(depth) = &view.depth else { continue };
        for (i, z) in depth.depth().iter().enumerate().filter(|(i, z)| i % 7 == 0 && **z > 0.0) {
            let p = view.lift(i as u32 % view.camera.width, i as u32 / view.camera.width, *z);
            points.extend([p.to_array(), [p.x, -p.y, p.z]]);
        }
    }
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let grey = vec![[128; 3]; points.len()];
    vg::io::ply::write_points(path, &points, &grey).unwrap();
}

/// Scale error, and largest shift of the vehicle's corners, metres.
fn errors(path: &Path) -> (f64, f64) {
    let found = vg::io::read_vehicle_from_world(path).unwrap();
    let truth = truth();
    let corner =
        |k: i32| glam::DVec3::new(f64::from(k & 1) * 4.0 - 2.0, f64::from(k >> 1 & 1) * 1.8 - 0.9, 0.0);
    let world = |p: glam::DVec3| truth.rotation.transpose() * (p - truth.translation) / truth.scale;
    let off = |k: i32| found.transform_point(world(corner(k))).distance(corner(k));
    (found.scale / truth.scale - 1.0, (0..4).map(off).fold(0.0, f64::max))
}

#[test]
fn a_scan_gives_the_sample_s_frame_and_prints_how_well_it_fits() {
    let folder = copy_of_sample(&["sparse", "masks", "images"]);
    let at = folder.path();
    write_scan(&at.join("scan.ply"));
    let out = succeed(at, "align {} --scan {}/scan.ply --threads 2 -o {}/v.json").out;
    for word in ["residual", "confidence", "8 masks", "front and rear swapped"] {
        assert!(out.contains(word), "{out}");
    }
    let (scale, off) = errors(&at.join("v.json"));
    assert!(scale.abs() < 0.01 && off < 0.05, "{scale} {off}: {out}");
    let written = json(&at.join("v.json"));
    assert!(written["residual_m"].as_f64().unwrap() < 0.03 && written["confidence"].as_f64().unwrap() > 0.2);
    assert!((written["scale"].as_f64().unwrap() / truth().scale - 1.0).abs() < 0.01);
    // The file serves as input of a reconstruction.
    succeed(
        at,
        "reconstruct {} --vehicle-from-world {}/v.json --views 000,001 --prior hull --no-check -o {}/a.ply",
    );
    // A view without a mask is left out, with a message.
    fs::remove_file(at.join("masks/007.png")).unwrap();
    let run = succeed_with_warnings(at, "align {} --scan {}/scan.ply -o {}/v.json");
    assert!(run.err.contains("007.png: no mask; searched for masks/"), "{run:?}");
    let out = run.out;
    assert!(out.contains("7 masks; 1 view without a mask was left out"), "{out}");
}

#[test]
fn an_unusable_scan_is_an_error_with_the_requirements() {
    let folder = copy_of_sample(&["sparse", "masks", "images"]);
    let at = folder.path();
    write_scan(&at.join("scan.ply"));
    let (points, colors) = vg::io::ply::read_points(&at.join("scan.ply")).unwrap();
    let millimetres: Vec<_> = points.iter().map(|p| p.map(|c| 1000.0 * c)).collect();
    vg::io::ply::write_points(&at.join("mm.ply"), &millimetres, &colors).unwrap();
    fail(at, "align {} --scan {}/mm.ply -o {}/v.json", 1, &["--scan", "mm.ply", "in metres"]);
    fail(at, "align {} --scan {}/none.ply -o {}/v.json", 1, &["none.ply"]);
    fail(at, "align {} -o {}/v.json --scan", 1, &["--scan", "holds no scan", "3dscanner_origin"]);
    fail(at, "align {} --scan {}/scan.ply -o {}/scan.ply", 1, &["scan.ply", "would be replaced"]);
    fail(at, "align {} --box 4.5,1.8,1.5 -o {}/v.json", 1, &["--box", "show no ground", "level ground"]);
    fs::remove_dir_all(at.join("masks")).unwrap();
    fail(at, "align {} --scan {}/scan.ply -o {}/v.json", 1, &["0 of 8 views have a mask", "at least 3"]);
    assert!(!at.join("v.json").exists());
}

#[test]
fn exactly_one_way_to_align_is_required() {
    let at = Path::new(".");
    fail(at, "align . -o v.json", 2, &["--scan", "--known-centers", "--box", "--matrix"]);
    fail(at, "align . --matrix m.txt --box 4,2,1 -o v.json", 2, &["--matrix", "--box"]);
    fail(at, "align . --matrix m.txt --heading forward -o v.json", 2, &["--heading", "--matrix"]);
    fail(at, "align . --scan s.ply --heading sideways -o v.json", 2, &["sideways", "--heading", "forward"]);
    fail(at, "align . --box 4,2 -o v.json", 2, &["--box", "length,width,height"]);
}

#[test]
fn a_matrix_is_checked_and_rewritten() {
    let folder = copy_of_sample(&["sparse"]);
    let at = folder.path();
    let numbers: Vec<String> = truth().to_row_major().iter().map(|v| format!("{v:?}")).collect();
    fs::write(at.join("m.txt"), numbers.join(" ")).unwrap();
    succeed(at, "align {} --matrix {}/m.txt -o {}/v.json");
    assert!(errors(&at.join("v.json")).1 < 1e-9);
    assert!(json(&at.join("v.json"))["confidence"].is_null());
    succeed(at, "align {} --matrix {}/v.json -o {}/w.json");
    fs::write(at.join("shear.txt"), "1 1 0 0  0 1 0 0  0 0 1 0  0 0 0 1").unwrap();
    fail(at, "align {} --matrix {}/shear.txt -o {}/x.json", 1, &["shear.txt", "matrix"]);
    fs::write(at.join("short.txt"), "1 0 0").unwrap();
    fail(at, "align {} --matrix {}/short.txt -o {}/x.json", 1, &["short.txt", "3 numbers", "16"]);
    fail(at, "align {}/nothing --matrix {}/m.txt -o {}/x.json", 1, &["nothing"]);
    assert!(!at.join("x.json").exists());
}

#[test]
fn known_centers_of_the_sample_give_its_similarity_with_small_residuals() {
    let scene = copy_of_sample(&["sparse"]);
    let at = scene.path();
    let mut centers = centers();
    fs::write(at.join("centers.json"), serde_json::to_vec(&centers).unwrap()).unwrap();
    let out = succeed(at, "align {} --known-centers {}/centers.json -o {}/v.json").out;
    assert!(out.contains("residual 0.0000 m, confidence 1.00") && out.contains("007.png"), "{out}");
    let found = vg::io::read_vehicle_from_world(&at.join("v.json")).unwrap();
    let pairs = found.to_row_major().into_iter().zip(truth().to_row_major());
    // The model's poses are written with 17 digits.
    assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-9);

    // One wrong centre is named and has no effect.
    let x = centers["003.png"][0].as_f64().unwrap();
    centers["003.png"][0] = (x + 2.0).into();
    fs::write(at.join("wrong.json"), serde_json::to_vec(&centers).unwrap()).unwrap();
    let out = succeed(at, "align {} --cameras {}/wrong.json -o {}/v.json").out;
    assert!(out.contains("003.png: 2.0000 m, left out: inconsistent with the others"), "{out}");
    assert_eq!(out.matches("left out").count(), 1);
    assert!(errors(&at.join("v.json")).1 < 1e-9);
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

/// The sample in 3DRealCar's folders, as they are after having been moved: the links in `pcd_rescale` are broken.
fn real_car(at: &Path) {
    let processed = at.join("colmap_processed");
    copy(&sample().join("sparse"), &processed.join("pcd_rescale/sparse"));
    copy(&sample().join("images"), &processed.join("images"));
    fs::create_dir_all(processed.join("pcd_rescale/images")).unwrap();
    fs::create_dir_all(processed.join("masks/sam")).unwrap();
    for k in 0..8 {
        let mask = vg::io::image::read_mask(&sample().join(format!("masks/{k:03}.png"))).unwrap();
        let shape = format!("({}, {})", mask.height(), mask.width());
        let header = format!("{{'descr': '|b1', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(mask.labels().iter().map(|l| u8::from(*l == Label::Vehicle)));
        fs::write(processed.join(format!("masks/sam/{k:03}.npy")), bytes).unwrap();
    }
    write_scan(&at.join("3dscanner_origin/scan.ply"));
    fs::write(at.join("3dscanner_origin/frame_00000.json"), "{}").unwrap();
}

#[test]
fn a_folder_of_3drealcar_opens_by_its_root_with_masks_and_scan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    real_car(at);
    let out = succeed(at, "align {} -o {}/v.json --scan").out;
    assert!(out.contains("8 masks"), "{out}");
    let (scale, off) = errors(&at.join("v.json"));
    assert!(scale.abs() < 0.01 && off < 0.05, "{scale} {off}");
    let options = vg::io::SceneOptions { vehicle_from_world: Some(truth()), ..Default::default() };
    let real = vg::io::open_scene(at, &options).unwrap();
    let plain = vg::io::open_scene(&sample().join("sparse/0"), &options).unwrap();
    assert_eq!((real.scene.views.len(), real.notes.len()), (8, 0));
    for (a, b) in real.scene.views.iter().zip(&plain.scene.views) {
        assert_eq!((&a.name, &a.image, &a.mask), (&b.name, &b.image, &b.mask));
    }
    write_scan(&at.join("3dscanner_origin/second.ply"));
    fail(at, "align {} -o {}/v.json --scan", 1, &["3dscanner_origin", "second.ply", "one PLY file"]);
}
