//! The stage `calibrate`: the views in the frame whose y = 0 is the vehicle's plane of symmetry.

use super::frame::{Given, GivenFromWorking, InFrame, Working};
use super::options::Calibrate;
use super::plan;
use super::run::Run;
use crate::calibrate::{self, Calibrated, Calibration, Moved};
use crate::symmetry::SymmetryMode;
use vg_geometry::Result;
use vg_geometry::frame::pose_from_box;
use vg_scene::{Place, View, mirror};

/// The used views after the calibration.
pub(super) struct CalibratedViews {
    /// With corrected cameras. Masks that an occluder cut have no background: they carve nothing.
    pub(super) working: InFrame<Working, Vec<View>>,
    /// With corrected cameras and the caller's masks; `None` where they are those of `working`, whose frame is then the
    /// caller's.
    corrected: Option<InFrame<Given, Vec<View>>>,
    /// The working views and their mirror images, where those count as views (`SymmetryMode::Flip`).
    flipped: Option<InFrame<Working, Vec<View>>>,
    /// The way back to the caller's frame.
    pub(super) given_from_working: GivenFromWorking,
    /// The report of the calibration; `None` where the views cannot be calibrated or calibration was switched off.
    pub(super) report: Option<Calibration>,
}

impl CalibratedViews {
    /// The views that Gaussians are made of.
    pub(super) fn modelled(&self) -> &InFrame<Working, Vec<View>> {
        self.flipped.as_ref().unwrap_or(&self.working)
    }

    /// The views in the caller's frame, with corrected cameras.
    pub(super) fn in_given_frame(&self) -> &[View] {
        self.corrected.as_ref().map_or(&self.working, |corrected| corrected)
    }
}

/// Corrects the cameras and the plane of symmetry where the silhouettes disagree. A box of the caller's that stands off
/// the plane y = 0 has a plane of symmetry of its own: the views are moved into its frame first.
pub(super) fn calibrate(run: &mut Run) -> Result<()> {
    let options = &run.plan.options;
    let off_plane = run.plan.place_off_plane();
    let views = match &off_plane {
        Some(place) => in_frame_of_box(run.pinholes.to_vec(), place),
        None => run.pinholes.to_vec(),
    };
    let Calibrated { moved, report, left_out } = match options.calibrate {
        Calibrate::Auto => calibrate::calibrate(&views, run.context)?,
        Calibrate::Off => Calibrated::default(),
    };
    let count = usize::from(left_out.is_some());
    plan::note(&mut run.left_out, "calibration", left_out.unwrap_or_default(), count);
    let moved = match off_plane {
        Some(place) => Some(Moved::out_of_box(moved, &views, &place.vehicle_from_box())),
        None => moved,
    };
    let (working, corrected, given_from_working) = match moved {
        Some(Moved { views, in_vehicle, vehicle_from_corrected }) => {
            (views, Some(InFrame::new(in_vehicle)), Some(vehicle_from_corrected))
        }
        None => (views, None, None),
    };
    let flipped = (options.symmetry == SymmetryMode::Flip)
        .then(|| InFrame::new(working.iter().cloned().chain(working.iter().map(mirror::mirrored)).collect()));
    run.views.set(CalibratedViews {
        working: InFrame::new(working),
        corrected,
        flipped,
        given_from_working: GivenFromWorking(given_from_working),
        report,
    });
    Ok(())
}

/// The views with cameras in the box's own frame.
fn in_frame_of_box(mut views: Vec<View>, place: &Place) -> Vec<View> {
    let vehicle_from_box = place.vehicle_from_box();
    for view in &mut views {
        let pose = &mut view.camera.vehicle_from_camera;
        *pose = pose_from_box(&vehicle_from_box, pose);
    }
    views
}
