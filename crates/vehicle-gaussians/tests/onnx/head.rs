//! The Gaussian head on graphs with known attributes.

use std::ops::ControlFlow;
use std::path::PathBuf;
use vg::geometry::{Intrinsics, Pose};
use vg::head::{GaussianHead, NetworkHead};
use vg::onnx::Model;
use vg::pipeline::{Calibrate, Options, reconstruct};
use vg::prior::Geometry;
use vg::progress::{Context, Threads};
use vg::scene::{DepthMap, RgbImage};
use vg::symmetry::SymmetryMode;
use vg::{Camera, Error, Scene, View};
use vg_testing::networks::graph::Graph;
use vg_testing::networks::{constant, open, opened};
use vg_testing::vehicle::right_side;

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
    // Sides that are not multiples of 32.
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
        (|g| g.set("vg.prior", "x"), "metadata vg.prior: \"x\": a geometry prior, not a Gaussian head"),
        (|g| g.outputs[0].dimensions[1] = None, "accepted"),
        (|g| g.inputs[0].dimensions[2] = Some(36), "input images: a fixed size"),
        (
            |g| {
                g.rename_output_of("attributes", "before");
                g.floats("bad", &[1], &[f32::NAN]).node("Add", &["before", "bad"], "attributes", &[]);
            },
            "output attributes: the network returned NaN",
        ),
    ];
    for (k, (break_it, expected)) in breaks.into_iter().enumerate() {
        let mut broken = graph.clone();
        break_it(&mut broken);
        let model = open(&format!("head{k}"), &broken).unwrap();
        let message = match run(&scene, &options(&model)) {
            Ok(_) => "accepted".into(),
            Err(Error::Format { field, reason, .. }) => format!("{field}: {reason}"),
            Err(other) => other.to_string(),
        };
        assert!(message.starts_with(expected), "{message}\n{expected}");
    }
}

/// `tests/data/head`, written by `training/head/parity.py`: views, depth, and PyTorch's results for some pixels.
struct Fixture {
    scene: Scene,
    every: usize,
    /// `[m][38]`: mean, rotation, scale, opacity, harmonics; 0 without depth.
    gaussians: Vec<[f32; 38]>,
}

fn fixture() -> Fixture {
    let bytes = std::fs::read(folder().join("tiny_head.bin")).unwrap();
    let mut rest = bytes.strip_prefix(b"VGHEAD01").unwrap();
    let mut take = |n: usize| {
        let (taken, left) = rest.split_at(n);
        rest = left;
        taken
    };
    let word = |b: &[u8]| u32::from_le_bytes(b.try_into().unwrap()) as usize;
    let [n, w, h, every, m] = std::array::from_fn(|_| word(take(4)));
    let floats = |b: &[u8]| -> Vec<f32> {
        b.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    };
    let intrinsics = floats(take(36 * n));
    let poses = floats(take(48 * n));
    let images = take(3 * w * h * n).to_vec();
    let depth = floats(take(4 * w * h * n));
    let _raw = take(4 * 38 * m);
    let gaussians = floats(take(4 * 38 * m));
    assert!(rest.is_empty());
    let view = |i: usize| {
        let k = &intrinsics[9 * i..];
        let k = Intrinsics { fx: k[0].into(), fy: k[4].into(), cx: k[2].into(), cy: k[5].into() };
        let pose: [f64; 12] = std::array::from_fn(|j| poses[12 * i + j].into());
        let pose = Pose::from_row_major("pose", &pose).unwrap();
        let (width, height) = (w as u32, h as u32);
        let pixels = images[3 * w * h * i..3 * w * h * (i + 1)].as_chunks::<3>().0.to_vec();
        View {
            name: i.to_string(),
            camera: Camera::pinhole(width, height, k, pose).unwrap(),
            image: RgbImage::new(width, height, pixels).unwrap(),
            mask: None,
            depth: Some(DepthMap::new(width, height, depth[w * h * i..w * h * (i + 1)].to_vec()).unwrap()),
        }
    };
    let scene = Scene { views: (0..n).map(view).collect(), ..Scene::default() };
    Fixture { scene, every, gaussians: gaussians.as_chunks::<38>().0.to_vec() }
}

fn folder() -> PathBuf {
    vg_testing::root().join("tests/data/head")
}

#[test]
fn gaussians_equal_those_of_the_exported_network() {
    let Some(model) = opened(&folder().join("tiny_head.onnx")) else { return };
    let head = NetworkHead::new(model.unwrap(), 2).unwrap();
    let Fixture { scene, every, gaussians } = fixture();
    let pixels = scene.views[0].image.pixels().len();
    // Only the pixels of the fixture, so that Gaussians correspond to rows.
    let kept: Vec<Vec<bool>> = scene
        .views
        .iter()
        .enumerate()
        .map(|(i, view)| {
            let depth = view.depth.as_ref().unwrap().depth();
            (0..pixels).map(|p| (i * pixels + p).is_multiple_of(every) && depth[p] > 0.0).collect()
        })
        .collect();
    let depths = scene.views.iter().map(|v| v.depth.clone().unwrap()).collect();
    let threads = Threads::new(2).unwrap();
    let mut callback = |_| ControlFlow::Continue(());
    let context = Context::new(&threads, &mut callback);
    let found = head.predict(&scene.views, &Geometry::new(depths, None), &kept, &context).unwrap();
    let expected: Vec<&[f32; 38]> = gaussians.iter().filter(|row| row[10] > 0.0).collect();
    assert_eq!(found.len(), expected.len());
    assert!(found.len() > 50);
    let mut worst = 0.0f32;
    for (i, row) in expected.iter().enumerate() {
        let sh = &found.sh()[27 * i..27 * (i + 1)];
        let all = found.means()[i]
            .iter()
            .chain(&found.rotations()[i])
            .chain(&found.scales()[i])
            .chain(std::slice::from_ref(&found.opacities()[i]))
            .chain(sh);
        worst = all.zip(row.iter()).map(|(a, b)| (a - b).abs()).fold(worst, f32::max);
    }
    assert!(worst < 1e-4, "{worst:.1e}");
}
