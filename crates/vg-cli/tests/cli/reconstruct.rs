//! `vg reconstruct` on the sample.

use super::*;
use std::fs;

#[test]
fn views_are_chosen_by_path_by_file_name_and_by_stem() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mixed = "images/000.png,001.png,002,images/003.png";
    succeed(
        at,
        &format!("reconstruct transforms.json --views {mixed} --prior shape -o {{}}/new/folder/a.ply"),
    );
    assert!(fs::read(at.join("new/folder/a.ply")).unwrap() == fs::read(asset()).unwrap());
}

#[test]
fn the_model_is_the_same_bytes_with_one_thread_and_with_two() {
    let folder = tempfile::tempdir().unwrap();
    for threads in [1, 2] {
        let common = format!("reconstruct . --views {INPUTS} --prior shape --threads {threads}");
        succeed(folder.path(), &format!("{common} -o {{}}/{threads}.ply --points {{}}/{threads}.points.ply"));
    }
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert!(read("1.ply") == read("2.ply"));
    assert!(read("1.points.ply") == read("2.points.ply"));
}

#[test]
fn auto_uses_depth_if_every_used_view_has_it_and_the_report_names_the_prior() {
    let folder = tempfile::tempdir().unwrap();
    let prior = |views: &str| {
        let run = succeed_with_warnings(
            folder.path(),
            &format!("reconstruct . --views {views} -o {{}}/a.ply --report {{}}/r.json"),
        );
        assert_eq!(run.err.contains("1 of 2 views have none"), views == "000,005", "{run:?}");
        let out = run.out;
        let report = json(&folder.path().join("r.json"));
        let prior = report["prior"].as_str().unwrap().to_owned();
        assert!(out.contains(&format!("prior {prior}")), "{out}");
        assert_eq!(report["views_used"].as_array().unwrap().len(), views.split(',').count());
        prior
    };
    assert_eq!(prior("000,001"), "given");
    // 005 has no depth.
    assert_eq!(prior("000,005"), "shape");
}

#[test]
fn a_colmap_folder_with_its_similarity_gives_nearly_the_model_of_the_true_poses() {
    let scene = copy_of_sample(&["images", "masks", "sparse", "vehicle_from_world.json"]);
    let at = scene.path();
    let common = "--prior shape --vehicle-from-world {}/vehicle_from_world.json";
    succeed(at, &format!("reconstruct {{}} --views {INPUTS} {common} -o {{}}/colmap.ply"));
    let (colmap, _) = vg::io::ply::read(&at.join("colmap.ply")).unwrap();
    let (direct, _) = vg::io::ply::read(asset()).unwrap();
    let (n, expected) = (colmap.len() as f64, direct.len() as f64);
    assert!((n - expected).abs() < 0.01 * expected, "{n} Gaussians, {expected} with the true poses");
    // COLMAP's model is written with all digits; the grid may still differ slightly.
    let (low, high) = (colmap.bounds().unwrap(), direct.bounds().unwrap());
    for k in 0..3 {
        assert!((low.0[k] - high.0[k]).abs() < 0.02 && (low.1[k] - high.1[k]).abs() < 0.02);
    }
}

#[test]
fn points_are_the_metric_cloud_of_the_used_views_and_keep_changes_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let common = format!("reconstruct . --views {INPUTS} --prior given");
    succeed(at, &format!("{common} -o {{}}/a.ply --points {{}}/p.ply --report {{}}/r.json"));
    let (positions, colors) = vg::io::ply::read_points(&at.join("p.ply")).unwrap();
    assert_eq!(positions.len(), colors.len());
    let size = json(&sample().join("vehicle.json"))["size_m"].clone();
    for k in 0..3 {
        let half = 0.5 * size[k].as_f64().unwrap() as f32;
        // Depth in 16-bit millimetres, and the ground at the tyres.
        assert!(positions.iter().all(|p| p[k].abs() < half + 0.05), "axis {k}");
    }
    succeed(at, &format!("{common} --keep all -o {{}}/all.ply --report {{}}/all.json"));
    let count = |name: &str| json(&at.join(name))["gaussians"].as_u64().unwrap();
    assert!(count("all.json") > count("r.json"));
    assert_eq!(json(&at.join("all.json"))["settings"]["keep"]["overlap"], true);
}

#[test]
fn options_reach_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let options = "--prior hull --symmetry never --box 4.65,1.9,1.45,0,0,0,0 --sh-degree 0 --threads 1";
    succeed(at, &format!("reconstruct . --views 002 {options} -o {{}}/a.ply --report {{}}/r.json"));
    let report = json(&at.join("r.json"));
    assert_eq!(report["symmetry"]["mode"], "never");
    assert_eq!(report["working_box"]["source"], "given");
    assert_eq!((report["sh_degree"].as_u64(), report["threads"].as_u64()), (Some(0), Some(1)));
}

/// The sample with all camera centres scaled, which scales the vehicle by the same factor.
fn shrunk(scale: f64) -> tempfile::TempDir {
    let scene = copy_of_sample(&["images", "masks", "transforms.json"]);
    let path = scene.path().join("transforms.json");
    let mut cameras = json(&path);
    for frame in cameras["frames"].as_array_mut().unwrap() {
        for row in 0..3 {
            let number = &mut frame["transform_matrix"][row][3];
            *number = (scale * number.as_f64().unwrap()).into();
        }
        frame.as_object_mut().unwrap().remove("depth_file_path");
    }
    fs::write(&path, cameras.to_string()).unwrap();
    scene
}

