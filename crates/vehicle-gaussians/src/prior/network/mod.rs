//! Depth from a network in an ONNX file (paper eq. 2): MapAnything, or another that keeps the contract (docs/ONNX.md).
//!
//! The network's rays and cameras are only checked: a pixel's direction comes from the caller's intrinsics and its
//! position from the caller's pose, so that pictures and model line up. The network contributes distance alone. The
//! disagreement of its cameras with the caller's, and of its views with each other, is reported and corrected by
//! scales.

mod agreement;
mod contract;

pub use agreement::{PoseFit, ViewFit};

use super::{DepthPrior, Estimate, Geometry, PriorReport};
use agreement::{fit_poses, fit_views, median};
use contract::{Contract, DepthKind};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::Serialize;
use vg_geometry::progress::Context;
use vg_geometry::{Error, Pose, Result};
use vg_scene::fit::{Fit, ray};
use vg_scene::mask::Label;
use vg_scene::onnx::{Input, Model};
use vg_scene::{DepthMap, View};

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct NetworkPrior {
    model: Model,
    contract: Contract,
}

/// The result of a network, and how well it agrees with the caller's cameras.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkFit {
    /// The network's name, from its metadata.
    pub prior: String,
    /// Width and height of its input pictures.
    pub size: [u32; 2],
    /// Median angle between its rays and those of the intrinsics, degrees.
    pub ray_degrees: Option<f64>,
    /// Metres per unit of its depth, from its output `scale`; 1 without one.
    pub scale: f64,
    /// Its cameras against the caller's; `None` if it gives none or no two cameras are apart.
    pub poses: Option<PoseFit>,
    /// Whether depth was multiplied by `poses.scale` as well.
    pub rescaled: bool,
    /// Its views against each other; `None` if no two see the same place.
    pub views: Option<ViewFit>,
    /// Vehicle pixels without depth: outside the network's crop, or masked out by the network.
    pub without_depth: usize,
    /// Reasons to doubt the result.
    pub warnings: Vec<String>,
}

/// Rays that deviate by more belong to another camera, degrees.
const MOST_RAY_DEGREES: f64 = 3.0;

/// A metric network's scale is corrected if its cameras' scale differs by more than this, natural logarithm.
const SCALE_NOISE: f64 = 0.05;

/// Cameras that deviate by more degrees, or by a larger share of their distance, give a warning.
const DOUBTFUL_DEGREES: f64 = 5.0;
const DOUBTFUL_SHARE: f64 = 0.1;

impl NetworkPrior {
    /// A prior that runs `model`; [`Error::Format`] names what breaks the contract.
    pub fn new(model: Model) -> Result<Self> {
        let contract = Contract::from_model(&model)?;
        Ok(Self { model, contract })
    }
}

