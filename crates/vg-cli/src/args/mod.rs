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

/// Reconstructs a vehicle from posed, masked photographs of one side as metric 3D Gaussians.
#[derive(Parser)]
#[command(name = "vg", version, after_help = EXIT_CODES, arg_required_else_help = true, infer_long_args = false)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 the job is done; 1 it failed (bad data, a file that cannot be read or \
written); 2 the arguments make no sense; 130 interrupted, 143 terminated, 129 hung up.\nA result named - goes to \
standard output, and nothing else does.\nErrors are one line on standard error: vg: error: <cause>.";

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Make a Gaussian model of the vehicle in a scene
    Reconstruct(ReconstructArgs),
    /// Move a model that is there already towards a scene's photographs
    Refine(RefineArgs),
    /// Draw a model as a scene's cameras see it, or all around it
    Render(RenderArgs),
    /// Tell what is in a PLY file, and what is wrong with it
    Info(InfoArgs),
    /// Reconstruct from some views of scenes and measure the error in others
    Eval(EvalArgs),
    /// Measure error against run time over a sweep of settings
    Pareto(ParetoArgs),
    /// Reconstruct, and show on one HTML page what went in, what came out and how far off it is
    Report(ReportArgs),
    /// Run the whole job on the sample inside this program
    Demo(DemoArgs),
    /// Find the similarity from a scene's world to the vehicle's frame: by a scan, camera centres, a box, or a matrix
    Align(AlignArgs),
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
    /// Views to use, by path, file name, or file name without extension; all if not given. May be repeated; a comma
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

/// Numbers in depth files.
#[derive(Args)]
pub(crate) struct DepthArgs {
    /// Metres per number in the depth files, instead of what the scene says
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub(crate) depth_scale: Option<f64>,
}

/// What becomes of a result that is not to be believed.
#[derive(Args)]
pub(crate) struct StrictArgs {
    /// Fail and write nothing where the verdict is not good; with =bad, only where it is bad
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

/// From which verdict on a job fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Strict {
    /// Doubtful and bad, and unchecked for a budget.
    Doubtful,
    /// Bad alone.
    Bad,
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
    #[arg(long, conflicts_with = "strict")]
    pub(crate) no_check: bool,
    #[command(flatten)]
    pub(crate) strict: StrictArgs,
    /// Write what was done: settings, stage times, counts, what was left out and why, errors
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
    /// For a process that another one started: the similarity itself, 16 numbers
    #[arg(long, hide = true, conflicts_with = "vehicle_from_world")]
    pub(crate) frame_matrix: Option<String>,
    /// For such a process: end when standard input ends
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
    /// So many steps, or as many as fit into so many seconds (5s)
    #[arg(long, value_name = "N|SECONDSs", default_value = "300", value_parser = refinement)]
    pub(crate) amount: Amount,
    /// Keep one of three or more views out of the optimisation, to tell when to stop
    #[arg(long)]
    pub(crate) hold_out: bool,
    /// Let Gaussians divide and go, as 3D Gaussian splatting does
    #[arg(long)]
    pub(crate) densify: bool,
    /// Who draws and goes back: the processor, a graphics processor in a build that has one, or what is known to pay
    /// (auto: the processor)
    #[arg(long, default_value = "auto", value_parser = choice::<Backend>())]
    pub(crate) backend: Backend,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
    /// The refined model
    #[arg(short, long, value_name = "ASSET.ply")]
    pub(crate) output: PathBuf,
    /// Write what was done
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
}

#[derive(Args)]
#[command(group(clap::ArgGroup::new("where").required(true).args(["cameras", "turntable"])))]
pub(crate) struct RenderArgs {
    /// The model, a PLY file in 3DGS's layout
    pub(crate) asset: PathBuf,
    /// Draw what the cameras of this scene see: <image stem>.png each, with the folders of the pictures' names where
    /// two would be called the same
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
    /// Write depth too, under the same names in DIR/depth: 16-bit millimetres, 0 = none
    #[arg(long)]
    pub(crate) depth: bool,
    /// Who draws: the CPU, a graphics processor, or what is best of what this build and this machine have
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
    /// Gaussians or a point cloud, PLY
    pub(crate) file: PathBuf,
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
