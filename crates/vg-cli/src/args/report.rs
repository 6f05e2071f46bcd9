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
    /// As for `eval`: the inputs are reconstructed and the test views judged; split.json if there is one here or in
    /// the scene's folder
    #[arg(long, value_name = "FILE", conflicts_with = "views")]
    pub(crate) split: Option<PathBuf>,
    /// This key of the split; the first if not given
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
    /// The page
    #[arg(short, long, value_name = "PAGE.html")]
    pub(crate) output: PathBuf,
}
