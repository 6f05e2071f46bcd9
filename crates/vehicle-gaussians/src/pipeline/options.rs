//! The options of a reconstruction; all published measurements use `Options::default()`.

use super::cap::DEFAULT_MAX_GAUSSIANS;
use crate::refine::RefineOptions;
use crate::relight::Relight;
use crate::symmetry::SymmetryMode;
use serde::{Deserialize, Serialize};
use vg_geometry::options::{Face, Kind, Range, Setting, Value};
use vg_geometry::{Choice, Error, Result, choices, options};
use vg_scene::onnx::{self, Model};
use vg_scene::{Place, Scene, VehicleBox};
use vg_splat::gaussians::sh::MAX_DEGREE;

choices! {
    /// Where metric depth comes from.
    #[derive(Default, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum PriorChoice as "prior" {
        /// [`PriorChoice::Given`] if every used view has depth, else [`PriorChoice::Shape`]. Where some views have
        /// depth, it counts as measured points, to which the shape bends, and `log` is told.
        #[default]
        Auto = 0 "auto",
        /// The depth in the views.
        Given = 1 "given",
        /// The hull of the silhouettes and their mirrored twins; needs masks and nothing else.
        Hull = 2 "hull",
        /// The hull, corrected by what vehicles look like; needs masks and nothing else.
        Shape = 4 "shape",
        /// The network of [`Options::prior_model`]. [`Error::NotBuilt`] in a build without networks.
        Onnx = 3 "onnx",
    }
}

choices! {
    /// Whether cameras and the plane of symmetry are corrected before anything else.
    #[derive(Default)]
    pub enum Calibrate as "calibrate" {
        /// Where the silhouettes do not agree, and agree better with the correction.
        #[default]
        Auto = 0 "auto",
        /// The cameras are taken as they are.
        Off = 1 "off",
    }
}

choices! {
    /// What may not be left out although the scene does not need it; bits of [`Options::keep`].
    pub enum KeepItem as "keep" {
        /// Views whose camera another view already has.
        DuplicateViews = 1 "duplicate-views",
        /// Pixels that another view shows at a higher resolution.
        Overlap = 2 "overlap",
        /// Pixels on the silhouette's edge.
        SilhouetteEdge = 4 "silhouette-edge",
        /// Floating pixels at depth edges.
        Floaters = 8 "floaters",
        /// Bands of colour that the spread of viewing directions cannot support.
        ShBands = 16 "sh-bands",
    }
}

/// Work that the plan would leave out, done anyway; all `false` by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
pub struct Keep {
    /// [`KeepItem::DuplicateViews`].
    pub duplicate_views: bool,
    /// [`KeepItem::Overlap`].
    pub overlap: bool,
    /// [`KeepItem::SilhouetteEdge`].
    pub silhouette_edge: bool,
    /// [`KeepItem::Floaters`].
    pub floaters: bool,
    /// [`KeepItem::ShBands`].
    pub sh_bands: bool,
}

impl Keep {
    /// Everything that is named.
    pub fn from_items(items: impl IntoIterator<Item = KeepItem>) -> Self {
        let mut keep = Self::default();
        for item in items {
            *keep.item(item) = true;
        }
        keep
    }

    /// Everything that is kept.
    pub fn items(mut self) -> impl Iterator<Item = KeepItem> {
        KeepItem::ALL.iter().copied().filter(move |&item| *self.item(item))
    }

    fn item(&mut self, item: KeepItem) -> &mut bool {
        match item {
            KeepItem::DuplicateViews => &mut self.duplicate_views,
            KeepItem::Overlap => &mut self.overlap,
            KeepItem::SilhouetteEdge => &mut self.silhouette_edge,
            KeepItem::Floaters => &mut self.floaters,
            KeepItem::ShBands => &mut self.sh_bands,
        }
    }
}

impl Setting for Keep {
    const KIND: Kind = Kind::Set(KeepItem::enumeration);

    fn value(&self) -> Value {
        Value::Names(self.items().map(|item| item.name().to_owned()).collect())
    }

    fn from_value(argument: &str, value: Value) -> Result<Self> {
        let Value::Names(names) = value else { return Err(value.refused(argument, "names")) };
        let items = names.iter().map(|name| KeepItem::from_name(argument, name));
        items.collect::<Result<Vec<_>>>().map(Self::from_items)
    }
}

