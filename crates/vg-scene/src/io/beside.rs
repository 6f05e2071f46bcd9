//! Files found by a picture's name: the picture itself, its mask, its depth map.
//!
//! ```text
//! images/000.jpg    or .JPG; without an extension in the scene file: .png, .jpg or .jpeg
//! masks/000.png     or mask/; 000.png, 000.jpg.png (COLMAP), 000_mask.png, 000.mask.png; PNG, JPEG or NumPy
//! depth/000.png     or depths/; 000.png, 000.jpg.png, 000_depth.png, 000.depth.png; PNG, NumPy, PFM or EXR
//! ```
//!
//! An exact name takes precedence over one that differs in upper and lower case.

use super::files::is_there;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Extensions of pictures, which are tried if a scene file omits them.
pub(super) const PICTURES: [&str; 3] = ["png", "jpg", "jpeg"];
const MASK_FOLDERS: [&str; 2] = ["masks", "mask"];
const MASKS: [&str; 4] = ["png", "jpg", "jpeg", "npy"];
const DEPTH_FOLDERS: [&str; 2] = ["depth", "depths"];
const DEPTHS: [&str; 4] = ["png", "npy", "pfm", "exr"];

/// Looks files up in the folder of a scene. A folder is listed once, and only if an exact name does not exist.
pub(super) struct Finder {
    root: PathBuf,
    /// For each folder, the first path in order by lower-case name.
    listed: HashMap<PathBuf, HashMap<String, PathBuf>>,
}

/// A picture's name without and with its extension: `sub/000` and `sub/000.jpg`.
struct Name {
    stem: PathBuf,
    full: PathBuf,
}

impl Finder {
    /// A finder for the scene in `root`.
    pub(super) fn new(root: &Path) -> Self {
        Self { root: root.to_owned(), listed: HashMap::new() }
    }

    /// The picture that a scene file names `path`; `path` itself if it does not exist.
    pub(super) fn picture(&mut self, path: PathBuf) -> PathBuf {
        if let Some(found) = self.find(&path) {
            return found;
        }
        // NeRF's synthetic scenes omit the extension.
        let longer = match has_picture_extension(&path) {
            true => None,
            false => PICTURES.iter().find_map(|extension| self.find(&with_suffix(&path, extension))),
        };
        longer.unwrap_or(path)
    }

    /// The mask of `picture`, which the scene file refers to by one of the `relative` paths.
    pub(super) fn mask(&mut self, picture: &Path, relative: &[&Path]) -> Option<PathBuf> {
        self.companion(&MASK_FOLDERS, &MASKS, "mask", picture, relative)
    }

    /// The depth map of `picture`, which the scene file refers to by one of the `relative` paths.
    pub(super) fn depth(&mut self, picture: &Path, relative: &[&Path]) -> Option<PathBuf> {
        self.companion(&DEPTH_FOLDERS, &DEPTHS, "depth", picture, relative)
    }

    fn companion(
        &mut self,
        folders: &[&str],
        extensions: &[&str],
        suffix: &str,
        picture: &Path,
        relative: &[&Path],
    ) -> Option<PathBuf> {
        for folder in folders {
            let Some(folder) = self.folder(folder) else { continue };
            for path in relative {
                for base in Name::new(path, picture).bases(suffix) {
                    for extension in extensions {
                        let file = self.find(&folder.join(with_suffix(&base, extension)));
                        if file.is_some() {
                            return file;
                        }
                    }
                }
            }
        }
        None
    }

    /// The scene's folder of this name, in any case.
    fn folder(&mut self, name: &str) -> Option<PathBuf> {
        let exact = self.root.join(name);
        let found = if exact.is_dir() { Some(exact) } else { self.other_case(&exact) };
        found.filter(|folder| folder.is_dir())
    }

    /// The file at `path`, or the one whose own name differs from it only in case.
    fn find(&mut self, path: &Path) -> Option<PathBuf> {
        if is_there(path) {
            Some(path.to_owned())
        } else {
            self.other_case(path).filter(|file| is_there(file))
        }
    }

