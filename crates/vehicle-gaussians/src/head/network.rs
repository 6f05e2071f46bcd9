//! The paper's head: a network in an ONNX file that predicts 38 numbers per pixel (paper sec. "Gaussian Attribute
//! Estimation"), by the contract "gaussian head", version 1 (docs/ONNX.md).

use super::GaussianHead;
use super::attributes::{Activated, CHANNELS, Offset, SH_DEGREE, ScaleActivation, activate};
use crate::prior::Geometry;
use glam::Vec3;
use rayon::prelude::*;
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::View;
use vg_scene::mask::Label;
use vg_scene::onnx::{Broken, Input, Model, Ports};
use vg_splat::Gaussians;
use vg_splat::gaussians::buffer::Gaussian;

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct NetworkHead {
    model: Model,
    contract: Contract,
    /// Highest SH degree of the colour.
    sh_degree: u8,
}

#[derive(Clone, Copy, Debug)]
struct Contract {
    activation: ScaleActivation,
    offset: Offset,
    /// Sides of its input pictures are multiples of this.
    multiple: u32,
    takes_intrinsics: bool,
    /// Index among the outputs.
    attributes: usize,
}

impl NetworkHead {
    /// A head that runs `model`; [`vg_geometry::Error::Format`] names what breaks the contract. Colour up to SH degree
    /// `sh_degree`, at most 2.
    pub fn new(model: Model, sh_degree: u8) -> Result<Self> {
        let contract = Contract::read(model.ports()).map_err(|b| model.broken(b.field, b.reason))?;
        Ok(Self { model, contract, sh_degree: sh_degree.min(SH_DEGREE) })
    }

    /// Ignores the network's offsets, whatever its metadata (the paper's ablation).
    pub fn without_offset(mut self) -> Self {
        self.contract.offset = Offset::Ignored;
        self
    }
}

impl Contract {
    fn read(ports: &Ports) -> std::result::Result<Self, Broken> {
        ports.one_of("vg.contract", &[("1", ())], None)?;
        if let Some(prior) = ports.metadata.get("vg.prior") {
            return Err(Broken::new(
                "metadata vg.prior",
                format!("{prior:?}: a geometry prior, not a Gaussian head"),
            ));
        }
        ports.required("vg.head")?;
        let activations = [
            ("softplus", ScaleActivation::Softplus),
            ("sigmoid", ScaleActivation::Sigmoid),
            ("relu", ScaleActivation::Relu),
        ];
        let activation =
            ports.one_of("vg.scale_activation", &activations, Some(ScaleActivation::Softplus))?;
        let offsets = [("applied", Offset::Applied), ("ignored", Offset::Ignored)];
        let offset = ports.one_of("vg.offset", &offsets, Some(Offset::Applied))?;
        let multiple = ports.count("vg.size_multiple", 1)?;
        // The network runs on one view at a time, at the view's own size.
        let images = ports.required_input("images", &[Some(1), Some(3), None, None])?;
        if images[2].is_some() || images[3].is_some() {
            return Err(Broken::new("input images", "a fixed size; allowed: any height and width"));
        }
        ports.required_input("depth", &[Some(1), None, None])?;
        let takes_intrinsics = ports.input("intrinsics", &[Some(1), Some(3), Some(3)])?.is_some();
        ports.no_inputs_but(&["images", "depth", "intrinsics"])?;
        let attributes = ports.required_output("attributes", &[Some(1), Some(CHANNELS), None, None])?;
        Ok(Self { activation, offset, multiple, takes_intrinsics, attributes })
    }
}

