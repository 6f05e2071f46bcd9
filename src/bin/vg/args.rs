//! The command line: commands, options, and what their values may be.

use crate::job::{self, Failure, USAGE};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::{Path, PathBuf};
use vg::onnx::{Model, ModelOptions, Provider};
use vg::pipeline::{Calibrate, Keep, Options, PriorChoice};
use vg::refine::baseline::BaselineOptions;
use vg::refine::{Amount, Densify, RefineOptions};
use vg::relight::Relight;
use vg::render::Background;
use vg::symmetry::SymmetryMode;

/// Reconstructs a vehicle from posed, masked photographs of one side as metric 3D Gaussians.
#[derive(Parser)]
#[command(name = "vg", version, after_help = EXIT_CODES, arg_required_else_help = true, infer_long_args = false)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 the job is done; 1 it failed (bad data, a file that cannot be read or \
written); 2 the arguments make no sense; 130 interrupted.\nErrors are one line on standard error: vg: error: <cause>.";

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Make a Gaussian model of the vehicle in a scene
    Reconstruct(ReconstructArgs),
    /// Draw a model as a scene's cameras see it, or all around it
    Render(RenderArgs),
    /// Tell what is in a PLY file, and what is wrong with it
    Info(InfoArgs),
    /// Reconstruct from some views of scenes and measure the error in others
    Eval(EvalArgs),
    /// Measure error against run time over a sweep of settings
    Pareto(ParetoArgs),
    /// Run the whole job on the sample inside this program
    Demo(DemoArgs),
    /// Find the similarity from a scene's world to the vehicle's frame, from known camera centres
    Align(AlignArgs),
}

