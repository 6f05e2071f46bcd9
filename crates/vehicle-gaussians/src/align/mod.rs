//! Alignment of a structure-from-motion model, in an arbitrary gauge, to the metric vehicle frame.
//!
//! [`to_scan`] takes a scanned point cloud in the vehicle's frame and masked views: the scan's outline must run along
//! every mask's edge, and the sparse points of the vehicle must lie on the scan's surface. [`to_box`] takes the
//! vehicle's size and the ground. Measurements are in docs/ALIGN.md.

mod candidates;
mod folder;
mod footprint;
mod ground;
mod heading;
mod hull;
mod icp;
mod scan;
mod silhouettes;
mod solve;
mod to_box;
mod to_scan;

pub use folder::{folder_to_scan, folder_to_scan_watched, masks_of, scan_of};
pub use heading::Heading;
pub use to_box::{BoxAlignment, to_box, to_box_watched};
pub use to_scan::{LEAST_CONFIDENCE, ScanAlignment, to_scan, to_scan_watched};

use glam::DVec3;
use rayon::prelude::*;
use silhouettes::Outline;
use vg_geometry::{Error, Pose, Result};
use vg_scene::View;
use vg_scene::undistort::undistorted;

/// A view whose camera is posed in the world: its field for the pose in the vehicle frame, which is still to be found,
/// holds that pose.
#[derive(Clone, Copy)]
struct WorldView<'a>(&'a View);

impl WorldView<'_> {
    fn world_from_camera(&self) -> Pose {
        self.0.camera.vehicle_from_camera
    }

    /// Place of the camera in the world.
    fn camera_center(&self) -> DVec3 {
        self.world_from_camera().translation
    }
}

/// Minimum of masks that determines scale and position.
pub const FEWEST_VIEWS: usize = 3;

/// Returns an error, with the caller's index, if a point is not finite.
fn check_sparse(sparse: &[DVec3]) -> Result<()> {
    match sparse.iter().position(|p| !p.is_finite()) {
        Some(i) => Err(Error::argument(format!("sparse[{i}]"), sparse[i].to_string(), "finite")),
        None => Ok(()),
    }
}

/// Minimum of edge pieces in all masks together.
const FEWEST_EDGES: usize = 60;

fn outlines(views: &[View]) -> Result<Vec<Outline>> {
    let outline = |view: &View| {
        let view = undistorted(view)?;
        Ok(view.mask.as_ref().map(|mask| Outline::new(&WorldView(&view), mask)))
    };
    let all: Vec<Option<Outline>> = views.par_iter().map(outline).collect::<Result<_>>()?;
    let seen: Vec<Outline> = all.into_iter().flatten().filter(|o| o.edge_count() > 0).collect();
    let edges: usize = seen.iter().map(Outline::edge_count).sum();
    if seen.len() < FEWEST_VIEWS || edges < FEWEST_EDGES {
        let found = format!("{} of {} have a mask that shows an outline", seen.len(), views.len());
        return Err(Error::argument("views", found, format!("at least {FEWEST_VIEWS}")));
    }
    Ok(seen)
}

/// The error if no alignment fits. `check` names the input to check in addition to the masks.
fn nowhere(reason: &str, check: &str) -> Error {
    Error::Reconstruction { stage: "align", reason: format!("{reason}; check {check}, and the masks") }
}
