//! Every error is one line that names the cause.

use super::*;
use std::fs;

#[test]
fn a_missing_scene_is_named() {
    let at = Path::new(".");
    fail(at, "reconstruct nowhere -o a.ply", 1, &["nowhere", "No such file"]);
    fail(at, "reconstruct nowhere/transforms.json -o a.ply", 1, &["nowhere/transforms.json"]);
    fail(at, "reconstruct images -o a.ply", 1, &["images", "neither a transforms.json"]);
    fail(at, "reconstruct README.md -o a.ply", 1, &["README.md", "neither a transforms.json"]);
}

#[test]
fn the_hull_refuses_a_view_without_a_mask_by_name() {
    let scene = copy_of_sample(&["transforms.json", "images/000.png", "images/001.png", "masks/000.png"]);
    let path = scene.path().join("transforms.json");
    let text = fs::read_to_string(&path).unwrap().replace("\"mask_path\": \"masks/001.png\",", "");
    fs::write(&path, text).unwrap();
    let words = "reconstruct {} --views 000,001 --prior hull -o {}/a.ply";
    fail(scene.path(), words, 1, &["001.png", "mask", "none"]);
    assert!(!scene.path().join("a.ply").exists());
}

#[test]
fn given_refuses_a_view_without_depth_by_name() {
    fail(
        Path::new("."),
        "reconstruct . --prior given --views 000,006 -o /dev/null",
        1,
        &["006.png", "depth"],
    );
}

#[test]
fn a_mask_that_the_scene_names_but_lacks_is_named() {
    let scene = copy_of_sample(&["transforms.json", "images/000.png"]);
    fail(scene.path(), "reconstruct {} --views 000 --prior hull -o {}/a.ply", 1, &["masks/000.png"]);
}

#[test]
fn an_unknown_view_is_an_error_with_the_existing_views() {
    for command in
        ["reconstruct . --views 000,side.png -o a.ply", "render {} --cameras . --views side.png -o a"]
    {
        fail(asset(), command, 1, &["side.png", "000.png", "007.png"]);
    }
}

#[test]
fn a_bad_box_and_a_bad_background_are_usage_errors() {
    for size in ["4,2", "4,2,1,1", "a,b,c", "4,2,0", "nan,2,1", "-4,2,1", "400,2,1", ""] {
        let size = format!("--box={size}");
        fail(Path::new("."), &format!("reconstruct . -o a.ply {size}"), 2, &["--box"]);
    }
    for background in ["grey", "1,2", "1,2,256", "-1,2,3", "0.5,0.5,0.5"] {
        let words = format!("render a.ply --cameras . -o x --background={background}");
        fail(Path::new("."), &words, 2, &["--background", "white"]);
    }
}

#[test]
fn an_output_that_cannot_be_written_is_an_error_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("file"), "").unwrap();
    fs::create_dir(at.join("folder")).unwrap();
    fail(at, "reconstruct . -o {}/file/a.ply", 1, &["file"]);
    fail(at, "reconstruct . -o {}/folder", 1, &["folder", "is a folder"]);
    fail(at, "reconstruct . -o {}/a.ply --report {}/a.ply", 1, &["a.ply", "two results"]);
    fail(at, &format!("render {} --cameras . -o {{}}/file", asset().display()), 1, &["file"]);
    fail(at, "eval . --json {}/file/e.json", 1, &["file"]);
    assert_eq!(fs::read_dir(at).unwrap().count(), 2, "nothing was written");
}

#[test]
fn a_model_is_not_written_over_the_pictures_it_is_made_of() {
    let scene = copy_of_sample(&["transforms.json", "images", "masks", "depth"]);
    let words = "reconstruct {} --views 000 -o {}/images/../images/000.png";
    fail(scene.path(), words, 1, &["would be replaced"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_read_only_folder_is_an_error_before_the_work() {
    fail(Path::new("."), "reconstruct . --views 000 -o /proc/a.ply", 1, &["/proc: "]);
    fail(Path::new("."), "eval . --json /proc/e.json", 1, &["/proc: "]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_and_not_a_panic() {
    fail(
        Path::new("."),
        "reconstruct . --views 000,001 --prior given -o /dev/full",
        1,
        &["/dev/full", "space"],
    );
}

#[test]
fn a_colmap_model_without_its_similarity_is_an_error_that_names_it() {
    let scene = copy_of_sample(&["sparse", "images", "masks"]);
    fail(scene.path(), "reconstruct {} -o {}/a.ply", 1, &["--vehicle-from-world FILE"]);
}

#[test]
fn info_and_render_refuse_files_that_are_not_ply() {
    for file in ["README.md", "images/000.png", "transforms.json"] {
        fail(Path::new("."), &format!("info {file}"), 1, &[file]);
        fail(Path::new("."), &format!("render {file} --cameras . -o out"), 1, &[file]);
    }
    fail(Path::new("."), "info images", 1, &["images"]);
    fail(Path::new("."), "info nowhere.ply", 1, &["nowhere.ply", "No such file"]);
}

#[test]
fn a_truncated_model_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = fs::read(asset()).unwrap();
    fs::write(folder.path().join("a.ply"), &bytes[..bytes.len() - 1]).unwrap();
    fail(folder.path(), "info {}/a.ply", 1, &["a.ply"]);
}
