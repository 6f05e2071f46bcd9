//! Command-line options of the measurements: `eval` and `pareto`.

use super::{DepthArgs, FrameArgs, MethodArgs};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Vehicles that are measured.
#[derive(Args)]
pub(crate) struct VehiclesArgs {
    /// Scenes, as for `reconstruct`, or folders of scenes; for several, the table also has their mean
    #[arg(required = true)]
    pub(crate) scenes: Vec<PathBuf>,
    /// JSON {"KEY": {"input": [views], "test": [views]}}; a file that is not found here is looked up in each scene's
    /// folder
    #[arg(long, value_name = "FILE", default_value = "split.json")]
    pub(crate) split: PathBuf,
    /// Use only this key of the split
    #[arg(long, value_name = "KEY")]
    pub(crate) only: Option<String>,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    /// First find the similarity to the vehicle's frame from a scan, as `align --scan` does: CLOUD.ply in each scene's
    /// folder; without a file name, the scan of a 3DRealCar folder
    #[arg(long, value_name = "CLOUD.ply", num_args = 0..=1, conflicts_with = "vehicle_from_world")]
    pub(crate) align: Option<Option<PathBuf>>,
}

/// References, besides photographs, masks and depth, that a result is compared with.
#[derive(Args)]
pub(crate) struct JudgeArgs {
    /// Points scanned on the vehicle, PLY in its frame, metres, to measure the surface and the size; a file that is not
    /// found here is looked up in each scene's folder
    #[arg(long, value_name = "P.ply")]
    pub(crate) scan: Option<PathBuf>,
    /// LPIPS network, an ONNX file that meets the contract of docs/METRICS.md
    #[arg(long, value_name = "M.onnx")]
    pub(crate) lpips: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct EvalArgs {
    #[command(flatten)]
    pub(crate) vehicles: VehiclesArgs,
    #[command(flatten)]
    pub(crate) judge: JudgeArgs,
    /// A table of the paper, with a row for each system instead of a row for each vehicle; `omissions` measures what
    /// each omission of the plan costs
    #[arg(long, value_enum, value_name = "TABLE")]
    pub(crate) table: Option<TableName>,
    /// A row of the table: a name and the reconstruction options of this command, "no clones: --symmetry never"; may be
    /// repeated
    #[arg(long = "system", value_name = "NAME: OPTIONS", allow_hyphen_values = true)]
    pub(crate) systems: Vec<String>,
    /// A row of models made by another program: "DA3: da3 runs/{scene}/{split}". KIND is da3 (a folder with a PLY for
    /// each input view, or one PLY for all), trellis (a PLY as TRELLIS writes it), object (any PLY, z up), or vehicle
    /// (a PLY in the vehicle's frame); trellis and object are fitted to --scan. See docs/EVAL.md
    #[arg(long = "import", value_name = "NAME: KIND PATH")]
    pub(crate) imports: Vec<String>,
    /// Options that apply to all rows
    #[arg(long, value_name = "OPTIONS", default_value = "", allow_hyphen_values = true)]
    pub(crate) with: String,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) depth: DepthArgs,
    /// Use only N points of the cloud, chosen from those that the input cameras see; a cloud that is not found here is
    /// looked up in each scene's folder
    #[arg(long, value_name = "N", requires = "cloud", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) cloud_points: Option<u32>,
    /// Time the reconstruction R times and report the median
    #[arg(long, value_name = "R", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: u32,
    /// Write the numbers as JSON, including those of each view
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write the table as Markdown
    #[arg(long, value_name = "FILE")]
    pub(crate) markdown: Option<PathBuf>,
}

/// Predefined tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableName {
    /// This library's priors and heads against other methods (the paper's table 1)
    Main,
    /// Side of the input views against side of the test views (table 2)
    Side,
    /// Gain from correcting the prior's positions (table 3)
    Offset,
    /// Cloning Gaussians against mirroring photographs (table 4)
    Symmetry,
    /// Activation that makes a network's scales positive (table 5)
    Activation,
    /// Cost of each omission of the plan
    Omissions,
}

#[derive(Args)]
pub(crate) struct ParetoArgs {
    #[command(flatten)]
    pub(crate) vehicles: VehiclesArgs,
    #[command(flatten)]
    pub(crate) judge: JudgeArgs,
    /// A point of the sweep: an optional name and colon, then reconstruction options of `eval`, "fast: --refine 5s"; may
    /// be repeated
    #[arg(long = "point", value_name = "[NAME:] OPTIONS", required = true, allow_hyphen_values = true)]
    pub(crate) points: Vec<String>,
    /// Options that apply to all points
    #[arg(long, value_name = "OPTIONS", default_value = "", allow_hyphen_values = true)]
    pub(crate) with: String,
    /// Time each point R times, taking the points in turn, and report the median and the spread
    #[arg(long, value_name = "R", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: u32,
    /// Write the table as CSV
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write a plot of PSNR against seconds as SVG
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// Write the plot as PNG
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,
    /// Title of the plot
    #[arg(long, value_name = "TEXT", default_value = "Error against run time")]
    pub(crate) title: String,
    /// Write all numbers as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