impl GaussianHead for NetworkHead {
    fn name(&self) -> &'static str {
        "network"
    }

    fn predict(
        &self,
        views: &[View],
        geometry: &Geometry,
        kept: &[Vec<bool>],
        context: &Context,
    ) -> Result<Gaussians> {
        let count = kept.iter().flatten().filter(|k| **k).count();
        let mut all = Gaussians::with_capacity(self.sh_degree, count);
        let coefficients = all.sh_stride();
        for (i, view) in views.iter().enumerate() {
            if kept[i].contains(&true) {
                let frame = self.run(view, geometry, i)?;
                let activated: Vec<Activated> = context.parallel(|| {
                    let pixels = (0..kept[i].len()).into_par_iter().filter(|&pixel| kept[i][pixel]);
                    pixels.filter_map(|pixel| self.gaussian(view, geometry, i, pixel, &frame)).collect()
                });
                for g in &activated {
                    let gaussian = Gaussian {
                        mean: g.mean,
                        rotation: g.rotation,
                        scale: g.scale,
                        opacity: g.opacity,
                        sh0: [g.sh[0], g.sh[1], g.sh[2]],
                    };
                    if !gaussian.is_storable() {
                        let reason =
                            format!("the network returned a centre at {:?} m; allowed: finite", g.mean);
                        return Err(self.model.broken("output attributes", reason));
                    }
                    all.push_with_sh(&gaussian, &g.sh[..coefficients]);
                }
            }
            context.report("head", (i + 1) as f64 / views.len() as f64)?;
        }
        Ok(all)
    }
}

/// Raw attributes of one view. `[38][height][width]`, padded.
struct Frame {
    width: usize,
    height: usize,
    raw: Vec<f32>,
}

impl NetworkHead {
    /// Runs the network on a view, padded on the right and at the bottom with zeros.
    fn run(&self, view: &View, geometry: &Geometry, i: usize) -> Result<Frame> {
        let padded = |side: u32| side.next_multiple_of(self.contract.multiple) as usize;
        let (width, height) = (padded(view.camera.width), padded(view.camera.height));
        let mut images = vec![0.0; 3 * width * height];
        let mut depth = vec![0.0; width * height];
        let own = view.camera.width as usize;
        for (pixel, (color, z)) in view.image.pixels().iter().zip(geometry.depths[i].depth()).enumerate() {
            let at = pixel / own * width + pixel % own;
            // The network subtracts the mean depth of its input: background must not be in it.
            let vehicle = view.mask.as_ref().is_none_or(|m| m.labels()[pixel] == Label::Vehicle);
            depth[at] = if vehicle { *z } else { 0.0 };
            for (c, value) in color.iter().enumerate() {
                images[c * width * height + at] = f32::from(*value) / 255.0;
            }
        }
        let intrinsics = view.camera.intrinsics.to_row_major().map(|x| x as f32);
        let (image_shape, depth_shape) = ([1, 3, height, width], [1, height, width]);
        let mut inputs = vec![
            Input { name: "images", shape: &image_shape, data: &images },
            Input { name: "depth", shape: &depth_shape, data: &depth },
        ];
        if self.contract.takes_intrinsics {
            inputs.push(Input { name: "intrinsics", shape: &[1, 3, 3], data: &intrinsics });
        }
        let mut outputs = self.model.run(&inputs)?;
        let shape = [1, CHANNELS, height, width];
        let raw = self.model.output(&mut outputs, self.contract.attributes, &shape)?;
        Ok(Frame { width, height, raw })
    }

    fn gaussian(
        &self,
        view: &View,
        geometry: &Geometry,
        i: usize,
        pixel: usize,
        frame: &Frame,
    ) -> Option<Activated> {
        let (u, v) = (pixel as u32 % view.camera.width, pixel as u32 / view.camera.width);
        let z = geometry.depths[i].get(u, v)?;
        let at = v as usize * frame.width + u as usize;
        let raw: [f32; CHANNELS] = std::array::from_fn(|c| frame.raw[c * frame.width * frame.height + at]);
        let rotation = view.camera.vehicle_from_camera.rotation.as_mat3();
        let rgb = view.image.get(u, v).map(|c| f32::from(c) / 255.0);
        let Contract { activation, offset, .. } = self.contract;
        let place: Vec3 = view.lift(u, v, z);
        Some(activate(&raw, place, &rotation, rgb, activation, offset))
    }
}
