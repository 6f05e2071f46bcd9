//! Networks through ONNX Runtime: what is promised of the contracts in docs/ONNX.md, on graphs whose answers are known.
//!
//! Needs the feature `onnx` and a runtime (`pip install onnxruntime`, or `VG_ONNXRUNTIME`); without one each test says
//! that it is skipped, and `VG_NO_SKIP=1` makes that a failure.

mod contract;
mod depth;
mod head;
mod lpips;
mod segment;
