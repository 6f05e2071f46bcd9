//! A build without ONNX Runtime: every model is refused.

use super::{Input, ModelOptions, Ports, Tensor};
use std::path::Path;
use vg_geometry::Result;

/// A session that cannot exist.
pub(super) enum Session {}

impl Session {
    pub(super) fn open(_: &Path, _: &ModelOptions) -> Result<(Self, Ports)> {
        Err(super::not_built("model"))
    }

    pub(super) fn run(&mut self, _: &[Input]) -> Result<Vec<Option<Tensor>>, String> {
        match *self {}
    }
}
