//! Self-calibration: the plane of symmetry and the cameras, corrected until the silhouettes agree.
//!
//! Poses from a detector or a tracker put the plane of symmetry some centimetres and a degree or two off,
//! and single cameras some pixels. The masks reveal such errors: the hull of all silhouettes and of their mirrored
//! twins must fill every mask. Where it does not, the cameras are moved slightly until it does. [`Calibration`] reports
//! the result; measurements are in docs/CALIBRATION.md.

mod cones;
mod correction;
mod report;
mod samples;
mod solve;

pub use report::{Calibration, Verdict, ViewCalibration};

use crate::prior::volume::{Silhouette, whereabouts};
use cones::{Ball, Meeting};
use correction::Correction;
use rayon::prelude::*;
use samples::Sample;
use solve::{Free, Problem, deficit};
use vg_geometry::progress::Context;
use vg_geometry::{Pose, Result, Similarity};
use vg_scene::mask::Label;
use vg_scene::{Mask, View};

/// Scales of the loss for the plane and for all parameters, metres: from the deficit of a plane that is 3 degrees off
/// down to a few pixels.
const PLANE_SCALES_M: [f64; 2] = [0.2, 0.1];
const ALL_SCALES_M: [f64; 2] = [0.06, 0.03];

/// Limit to which edge errors are clipped, pixels: an occluder must not dominate the mean.
const MOST_EDGE_ERROR_PX: f64 = 20.0;

/// Mean edge error below which the silhouettes agree, pixels: it is 0.004 to 0.006 for ten ray-traced vehicles with
/// exact cameras, and 0.03 for a sedan whose plane is yawed by a degree.
const GOOD_PX: f64 = 0.015;

/// Largest allowed increase of a single view's edge error, pixels.
const WORSE_PX: f64 = 0.25;

/// Part of the held-out error that a correction must remove.
const LEAST_GAIN: f64 = 0.25;

/// Maximum of views. More do not come from a handful of photographs but from a reconstruction that has already made
/// them agree, and the cost is quadratic.
const MOST_VIEWS: usize = 64;

/// Output of the calibration for the stages that follow.
#[derive(Default)]
pub(crate) struct Calibrated {
    /// The views with corrected cameras, in a frame whose y = 0 is the plane of symmetry; masks that an occluder cut
    /// carve nothing. `None` if nothing differs from the caller's views.
    pub(crate) moved: Option<Moved>,
    /// The report; `None` if the views cannot be calibrated.
    pub(crate) report: Option<Calibration>,
    /// Reason why nothing was estimated.
    pub(crate) left_out: Option<&'static str>,
}

/// Corrected views.
pub(crate) struct Moved {
    /// The views in the corrected frame.
    pub(crate) views: Vec<View>,
    /// The views in the caller's frame, with the caller's masks.
    pub(crate) in_vehicle: Vec<View>,
    /// Transform back to the caller's frame.
    pub(crate) vehicle_from_corrected: Similarity,
}

impl Moved {
    /// Adds the transform out of the frame of a box, into which the views were brought, to `moved`.
    pub(crate) fn out_of_box(moved: Option<Self>, in_box: &[View], vehicle_from_box: &Pose) -> Self {
        let mut moved = moved.unwrap_or_else(|| Self {
            views: in_box.to_vec(),
            in_vehicle: in_box.to_vec(),
            vehicle_from_corrected: Similarity::IDENTITY,
        });
        for view in &mut moved.in_vehicle {
            view.camera.vehicle_from_camera = vehicle_from_box.after(&view.camera.vehicle_from_camera);
        }
        let Similarity { rotation, translation, scale } = moved.vehicle_from_corrected;
        let Pose { rotation, translation } = vehicle_from_box.after(&Pose { rotation, translation });
        moved.vehicle_from_corrected = Similarity { scale, rotation, translation };
        moved
    }
}

/// Largest distance from a camera to the vehicle, metres: beyond it, f32 steps along the rays are no longer small
/// against a pixel.
const FARTHEST_M: f64 = 1000.0;

