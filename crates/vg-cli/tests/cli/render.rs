//! `vg render` of the sample's model.

use super::*;
use image::{ColorType, DynamicImage};
use std::fs;

fn picture(path: &Path) -> DynamicImage {
    image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn every_camera_gives_a_picture_named_after_its_photograph() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("made/here");
    succeed(&out, &format!("render {} --cameras . -o {{}}", asset().display()));
    assert_eq!(names(&out), (0..8).map(|i| format!("{i:03}.png")).collect::<Vec<_>>());
    for name in names(&out) {
        let picture = picture(&out.join(name));
        assert_eq!((picture.width(), picture.height(), picture.color()), (512, 384, ColorType::Rgb8));
        assert_eq!(picture.as_rgb8().unwrap().get_pixel(0, 0).0, [255; 3]);
    }
}

#[test]
fn pictures_with_equal_names_in_several_folders_keep_their_folders() {
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(sample().join("transforms.json")).unwrap();
    let mut scene: serde_json::Value = serde_json::from_str(&text).unwrap();
    let frames = scene["frames"].as_array_mut().unwrap();
    frames.truncate(3);
    for (frame, path) in
        frames.iter_mut().zip(["images/cam0/000.png", "images/cam1/000.png", "images/a,b.png"])
    {
        frame["file_path"] = path.into();
        (frame["w"], frame["h"]) = (512.into(), 384.into());
    }
    fs::write(folder.path().join("transforms.json"), scene.to_string()).unwrap();
    let render = |views: &str, out: &str| {
        let words = format!("render {} --cameras {{}} {views} --depth -o {{}}/{out}", asset().display());
        succeed(folder.path(), &words);
    };
    render("", "all");
    for name in ["cam0/000.png", "cam1/000.png", "a,b.png", "depth/cam0/000.png", "depth/cam1/000.png"] {
        assert!(folder.path().join("all").join(name).is_file(), "{name}");
    }
    render(r"--views cam1/000.png --views a\,b", "some");
    assert_eq!(names(&folder.path().join("some")), ["000.png", "a,b.png", "depth"]);
}

#[test]
fn depth_is_16_bit_millimetres_next_to_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &format!("render {} --cameras . --views 002 --depth -o {{}}", asset().display()));
    let drawn = picture(&folder.path().join("depth/002.png"));
    let truth = picture(&sample().join("depth/002.png"));
    let (drawn, truth) = (drawn.as_luma16().unwrap(), truth.as_luma16().unwrap());
    let differences: Vec<f64> = drawn
        .pixels()
        .zip(truth.pixels())
        .filter(|(d, t)| d.0[0] > 0 && t.0[0] > 0)
        .map(|(d, t)| (f64::from(d.0[0]) - f64::from(t.0[0])).abs())
        .collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    // A visual hull of four views is some centimetres too fat.
    assert!(differences.len() > 20_000 && mean < 250.0, "{mean} mm over {} pixels", differences.len());
}

#[test]
fn backgrounds_are_white_black_any_colour_or_transparent() {
    let folder = tempfile::tempdir().unwrap();
    let corner = |background: &str| {
        let words =
            format!("render {} --cameras . --views 005 --background {background} -o {{}}", asset().display());
        succeed(folder.path(), &words);
        picture(&folder.path().join("005.png"))
    };
    for (background, expected) in [("white", [255; 3]), ("black", [0; 3]), ("10,20,30", [10, 20, 30])] {
        assert_eq!(corner(background).as_rgb8().unwrap().get_pixel(0, 0).0, expected);
    }
    assert_eq!(corner("transparent").as_rgba8().unwrap().get_pixel(0, 0).0[3], 0);
}

#[test]
fn a_turntable_shows_the_whole_vehicle_from_all_sides() {
    let folder = tempfile::tempdir().unwrap();
    let words = format!("render {} --turntable 5 --size 200x120 -o {{}}", asset().display());
    succeed(folder.path(), &words);
    assert_eq!(names(folder.path()), (0..5).map(|i| format!("{i:03}.png")).collect::<Vec<_>>());
    for name in names(folder.path()) {
        let picture = picture(&folder.path().join(&name)).into_rgb8();
        assert_eq!(picture.dimensions(), (200, 120));
        let on_border = picture
            .enumerate_pixels()
            .filter(|(x, y, p)| (*x == 0 || *y == 0 || *x == 199 || *y == 119) && p.0 != [255; 3]);
        assert_eq!(on_border.count(), 0, "{name} is cut");
        let vehicle = picture.pixels().filter(|p| p.0 != [255; 3]).count();
        assert!(vehicle > 1200, "{name}: {vehicle} pixels of vehicle");
    }
}

#[test]
fn a_scene_needs_no_pictures_to_be_rendered_but_a_colmap_model_needs_its_similarity() {
    let scene = copy_of_sample(&["sparse", "vehicle_from_world.json"]);
    let asset = asset().display();
    let similarity = "--vehicle-from-world {}/vehicle_from_world.json";
    succeed(scene.path(), &format!("render {asset} --cameras {{}} {similarity} --views 006.png -o {{}}/out"));
    assert_eq!(names(&scene.path().join("out")), ["006.png"]);
    fail(
        scene.path(),
        &format!("render {asset} --cameras {{}} -o {{}}/out"),
        1,
        &["vehicle_from_world", "--vehicle-from-world FILE"],
    );
}

#[test]
fn results_never_replace_each_other_or_the_scenes_own_pictures() {
    let scene = copy_of_sample(&["transforms.json", "images/000.png", "images/001.png"]);
    let asset = asset().display();
    let text = fs::read_to_string(scene.path().join("transforms.json")).unwrap();
    let before = fs::read(scene.path().join("images/000.png")).unwrap();
    fail(
        scene.path(),
        &format!("render {asset} --cameras {{}} --views 000 -o {{}}/images"),
        1,
        &["images/000.png", "would be replaced"],
    );
    assert!(fs::read(scene.path().join("images/000.png")).unwrap() == before);
    // With two folders of equally named pictures, the results keep the folders.
    fs::write(scene.path().join("transforms.json"), text.replace("images/001.png", "images/rear/000.png"))
        .unwrap();
    succeed(scene.path(), &format!("render {asset} --cameras {{}} -o {{}}/out"));
    assert!(scene.path().join("out/000.png").exists() && scene.path().join("out/rear/000.png").exists());
}

#[test]
fn the_backend_is_chosen_printed_and_an_error_if_unavailable() {
    let folder = tempfile::tempdir().unwrap();
    let render = |backend: &str| {
        format!("render {} --cameras . --views 005 --backend {backend} -o {{}}", asset().display())
    };
    let run = succeed(folder.path(), &render("cpu"));
    assert!(run.out.contains("1 picture by cpu (") && run.out.contains("): asked for"), "{run:?}");
    let by_cpu = picture(&folder.path().join("005.png"));
    succeed(folder.path(), &render("auto"));
    assert_eq!(vg_in(folder.path(), &render("cuda")).code, 2);
    let run = vg_in(folder.path(), &render("gpu"));
    if run.code == 0 {
        assert!(run.out.contains("1 picture by gpu ("), "{run:?}");
        let by_gpu = picture(&folder.path().join("005.png"));
        let [a, b] = [&by_cpu, &by_gpu].map(|p| p.as_rgb8().unwrap().as_raw());
        assert!(a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap() <= 1);
    } else {
        let why = if cfg!(feature = "gpu") { "graphics processor: " } else { "gpu is not in this build" };
        fail(folder.path(), &render("gpu"), run.code, &[why]);
    }
}
