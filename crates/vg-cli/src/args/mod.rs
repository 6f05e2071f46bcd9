//! The command line: commands and their options.

mod align;
#[cfg(test)]
mod documented;
mod eval;
mod method;
mod report;
mod settings;
mod values;

pub(crate) use align::{AlignArgs, Mode};
pub(crate) use eval::{EvalArgs, JudgeArgs, ParetoArgs, TableName, VehiclesArgs};
pub(crate) use method::MethodArgs;
pub(crate) use report::ReportArgs;

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use values::{Names, background, choice, names, picture_size, positive, refinement};
use vg::refine::Amount;
use vg::render::{Backend, Background};

/// Reconstructs a vehicle as metric 3D Gaussians from posed, masked photographs of one side.
#[derive(Parser)]
#[command(name = "vg", version, after_help = EXIT_CODES, arg_required_else_help = true, infer_long_args = false)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 success; 1 failure (bad data, a file that cannot be read or written); \
2 invalid arguments; 130 interrupted, 143 terminated, 129 hung up.\nAn output file named - is standard output, which \
then holds nothing else.\nErrors are one line on standard error: vg: error: <cause>.";

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Make a Gaussian model of the vehicle in a scene
    Reconstruct(ReconstructArgs),
    /// Optimise an existing model against a scene's photographs
    Refine(RefineArgs),
    /// Render a model from a scene's cameras, or from all around
    Render(RenderArgs),
    /// Describe a PLY file and its problems
    Info(InfoArgs),
    /// Reconstruct from some views of scenes and measure the error in the others
    Eval(EvalArgs),
    /// Measure error against run time over a sweep of settings
    Pareto(ParetoArgs),
    /// Reconstruct, and write one HTML page with inputs, result, errors and times
    Report(ReportArgs),
    /// Run the whole pipeline on the bundled sample
    Demo(DemoArgs),
    /// Find the similarity from a scene's world to the vehicle's frame, from a scan, camera centres, a box or a matrix
    Align(AlignArgs),
}

/// Frame of a scene, which its files do not define.
#[derive(Args)]
pub(crate) struct FrameArgs {
    /// Similarity from the scene's world to the vehicle's frame, JSON; required for a COLMAP model
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle_from_world: Option<PathBuf>,
}

/// Selection of the scene's views.
#[derive(Args)]
pub(crate) struct ViewsArgs {
    /// Views to use, by path, file name, or file name without extension [default: all]. May be repeated; a comma
    /// inside a name is written \,
    #[arg(long, value_name = "NAME,NAME,...", value_parser = names)]
    views: Option<Vec<Names>>,
}

impl ViewsArgs {
    /// The names in the order given; `None` means all views.
    pub(crate) fn names(&self) -> Option<Vec<String>> {
        let lists = self.views.as_ref()?;
        Some(lists.iter().flat_map(|list| list.0.iter().cloned()).collect())
    }
}

/// Unit of depth files.
#[derive(Args)]
pub(crate) struct DepthArgs {
    /// Metres per unit of the depth files; overrides the scene's value
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub(crate) depth_scale: Option<f64>,
}

/// Rejection of results with a poor verdict.
#[derive(Args)]
pub(crate) struct StrictArgs {
    /// Fail and write nothing unless the verdict is good; with =bad, only if it is bad
    #[arg(
        long,
        value_name = "doubtful|bad",
        value_enum,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "doubtful"
    )]
    pub(crate) strict: Option<Strict>,
}

/// Mildest verdict that makes a job fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Strict {
    /// Doubtful, bad, and unchecked (where the budget left no time to check).
    Doubtful,
    /// Only bad.
    Bad,
}