/// How a reconstruction is made; shared by `reconstruct` and `eval`.
#[derive(Args)]
pub(crate) struct MethodArgs {
    /// Depth source: the scene's own depth; the visual hull; the hull corrected by what vehicles look like (shape);
    /// the network of --prior-model (onnx); or (auto) the first if every used view has depth, else shape
    #[arg(long, value_enum, default_value_t = Prior::Auto)]
    pub(crate) prior: Prior,
    /// The geometry network of --prior onnx: an ONNX file in the contract of docs/ONNX.md
    #[arg(long, value_name = "M.onnx")]
    pub(crate) prior_model: Option<PathBuf>,
    /// A Gaussian head, an ONNX file in the contract of docs/ONNX.md, instead of the built-in one
    #[arg(long, value_name = "M.onnx")]
    pub(crate) head_model: Option<PathBuf>,
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
    /// Length, width and height of the vehicle in metres, where known
    #[arg(long = "box", value_name = "L,W,H", value_parser = vehicle_size)]
    vehicle_size: Option<VehicleSize>,
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
    /// Optimise the model against the photographs: so many steps (300), or as many as fit into so many seconds (5s)
    #[arg(long, value_name = "N|SECONDSs", value_parser = refinement)]
    refine: Option<Amount>,
    /// Keep one of three or more views out of the optimisation, to tell when to stop
    #[arg(long, requires = "refine")]
    refine_hold_out: bool,
    /// Let Gaussians divide and go in the optimisation, as 3D Gaussian splatting does
    #[arg(long, requires = "refine")]
    refine_densify: bool,
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
const NOT_OF_A_BASELINE: [&str; 14] = [
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
    "refine_hold_out",
    "refine_densify",
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
            vehicle_size: self.vehicle_size.map(|s| s.0),
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
            threads: self.threads,
            points: false,
            refine: self.refine.filter(|_| self.baseline.is_none()).map(|amount| RefineOptions {
                amount,
                hold_out: self.refine_hold_out,
                densify: self.refine_densify.then(Densify::of_refinement),
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

    /// Whether depth of the scene is read.
    pub(crate) fn wants_depth(&self) -> bool {
        matches!(self.prior, Prior::Auto | Prior::Given) && self.baseline.is_none()
    }
}

/// What a scene's files do not say.
#[derive(Args)]
pub(crate) struct FrameArgs {
    /// Similarity from the scene's world to the vehicle's frame, JSON; a COLMAP model needs one
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle_from_world: Option<PathBuf>,
}

/// Which of the scene's views.
#[derive(Args)]
pub(crate) struct ViewsArgs {
    /// Views to use, by path, file name, or file name without extension; all if not given
    #[arg(long, value_name = "NAME,NAME,...", value_delimiter = ',')]
    pub(crate) views: Option<Vec<String>>,
}

/// Numbers in depth files.
#[derive(Args)]
pub(crate) struct DepthArgs {
    /// Metres per number in the depth files, instead of what the scene says
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub(crate) depth_scale: Option<f64>,
}

#[derive(Args)]
pub(crate) struct ReconstructArgs {
    /// A transforms.json, a folder with one, or a COLMAP folder (images/, masks/, sparse/0)
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) views: ViewsArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    #[command(flatten)]
    pub(crate) depth: DepthArgs,
    /// A segmentation network, an ONNX file in the contract of docs/ONNX.md, for the views that have no mask
    #[arg(long, value_name = "M.onnx")]
    pub(crate) mask_model: Option<PathBuf>,
    /// The model, a PLY file in 3DGS's layout
    #[arg(short, long, value_name = "ASSET.ply")]
    pub(crate) output: PathBuf,
    /// Write the metric coloured point cloud as well
    #[arg(long, value_name = "P.ply", conflicts_with = "baseline")]
    pub(crate) points: Option<PathBuf>,
    /// Do not draw the model into the input views to report the error there: about twice as fast with given depth
    #[arg(long)]
    pub(crate) no_check: bool,
    /// Write what was done: settings, stage times, counts, what was left out and why, errors
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
}

#[derive(Args)]
#[command(group(clap::ArgGroup::new("where").required(true).args(["cameras", "turntable"])))]
pub(crate) struct RenderArgs {
    /// The model, a PLY file in 3DGS's layout
    pub(crate) asset: PathBuf,
    /// Draw what the cameras of this scene see: <image stem>.png each
    #[arg(long, value_name = "SCENE")]
    pub(crate) cameras: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) views: ViewsArgs,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    /// Draw N pictures from all around instead
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), conflicts_with_all = ["views", "vehicle_from_world"])]
    pub(crate) turntable: Option<u32>,
    /// Size of the turntable's pictures, pixels
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = picture_size, conflicts_with = "cameras")]
    pub(crate) size: (u32, u32),
    /// What is behind the vehicle; a colour as three numbers from 0 to 255
    #[arg(long, value_name = "white|black|R,G,B|transparent", default_value = "white", value_parser = background)]
    pub(crate) background: Background,
    /// Write depth too: DIR/depth/<image stem>.png, 16-bit millimetres, 0 = none
    #[arg(long)]
    pub(crate) depth: bool,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
    /// Folder for the pictures
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Args)]
pub(crate) struct InfoArgs {
    /// Gaussians or a point cloud, PLY
    pub(crate) file: PathBuf,
}

