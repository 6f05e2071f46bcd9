//! Opens a scene on disk: first a listing of names, cameras and files, then the pixels of the selected views.

use super::files::in_file;
use super::image::ExifPixels;
use super::listing::{self, ListedView, Listing};
use super::{colmap, load, select};
use crate::io::ply::ColoredPoints;
use crate::{Scene, VehicleBox};
use glam::DVec3;
use std::path::{Path, PathBuf};
use vg_geometry::progress::{UNWATCHED, Watch};
use vg_geometry::{Camera, Error, Result, Similarity};

pub use super::listing::DepthFile;

/// Selection of a scene's views, and information that its files lack.
#[derive(Clone, Debug)]
pub struct SceneOptions {
    /// Views to open, in this order, each by path, file name, or file name without extension; `None` means all.
    pub views: Option<Vec<String>>,
    /// Similarity from the world of the poses to the vehicle's frame. A COLMAP model needs one; without it, a
    /// `transforms.json` is assumed to be in the vehicle's frame.
    pub vehicle_from_world: Option<Similarity>,
    /// Metres per number in the depth files, which overrides the scene's unit. Without either, integers are
    /// millimetres and floats metres.
    pub depth_scale: Option<f64>,
    /// Whether existing depth files are read.
    pub load_depth: bool,
    /// The only format to search for; `None` means a `transforms.json`, or else a COLMAP model.
    pub format: Option<SceneFormat>,
}

/// File format of a scene's cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneFormat {
    /// nerfstudio's `transforms.json`.
    Transforms,
    /// A COLMAP model.
    Colmap,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { views: None, vehicle_from_world: None, depth_scale: None, load_depth: true, format: None }
    }
}

/// A scene's views before their pixels are read. Pictures need not exist, unless the scene file omits their
/// size.
#[derive(Clone, Debug)]
pub struct SceneIndex {
    /// The `transforms.json` or the COLMAP model's folder.
    pub source: PathBuf,
    /// Views in the order of the selection; else in the order of the `transforms.json`, or by name.
    pub views: Vec<SceneView>,
    /// The vehicle's box in its own frame, if the scene file contains it.
    pub vehicle_box: Option<VehicleBox>,
    /// Notes on choices among several candidates, a sentence each.
    pub notes: Vec<String>,
    sparse_model: Option<PathBuf>,
    vehicle_from_world: Option<Similarity>,
}

/// One view of a [`SceneIndex`].
#[derive(Clone, Debug)]
pub struct SceneView {
    /// The picture's path below its images folder.
    pub name: String,
    /// Camera with its pose in the vehicle's frame.
    pub camera: Camera,
    /// The picture.
    pub image: PathBuf,
    /// The mask's file, if it exists.
    pub mask: Option<PathBuf>,
    /// The depth map's file, if it exists.
    pub depth: Option<DepthFile>,
    /// All names that were tried for the mask, for messages.
    pub(super) mask_names: String,
}

/// A camera and its name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The picture's path below its images folder.
    pub name: String,
    /// Camera with its pose in the vehicle's frame.
    pub camera: Camera,
}

/// A scene with its pixels.
#[derive(Clone, Debug)]
pub struct SceneFiles {
    /// The source of each view.
    pub index: SceneIndex,
    /// The views, in the order of the index.
    pub scene: Scene,
    /// Notes on legal input that looks like a mistake, one sentence each.
    pub notes: Vec<String>,
}

/// Lists the views of the scene at `path`: a `transforms.json`, a folder with one, or a COLMAP folder.
pub fn list_scene(path: &Path, options: &SceneOptions) -> Result<SceneIndex> {
    if let Some(unit) = options.depth_scale
        && !(unit > 0.0 && unit.is_finite())
    {
        return Err(Error::argument("depth_scale", unit.to_string(), "metres per unit, above 0"));
    }
    let Listing { source, mut views, not_vehicle_frame, sparse_model, vehicle_box, notes } =
        listing::list(path, options.format)?;
    if let (None, Some((field, reason))) = (&options.vehicle_from_world, not_vehicle_frame) {
        return Err(Error::format(&source, field, reason));
    }
    if let Some(names) = &options.views {
        views = select::select(&views, names)?.into_iter().map(|i| views[i].clone()).collect();
    }
    let views = views.into_iter().map(|view| {
        let mut camera = view.camera;
        if let Some(vehicle_from_world) = &options.vehicle_from_world {
            camera.vehicle_from_camera = vehicle_from_world.transform_pose(&camera.vehicle_from_camera);
        }
        camera.validate(&view.name)?;
        let depth = view.depth.filter(|_| options.load_depth);
        let depth = depth.map(|d| DepthFile { unit: options.depth_scale.or(d.unit), ..d });
        let ListedView { name, image, mask, mask_names, .. } = view;
        Ok(SceneView { name, camera, image, mask, depth, mask_names })
    });
    let views = views.collect::<Result<_>>()?;
    let vehicle_from_world = options.vehicle_from_world;
    let vehicle_box = match (vehicle_box, &vehicle_from_world) {
        (Some(known), Some(moved)) => {
            Some(known.moved("vehicle_box", moved).map_err(|e| in_file(&source, e))?)
        }
        (known, _) => known,
    };
    Ok(SceneIndex { source, views, vehicle_box, notes, sparse_model, vehicle_from_world })
}

/// Lists the scene at `path` and reads the pictures, masks and depth maps of the selected views.
pub fn open_scene(path: &Path, options: &SceneOptions) -> Result<SceneFiles> {
    list_scene(path, options)?.load()
}

/// [`open_scene`] under `watch`, which reports progress after every view and can stop before the next.
pub fn open_scene_watched(path: &Path, options: &SceneOptions, watch: &Watch) -> Result<SceneFiles> {
    list_scene(path, options)?.load_watched(watch)
}

impl SceneIndex {
    /// The cameras alone.
    pub fn cameras(&self) -> Vec<NamedCamera> {
        self.views.iter().map(|v| NamedCamera { name: v.name.clone(), camera: v.camera }).collect()
    }

    /// The sparse points of a COLMAP model, transformed to the vehicle's frame, metres; `None` if there are none.
    /// They include ground and surroundings.
    pub fn sparse_points(&self) -> Result<Option<ColoredPoints>> {
        let Some(model) = &self.sparse_model else { return Ok(None) };
        let Some(points) = colmap::read_points(model)? else { return Ok(None) };
        let moved = |&p: &[f64; 3]| {
            let p = DVec3::from_array(p);
            self.vehicle_from_world.map_or(p, |s| s.transform_point(p)).as_vec3().to_array()
        };
        Ok(Some((points.positions.iter().map(moved).collect(), points.colors)))
    }

    /// Reads the pixels of all views listed.
    pub fn load(self) -> Result<SceneFiles> {
        self.load_watched(&UNWATCHED)
    }

    fn load_watched(self, watch: &Watch) -> Result<SceneFiles> {
        let (mut scene, found) = load::load(&self.views, self.exif(), watch)?;
        scene.vehicle_box = self.vehicle_box;
        let notes = self.notes.iter().cloned().chain(found).collect();
        Ok(SceneFiles { index: self, scene, notes })
    }

    /// The pixel order to which the cameras refer.
    fn exif(&self) -> ExifPixels {
        if self.sparse_model.is_some() { ExifPixels::Stored } else { ExifPixels::BySize }
    }
}
