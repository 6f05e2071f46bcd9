//! `vg eval` on the sample.

use super::*;
use std::fs;

#[test]
fn an_evaluation_prints_a_table_and_writes_the_same_numbers_as_json() {
    let folder = tempfile::tempdir().unwrap();
    let words = "eval . --split split.json --prior hull --repeat 2 --json {}/e.json";
    let out = succeed(folder.path(), words).out;
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[0].starts_with("scene") && lines[0].contains("SSIM") && lines.len() == 2, "{out}");
    let document = json(&folder.path().join("e.json"));
    let row = &document["splits"][0];
    assert_eq!((row["scene"].as_str(), row["split"].as_str()), (Some("sedan"), Some("right_to_left")));
    assert_eq!((row["prior"].as_str(), document["repeat"].as_u64()), (Some("hull"), Some(2)));
    assert_eq!((row["verdict"].as_str(), document["mean"]["verdict"].as_str()), (Some("good"), Some("good")));
    let psnr = row["psnr_db"].as_f64().unwrap();
    assert!(lines[1].contains(&format!("{psnr:.3}")), "{out}");
    // Far below the actual figures: this tests the protocol (white background, sides, masks), not the method.
    assert!(psnr > 17.0 && row["silhouette_iou"].as_f64().unwrap() > 0.85, "{row}");
    assert!(row["psnr_box_db"].as_f64().unwrap() < psnr);
    // The hull does not use the inputs' depth, so it can be measured with it.
    let depth = row["input_depth_mae_m"].as_f64().unwrap();
    assert!(depth > 0.001 && depth < 0.3, "{depth}");
    let views = row["views"].as_array().unwrap();
    let mean = views.iter().map(|v| v["psnr_db"].as_f64().unwrap()).sum::<f64>() / views.len() as f64;
    assert!(views.len() == 4 && (mean - psnr).abs() < 1e-9);
}

#[test]
fn the_hull_does_not_use_depth() {
    // Without depth files the model is the same.
    let blind = copy_of_sample(&["images", "masks", "split.json", "transforms.json"]);
    let path = blind.path().join("transforms.json");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace("depth_file_path", "no_depth_file_path")).unwrap();
    let at = blind.path();
    succeed(at, "eval . --prior hull --json {}/seeing.json");
    succeed(at, "eval {} --prior hull --json {}/blind.json");
    let psnr = |name: &str| json(&at.join(name))["splits"][0]["psnr_db"].as_f64().unwrap();
    assert_eq!(psnr("seeing.json"), psnr("blind.json"));
    assert!(json(&at.join("blind.json"))["splits"][0]["input_depth_mae_m"].is_null());
}

#[test]
fn a_broken_scene_is_named_and_the_others_are_evaluated() {
    let broken = copy_of_sample(&["split.json"]);
    fs::create_dir(broken.path().join("images")).unwrap();
    let run = vg_in(broken.path(), "eval {} . --prior given --json {}/e.json");
    assert_eq!(run.code, 1);
    assert_one_error(&run);
    assert!(run.err.contains(broken.path().to_str().unwrap()), "{run:?}");
    assert!(run.out.contains("sedan  right_to_left  given"), "{run:?}");
    let document = json(&broken.path().join("e.json"));
    assert_eq!(document["errors"].as_array().unwrap().len(), 1);
    assert_eq!(document["splits"].as_array().unwrap().len(), 1);
}

#[test]
fn several_scenes_get_a_row_of_means() {
    let out = succeed(Path::new("."), "eval . transforms.json --prior given").out;
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines.len() == 4 && lines[3].starts_with("mean"), "{out}");
}

