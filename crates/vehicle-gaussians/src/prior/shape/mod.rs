//! The learned prior: the hull of the silhouettes, corrected by a network trained on vehicles.
//!
//! A few silhouettes at one height carve a hull that is too fat, and the excess is predictable from the place on the
//! vehicle. A small network that was trained on procedural vehicles only (`network`) turns the hull on
//! a coarse lattice over half the vehicle ([`lattice`]) into signed distance to the vehicle's surface, with an
//! uncertainty. This is one surface for all views and their mirrored twins, so nothing has to be fused. Where the
//! network is uncertain the surface stays nearer to the hull, and it never leaves the hull. The surface then moves to
//! where the photographs agree (`prior::photo`), is raised where masks are not filled, and finally moves to measured
//! points, if there are any.

pub mod lattice;
mod network;

use super::hull::require_masks;
use super::photo::fit_photographs;
use super::volume::extent::MIRROR_M;
use super::volume::relax::HULL_SLACK_M;
use super::volume::{
    Field, KnownBox, Silhouette, fill_masks, find_box, fit_cloud, inside_both, inside_known, march,
    uncovered_places,
};
use super::{DepthPrior, Ends, Estimate, Geometry, PriorReport, WorkingBox};
use glam::{DVec3, IVec3, Vec3};
use lattice::{HULL_CLAMP_M, Lattice, NODES, VIEW_NUMBERS, hull_on, view_numbers};
use network::{Network, Planes};
use rayon::prelude::*;
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::{Cloud, DepthMap, View};

/// Metres per unit of the network's output.
const UNIT_M: f32 = 0.25;

/// Range to which logarithms of the Laplace scale are clamped, units of [`UNIT_M`].
const LOG_SCALE: std::ops::RangeInclusive<f32> = -4.0..=1.0;

/// Expected error that halves a pixel's confidence, metres.
const HALF_TRUSTED_M: f32 = 0.05;

/// Corrections are applied in full below this range of expected errors and not at all above it, metres.
const TRUSTED_M: std::ops::Range<f32> = 0.10..0.30;

/// A ray of a vehicle pixel that misses the predicted surface by more than this, although it meets the hull, shows
/// something that the network removed wrongly, metres.
const MISSED_M: f32 = 0.12;

/// Distance to such a place: no correction is applied below this range, the whole correction above it, metres.
const REVERTED_M: std::ops::Range<f32> = 0.2..0.4;

/// Inset of the predicted surface, metres: a surfel reaches about half a pixel beyond its centre.
const INSET_M: f32 = 0.01;

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct ShapePrior {
    /// The vehicle's box, as far as the caller knows it.
    pub known_box: Option<KnownBox>,
    /// Points measured on the vehicle, if there are any.
    pub cloud: Option<Cloud>,
    /// Whether the surface is also moved to where the photographs agree, see `prior::photo`.
    pub photo: bool,
    /// Grid spacing, metres, if coarser than the finest useful one.
    pub voxel_m: Option<f64>,
}

impl DepthPrior for ShapePrior {
    fn name(&self) -> &'static str {
        "shape"
    }

    fn estimate(&self, views: &[View], context: &Context) -> Result<Estimate> {
        require_masks(views)?;
        let silhouettes: Vec<Silhouette> =
            context.parallel(|| views.par_iter().map(Silhouette::new).collect());
        context.report("prior", 0.1)?;
        let working_box = context.parallel(|| find_box(self.known_box.as_ref(), views, &silhouettes))?;
        context.report("prior", 0.2)?;
        let network = Network::embedded()?;
        let mut shape = context.parallel(|| Shape::predict(network, &working_box, &silhouettes, views));
        context.report("prior", 0.35)?;
        let (mut field, hull) = context.parallel(|| {
            let (field, hull) = shape.field(&working_box, &silhouettes, self.voxel_m);
            let removed = uncovered_places(&field, &hull, views, MISSED_M);
            if removed.is_empty() {
                return (field, hull);
            }
            shape.revert_near(&removed);
            (shape.bounded_by(&hull), hull)
        });
        context.report("prior", 0.45)?;
        let photo = match self.photo {
            true => Some(context.parallel(|| fit_photographs(&mut field, &hull, views))?),
            false => None,
        };
        context.report("prior", 0.7)?;
        let masks = context.parallel(|| fill_masks(&mut field, Some(&hull), views));
        let points = context.parallel(|| fit_cloud(&mut field, &hull, views, self.cloud.as_ref()));
        context.report("prior", 0.8)?;
        let mut depths = Vec::with_capacity(views.len());
        for (i, view) in views.iter().enumerate() {
            depths.push(context.parallel(|| shape.with_confidence(view, march::march(view, &field)?))?);
            context.report("prior", 0.8 + 0.2 * (i + 1) as f64 / views.len() as f64)?;
        }
        let error = |p: Vec3| f64::from(shape.lattice.sample(&shape.error, p));
        let ends = context.parallel(|| Ends::of_field(&field, error));
        Ok(Estimate {
            geometry: Geometry { ends, ..Geometry::new(depths, Some(working_box)) },
            report: PriorReport { points, photo, masks: Some(masks), network: None },
        })
    }
}

/// The network's prediction for half a vehicle.
struct Shape {
    lattice: Lattice,
    /// Distance inside the hull, metres, clamped to the network's range. `[16][32][96]`
    hull: Vec<f32>,
    /// Signed distance to the surface, positive inside, metres. `[16][32][96]`
    distance: Vec<f32>,
    /// Expected mean absolute error of `distance`, metres. `[16][32][96]`
    error: Vec<f32>,
}

