//! Picture distances from a network: on a graph with a known answer, and compared with the lpips package if Python has
//! it.

use std::process::Command;
use vg::Error;
use vg::metrics::Lpips;
use vg_testing::Random;
use vg_testing::networks::graph::{Attribute, Graph, Port};
use vg_testing::networks::{file, open, opened};

/// The shape of LPIPS with one layer: features of both pictures are normalised across channels, and the weighted
/// square differences are added and averaged over the pixels. The features are the colours and their sum.
fn tiny(sides: Option<[u64; 2]>) -> Graph {
    let mut g = Graph::default();
    let [w, h] = sides.map_or([None; 2], |sides| sides.map(Some));
    g.inputs = ["a", "b"].map(|name| Port::new(name, &[None, Some(3), h, w])).to_vec();
    g.outputs = vec![Port::new("lpips", &[None])];
    g.say("vg.contract", "1").say("vg.metric", "lpips").say("vg.lpips.net", "tiny").say("vg.range", "0..1");
    g.floats("two", &[1], &[2.0]).floats("one", &[1], &[1.0]).floats("small", &[1], &[1e-10]);
    g.integers("channel", &[1]);
    for name in ["a", "b"] {
        let of = |part: &str| format!("{name}_{part}");
        g.node("Mul", &[name, "two"], &of("twice"), &[]).node("Sub", &[&of("twice"), "one"], &of("rgb"), &[]);
        g.node("ReduceSum", &[&of("rgb"), "channel"], &of("sum"), &[]);
        g.node("Concat", &[&of("rgb"), &of("sum")], &of("f"), &[Attribute::Int("axis", 1)]);
        g.node("Mul", &[&of("f"), &of("f")], &of("ff"), &[]);
        g.node("ReduceSum", &[&of("ff"), "channel"], &of("square"), &[]);
        g.node("Sqrt", &[&of("square")], &of("root"), &[]);
        g.node("Add", &[&of("root"), "small"], &of("norm"), &[]);
        g.node("Div", &[&of("f"), &of("norm")], &of("unit"), &[]);
    }
    g.floats("weights", &[1, 4, 1, 1], &WEIGHTS).integers("last", &[1, 2, 3]);
    g.node("Sub", &["a_unit", "b_unit"], "d", &[]).node("Mul", &["d", "d"], "dd", &[]);
    g.node("Mul", &["dd", "weights"], "weighted", &[]);
    g.node("ReduceSum", &["weighted", "channel"], "each", &[]);
    g.node(
        "ReduceMean",
        &["each"],
        "lpips",
        &[Attribute::Ints("axes", &[1, 2, 3]), Attribute::Int("keepdims", 0)],
    );
    g
}

const WEIGHTS: [f32; 4] = [0.5, 1.0, 0.25, 2.0];

/// The distance that the graph computes, in f64.
fn expected(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let unit = |p: &[f32; 3]| {
        let rgb = p.map(|c| 2.0 * f64::from(c) - 1.0);
        let f = [rgb[0], rgb[1], rgb[2], rgb.iter().sum()];
        let norm = f.iter().map(|v| v * v).sum::<f64>().sqrt() + 1e-10;
        f.map(|v| v / norm)
    };
    let pixel = |(a, b): (&[f32; 3], &[f32; 3])| -> f64 {
        let (a, b) = (unit(a), unit(b));
        (0..4).map(|k| f64::from(WEIGHTS[k]) * (a[k] - b[k]).powi(2)).sum()
    };
    a.iter().zip(b).map(pixel).sum::<f64>() / a.len() as f64
}

/// A picture, and one that differs slightly from it.
fn pictures(width: u32, height: u32) -> [Vec<[f32; 3]>; 2] {
    let mut random = Random::new(u64::from(width));
    let mut a = Vec::new();
    let mut b = Vec::new();
    for _ in 0..width * height {
        let pixel = [(); 3].map(|()| random.uniform(0.0, 1.0) as f32);
        a.push(pixel);
        b.push(pixel.map(|c| (c + random.uniform(0.0, 0.3) as f32).min(1.0)));
    }
    [a, b]
}

/// Error of f32 sums of four numbers and of all pixels.
const TOLERANCE: f64 = 2e-6;

