//! COLMAP models as their files describe them, with checks across files.

use super::{binary, text};
use crate::io::files::{in_file, is_there, open_regular, read_limited, relative_inside};
use std::collections::{HashMap, HashSet};
use std::io::Read;
use std::path::{Path, PathBuf};
use vg_geometry::camera::MAX_SIDE;
use vg_geometry::frame::pose_from_colmap;
use vg_geometry::{Camera, CameraModel, Error, Pose, Result};

/// Longest model file that is read; an image with ten thousand features takes 240 kB.
const MAX_FILE: u64 = 2 << 30;

/// Cameras and posed images of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Cameras by COLMAP's camera id; ids may have gaps.
    pub cameras: HashMap<u32, ModelCamera>,
    /// Images sorted by name; their order in the files is arbitrary.
    pub images: Vec<ModelImage>,
}

/// One camera with checked parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCamera {
    /// Camera model, one of those that are supported.
    pub model: CameraModel,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Parameters in COLMAP's order.
    pub params: Vec<f64>,
}

/// One registered image.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelImage {
    /// COLMAP's image id.
    pub id: u32,
    /// Relative path below the images folder.
    pub name: PathBuf,
    /// COLMAP's camera id.
    pub camera_id: u32,
    /// Pose in the model's own gauge.
    pub world_from_camera: Pose,
}

/// The sparse points of a model, in its own gauge.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparsePoints {
    /// Positions, as many as colours.
    pub positions: Vec<[f64; 3]>,
    /// Colours, RGB.
    pub colors: Vec<[u8; 3]>,
}

/// Names of unsupported camera models, by id minus 7, for the error.
const OTHER_MODELS: [&str; 11] = [
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
    "SIMPLE_DIVISION",
    "DIVISION",
    "SIMPLE_FISHEYE",
    "FISHEYE",
    "EUCM",
    "EQUIRECTANGULAR",
];

/// The model's folder at or below `folder`: `sparse/0`, `sparse`, `folder` itself, or `0`. If there are several
/// numbered models, the one with the most images: COLMAP writes one for each part of a scene that it could not join.
pub fn find_model(folder: &Path) -> Option<PathBuf> {
    find(folder).map(|found| found.folder)
}

/// A model that was found.
pub(crate) struct Found {
    pub(crate) folder: PathBuf,
    /// Note on the choice among several models.
    pub(crate) note: Option<String>,
}

/// [`find_model`] with a note on the choice.
pub(crate) fn find(folder: &Path) -> Option<Found> {
    let plain = |folder: PathBuf| extension_of(&folder).is_some().then_some(Found { folder, note: None });
    let sparse = folder.join("sparse");
    largest(&sparse)
        .or_else(|| plain(sparse))
        .or_else(|| plain(folder.to_owned()))
        .or_else(|| largest(folder))
}

/// The model with the most images among those in numbered folders; the first if several have the most.
fn largest(folder: &Path) -> Option<Found> {
    let mut numbered: Vec<(u32, PathBuf)> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            Some((path.file_name()?.to_str()?.parse().ok()?, path))
        })
        .filter(|(_, path)| extension_of(path).is_some())
        .collect();
    numbered.sort();
    if numbered.len() < 2 {
        return numbered.pop().map(|(_, folder)| Found { folder, note: None });
    }
    let mut models: Vec<(usize, PathBuf)> =
        numbered.into_iter().map(|(_, path)| (image_count(&path), path)).collect();
    models.sort_by_key(|(images, _)| std::cmp::Reverse(*images));
    let folder = models[0].1.clone();
    let others: Vec<String> =
        models[1..].iter().map(|(images, path)| format!("{} has {images}", path.display())).collect();
    let note = format!(
        "{}: chosen among {} COLMAP models, with {} images; {}",
        folder.display(),
        models.len(),
        models[0].0,
        others.join(", ")
    );
    Some(Found { folder, note: Some(note) })
}

/// The number of images of a model; 0 if it cannot be read, which is reported when the model is read.
fn image_count(folder: &Path) -> usize {
    let binary = folder.join("images.bin");
    let counted = match extension_of(folder) {
        Some("bin") => open_regular(&binary).ok().and_then(|mut file| {
            let mut count = [0; 8];
            file.read_exact(&mut count).ok()?;
            usize::try_from(u64::from_le_bytes(count)).ok()
        }),
        _ => {
            let path = folder.join("images.txt");
            let bytes = read_limited(&path, MAX_FILE).ok();
            bytes.and_then(|bytes| text::images_from_text(&bytes, &path).ok()).map(|images| images.len())
        }
    };
    counted.unwrap_or(0)
}

/// Reads `cameras` and `images` of the model in `folder`; binary files take precedence over text.
pub fn read_model(folder: &Path) -> Result<Model> {
    let Some(extension) = extension_of(folder) else {
        let reason = "missing; allowed: cameras.bin and images.bin, or cameras.txt and images.txt";
        return Err(Error::format(folder, "cameras, images", reason));
    };
    let (cameras_path, images_path) =
        (folder.join(format!("cameras.{extension}")), folder.join(format!("images.{extension}")));
    let (cameras, images) = (read_limited(&cameras_path, MAX_FILE)?, read_limited(&images_path, MAX_FILE)?);
    let (cameras, images) = if extension == "bin" {
        (
            binary::cameras_from_binary(&cameras, &cameras_path)?,
            binary::images_from_binary(&images, &images_path)?,
        )
    } else {
        (text::cameras_from_text(&cameras, &cameras_path)?, text::images_from_text(&images, &images_path)?)
    };
    Model::new(cameras, images, &images_path)
}