#[derive(Args)]
pub(crate) struct EvalArgs {
    /// Scenes, as for `reconstruct`; several make a table with their mean
    #[arg(required = true)]
    pub(crate) scenes: Vec<PathBuf>,
    /// JSON of {"KEY": {"input": [views], "test": [views]}}; a name that is not found here is looked up in each
    /// scene's folder
    #[arg(long, value_name = "FILE", default_value = "split.json")]
    pub(crate) split: PathBuf,
    /// This key of the split only
    #[arg(long, value_name = "KEY")]
    pub(crate) only: Option<String>,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    #[command(flatten)]
    pub(crate) depth: DepthArgs,
    /// Show the method only N points of the cloud, of those that the input cameras see; a cloud that is not found
    /// here is looked up in each scene's folder
    #[arg(long, value_name = "N", requires = "cloud", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) cloud_points: Option<u32>,
    /// Time the reconstruction R times and report the median
    #[arg(long, value_name = "R", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: u32,
    /// Write the numbers, per view too
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct ParetoArgs {
    /// Scenes, as for `reconstruct`
    #[arg(required = true)]
    pub(crate) scenes: Vec<PathBuf>,
    /// As for `eval`
    #[arg(long, value_name = "FILE", default_value = "split.json")]
    pub(crate) split: PathBuf,
    /// This key of the split only
    #[arg(long, value_name = "KEY")]
    pub(crate) only: Option<String>,
    /// A point of the sweep: options of `eval` that say how to reconstruct, "--refine 5s", with a name before a colon
    /// if it is to have one; once for each point
    #[arg(long = "point", value_name = "[NAME:] OPTIONS", required = true, allow_hyphen_values = true)]
    pub(crate) points: Vec<String>,
    /// Options that all points have
    #[arg(long, value_name = "OPTIONS", default_value = "", allow_hyphen_values = true)]
    pub(crate) with: String,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    /// Time each point R times, one after the other, and report the median and the spread
    #[arg(long, value_name = "R", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: u32,
    /// Write the table
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write a plot of PSNR against seconds
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// Heading of the plot
    #[arg(long, value_name = "TEXT", default_value = "Error against run time")]
    pub(crate) title: String,
    /// Write all numbers
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct DemoArgs {
    /// Folder for what the demo makes
    #[arg(default_value = "vg-demo")]
    pub(crate) folder: PathBuf,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

#[derive(Args)]
pub(crate) struct AlignArgs {
    /// The scene, usually a COLMAP folder
    pub(crate) scene: PathBuf,
    /// Camera centres in the vehicle's frame, metres: {"000.jpg": [x, y, z], ...}, at least three
    #[arg(long, value_name = "CENTERS.json")]
    pub(crate) known_centers: PathBuf,
    /// The similarity, for --vehicle-from-world
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Prior {
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

/// Length, width, height in metres. A type of its own: the parser would take an array for a list of values.
#[derive(Clone, Copy)]
struct VehicleSize([f64; 3]);

fn vehicle_size(text: &str) -> Result<VehicleSize, String> {
    let size = numbers::<f64>(text).ok_or("expected three numbers, length,width,height in metres")?;
    match (Options { vehicle_size: Some(size), ..Options::default() }).validate() {
        Ok(()) => Ok(VehicleSize(size)),
        Err(vg::Error::Argument { allowed, .. }) => Err(format!("expected {allowed}")),
        Err(other) => Err(other.to_string()),
    }
}

fn background(text: &str) -> Result<Background, String> {
    match text {
        "white" => Ok(Background::Color([1.0; 3])),
        "black" => Ok(Background::Color([0.0; 3])),
        "transparent" => Ok(Background::Transparent),
        other => numbers::<u8>(other)
            .map(|rgb| Background::Color(rgb.map(|c| f32::from(c) / 255.0)))
            .ok_or_else(|| "expected white, black, transparent, or R,G,B with numbers from 0 to 255".into()),
    }
}

/// Three numbers with commas between.
fn numbers<T: std::str::FromStr>(text: &str) -> Option<[T; 3]> {
    let numbers: Vec<T> = text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().ok()?;
    numbers.try_into().ok()
}

fn picture_size(text: &str) -> Result<(u32, u32), String> {
    let side =
        |text: &str| text.parse().ok().filter(|side| (1..=vg::geometry::camera::MAX_SIDE).contains(side));
    text.split_once('x')
        .and_then(|(w, h)| Some((side(w)?, side(h)?)))
        .ok_or_else(|| format!("expected WxH, each 1 to {}", vg::geometry::camera::MAX_SIDE))
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value: &f64| *value > 0.0 && value.is_finite())
        .ok_or_else(|| "expected a number above 0".into())
}

fn refinement(text: &str) -> Result<Amount, String> {
    let amount = match text.strip_suffix('s') {
        Some(seconds) => seconds.parse().ok().map(Amount::Seconds),
        None => text.parse().ok().map(Amount::Iterations),
    };
    let amount = amount.ok_or("expected a number of steps (300) or of seconds (5s)")?;
    match (RefineOptions { amount, ..RefineOptions::default() }).validate() {
        Ok(()) => Ok(amount),
        Err(vg::Error::Argument { allowed, .. }) => Err(format!("expected {allowed}")),
        Err(other) => Err(other.to_string()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    let inside = |share: &f64| *share > 0.0 && *share <= 1.0;
    text.parse().ok().filter(inside).ok_or_else(|| "expected a number above 0, at most 1".into())
}

fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| *n > 0).ok_or_else(|| "expected a whole number above 0".into())
}
