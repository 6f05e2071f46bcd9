//! Models that other programs made, as rows of a table.

use super::split::Split;
use super::vehicles::Vehicle;
use crate::job::{Failure, Result, USAGE};
use crate::scene;
use std::path::{Path, PathBuf};
use vg::imports::{self, Up};
use vg::io::splats;
use vg::progress::Threads;
use vg::scene::Cloud;
use vg::{Gaussians, View};

/// Location of the models that one program made.
pub(crate) struct Import {
    kind: Kind,
    /// Path that may contain `{scene}` and `{split}`.
    pattern: String,
    /// Time for one model, as given by the user.
    pub(crate) seconds: Option<f64>,
}

/// Format and frame of a program's models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Depth Anything 3: a PLY for each view, in the cameras' world.
    DepthAnything3,
    /// TRELLIS: one object of unknown size and heading, -y up.
    Trellis,
    /// One object of unknown size and heading, z up.
    Object,
    /// A model in the vehicle's frame, metres.
    Vehicle,
}

impl Import {
    /// Parses `NAME: KIND PATH [seconds=S]`.
    pub(crate) fn read(text: &str) -> Result<(String, Self)> {
        let wrong = |what: &str| Failure {
            message: format!(
                "--import \"{text}\": {what}; expected \"NAME: KIND PATH [seconds=S]\" with KIND da3, trellis, object \
                 or vehicle"
            ),
            code: USAGE,
        };
        let (name, rest) = text.split_once(':').ok_or_else(|| wrong("found no colon after a name"))?;
        let (kind, rest) =
            rest.trim().split_once(char::is_whitespace).ok_or_else(|| wrong("found no path"))?;
        let kind = match kind {
            "da3" => Kind::DepthAnything3,
            "trellis" => Kind::Trellis,
            "object" => Kind::Object,
            "vehicle" => Kind::Vehicle,
            _ => return Err(wrong("unknown KIND")),
        };
        let rest = rest.trim();
        let (pattern, seconds) = match rest.rsplit_once("seconds=") {
            Some((pattern, seconds)) => {
                let seconds = seconds.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite());
                (pattern.trim(), Some(seconds.ok_or_else(|| wrong("seconds is not a number above 0"))?))
            }
            None => (rest, None),
        };
        if pattern.is_empty() {
            return Err(wrong("found no path"));
        }
        Ok((name.trim().to_owned(), Self { kind, pattern: pattern.to_owned(), seconds }))
    }

    pub(crate) fn kind(&self) -> Kind {
        self.kind
    }

    fn path(&self, scene: &str, key: &str) -> PathBuf {
        PathBuf::from(self.pattern.replace("{scene}", scene).replace("{split}", key))
    }

    /// The files of a split's model, including its cameras.
    pub(crate) fn files(&self, scene: &str, key: &str) -> Vec<PathBuf> {
        let path = self.path(scene, key);
        match std::fs::read_dir(&path) {
            Ok(entries) => entries.flatten().map(|entry| entry.path()).collect(),
            Err(_) => vec![path.with_extension("cameras.json"), path],
        }
    }

    /// The model of a split in the vehicle's frame.
    pub(crate) fn model(
        &self,
        vehicle: &Vehicle,
        key: &str,
        split: &Split,
        scan: Option<&Cloud>,
        threads: &Threads,
    ) -> Result<Gaussians> {
        let path = self.path(&vehicle.name, key);
        if self.kind == Kind::Vehicle {
            return read(&path);
        }
        let views = scene::open(&vehicle.scene, &split.input, &vehicle.options(None), threads)?.scene.views;
        if self.kind == Kind::DepthAnything3 {
            return threads.run(|| read_views(&path, &views, vehicle));
        }
        let scan = scan.ok_or_else(|| {
            Failure::job("the model has no metric frame and must be fitted to a scan: give --scan P.ply")
        })?;
        let up = if self.kind == Kind::Trellis { Up::MinusY } else { Up::Z };
        let object = read(&path)?;
        let placed = threads.run(|| imports::place_object(&object, up, scan, &views))?;
        Ok(placed.gaussians)
    }
}

/// Reads a folder with a PLY for each view, or one PLY for all, in the world of the scene's poses, or of the camera
/// centres in the cameras file next to them.
fn read_views(path: &Path, views: &[View], vehicle: &Vehicle) -> Result<Gaussians> {
    let cameras = if path.is_dir() { path.join("cameras.json") } else { path.with_extension("cameras.json") };
    let centers = cameras.is_file().then(|| vg::io::read_known_centers(&cameras)).transpose()?;
    let parts = if path.is_dir() {
        let of = |view: &View| read(&path.join(&view.name).with_extension("ply"));
        views.iter().map(of).collect::<Result<Vec<_>>>()?
    } else {
        vec![read(path)?]
    };
    let parts = match &vehicle.vehicle_from_world {
        Some(to_vehicle) if centers.is_none() => {
            parts.iter().map(|part| part.transformed(to_vehicle)).collect::<vg::Result<Vec<_>>>()?
        }
        _ => parts,
    };
    Ok(imports::merge_views(&parts, views, centers.as_deref())?)
}

fn read(path: &Path) -> Result<Gaussians> {
    let (gaussians, _) = splats::read(path)?;
    Ok(gaussians)
}
