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

/// A source of metric depth. Implement it to reconstruct with a prior of your own, see
/// [`crate::pipeline::reconstruct_with`].
///
/// ```
/// use vg::prior::{DepthPrior, Estimate, Geometry};
/// use vg::progress::Context;
/// use vg::scene::{DepthMap, View};
///
/// /// A wall at a fixed distance from every camera.
/// struct Wall {
///     depth_m: f32,
/// }
///
/// impl DepthPrior for Wall {
///     fn name(&self) -> &'static str {
///         "wall"
///     }
///
///     fn estimate(&self, views: &[View], _context: &Context) -> vg::Result<Estimate> {
///         let depth = |view: &View| {
///             let (width, height) = (view.camera.width, view.camera.height);
///             DepthMap::new(width, height, vec![self.depth_m; width as usize * height as usize])
///         };
///         let depths = views.iter().map(depth).collect::<vg::Result<_>>()?;
///         Ok(Geometry::new(depths, None).into())
///     }
/// }
/// ```
pub trait DepthPrior {
    /// Name in reports and error messages.
    fn name(&self) -> &'static str;

    /// Estimates one depth map per view, in the order and the size of the views; 0 where a pixel has no depth.
    ///
    /// The views are pinholes: lens distortion is removed. Their cameras are posed in the frame that the run works in,
    /// whose y = 0 is the vehicle's plane of symmetry; the calibration may have moved it from the caller's frame. Long
    /// work should call [`Context::report`] with the stage `"prior"` now and then, and return its error, which is how a
    /// caller cancels. [`Context::parallel`] runs rayon's iterators on the threads of the run.
    fn estimate(&self, views: &[View], context: &Context) -> Result<Estimate>;
}

/// The answer of a prior.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Where the surface is.
    pub geometry: Geometry,
    /// The prior's own report.
    pub report: PriorReport,
}

impl From<Geometry> for Estimate {
    fn from(geometry: Geometry) -> Self {
        Self { geometry, report: PriorReport::default() }
    }
}

/// A prior's report of its own work; later stages do not read it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PriorReport {
    /// How the surface was fitted to the points of the scene's cloud; `None` without a cloud or for a prior that does
    /// not use it.
    pub points: Option<PointFit>,
    /// How the surface was moved to where the photographs agree.
    pub photo: Option<PhotoFit>,
    /// How the surface was extended to fill the masks.
    pub masks: Option<Filled>,
    /// How far the network's answer agrees with the caller's cameras.
    pub network: Option<NetworkFit>,
}

/// The shape of the vehicle, as estimated or measured from the views.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// One map per view.
    pub depths: Vec<DepthMap>,
    /// Unit normals per view in the camera frame, see [`normals::normals`]. Where a prior leaves the list empty,
    /// [`Geometry::find_normals`] computes them from the depth.
    pub normals: Vec<Vec<Vec3>>,
    /// The box that the vehicle was looked for in.
    pub working_box: Option<WorkingBox>,
    /// The ends of the surface, where the prior estimates a whole one.
    pub ends: Option<Ends>,
}

impl Geometry {
    /// Depth without normals and ends.
    pub fn new(depths: Vec<DepthMap>, working_box: Option<WorkingBox>) -> Self {
        Self { depths, normals: Vec::new(), working_box, ends: None }
    }

    /// Approximate middle of the observed surface in the frame of the views, metres: the mean of some lifted pixels.
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

    /// The views with their depth, for visibility queries.
    pub fn observers<'a>(&'a self, views: &'a [View]) -> Vec<Observer<'a>> {
        views.iter().zip(&self.depths).map(|(view, depth)| Observer::new(view, depth)).collect()
    }

    /// Computes normals from the depth where the prior gave none.
    pub fn find_normals(&mut self, views: &[View], context: &Context) {
        if self.normals.is_empty() {
            let pairs = views.iter().zip(&self.depths);
            self.normals = context
                .parallel(|| pairs.map(|(view, depth)| normals::normals(&view.camera, depth)).collect());
        }
    }
}

/// The ends of a surface along each axis.
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
    /// The ends of a field's zero surface; `error_m` returns the expected error of the surface at a point.
    pub(crate) fn of_field(field: &volume::Field, error_m: impl Fn(Vec3) -> f64) -> Option<Self> {
        let ends = field.surface_ends()?;
        Some(Self {
            low: ends.map(|[(low, _), _]| f64::from(low)),
            high: ends.map(|[_, (high, _)]| f64::from(high)),
            error_m: ends.map(|both| both.map(|(_, at)| error_m(at))),
        })
    }
}

/// The box that a prior searches for the vehicle: axis-aligned in the vehicle frame, symmetric about y = 0, and larger
/// than the vehicle by what the silhouettes do not bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkingBox {
    /// Lowest corner, metres.
    pub low: [f64; 3],
    /// Highest corner, metres.
    pub high: [f64; 3],
    /// The source of its bounds.
    pub source: BoxSource,
    /// Contradiction between the known size and the silhouettes, metres; 0 where they agree.
    pub contradicted_m: f64,
}

/// The source of a [`WorkingBox`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BoxSource {
    /// The size that the caller gave, and the silhouettes.
    Given,
    /// The silhouettes alone.
    Estimated,
}

/// Contradictions below this are within the errors of masks and poses, metres.
const REPORTED_CONTRADICTION_M: f64 = 0.05;

impl WorkingBox {
    /// A sentence for the caller where the silhouettes contradict the given size.
    pub fn warning(&self) -> Option<String> {
        let use_made = match self.source {
            BoxSource::Given => "it was used all the same",
            BoxSource::Estimated => "it was not used",
        };
        (self.contradicted_m > REPORTED_CONTRADICTION_M).then(|| {
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