#[test]
fn a_bad_verdict_is_a_warning_and_with_strict_a_failure_without_a_file() {
    let scene = shrunk(0.18);
    let at = scene.path();
    let common = format!("reconstruct {{}} --views {INPUTS} --prior hull --resolution 0.5");
    let run = vg_in(at, &format!("{common} -o {{}}/a.ply --report {{}}/r.json"));
    assert_eq!(run.code, 0, "{run:?}");
    assert!(run.err.lines().all(|line| line.starts_with("vg: warning: ")), "{run:?}");
    assert!(run.err.contains("vg: warning: the vehicle is 0.8") && run.err.contains("metres"), "{run:?}");
    assert!(run.out.contains("verdict: bad"), "{run:?}");
    let report = json(&at.join("r.json"));
    assert_eq!(
        (report["verdict"].as_str(), report["verdict_reasons"][0]["code"].as_str()),
        (Some("bad"), Some("too-small"))
    );
    for strict in ["--strict", "--strict=bad", "--strict=doubtful"] {
        fail(
            at,
            &format!("{common} {strict} -o {{}}/b.ply --report {{}}/b.json"),
            1,
            &["--strict: the result is bad", "the vehicle is 0.8"],
        );
        assert!(!at.join("b.ply").exists() && !at.join("b.json").exists(), "{strict}");
    }
    fail(at, &format!("{common} --strict=good -o {{}}/b.ply"), 2, &["--strict", "doubtful, bad"]);
}

#[test]
fn a_good_result_passes_strict_and_each_view_has_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let words = format!("reconstruct . --views {INPUTS} --prior hull --strict -o {{}}/a.ply");
    let out = succeed(folder.path(), &words).out;
    assert!(out.contains("verdict: good"), "{out}");
    for view in INPUTS.split(',') {
        let line = out.lines().find(|line| line.trim_start().starts_with(&format!("{view}.png: ")));
        assert!(line.is_some_and(|line| line.contains(" dB, IoU 0.9")), "{out}");
    }
}

#[test]
fn depth_scale_replaces_the_scenes_unit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    succeed(at, "reconstruct . --views 001 --symmetry never --prior given -o {}/a.ply");
    succeed(at, "reconstruct . --views 001 --symmetry never --prior given --depth-scale 0.001 -o {}/b.ply");
    assert!(fs::read(at.join("a.ply")).unwrap() == fs::read(at.join("b.ply")).unwrap());
    let run = vg_in(at, "reconstruct . --views 001 --prior given --depth-scale 1 -o {}/c.ply");
    assert!(run.err.contains("is the unit right?"), "{run:?}");
}

#[test]
fn a_baseline_is_fitted_and_options_that_it_lacks_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let words = format!("reconstruct . --views {INPUTS} --resolution 0.25 --baseline 3dgs");
    // Four steps are few, which the verdict shows.
    succeed_with_warnings(at, &format!("{words} --refine 4 -o {{}}/a.ply --report {{}}/r.json"));
    let report = json(&at.join("r.json"));
    assert_eq!((report["prior"].as_str(), report["head"].as_str()), (Some("none"), Some("3dgs")));
    assert_eq!((report["refinement"]["made"].as_u64(), report["sh_degree"].as_u64()), (Some(4), Some(3)));
    for option in [
        "--symmetry always",
        "--prior hull",
        "--calibrate off",
        "--depth-scale 1",
        "--budget 3",
        "--points {}/p.ply",
        "--refine 4 --refine-hold-out",
    ] {
        let name =
            option.split_whitespace().find(|word| *word != "--refine" && word.starts_with("--")).unwrap();
        fail(at, &format!("{words} {option} -o {{}}/b.ply"), 2, &[name, "cannot be used with"]);
    }
    fail(at, &format!("{words}x -o {{}}/b.ply"), 2, &["3dgsx", "possible values: 3dgs"]);
}

#[test]
fn a_refinement_is_reported_and_bad_amounts_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let made = vg_in(
        folder.path(),
        &format!(
            "reconstruct . --views {INPUTS} --resolution 0.25 --refine 8 -o {{}}/a.ply --report {{}}/r.json"
        ),
    );
    assert_eq!(made.code, 0, "{}", made.err);
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("r.json")).unwrap()).unwrap();
    let done = &report["refinement"];
    assert_eq!((done["iterations"].as_u64(), done["stop"].as_str()), (Some(8), Some("done")));
    assert!(done["psnr_db"][1].as_f64() > done["psnr_db"][0].as_f64(), "{done}");
    for (amount, expected) in [
        ("many", "expected a number of steps (300) or of seconds (5s)"),
        ("0s", "expected above 0, at most 86400"),
        ("-5", "expected a number of steps"),
        ("2000000", "expected at most 1000000"),
        ("infs", "expected above 0"),
    ] {
        let refused = vg_in(folder.path(), &format!("reconstruct . --refine={amount} -o {{}}/b.ply"));
        assert!(refused.code == 2 && refused.err.contains(expected), "{amount}: {}", refused.err);
    }
}
