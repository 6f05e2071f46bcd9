//! Listing of a scene on disk before any pixel is read: names of pictures, cameras, and files.
//!
//! Poses are those of the files, `world_from_camera`; [`super::scene`] decides whether that world is the vehicle's
//! frame.

use super::beside::{Finder, mask_names};
use super::files::{is_there, read_limited};
use super::scene::SceneFormat;
use super::{colmap, image, json, realcar, transforms};
use crate::VehicleBox;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use vg_geometry::{Camera, Error, Result};

/// A scene's views in the world of its files.
#[derive(Clone, Debug)]
pub(super) struct Listing {
    /// The file or folder that holds the poses.
    pub(super) source: PathBuf,
    /// Views in the file's order; COLMAP's images by name.
    pub(super) views: Vec<ListedView>,
    /// Field and reason, if the world of the poses is not the vehicle's frame.
    pub(super) not_vehicle_frame: Option<(&'static str, &'static str)>,
    /// The folder of a COLMAP model, which may have sparse points.
    pub(super) sparse_model: Option<PathBuf>,
    /// The vehicle's box in the world of the poses.
    pub(super) vehicle_box: Option<VehicleBox>,
    /// Notes on choices among several candidates, a sentence each.
    pub(super) notes: Vec<String>,
}

/// One view of a [`Listing`].
#[derive(Clone, Debug)]
pub(super) struct ListedView {
    pub(super) name: String,
    /// The path in the scene file, verbatim.
    pub(super) path_in_file: String,
    /// Camera whose `vehicle_from_camera` still holds `world_from_camera`.
    pub(super) camera: Camera,
    pub(super) image: PathBuf,
    pub(super) mask: Option<PathBuf>,
    pub(super) depth: Option<DepthFile>,
    /// All names that were tried for the mask, for messages.
    pub(super) mask_names: String,
}

/// A depth file and the unit of its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthFile {
    /// PNG, NPY, PFM or EXR.
    pub path: PathBuf,
    /// Metres per number in the file, if the scene or the caller gives it; else integers are millimetres, floats
    /// metres.
    pub unit: Option<f64>,
}

/// Lists the scene at `path`: a `transforms.json`, a folder with one, or else a COLMAP folder; only one of `format` if
/// that is given.
pub(super) fn list(path: &Path, format: Option<SceneFormat>) -> Result<Listing> {
    let meta = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    if meta.is_file() {
        if format == Some(SceneFormat::Colmap) {
            return Err(Error::format(path, "scene", "a file; allowed: a folder with a COLMAP model"));
        }
        if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("json")) {
            return Err(Error::format(path, "scene", NO_SCENE));
        }
        return list_transforms(path);
    }
    let transforms = path.join("transforms.json");
    if is_there(&transforms) && format != Some(SceneFormat::Colmap) {
        return list_transforms(&transforms);
    }
    match find_colmap(path) {
        Some(found) if format != Some(SceneFormat::Transforms) => list_colmap(path, found),
        _ => Err(Error::format(path, "scene", NO_SCENE)),
    }
}

/// The COLMAP model at or below `path`.
pub(super) fn find_colmap(path: &Path) -> Option<colmap::Found> {
    colmap::find(path).or_else(|| realcar::find_model(path))
}

const NO_SCENE: &str = "neither a transforms.json, nor a folder with one, nor a folder with a COLMAP model (cameras.bin and images.bin, or .txt, in sparse/0 or another number, in sparse, in the folder itself, or in colmap_processed/pcd_rescale as in 3DRealCar)";