#[test]
fn invalid_splits_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("list.json"), "[1]").unwrap();
    fs::write(at.join("none.json"), "{}").unwrap();
    fs::write(at.join("empty.json"), r#"{"a": {"input": ["000"], "test": []}}"#).unwrap();
    fs::write(at.join("unknown.json"), r#"{"a": {"input": ["000"], "test": ["999"]}}"#).unwrap();
    fail(at, "eval . --split {}/list.json", 1, &["list.json", "expected"]);
    fail(at, "eval . --split {}/none.json", 1, &["none.json", "no split"]);
    fail(at, "eval . --split {}/empty.json", 1, &["empty.json", "a: no input view or no test view"]);
    fail(at, "eval . --split {}/unknown.json", 1, &["\"999\"", "000.png"]);
    fail(at, "eval . --only sideways", 1, &["sideways", "right_to_left"]);
    fail(at, "eval . --split {}/missing.json", 1, &["missing.json"]);
}

#[test]
fn a_cloud_moves_the_surface_to_it_and_is_found_in_the_scene_s_folder() {
    let folder = copy_of_sample(&["images", "masks", "depth", "split.json", "transforms.json"]);
    let at = folder.path();
    // Every point that the input views see, as a scan.
    succeed(
        at,
        &format!("reconstruct . --views {INPUTS} --prior given -o {{}}/g.ply --points {{}}/scan.ply"),
    );
    let input_depth = |options: &str| {
        succeed(at, &format!("eval {{}} --prior hull --json {{}}/e.json {options}"));
        let row = json(&at.join("e.json"))["splits"][0].clone();
        assert!(row["input_depth_p90_m"].as_f64() > row["input_depth_mae_m"].as_f64(), "{row}");
        row["input_depth_mae_m"].as_f64().unwrap()
    };
    let (without, few, all) =
        (input_depth(""), input_depth("--cloud scan.ply --cloud-points 50"), input_depth("--cloud scan.ply"));
    assert!(few < 0.95 * without && all < 0.7 * without, "{without} {few} {all}");
}

#[test]
fn the_error_of_depth_in_the_inputs_is_printed_if_they_have_depth() {
    let heading = |prior: &str| {
        let out = succeed(Path::new("."), &format!("eval . --prior {prior}")).out;
        out.lines().next().unwrap().to_owned()
    };
    assert!(heading("hull").contains("in. depth MAE m     p90"), "{}", heading("hull"));
    assert!(!heading("given").contains("p90"));
}

#[test]
fn invalid_clouds_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let header = |n: usize| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n\
             property float z\nend_header\n"
        )
    };
    let nan = [header(1).as_bytes(), &f32::NAN.to_le_bytes().repeat(3)].concat();
    fs::write(at.join("nan.ply"), nan).unwrap();
    fs::write(at.join("empty.ply"), header(0)).unwrap();
    fail(at, "eval . --prior hull --cloud {}/missing.ply", 1, &["missing.ply"]);
    fail(at, "eval . --prior hull --cloud {}/nan.ply", 1, &["nan.ply", "x"]);
    fail(at, "eval . --prior hull --cloud {}/empty.ply", 1, &["empty.ply", "0 points", "1 to 10000000"]);
    fail(at, "eval . --prior hull --cloud-points 5", 2, &["--cloud"]);
    fail(at, "eval . --cloud {}/nan.ply --cloud-points 0", 2, &["cloud-points"]);
    fail(at, "reconstruct . -o {}/a.ply --prior hull --cloud {}/empty.ply", 1, &["empty.ply"]);
    fail(at, "reconstruct . -o {}/nan.ply --prior hull --cloud {}/nan.ply", 1, &["would be replaced"]);
}

#[test]
fn a_table_has_a_row_for_each_system_and_the_reason_if_one_is_empty() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let words = "eval . --table symmetry --with --prior=hull --repeat 2 --json {}/e.json --markdown {}/e.md";
    let out = succeed(at, words).out;
    assert_eq!(out.lines().count(), 5, "{out}");
    let document = json(&at.join("e.json"));
    let systems = document["systems"].as_array().unwrap();
    let of = |name: &str| systems.iter().find(|s| s["system"].as_str().unwrap().starts_with(name)).unwrap();
    let psnr = |name: &str| of(name)["psnr_db"].as_f64().unwrap();
    // The unseen side is empty without clones.
    assert!(
        psnr("Gaussian cloning") > psnr("neither") + 2.0 && psnr("image flipping") > psnr("neither") + 2.0
    );
    for system in systems {
        assert_eq!((system["splits"].as_u64(), system["each"].as_array().unwrap().len()), (Some(1), 1));
        assert_eq!(system["each"][0]["seconds"].as_array().unwrap().len(), 2);
        assert!(!cfg!(target_os = "linux") || system["peak_bytes"].as_u64().unwrap() > 1 << 20, "{system}");
    }
    let markdown = fs::read_to_string(at.join("e.md")).unwrap();
    assert!(markdown.starts_with("| system | splits |") && markdown.lines().count() == 6, "{markdown}");

    let out = succeed(at, "eval . --table activation --json {}/a.json").out;
    assert!(out.contains("\nrelu: needs heads trained with it: --head-model"), "{out}");
    assert_eq!(json(&at.join("a.json"))["systems"][2]["missing"].as_array().unwrap().len(), 1);
}

