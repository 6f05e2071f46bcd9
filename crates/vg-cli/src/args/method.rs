//! Command-line options of a reconstruction.

use super::settings::Settings;
use super::values::{KnownBox, choice, known_box, refinement};
use crate::job::{self, Failure, USAGE};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use vg::onnx::{Model, ModelOptions, Provider};
use vg::pipeline::{BaselineRun, Method, Options, PriorChoice};
use vg::refine::baseline::BaselineOptions;
use vg::refine::{Amount, Densify, RefineOptions};
use vg::render::Backend;

/// Options of a reconstruction, shared by `reconstruct`, `eval` and `report`.
#[derive(Args)]
pub(crate) struct MethodArgs {
    #[command(flatten)]
    settings: Settings,
    /// Geometry network for --prior onnx: an ONNX file that meets the contract of docs/ONNX.md
    #[arg(long, value_name = "M.onnx")]
    pub(crate) prior_model: Option<PathBuf>,
    /// Gaussian head to use instead of the built-in one: an ONNX file that meets the contract of docs/ONNX.md
    #[arg(long, value_name = "M.onnx")]
    pub(crate) head_model: Option<PathBuf>,
    /// Ignore the position offsets that the head's network predicts (the paper's ablation)
    #[arg(long, requires = "head_model")]
    no_offset: bool,
    /// ONNX Runtime's library or its folder [default: VG_ONNXRUNTIME, else an installed Python package's]
    #[arg(long, value_name = "PATH")]
    onnxruntime: Option<PathBuf>,
    /// Device for networks: the CPU, CUDA, or CUDA where available (auto)
    #[arg(long, value_enum, default_value_t = RunsOn::Cpu)]
    provider: RunsOn,
    /// Length, width and height of the vehicle in metres, if known to a few centimetres; X,Y,Z,YAW add the pose of its
    /// box: the centre in metres and the rotation about z in radians, in the frame of the cameras
    #[arg(long = "box", value_name = "L,W,H[,X,Y,Z,YAW]", value_parser = known_box, allow_hyphen_values = true)]
    vehicle_box: Option<KnownBox>,
    /// Points measured on the vehicle, PLY in its frame, metres; an estimated surface is fitted to them
    #[arg(long, value_name = "P.ply")]
    pub(crate) cloud: Option<PathBuf>,
    /// Optimise the model against the photographs for a number of steps (300) or of seconds (5s)
    #[arg(long, value_name = "N|SECONDSs", value_parser = refinement)]
    refine: Option<Amount>,
    /// Hold one of three or more views out of the optimisation, to decide when to stop
    #[arg(long, requires = "refine")]
    refine_hold_out: bool,
    /// Split, clone and prune Gaussians in the optimisation, as 3D Gaussian splatting does
    #[arg(long, requires = "refine")]
    refine_densify: bool,
    /// Device for rendering and gradients in the optimisation: cpu, gpu (in a build with GPU support), or auto, at
    /// present the CPU
    #[arg(long, requires = "refine", default_value = "auto", value_parser = choice::<Backend>())]
    refine_backend: Backend,
    /// Fit another method to the input views instead, for comparison: 3D Gaussian splatting from a random start or from
    /// --cloud, without any prior; --refine sets the number of steps (2000) or seconds, and
    /// --sh-degree is 3 if it is not given
    #[arg(long, value_enum, value_name = "METHOD", conflicts_with_all = CONFLICTS_WITH_BASELINE)]
    baseline: Option<Baseline>,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

/// Options that do not apply to a baseline.
const CONFLICTS_WITH_BASELINE: [&str; 16] = [
    "prior",
    "prior_model",
    "head_model",
    "onnxruntime",
    "provider",
    "symmetry",
    "relight",
    "calibrate",
    "keep",
    "budget",
    "max_gaussians",
    "refine_hold_out",
    "refine_densify",
    "refine_backend",
    "no_photo",
    "depth_scale",
];

impl MethodArgs {
    /// The method for the library, with its models open.
    pub(crate) fn method(&self) -> job::Result<Method> {
        let mismatch = match (self.settings.options.prior == PriorChoice::Onnx, self.prior_model.is_some()) {
            (true, false) => Some("--prior onnx needs a network: --prior-model M.onnx"),
            (false, true) => Some("--prior-model M.onnx is used only with --prior onnx"),
            _ => None,
        };
        if let Some(message) = mismatch {
            return Err(Failure { message: message.into(), code: USAGE });
        }
        let model = |path: &Path| Model::open(path, &self.model_options());
        let (prior_model, head_model) = (self.prior_model.as_deref(), self.head_model.as_deref());
        Ok(match self.method_without_models() {
            Method::Vehicle(options) => Method::Vehicle(Options {
                prior_model: prior_model.map(model).transpose()?,
                head_model: head_model.map(model).transpose()?,
                ..options
            }),
            baseline => baseline,
        })
    }

    /// Whether all options, apart from those of networks, have their default values.
    pub(crate) fn is_silent(&self) -> bool {
        self.method_without_models() == Method::Vehicle(Options::default()) && self.cloud.is_none()
    }

    /// Options with which networks are opened.
    pub(crate) fn model_options(&self) -> ModelOptions {
        ModelOptions {
            runtime: self.onnxruntime.clone(),
            provider: if self.provider == RunsOn::Cpu { Provider::Cpu } else { Provider::Cuda },
            fall_back: self.provider == RunsOn::Auto,
            threads: self.threads,
            ..ModelOptions::default()
        }
    }

    fn method_without_models(&self) -> Method {
        match self.baseline {
            Some(Baseline::GaussianSplatting) => Method::Baseline(self.baseline_run()),
            None => Method::Vehicle(self.options_without_models()),
        }
    }

    fn baseline_run(&self) -> BaselineRun {
        let (table, default) = (&self.settings, BaselineOptions::default());
        BaselineRun {
            baseline: BaselineOptions {
                amount: self.refine.unwrap_or(default.amount),
                sh_degree: match table.is_given("sh_degree") {
                    true => table.options.sh_degree,
                    false => default.sh_degree,
                },
                ..default
            },
            vehicle_size: self.vehicle_box.map(|known| known.0.size),
            vehicle_place: self.vehicle_box.and_then(|known| known.0.place),
            resolution: table.options.resolution,
            max_views: table.options.max_views,
            threads: self.threads,
            ..BaselineRun::default()
        }
    }

    fn options_without_models(&self) -> Options {
        let table = &self.settings;
        Options {
            ignore_offset: self.no_offset,
            vehicle_size: self.vehicle_box.map(|known| known.0.size),
            vehicle_place: self.vehicle_box.and_then(|known| known.0.place),
            threads: self.threads,
            refine: self.refine.map(|amount| RefineOptions {
                amount,
                hold_out: self.refine_hold_out,
                densify: self.refine_densify.then(Densify::for_refinement),
                backend: self.refine_backend,
                ..RefineOptions::default()
            }),
            ..table.options.clone()
        }
    }

    /// Files that are read in addition to the scene.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.cloud, &self.prior_model, &self.head_model, &self.onnxruntime].into_iter().flatten()
    }

    /// Whether the scene's depth is read.
    pub(crate) fn wants_depth(&self) -> bool {
        self.method_without_models().uses_given_depth()
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RunsOn {
    Cpu,
    Cuda,
    Auto,
}

/// Methods for comparison.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Baseline {
    #[value(name = "3dgs")]
    GaussianSplatting,
}
