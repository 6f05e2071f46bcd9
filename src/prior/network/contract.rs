//! What a geometry network promises: contract "geometry prior", version 1 (docs/ONNX.md), read off its ports and
//! metadata before anything is run.

use crate::error::Result;
use crate::onnx::{Broken, Model, Ports};

/// What the numbers of `depth` are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DepthKind {
    /// Distance from the camera along the pixel's ray.
    AlongRay,
    /// Planar depth along the optical axis.
    Z,
}

/// How a photograph comes to the network's size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Resize {
    /// Scaled evenly to cover it; what is over is cut on both sides.
    CoverCrop,
    /// Width and height each to its own.
    Stretch,
}

/// Width and height of the network's pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    Fixed(u32, u32),
    /// The long side, and what both sides are multiples of.
    Free {
        long_side: u32,
        multiple: u32,
    },
}

/// A network that keeps the contract, as far as can be told before it is run.
#[derive(Clone, Debug)]
pub(crate) struct Contract {
    /// `vg.prior`.
    pub(crate) name: String,
    pub(crate) depth: DepthKind,
    pub(crate) is_metric: bool,
    pub(crate) resize: Resize,
    pub(crate) size: Size,
    /// Taken off the colours in [0, 1], which are then divided by `std`.
    pub(crate) mean: [f32; 3],
    pub(crate) std: [f32; 3],
    /// How many views it takes, where that is fixed.
    pub(crate) views: Option<usize>,
    pub(crate) takes_intrinsics: bool,
    pub(crate) takes_poses: bool,
    /// Indices among the outputs.
    pub(crate) outputs: Outputs,
}

/// Where the outputs are, of those that there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outputs {
    pub(crate) depth: usize,
    pub(crate) rays: Option<usize>,
    pub(crate) scale: Option<usize>,
    pub(crate) confidence: Option<usize>,
    pub(crate) mask: Option<usize>,
    pub(crate) poses: Option<usize>,
}

/// Side of pictures for a network that takes any.
const LONG_SIDE: u32 = 518;

impl Contract {
    /// Reads it, or says what breaks it.
    pub(crate) fn of(model: &Model) -> Result<Self> {
        Self::read(model.ports()).map_err(|broken| model.broken(broken.field, broken.reason))
    }

    fn read(ports: &Ports) -> std::result::Result<Self, Broken> {
        ports.one_of("vg.contract", &[("1", ())], None)?;
        if let Some(head) = ports.metadata.get("vg.head") {
            return Err(Broken::new(
                "metadata vg.head",
                format!("{head:?}: a Gaussian head, no geometry prior"),
            ));
        }
        let name = ports.required("vg.prior")?.to_owned();
        let depth = [("along_ray", DepthKind::AlongRay), ("z", DepthKind::Z)];
        let depth = ports.one_of("vg.depth", &depth, None)?;
        let is_metric = ports.one_of("vg.metric", &[("true", true), ("false", false)], None)?;
        let ways = [("cover_crop", Resize::CoverCrop), ("stretch", Resize::Stretch)];
        let resize = ports.one_of("vg.resize", &ways, Some(Resize::CoverCrop))?;
        let multiple = ports.count("vg.size_multiple", 1)?;
        let long_side = ports.count("vg.long_side", LONG_SIDE)?;
        let mean = ports.color("vg.mean", [0.0; 3])?;
        let std = ports.color("vg.std", [1.0; 3])?;
        if std.contains(&0.0) {
            return Err(Broken::new("metadata vg.std", format!("{std:?}; allowed: no zeros")));
        }

        let images = ports.required_input("images", &[None, Some(3), None, None])?;
        let size = match (images[2], images[3]) {
            (Some(height), Some(width)) => {
                let side = |n: usize| u32::try_from(n).ok().filter(|n| (1..=8192).contains(n));
                let sides = side(width).zip(side(height));
                let (width, height) =
                    sides.ok_or_else(|| Broken::new("input images", "sides beyond 1 to 8192"))?;
                Size::Fixed(width, height)
            }
            (None, None) if long_side < multiple => {
                let reason = format!("{long_side}, less than vg.size_multiple {multiple}");
                return Err(Broken::new("metadata vg.long_side", reason));
            }
            (None, None) => Size::Free { long_side, multiple },
            _ => {
                return Err(Broken::new(
                    "input images",
                    "one side fixed and one free; allowed: both or none",
                ));
            }
        };
        let views = images[0];
        let takes_intrinsics = ports.input("intrinsics", &[views, Some(3), Some(3)])?.is_some();
        let takes_poses = ports.input("cam_to_ref", &[views, Some(4), Some(4)])?.is_some();
        ports.no_inputs_but(&["images", "intrinsics", "cam_to_ref"])?;

        let (height, width) = (images[2], images[3]);
        let map = [views, height, width];
        let outputs = Outputs {
            depth: ports.required_output("depth", &map)?,
            rays: ports.output("rays", &[views, height, width, Some(3)])?,
            scale: ports.output("scale", &[Some(1)])?,
            confidence: ports.output("confidence", &map)?,
            mask: ports.output("mask", &map)?,
            poses: ports.output("cam_to_ref_pred", &[views, Some(4), Some(4)])?,
        };
        if !is_metric && outputs.poses.is_none() {
            let reason =
                "missing; a prior with vg.metric=false needs it, or nothing tells how large the vehicle is";
            return Err(Broken::new("output cam_to_ref_pred", reason));
        }
        Ok(Self {
            name,
            depth,
            is_metric,
            resize,
            size,
            mean,
            std,
            views,
            takes_intrinsics,
            takes_poses,
            outputs,
        })
    }

    /// Width and height for photographs of `aspect` = width / height on the mean.
    pub(crate) fn size_for(&self, aspect: f64) -> (u32, u32) {
        match self.size {
            Size::Fixed(width, height) => (width, height),
            Size::Free { long_side, multiple } => {
                let long = (long_side / multiple).max(1) * multiple;
                let short = f64::from(long) * aspect.min(1.0 / aspect) / f64::from(multiple);
                let short = (short.round() as u32).max(1) * multiple;
                if aspect >= 1.0 { (long, short) } else { (short, long) }
            }
        }
    }
}
