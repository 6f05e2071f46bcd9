//! The fast renderers, for tests that run on each of them.

use vg::render::{CpuRenderer, Differentiable};

/// The two CPU renderers, and the GPU renderer if it is built and a device exists.
pub fn renderers() -> Vec<(&'static str, Box<dyn Differentiable>)> {
    let mut out: Vec<(&str, Box<dyn Differentiable>)> =
        vec![("vector", Box::new(CpuRenderer::new())), ("portable", Box::new(CpuRenderer::portable()))];
    #[cfg(feature = "gpu")]
    if let Some(gpu) = super::gpu::renderer() {
        out.push(("gpu", Box::new(gpu)));
    }
    out.reverse();
    out
}