impl DepthPrior for NetworkPrior {
    fn name(&self) -> &'static str {
        "onnx"
    }

    fn estimate(&self, views: &[View], context: &Context) -> Result<Estimate> {
        if let Some(n) = self.contract.framing.views.filter(|n| *n != views.len()) {
            let allowed =
                format!("{n}, the fixed number of views of the network {}", self.model.path().display());
            return Err(Error::argument("views", views.len().to_string(), allowed));
        }
        let given = relative_to_first(views);
        let aspect = |v: &View| f64::from(v.camera.width) / f64::from(v.camera.height);
        let size = self.contract.framing.size_for(views.iter().map(aspect).sum::<f64>() / views.len() as f64);
        let fit = |(i, view): (usize, &View)| {
            let (width, height) = (view.camera.width, view.camera.height);
            Fit::new(width, height, size, self.contract.framing.resize).ok_or_else(|| {
                let allowed = format!("an aspect ratio nearer to the network's {} x {}", size.0, size.1);
                Error::argument(format!("{}.image", view.argument(i)), format!("{width}x{height}"), allowed)
            })
        };
        let fits: Vec<Fit> = views.iter().enumerate().map(fit).collect::<Result<_>>()?;
        let pictures: Vec<Vec<f32>> = context.parallel(|| {
            fits.par_iter()
                .zip(views)
                .map(|(fit, view)| fit.picture(&view.image, &self.contract.framing))
                .collect()
        });
        context.report("prior", 0.1)?;
        let prediction = self.run(views, &fits, &given, &pictures.concat())?;
        context.report("prior", 0.8)?;

        let mut report = NetworkFit {
            prior: self.contract.name.clone(),
            size: [size.0, size.1],
            ray_degrees: None,
            scale: prediction.scale,
            poses: None,
            rescaled: false,
            views: None,
            without_depth: 0,
            warnings: Vec::new(),
        };
        let small: Vec<Vec<f32>> =
            (0..views.len()).map(|i| self.planar(&prediction, i, &fits[i], views)).collect();
        report.ray_degrees = self.ray_error(&prediction, &fits, views)?;
        let scale = self.scale(&prediction, &given, &mut report)?;
        let mut depths = context.parallel(|| full_size(&small, &fits, views, |_| scale))?;
        report.views = context.parallel(|| fit_views(views, &depths));
        if let Some(fit) = report.views.as_ref().filter(|fit| fit.after < fit.before) {
            depths = context.parallel(|| full_size(&small, &fits, views, |i| scale * fit.scales[i]))?;
        }
        if let Some(rank) = context.parallel(|| prediction.confidence_ranks()) {
            depths = ranked(depths, &rank, &fits, views)?;
        }
        let none = |(view, depth): (&View, &DepthMap)| {
            let vehicle = |i: usize| view.mask.as_ref().is_none_or(|m| m.labels()[i] == Label::Vehicle);
            depth.depth().iter().enumerate().filter(|(i, z)| **z <= 0.0 && vehicle(*i)).count()
        };
        report.without_depth = views.iter().zip(&depths).map(none).sum();
        Ok(Estimate {
            geometry: Geometry::new(depths, None),
            report: PriorReport { network: Some(report), ..PriorReport::default() },
        })
    }
}

/// The checked outputs of one run.
struct Prediction {
    pixels: usize,
    /// `[view][pixel]`, in the unit of the network.
    depth: Vec<f32>,
    /// `[view][pixel][3]`
    rays: Option<Vec<f32>>,
    scale: f64,
    /// `[view][pixel]`
    confidence: Option<Vec<f32>>,
    /// `[view][pixel]`
    mask: Option<Vec<f32>>,
    /// Camera to reference, translations in the unit of the network.
    poses: Option<Vec<Pose>>,
}

impl Prediction {
    fn is_sure(&self, view: usize, pixel: usize) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask[view * self.pixels + pixel] > 0.5)
    }

    /// Rank of each pixel: the share of all pixels with lower confidence. Only the order of confidences is meaningful.
    fn confidence_ranks(&self) -> Option<Vec<f32>> {
        let confidence = self.confidence.as_ref()?;
        let mut sorted = confidence.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        let below = |c: &f32| sorted.partition_point(|s| s < c) as f32 / sorted.len() as f32;
        Some(confidence.par_iter().map(below).collect())
    }
}

impl NetworkPrior {
    fn run(&self, views: &[View], fits: &[Fit], given: &[Pose], pictures: &[f32]) -> Result<Prediction> {
        let n = views.len();
        let (width, height) = (fits[0].size.0 as usize, fits[0].size.1 as usize);
        let intrinsics: Vec<f32> = views
            .iter()
            .zip(fits)
            .flat_map(|(view, fit)| {
                let i = fit.intrinsics(&view.camera.intrinsics);
                i.to_row_major()
            })
            .map(|x| x as f32)
            .collect();
        let poses: Vec<f32> = given
            .iter()
            .flat_map(|pose| pose.to_row_major().into_iter().chain([0.0, 0.0, 0.0, 1.0]))
            .map(|x| x as f32)
            .collect();
        let (image_shape, k_shape, pose_shape) = ([n, 3, height, width], [n, 3, 3], [n, 4, 4]);
        let mut inputs = vec![Input { name: "images", shape: &image_shape, data: pictures }];
        if self.contract.takes_intrinsics {
            inputs.push(Input { name: "intrinsics", shape: &k_shape, data: &intrinsics });
        }
        if self.contract.takes_poses {
            inputs.push(Input { name: "cam_to_ref", shape: &pose_shape, data: &poses });
        }
        let mut outputs = self.model.run(&inputs)?;
        let mut take = |at: usize, shape: &[usize]| self.model.output(&mut outputs, at, shape);
        let at = self.contract.outputs;
        let map = [n, height, width];
        let poses = at.poses.map(|at| take(at, &[n, 4, 4])).transpose()?;
        let scale = at.scale.map(|at| take(at, &[1])).transpose()?;
        let prediction = Prediction {
            pixels: width * height,
            depth: take(at.depth, &map)?,
            rays: at.rays.map(|at| take(at, &[n, height, width, 3])).transpose()?,
            scale: scale.map_or(1.0, |s| f64::from(s[0])),
            confidence: at.confidence.map(|at| take(at, &map)).transpose()?,
            mask: at.mask.map(|at| take(at, &map)).transpose()?,
            poses: poses.map(|numbers| self.poses(&numbers)).transpose()?,
        };
        self.check(&prediction)?;
        Ok(prediction)
    }