/// Corrects undistorted views until their silhouettes agree.
pub(crate) fn calibrate(views: &[View], context: &Context) -> Result<Calibrated> {
    let nothing = |why| Ok(Calibrated { moved: None, report: None, left_out: Some(why) });
    if views.iter().any(|v| v.mask.is_none()) {
        return nothing("a view has no mask, and the plane can be found from silhouettes only");
    }
    if views.len() < 2 {
        return nothing(
            "there is only one view, whose silhouette agrees with its mirror image for any plane",
        );
    }
    if views.len() > MOST_VIEWS {
        return nothing(
            "there are more than 64 views, which the reconstruction of their poses has already aligned",
        );
    }
    let Some((middle, radius)) = whereabouts(views) else {
        return nothing("the views do not look at a common place near the plane y = 0");
    };
    if !views.iter().all(|v| (v.camera.center() - middle).length() <= FARTHEST_M) {
        return nothing("a camera is more than 1000 m from the vehicle, too far to see a detector's error");
    }
    let ball = Ball { middle, radius };
    let silhouettes: Vec<Silhouette> = context.parallel(|| views.par_iter().map(Silhouette::new).collect());
    let samples = samples::edges(views, middle);
    context.report("calibrate", 0.1)?;

    let none = Correction::none(views.len(), middle);
    let (trusted, before) = context.parallel(|| trusted(views, &silhouettes, ball, &none, &samples));
    let problem = Problem { views, silhouettes: &silhouettes, trusted: &trusted, ball };
    let judge = Judge { views, samples: &samples };
    if judge.error(&before, |_| true) < GOOD_PX {
        let report = context.parallel(|| judge.report(&problem, &none, &before, &before, None));
        let why = "the silhouettes agree to a fraction of a pixel";
        let moved = moved(views, &none, &trusted)?;
        return Ok(Calibrated { moved, report: Some(report), left_out: Some(why) });
    }
    context.report("calibrate", 0.3)?;

    let fitted: Vec<Sample> = samples.iter().filter(|s| !s.held_out).copied().collect();
    let plane = context.parallel(|| problem.fit(&none, &fitted, Free::Plane, &PLANE_SCALES_M));
    context.report("calibrate", 0.5)?;
    let all = context.parallel(|| problem.fit(&plane, &fitted, Free::All, &ALL_SCALES_M));
    context.report("calibrate", 0.9)?;

    let after = context.parallel(|| problem.meetings(&all, &samples, &[]));
    let refusal = judge.refusal(&all, &before, &after);
    let report = context.parallel(|| judge.report(&problem, &all, &before, &after, Some(refusal.clone())));
    let moved = moved(views, if refusal.is_none() { &all } else { &none }, &trusted)?;
    Ok(Calibrated { moved, report: Some(report), left_out: None })
}

/// Which silhouettes are trusted, and the rays' meetings with their cones. A silhouette is distrusted (an occluder cut
/// its mask) if many rays miss by decimetres with it but not without it.
fn trusted(
    views: &[View],
    silhouettes: &[Silhouette],
    ball: Ball,
    none: &Correction,
    samples: &[Sample],
) -> (Vec<bool>, Vec<Meeting>) {
    /// Deficit that no small correction explains, metres.
    const FAR_M: f64 = 0.4;
    /// Share of such rays above which a silhouette is distrusted.
    const MANY: f64 = 0.05;
    let mut trusted = vec![true; views.len()];
    let met = |trusted: &[bool]| Problem { views, silhouettes, trusted, ball }.meetings(none, samples, &[]);
    let far = |met: &[Meeting]| {
        met.iter().filter(|m| deficit(m) > FAR_M).count() as f64 / samples.len().max(1) as f64
    };
    let mut meetings = met(&trusted);
    let mut now = far(&meetings);
    // If only two silhouettes contradict each other, either may be wrong.
    while now > MANY && trusted.iter().filter(|t| **t).count() > 2 {
        let without = |i: usize| {
            let mut others = trusted.clone();
            others[i] = false;
            met(&others)
        };
        let candidates = (0..views.len()).filter(|&i| trusted[i]);
        let tried = candidates.map(|i| (without(i), i));
        let Some((least, i)) = tried.min_by(|a, b| far(&a.0).total_cmp(&far(&b.0))) else { break };
        if far(&least) > 0.5 * now {
            break;
        }
        trusted[i] = false;
        (now, meetings) = (far(&least), least);
    }
    (trusted, meetings)
}

/// The views with the correction applied; `None` if nothing differs from the caller's views.
fn moved(views: &[View], correction: &Correction, trusted: &[bool]) -> Result<Option<Moved>> {
    let still = correction.is_none();
    if still && trusted.iter().all(|t| *t) {
        return Ok(None);
    }
    let mut moved = Moved {
        views: views.to_vec(),
        in_vehicle: views.to_vec(),
        vehicle_from_corrected: Similarity::IDENTITY,
    };
    for (i, trusted) in trusted.iter().enumerate() {
        if !trusted {
            moved.views[i].mask = views[i].mask.as_ref().map(without_background).transpose()?;
        }
        if !still {
            let given = &views[i].camera.vehicle_from_camera;
            moved.views[i].camera.vehicle_from_camera = correction.apply(i, given);
            moved.in_vehicle[i].camera.vehicle_from_camera = correction.own(i).after(given);
        }
    }
    if !still {
        let Pose { rotation, translation } = correction.plane().inverse();
        moved.vehicle_from_corrected = Similarity { scale: 1.0, rotation, translation };
    }
    Ok(Some(moved))
}

