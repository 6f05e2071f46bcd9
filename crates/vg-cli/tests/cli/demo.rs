//! `vg demo`.

use super::*;
use std::fs;

#[test]
fn the_demo_writes_model_report_renders_and_contact_sheet() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("new");
    let out = succeed(&at, "demo {}").out;
    for word in ["PSNR", "--prior shape", "--prior given", "contact.png", "asset.ply"] {
        assert!(out.contains(word), "{word} in {out}");
    }
    for file in ["asset.ply", "points.ply", "report.json", "contact.png"] {
        assert!(fs::metadata(at.join(file)).unwrap().len() > 1000, "{file}");
    }
    assert_eq!(fs::read_dir(at.join("unseen")).unwrap().count(), 4);
    assert_eq!(json(&at.join("report.json"))["prior"], "shape");
    assert!(fs::read(at.join("asset.ply")).unwrap() == fs::read(asset()).unwrap());
    let sheet = image::open(at.join("contact.png")).unwrap();
    assert!(sheet.width() > 1000 && sheet.height() > 300);
    // A second run replaces everything.
    succeed(&at, "demo {}");
}

#[test]
fn the_sample_inside_the_program_equals_the_one_in_the_repository() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), "demo {}");
    let scene = folder.path().join("scene");
    let mut files = 0;
    for part in ["", "images", "masks", "depth", "sparse/0"] {
        for entry in fs::read_dir(sample().join(part)).unwrap() {
            let entry = entry.unwrap();
            // The text version of the model has the same content.
            let is_twin = part == "sparse/0" && entry.path().extension().is_some_and(|e| e == "txt");
            if entry.file_type().unwrap().is_file() && !is_twin {
                let inside = scene.join(part).join(entry.file_name());
                let name = inside.display();
                assert!(fs::read(&inside).ok() == fs::read(entry.path()).ok(), "{name} differs");
                files += 1;
            }
        }
    }
    assert!(files >= 28, "{files} files");
}

#[test]
fn a_folder_that_cannot_be_created_is_one_error() {
    let file = tempfile::NamedTempFile::new().unwrap();
    fail(file.path(), "demo {}/demo", 1, &[file.path().to_str().unwrap()]);
}
