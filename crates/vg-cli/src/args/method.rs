//! How a reconstruction is made, as options of the command line.

use super::values::{KnownBox, at_least_one, backend, known_box, positive, refinement, share};
use crate::job::{self, Failure, USAGE};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use vg::onnx::{Model, ModelOptions, Provider};
use vg::pipeline::{Calibrate, DEFAULT_MAX_GAUSSIANS, Keep, Options, PriorChoice};
use vg::refine::baseline::BaselineOptions;
use vg::refine::{Amount, Densify, RefineOptions};
use vg::relight::Relight;
use vg::render::Backend;
use vg::symmetry::SymmetryMode;

/// How a reconstruction is made; shared by `reconstruct` and `eval`.
#[derive(Args)]
pub(crate) struct MethodArgs {
    /// Depth source: the scene's own depth; the visual hull; the hull corrected by what vehicles look like (shape);
    /// the network of --prior-model (onnx); or (auto) the first if every used view has depth, else shape, which bends to
    /// the depth of the views that have it
    #[arg(long, value_enum, default_value_t = Prior::Auto)]
    prior: Prior,
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
    /// Mirror what was not observed (auto), all of the denser side (always), nothing (never), or the photographs
    /// instead of the model (flip)
    #[arg(long, value_enum, default_value_t = Symmetry::Auto)]
    symmetry: Symmetry,
    /// Show mirror images in the light of their own side, as far as it can be told from what was seen (auto), or as
    /// they were seen (never)
    #[arg(long, value_enum, default_value_t = Relit::Auto)]
    relight: Relit,
    /// Correct the plane of symmetry and the cameras where the silhouettes contradict them (auto), or take them as
    /// they are (off)
    #[arg(long, value_enum, default_value_t = Calibration::Auto)]
    calibrate: Calibration,
    /// Length, width and height of the vehicle in metres, where known, to a few centimetres; with X,Y,Z,YAW also where its
    /// box stands: the centre in metres and the turn about z in radians, in the frame of the cameras
    #[arg(long = "box", value_name = "L,W,H[,X,Y,Z,YAW]", value_parser = known_box, allow_hyphen_values = true)]
    vehicle_box: Option<KnownBox>,
    /// Highest degree of the spherical harmonics that hold the colour [default: 2; of a baseline 3]
    #[arg(long, value_name = "0..3", value_parser = clap::value_parser!(u8).range(0..=3))]
    sh_degree: Option<u8>,
    /// Points measured on the vehicle, PLY in its frame, metres: a surface that is estimated is moved to them
    #[arg(long, value_name = "P.ply")]
    pub(crate) cloud: Option<PathBuf>,
    /// What the plan may not leave out, separated by commas
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    keep: Vec<KeepItem>,
    /// Seconds the reconstruction may take: what does not fit is left out
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    budget: Option<f64>,
    /// Resample the views to this share of their width and height first
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = share)]
    resolution: f64,
    /// Use at most this many views, those that spread best around the vehicle
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    max_views: Option<usize>,
    /// Most Gaussians that the model may have by what the masks say of its size; where they allow for more, the views are
    /// resampled to fewer pixels
    #[arg(long, value_name = "N", default_value_t = DEFAULT_MAX_GAUSSIANS, value_parser = at_least_one)]
    max_gaussians: usize,
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
    #[arg(long, requires = "refine", value_name = "auto|cpu|gpu", default_value = "auto", value_parser = backend)]
    refine_backend: Backend,
    /// Fit another method to the input views instead, for comparison: 3D Gaussian splatting from a random start or from
    /// --cloud, without any prior; --refine tells how long (2000)
    #[arg(long, value_enum, value_name = "METHOD", conflicts_with_all = NOT_OF_A_BASELINE)]
    baseline: Option<Baseline>,
    /// Do not move the shape prior's surface to where the photographs agree
    #[arg(long)]
    no_photo: bool,
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
        if (self.prior == Prior::Onnx) != self.prior_model.is_some() {
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
        let kept = |item: KeepItem| self.keep.contains(&item) || self.keep.contains(&KeepItem::All);
        Options {
            prior: match self.prior {
                Prior::Auto => PriorChoice::Auto,
                Prior::Given => PriorChoice::Given,
                Prior::Hull => PriorChoice::Hull,
                Prior::Shape => PriorChoice::Shape,
                Prior::Onnx => PriorChoice::Onnx,
            },
            prior_model: None,
            head_model: None,
            ignore_offset: self.no_offset,
            symmetry: match self.symmetry {
                Symmetry::Auto => SymmetryMode::Auto,
                Symmetry::Always => SymmetryMode::Always,
                Symmetry::Never => SymmetryMode::Never,
                Symmetry::Flip => SymmetryMode::Flip,
            },
            relight: match self.relight {
                Relit::Auto => Relight::Auto,
                Relit::Never => Relight::Never,
            },
            calibrate: match self.calibrate {
                Calibration::Auto => Calibrate::Auto,
                Calibration::Off => Calibrate::Off,
            },
            vehicle_size: self.vehicle_box.map(|known| known.0.size),
            vehicle_place: self.vehicle_box.and_then(|known| known.0.place),
            sh_degree: self.sh_degree.unwrap_or(Options::default().sh_degree),
            keep: Keep {
                duplicate_views: kept(KeepItem::DuplicateViews),
                overlap: kept(KeepItem::Overlap),
                silhouette_edge: kept(KeepItem::SilhouetteEdge),
                floaters: kept(KeepItem::Floaters),
                sh_bands: kept(KeepItem::ShBands),
            },
            check: true,
            photo: !self.no_photo,
            budget_s: self.budget,
            resolution: self.resolution,
            max_views: self.max_views,
            max_gaussians: Some(self.max_gaussians),
            threads: self.threads,
            points: false,
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
                    sh_degree: self.sh_degree.unwrap_or(default.sh_degree),
                    ..default
                }
            }),
        }
    }

    /// The files that are read beside a scene.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.cloud, &self.prior_model, &self.head_model, &self.onnxruntime].into_iter().flatten()
    }

    /// Whether depth of the scene is read.
    pub(crate) fn wants_depth(&self) -> bool {
        matches!(self.prior, Prior::Auto | Prior::Given) && self.baseline.is_none()
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Prior {
    Auto,
    Given,
    Hull,
    Shape,
    Onnx,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RunsOn {
    Cpu,
    Cuda,
    Auto,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Symmetry {
    Auto,
    Always,
    Never,
    Flip,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Relit {
    Auto,
    Never,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Calibration {
    Auto,
    Off,
}

/// Methods to compare with.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Baseline {
    #[value(name = "3dgs")]
    GaussianSplatting,
}

/// The fields of [`Keep`].
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KeepItem {
    DuplicateViews,
    Overlap,
    SilhouetteEdge,
    Floaters,
    ShBands,
    All,
}
