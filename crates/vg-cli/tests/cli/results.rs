//! Rules for results: which files they must not replace, the ending of their names, and standard output.

use super::*;
use std::collections::BTreeMap;
use std::fs;

/// Content of every file below the folder.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
        } else {
            found.insert(path.clone(), fs::read(path).unwrap());
        }
    }
    found
}

/// The sample with a model and the other inputs of commands.
fn scene_with_model() -> tempfile::TempDir {
    let parts =
        ["transforms.json", "split.json", "vehicle_from_world.json", "images", "masks", "depth", "sparse"];
    let scene = copy_of_sample(&parts);
    fs::copy(asset(), scene.path().join("asset.ply")).unwrap();
    scene
}

#[test]
fn no_command_writes_over_a_file_of_its_scene_or_one_that_it_reads() {
    let scene = scene_with_model();
    let before = contents(scene.path());
    let replaced = [
        "reconstruct {} --views 000 -o {}/a.ply --report {}/transforms.json",
        "reconstruct {} --views 000 -o {}/a.ply --report {}/split.json",
        "reconstruct {} --views 000 --vehicle-from-world {}/vehicle_from_world.json -o {}/a.ply --report {}/vehicle_from_world.json",
        "reconstruct {} --views 000 --cloud {}/asset.ply -o {}/a.ply --points {}/asset.ply",
        "refine {}/asset.ply {} --views 000 -o {}/asset.ply",
        "render {}/asset.ply --cameras {} --views 000 -o {}/images",
        "render {}/asset.ply --turntable 2 -o {}/images",
        "render {}/asset.ply --cameras {} --views 006 -o {}/masks",
        "render {}/asset.ply --cameras {} --views 000 --depth -o {}",
        "eval {} --json {}/transforms.json",
        "eval {} --json {}/sub/../split.json",
        "eval {} --json {}/vehicle_from_world.json",
        "pareto {} --point=all: --json {}/split.json",
        "pareto {} --point=--cloud=asset.ply --json {}/split.json",
        "align {} --matrix {}/vehicle_from_world.json -o {}/split.json",
        "align {} --matrix {}/vehicle_from_world.json -o {}/vehicle_from_world.json",
    ];
    for words in replaced {
        fail(scene.path(), words, 1, &["would be replaced"]);
    }
    let among_them = [
        "reconstruct {} --views 000 -o {}/images/a.ply",
        "reconstruct {} --views 000 -o {}/sparse/0/points3D.ply",
        "render {}/asset.ply --turntable 2 -o {}/depth/turntable",
        "eval {} --markdown {}/masks/t.md",
        "pareto {} --point=all: --csv {}/images/p.csv",
        "report {} -o {}/images/page.html",
        "demo {}/images",
    ];
    for words in among_them {
        fail(scene.path(), words, 1, &["part of the scene", "choose another folder"]);
    }
    assert!(contents(scene.path()) == before);
    // Results of an earlier run may be replaced.
    succeed(scene.path(), "align {} --matrix vehicle_from_world.json -o {}/vehicle_from_world.json");
    assert!(contents(scene.path()) != before);
}

#[test]
fn the_demo_replaces_only_its_own_scene() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("scene/images/000.png");
    copy(&sample().join("images/001.png"), &own);
    let before = contents(folder.path());
    fail(folder.path(), "demo {}", 1, &["scene/images/000.png", "would be replaced"]);
    assert!(contents(folder.path()) == before);
}

#[test]
fn two_results_with_the_same_path_in_two_spellings_are_an_error() {
    let folder = tempfile::tempdir().unwrap();
    for other in ["{}/./a.ply", "{}/new/../a.ply", "{}/new/../../{}/a.ply"] {
        let other = other.replacen(
            "../../{}",
            &format!("../../{}", folder.path().file_name().unwrap().to_str().unwrap()),
            1,
        );
        let words = format!("reconstruct . --views 000 -o {{}}/a.ply --points {other}");
        fail(folder.path(), &words, 1, &["two results (number 1 and number 2)"]);
    }
    fail(
        folder.path(),
        "reconstruct . --views 000 -o - --points -",
        1,
        &["2 results would go to standard output"],
    );
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_name_with_the_ending_of_another_format_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    for (words, ending) in [
        ("reconstruct . -o {}/car.spz", ".ply"),
        ("reconstruct . -o {}/car.splat", ".ply"),
        ("reconstruct . -o {}/car.ply --points {}/p.las", ".ply"),
        ("reconstruct . -o {}/car.ply --report {}/r.yaml", ".json"),
        ("eval . --markdown {}/t.json", ".md or .markdown"),
        ("pareto . --point=all: --csv {}/t.tsv", ".csv"),
        ("pareto . --point=all: --png {}/t.jpg", ".png"),
        ("report . -o {}/page.pdf", ".html or .htm"),
        ("align . --matrix vehicle_from_world.json -o {}/v.txt", ".json"),
    ] {
        fail(folder.path(), words, 2, &["expected a name that ends in", ending]);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_result_named_dash_is_the_only_output_on_standard_output() {
    let at = Path::new(".");
    let made = Command::new(env!("CARGO_BIN_EXE_vg"))
        .args(["reconstruct", ".", "--views", "000,001", "--prior", "given", "-o", "-"])
        .current_dir(sample())
        .output()
        .unwrap();
    assert!(made.status.success() && made.stderr.is_empty(), "{}", String::from_utf8_lossy(&made.stderr));
    let (gaussians, _) = vg::io::ply::read_from(&made.stdout[..], made.stdout.len() as u64, at).unwrap();
    let mut again = Vec::new();
    vg::io::ply::write_to(&mut again, &gaussians).unwrap();
    assert_eq!(again.len(), made.stdout.len(), "nothing after the model");

    let words = "reconstruct . --views 000,001 --prior given -o /dev/null --report";
    let report: serde_json::Value = serde_json::from_str(&succeed(at, &format!("{words} -")).out).unwrap();
    assert_eq!(report["gaussians"], gaussians.len());
    if cfg!(unix) {
        let same: serde_json::Value =
            serde_json::from_str(&succeed(at, &format!("{words} /dev/stdout")).out).unwrap();
        assert_eq!(same["gaussians"], gaussians.len());
    }
    let similarity = succeed(at, "align . --matrix vehicle_from_world.json -o -").out;
    vg::io::vehicle_frame::parse_vehicle_from_world(similarity.as_bytes(), at).unwrap();
    let table = succeed(at, "eval . --prior given --markdown -").out;
    assert!(table.lines().count() == 3 && table.lines().all(|line| line.starts_with("| ")), "{table}");
    fail(at, &format!("render {} --turntable 2 -o -", asset().display()), 2, &["expected a folder"]);
}
