//! From evidence to reasons. The thresholds lie between the values of good scenes and of known mistakes:
//! docs/VERDICT.md.

use super::{Evidence, Reason, ReasonCode, Severity, ViewEvidence};
use crate::calibrate::{Calibration, Verdict as Corrected};
use crate::pipeline::report::CheckedView;

/// The input of the rules.
pub(in crate::pipeline) struct Judged<'a> {
    pub(in crate::pipeline) evidence: &'a Evidence,
    /// The errors in the input views, in the order of the evidence's views; empty where the check was switched off.
    pub(in crate::pipeline) checked: &'a [CheckedView],
    pub(in crate::pipeline) calibration: Option<&'a Calibration>,
    /// Whether the depth was measured or predicted, not made of the silhouettes.
    pub(in crate::pipeline) has_depth: bool,
    /// Whether the unseen side was completed.
    pub(in crate::pipeline) is_completed: bool,
}

/// All reasons, the most severe first.
pub(in crate::pipeline) fn judge(judged: &Judged) -> Vec<Reason> {
    let mut reasons: Vec<Reason> = [
        lenses(judged),
        masks(judged),
        size(judged),
        depth(judged),
        views(judged),
        symmetry(judged),
        photographs(judged),
        silhouettes(judged),
        pictures(judged),
        corrections(judged),
    ]
    .into_iter()
    .flatten()
    .collect();
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.severity));
    reasons
}

/// Two limits: values beyond the first are doubtful, values beyond the second bad.
#[derive(Clone, Copy)]
struct Limits {
    doubtful: f64,
    bad: f64,
}

impl Limits {
    /// The severity of a number that is good where it is small.
    fn above(self, value: f64) -> Option<Severity> {
        match value {
            v if v > self.bad => Some(Severity::Bad),
            v if v > self.doubtful => Some(Severity::Doubtful),
            _ => None,
        }
    }

    /// The severity of a number that is good where it is large.
    fn below(self, value: f64) -> Option<Severity> {
        Self { doubtful: -self.doubtful, bad: -self.bad }.above(-value)
    }
}

/// The fields that all reasons of one rule share.
struct Rule {
    code: ReasonCode,
    expected: String,
    cause: &'static str,
    remedy: &'static str,
}

impl Rule {
    fn reason(self, severity: Severity, view: Option<&str>, found: String) -> Reason {
        let Self { code, expected, cause, remedy } = self;
        let view = view.map(str::to_owned);
        Reason { code, severity, view, found, expected, cause: cause.into(), remedy: remedy.into() }
    }

    /// A reason for each view with a finding; a single one where there are many.
    fn of_views(&self, found: Vec<(Severity, &str, String)>) -> Vec<Reason> {
        /// The most views that are named; more have a common cause.
        const MOST_NAMED: usize = 2;
        let again = || Rule { expected: self.expected.clone(), ..*self };
        let worst = found.iter().map(|(severity, ..)| *severity).max();
        match (found.len(), worst) {
            (n, Some(worst)) if n > MOST_NAMED => {
                let each: Vec<String> =
                    found.iter().take(MOST_NAMED).map(|(_, view, what)| format!("{view}: {what}")).collect();
                let text = format!("in {n} views, {}, and others", each.join(", "));
                vec![again().reason(worst, None, text)]
            }
            _ => found
                .into_iter()
                .map(|(severity, view, what)| again().reason(severity, Some(view), what))
                .collect(),
        }
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// A lens model without a ray for vehicle pixels folds back, or belongs to another lens.
fn lenses(judged: &Judged) -> Vec<Reason> {
    const WITHOUT_RAY: Limits = Limits { doubtful: 0.01, bad: 0.2 };
    let lost = |view: &ViewEvidence| WITHOUT_RAY.above(view.without_ray);
    let rule = Rule {
        code: ReasonCode::Lens,
        expected: "a lens model that can be inverted wherever the vehicle is".into(),
        cause: "distortion coefficients of another camera, another model or another order",
        remedy: "check the coefficients, or undistort the photographs and give none",
    };
    rule.of_views(each(judged, |view| {
        Some((
            lost(view)?,
            format!("the lens has no ray for {} of the vehicle's pixels", percent(view.without_ray)),
        ))
    }))
}

/// A mask that is vehicle along the picture's border marks the background.
fn masks(judged: &Judged) -> Vec<Reason> {
    const BORDER: Limits = Limits { doubtful: 0.5, bad: 0.9 };
    /// A full mask holds no information, which is another mistake than swapped values.
    const FULL: f64 = 0.999;
    let rule = Rule {
        code: ReasonCode::MaskInverted,
        expected: "background along most of the border: 255 is vehicle, 0 is not".into(),
        cause: "vehicle and background have changed places in the mask",
        remedy: "invert the mask, or take a photograph that shows the whole vehicle",
    };
    rule.of_views(each(judged, |view| {
        let severity = BORDER.above(view.border_share).filter(|_| view.mask_share < FULL)?;
        let found = format!(
            "the mask holds {} of the picture and {} of its border",
            percent(view.mask_share),
            percent(view.border_share)
        );
        Some((severity, found))
    }))
}

/// The findings of a test of each view.
fn each<'a>(
    judged: &Judged<'a>,
    found: impl Fn(&ViewEvidence) -> Option<(Severity, String)>,
) -> Vec<(Severity, &'a str, String)> {
    let of =
        |view: &'a ViewEvidence| found(view).map(|(severity, text)| (severity, view.name.as_str(), text));
    judged.evidence.views.iter().filter_map(of).collect()
}

/// The findings of a test of each view and its errors, for views whose silhouette was not left out.
fn each_checked<'a>(
    judged: &Judged<'a>,
    found: impl Fn(&ViewEvidence, &CheckedView) -> Option<(Severity, String)>,
) -> Vec<(Severity, &'a str, String)> {
    let pairs = judged.evidence.views.iter().zip(judged.checked).enumerate();
    pairs
        .filter(|(i, _)| !is_ignored(judged, *i))
        .filter_map(|(_, (view, checked))| {
            found(view, checked).map(|(s, text)| (s, view.name.as_str(), text))
        })
        .collect()
}