    fn poses(&self, numbers: &[f32]) -> Result<Vec<Pose>> {
        let pose = |(i, m): (usize, &[f32])| {
            let m: [f64; 12] = std::array::from_fn(|k| f64::from(m[k]));
            let field = format!("output cam_to_ref_pred[{i}]");
            let bad = |e: Error| match e {
                Error::Argument { found, allowed, .. } => {
                    self.model.broken(field.clone(), format!("{found}; allowed: {allowed}"))
                }
                other => other,
            };
            Pose::from_row_major("pose", &m).map_err(bad)
        };
        numbers.chunks_exact(16).enumerate().map(pose).collect()
    }

    fn check(&self, prediction: &Prediction) -> Result<()> {
        for (i, z) in prediction.depth.iter().enumerate() {
            if *z <= 0.0 && prediction.is_sure(i / prediction.pixels, i % prediction.pixels) {
                let reason =
                    format!("the network returned {z}; allowed: above 0 where its mask is above 0.5");
                return Err(self.model.broken("output depth", reason));
            }
        }
        if let Some(rays) = &prediction.rays {
            let length = |r: &[f32]| r.iter().map(|x| x * x).sum::<f32>().sqrt();
            if let Some(r) = rays.chunks_exact(3).find(|r| (length(r) - 1.0).abs() > 1e-3) {
                let reason =
                    format!("the network returned a ray of length {}; allowed: 1 +- 0.001", length(r));
                return Err(self.model.broken("output rays", reason));
            }
        }
        if let Some(mask) = &prediction.mask
            && let Some(p) = mask.iter().find(|p| !(0.0..=1.0).contains(*p))
        {
            return Err(self
                .model
                .broken("output mask", format!("the network returned {p}; allowed: 0 to 1")));
        }
        if prediction.scale <= 0.0 {
            let reason = format!("the network returned {}; allowed: above 0", prediction.scale);
            return Err(self.model.broken("output scale", reason));
        }
        Ok(())
    }

    /// Planar depth in units of the network, 0 where its mask excludes the pixel; paper eq. 3 along
    /// the ray of the caller's intrinsics.
    fn planar(&self, prediction: &Prediction, view: usize, fit: &Fit, views: &[View]) -> Vec<f32> {
        let i = fit.intrinsics(&views[view].camera.intrinsics);
        let depth = &prediction.depth[view * prediction.pixels..(view + 1) * prediction.pixels];
        let z = |(pixel, d): (usize, &f32)| match (prediction.is_sure(view, pixel), self.contract.depth) {
            (false, _) => 0.0,
            (true, DepthKind::Z) => *d,
            (true, DepthKind::AlongRay) => (f64::from(*d) / ray(&i, pixel, fit.size.0).length()) as f32,
        };
        depth.iter().enumerate().map(z).collect()
    }

    /// Median angle between the network's rays and the caller's, degrees; an error if they belong to another camera.
    fn ray_error(&self, prediction: &Prediction, fits: &[Fit], views: &[View]) -> Result<Option<f64>> {
        let Some(rays) = &prediction.rays else { return Ok(None) };
        const EVERY: usize = 7;
        let mut angles = Vec::new();
        for (k, (fit, view)) in fits.iter().zip(views).enumerate() {
            let i = fit.intrinsics(&view.camera.intrinsics);
            for pixel in (0..prediction.pixels).step_by(EVERY).filter(|p| prediction.is_sure(k, *p)) {
                let at = 3 * (k * prediction.pixels + pixel);
                let found = DVec3::from_array(std::array::from_fn(|c| f64::from(rays[at + c])));
                let expected = ray(&i, pixel, fit.size.0);
                angles.push(found.cross(expected).length().atan2(found.dot(expected)).to_degrees());
            }
        }
        let Some(median) = median(angles) else { return Ok(None) };
        if median > MOST_RAY_DEGREES {
            let reason = format!(
                "the network's rays differ from those of the intrinsics by {median:.1} degrees (at most \
                 {MOST_RAY_DEGREES}): another lens, or a picture that was cropped or scaled without its intrinsics"
            );
            return Err(Error::Reconstruction { stage: "prior", reason });
        }
        Ok(Some(median))
    }

