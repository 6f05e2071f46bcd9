//! The program with models, each run in a process of its own.

use std::process::{Command, Output};
use vg_testing::networks::oracle::{Manner, ellipsoid};
use vg_testing::networks::{brightness, file, open};
use vg_testing::vehicle::right_side;

fn sample() -> std::path::PathBuf {
    vg_testing::root().join("tests/data/sedan")
}

fn vg(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vg")).args(arguments).output().unwrap()
}

#[test]
fn an_unusable_runtime_is_an_error_with_what_to_install() {
    let scene = right_side(48, 36);
    let graph = ellipsoid(&scene.views[0].camera, 48, 36, Manner::PLAIN);
    let path = file("program");
    graph.write(&path);
    let (sample, path) = (sample(), path.to_str().unwrap().to_owned());
    let out = file("never").with_extension("ply");
    for (runtime, expected) in [
        ("/nowhere/libonnxruntime.so", "/nowhere/libonnxruntime.so does not exist"),
        ("/", "no libonnxruntime in /"),
        (env!("CARGO_MANIFEST_DIR"), "no libonnxruntime in "),
        (concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"), "Cargo.toml"),
    ] {
        let done = vg(&[
            "reconstruct",
            sample.to_str().unwrap(),
            "--prior",
            "onnx",
            "--prior-model",
            &path,
            "--onnxruntime",
            runtime,
            "-o",
            out.to_str().unwrap(),
        ]);
        let text = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{text}");
        assert!(text.starts_with("vg: error: ONNX Runtime: ") && text.contains(expected), "{text}");
        assert!(text.contains("pip install onnxruntime") && text.trim_end().lines().count() == 1, "{text}");
    }
}

#[test]
fn incompatible_options_are_refused() {
    let sample = sample();
    let cases = [
        (["--prior", "onnx"], "--prior onnx needs a network: --prior-model M.onnx"),
        (["--prior-model", "m.onnx"], "--prior-model M.onnx is used only with --prior onnx"),
    ];
    for (arguments, expected) in cases {
        let mut all = vec!["reconstruct", sample.to_str().unwrap(), "-o", "x.ply"];
        all.extend(arguments);
        let done = vg(&all);
        let text = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{text}");
        assert!(text.contains(expected), "{text}");
    }
}

#[test]
fn a_reconstruction_with_a_network_reports_its_agreement() {
    // The sample's car is not an ellipsoid; the test is that depth and report come from the network.
    let scene = vg::io::open_scene(&sample(), &vg::io::SceneOptions::default()).unwrap().scene;
    let graph = ellipsoid(&scene.views[0].camera, 64, 48, Manner::PLAIN);
    if open("sample", &graph).is_none() {
        return;
    }
    let (folder, path) = (tempfile::tempdir().unwrap(), file("sample"));
    let (asset, report) = (folder.path().join("a.ply"), folder.path().join("r.json"));
    let done = vg(&[
        "reconstruct",
        sample().to_str().unwrap(),
        "--views",
        "000,001,002,003",
        "--prior",
        "onnx",
        "--prior-model",
        path.to_str().unwrap(),
        "-o",
        asset.to_str().unwrap(),
        "--report",
        report.to_str().unwrap(),
    ]);
    let text = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{text}");
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    assert_eq!(report["prior"], "onnx");
    assert!(report["network"]["ray_degrees"].as_f64().unwrap() < 0.1);
    assert_eq!(report["network"]["size"], serde_json::json!([64, 48]));
}

#[test]
fn the_program_makes_a_vehicle_of_photographs_without_masks() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene");
    let sample = vg_testing::root().join("tests/data/sedan");
    std::fs::create_dir_all(scene.join("images")).unwrap();
    // The silhouettes themselves for photographs: what brightness segments exactly.
    for name in ["000", "001", "002", "003"] {
        std::fs::copy(sample.join(format!("masks/{name}.png")), scene.join(format!("images/{name}.png")))
            .unwrap();
    }
    let text = std::fs::read_to_string(sample.join("transforms.json")).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
    for frame in json["frames"].as_array_mut().unwrap() {
        let stem = frame["file_path"].as_str().unwrap().rsplit(['/', '.']).nth(1).unwrap().to_owned();
        frame["file_path"] = format!("images/{stem}.png").into();
        frame.as_object_mut().unwrap().remove("mask_path");
    }
    std::fs::write(scene.join("transforms.json"), json.to_string()).unwrap();
    let run = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vg"));
        command.args(["reconstruct", scene.to_str().unwrap(), "--views", "000,001,002,003"]);
        let done = command
            .args(["--prior", "hull", "-o", "a.ply"])
            .args(more)
            .current_dir(&folder)
            .output()
            .unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (done.status.code(), text(&done.stdout), text(&done.stderr))
    };
    let (code, _, error) = run(&[]);
    assert_eq!(code, Some(1), "{error}");
    assert!(
        error.contains(".mask: none; allowed: a mask that shows the vehicle") && error.contains("mask model"),
        "{error}"
    );

    if open("program segmentation", &brightness(None)).is_none() {
        return;
    }
    let path = file("program segmentation");
    let (code, said, error) = run(&["--mask-model", path.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("; masks of 4 views by brightness"), "{said}");
    let iou: f64 = said.split("IoU ").nth(1).unwrap().split(',').next().unwrap().parse().unwrap();
    assert!(iou > 0.9, "{said}");
    // Masks that are there are not made again, and the network is not even opened.
    let has_masks = Command::new(env!("CARGO_BIN_EXE_vg"))
        .args([
            "reconstruct",
            sample.to_str().unwrap(),
            "--views",
            "000,001",
            "--prior",
            "hull",
            "-o",
            "b.ply",
        ])
        .args(["--mask-model", "nowhere.onnx"])
        .current_dir(&folder)
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&has_masks.stderr).into_owned();
    assert!(
        has_masks.status.success() && error.contains("not used, because every view has a mask"),
        "{error}"
    );
}