/// Length, width and height against those of road vehicles.
fn size(judged: &Judged) -> Vec<Reason> {
    /// An articulated bus, a lorry with its mirrors, a double-decker; no vehicle is a tenth larger.
    const LARGE: [Limits; 3] = [
        Limits { doubtful: 19.0, bad: 21.0 },
        Limits { doubtful: 2.9, bad: 3.3 },
        Limits { doubtful: 4.5, bad: 5.0 },
    ];
    /// Cars shorter than 2.3 m have been built (1.37 x 0.99 x 1.00 m) but are rare; the lowest are 1.0 m high.
    const SMALL: [Limits; 3] = [
        Limits { doubtful: 2.2, bad: 1.3 },
        Limits { doubtful: 1.1, bad: 0.6 },
        Limits { doubtful: 0.95, bad: 0.7 },
    ];
    /// Shares of the length: a city car is 0.66 of it wide and 0.62 high.
    const WIDE: Limits = Limits { doubtful: 0.75, bad: 1.0 };
    const HIGH: Limits = Limits { doubtful: 0.9, bad: 1.2 };
    const CAUSE_OF_SIZE: &str =
        "poses or depth in another unit than metres, or focal lengths of another picture size";
    const REMEDY: &str = "scale them to metres, or check the intrinsics";
    let Some(size) = judged.evidence.size_m else { return Vec::new() };
    let [length, width, height] = size;
    let found = format!("the vehicle is {length:.2} x {width:.2} x {height:.2} m");
    let far = judged.evidence.nearest_camera_m.filter(|metres| *metres > FAR_M);
    if let Some(metres) = far.filter(|_| size.iter().any(|m| *m > FAR_M)) {
        let rule = Rule {
            code: ReasonCode::FarAway,
            expected: "a vehicle at the origin of its frame, metres from the cameras".into(),
            cause: "poses in world coordinates, UTM for one, or in millimetres",
            remedy: "give vehicle_from_world, or poses in the vehicle's frame in metres",
        };
        return vec![rule.reason(
            Severity::Bad,
            None,
            format!("{found}, its middle {metres:.0} m from the nearest camera"),
        )];
    }
    if let Some(severity) = (0..3).filter_map(|k| LARGE[k].above(size[k])).max() {
        let rule = Rule {
            code: ReasonCode::TooLarge,
            expected: "at most 19 x 2.9 x 4.5 m, the largest on the road".into(),
            cause: match width > length {
                true => "the axes of the poses are not x forward, y left, z up, or a unit other than metres",
                false => CAUSE_OF_SIZE,
            },
            remedy: REMEDY,
        };
        return vec![rule.reason(severity, None, found)];
    }
    // With given depth the model is only as complete as the photographs.
    let longest = length.max(width).max(height);
    let small = match judged.has_depth {
        true => SMALL[0].below(longest),
        false => [0, 2].into_iter().filter_map(|k| SMALL[k].below(size[k])).max(),
    };
    let narrow = SMALL[1].below(width).filter(|_| judged.is_completed && !judged.has_depth);
    if let Some(severity) = small.max(narrow) {
        let rule = Rule {
            code: ReasonCode::TooSmall,
            expected: "at least 2.2 x 1.1 x 0.95 m, the smallest on the road".into(),
            cause: CAUSE_OF_SIZE,
            remedy: REMEDY,
        };
        return vec![rule.reason(severity, None, found)];
    }
    let shape = WIDE.above(width / length).max(HIGH.above(height / length)).filter(|_| !judged.has_depth);
    let rule = Rule {
        code: ReasonCode::Proportions,
        expected: "longer than wide and high".into(),
        cause: "the axes of the poses are not x forward, y left, z up",
        remedy: "turn the poses into the vehicle's frame; vg align finds it from a scan or a box",
    };
    shape.map(|severity| rule.reason(severity, None, found)).into_iter().collect()
}

