//! Masks from segmentation networks, on graphs whose answers are known: bright pixels are vehicle.

use crate::common::vehicle::right_side;
use crate::graph::{Attribute, Graph, Port};
use crate::{file, open, opened};
use std::process::Command;
use vg::onnx::Model;
use vg::scene::mask::Label;
use vg::scene::{Mask, RgbImage, Segmenter};
use vg::{Camera, Error, View};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;

/// The probability is the mean of the channels; `side` fixed, or free with a long side of 64.
pub(crate) fn brightness(sides: Option<(u64, u64)>) -> Graph {
    let mut g = Graph::default();
    let (h, w) = (sides.map(|s| s.1), sides.map(|s| s.0));
    g.inputs = vec![Port::new("images", &[None, Some(3), h, w])];
    g.outputs = vec![Port::new("mask", &[None, h, w])];
    g.say("vg.contract", "1").say("vg.mask", "brightness");
    if sides.is_none() {
        g.say("vg.long_side", "64").say("vg.size_multiple", "8");
    }
    let mean = [Attribute::Ints("axes", &[1]), Attribute::Int("keepdims", 0)];
    g.node("ReduceMean", &["images"], "mask", &mean);
    g
}

/// White where the vehicle is, and a white car to the left of it.
pub(crate) fn black_and_white(view: &View, neighbour: bool) -> RgbImage {
    let mask = view.mask.as_ref().unwrap();
    let pixel = |i: u32| {
        let (u, v) = (i % WIDTH, i / WIDTH);
        let shown = mask.is_vehicle(u, v) || (neighbour && u < 6 && (30..50).contains(&v));
        [if shown { 255 } else { 0 }; 3]
    };
    RgbImage::new(WIDTH, HEIGHT, (0..WIDTH * HEIGHT).map(pixel).collect()).unwrap()
}

/// Pixels in both over pixels in either.
fn overlap(a: &Mask, b: &Mask) -> f64 {
    let count = |test: &dyn Fn(bool, bool) -> bool| {
        let vehicle = |l: &Label| *l == Label::Vehicle;
        a.labels().iter().zip(b.labels()).filter(|(a, b)| test(vehicle(a), vehicle(b))).count() as f64
    };
    count(&|a, b| a && b) / count(&|a, b| a || b)
}

fn segmenter(name: &str, graph: &Graph) -> Option<Segmenter> {
    open(name, graph).map(|model: Model| Segmenter::new(model).unwrap())
}

#[test]
fn the_mask_comes_back_at_the_photographs_size_without_the_car_beside() {
    let scene = right_side(WIDTH, HEIGHT);
    // The network's pictures: as large, smaller and of another shape, and of any size.
    let sizes = [Some((96, 72)), Some((64, 64)), None];
    for (k, (size, least)) in sizes.into_iter().zip([1.0, 0.93, 0.93]).enumerate() {
        let Some(network) = segmenter(&format!("segment{k}"), &brightness(size)) else { return };
        for view in &scene.views {
            let mask = network.mask(&black_and_white(view, true), &view.camera).unwrap();
            let overlap = overlap(&mask, view.mask.as_ref().unwrap());
            assert!(overlap >= least, "{size:?} {}: {overlap}", view.name);
        }
    }
}

#[test]
fn only_views_without_a_mask_are_filled() {
    let mut scene = right_side(WIDTH, HEIGHT);
    let Some(network) = segmenter("fill", &brightness(None)) else { return };
    scene.views[1].image = black_and_white(&scene.views[1], false);
    let known = scene.views[1].mask.take().unwrap();
    let others = scene.views.clone();
    assert_eq!(network.fill(&mut scene.views).unwrap(), 1);
    assert!(overlap(scene.views[1].mask.as_ref().unwrap(), &known) > 0.93);
    assert!([0, 2, 3].iter().all(|&i| scene.views[i].mask == others[i].mask));
    assert_eq!(network.fill(&mut scene.views).unwrap(), 0);
}

#[test]
fn segmentations_that_break_the_contract_are_named() {
    let view = right_side(WIDTH, HEIGHT).views.remove(0);
    let graph = brightness(Some((96, 72)));
    if open("sound segmentation", &graph).is_none() {
        return;
    }
    type Break = (fn(&mut Graph), &'static str);
    let breaks: [Break; 10] = [
        (|g| g.metadata.retain(|(k, _)| k != "vg.contract"), "metadata vg.contract: missing"),
        (|g| g.metadata.retain(|(k, _)| k != "vg.mask"), "metadata vg.mask: missing"),
        (|g| g.set("vg.prior", "x"), "metadata vg.prior: \"x\": a geometry prior, no segmentation"),
        (|g| g.set("vg.head", "x"), "metadata vg.head: \"x\": a Gaussian head, no segmentation"),
        (|g| g.inputs.push(Port::new("prompt", &[Some(1)])), "input prompt: unknown; allowed: images"),
        (|g| g.inputs[0].dimensions[0] = Some(2), "input images: takes 2 views at once; allowed: 1 or any"),
        (|g| g.outputs[0].dimensions = vec![None, Some(1), Some(72), Some(96)], "allowed: [any, 72, 96]"),
        (
            |g| {
                g.rename_output_of("mask", "before");
                g.floats("two", &[1], &[2.0]).node("Add", &["before", "two"], "mask", &[]);
            },
            "output mask: 2",
        ),
        (
            |g| {
                g.rename_output_of("mask", "before");
                g.floats("bad", &[1], &[f32::NAN]).node("Add", &["before", "bad"], "mask", &[]);
            },
            "output mask: NaN came of a run; allowed: finite",
        ),
        (|g| g.set("vg.std", "0,1,1"), "metadata vg.std: [0.0, 1.0, 1.0]; allowed: no zeros"),
    ];
    for (k, (break_it, expected)) in breaks.into_iter().enumerate() {
        let mut broken = graph.clone();
        break_it(&mut broken);
        let path = file(&format!("segmentation{k}"));
        broken.write(&path);
        let model = match opened(&path).unwrap() {
            Ok(model) => Segmenter::new(model),
            Err(error) => Err(error),
        };
        let said = match model.and_then(|network| network.mask(&view.image, &view.camera)) {
            Ok(_) => "accepted".into(),
            Err(Error::Format { field, reason, .. }) => format!("{field}: {reason}"),
            Err(other) => other.to_string(),
        };
        assert!(said.contains(expected), "{said}\n{expected}");
    }
    let network = segmenter("size", &graph).unwrap();
    let other = Camera { width: 97, ..view.camera };
    let error = network.mask(&view.image, &other).unwrap_err().to_string();
    assert!(error.contains("image: 96x72; allowed: the camera's size, 97x72"), "{error}");
}

#[test]
fn the_program_makes_a_vehicle_of_photographs_without_masks() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene");
    let sample = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/sedan");
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
        error.contains(".mask: none; allowed: a mask with the vehicle") && error.contains("mask model"),
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
    assert!(has_masks.status.success() && error.contains("not opened, every view has a mask"), "{error}");
}
