//! The options of a reconstruction; all published measurements use `Options::default()`.

use super::cap::DEFAULT_MAX_GAUSSIANS;
use crate::refine::RefineOptions;
use crate::relight::Relight;
use crate::symmetry::SymmetryMode;
use serde::{Deserialize, Serialize};
use vg_geometry::{Error, Result};
use vg_scene::onnx::{self, Model};
use vg_scene::{Place, Scene, VehicleBox};

/// The depth source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PriorChoice {
    /// `Given` if every used view has depth, else `Shape`, the best prior that needs none. Where some views have depth,
    /// the surface of the shape prior is fitted to it as measured points.
    #[default]
    Auto,
    /// The caller's metric depth.
    Given,
    /// The visual hull of the silhouettes and their mirrored twins.
    Hull,
    /// The hull, corrected by a network that learned the shapes of vehicles.
    Shape,
    /// The network of [`Options::prior_model`].
    Onnx,
}

impl PriorChoice {
    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Given => "given",
            Self::Hull => "hull",
            Self::Shape => "shape",
            Self::Onnx => "onnx",
        }
    }
}

/// Whether the plane of symmetry and the cameras are corrected before anything else, see [`crate::calibrate`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Calibrate {
    /// They are corrected where the silhouettes do not agree and the correction makes them agree better.
    #[default]
    Auto,
    /// The caller's cameras are used unchanged.
    Off,
}

/// Work that the plan would leave out, done anyway; all `false` by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
pub struct Keep {
    /// Views whose camera another view already has.
    pub duplicate_views: bool,
    /// Pixels that another view shows at a higher resolution.
    pub overlap: bool,
    /// Pixels on the silhouette's edge.
    pub silhouette_edge: bool,
    /// Floating pixels at depth edges.
    pub floaters: bool,
    /// SH bands that the spread of viewing directions cannot support.
    pub sh_bands: bool,
}

/// Settings of a reconstruction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Options {
    /// Depth source.
    pub prior: PriorChoice,
    /// A geometry network for the `Onnx` prior, see [`crate::prior::network`].
    pub prior_model: Option<Model>,
    /// A Gaussian head, see [`crate::head::network`]; `None` for the surfel head, which needs no weights.
    pub head_model: Option<Model>,
    /// Whether to ignore the offsets that `head_model` predicts (the paper's ablation).
    pub ignore_offset: bool,
    /// Whether cameras are corrected where the silhouettes contradict them.
    pub calibrate: Calibrate,
    /// When Gaussians are cloned across y = 0.
    pub symmetry: SymmetryMode,
    /// Whether clones are shown in the light of their own side.
    pub relight: Relight,
    /// Length, width, height in metres, where known: the vehicle is placed within the boxes of this size that fit the
    /// silhouettes. Overrides [`Scene::vehicle_box`](vg_scene::Scene::vehicle_box).
    pub vehicle_size: Option<[f64; 3]>,
    /// The place of a box of `vehicle_size`, to a few decimetres. Its middle plane, not y = 0, is then the plane of
    /// symmetry; the result is in the frame of the cameras anyway.
    pub vehicle_place: Option<Place>,
    /// Highest SH degree of the colour, 0 to 3.
    pub sh_degree: u8,
    /// Work that the plan must not leave out.
    pub keep: Keep,
    /// Whether to draw the model into its input views and report the error there.
    pub check: bool,
    /// Whether the `Shape` prior moves its surface to where the photographs agree.
    pub photo: bool,
    /// Time limit of the whole call, seconds: the plan leaves out what does not fit. `None` for no limit.
    pub budget_s: Option<f64>,
    /// Views are resampled to this share of their width and height before anything else, above 0 to 1.
    pub resolution: f64,
    /// The most views to use; those that spread best around the vehicle are kept.
    pub max_views: Option<usize>,
    /// The most Gaussians that the model may have, as estimated from the masks of the used views, see
    /// [`cap`](super::cap); `None` for any number. Where the masks allow for more, the views are resampled to fewer
    /// pixels first, and the report contains the reason. A refinement that densifies can exceed it.
    pub max_gaussians: Option<usize>,
    /// Worker threads; 0 means one per core.
    pub threads: usize,
    /// Whether to return the metric coloured point cloud as well.
    pub points: bool,
    /// The optimisation of the result against the photographs; `None`, the default, for none.
    pub refine: Option<RefineOptions>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            prior: PriorChoice::Auto,
            prior_model: None,
            head_model: None,
            ignore_offset: false,
            calibrate: Calibrate::Auto,
            symmetry: SymmetryMode::Auto,
            relight: Relight::Auto,
            vehicle_size: None,
            vehicle_place: None,
            sh_degree: 2,
            keep: Keep::default(),
            check: true,
            photo: true,
            budget_s: None,
            resolution: 1.0,
            max_views: None,
            max_gaussians: Some(DEFAULT_MAX_GAUSSIANS),
            threads: 0,
            points: false,
            refine: None,
        }
    }
}

impl Options {
    /// Checks that each field is in its range.
    ///
    /// # Errors
    /// [`Error::Argument`] with the field's name; [`Error::NotBuilt`] for the `Onnx` prior in a build without networks.
    pub fn validate(&self) -> Result<()> {
        match (self.prior, &self.prior_model) {
            // Without networks a model cannot be opened, so the missing model is not the error.
            (PriorChoice::Onnx, None) if !onnx::is_built() => return Err(onnx::not_built("options.prior")),
            (PriorChoice::Onnx, None) => {
                return Err(Error::argument(
                    "options.prior_model",
                    "none",
                    "an open model for the prior onnx",
                ));
            }
            (PriorChoice::Onnx, Some(_)) | (_, None) => {}
            (other, Some(model)) => {
                let found = format!("{}, with the prior {}", model.path().display(), other.name());
                return Err(Error::argument("options.prior_model", found, "none, or the prior onnx"));
            }
        }
        match (self.vehicle_size, self.vehicle_place) {
            (Some(size), place) => VehicleBox { size, place }.validate("options")?,
            (None, Some(_)) => {
                let allowed = "length, width, height in metres beside options.vehicle_place";
                return Err(Error::argument("options.vehicle_size", "none", allowed));
            }
            (None, None) => {}
        }
        if let Some(budget) = self.budget_s
            && !(budget > 0.0 && budget.is_finite())
        {
            return Err(Error::argument("options.budget_s", budget.to_string(), "seconds above 0"));
        }
        if !(self.resolution > 0.0 && self.resolution <= 1.0) {
            let found = self.resolution.to_string();
            return Err(Error::argument("options.resolution", found, "above 0, at most 1"));
        }
        if self.max_views == Some(0) {
            return Err(Error::argument("options.max_views", "0", "at least 1"));
        }
        if self.max_gaussians == Some(0) {
            return Err(Error::argument("options.max_gaussians", "0", "at least 1"));
        }
        if let Some(refine) = &self.refine {
            refine.validate()?;
        }
        if self.sh_degree > vg_splat::gaussians::sh::MAX_DEGREE {
            return Err(Error::argument("options.sh_degree", self.sh_degree.to_string(), "0 to 3"));
        }
        Ok(())
    }

    /// The vehicle's box where it is known: that of the options, else that of the scene.
    pub(super) fn vehicle_box(&self, scene: &Scene) -> Option<VehicleBox> {
        let own = self.vehicle_size.map(|size| VehicleBox { size, place: self.vehicle_place });
        own.or(scene.vehicle_box)
    }
}
