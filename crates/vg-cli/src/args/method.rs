//! How a reconstruction is made, as options of the command line.

use super::settings::Settings;
use super::values::{KnownBox, choice, known_box, refinement};
use crate::job::{self, Failure, USAGE};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use vg::onnx::{Model, ModelOptions, Provider};
use vg::pipeline::{Options, PriorChoice};
use vg::refine::baseline::BaselineOptions;
use vg::refine::{Amount, Densify, RefineOptions};
use vg::render::Backend;

/// How a reconstruction is made; shared by `reconstruct` and `eval`.
#[derive(Args)]
pub(crate) struct MethodArgs {
    #[command(flatten)]
    settings: Settings,
    /// The geometry network of --prior onnx: an ONNX file in the contract of docs/ONNX.md
    #[arg(long, value_name = "M.onnx")]
    pub(crate) prior_model: Option<PathBuf>,
    /// A Gaussian head, an ONNX file in the contract of docs/ONNX.md, instead of the built-in one
    #[arg(long, value_name = "M.onnx")]
    pub(crate) head_model: Option<PathBuf>,
    /// Leave out what the head's network says of where a pixel's Gaussian is beside the depth (the paper's ablation)
    #[arg(long, requires = "head_model")]
    no_offset: bool,
    /// ONNX Runtime's library or its folder; else VG_ONNXRUNTIME, else that of an installed Python package
    #[arg(long, value_name = "PATH")]
    onnxruntime: Option<PathBuf>,
    /// Where networks run: the processor, CUDA, or CUDA where it can be had
    #[arg(long, value_enum, default_value_t = RunsOn::Cpu)]
    provider: RunsOn,
    /// Length, width and height of the vehicle in metres, where known, to a few centimetres; with X,Y,Z,YAW also where its
    /// box stands: the centre in metres and the turn about z in radians, in the frame of the cameras
    #[arg(long = "box", value_name = "L,W,H[,X,Y,Z,YAW]", value_parser = known_box, allow_hyphen_values = true)]
    vehicle_box: Option<KnownBox>,
    /// Points measured on the vehicle, PLY in its frame, metres: a surface that is estimated is moved to them
    #[arg(long, value_name = "P.ply")]
    pub(crate) cloud: Option<PathBuf>,
    /// Optimise the model against the photographs: so many steps (300), or as many as fit into so many seconds (5s)
    #[arg(long, value_name = "N|SECONDSs", value_parser = refinement)]
    refine: Option<Amount>,
    /// Keep one of three or more views out of the optimisation, to tell when to stop
    #[arg(long, requires = "refine")]
    refine_hold_out: bool,
    /// Let Gaussians divide and go in the optimisation, as 3D Gaussian splatting does
    #[arg(long, requires = "refine")]
    refine_densify: bool,
    /// Who draws and goes back in the optimisation: the processor, a graphics processor in a build that has one, or what
    /// is known to pay (auto: the processor)
    #[arg(long, requires = "refine", default_value = "auto", value_parser = choice::<Backend>())]
    refine_backend: Backend,
    /// Fit another method to the input views instead, for comparison: 3D Gaussian splatting from a random start or from
    /// --cloud, without any prior; --refine tells how long (2000), and --sh-degree is 3 if it is not given
    #[arg(long, value_enum, value_name = "METHOD", conflicts_with_all = NOT_OF_A_BASELINE)]
    baseline: Option<Baseline>,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

/// Arguments of what a baseline has not.
const NOT_OF_A_BASELINE: [&str; 16] = [
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
    /// For the library; models are opened.
    pub(crate) fn options(&self) -> job::Result<Options> {
        if (self.settings.options.prior == PriorChoice::Onnx) != self.prior_model.is_some() {
            let message = "--prior onnx and --prior-model M.onnx go together".into();
            return Err(Failure { message, code: USAGE });
        }
        let model = |path: &Path| Model::open(path, &self.model_options());
        let (prior_model, head_model) = (self.prior_model.as_deref(), self.head_model.as_deref());
        Ok(Options {
            prior_model: prior_model.map(model).transpose()?,
            head_model: head_model.map(model).transpose()?,
            ..self.plain_options()
        })
    }

    /// Whether nothing was said of how to reconstruct, but which networks there are.
    pub(crate) fn is_silent(&self) -> bool {
        self.plain_options() == Options::default() && self.cloud.is_none()
    }

    /// How networks are opened.
    pub(crate) fn model_options(&self) -> ModelOptions {
        ModelOptions {
            runtime: self.onnxruntime.clone(),
            provider: if self.provider == RunsOn::Cpu { Provider::Cpu } else { Provider::Cuda },
            fall_back: self.provider == RunsOn::Auto,
            threads: self.threads,
            ..ModelOptions::default()
        }
    }

    /// Without models.
    fn plain_options(&self) -> Options {
        let table = &self.settings;
        Options {
            ignore_offset: self.no_offset,
            vehicle_size: self.vehicle_box.map(|known| known.0.size),
            vehicle_place: self.vehicle_box.and_then(|known| known.0.place),
            threads: self.threads,
            refine: self.refine.filter(|_| self.baseline.is_none()).map(|amount| RefineOptions {
                amount,
                hold_out: self.refine_hold_out,
                densify: self.refine_densify.then(Densify::of_refinement),
                backend: self.refine_backend,
                ..RefineOptions::default()
            }),
            baseline: self.baseline.map(|Baseline::GaussianSplatting| {
                let default = BaselineOptions::default();
                BaselineOptions {
                    amount: self.refine.unwrap_or(default.amount),
                    sh_degree: if table.is_given("sh_degree") {
                        table.options.sh_degree
                    } else {
                        default.sh_degree
                    },
                    ..default
                }
            }),
            ..table.options.clone()
        }
    }

    /// The files that are read beside a scene.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.cloud, &self.prior_model, &self.head_model, &self.onnxruntime].into_iter().flatten()
    }

    /// Whether depth of the scene is read.
    pub(crate) fn wants_depth(&self) -> bool {
        matches!(self.settings.options.prior, PriorChoice::Auto | PriorChoice::Given)
            && self.baseline.is_none()
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RunsOn {
    Cpu,
    Cuda,
    Auto,
}

/// Methods to compare with.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Baseline {
    #[value(name = "3dgs")]
    GaussianSplatting,
}