impl Shape {
    fn predict(
        network: &Network,
        working_box: &WorkingBox,
        silhouettes: &[Silhouette],
        views: &[View],
    ) -> Self {
        let lattice = Lattice::around(working_box);
        let mut hull = hull_on(&lattice, silhouettes);
        let input = network_input(&hull, &view_numbers(working_box, views));
        let answer = network.run(&input);
        let [nx, ny, nz] = NODES;
        let mut distance = vec![0.0f32; hull.len()];
        let mut error = vec![0.0f32; hull.len()];
        hull.iter_mut().for_each(|h| *h = h.clamp(-UNIT_M, UNIT_M));
        for (row, hull) in hull.chunks_exact(nx).enumerate() {
            let (j, k) = (row / nz, row % nz);
            let (correction, log_scale) = (answer.row(j, k), answer.row(ny + j, k));
            for i in 0..nx {
                let at = row * nx + i;
                error[at] = UNIT_M * log_scale[i].clamp(*LOG_SCALE.start(), *LOG_SCALE.end()).exp();
                distance[at] = hull[i] + trust(error[at]) * UNIT_M * correction[i];
            }
        }
        Self { lattice, hull, distance, error }
    }

    /// The depth with confidence 1 / (1 + e / 0.05 m), where the network expects an error of `e`, times the depth's own
    /// confidence.
    fn with_confidence(&self, view: &View, depth: DepthMap) -> Result<DepthMap> {
        let width = depth.width();
        let confidence = (0..depth.depth().len() as u32)
            .into_par_iter()
            .map(|pixel| {
                let (u, v) = (pixel % width, pixel / width);
                depth.get(u, v).map_or(0.0, |z| {
                    let error = self.lattice.sample(&self.error, view.lift(u, v, z));
                    depth.confidence().map_or(1.0, |c| c[pixel as usize]) / (1.0 + error / HALF_TRUSTED_M)
                })
            })
            .collect();
        depth.with_confidence(confidence)
    }

    /// The surface as a field on a fine grid, nowhere outside the hull, and the hull itself.
    fn field(
        &self,
        working_box: &WorkingBox,
        silhouettes: &[Silhouette],
        coarser: Option<f64>,
    ) -> (Field, Field) {
        let (low, high) = (DVec3::from_array(working_box.low), DVec3::from_array(working_box.high));
        let voxel = super::hull::voxel(working_box, coarser);
        let margin = DVec3::new(2.0 * voxel, MIRROR_M, 2.0 * voxel);
        let hull = Field::symmetric(low - margin, high + margin, voxel, |p| {
            inside_both(silhouettes, p).min(inside_known(working_box, p))
        });
        (self.bounded_by(&hull), hull)
    }

    /// The surface as a field on the hull's grid, nowhere outside the hull.
    fn bounded_by(&self, hull: &Field) -> Field {
        let mut field = hull.clone();
        field.adjust(|p, hull| (self.lattice.sample(&self.distance, p) - INSET_M).min(hull + HULL_SLACK_M));
        field
    }

    /// Reverts corrections near these places and their mirror images, where the masks show something that the network
    /// removed: entirely below [`REVERTED_M`], not at all above it, linearly between.
    fn revert_near(&mut self, places: &[Vec3]) {
        let fold = |p: &Vec3| Vec3::new(p.x, p.y.abs(), p.z);
        // Neighbouring rays find the same place: one per cell is enough.
        let mut cells: Vec<[i32; 3]> =
            places.iter().map(|p| (fold(p) / REVERTED_M.start * 2.0).round().as_ivec3().to_array()).collect();
        cells.sort_unstable();
        cells.dedup();
        let places: Vec<Vec3> =
            cells.iter().map(|c| IVec3::from_array(*c).as_vec3() * REVERTED_M.start * 0.5).collect();
        let [nx, _, nz] = NODES;
        let lattice = self.lattice;
        let rows = self.distance.par_chunks_mut(nx).zip(self.hull.par_chunks(nx)).enumerate();
        rows.for_each(|(row, (distance, hull))| {
            for (i, (distance, hull)) in distance.iter_mut().zip(hull).enumerate() {
                let node = lattice.node(i, row / nz, row % nz);
                let near =
                    places.iter().map(|p| p.distance_squared(node)).fold(f32::INFINITY, f32::min).sqrt();
                let kept = way_through(&REVERTED_M, near);
                *distance = hull + kept * (*distance - hull);
            }
        });
    }
}

/// The part of a correction that is applied: where the network is uncertain, the hull at least agrees with the
/// silhouettes.
fn trust(error: f32) -> f32 {
    1.0 - way_through(&TRUSTED_M, error)
}

/// 0 below the range, 1 above it, linear between.
fn way_through(range: &std::ops::Range<f32>, x: f32) -> f32 {
    ((x - range.start) / (range.end - range.start)).clamp(0.0, 1.0)
}

/// Channels in the order of `training/shape/network.py`: hull slices along |y|, x, z, and the constant view numbers.
fn network_input(hull: &[f32], numbers: &[f32; VIEW_NUMBERS]) -> Planes {
    let [nx, ny, nz] = NODES;
    let mut input = Planes::new(ny + 2 + VIEW_NUMBERS, nz, nx);
    let centered = |i: usize, n: usize| 2.0 * i as f32 / (n - 1) as f32 - 1.0;
    for k in 0..nz {
        for j in 0..ny {
            let row = &hull[(j * nz + k) * nx..][..nx];
            for (value, hull) in input.row_mut(j, k).iter_mut().zip(row) {
                *value = hull / HULL_CLAMP_M;
            }
        }
        for (i, value) in input.row_mut(ny, k).iter_mut().enumerate() {
            *value = centered(i, nx);
        }
        input.row_mut(ny + 1, k).fill(centered(k, nz));
        for (c, number) in numbers.iter().enumerate() {
            input.row_mut(ny + 2 + c, k).fill(*number);
        }
    }
    input
}
