//! Protects inputs: a result never replaces a file that the command reads, a file of a scene, or another result.
//!
//! Files are identified by the file system, not by the spelling of their names. No result is written into a scene's
//! folders of pictures, masks, depth and COLMAP models, because a new picture there would become part of the scene.

use crate::job::{Failure, Result};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use vg::geometry::Similarity;
use vg::io::{SceneFormat, SceneOptions, colmap_format, folds_case, list_scene, resolved};

/// Folders that belong to a scene, directly in the scene's folder.
const FOLDERS: [&str; 7] =
    ["images", "masks", "mask", "depth", "sparse", "colmap_processed", "3dscanner_origin"];

/// File name of the similarity to the vehicle's frame in the documentation and in `align`.
const SIMILARITY: &str = "vehicle_from_world.json";

/// Files of COLMAP models, without their extensions.
const MODEL_FILES: [&str; 5] = ["cameras", "images", "points3D", "rigs", "frames"];

/// Files that list a scene's pictures in nerfstudio and in the NeRF synthetic scenes.
const TRANSFORMS: [&str; 4] =
    ["transforms.json", "transforms_train.json", "transforms_val.json", "transforms_test.json"];

/// Identity of a file in the file system.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Place {
    /// Device and inode of a file or folder that exists.
    #[cfg(unix)]
    Node(u64, u64),
    Path(PathBuf),
}

impl Place {
    fn from_path(path: &Path) -> Self {
        let path = resolved(path);
        #[cfg(unix)]
        if let Ok(meta) = fs::metadata(&path)
            && (meta.is_file() || meta.is_dir())
        {
            use std::os::unix::fs::MetadataExt;
            return Self::Node(meta.dev(), meta.ino());
        }
        Self::Path(path)
    }
}

/// Files and folders that no result of a command may replace.
#[derive(Clone, Debug, Default)]
pub(crate) struct Inputs {
    /// Files, each with the reason.
    files: HashMap<Place, String>,
    /// Folders, each with its name and that of its scene.
    folders: HashMap<Place, [PathBuf; 2]>,
    /// Scenes that were already added.
    roots: HashSet<Place>,
    /// Whether the command makes similarities, so that it may replace one that it does not read.
    makes_similarity: bool,
}

impl Inputs {
    /// Inputs of a command that makes the similarity to the vehicle's frame.
    pub(crate) fn for_alignment() -> Self {
        Self { makes_similarity: true, ..Self::default() }
    }

    /// Adds files that the command reads.
    pub(crate) fn files<'a, P: AsRef<Path> + ?Sized + 'a>(
        mut self,
        paths: impl IntoIterator<Item = &'a P>,
    ) -> Self {
        let why = || "is an input of this command".to_owned();
        self.files.extend(paths.into_iter().map(|path| (Place::from_path(path.as_ref()), why())));
        self
    }

