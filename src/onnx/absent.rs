//! A build without ONNX Runtime: every model is refused.

use super::{Input, ModelOptions, Ports, Tensor};
use crate::error::{Error, Result};
use std::path::Path;

/// Cannot be made.
pub(super) enum Session {}

pub(super) fn is_built() -> Result<()> {
    Err(not_built())
}

fn not_built() -> Error {
    Error::NotBuilt {
        argument: "model".into(),
        found: "ONNX Runtime".into(),
        remedy: "build with the feature onnx (cargo build --features onnx)".into(),
    }
}

impl Session {
    pub(super) fn open(_: &Path, _: &ModelOptions) -> Result<(Self, Ports)> {
        Err(not_built())
    }

    pub(super) fn run(&mut self, _: &[Input]) -> Result<Vec<Option<Tensor>>, String> {
        match *self {}
    }
}