#[test]
fn the_side_table_uses_the_test_views_of_every_split() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("both.json"),
        r#"{"r": {"input": ["000","001","002","003"], "test": ["004","005"]},
            "l": {"input": ["004","005","006","007"], "test": ["000","001"]}}"#,
    )
    .unwrap();
    let words = "eval . --table side --split {}/both.json --with --prior=hull --json {}/e.json";
    succeed(at, words);
    let systems = json(&at.join("e.json"))["systems"].clone();
    let views = |row: usize| -> Vec<String> {
        let views = systems[row]["each"][0]["views"].as_array().unwrap().iter();
        views.map(|v| v["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(
        (views(0), views(1)),
        (vec!["000.png".into(), "001.png".into()], vec!["004.png".into(), "005.png".into()])
    );
    // The test views of every split, except those that are inputs.
    assert_eq!(views(2), ["000.png", "001.png"]);
    assert_eq!(systems[0]["each"][0]["split"], "l");
}

#[test]
fn a_folder_with_faulty_vehicles_is_measured_as_far_as_possible() {
    let set = tempfile::tempdir().unwrap();
    let parts = ["images", "masks", "depth", "split.json", "transforms.json"];
    for name in ["a_good", "b_no_mask", "c_wrong_size", "d_empty_sparse", "e_no_picture"] {
        parts.iter().for_each(|part| copy(&sample().join(part), &set.path().join(name).join(part)));
    }
    fs::create_dir(set.path().join("notes")).unwrap();
    let at = |path: &str| set.path().join(path);
    fs::remove_dir_all(at("b_no_mask/masks")).unwrap();
    let scene = fs::read_to_string(at("b_no_mask/transforms.json")).unwrap();
    fs::write(at("b_no_mask/transforms.json"), scene.replace("mask_path", "no_mask_path")).unwrap();
    image::RgbImage::new(10, 10).save(at("c_wrong_size/images/001.png")).unwrap();
    fs::remove_file(at("d_empty_sparse/transforms.json")).unwrap();
    fs::create_dir_all(at("d_empty_sparse/sparse/0")).unwrap();
    fs::remove_file(at("e_no_picture/images/005.png")).unwrap();

    let run = vg_in(set.path(), "eval {} --prior hull --json {}/e.json");
    assert_eq!(run.code, 1);
    let lines: Vec<&str> = run.err.lines().collect();
    assert_eq!(lines.len(), 4, "{run:?}");
    for (line, causes) in lines.iter().zip([
        ["b_no_mask", "mask"],
        ["c_wrong_size", "001.png"],
        ["d_empty_sparse", "sparse/0"],
        ["e_no_picture", "005.png"],
    ]) {
        assert!(causes.iter().all(|cause| line.contains(cause)), "{causes:?}: {line}");
    }
    assert!(run.out.contains("a_good  right_to_left") && run.out.lines().count() == 2, "{run:?}");
    assert_eq!(json(&at("e.json"))["errors"].as_array().unwrap().len(), 4);

    // Several systems: a fault of the pictures is reported once per vehicle, one of a method where it occurs.
    let run = vg_in(set.path(), "eval {} --table symmetry --with --prior=hull --json {}/t.json");
    let errors = run.err.lines().filter(|line| line.starts_with("vg: error: ")).count();
    assert_eq!((run.code, errors), (1, 4), "{run:?}");
    let systems = json(&at("t.json"))["systems"].clone();
    assert_eq!((systems[0]["splits"].as_u64(), systems[3]["splits"].as_u64()), (Some(1), Some(1)));
}

#[test]
fn models_of_other_programs_are_rows() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("sedan")).unwrap();
    fs::copy(asset(), at.join("sedan/right_to_left.ply")).unwrap();
    let import = "ours again: vehicle {}/{scene}/{split}.ply seconds=2.5"
        .replace("{}/", &format!("{}/", at.display()));
    let missing = format!("nothing: vehicle {}/missing.ply", at.display());
    let json_path = at.join("e.json");
    let words = [
        "eval",
        ".",
        "--system",
        "ours: --prior shape",
        "--import",
        &import,
        "--json",
        json_path.to_str().unwrap(),
    ];
    let run = vg(&words);
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{run:?}");
    let systems = json(&json_path)["systems"].clone();
    // Through a file: opacities and scales are stored as logits and logarithms.
    let psnr = |i: usize| systems[i]["psnr_db"].as_f64().unwrap();
    assert!((psnr(0) - psnr(1)).abs() < 1e-3, "{} {}", psnr(0), psnr(1));
    assert_eq!(
        (systems[1]["seconds"].as_f64(), systems[1]["system"].as_str()),
        (Some(2.5), Some("ours again"))
    );

    let run = vg(&["eval", ".", "--system", "ours: --prior hull", "--import", &missing]);
    assert!(
        run.code == 1 && run.err.contains("missing.ply") && run.out.contains("\nnothing: sedan"),
        "{run:?}"
    );
    for (import, cause) in [
        ("no colon", "found no colon after a name"),
        ("a: da3", "found no path"),
        ("a: unheard x.ply", "unknown KIND"),
        ("a: vehicle x.ply seconds=-1", "seconds is not a number above 0"),
    ] {
        let run = vg(&["eval", ".", "--import", import]);
        assert!(run.code == 2 && run.err.contains(cause), "{run:?}");
    }
    let run = vg(&["eval", ".", "--import", "a: object x.ply"]);
    assert!(run.code == 1 && run.err.contains("give --scan"), "{run:?}");
}

