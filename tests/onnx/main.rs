//! Networks through ONNX Runtime: what is promised of the contracts in docs/ONNX.md, on graphs whose answers are known.
//!
//! Needs the feature `onnx` and a runtime (`pip install onnxruntime`, or `VG_ONNXRUNTIME`); without one each test says
//! that it is skipped, and `VG_NO_SKIP=1` makes that a failure.

#[path = "../common/mod.rs"]
mod common;
mod graph;
mod oracle;

mod c_abi;
mod contract;
mod depth;
mod head;
mod lpips;
mod program;
mod segment;

use graph::Graph;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use vg::onnx::{Model, ModelOptions};
use vg::{Error, Result};

/// Files of these tests.
static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());

fn file(name: &str) -> PathBuf {
    FOLDER.path().join(format!("{name}.onnx"))
}

/// The graph as an open model; `None` where there is no runtime.
fn open(name: &str, graph: &Graph) -> Option<Model> {
    let path = file(name);
    graph.write(&path);
    opened(&path).map(|model| model.unwrap())
}

fn opened(path: &Path) -> Option<Result<Model>> {
    let options = ModelOptions { threads: 2, ..ModelOptions::default() };
    match Model::open(path, &options) {
        Err(Error::Missing { what, found, remedy }) => {
            let line = format!("skipped: {what}: {found}; {remedy}");
            assert!(std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
            common::say(&line);
            None
        }
        other => Some(other),
    }
}
