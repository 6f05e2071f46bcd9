//! The renderers that are fast, to be tried one after the other.

use vg::render::{CpuRenderer, Differentiable};

/// The CPU's two, and the graphics processor's where it is built and there is one.
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
