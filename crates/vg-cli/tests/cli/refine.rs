//! `vg refine` of the sample's model.

use super::*;
use std::fs;

#[test]
fn a_model_is_optimised_against_the_photographs() {
    let folder = tempfile::tempdir().unwrap();
    let words = format!(
        "refine {} . --views {INPUTS} --amount 8 -o {{}}/r.ply --report {{}}/r.json",
        asset().display()
    );
    let out = succeed(folder.path(), &words).out;
    let report = json(&folder.path().join("r.json"));
    let done = &report["refinement"];
    let psnr: Vec<f64> = done["psnr_db"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!(psnr[1] > psnr[0] + 0.05, "{psnr:?}");
    assert!(out.contains("8 steps") && out.contains(&format!("{:.2} dB", psnr[1])), "{out}");
    assert_eq!(
        (done["stop"].as_str(), report["settings"]["amount"]["iterations"].as_u64()),
        (Some("done"), Some(8))
    );
    // The number of Gaussians is unchanged, and a second run gives the same bytes.
    let (before, after) = (fs::read(asset()).unwrap(), fs::read(folder.path().join("r.ply")).unwrap());
    assert!(before.len() == after.len() && before != after);
    succeed(folder.path(), &words.replace("r.ply", "again.ply").replace("--amount", "--threads 1 --amount"));
    assert!(after == fs::read(folder.path().join("again.ply")).unwrap());
}

#[test]
fn invalid_refinements_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let asset = asset().display();
    fail(at, &format!("refine {asset} . --amount 0s -o {{}}/r.ply"), 2, &["--amount", "above 0"]);
    fail(at, &format!("refine {asset} . -o {asset}"), 1, &["would be replaced"]);
    fail(
        at,
        &format!("refine {asset} . --backend cuda -o {{}}/r.ply"),
        2,
        &["--backend", "possible values: auto, cpu, gpu"],
    );
    if !cfg!(feature = "gpu") {
        let words = ["options.refine.backend: gpu is not in this build", "feature gpu"];
        fail(at, &format!("refine {asset} . --views 004 --backend gpu -o {{}}/r.ply"), 1, &words);
    }
    fail(at, "refine nothing.ply . -o {}/r.ply", 1, &["nothing.ply"]);
    assert_eq!(fs::read_dir(at).unwrap().count(), 0);
}