    /// Adds all files of the scene at `path`, whether the command uses them or not.
    pub(crate) fn scene(mut self, path: &Path) -> Self {
        let folder = if path.is_dir() { path } else { path.parent().unwrap_or(path) };
        let folder = resolved(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        self.add_root(&folder);
        if path.is_file() {
            self.add_transforms(path, &folder);
        }
        // A COLMAP model may be given by its own folder, two levels below that of the scene.
        for above in folder.ancestors().skip(1).take(2) {
            if above.join("images").is_dir() && colmap_format(above).is_some() {
                self.add_root(above);
            }
        }
        self
    }

    fn add_root(&mut self, root: &Path) {
        if !self.roots.insert(Place::from_path(root)) {
            return;
        }
        for folder in FOLDERS.map(|name| root.join(name)).into_iter().filter(|folder| folder.is_dir()) {
            self.folders.insert(Place::from_path(&folder), [folder.clone(), root.to_owned()]);
            self.add_below(&folder, root);
        }
        for entry in fs::read_dir(root).into_iter().flatten().flatten() {
            let path = entry.path();
            let (name, stem) = (entry.file_name(), path.file_stem().unwrap_or_default());
            let is_similarity = name == SIMILARITY && !self.makes_similarity;
            if name == "split.json" || is_similarity || MODEL_FILES.iter().any(|file| stem == *file) {
                self.add_scene_file(&path, root);
            }
        }
        for path in TRANSFORMS.map(|name| root.join(name)).into_iter().filter(|path| path.is_file()) {
            self.add_transforms(&path, root);
        }
    }

    fn add_scene_file(&mut self, path: &Path, root: &Path) {
        if path.is_file() {
            self.files.insert(Place::from_path(path), format!("belongs to the scene {}", root.display()));
        }
    }

    /// Adds the files in a folder and its subfolders, with the targets of links.
    fn add_below(&mut self, folder: &Path, root: &Path) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => self.add_below(&entry.path(), root),
                _ => self.add_scene_file(&entry.path(), root),
            }
        }
    }

    /// Adds the file and all files that it lists. Errors in it are left to the command.
    fn add_transforms(&mut self, path: &Path, root: &Path) {
        self.add_scene_file(path, root);
        let options = SceneOptions {
            vehicle_from_world: Some(Similarity::IDENTITY),
            format: Some(SceneFormat::Transforms),
            ..SceneOptions::default()
        };
        let index = list_scene(path, &options).ok();
        for view in index.iter().flat_map(|index| &index.views) {
            let depth = view.depth.as_ref().map(|depth| &depth.path);
            for file in [Some(&view.image), view.mask.as_ref(), depth].into_iter().flatten() {
                self.add_scene_file(file, root);
            }
        }
    }
}

/// Refuses results that would replace inputs or each other, and results in folders of a scene, even of a scene that the
/// command does not name.
pub(crate) fn refuse_clashes(results: &[PathBuf], inputs: &Inputs) -> Result<()> {
    let (to_output, results): (Vec<&PathBuf>, Vec<&PathBuf>) =
        results.iter().partition(|path| is_standard_output(path));
    if to_output.len() > 1 {
        return Err(Failure::job(format!(
            "{} results would go to standard output; allowed: one",
            to_output.len()
        )));
    }
    let places: Vec<PathBuf> = results.iter().map(|path| resolved(path)).collect();
    let folders: BTreeSet<&Path> = places.iter().filter_map(|place| place.parent()).collect();
    let around: BTreeSet<&Path> = folders.iter().flat_map(|folder| folder.ancestors()).collect();
    let mut inputs = inputs.clone();
    for folder in around.into_iter().filter(|folder| is_scene(folder)) {
        inputs.add_root(folder);
    }
    for result in &results {
        if let Some(why) = inputs.files.get(&Place::from_path(result)) {
            return Err(Failure::job(format!(
                "{}: {why} and would be replaced; choose another name",
                result.display()
            )));
        }
    }
    for folder in folders {
        let taken = folder.ancestors().find_map(|folder| inputs.folders.get(&Place::from_path(folder)));
        if let Some([taken, scene]) = taken {
            return Err(Failure::job(format!(
                "{}: a result here would become part of the scene {}, whose files are in {}; choose another folder",
                folder.display(),
                scene.display(),
                taken.display()
            )));
        }
    }
    refuse_repeated(&results, &places)
}

/// Whether the folder contains a list of poses.
fn is_scene(folder: &Path) -> bool {
    TRANSFORMS.iter().any(|name| folder.join(name).is_file()) || colmap_format(folder).is_some()
}

