//! Options of `vg report`.

use super::{DepthArgs, FrameArgs, MethodArgs, StrictArgs, ViewsArgs};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub(crate) struct ReportArgs {
    /// The scene, as for `reconstruct`
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) views: ViewsArgs,
    /// Split, as for `eval`: the input views are reconstructed and the test views measured [default: split.json here or
    /// in the scene's folder, if there is one]
    #[arg(long, value_name = "FILE", conflicts_with = "views")]
    pub(crate) split: Option<PathBuf>,
    /// Key of the split [default: the first]
    #[arg(long, value_name = "KEY", conflicts_with = "views")]
    pub(crate) only: Option<String>,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    #[command(flatten)]
    pub(crate) depth: DepthArgs,
    #[command(flatten)]
    pub(crate) strict: StrictArgs,
    /// Output file of the page
    #[arg(short, long, value_name = "PAGE.html")]
    pub(crate) output: PathBuf,
}