/// Reads the sparse points of the model in `folder`; `None` if there is no such file.
pub fn read_points(folder: &Path) -> Result<Option<SparsePoints>> {
    let (binary, text) = (folder.join("points3D.bin"), folder.join("points3D.txt"));
    if is_there(&binary) {
        binary::points_from_binary(&read_limited(&binary, MAX_FILE)?, &binary).map(Some)
    } else if is_there(&text) {
        text::points_from_text(&read_limited(&text, MAX_FILE)?, &text).map(Some)
    } else {
        Ok(None)
    }
}

fn extension_of(folder: &Path) -> Option<&'static str> {
    ["bin", "txt"].into_iter().find(|extension| {
        ["cameras", "images"].iter().all(|file| is_there(&folder.join(format!("{file}.{extension}"))))
    })
}

impl Model {
    /// A model whose images refer to existing cameras and have unique names; `path` is the images file, for messages.
    pub fn new(cameras: HashMap<u32, ModelCamera>, mut images: Vec<ModelImage>, path: &Path) -> Result<Self> {
        if images.is_empty() {
            return Err(Error::format(path, "images", "none; allowed: at least one registered image"));
        }
        images.sort_by(|a, b| a.name.cmp(&b.name));
        let mut ids = HashSet::new();
        for (i, image) in images.iter().enumerate() {
            let field = |part: &str| format!("image {}.{part}", image.id);
            if !cameras.contains_key(&image.camera_id) {
                let reason = format!("{}; allowed: a camera of the model", image.camera_id);
                return Err(Error::format(path, field("camera_id"), reason));
            }
            if !ids.insert(image.id) {
                return Err(Error::format(path, field("id"), "used twice; allowed: once"));
            }
            if i > 0 && images[i - 1].name == image.name {
                let reason = format!("{:?}, as image {}; allowed: once", image.name, images[i - 1].id);
                return Err(Error::format(path, field("name"), reason));
            }
        }
        Ok(Self { cameras, images })
    }

    /// The camera of an image; its pose is `world_from_camera`.
    pub fn camera_of(&self, image: &ModelImage) -> Result<Camera> {
        let camera = self.cameras.get(&image.camera_id).ok_or_else(|| {
            let found = image.camera_id.to_string();
            Error::argument(format!("image {}.camera_id", image.id), found, "a camera of the model")
        })?;
        camera.posed(&format!("camera {}", image.camera_id), image.world_from_camera)
    }
}

impl ModelCamera {
    /// Camera `id`, after a check of its parameters.
    pub(super) fn new(
        id: u32,
        model: CameraModel,
        (width, height): (u64, u64),
        params: Vec<f64>,
        path: &Path,
    ) -> Result<Self> {
        let field = format!("camera {id}");
        let side = |s: u64| u32::try_from(s).unwrap_or(MAX_SIDE + 1);
        let camera = Self { model, width: side(width), height: side(height), params };
        camera.posed(&field, Pose::IDENTITY).map_err(|e| in_file(path, e))?;
        Ok(camera)
    }

    fn posed(&self, argument: &str, world_from_camera: Pose) -> Result<Camera> {
        let Self { model, width, height, params } = self;
        Camera::from_colmap(argument, *model, *width, *height, params, world_from_camera)
    }
}

impl ModelImage {
    /// Image `id`, after a check of its pose and name.
    pub(super) fn new(
        id: u32,
        qvec_wxyz: [f64; 4],
        tvec: [f64; 3],
        camera_id: u32,
        name: &[u8],
        path: &Path,
    ) -> Result<Self> {
        let field = |part: &str| format!("image {id}.{part}");
        let text = std::str::from_utf8(name).map_err(|_| {
            let reason = format!("{:?} is not UTF-8; allowed: UTF-8", String::from_utf8_lossy(name));
            Error::format(path, field("name"), reason)
        })?;
        let name = relative_inside(text).map_err(|reason| Error::format(path, field("name"), reason))?;
        let world_from_camera =
            pose_from_colmap(&field("pose"), qvec_wxyz, tvec).map_err(|e| in_file(path, e))?;
        Ok(Self { id, name, camera_id, world_from_camera })
    }
}

impl SparsePoints {
    pub(super) fn push(&mut self, id: u64, position: [f64; 3], color: [u8; 3], path: &Path) -> Result<()> {
        if !position.iter().all(|v| v.is_finite()) {
            let reason = format!("{position:?}; allowed: finite numbers");
            return Err(Error::format(path, format!("point {id}.xyz"), reason));
        }
        self.positions.push(position);
        self.colors.push(color);
        Ok(())
    }
}

/// The camera model of a number; an error with its name and the way out if it is not supported.
pub(super) fn model_from_id(model_id: i32, camera_id: u32, path: &Path) -> Result<CameraModel> {
    CameraModel::from_id(model_id).ok_or_else(|| {
        let other = usize::try_from(model_id).ok().and_then(|i| OTHER_MODELS.get(i.checked_sub(7)?));
        unknown_model(other.map_or(&format!("model {model_id}"), |name| name), camera_id, path)
    })
}

/// The camera model of a name; an error with the way out if it is not supported.
pub(super) fn model_from_name(name: &str, camera_id: u32, path: &Path) -> Result<CameraModel> {
    CameraModel::from_name(name).ok_or_else(|| unknown_model(name, camera_id, path))
}

fn unknown_model(name: &str, camera_id: u32, path: &Path) -> Error {
    let all = CameraModel::ALL.map(CameraModel::name).join(", ");
    let reason =
        format!("{name}; allowed: {all}. Undistort the pictures first, with colmap image_undistorter");
    Error::format(path, format!("camera {camera_id}.model"), reason)
}