#[test]
fn the_distance_equals_the_result_of_the_graph() {
    let Some(model) = open("lpips", &tiny(None)) else { return };
    let lpips = Lpips::new(model).unwrap();
    assert_eq!(lpips.net(), "tiny");
    for (w, h) in [(64, 64), (97, 75)] {
        let [a, b] = pictures(w, h);
        let found = lpips.distance(&a, &b, w, h).unwrap();
        assert!((found - expected(&a, &b)).abs() < TOLERANCE, "{found} {}", expected(&a, &b));
        assert_eq!(lpips.distance(&a, &a, w, h).unwrap(), 0.0);
        // Clamped, as on a display.
        let bright: Vec<[f32; 3]> = a.iter().map(|p| p.map(|c| if c > 0.9 { 7.0 } else { c })).collect();
        let shown: Vec<[f32; 3]> = bright.iter().map(|p| p.map(|c| c.min(1.0))).collect();
        assert_eq!(lpips.distance(&bright, &b, w, h).unwrap(), lpips.distance(&shown, &b, w, h).unwrap());
    }
}

#[test]
fn pictures_that_cannot_be_measured_are_named() {
    let (Some(any), Some(fixed)) = (open("any", &tiny(None)), open("fixed", &tiny(Some([80, 64])))) else {
        return;
    };
    let (any, fixed) = (Lpips::new(any).unwrap(), Lpips::new(fixed).unwrap());
    let [a, b] = pictures(80, 64);
    assert!(fixed.distance(&a, &b, 80, 64).unwrap() > 0.0);
    let message =
        |lpips: &Lpips, a: &[[f32; 3]], w: u32, h: u32| lpips.distance(a, &b, w, h).unwrap_err().to_string();
    assert_eq!(message(&any, &a, 63, 64), "width: 63; allowed: 64 or more");
    assert_eq!(message(&any, &a, 80, 10), "height: 10; allowed: 64 or more");
    assert_eq!(message(&any, &a[1..], 80, 64), "a: 5119 pixels; allowed: width * height = 5120");
    assert_eq!(message(&fixed, &a, 64, 80), "width: 64; allowed: 80, the model's fixed size");
    let mut broken = a.clone();
    broken[7][1] = f32::NAN;
    assert!(message(&any, &broken, 80, 64).starts_with("a[7]: ["));
}

