//! Visual priors: where the surface is, as metric planar depth per view (paper sec. "Metric-Scale Geometry").

pub mod given;
pub mod hull;
pub mod network;
pub mod normals;
mod photo;
pub mod shape;
#[doc(hidden)] // For the training of the shape prior.
pub mod volume;

pub use given::GivenDepth;
pub use hull::HullPrior;
pub use network::{NetworkFit, NetworkPrior};
pub use photo::PhotoFit;
pub use shape::ShapePrior;
pub use volume::{Filled, PointFit};

use glam::{DVec3, Vec3};
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::visibility::Observer;
use vg_scene::{DepthMap, View};

/// A source of metric depth.
pub trait DepthPrior {
    /// Name in options and reports.
    fn name(&self) -> &'static str;

    /// One depth map per view, in the view's pinhole grid, metres. Views are undistorted.
    fn estimate(&self, views: &[View], context: &Context) -> Result<Geometry>;
}

/// What a prior knows of the vehicle's shape.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// One per view.
    pub depths: Vec<DepthMap>,
    /// Unit normals per view in the camera frame, see [`normals::normals`]; filled by
    /// [`Geometry::find_normals`].
    pub normals: Vec<Vec<Vec3>>,
    /// The box it worked in.
    pub working_box: Option<WorkingBox>,
    /// Where its surface ends, if it estimates a whole one.
    pub ends: Option<Ends>,
    /// What it made of the scene's cloud, where there is one and it has a use for it.
    pub points: Option<PointFit>,
    /// What the photographs said of the surface, where they were asked.
    pub photo: Option<PhotoFit>,
    /// How it closed what its surface left open of the masks, where it does.
    pub masks: Option<Filled>,
    /// What a network said, where one was asked.
    pub network: Option<NetworkFit>,
}

impl Geometry {
    /// Depth without normals yet.
    pub fn new(depths: Vec<DepthMap>, working_box: Option<WorkingBox>) -> Self {
        Self {
            depths,
            normals: Vec::new(),
            working_box,
            ends: None,
            points: None,
            photo: None,
            masks: None,
            network: None,
        }
    }

    /// About the middle of what the views see, vehicle frame, metres: the mean of some lifted pixels.
    pub fn middle(&self, views: &[View]) -> DVec3 {
        /// A prime, so that the samples do not line up in columns.
        const EVERY: usize = 97;
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for (view, depth) in views.iter().zip(&self.depths) {
            for (i, z) in depth.depth().iter().enumerate().step_by(EVERY).filter(|(_, z)| **z > 0.0) {
                let (u, v) = (i as u32 % depth.width(), i as u32 / depth.width());
                sum += view.lift(u, v, *z).as_dvec3();
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { DVec3::ZERO }
    }

    /// The views with their depth, for look-ups.
    pub fn observers<'a>(&'a self, views: &'a [View]) -> Vec<Observer<'a>> {
        views.iter().zip(&self.depths).map(|(view, depth)| Observer::new(view, depth)).collect()
    }

    /// Normals from depth, where the prior gave none.
    pub fn find_normals(&mut self, views: &[View], context: &Context) {
        if self.normals.is_empty() {
            let pairs = views.iter().zip(&self.depths);
            self.normals = context
                .parallel(|| pairs.map(|(view, depth)| normals::normals(&view.camera, depth)).collect());
        }
    }
}

/// Where a surface begins and ends along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    /// Lowest x, y, z, metres.
    pub low: [f64; 3],
    /// Highest x, y, z, metres.
    pub high: [f64; 3],
    /// Expected error of both, metres. `[axis][low, high]`
    pub error_m: [[f64; 2]; 3],
}

impl Ends {
    /// The ends of a field's zero surface, which is expected to be off by `error_m` at a point.
    pub(crate) fn of_field(field: &volume::Field, error_m: impl Fn(Vec3) -> f64) -> Option<Self> {
        let ends = field.surface_ends()?;
        Some(Self {
            low: ends.map(|[(low, _), _]| f64::from(low)),
            high: ends.map(|[_, (high, _)]| f64::from(high)),
            error_m: ends.map(|both| both.map(|(_, at)| error_m(at))),
        })
    }
}

/// The box that a prior looks for the vehicle in: axis-aligned in the vehicle frame, symmetric about y = 0, and larger
/// than the vehicle by what the silhouettes leave open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkingBox {
    /// Lowest corner, metres.
    pub low: [f64; 3],
    /// Highest corner, metres.
    pub high: [f64; 3],
    /// What bounds it.
    pub source: BoxSource,
    /// By how much the known size and the silhouettes contradict each other, metres; 0 where they agree.
    pub contradicted_m: f64,
}

/// Where a [`WorkingBox`] comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BoxSource {
    /// The size that the caller gave, and the silhouettes.
    Given,
    /// The silhouettes alone.
    Estimated,
}

/// A size that is contradicted by less is within what masks and poses are off by, metres.
const CONTRADICTION_TOLD_M: f64 = 0.05;

impl WorkingBox {
    /// What a caller should know whose size the silhouettes contradict.
    pub fn warning(&self) -> Option<String> {
        let use_made = match self.source {
            BoxSource::Given => "it was used all the same",
            BoxSource::Estimated => "it was not used",
        };
        (self.contradicted_m > CONTRADICTION_TOLD_M).then(|| {
            format!(
                "the vehicle's size that was given and the silhouettes contradict each other by {:.2} m: {use_made}; check the \
                 size (length, width, height), the masks and the poses",
                self.contradicted_m
            )
        })
    }

    /// Length, width, height in metres.
    pub fn size(&self) -> [f64; 3] {
        std::array::from_fn(|k| self.high[k] - self.low[k])
    }
}
