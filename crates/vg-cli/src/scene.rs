//! Opens the scenes that are given on the command line.

use crate::args::FrameArgs;
use crate::job::{self, Result};
use std::path::{Path, PathBuf};
use vg::io::{SceneFiles, SceneIndex, SceneOptions};
use vg::progress::Threads;

/// Options of the scene without names of views.
pub(crate) fn options(frame: &FrameArgs, depth_scale: Option<f64>, load_depth: bool) -> Result<SceneOptions> {
    let read = |path: &PathBuf| vg::io::read_vehicle_from_world(path);
    let vehicle_from_world = frame.vehicle_from_world.as_ref().map(read).transpose()?;
    Ok(SceneOptions { vehicle_from_world, depth_scale, load_depth, ..SceneOptions::default() })
}

/// Reads the views with these names.
pub(crate) fn open(
    path: &Path,
    views: &[String],
    options: &SceneOptions,
    threads: &Threads,
) -> Result<SceneFiles> {
    load(vg::io::list_scene(path, &named(Some(views), options))?, threads)
}

/// The options with these views.
pub(crate) fn named(views: Option<&[String]>, options: &SceneOptions) -> SceneOptions {
    SceneOptions { views: views.map(<[String]>::to_vec), ..options.clone() }
}

/// Name of the scene: its folder's name.
pub(crate) fn name(scene: &Path) -> String {
    let absolute = std::fs::canonicalize(scene).unwrap_or_else(|_| scene.to_owned());
    let folder = if absolute.is_file() { absolute.parent() } else { Some(absolute.as_path()) };
    folder.and_then(Path::file_name).unwrap_or(scene.as_os_str()).to_string_lossy().into_owned()
}

/// Files of a scene's views, which no result may replace.
pub(crate) fn view_files(index: &SceneIndex) -> Vec<PathBuf> {
    let views = index.views.iter().flat_map(|view| {
        let depth = view.depth.as_ref().map(|d| d.path.clone());
        [Some(view.image.clone()), view.mask.clone(), depth].into_iter().flatten()
    });
    views.chain([index.source.clone()]).collect()
}

/// Reads the pixels of listed views and records warnings.
pub(crate) fn load(index: SceneIndex, threads: &Threads) -> Result<SceneFiles> {
    let files = threads.run(|| index.load())?;
    files.notes.iter().for_each(|note| job::note(note));
    Ok(files)
}