options! {
    /// Settings of a reconstruction.
    #[derive(Clone, Debug, PartialEq, Serialize)]
    pub struct Options {
        /// Where metric depth comes from.
        pub prior: PriorChoice = PriorChoice::Auto => {
            help: "Depth source: the scene's own depth (given); the visual hull (hull); the hull corrected by a shape \
                   model of vehicles (shape); the network of --prior-model (onnx); or (auto) the scene's own depth if \
                   every used view has it, else the shape, fitted to the depth of the views that have it, with a warning",
        },
        /// A geometry network for the `Onnx` prior, see [`crate::prior::network`].
        pub prior_model: Option<Model> = None,
        /// A Gaussian head, see [`crate::head::network`]; `None` for the surfel head, which needs no weights.
        pub head_model: Option<Model> = None,
        /// Leave out the offsets that `head_model` answers (the paper's ablation), whatever the model was trained with.
        pub ignore_offset: bool = false,
        /// Whether cameras are corrected where the silhouettes contradict them.
        pub calibrate: Calibrate = Calibrate::Auto => {
            help: "Correct the plane of symmetry and the cameras where the silhouettes contradict them (auto), or use \
                   them as given (off)",
        },
        /// How the side that was not photographed is completed.
        pub symmetry: SymmetryMode = SymmetryMode::Auto => {
            help: "Mirror the unobserved parts (auto), all of the denser side (always), nothing (never), or the \
                   photographs instead of the model (flip)",
        },
        /// Whether mirror images are shown in the light of their own side.
        pub relight: Relight = Relight::Auto => {
            help: "Relight mirror images for their own side, as far as the observed light allows (auto), or leave their \
                   colours as observed (never)",
        },
        /// Length, width, height in metres, where known: no part of the vehicle is placed where no box of this size can
        /// stand that fits the silhouettes. Goes before [`Scene::vehicle_box`](vg_scene::Scene::vehicle_box).
        pub vehicle_size: Option<[f64; 3]> = None,
        /// Where a box of `vehicle_size` stands, to a few decimetres. Its middle plane, not y = 0, is then the plane of
        /// symmetry; the result is in the frame of the cameras all the same.
        pub vehicle_place: Option<Place> = None,
        /// Highest degree of the colour's spherical harmonics, 0 to 3.
        pub sh_degree: u8 = 2 => {
            help: "Highest degree of the spherical harmonics that hold the colour",
            range: Some(Range::closed(0.0, f64::from(MAX_DEGREE), "0 to 3")),
            value_name: Some("0..3"),
        },
        /// What the plan may not leave out.
        pub keep: Keep = Keep::default() => {
            help: "Omissions that the plan must not make",
            value_name: Some("LIST"),
        },
        /// `true`: draw the model into its input views and report the error there; `false`: do not.
        pub check: bool = true => {
            help: "Draw the model into its input views and report the error there",
            apart: &[Face::Program],
        },
        /// `true`: [`PriorChoice::Shape`] moves its surface to where the photographs agree; `false`: it does not.
        pub photo: bool = true => {
            help: "Correct the shape prior's surface by photo-consistency",
        },
        /// Seconds the call may take, above 0, where that matters: what is left out is then chosen to fit. `None`: as
        /// long as it takes.
        pub budget_s: Option<f64> = None => {
            help: "Time limit of the reconstruction in seconds; steps that do not fit are left out",
            range: Some(Range::above(0.0, f64::MAX, "seconds above 0")),
            short: Some("budget"),
            none: Some("as long as it takes"),
            value_name: Some("SECONDS"),
        },
        /// Views are first resampled to this share of their width and height, above 0, at most 1. A `budget_s` may
        /// choose less.
        pub resolution: f64 = 1.0 => {
            help: "Resample the views first to this fraction of their width and height; a budget may choose less",
            range: Some(Range::above(0.0, 1.0, "above 0, at most 1")),
            value_name: Some("SHARE"),
        },
        /// At most this many views are used, those that spread best around the vehicle; `None`: all. A `budget_s` may
        /// choose fewer.
        pub max_views: Option<usize> = None => {
            help: "Use at most this many views, chosen to spread best around the vehicle; a budget may choose fewer",
            range: Some(Range::closed(1.0, f64::MAX, "at least 1")),
            none: Some("all"),
        },
        /// Most Gaussians that the model may have by what the masks of the used views say of its size: twice their
        /// vehicle pixels, or six times those of the largest mask, whichever is less. Where that is more, the views are
        /// resampled to fewer pixels before the work, and the log and the report say so. `None`: any number. Default
        /// 12000000, whose PLY file would have 2 GB.
        pub max_gaussians: Option<usize> = Some(DEFAULT_MAX_GAUSSIANS) => {
            help: "Largest number of Gaussians, estimated from the masks; where they would give more, the views are \
                   resampled to fewer pixels, and the report says so",
            range: Some(Range::closed(1.0, f64::MAX, "at least 1")),
            none: Some("any number"),
        },
        /// Worker threads; 0 means one per core.
        pub threads: usize = 0,
        /// `true`: the report also holds the metric coloured point cloud; `false`: it does not.
        pub points: bool = false => {
            help: "Return the metric coloured point cloud as well",
            apart: &[Face::Program],
        },
        /// How the result is optimised against the photographs; `None`, the default: it is not.
        pub refine: Option<RefineOptions> = None,
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
        self.check_ranges("options")?;
        if let Some(refine) = &self.refine {
            refine.validate()?;
        }
        Ok(())
    }

    /// The vehicle's box where it is known: that of the options, else that of the scene.
    pub(super) fn vehicle_box(&self, scene: &Scene) -> Option<VehicleBox> {
        let own = self.vehicle_size.map(|size| VehicleBox { size, place: self.vehicle_place });
        own.or(scene.vehicle_box)
    }
}
