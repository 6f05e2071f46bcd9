//! Rendering backends: the CPU's threads or a graphics processor.

use super::{CpuRenderer, Differentiable};
use std::sync::Arc;
use vg_geometry::{Error, Result, choices};

choices! {
    /// What draws.
    #[derive(Default)]
    pub enum Backend as "backend" {
        /// What is best of what this build and this machine have; for a single picture the CPU.
        #[default]
        Auto = 0 "auto",
        /// The context's threads.
        Cpu = 1 "cpu",
        /// A graphics processor, or a driver that stands in for one. [`Error::NotBuilt`] in a build without it,
        /// [`Error::Missing`] on a machine without a driver.
        Gpu = 2 "gpu",
    }
}

/// The chosen backend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// [`Backend::Cpu`] or [`Backend::Gpu`].
    pub backend: Backend,
    /// Instruction set of the CPU, or the device's name.
    pub device: String,
    /// The reason for the choice; not a sentence.
    pub why: String,
}

impl std::fmt::Display for Choice {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let name = if self.backend == Backend::Gpu { "gpu" } else { "cpu" };
        write!(f, "{name} ({}): {}", self.device, self.why)
    }
}

/// Whether this build can draw on a graphics processor.
pub fn is_built() -> bool {
    cfg!(feature = "gpu")
}

/// The error where it cannot.
pub fn not_built(argument: &str) -> Error {
    Error::NotBuilt {
        argument: argument.into(),
        found: "gpu".into(),
        remedy: "build with the feature gpu, or use auto or cpu".into(),
    }
}

/// A differentiable renderer that threads can share.
pub type Trainer = Arc<dyn Differentiable + Send + Sync>;

/// Chooses a differentiable renderer for optimisation, where the Gaussians change with every picture.
/// [`Backend::Auto`] is the CPU, because the backward pass ends there and the Gaussians would have to be copied to the
/// device for each picture.
///
/// Errors, for [`Backend::Gpu`] alone: those of [`AssetRenderer::new`](super::AssetRenderer::new).
pub fn trainer(backend: Backend) -> Result<(Trainer, Choice)> {
    match backend {
        Backend::Gpu => device_trainer(),
        Backend::Auto | Backend::Cpu => {
            let cpu = CpuRenderer::new();
            let why = if backend == Backend::Cpu { "asked for" } else { "the backward pass ends there" };
            let choice =
                Choice { backend: Backend::Cpu, device: cpu.level().to_owned(), why: why.to_owned() };
            Ok((Arc::new(cpu), choice))
        }
    }
}

#[cfg(feature = "gpu")]
fn device_trainer() -> Result<(Trainer, Choice)> {
    let gpu = super::GpuRenderer::shared(super::Adapter::Any)?;
    let choice = Choice { backend: Backend::Gpu, device: gpu.name().to_owned(), why: "asked for".to_owned() };
    Ok((gpu, choice))
}

#[cfg(not(feature = "gpu"))]
fn device_trainer() -> Result<(Trainer, Choice)> {
    Err(not_built("backend"))
}
