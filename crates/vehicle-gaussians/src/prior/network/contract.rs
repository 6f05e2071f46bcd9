//! The contract "geometry prior", version 1 (docs/ONNX.md), read from a network's ports and metadata before it is
//! run.

use vg_geometry::Result;
use vg_scene::framing::{Framing, Resize};
use vg_scene::onnx::{Broken, Model, Ports};

/// Meaning of the numbers of `depth`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DepthKind {
    /// Distance from the camera along the pixel's ray.
    AlongRay,
    /// Planar depth along the optical axis.
    Z,
}

/// The contract of a network, as far as it can be checked before the network is run.
#[derive(Clone, Debug)]
pub(crate) struct Contract {
    /// `vg.prior`.
    pub(crate) name: String,
    pub(crate) depth: DepthKind,
    pub(crate) is_metric: bool,
    pub(crate) framing: Framing,
    pub(crate) takes_intrinsics: bool,
    pub(crate) takes_poses: bool,
    /// Indices among the outputs.
    pub(crate) outputs: Outputs,
}

/// Indices of the outputs; `None` for outputs that the network does not have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outputs {
    pub(crate) depth: usize,
    pub(crate) rays: Option<usize>,
    pub(crate) scale: Option<usize>,
    pub(crate) confidence: Option<usize>,
    pub(crate) mask: Option<usize>,
    pub(crate) poses: Option<usize>,
}

impl Contract {
    /// Reads the contract of a model; the error names what breaks it.
    pub(crate) fn from_model(model: &Model) -> Result<Self> {
        Self::read(model.ports()).map_err(|broken| model.broken(broken.field, broken.reason))
    }

    fn read(ports: &Ports) -> std::result::Result<Self, Broken> {
        ports.one_of("vg.contract", &[("1", ())], None)?;
        if let Some(head) = ports.metadata.get("vg.head") {
            return Err(Broken::new(
                "metadata vg.head",
                format!("{head:?}: a Gaussian head, not a geometry prior"),
            ));
        }
        let name = ports.required("vg.prior")?.to_owned();
        let depth = [("along_ray", DepthKind::AlongRay), ("z", DepthKind::Z)];
        let depth = ports.one_of("vg.depth", &depth, None)?;
        let is_metric = ports.one_of("vg.metric", &[("true", true), ("false", false)], None)?;
        let framing = Framing::read(ports, Resize::CoverCrop)?;
        let images = ports.required_input("images", &[None, Some(3), None, None])?;
        let views = framing.views;
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
                "missing; a prior with vg.metric=false needs it to find out how large the vehicle is";
            return Err(Broken::new("output cam_to_ref_pred", reason));
        }
        Ok(Self { name, depth, is_metric, framing, takes_intrinsics, takes_poses, outputs })
    }
}
