//! A session of ONNX Runtime.

use super::{Input, ModelOptions, Port, Ports, Provider, Tensor, runtime};
use ort::ep;
use ort::logging::LogLevel;
use ort::session::SessionInputValue;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Outlet, TensorElementType, TensorRef, ValueType};
use std::path::Path;
use vg_geometry::threads::without_signals;
use vg_geometry::{Error, Result};

/// Size of weights, bytes, from which they are rearranged only at the caller's request.
const LARGE: u64 = 1 << 30;

pub(super) struct Session(ort::session::Session);

impl Session {
    pub(super) fn open(path: &Path, options: &ModelOptions) -> Result<(Self, Ports)> {
        runtime::load(options.runtime.as_deref())?;
        let session = built(path, options)?;
        let refused = |e: ort::Error| Error::format(path, "metadata", words(&e));
        let metadata = session.metadata().map_err(refused)?;
        let keys = metadata.custom_keys().map_err(refused)?;
        let pairs = keys.into_iter().filter_map(|key| metadata.custom(&key).map(|value| (key, value)));
        let ports = Ports {
            inputs: session.inputs().iter().map(port).collect(),
            outputs: session.outputs().iter().map(port).collect(),
            metadata: pairs.collect(),
        };
        drop(metadata);
        Ok((Self(session), ports))
    }

    pub(super) fn run(&mut self, inputs: &[Input]) -> Result<Vec<Option<Tensor>>, String> {
        let values: Vec<_> = inputs.iter().map(lent).collect::<ort::Result<_>>().map_err(|e| words(&e))?;
        let outputs = self.0.run(values).map_err(|e| words(&e))?;
        let copied = |value: ort::value::ValueRef<'_>| {
            let (shape, data) = value.try_extract_tensor::<f32>().ok()?;
            let shape = shape.iter().map(|&n| usize::try_from(n).unwrap_or(0)).collect();
            Some(Tensor { shape, data: data.to_vec() })
        };
        Ok(outputs.iter().map(|(_, value)| copied(value)).collect())
    }
}

fn built(path: &Path, options: &ModelOptions) -> Result<ort::session::Session> {
    let threads = match options.threads {
        0 => std::thread::available_parallelism().map_or(1, Into::into),
        threads => threads,
    };
    let cpu = ep::CPU::default().with_arena_allocator(options.arena).build();
    let providers = match options.provider {
        Provider::Cpu => vec![cpu],
        Provider::Cuda if options.fall_back => vec![ep::CUDA::default().build().fail_silently(), cpu],
        Provider::Cuda => vec![ep::CUDA::default().build().error_on_failure(), cpu],
    };
    let prepack = options.prepack.unwrap_or_else(|| bytes_beside(path) < LARGE);
    let broken = |e: ort::Error| Error::format(path, "model", words(&e));
    let set = || -> ort::Result<_> {
        Ok(ort::session::Session::builder()?
            .with_log_level(LogLevel::Fatal)?
            .with_optimization_level(GraphOptimizationLevel::All)?
            .with_intra_threads(threads)?
            .with_inter_threads(1)?
            .with_intra_op_spinning(false)?
            .with_inter_op_spinning(false)?
            .with_deterministic_compute(true)?
            .with_memory_pattern(options.arena)?
            .with_prepacking(prepack)?)
    };
    let builder = set().map_err(broken)?;
    let mut builder = builder.with_execution_providers(providers).map_err(|e| Error::Missing {
        what: "CUDA",
        found: words(&ort::Error::<()>::from(e)),
        remedy: "install onnxruntime-gpu and name its library, or run on the CPU".into(),
    })?;
    without_signals(|| builder.commit_from_file(path)).map_err(broken)
}

/// Total size of the model and of the files in its folder whose names begin with its own, which hold external weights.
fn bytes_beside(path: &Path) -> u64 {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    files
        .filter(|file| file.file_name().to_string_lossy().starts_with(&stem))
        .filter_map(|file| file.metadata().ok())
        .map(|m| m.len())
        .sum()
}

fn port(outlet: &Outlet) -> Port {
    let dimensions = match outlet.dtype() {
        ValueType::Tensor { ty: TensorElementType::Float32, shape, .. } => {
            Some(shape.iter().map(|&n| usize::try_from(n).ok()).collect())
        }
        _ => None,
    };
    Port { name: outlet.name().to_owned(), dimensions }
}

/// The runtime's message in one line.
fn words<R>(error: &ort::Error<R>) -> String {
    let line = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
    line.trim_end_matches('.').to_owned()
}

fn lent<'a>(input: &Input<'a>) -> ort::Result<(&'a str, SessionInputValue<'a>)> {
    Ok((input.name, TensorRef::from_array_view((input.shape, input.data))?.into()))
}
