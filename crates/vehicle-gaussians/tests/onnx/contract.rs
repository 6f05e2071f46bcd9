//! Models that break a contract: the error of each names the place and the allowed values.

use std::ops::ControlFlow;
use vg::onnx::Model;
use vg::pipeline::{Calibrate, Options, PriorChoice, reconstruct};
use vg::{Error, Scene};
use vg_testing::networks::graph::{Graph, INT64, Port};
use vg_testing::networks::oracle::{Manner, ellipsoid, set_output};
use vg_testing::networks::{file, open, opened};
use vg_testing::vehicle::right_side;

const WIDTH: u32 = 48;
const HEIGHT: u32 = 36;

fn sound(scene: &Scene) -> Graph {
    ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN)
}

fn refusal(scene: &Scene, model: &Model) -> String {
    let options = Options {
        prior: PriorChoice::Onnx,
        prior_model: Some(model.clone()),
        calibrate: Calibrate::Off,
        ..Options::default()
    };
    match reconstruct(scene, &options, &mut |_| ControlFlow::Continue(())) {
        Ok(_) => "accepted".into(),
        Err(Error::Format { field, reason, .. }) => format!("{field}: {reason}"),
        Err(other) => other.to_string(),
    }
}

#[test]
fn each_violation_is_named() {
    let scene = right_side(WIDTH, HEIGHT);
    let graph = sound(&scene);
    let Some(model) = open("sound", &graph) else { return };
    assert_eq!(refusal(&scene, &model), "accepted");

    let input = |graph: &mut Graph, name: &str, change: &dyn Fn(&mut Port)| {
        change(graph.inputs.iter_mut().find(|p| p.name == name).unwrap());
    };
    type Break<'a> = (&'a str, Box<dyn Fn(&mut Graph) + 'a>, &'a str);
    let without = |key: &'static str| move |g: &mut Graph| g.metadata.retain(|(k, _)| k != key);
    let breaks: Vec<Break> = vec![
        ("no contract", Box::new(without("vg.contract")), "metadata vg.contract: missing"),
        ("contract 2", Box::new(|g| g.set("vg.contract", "2")), "metadata vg.contract: \"2\"; allowed: 1"),
        ("no name", Box::new(without("vg.prior")), "metadata vg.prior: missing"),
        ("a head", Box::new(|g| g.set("vg.head", "unet")), "metadata vg.head: \"unet\": a Gaussian head"),
        ("no kind", Box::new(without("vg.depth")), "metadata vg.depth: missing"),
        (
            "odd kind",
            Box::new(|g| g.set("vg.depth", "disparity")),
            "metadata vg.depth: \"disparity\"; allowed: along_ray, z",
        ),
        ("no unit", Box::new(without("vg.metric")), "metadata vg.metric: missing"),
        (
            "odd unit",
            Box::new(|g| g.set("vg.metric", "yes")),
            "metadata vg.metric: \"yes\"; allowed: true, false",
        ),
        (
            "odd resize",
            Box::new(|g| g.set("vg.resize", "pad")),
            "metadata vg.resize: \"pad\"; allowed: cover_crop",
        ),
        (
            "no multiple",
            Box::new(|g| g.set("vg.size_multiple", "0")),
            "metadata vg.size_multiple: \"0\"; allowed: 1",
        ),
        (
            "two colours",
            Box::new(|g| g.set("vg.mean", "0.5,0.5")),
            "metadata vg.mean: \"0.5,0.5\"; allowed: three",
        ),
        (
            "no spread",
            Box::new(|g| g.set("vg.std", "1,0,1")),
            "metadata vg.std: [1.0, 0.0, 1.0]; allowed: no zeros",
        ),
        (
            "input renamed",
            Box::new(|g| input(g, "images", &|p| p.name = "pictures".into())),
            "input images: missing",
        ),
        (
            "one more input",
            Box::new(|g| g.inputs.push(Port::new("prompt", &[Some(1)]))),
            "input prompt: unknown; allowed: images, intrinsics, cam_to_ref",
        ),
        (
            "four channels",
            Box::new(|g| input(g, "images", &|p| p.dimensions[1] = Some(4))),
            "input images: shape [any, 4, 36, 48]; allowed: [any, 3, any, any]",
        ),
        (
            "a batch axis",
            Box::new(|g| input(g, "images", &|p| p.dimensions.insert(0, Some(1)))),
            "input images: shape [1, any, 3, 36, 48]; allowed: [any, 3, any, any]",
        ),
        (
            "a free width",
            Box::new(|g| input(g, "images", &|p| p.dimensions[3] = None)),
            "input images: one side fixed and one free",
        ),
        ("output missing", Box::new(|g| g.outputs.retain(|p| p.name != "depth")), "output depth: missing"),
        (
            "no metric scale and no cameras",
            Box::new(|g| {
                g.say("vg.metric", "false");
                g.outputs.retain(|p| p.name != "cam_to_ref_pred");
            }),
            "output cam_to_ref_pred: missing; a prior with vg.metric=false needs it",
        ),
        (
            "NaN",
            Box::new(|g| set_output(g, "depth", f32::NAN)),
            "output depth: the network returned NaN; allowed: finite",
        ),
        (
            "infinite",
            Box::new(|g| set_output(g, "confidence", f32::INFINITY)),
            "output confidence: the network returned inf",
        ),
        (
            "negative",
            Box::new(|g| set_output(g, "depth", -2.0)),
            "output depth: the network returned -2; allowed: above 0",
        ),
        (
            "short rays",
            Box::new(|g| set_output(g, "rays", 0.5)),
            "output rays: the network returned a ray of length 0.866",
        ),
        (
            "mask of 2",
            Box::new(|g| set_output(g, "mask", 2.0)),
            "output mask: the network returned 2; allowed: 0 to 1",
        ),
        (
            "scale 0",
            Box::new(|g| set_output(g, "scale", 0.0)),
            "output scale: the network returned 0; allowed: above 0",
        ),
        ("no rotation", Box::new(|g| set_output(g, "cam_to_ref_pred", 1.0)), "output cam_to_ref_pred[0]: "),
        (
            "five views",
            Box::new(|g| g.inputs.iter_mut().for_each(|p| p.dimensions[0] = Some(5))),
            "views: 4; allowed: 5, the fixed number of views of the network ",
        ),
    ];
    assert!(breaks.len() >= 20);
    for (name, break_it, expected) in breaks {
        let mut broken = graph.clone();
        break_it(&mut broken);
        let path = file(name);
        broken.write(&path);
        // If the runtime itself finds the fault first, its message names the model.
        let message = match opened(&path).unwrap() {
            Ok(model) => refusal(&scene, &model),
            Err(error) => error.to_string(),
        };
        assert!(message.starts_with(expected), "{name}:\n  {message}\n  {expected}");
    }
}

#[test]
fn errors_of_the_runtime_name_the_file_in_one_line() {
    let scene = right_side(WIDTH, HEIGHT);
    let mut graph = sound(&scene);
    if open("probe", &graph).is_none() {
        return;
    }
    let path = file("no model");
    std::fs::write(&path, b"not a model at all").unwrap();
    let text = opened(&path).unwrap().unwrap_err().to_string();
    assert!(text.contains("no model.onnx: model: ") && !text.contains('\n'), "{text}");
    graph.inputs.iter_mut().for_each(|p| p.element = INT64);
    let path = file("integers");
    graph.write(&path);
    let text = opened(&path).unwrap().unwrap_err().to_string();
    assert!(text.contains("integers.onnx: model: ") && !text.contains('\n'), "{text}");
    let text = opened(&file("nowhere")).unwrap().unwrap_err().to_string();
    assert!(text.contains("nowhere.onnx: ") && text.contains("No such file"), "{text}");
}