/// Photographs of vehicles are taken from nearer than this, metres.
const FAR_M: f64 = 1000.0;

/// Given or predicted depth against the silhouettes.
fn depth(judged: &Judged) -> Vec<Reason> {
    const TOO_LONG: Limits = Limits { doubtful: 1.15, bad: 1.4 };
    const INSIDE: Limits = Limits { doubtful: 0.97, bad: 0.8 };
    /// Share of the depth that can lie inside the silhouettes in spite of a wrong unit.
    const BY_CHANCE: f64 = 0.6;
    if !judged.has_depth {
        return Vec::new();
    }
    let inside = judged.evidence.views.iter().filter_map(|view| view.depth_inside);
    let (sum, n) = inside.fold((0.0, 0.0), |(sum, n), inside| (sum + inside, n + 1.0));
    if let Some(scale) = judged.evidence.depth_scale.filter(|_| sum < BY_CHANCE * n)
        && let Some(severity) = TOO_LONG.above(scale.max(scale.recip()))
    {
        let rule = Rule {
            code: ReasonCode::DepthUnit,
            expected:
                "depth in metres along the optical axis, in the unit of the poses: a factor of 0.9 to 1.1"
                    .into(),
            cause: likely_unit(scale),
            remedy: "scale depth or poses (--depth-scale), or leave the depth out (--prior shape)",
        };
        let found = format!("the silhouettes put the surface at about {scale:.3} times the depth");
        return vec![rule.reason(severity, None, found)];
    }
    let rule = Rule {
        code: ReasonCode::DepthOutside,
        expected: "depth whose points lie inside the silhouettes of all views".into(),
        cause: "depth of another frame or camera, along the ray instead of the axis, or masks that do not fit it",
        remedy: "check that depth, mask and pose belong together, or leave the depth out (--prior shape)",
    };
    rule.of_views(each(judged, |view| {
        let outside = 1.0 - view.depth_inside?;
        let found = format!("{} of its depth lies outside the other views' silhouettes", percent(outside));
        Some((INSIDE.below(1.0 - outside)?, found))
    }))
}

/// The unit mistake that explains a factor of `scale` between the depth and the silhouettes.
fn likely_unit(scale: f64) -> &'static str {
    /// Accuracy of the factor.
    const ABOUT: f64 = 1.25;
    let near = |unit: f64| (scale / unit).max(unit / scale) < ABOUT;
    match () {
        () if near(1e-3) => "depth in millimetres",
        () if near(1e-2) => "depth in centimetres",
        () if near(0.0254) => "depth in inches",
        () if near(0.3048) => "depth in feet, or poses whose scale is not metric",
        () if near(1e3) => "poses in millimetres",
        () if near(1e2) => "poses in centimetres",
        () if near(0.3048f64.recip()) => "poses in feet",
        () => "a scale of the poses or of the depth that is not metric",
    }
}

