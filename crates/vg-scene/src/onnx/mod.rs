//! Opening and running of ONNX models. The callers define the meaning of inputs and outputs.
//!
//! ONNX Runtime is a shared library that is loaded when the first model is opened, see [`ModelOptions::runtime`].
//! Without the feature `onnx` every model is refused with [`Error::NotBuilt`].

#[cfg(not(feature = "onnx"))]
#[path = "absent.rs"]
mod backend;
#[cfg(feature = "onnx")]
#[path = "session.rs"]
mod backend;
mod ports;
#[cfg(feature = "onnx")]
mod runtime;

pub use ports::Broken;
pub use ports::{Port, Ports};

use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use vg_geometry::threads::OfProcess;
use vg_geometry::{Error, Result, choices};

choices! {
    /// Where a model runs.
    #[derive(Default)]
    pub enum Provider as "provider" {
        /// The processor.
        #[default]
        Cpu = 0 "cpu",
        /// The first CUDA device, where ONNX Runtime was built for it.
        Cuda = 1 "cuda",
    }
}

/// Options for opening a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelOptions {
    /// ONNX Runtime, the library or its folder. `None`: the one named by the environment variable `VG_ONNXRUNTIME`, or
    /// else the one in an installed Python package `onnxruntime`. A process uses the first one that it loads.
    pub runtime: Option<PathBuf>,
    /// Execution provider.
    pub provider: Provider,
    /// Whether the model runs on the CPU if the provider is not available; otherwise that is an error.
    pub fall_back: bool,
    /// Threads of the runtime, which exist as long as the model is open; 0 means one per core.
    pub threads: usize,
    /// Whether weights are rearranged for speed when the model is opened, which can double the memory.
    /// `None`: if the files take less than 1 GiB.
    pub prepack: Option<bool>,
    /// Whether the runtime reuses the memory of a run for the next one.
    pub arena: bool,
}

impl Default for ModelOptions {
    fn default() -> Self {
        Self {
            runtime: None,
            provider: Provider::Cpu,
            fall_back: false,
            threads: 0,
            prepack: None,
            arena: false,
        }
    }
}

/// Maximum of threads of the runtime.
const MAX_THREADS: usize = 1024;

impl ModelOptions {
    /// Checks that each field is in its range.
    ///
    /// # Errors
    /// [`Error::Argument`] with the field's name.
    pub fn validate(&self) -> Result<()> {
        if self.threads > MAX_THREADS {
            let allowed = format!("0 to {MAX_THREADS}, 0 for one per core");
            return Err(Error::argument("threads", self.threads.to_string(), allowed));
        }
        Ok(())
    }
}

/// Whether this build can open models, that is, has the feature `onnx`.
pub const fn is_built() -> bool {
    cfg!(feature = "onnx")
}

/// The error of a build without networks if `argument` needs one.
pub fn not_built(argument: &str) -> Error {
    Error::NotBuilt {
        argument: argument.into(),
        found: "ONNX Runtime".into(),
        remedy: "build with the feature onnx (cargo build --features onnx)".into(),
    }
}

/// An open model. Clones share it; runs from several threads are serialised.
#[derive(Clone)]
pub struct Model {
    inner: Arc<Inner>,
}

struct Inner {
    path: PathBuf,
    ports: Ports,
    session: OfProcess<Mutex<backend::Session>>,
}

/// A borrowed input tensor.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Name of the input.
    pub name: &'a str,
    /// Dimensions; their product is the number of values.
    pub shape: &'a [usize],
    /// Values, row-major.
    pub data: &'a [f32],
}

/// An output tensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Dimensions; their product is the number of values.
    pub shape: Vec<usize>,
    /// Values, row-major.
    pub data: Vec<f32>,
}

impl Model {
    /// Opens the model in a file; external weights are found by their names in the same folder.
    ///
    /// # Errors
    /// [`Error::Argument`] for options out of range, [`Error::NotBuilt`] without the feature `onnx`, [`Error::Io`]
    /// without the file, [`Error::Missing`] without a runtime or the provider, [`Error::Format`] if the runtime
    /// refuses the file.
    pub fn open(path: &Path, options: &ModelOptions) -> Result<Self> {
        options.validate()?;
        if !is_built() {
            return Err(not_built("model"));
        }
        let file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
        if !file.metadata().is_ok_and(|m| m.is_file()) {
            return Err(Error::argument("model", format!("{}, not a file", path.display()), "an ONNX file"));
        }
        let (session, ports) = backend::Session::open(path, options)?;
        let session = OfProcess::new(Mutex::new(session));
        Ok(Self { inner: Arc::new(Inner { path: path.to_owned(), ports, session }) })
    }

    /// Path of the model's file.
    pub fn path(&self) -> &Path {
        &self.inner.path
    }

    /// The model's inputs, outputs and metadata.
    pub fn ports(&self) -> &Ports {
        &self.inner.ports
    }

    /// Runs the model. The outputs are in the order of [`Ports::outputs`]; those that are not float32 tensors are
    /// `None`.
    ///
    /// # Errors
    /// [`Error::Format`] if the runtime fails, [`Error::Argument`] in a fork of the process that opened the model.
    pub fn run(&self, inputs: &[Input]) -> Result<Vec<Option<Tensor>>> {
        let mut session = self.inner.session.get("model")?.lock().unwrap_or_else(PoisonError::into_inner);
        session.run(inputs).map_err(|reason| self.broken("run", reason))
    }

    /// Takes one output of a run; an error that names it unless it has the expected shape and is finite.
    pub fn output(&self, outputs: &mut [Option<Tensor>], at: usize, shape: &[usize]) -> Result<Vec<f32>> {
        let field = format!("output {}", self.ports().outputs[at].name);
        let Some(tensor) = outputs[at].take() else {
            return Err(self.broken(field, "not a tensor of float32"));
        };
        if tensor.shape != shape {
            let reason = format!("the network returned shape {:?}; allowed: {shape:?}", tensor.shape);
            return Err(self.broken(field, reason));
        }
        match tensor.data.iter().find(|v| !v.is_finite()) {
            Some(value) => Err(self.broken(field, format!("the network returned {value}; allowed: finite"))),
            None => Ok(tensor.data),
        }
    }

    /// An error about this model.
    pub fn broken(&self, field: impl Into<String>, reason: impl Into<String>) -> Error {
        Error::format(&self.inner.path, field, reason)
    }
}

impl std::fmt::Debug for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Model").field("path", &self.inner.path).finish_non_exhaustive()
    }
}

/// Whether both are the same open model.
impl PartialEq for Model {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.inner, &other.inner)
    }
}

/// Serialises the path of the model's file.
impl Serialize for Model {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.inner.path.to_string_lossy())
    }
}