/// Refuses two results with one name; `places` are the results' absolute paths.
fn refuse_repeated(results: &[&PathBuf], places: &[PathBuf]) -> Result<()> {
    let mut seen = HashMap::new();
    let mut in_lower_case = HashMap::new();
    let twice = |first: usize, i: usize| {
        Err(Failure::job(format!(
            "{}: two results (number {} and number {}) would have this name; choose two names",
            results[i].display(),
            first + 1,
            i + 1
        )))
    };
    for (i, place) in places.iter().enumerate() {
        if let Some(first) = seen.insert(Place::from_path(place), i) {
            return twice(first, i);
        }
        let lower = place.to_string_lossy().to_lowercase();
        if let Some(first) = in_lower_case.insert(lower, i)
            && place.ancestors().skip(1).find(|folder| folder.is_dir()).is_some_and(folds_case)
        {
            return twice(first, i);
        }
    }
    Ok(())
}

/// Whether this name is standard output: `-`, or the system's name for it.
pub(crate) fn is_standard_output(path: &Path) -> bool {
    let names = ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
    names.iter().any(|name| path.as_os_str() == *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(results: &[&str], inputs: &Inputs, at: &Path) -> Option<String> {
        let results: Vec<PathBuf> = results.iter().map(|name| at.join(name)).collect();
        refuse_clashes(&results, inputs).err().map(|failure| failure.message)
    }

    #[test]
    fn a_new_file_is_one_file_in_every_spelling() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        fs::create_dir_all(at.join("x/y")).unwrap();
        let none = Inputs::default();
        for other in ["./a.ply", "x/../a.ply", "x/y/../../a.ply", "new/../a.ply"] {
            let message = refused(&["a.ply", other], &none, at).unwrap();
            assert!(message.contains("two results (number 1 and number 2)"), "{message}");
        }
        assert_eq!(refused(&["a.ply", "x/a.ply", "b.ply", "A.ply"], &none, at), None);
    }

    #[cfg(unix)]
    #[test]
    fn links_of_both_kinds_are_the_file_they_lead_to() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        fs::write(at.join("photo.png"), "p").unwrap();
        fs::hard_link(at.join("photo.png"), at.join("hard.png")).unwrap();
        symlink("photo.png", at.join("soft.png")).unwrap();
        symlink("new.ply", at.join("dangling.ply")).unwrap();
        symlink(".", at.join("here")).unwrap();
        let inputs = Inputs::default().files([&at.join("photo.png")]);
        for name in ["photo.png", "hard.png", "soft.png", "here/photo.png"] {
            let message = refused(&[name], &inputs, at).unwrap();
            assert!(message.contains("is an input of this command and would be replaced"), "{message}");
        }
        for other in ["dangling.ply", "here/new.ply"] {
            assert!(refused(&["new.ply", other], &inputs, at).unwrap().contains("two results"));
        }
    }

    #[test]
    fn a_scenes_folders_accept_no_results_even_if_the_scene_is_not_named() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        for folder in ["s/images/left", "s/masks", "s/sparse/0", "plain/images"] {
            fs::create_dir_all(at.join(folder)).unwrap();
        }
        for file in ["s/transforms.json", "s/split.json", "s/images/left/0.jpg", "s/sparse/0/images.bin"] {
            fs::write(at.join(file), "{}").unwrap();
        }
        let (named, unnamed) = (Inputs::default().scene(&at.join("s")), Inputs::default());
        for inputs in [&named, &unnamed] {
            for file in ["s/transforms.json", "s/split.json", "s/images/left/0.jpg", "s/sparse/0/images.bin"]
            {
                let message = refused(&[file], inputs, at).unwrap();
                assert!(
                    message.contains("belongs to the scene") && message.contains("would be replaced"),
                    "{message}"
                );
            }
            for file in ["s/images/new.png", "s/images/left/deep/new.png", "s/masks/0.png"] {
                let message = refused(&[file], inputs, at).unwrap();
                assert!(message.contains("choose another folder"), "{message}");
            }
            for file in ["s/model.ply", "s/out/images/0.png", "plain/images/0.png"] {
                assert_eq!(refused(&[file], inputs, at), None, "{file}");
            }
        }
    }
}
