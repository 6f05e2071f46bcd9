//! Vehicles of a measurement: their folders, their splits, and the frame of their poses.

use super::split::{self, Split};
use crate::args::VehiclesArgs;
use crate::job::{Failure, Result};
use crate::{align, scene as scenes};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vg::align::Heading;
use vg::geometry::Similarity;
use vg::io::{FitQuality, SceneFormat, SceneOptions};
use vg::progress::Threads;

/// Files and folders of which every scene's folder has at least one.
const SCENE_ENTRIES: [&str; 8] = [
    "transforms.json",
    "images",
    "sparse",
    "colmap_processed",
    "cameras.bin",
    "cameras.txt",
    "images.bin",
    "images.txt",
];

/// A vehicle that can be measured.
pub(crate) struct Vehicle {
    pub(crate) name: String,
    /// File or folder of the scene.
    pub(crate) scene: PathBuf,
    pub(crate) splits: BTreeMap<String, Split>,
    /// From the world of the scene's poses; `None` where that already is the vehicle's frame.
    pub(crate) vehicle_from_world: Option<Similarity>,
    /// How well the scene fits the scan that it was aligned to.
    pub(crate) fit: Option<FitQuality>,
    format: Option<SceneFormat>,
}

impl Vehicle {
    /// Reads the data that a measurement needs before any picture.
    pub(crate) fn open(scene: &Path, args: &VehiclesArgs, threads: &Threads) -> Result<Self> {
        let splits = split::read(&split::find(&args.split, scene), args.only.as_deref())?;
        let mut vehicle = Self {
            name: scenes::name(scene),
            scene: scene.to_owned(),
            splits,
            vehicle_from_world: None,
            fit: None,
            format: None,
        };
        if let Some(path) = &args.frame.vehicle_from_world {
            vehicle.vehicle_from_world = Some(vg::io::read_vehicle_from_world(&split::find(path, scene))?);
        } else if let Some(named) = &args.align {
            let named = named.as_ref().map(|path| split::find(path, scene));
            let found = align::align_to_scan(scene, named.as_deref(), Heading::Auto, threads)?;
            vehicle.vehicle_from_world = Some(found.vehicle_from_world);
            vehicle.fit = Some(FitQuality { residual_m: found.residual_m, confidence: found.confidence });
            vehicle.format = vg::io::colmap_format(scene);
        }
        Ok(vehicle)
    }

    /// Options with which its scene is opened, without depth.
    pub(crate) fn options(&self, depth_scale: Option<f64>) -> SceneOptions {
        SceneOptions {
            vehicle_from_world: self.vehicle_from_world,
            depth_scale,
            load_depth: false,
            format: self.format,
            ..SceneOptions::default()
        }
    }

    /// The file or folder that holds the poses that are used.
    pub(crate) fn source(&self) -> Result<PathBuf> {
        Ok(vg::io::list_scene(&self.scene, &self.options(None))?.source)
    }

    /// Mean y of the cameras of these views, vehicle frame, metres; positive on the vehicle's left.
    pub(crate) fn side(&self, views: &[String]) -> Result<f64> {
        let options = SceneOptions { views: Some(views.to_vec()), ..self.options(None) };
        let index = vg::io::list_scene(&self.scene, &options)?;
        let sum: f64 = index.views.iter().map(|view| view.camera.center().y).sum();
        Ok(sum / index.views.len().max(1) as f64)
    }
}

/// Expands folders of scenes to the scenes in them, sorted by name.
pub(crate) fn found(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for path in named {
        match scenes_in(path)? {
            Some(scenes) => found.extend(scenes),
            None => found.push(path.clone()),
        }
    }
    Ok(found)
}

/// Scenes in the folder; `None` if it is a scene itself or contains none.
fn scenes_in(folder: &Path) -> Result<Option<Vec<PathBuf>>> {
    let is_scene = |path: &Path| SCENE_ENTRIES.iter().any(|name| path.join(name).exists());
    if !folder.is_dir() || is_scene(folder) {
        return Ok(None);
    }
    let broken = |e: std::io::Error| Failure::job(format!("{}: {e}", folder.display()));
    let mut scenes = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(broken)? {
        let path = entry.map_err(broken)?.path();
        if path.is_dir() && is_scene(&path) {
            scenes.push(path);
        }
    }
    scenes.sort();
    Ok((!scenes.is_empty()).then_some(scenes))
}