    /// Metres per unit of the network.
    fn scale(&self, prediction: &Prediction, given: &[Pose], report: &mut NetworkFit) -> Result<f64> {
        let metres = |pose: &Pose| Pose { translation: prediction.scale * pose.translation, ..*pose };
        let predicted: Option<Vec<Pose>> =
            prediction.poses.as_ref().map(|poses| poses.iter().map(metres).collect());
        report.poses = predicted.as_ref().and_then(|predicted| fit_poses(predicted, given));
        let Some(fit) = &report.poses else {
            return match self.contract.is_metric {
                true => {
                    report.warnings
                        .push("all cameras are at one place: the network's own scale is used unchecked".into());
                    Ok(prediction.scale)
                }
                false => Err(Error::Reconstruction {
                    stage: "prior",
                    reason: "the network is not metric and all cameras are at one place: the vehicle's size cannot be \
                             determined; give views from two places, or another prior"
                        .into(),
                }),
            };
        };
        if !(fit.scale > 0.0 && fit.scale.is_finite()) {
            let reason = format!(
                "the network's cameras do not fit the poses at any positive scale (best: {:.3}): a mirrored axis, or \
                 views in another order",
                fit.scale
            );
            return Err(Error::Reconstruction { stage: "prior", reason });
        }
        let distance = given.iter().map(|p| p.translation.length()).fold(0.0, f64::max);
        let worst = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let (degrees, metres) = (worst(&fit.rotation_degrees), worst(&fit.center_m));
        if degrees > DOUBTFUL_DEGREES || metres > DOUBTFUL_SHARE * distance {
            report.warnings.push(format!(
                "the network's cameras differ from the poses by up to {degrees:.1} degrees and {metres:.2} m: a mirrored \
                 axis, views in another order, or a vehicle that moved"
            ));
        }
        report.rescaled = !self.contract.is_metric || fit.scale.ln().abs() > SCALE_NOISE;
        Ok(prediction.scale * if report.rescaled { fit.scale } else { 1.0 })
    }
}

/// Poses from each camera to the first view's camera, so that a distant world origin loses no precision in f32.
fn relative_to_first(views: &[View]) -> Vec<Pose> {
    let first = views[0].camera.vehicle_from_camera.inverse();
    let mut poses: Vec<Pose> = views.iter().map(|v| first.after(&v.camera.vehicle_from_camera)).collect();
    poses[0] = Pose { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
    poses
}

/// Depth maps in metres at the photographs' size, from the network's small maps.
fn full_size(
    small: &[Vec<f32>],
    fits: &[Fit],
    views: &[View],
    scale: impl Fn(usize) -> f64 + Sync,
) -> Result<Vec<DepthMap>> {
    let one = |i: usize| {
        let metres = small[i].iter().map(|z| (scale(i) * f64::from(*z)) as f32).collect();
        let map = DepthMap::new(fits[i].size.0, fits[i].size.1, metres)?;
        fits[i].back(&map, views[i].camera.width, views[i].camera.height)
    };
    (0..views.len()).into_par_iter().map(one).collect()
}

/// The depths with the confidence rank of the network's nearest pixel.
fn ranked(depths: Vec<DepthMap>, ranks: &[f32], fits: &[Fit], views: &[View]) -> Result<Vec<DepthMap>> {
    let pixels = ranks.len() / views.len();
    let one = |(i, depth): (usize, DepthMap)| {
        let own = &ranks[i * pixels..(i + 1) * pixels];
        let (width, n) = (depth.width(), depth.depth().len());
        depth.with_confidence((0..n).map(|p| fits[i].nearest(p, width).map_or(0.0, |at| own[at])).collect())
    };
    depths.into_iter().enumerate().map(one).collect()
}
