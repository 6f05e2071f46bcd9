//! What a caller may choose; `Options::default()` is what everything is measured with.

use super::cap::DEFAULT_MAX_GAUSSIANS;
use crate::refine::RefineOptions;
use crate::refine::baseline::BaselineOptions;
use crate::relight::Relight;
use crate::symmetry::SymmetryMode;
use serde::{Deserialize, Serialize};
use vg_geometry::{Error, Result};
use vg_scene::onnx::{self, Model};
use vg_scene::{Place, Scene, VehicleBox};

/// Which depth source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PriorChoice {
    /// `Given` if every used view has depth, else the best prior without: `Shape`. Where some views have depth, it counts
    /// as measured points, to which the shape bends.
    #[default]
    Auto,
    /// The caller's metric depth.
    Given,
    /// The visual hull of the silhouettes and their mirrored twins.
    Hull,
    /// The hull, corrected by what vehicles look like.
    Shape,
    /// The network of [`Options::prior_model`].
    Onnx,
}

impl PriorChoice {
    /// As in the command line and in reports.
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
    /// Where the silhouettes do not agree, and agree better with the correction.
    #[default]
    Auto,
    /// The caller's cameras are taken as they are.
    Off,
}

/// What the plan would leave out, kept nevertheless; all `false` by default.
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
    /// Leave out the offsets that `head_model` answers (the paper's ablation), whatever the model was trained with.
    pub ignore_offset: bool,
    /// Whether cameras are corrected where the silhouettes contradict them.
    pub calibrate: Calibrate,
    /// When Gaussians are cloned across y = 0.
    pub symmetry: SymmetryMode,
    /// Whether clones are shown in the light of their own side.
    pub relight: Relight,
    /// Length, width, height in metres, where known: no part of the vehicle is placed where no box of this size can
    /// stand that fits the silhouettes. Goes before [`Scene::vehicle_box`](vg_scene::Scene::vehicle_box).
    pub vehicle_size: Option<[f64; 3]>,
    /// Where a box of `vehicle_size` stands, to a few decimetres. Its middle plane, not y = 0, is then the plane of
    /// symmetry; the result is in the frame of the cameras all the same.
    pub vehicle_place: Option<Place>,
    /// Highest SH degree of the colour, 0 to 3.
    pub sh_degree: u8,
    /// What the plan may not leave out.
    pub keep: Keep,
    /// Whether to draw the model into its input views and report the error there.
    pub check: bool,
    /// Whether the `Shape` prior moves its surface to where the photographs agree.
    pub photo: bool,
    /// Seconds the whole call may take, where that matters: the plan then chooses what to leave out.
    pub budget_s: Option<f64>,
    /// Views are resampled to this share of their width and height before anything else, above 0 to 1.
    pub resolution: f64,
    /// Most views to use; those are kept that spread best around the vehicle.
    pub max_views: Option<usize>,
    /// Most Gaussians that the model may have by what the masks of the used views say of its size, see
    /// [`cap`](super::cap); `None` means any number. Where they allow for more, the views are resampled to fewer pixels
    /// before the work, and the report says so. A refinement that densifies adds to it, and a baseline does not look at it.
    pub max_gaussians: Option<usize>,
    /// Worker threads; 0 means one per core.
    pub threads: usize,
    /// Whether to return the metric coloured point cloud as well.
    pub points: bool,
    /// How the result is optimised against the photographs; `None`, the default: it is not.
    pub refine: Option<RefineOptions>,
    /// 3D Gaussian splatting instead of everything between the choice of views and the check, for comparison; `None`,
    /// the default: this library's method. What is of that method alone is then as it is by default or refused; `calibrate`,
    /// `relight`, `sh_degree`, `photo` and all of `keep` but the views are not looked at.
    pub baseline: Option<BaselineOptions>,
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
            baseline: None,
        }
    }
}

impl Options {
    /// Each field in its range.
    ///
    /// # Errors
    /// [`Error::Argument`] with the field's name; [`Error::NotBuilt`] for the `Onnx` prior in a build without networks.
    pub fn validate(&self) -> Result<()> {
        match (self.prior, &self.prior_model) {
            // Nobody can open one there: the model is not what is missing.
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
        if let Some(baseline) = &self.baseline {
            self.validate_beside_baseline()?;
            baseline.validate()?;
        }
        if self.sh_degree > vg_splat::gaussians::sh::MAX_DEGREE {
            return Err(Error::argument("options.sh_degree", self.sh_degree.to_string(), "0 to 3"));
        }
        Ok(())
    }

    /// What is known of the vehicle's box: the caller's word, else the scene's.
    pub(super) fn vehicle_box(&self, scene: &Scene) -> Option<VehicleBox> {
        let own = self.vehicle_size.map(|size| VehicleBox { size, place: self.vehicle_place });
        own.or(scene.vehicle_box)
    }

    /// What a baseline has not.
    fn validate_beside_baseline(&self) -> Result<()> {
        let symmetry = matches!(self.symmetry, SymmetryMode::Auto | SymmetryMode::Never);
        let fields = [
            ("prior", self.prior == PriorChoice::Auto, self.prior.name().to_owned(), "auto"),
            ("head_model", self.head_model.is_none(), "a network".into(), "none"),
            ("symmetry", symmetry, format!("{:?}", self.symmetry).to_lowercase(), "auto or never"),
            (
                "budget_s",
                self.budget_s.is_none(),
                format!("{} s", self.budget_s.unwrap_or(0.0)),
                "none; the amount is the baseline's",
            ),
            ("points", !self.points, "true".into(), "false"),
            ("refine", self.refine.is_none(), "a refinement".into(), "none; the amount is the baseline's"),
        ];
        for (name, fits, found, allowed) in fields {
            if !fits {
                let found = format!("{found}, with a baseline");
                return Err(Error::argument(format!("options.{name}"), found, allowed));
            }
        }
        Ok(())
    }
}