/// The mask with unknown pixels instead of background: it carves nothing.
fn without_background(mask: &Mask) -> Result<Mask> {
    let labels = mask.labels().iter().map(|l| if *l == Label::Background { Label::Unknown } else { *l });
    Mask::new(mask.width(), mask.height(), labels.collect())
}

/// Decides whether a correction is better than none.
struct Judge<'a> {
    views: &'a [View],
    samples: &'a [Sample],
}

impl Judge<'_> {
    /// Mean edge error over the chosen samples, pixels.
    fn error(&self, meetings: &[Meeting], choose: impl Fn(&Sample) -> bool) -> f64 {
        let chosen = self.samples.iter().zip(meetings).filter(|(s, _)| choose(s));
        let (sum, n) = chosen.fold((0.0, 0usize), |(sum, n), (sample, meeting)| {
            let i = self.views[sample.view].camera.intrinsics;
            let z = f64::from((meeting.t * sample.direction.z).max(0.05));
            let pixels = (deficit(meeting) - f64::from(sample.margin)).max(0.0) * i.smaller_focal() / z;
            (sum + pixels.min(MOST_EDGE_ERROR_PX), n + 1)
        });
        if n > 0 { sum / n as f64 } else { 0.0 }
    }

    /// Reason to refuse the correction, or `None`.
    fn refusal(&self, correction: &Correction, before: &[Meeting], after: &[Meeting]) -> Option<String> {
        if let Some(bound) = correction.at_limit() {
            return Some(format!("{bound}, the largest error that is corrected"));
        }
        let held_out = |met: &[Meeting]| self.error(met, |s| s.held_out);
        let (had, has) = (held_out(before), held_out(after));
        if has.is_nan() || has > (1.0 - LEAST_GAIN) * had {
            return Some(format!(
                "edges that were held out miss the hull by {has:.2} pixels instead of {had:.2}: too little improvement"
            ));
        }
        (0..self.views.len()).find_map(|view| {
            let of = |met: &[Meeting]| self.error(met, |s| s.held_out && s.view == view);
            let (had, has) = (of(before), of(after));
            (has > had + WORSE_PX).then(|| {
                let name = self.views[view].argument(view);
                format!("{name}: its held-out edges miss the hull by {has:.2} pixels instead of {had:.2}")
            })
        })
    }

    fn report(
        &self,
        problem: &Problem,
        correction: &Correction,
        before: &[Meeting],
        after: &[Meeting],
        refusal: Option<Option<String>>,
    ) -> Calibration {
        let insides = samples::insides(self.views);
        let none = Correction::none(self.views.len(), problem.ball.middle);
        let covered = |c: &Correction| {
            let met = problem.meetings(c, &insides, &[]);
            met.iter().filter(|m| m.inside >= 0.0).count() as f64 / insides.len().max(1) as f64
        };
        let coverage_before = covered(&none);
        let fitted = refusal.is_some();
        let held_out = |met: &[Meeting]| fitted.then(|| self.error(met, |s| s.held_out));
        let (verdict, why) = match refusal {
            None => (Verdict::NotNeeded, "the silhouettes agree".to_owned()),
            Some(None) => (Verdict::Accepted, "held-out edges agree better".to_owned()),
            Some(Some(why)) => (Verdict::Refused, why),
        };
        let [yaw, roll, lateral_m] = correction.plane_numbers();
        Calibration {
            verdict,
            why,
            yaw_degrees: yaw.to_degrees(),
            roll_degrees: roll.to_degrees(),
            lateral_m,
            corrected_from_vehicle: correction.plane().to_row_major(),
            views: (0..self.views.len()).map(|i| self.view(problem, correction, i)).collect(),
            coverage_before,
            coverage_after: if fitted { covered(correction) } else { coverage_before },
            edge_error_before_px: self.error(before, |_| true),
            edge_error_after_px: self.error(after, |_| true),
            held_out_before_px: held_out(before),
            held_out_after_px: held_out(after),
        }
    }

    fn view(&self, problem: &Problem, correction: &Correction, i: usize) -> ViewCalibration {
        let camera = &self.views[i].camera;
        let (rotation, translation) = correction.camera_numbers(i);
        let own = correction.own(i).after(&camera.vehicle_from_camera);
        let pixel = |p: glam::DVec3| {
            let pixel = camera.intrinsics.pixel_from_normalized([p.x / p.z, p.y / p.z]);
            glam::DVec2::from_array(pixel)
        };
        let of = |pose: &Pose| pixel(pose.inverse().transform_point(problem.ball.middle));
        let moved = of(&own) - of(&camera.vehicle_from_camera);
        ViewCalibration {
            name: self.views[i].name.clone(),
            pixels: if moved.is_finite() { moved.length() } else { 0.0 },
            degrees: rotation.length().to_degrees(),
            metres: translation.length(),
            vehicle_from_camera: own.to_row_major(),
            ignored: !problem.trusted[i],
        }
    }
}
