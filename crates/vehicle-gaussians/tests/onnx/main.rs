//! Networks through ONNX Runtime: the contracts in docs/ONNX.md, on graphs with known answers.
//!
//! Needs the feature `onnx` and a runtime (`pip install onnxruntime`, or `VG_ONNXRUNTIME`). Without one each test
//! prints that it is skipped, and `VG_NO_SKIP=1` makes that a failure.

mod contract;
mod depth;
mod head;
mod lpips;
mod segment;
