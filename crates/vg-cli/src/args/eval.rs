//! What is measured, and how, as options of the command line: `eval` and `pareto`.

use super::{DepthArgs, FrameArgs, MethodArgs};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// The vehicles a measurement is made on.
#[derive(Args)]
pub(crate) struct VehiclesArgs {
    /// Scenes, as for `reconstruct`, or folders of scenes; several make a table with their mean
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
    pub(crate) frame: FrameArgs,
    /// Find the similarity to the vehicle's frame from the scan first, as `align --scan` does: from CLOUD.ply in each
    /// scene's folder, without a name from the scan of a 3DRealCar folder
    #[arg(long, value_name = "CLOUD.ply", num_args = 0..=1, conflicts_with = "vehicle_from_world")]
    pub(crate) align: Option<Option<PathBuf>>,
}

/// What beside photographs, masks and depth a result is compared with.
#[derive(Args)]
pub(crate) struct JudgeArgs {
    /// Points scanned on the vehicle, PLY in its frame, metres, to measure the surface and the size with; one that is
    /// not found here is looked up in each scene's folder
    #[arg(long, value_name = "P.ply")]
    pub(crate) scan: Option<PathBuf>,
    /// LPIPS, an ONNX file in the contract of docs/METRICS.md
    #[arg(long, value_name = "M.onnx")]
    pub(crate) lpips: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct EvalArgs {
    #[command(flatten)]
    pub(crate) vehicles: VehiclesArgs,
    #[command(flatten)]
    pub(crate) judge: JudgeArgs,
    /// A table of the paper, a row for each system, instead of a row for each vehicle; `omissions` is what each thing
    /// that the plan leaves out is worth
    #[arg(long, value_enum, value_name = "TABLE")]
    pub(crate) table: Option<TableName>,
    /// A row of the table: options of this command that say how to reconstruct, "no clones: --symmetry never"; once
    /// for each row
    #[arg(long = "system", value_name = "NAME: OPTIONS", allow_hyphen_values = true)]
    pub(crate) systems: Vec<String>,
    /// A row of models that another program made: "DA3: da3 runs/{scene}/{split}". KIND is da3 (a folder with a PLY
    /// for each input view, or one PLY of all), trellis (a PLY as TRELLIS writes it), object (any PLY, z up), or
    /// vehicle (a PLY in the vehicle's frame); all but da3 and vehicle are fitted to --scan. See docs/EVAL.md
    #[arg(long = "import", value_name = "NAME: KIND PATH")]
    pub(crate) imports: Vec<String>,
    /// Options that all rows have
    #[arg(long, value_name = "OPTIONS", default_value = "", allow_hyphen_values = true)]
    pub(crate) with: String,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
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
    /// Write the table as Markdown
    #[arg(long, value_name = "FILE")]
    pub(crate) markdown: Option<PathBuf>,
}

/// Tables that can be asked for by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableName {
    /// This library's priors and heads beside other methods (the paper's table 1)
    Main,
    /// From which side the inputs are, and where the result is looked at from (table 2)
    Side,
    /// What correcting the prior's places is worth (table 3)
    Offset,
    /// Cloning Gaussians beside mirroring photographs (table 4)
    Symmetry,
    /// What makes a network's scales positive (table 5)
    Activation,
    /// What each thing that the plan leaves out would have been worth
    Omissions,
}

#[derive(Args)]
pub(crate) struct ParetoArgs {
    #[command(flatten)]
    pub(crate) vehicles: VehiclesArgs,
    #[command(flatten)]
    pub(crate) judge: JudgeArgs,
    /// A point of the sweep: options of `eval` that say how to reconstruct, "--refine 5s", with a name before a colon
    /// if it is to have one; once for each point
    #[arg(long = "point", value_name = "[NAME:] OPTIONS", required = true, allow_hyphen_values = true)]
    pub(crate) points: Vec<String>,
    /// Options that all points have
    #[arg(long, value_name = "OPTIONS", default_value = "", allow_hyphen_values = true)]
    pub(crate) with: String,
    /// Time each point R times, one after the other, and report the median and the spread
    #[arg(long, value_name = "R", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: u32,
    /// Write the table
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write a plot of PSNR against seconds
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// The same as PNG
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,
    /// Heading of the plot
    #[arg(long, value_name = "TEXT", default_value = "Error against run time")]
    pub(crate) title: String,
    /// Write all numbers
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