#[test]
fn options_for_all_rows_belong_into_with() {
    let folder = Path::new(".");
    fail(folder, "eval . --table side --prior hull", 2, &["--with"]);
    fail(folder, "eval . --with --prior=hull", 2, &["--with needs --table"]);
    fail(folder, "eval . --table nothing", 2, &["main", "omissions"]);
}

#[test]
fn a_colmap_model_is_aligned_before_it_is_measured_and_an_ambiguous_heading_is_an_error() {
    let folder = copy_of_sample(&["images", "masks", "sparse", "split.json"]);
    let at = folder.path();
    let (model, _) = vg::io::ply::read(asset()).unwrap();
    let scan: Vec<[f32; 3]> = model.means().iter().step_by(7).copied().collect();
    let write = |name: &str, points: &[[f32; 3]]| {
        vg::io::ply::write_points(&at.join(name), points, &vec![[128; 3]; points.len()]).unwrap();
    };
    write("scan.ply", &scan);
    // A scan with equal front and back.
    let both: Vec<[f32; 3]> = scan.iter().flat_map(|&[x, y, z]| [[x, y, z], [-x, y, z]]).collect();
    write("both.ply", &both);

    succeed(at, "eval {} --align scan.ply --scan scan.ply --prior hull --json {}/e.json");
    succeed(at, "eval . --prior hull --json {}/t.json");
    let (found, truth) = (json(&at.join("e.json")), json(&at.join("t.json")));
    let psnr = |document: &serde_json::Value| document["mean"]["psnr_db"].as_f64().unwrap();
    assert!((psnr(&found) - psnr(&truth)).abs() < 1.0, "{} {}", psnr(&found), psnr(&truth));
    assert!(found["aligned"][0]["residual_m"].as_f64().unwrap() < 0.05, "{}", found["aligned"]);
    assert!(found["mean"]["surface"]["chamfer_m"].as_f64().unwrap() < 0.1, "{}", found["mean"]);
    assert_eq!(truth["aligned"].as_array().unwrap().len(), 0);

    fail(at, "eval {} --align both.ply", 1, &["--heading", "cannot be told apart"]);
    fail(at, "eval {} --align", 1, &["--scan", "holds no scan"]);
    fail(at, "eval {} --prior hull", 1, &["vehicle"]);
}
