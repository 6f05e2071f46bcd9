//! The Gaussian head on graphs whose attributes are known.

use crate::common::vehicle::right_side;
use crate::graph::{Graph, Port};
use crate::open;
use std::ops::ControlFlow;
use vg::onnx::Model;
use vg::pipeline::{Calibrate, Options, reconstruct};
use vg::symmetry::SymmetryMode;
use vg::{Error, Scene};

/// Attributes that are the same at every pixel: 0 but for scale channels of `scale`.
fn constant(multiple: &str, scale: f32) -> Graph {
    let mut g = Graph::default();
    g.inputs = vec![
        Port::new("images", &[None, Some(3), None, None]),
        Port::new("depth", &[None, None, None]),
        Port::new("intrinsics", &[None, Some(3), Some(3)]),
    ];
    g.outputs = vec![Port::new("attributes", &[None, Some(38), None, None])];
    g.say("vg.contract", "1").say("vg.head", "constant").say("vg.size_multiple", multiple);
    let mut values = [0.0f32; 38];
    values[4] = 2.0;
    values[8..11].fill(scale);
    g.floats("values", &[1, 38, 1, 1], &values).floats("nothing", &[1], &[0.0]).integers("one", &[1]);
    g.node("Unsqueeze", &["depth", "one"], "depth4", &[]).node("Mul", &["depth4", "nothing"], "empty", &[]);
    g.node("Add", &["empty", "values"], "attributes", &[]);
    g
}

fn options(model: &Model) -> Options {
    Options {
        head_model: Some(model.clone()),
        calibrate: Calibrate::Off,
        symmetry: SymmetryMode::Never,
        ..Options::default()
    }
}

fn run(scene: &Scene, options: &Options) -> vg::Result<vg::pipeline::Reconstruction> {
    reconstruct(scene, options, &mut |_| ControlFlow::Continue(()))
}

#[test]
fn attributes_become_gaussians_at_the_lifted_points() {
    // Sides that are no multiples of 32.
    let scene = right_side(50, 37);
    let Some(model) = open("constant", &constant("32", -5.0)) else { return };
    let made = run(&scene, &options(&model)).unwrap();
    let surfels = run(&scene, &Options { head_model: None, ..options(&model) }).unwrap();
    assert_eq!((made.report.head, surfels.report.head), ("network", "surfel"));
    assert_eq!(made.gaussians.means(), surfels.gaussians.means());
    let expected = (-5f32).exp().ln_1p();
    assert!(made.gaussians.scales().iter().flatten().all(|s| (s - expected).abs() < 1e-6));
    assert!(made.gaussians.opacities().iter().all(|o| (o - 0.952_574_1).abs() < 1e-6));
    assert!(made.gaussians.rotations().iter().all(|q| *q == [1.0, 0.0, 0.0, 0.0]));
}

#[test]
fn heads_that_break_the_contract_are_named() {
    let scene = right_side(48, 36);
    let graph = constant("1", -5.0);
    if open("sound head", &graph).is_none() {
        return;
    }
    type Break = (fn(&mut Graph), &'static str);
    let breaks: [Break; 6] = [
        (|g| g.metadata.retain(|(k, _)| k != "vg.head"), "metadata vg.head: missing"),
        (|g| g.set("vg.scale_activation", "exp"), "metadata vg.scale_activation: \"exp\"; allowed: softplus"),
        (|g| g.set("vg.prior", "x"), "metadata vg.prior: \"x\": a geometry prior, no Gaussian head"),
        (|g| g.outputs[0].dimensions[1] = None, "accepted"),
        (|g| g.inputs[0].dimensions[2] = Some(36), "input images: of a fixed size"),
        (
            |g| {
                g.rename_output_of("attributes", "before");
                g.floats("bad", &[1], &[f32::NAN]).node("Add", &["before", "bad"], "attributes", &[]);
            },
            "output attributes: NaN came of a run",
        ),
    ];
    for (k, (break_it, expected)) in breaks.into_iter().enumerate() {
        let mut broken = graph.clone();
        break_it(&mut broken);
        let model = open(&format!("head{k}"), &broken).unwrap();
        let said = match run(&scene, &options(&model)) {
            Ok(_) => "accepted".into(),
            Err(Error::Format { field, reason, .. }) => format!("{field}: {reason}"),
            Err(other) => other.to_string(),
        };
        assert!(said.starts_with(expected), "{said}\n{expected}");
    }
}