fn list_transforms(path: &Path) -> Result<Listing> {
    let file = transforms::parse(&read_limited(path, json::MAX_FILE)?, path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut finder = Finder::new(folder);
    let common = common_folder(&file.frames);
    // A file that lists depth for some frames has none for the others.
    let lists_depth = file.frames.iter().any(|frame| frame.depth_file_path.is_some());
    let mut views = Vec::with_capacity(file.frames.len());
    for (i, frame) in file.frames.iter().enumerate() {
        let field = format!("frames[{i}]");
        let image = finder.picture(folder.join(&frame.file_path));
        let size = match frame.size {
            Some(size) => size,
            None => image::size(&image)?,
        };
        let in_images = frame.file_path.strip_prefix("images").unwrap_or(&frame.file_path);
        let in_common = common.map_or(in_images, |c| frame.file_path.strip_prefix(c).unwrap_or(in_images));
        let relative = [in_images, &frame.file_path, in_common];
        let mask = match &frame.mask_path {
            Some(mask) => Some(folder.join(mask)),
            None => finder.mask(&image, &relative),
        };
        let depth = match &frame.depth_file_path {
            Some(depth) => file.loads_depth.then(|| folder.join(depth)),
            None if lists_depth || !file.loads_depth => None,
            None => finder.depth(&image, &relative),
        };
        views.push(ListedView {
            name: in_images.to_string_lossy().into_owned(),
            path_in_file: frame.file_path.to_string_lossy().into_owned(),
            camera: frame.camera(size, path, &field)?,
            mask_names: mask_names(&image, in_common),
            image,
            mask,
            depth: depth.map(|path| DepthFile { path, unit: file.depth_unit }),
        });
    }
    refuse_repeated(path, "file_path", &views)?;
    let not_vehicle_frame = file.moved_by.map(|key| {
        (key, "set, so the poses were moved and may not be in the vehicle's frame. Pass the similarity from these poses to the vehicle's frame (--vehicle-from-world FILE), or drop the key if they are in the vehicle's frame")
    });
    Ok(Listing {
        source: path.to_owned(),
        views,
        not_vehicle_frame,
        sparse_model: None,
        vehicle_box: file.vehicle_box,
        notes: Vec::new(),
    })
}

/// First component of the path of all pictures of a `transforms.json`, if they share it.
fn common_folder(frames: &[transforms::Frame]) -> Option<&OsStr> {
    fn first(frame: &transforms::Frame) -> Option<&OsStr> {
        let mut names = frame.file_path.iter();
        names.next().filter(|_| names.next().is_some())
    }
    let folder = first(frames.first()?)?;
    frames.iter().all(|frame| first(frame) == Some(folder)).then_some(folder)
}

/// Lists the COLMAP model `found` at or below `path`.
fn list_colmap(path: &Path, found: colmap::Found) -> Result<Listing> {
    let model = found.folder;
    let root = colmap_root(path, &model);
    let read = colmap::read_model(&model)?;
    let mut finder = Finder::new(&root);
    let views = read.images.iter().map(|image| {
        let name = image.name.to_string_lossy().into_owned();
        let camera = read.camera_of(image)?;
        let picture = finder.picture(realcar::find_image(&root, &image.name));
        let mask = finder.mask(&picture, &[&image.name]).or_else(|| realcar::find_mask(&root, &image.name));
        let depth = finder.depth(&picture, &[&image.name]).map(|path| DepthFile { path, unit: None });
        let mask_names = mask_names(&picture, &image.name);
        Ok(ListedView { path_in_file: name.clone(), name, camera, image: picture, mask, depth, mask_names })
    });
    let reason = "missing: the position, rotation and scale of a COLMAP model are arbitrary, so it is not in the vehicle's frame. Pass the similarity from the model to the vehicle's frame (--vehicle-from-world FILE)";
    Ok(Listing {
        views: views.collect::<Result<_>>()?,
        not_vehicle_frame: Some(("vehicle_from_world", reason)),
        sparse_model: Some(model.clone()),
        source: model,
        notes: found.note.into_iter().collect(),
        vehicle_box: None,
    })
}

/// The folder that contains `images/`: the model's own or one above it, else the given one.
fn colmap_root(path: &Path, model: &Path) -> PathBuf {
    // A relative path such as "." has all its ancestors only as an absolute path.
    let absolute = std::path::absolute(model).unwrap_or_else(|_| model.to_owned());
    let root = absolute.ancestors().take(3).find(|folder| folder.join("images").is_dir());
    root.map_or_else(|| path.to_owned(), Path::to_owned)
}

/// Returns an error if a picture is listed twice: the two views would have the same name.
pub(super) fn refuse_repeated(path: &Path, field: &str, views: &[ListedView]) -> Result<()> {
    let mut seen = std::collections::HashMap::new();
    for (i, view) in views.iter().enumerate() {
        if let Some(first) = seen.insert(view.image.as_path(), i) {
            let reason = format!("{:?} again, after entry {first}; allowed: once", view.path_in_file);
            return Err(Error::format(path, format!("frames[{i}].{field}"), reason));
        }
    }
    Ok(())
}