    fn other_case(&mut self, path: &Path) -> Option<PathBuf> {
        let (folder, name) = (path.parent()?, path.file_name()?.to_string_lossy().to_lowercase());
        if !self.listed.contains_key(folder) {
            self.listed.insert(folder.to_owned(), names_in(folder));
        }
        self.listed[folder].get(&name).cloned()
    }
}

/// Paths in `folder` by lower-case name.
fn names_in(folder: &Path) -> HashMap<String, PathBuf> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(here).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name()).collect();
    names.sort();
    let mut by_spelling = HashMap::new();
    for name in names {
        by_spelling.entry(name.to_string_lossy().to_lowercase()).or_insert_with(|| folder.join(&name));
    }
    by_spelling
}

impl Name {
    /// The name of the file `picture` in the folder of `relative`.
    fn new(relative: &Path, picture: &Path) -> Self {
        let full = relative.with_file_name(picture.file_name().unwrap_or_default());
        let stem = if has_picture_extension(&full) { full.with_extension("") } else { full.clone() };
        Self { stem, full }
    }

    /// Names to try, without their last extension, in order.
    fn bases(&self, suffix: &str) -> [PathBuf; 4] {
        let joined = |mark: &str| {
            let mut longer = self.stem.clone().into_os_string();
            longer.push(format!("{mark}{suffix}"));
            PathBuf::from(longer)
        };
        [self.stem.clone(), self.full.clone(), joined("_"), joined(".")]
    }
}

/// All names that [`Finder::mask`] tries for a picture, for messages:
/// `masks/{000,000.jpg,000_mask,000.mask}.{png,jpg,jpeg,npy}, and the same in mask/`.
pub(super) fn mask_names(picture: &Path, relative: &Path) -> String {
    let bases = Name::new(relative, picture).bases("mask");
    let mut bases: Vec<String> = bases.iter().map(|base| base.display().to_string()).collect();
    bases.dedup();
    let [first, second] = MASK_FOLDERS;
    format!("{first}/{{{}}}.{{{}}}, and the same in {second}/", bases.join(","), MASKS.join(","))
}

/// Whether a file name has the extension of a picture.
pub(super) fn has_picture_extension(path: &Path) -> bool {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    extension.is_some_and(|e| PICTURES.contains(&e.as_str()))
}

fn with_suffix(path: &Path, extension: &str) -> PathBuf {
    let mut longer = path.as_os_str().to_owned();
    longer.push(format!(".{extension}"));
    PathBuf::from(longer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::depth::DepthFormat;
    use std::fs;

    #[test]
    fn every_documented_name_is_found_in_the_documented_order() {
        let root = tempfile::tempdir().unwrap();
        let relative = Path::new("sub/a.jpg");
        let picture = root.path().join("images/sub/a.jpg");
        let order = ["a.png", "a.jpg.png", "a_mask.JPG", "a.mask.npy"];
        for folder in ["masks/sub", "Mask/sub"] {
            fs::create_dir_all(root.path().join(folder)).unwrap();
        }
        let mut files: Vec<PathBuf> = ["masks/sub", "Mask/sub"]
            .iter()
            .flat_map(|folder| order.map(|name| root.path().join(folder).join(name)))
            .collect();
        files.iter().for_each(|file| fs::write(file, "").unwrap());
        while !files.is_empty() {
            assert_eq!(Finder::new(root.path()).mask(&picture, &[relative]).as_ref(), files.first());
            fs::remove_file(files.remove(0)).unwrap();
        }
        assert_eq!(Finder::new(root.path()).mask(&picture, &[relative]), None);
        assert_eq!(
            mask_names(&picture, relative),
            "masks/{sub/a,sub/a.jpg,sub/a_mask,sub/a.mask}.{png,jpg,jpeg,npy}, and the same in mask/"
        );
    }

    #[test]
    fn every_extension_that_is_searched_for_is_a_depth_format() {
        for extension in DEPTHS {
            DepthFormat::from_path(&with_suffix(Path::new("a"), extension)).unwrap();
        }
    }
}