/// The silhouettes against one another.
fn views(judged: &Judged) -> Vec<Reason> {
    const COHERENT: Limits = Limits { doubtful: 0.99, bad: 0.88 };
    /// One view is to blame if this share of the failing rays would meet without it, and this many times as many as
    /// without any other.
    const EXPLAINED: f64 = 0.5;
    const CLEARLY: f64 = 1.5;
    let mut reasons = ignored(judged);
    let views = &judged.evidence.views;
    let worst = views.iter().filter_map(|view| view.coherent).min_by(f64::total_cmp);
    let Some((worst, severity)) = worst.and_then(|worst| Some((worst, COHERENT.below(worst)?))) else {
        return reasons;
    };
    let failing = |but: &ViewEvidence| {
        let others = views.iter().filter(|view| !std::ptr::eq(*view, but)).filter_map(|view| view.coherent);
        let (sum, n) = others.fold((0.0, 0.0), |(sum, n), coherent| (sum + 1.0 - coherent, n + 1.0));
        if n > 0.0 { sum / n } else { 0.0 }
    };
    let mut blamed: Vec<(f64, &ViewEvidence)> =
        views.iter().filter_map(|view| Some((view.blamed?, view))).collect();
    blamed.sort_by(|a, b| b.0.total_cmp(&a.0));
    if let [(most, view), (second, _), ..] = blamed[..]
        && most > EXPLAINED * failing(view)
        && most > CLEARLY * second
        && most > 0.0
    {
        let rule = Rule {
            code: ReasonCode::ViewDisagrees,
            expected: "rays that meet in all silhouettes".into(),
            cause: "the mask, the photograph or the pose of this view belongs to another frame",
            remedy: "check this view, or leave it out (--views)",
        };
        let found = format!("without it {} more of the other masks' rays would meet", percent(most));
        reasons.push(rule.reason(severity, Some(&view.name), found));
        return reasons;
    }
    let rule = Rule {
        code: ReasonCode::ViewsDisagree,
        expected: "rays that meet in all silhouettes".into(),
        cause: "masks or photographs in another order than the poses, or poses and intrinsics that do not belong together",
        remedy: "check that views, masks and poses are of the same frames, and the conventions of the poses",
    };
    let found = format!(
        "in the worst view {} of the mask's rays meet no place that the others have room for",
        percent(1.0 - worst)
    );
    reasons.push(rule.reason(severity, None, found));
    reasons
}

/// Views whose silhouette the calibration left out.
fn ignored(judged: &Judged) -> Vec<Reason> {
    /// The rest of a mask that an occluder cut lies within the model.
    const COVERED: f64 = 0.97;
    let views = judged.evidence.views.iter().enumerate().filter(|(i, _)| is_ignored(judged, *i));
    views
        .map(|(i, view)| {
            let is_cut = judged.checked.get(i).is_none_or(|checked| checked.errors.mask_covered > COVERED);
            let rule = Rule {
                code: ReasonCode::ViewDisagrees,
                expected: "a silhouette that agrees with the others".into(),
                cause: match is_cut {
                    true => "something before the vehicle cuts its mask",
                    false => "the mask, the photograph or the pose of this view belongs to another frame",
                },
                remedy: "check this view's mask and pose, or leave it out (--views)",
            };
            let severity = if is_cut { Severity::Doubtful } else { Severity::Bad };
            let found = "its silhouette contradicts all others and was left out".into();
            rule.reason(severity, Some(&view.name), found)
        })
        .collect()
}

/// Whether the calibration left out the silhouette of the `i`-th view.
fn is_ignored(judged: &Judged, i: usize) -> bool {
    judged.calibration.and_then(|calibration| calibration.views.get(i)).is_some_and(|view| view.ignored)
}

/// The silhouettes against their mirror images.
fn symmetry(judged: &Judged) -> Vec<Reason> {
    const COHERENT: Limits = Limits { doubtful: 0.985, bad: 0.9 };
    let lost = |view: &ViewEvidence| Some(view.coherent.unwrap_or(1.0) - view.coherent_mirrored?);
    let Some(worst) = judged.evidence.views.iter().filter_map(lost).max_by(f64::total_cmp) else {
        return Vec::new();
    };
    let rule = Rule {
        code: ReasonCode::Symmetry,
        expected: "silhouettes that agree with their mirror images at y = 0".into(),
        cause: "the plane y = 0 is not the vehicle's plane of symmetry: its origin lies beside the middle, or axes are swapped",
        remedy: "move the poses into the vehicle's frame (x forward, y left, z up), by vg align for one",
    };
    let found =
        format!("in the worst view {} of the mask's rays miss the mirrored silhouettes", percent(worst));
    COHERENT.below(1.0 - worst).map(|severity| rule.reason(severity, None, found)).into_iter().collect()
}

