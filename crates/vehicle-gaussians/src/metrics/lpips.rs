//! LPIPS (Zhang et al. 2018): perceptual distance of two pictures by the features of a network. Contract "picture
//! distance", version 1 (docs/ONNX.md).

use super::on_white;
use std::path::Path;
use vg_geometry::{Error, Result};
use vg_scene::View;
use vg_scene::onnx::{Broken, Input, Model, ModelOptions, Ports};
use vg_splat::render::Rendered;

/// Smallest side of a picture, pixels; the deepest layers of a smaller picture are empty.
pub const LPIPS_MIN_SIDE: u32 = 64;

/// A network that computes LPIPS. Clones share the open model; threads take turns.
#[derive(Clone, Debug, PartialEq)]
pub struct Lpips {
    model: Model,
    net: String,
    /// Height and width of its pictures, where the model fixes them.
    sides: [Option<usize>; 2],
    /// Index of the distance among the outputs.
    distance: usize,
}

impl Lpips {
    /// Opens a model file.
    ///
    /// # Errors
    /// As [`Model::open`] and [`Lpips::new`].
    pub fn open(path: &Path, options: &ModelOptions) -> Result<Self> {
        Self::new(Model::open(path, options)?)
    }

    /// Wraps a model that conforms to the contract; the [`Error::Format`] of another names the violation.
    pub fn new(model: Model) -> Result<Self> {
        let (net, sides, distance) =
            Self::read(model.ports()).map_err(|broken| model.broken(broken.field, broken.reason))?;
        Ok(Self { model, net, sides, distance })
    }

    fn read(ports: &Ports) -> std::result::Result<(String, [Option<usize>; 2], usize), Broken> {
        ports.one_of("vg.contract", &[("1", ())], None)?;
        for (key, what) in
            [("vg.prior", "a geometry prior"), ("vg.head", "a Gaussian head"), ("vg.mask", "a segmentation")]
        {
            if let Some(name) = ports.metadata.get(key) {
                let reason = format!("{name:?}: {what}, not a picture distance");
                return Err(Broken::new(format!("metadata {key}"), reason));
            }
        }
        ports.one_of("vg.metric", &[("lpips", ())], None)?;
        ports.one_of("vg.range", &[("0..1", ())], None)?;
        let net = ports.required("vg.lpips.net")?.to_owned();
        let a = ports.required_input("a", &[Some(1), Some(3), None, None])?;
        ports.required_input("b", &[Some(1), Some(3), a[2], a[3]])?;
        ports.no_inputs_but(&["a", "b"])?;
        let distance = ports.required_output("lpips", &[Some(1)])?;
        Ok((net, [a[2], a[3]], distance))
    }

    /// The kind of network: `alex`, `vgg` or `squeeze`. Their distances are not comparable.
    pub fn net(&self) -> &str {
        &self.net
    }

    /// The distance of two RGB pictures in [0, 1] (values outside are clamped), `width` columns wide; 0 where they
    /// are equal.
    ///
    /// # Errors
    /// [`Error::Argument`] for a picture that is smaller than [`LPIPS_MIN_SIDE`], not `width * height` pixels, not
    /// finite, or not of the model's fixed size; [`Error::Format`] where the network's output violates the contract.
    pub fn distance(&self, a: &[[f32; 3]], b: &[[f32; 3]], width: u32, height: u32) -> Result<f64> {
        self.check_size(width, height)?;
        let (w, h) = (width as usize, height as usize);
        let shape = [1, 3, h, w];
        let (a, b) = (planes("a", a, w * h)?, planes("b", b, w * h)?);
        let inputs =
            [("a", &a), ("b", &b)].map(|(name, data)| Input { name, shape: &shape, data: data.as_slice() });
        let mut outputs = self.model.run(&inputs)?;
        let distance = self.model.output(&mut outputs, self.distance, &[1])?;
        Ok(f64::from(distance[0]))
    }

    /// [`Lpips::distance`], or `None` for a picture smaller than [`LPIPS_MIN_SIDE`] where the model fixes no size.
    ///
    /// # Errors
    /// As [`Lpips::distance`].
    pub fn distance_of(
        &self,
        a: &[[f32; 3]],
        b: &[[f32; 3]],
        width: u32,
        height: u32,
    ) -> Result<Option<f64>> {
        let is_small = width.min(height) < LPIPS_MIN_SIDE && self.sides == [None; 2];
        if is_small { Ok(None) } else { self.distance(a, b, width, height).map(Some) }
    }

    /// The distance of a picture that the view's camera draws on white from the view's photograph, masked on white;
    /// `None` as for [`Lpips::distance_of`].
    ///
    /// # Errors
    /// As [`Lpips::distance`].
    pub fn of(&self, rendered: &Rendered, view: &View) -> Result<Option<f64>> {
        self.distance_of(&rendered.color, &on_white(view), rendered.width, rendered.height)
    }

    fn check_size(&self, width: u32, height: u32) -> Result<()> {
        for (name, side, fixed) in [("width", width, self.sides[1]), ("height", height, self.sides[0])] {
            let allowed = match fixed {
                Some(fixed) if fixed != side as usize => format!("{fixed}, the model's fixed size"),
                None if side < LPIPS_MIN_SIDE => format!("{LPIPS_MIN_SIDE} or more"),
                _ => continue,
            };
            return Err(Error::argument(name, side.to_string(), allowed));
        }
        Ok(())
    }
}

/// The picture's channels as planes, the layout of networks.
fn planes(argument: &str, picture: &[[f32; 3]], pixels: usize) -> Result<Vec<f32>> {
    if picture.len() != pixels {
        let allowed = format!("width * height = {pixels}");
        return Err(Error::argument(argument, format!("{} pixels", picture.len()), allowed));
    }
    if let Some(i) = picture.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(Error::argument(format!("{argument}[{i}]"), format!("{:?}", picture[i]), "finite"));
    }
    Ok((0..3).flat_map(|c| picture.iter().map(move |p| p[c].clamp(0.0, 1.0))).collect())
}
