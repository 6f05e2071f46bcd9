//! The program with models, each run in a process of its own.

use crate::common::vehicle::right_side;
use crate::oracle::{Manner, ellipsoid};
use crate::{file, open};
use std::path::Path;
use std::process::{Command, Output};

fn sample() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/sedan")
}

fn vg(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vg")).args(arguments).output().unwrap()
}

#[test]
fn a_runtime_that_cannot_be_used_is_said_with_what_to_install() {
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
fn options_that_do_not_go_together_are_refused() {
    let sample = sample();
    for arguments in [["--prior", "onnx"], ["--prior-model", "m.onnx"]] {
        let mut all = vec!["reconstruct", sample.to_str().unwrap(), "-o", "x.ply"];
        all.extend(arguments);
        let done = vg(&all);
        let text = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{text}");
        assert!(text.contains("--prior onnx and --prior-model M.onnx go together"), "{text}");
    }
}

#[test]
fn a_reconstruction_with_a_network_reports_how_far_it_agrees() {
    // The sample's car is no ellipsoid: what counts is that depth and report come of the network.
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
