//! Networks whose answers are known, and their files.
//!
//! They need a runtime (`pip install onnxruntime`, or `VG_ONNXRUNTIME`); without one each test says that it is skipped,
//! and `VG_NO_SKIP=1` makes that a failure.

pub mod graph;
pub mod oracle;

use graph::{Attribute, Graph, Port};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use vg::onnx::{Model, ModelOptions};
use vg::scene::RgbImage;
use vg::{Error, Result, View};

/// Files of these tests.
static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());

pub fn file(name: &str) -> PathBuf {
    FOLDER.path().join(format!("{name}.onnx"))
}

/// The graph as an open model; `None` where there is no runtime.
pub fn open(name: &str, graph: &Graph) -> Option<Model> {
    let path = file(name);
    graph.write(&path);
    opened(&path).map(|model| model.unwrap())
}

pub fn opened(path: &Path) -> Option<Result<Model>> {
    let options = ModelOptions { threads: 2, ..ModelOptions::default() };
    match Model::open(path, &options) {
        Err(Error::Missing { what, found, remedy }) => {
            let line = format!("skipped: {what}: {found}; {remedy}");
            assert!(std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
            crate::say(&line);
            None
        }
        other => Some(other),
    }
}

/// A head with equal attributes at every pixel: 0 except for scale channels of `scale`.
pub fn constant(multiple: &str, scale: f32) -> Graph {
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

/// The probability is the mean of the channels; `side` fixed, or free with a long side of 64.
pub fn brightness(sides: Option<(u64, u64)>) -> Graph {
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

/// White on the vehicle, and a white car to the left of it.
pub fn black_and_white(view: &View, neighbour: bool) -> RgbImage {
    let (width, height) = (view.camera.width, view.camera.height);
    let mask = view.mask.as_ref().unwrap();
    let pixel = |i: u32| {
        let (u, v) = (i % width, i / width);
        let shown = mask.is_vehicle(u, v) || (neighbour && u < 6 && (30..50).contains(&v));
        [if shown { 255 } else { 0 }; 3]
    };
    RgbImage::new(width, height, (0..width * height).map(pixel).collect()).unwrap()
}
