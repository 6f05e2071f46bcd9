//! Masks from segmentation networks, on graphs with known answers: bright pixels are vehicle.

use vg::onnx::Model;
use vg::scene::mask::Label;
use vg::scene::{Mask, Segmenter};
use vg::{Camera, Error};
use vg_testing::networks::graph::{Graph, Port};
use vg_testing::networks::{black_and_white, brightness, file, open, opened};
use vg_testing::vehicle::right_side;

const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;

/// Intersection over union of two masks.
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
fn the_mask_has_the_photographs_size_and_excludes_the_neighbouring_car() {
    let scene = right_side(WIDTH, HEIGHT);
    // The network's picture size: equal, smaller and of another shape, and free.
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
        (
            |g| g.set("vg.prior", "x"),
            "metadata vg.prior: \"x\": a geometry prior, not a segmentation network",
        ),
        (|g| g.set("vg.head", "x"), "metadata vg.head: \"x\": a Gaussian head, not a segmentation network"),
        (|g| g.inputs.push(Port::new("prompt", &[Some(1)])), "input prompt: unknown; allowed: images"),
        (|g| g.inputs[0].dimensions[0] = Some(2), "input images: 2 views per run; allowed: 1 or any"),
        (|g| g.outputs[0].dimensions = vec![None, Some(1), Some(72), Some(96)], "allowed: [any, 72, 96]"),
        (
            |g| {
                g.rename_output_of("mask", "before");
                g.floats("two", &[1], &[2.0]).node("Add", &["before", "two"], "mask", &[]);
            },
            "output mask: the network returned 2",
        ),
        (
            |g| {
                g.rename_output_of("mask", "before");
                g.floats("bad", &[1], &[f32::NAN]).node("Add", &["before", "bad"], "mask", &[]);
            },
            "output mask: the network returned NaN; allowed: finite",
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
        let message = match model.and_then(|network| network.mask(&view.image, &view.camera)) {
            Ok(_) => "accepted".into(),
            Err(Error::Format { field, reason, .. }) => format!("{field}: {reason}"),
            Err(other) => other.to_string(),
        };
        assert!(message.contains(expected), "{message}\n{expected}");
    }
    let network = segmenter("size", &graph).unwrap();
    let other = Camera { width: 97, ..view.camera };
    let error = network.mask(&view.image, &other).unwrap_err().to_string();
    assert!(error.contains("image: 96x72; allowed: the camera's size, 97x72"), "{error}");
}