#[derive(Args)]
pub(crate) struct ReconstructArgs {
    /// A transforms.json, a folder that holds one, or a COLMAP folder (images/, masks/, sparse/0)
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) views: ViewsArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    #[command(flatten)]
    pub(crate) depth: DepthArgs,
    /// Segmentation network for views without a mask: an ONNX file that meets the contract of docs/ONNX.md
    #[arg(long, value_name = "M.onnx")]
    pub(crate) mask_model: Option<PathBuf>,
    /// The model, a PLY file in 3DGS's layout
    #[arg(short, long, value_name = "ASSET.ply")]
    pub(crate) output: PathBuf,
    /// Also write the metric coloured point cloud
    #[arg(long, value_name = "P.ply", conflicts_with = "baseline")]
    pub(crate) points: Option<PathBuf>,
    /// Skip the error check in the input views: about twice as fast with given depth
    #[arg(long, conflicts_with = "strict")]
    pub(crate) no_check: bool,
    #[command(flatten)]
    pub(crate) strict: StrictArgs,
    /// Write a report as JSON: settings, stage times, counts, what was left out and why, errors
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
    /// For a child process: the similarity itself, 16 numbers
    #[arg(long, hide = true, conflicts_with = "vehicle_from_world")]
    pub(crate) frame_matrix: Option<String>,
    /// For a child process: end when standard input ends
    #[arg(long, hide = true)]
    pub(crate) end_with_input: bool,
}

#[derive(Args)]
pub(crate) struct RefineArgs {
    /// The model, a PLY file in 3DGS's layout, in the scene's vehicle frame
    pub(crate) asset: PathBuf,
    /// The scene, as for `reconstruct`
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) views: ViewsArgs,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    /// Number of steps (300) or of seconds (5s)
    #[arg(long, value_name = "N|SECONDSs", default_value = "300", value_parser = refinement)]
    pub(crate) amount: Amount,
    /// Hold one of three or more views out of the optimisation, to decide when to stop
    #[arg(long)]
    pub(crate) hold_out: bool,
    /// Split, clone and prune Gaussians, as 3D Gaussian splatting does
    #[arg(long)]
    pub(crate) densify: bool,
    /// Device for rendering and gradients: cpu, gpu (in a build with GPU support), or auto, at present the CPU
    #[arg(long, default_value = "auto", value_parser = choice::<Backend>())]
    pub(crate) backend: Backend,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
    /// Output file of the refined model
    #[arg(short, long, value_name = "ASSET.ply")]
    pub(crate) output: PathBuf,
    /// Write a report as JSON: settings, steps, errors
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
}

#[derive(Args)]
#[command(group(clap::ArgGroup::new("where").required(true).args(["cameras", "turntable"])))]
pub(crate) struct RenderArgs {
    /// The model, a PLY file in 3DGS's layout
    pub(crate) asset: PathBuf,
    /// Render from the cameras of this scene: <image stem>.png each, with the folders of the image names where two
    /// would have the same name
    #[arg(long, value_name = "SCENE")]
    pub(crate) cameras: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) views: ViewsArgs,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    /// Render N pictures from all around instead
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), conflicts_with_all = ["views", "vehicle_from_world"])]
    pub(crate) turntable: Option<u32>,
    /// Size of the turntable's pictures, pixels
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = picture_size, conflicts_with = "cameras")]
    pub(crate) size: (u32, u32),
    /// Background; a colour is three numbers from 0 to 255
    #[arg(long, value_name = "white|black|R,G,B|transparent", default_value = "white", value_parser = background)]
    pub(crate) background: Background,
    /// Also write depth, under the same names in DIR/depth: 16-bit millimetres, 0 = none
    #[arg(long)]
    pub(crate) depth: bool,
    /// Renderer: cpu, gpu, or auto, the best that this build and this machine have
    #[arg(long, default_value = "auto", value_parser = choice::<Backend>())]
    pub(crate) backend: Backend,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
    /// Folder for the pictures
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Args)]
pub(crate) struct InfoArgs {
    /// PLY file of Gaussians or of a point cloud
    pub(crate) file: PathBuf,
}

#[derive(Args)]
pub(crate) struct DemoArgs {
    /// Output folder
    #[arg(default_value = "vg-demo")]
    pub(crate) folder: PathBuf,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}