/// The photographs against one another.
fn photographs(judged: &Judged) -> Vec<Reason> {
    const CORRELATION: Limits = Limits { doubtful: 0.5, bad: 0.4 };
    let rule = Rule {
        code: ReasonCode::Photographs,
        expected: "photographs that show the same things in the same places: a correlation of at least 0.5"
            .into(),
        cause: "photographs in another order than masks and poses, or poses that are not theirs",
        remedy: "check that photographs, masks and poses are of the same frames",
    };
    rule.of_views(each(judged, |view| {
        let found = view.photographs?;
        let text = format!("its brightness correlates by {found:.2} with that of the view that agrees best");
        Some((CORRELATION.below(found)?, text))
    }))
}

/// Loss of intersection over union from sampling alone: a band of about a pixel along the outline.
fn band(view: &ViewEvidence, pixels: f64) -> f64 {
    4.0 / (view.mask_share * pixels).sqrt().max(1.0)
}

/// The model's silhouette against each mask.
fn silhouettes(judged: &Judged) -> Vec<Reason> {
    const MISSING: Limits = Limits { doubtful: 0.04, bad: 0.2 };
    let rule = Rule {
        code: ReasonCode::Silhouette,
        expected: "an intersection over union of at least 0.94".into(),
        cause: "its mask or pose contradicts the others, or the depth",
        remedy: "compare the model with the photograph (vg report), and check this view's mask and pose",
    };
    rule.of_views(each_checked(judged, |view, checked| {
        let iou = checked.errors.silhouette_iou;
        let severity = MISSING.above(1.0 - iou - band(view, view.pixels))?;
        let found =
            format!("the model's silhouette and the mask have an intersection over union of {iou:.3}");
        Some((severity, found))
    }))
}

/// The model's picture against each photograph.
fn pictures(judged: &Judged) -> Vec<Reason> {
    const PSNR_DB: Limits = Limits { doubtful: 19.0, bad: 14.0 };
    let rule = Rule {
        code: ReasonCode::Picture,
        expected: "a PSNR of at least 19 dB in an input view".into(),
        cause: "its photograph, mask or pose belongs to another frame",
        remedy: "compare the model with the photograph (vg report), and check this view",
    };
    rule.of_views(each_checked(judged, |_, checked| {
        let db = checked.errors.psnr_db;
        let found = format!("the model is drawn at {db:.1} dB");
        PSNR_DB.below(db).map(|severity| (severity, found))
    }))
}

/// Errors of the cameras that the calibration could not correct, or had to correct.
fn corrections(judged: &Judged) -> Vec<Reason> {
    /// Edges that miss the hull by less are no reason to doubt a refusal, pixels.
    const EDGES_PX: Limits = Limits { doubtful: 0.5, bad: 5.0 };
    const GIVEN_IOU: f64 = 0.93;
    let Some(calibration) = judged.calibration else { return Vec::new() };
    let edges = calibration.edge_error_before_px;
    if calibration.verdict == Corrected::Refused {
        let rule = Rule {
            code: ReasonCode::CalibrationRefused,
            expected:
                "silhouettes that agree to a fraction of a pixel, or after a correction of a detector's size"
                    .into(),
            cause: "a plane of symmetry more than 0.2 m off, another frame, or poses of other photographs",
            remedy: "check the vehicle's frame and the order of the views",
        };
        let found = format!(
            "silhouettes miss one another by {edges:.2} px, and no correction is believed ({})",
            calibration.why
        );
        return EDGES_PX
            .above(edges)
            .map(|severity| rule.reason(severity, None, found))
            .into_iter()
            .collect();
    }
    let given = judged.checked.iter().map(|view| view.by_given_camera.silhouette_iou);
    let given = given.sum::<f64>() / judged.checked.len().max(1) as f64;
    let rule = Rule {
        code: ReasonCode::CamerasCorrected,
        expected: "poses that are true to a few pixels".into(),
        cause: "poses of a detector or a tracker, each with an error of its own",
        remedy: "take the corrected cameras of the report (calibration.views), or better poses",
    };
    let found = format!(
        "the cameras had to be moved: by those that were given the silhouettes have an intersection over union of {given:.3}"
    );
    let moved = calibration.verdict == Corrected::Accepted && !judged.checked.is_empty() && given < GIVEN_IOU;
    moved.then(|| rule.reason(Severity::Doubtful, None, found)).into_iter().collect()
}