#[test]
fn picture_distances_that_break_the_contract_are_named() {
    let graph = tiny(None);
    if open("sound lpips", &graph).is_none() {
        return;
    }
    type Break = (fn(&mut Graph), &'static str);
    let breaks: [Break; 12] = [
        (|g| g.metadata.retain(|(k, _)| k != "vg.contract"), "metadata vg.contract: missing"),
        (|g| g.set("vg.contract", "2"), "metadata vg.contract: \"2\"; allowed: 1"),
        (|g| g.metadata.retain(|(k, _)| k != "vg.metric"), "metadata vg.metric: missing"),
        (|g| g.set("vg.metric", "ssim"), "metadata vg.metric: \"ssim\"; allowed: lpips"),
        (|g| g.set("vg.range", "-1..1"), "metadata vg.range: \"-1..1\"; allowed: 0..1"),
        (|g| g.metadata.retain(|(k, _)| k != "vg.lpips.net"), "metadata vg.lpips.net: missing"),
        (|g| g.set("vg.mask", "x"), "metadata vg.mask: \"x\": a segmentation, not a picture distance"),
        (|g| g.inputs.push(Port::new("c", &[Some(1)])), "input c: unknown; allowed: a, b"),
        (
            |g| g.inputs[0].dimensions[0] = Some(2),
            "input a: shape [2, 3, any, any]; allowed: [1, 3, any, any]",
        ),
        (
            |g| {
                g.rename_output_of("lpips", "distance");
                g.outputs[0].name = "distance".into();
            },
            "output lpips: missing",
        ),
        (|g| g.outputs[0].dimensions = vec![None, Some(1)], "; allowed: [1]"),
        (
            |g| {
                g.rename_output_of("lpips", "before");
                g.floats("bad", &[1], &[f32::NAN]).node("Add", &["before", "bad"], "lpips", &[]);
            },
            "output lpips: the network returned NaN; allowed: finite",
        ),
    ];
    let [a, b] = pictures(64, 64);
    for (k, (break_it, expected)) in breaks.into_iter().enumerate() {
        let mut broken = graph.clone();
        break_it(&mut broken);
        let path = file(&format!("lpips{k}"));
        broken.write(&path);
        let model = opened(&path).unwrap();
        let message = match model.and_then(Lpips::new).and_then(|lpips| lpips.distance(&a, &b, 64, 64)) {
            Ok(_) => "accepted".into(),
            Err(Error::Format { field, reason, .. }) => format!("{field}: {reason}"),
            Err(other) => other.to_string(),
        };
        assert!(message.contains(expected), "{message}\n{expected}");
    }
}

/// Script that writes the exporter's file and the package's own answers for the same pictures, with a random backbone.
const PACKAGE: &str = r#"
import sys, types, warnings
from pathlib import Path
warnings.simplefilter("ignore")
# The parent without its __init__, which imports the extension module.
parent = sys.modules["vehicle_gaussians"] = types.ModuleType("vehicle_gaussians")
parent.__path__ = [sys.argv[3]]
import numpy as np, torch
from vehicle_gaussians.export import lpips, lpips_network
out, net = Path(sys.argv[1]), sys.argv[2]
torch.manual_seed(5)
model = lpips_network.built(net)
keys = {n: "features." + n.partition(".")[2] for n, _ in model.net.named_parameters()}
torch.save({keys[n]: p.detach() for n, p in model.net.named_parameters()}, out / "backbone.pth")
assert lpips.main(["--net", net, "--backbone", str(out / "backbone.pth"), "-o", str(out / "lpips.onnx")]) == 0
for w, h in [(64, 64), (97, 75), (512, 384)]:
    a = np.fromfile(out / f"a{w}.f32", np.float32).reshape(1, h, w, 3)
    b = np.fromfile(out / f"b{w}.f32", np.float32).reshape(1, h, w, 3)
    a, b = (torch.from_numpy(x.transpose(0, 3, 1, 2).copy()) for x in (a, b))
    with torch.no_grad():
        print("distance", w, h, repr(model(a, b, normalize=True).item()))
"#;

/// Two runtimes in f32 over thirteen layers; measured 8e-9 at most.
const PACKAGE_TOLERANCE: f64 = 1e-7;

#[test]
fn distances_equal_those_of_the_lpips_package() {
    let package = vg_testing::root().join("bindings/python/python/vehicle_gaussians");
    let present =
        Command::new("python3").args(["-c", "import torch, lpips, torchvision, onnx, onnxscript"]).output();
    if !present.is_ok_and(|o| o.status.success()) {
        vg_testing::say("skipped: python3 has no torch with lpips, torchvision, onnx and onnxscript");
        return;
    }
    if open("lpips", &tiny(None)).is_none() {
        return;
    }
    let sizes = [(64, 64), (97, 75), (512, 384)];
    for net in ["alex", "vgg"] {
        let folder = tempfile::tempdir().unwrap();
        for (w, h) in sizes {
            for (name, picture) in ["a", "b"].into_iter().zip(pictures(w, h)) {
                let bytes: Vec<u8> = picture.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
                std::fs::write(folder.path().join(format!("{name}{w}.f32")), bytes).unwrap();
            }
        }
        let mut python = Command::new("python3");
        python.args(["-c", PACKAGE]).arg(folder.path()).arg(net).arg(&package);
        let ran = python.output().unwrap();
        let text = String::from_utf8_lossy(&ran.stdout);
        assert!(ran.status.success(), "{text}{}", String::from_utf8_lossy(&ran.stderr));
        let lpips = Lpips::new(opened(&folder.path().join("lpips.onnx")).unwrap().unwrap()).unwrap();
        assert_eq!(lpips.net(), net);
        let distances = text.lines().filter_map(|l| l.strip_prefix("distance "));
        let mut measured = 0;
        for line in distances {
            let words: Vec<&str> = line.split(' ').collect();
            let (w, h, expected): (u32, u32, f64) =
                (words[0].parse().unwrap(), words[1].parse().unwrap(), words[2].parse().unwrap());
            let [a, b] = pictures(w, h);
            let found = lpips.distance(&a, &b, w, h).unwrap();
            println!("{net} {w}x{h}: {found}, off by {:.1e}", (found - expected).abs());
            assert!((found - expected).abs() < PACKAGE_TOLERANCE, "{net} {w}x{h}: {found} and {expected}");
            measured += 1;
        }
        assert_eq!(measured, sizes.len());
    }
}
