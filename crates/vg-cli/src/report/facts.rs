//! The run's own report as rows for the page.

use super::text::{decimals, number, psnr};
use crate::shown;
use vg::View;
use vg::calibrate::{Calibration, Verdict};
use vg::pipeline::{BudgetPlan, InputError, Report};
use vg::prior::{BoxSource, NetworkFit, PhotoFit, PointFit};
use vg::refine::{Densified, Refinement, Stop};
use vg::relight::Relighting;
use vg::scene::Mask;
use vg::symmetry::{Completion, SymmetryMode};

/// Names and values.
type Rows = Vec<(&'static str, String)>;

/// A part of the report.
pub(super) struct Part {
    pub(super) heading: &'static str,
    pub(super) rows: Rows,
}

/// The parts that this run has.
pub(super) fn parts(report: &Report) -> Vec<Part> {
    let part = |heading, rows: Option<Rows>| Some(Part { heading, rows: rows? });
    let ours = report.settings.vehicle().is_some();
    let vehicle = report.vehicle.map(|v| {
        let [length, width, height] =
            std::array::from_fn(|k| format!("{:.2} ± {:.2} m", v.size_m[k], v.uncertainty_m[k]));
        vec![("length", length), ("width, often without the outer mirrors", width), ("height", height)]
    });
    let working_box = report.working_box.map(|b| {
        let source = match b.source {
            BoxSource::Given => "the given size and the silhouettes",
            BoxSource::Estimated => "the silhouettes",
        };
        vec![
            ("bounded by", source.into()),
            ("length, width, height", lengths(b.size_m)),
            ("lowest corner", lengths(b.low_m)),
        ]
    });
    let masks = report.masks.map(|m| {
        let both = [m.uncovered_before, m.uncovered_after].map(|share| 100.0 * share);
        vec![("vehicle pixels not covered by it", change(both, "%"))]
    });
    [
        part("The vehicle's size", vehicle),
        part("Completion of the unseen side", ours.then(|| symmetry(&report.symmetry))),
        part("Relighting of the mirror images", report.relight.as_ref().map(relight)),
        part("Calibration of the cameras", report.calibration.as_ref().map(calibration)),
        part("Search box of the prior, larger than the vehicle", working_box),
        part("Surface correction by photo-consistency", report.photo.as_ref().map(photo)),
        part("Surface correction by the masks", masks),
        part("Surface correction by measured points", report.cloud.as_ref().map(points)),
        part("Depth from a network", report.network.as_ref().map(network)),
        part("Budget", report.plan.as_ref().map(budget)),
        part("Refinement", report.refinement.as_ref().map(refinement)),
        part("Check of the model in its input views", report.input_error.map(|error| check(error, report))),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn symmetry(done: &Completion) -> Rows {
    let rule = match done.mode {
        SymmetryMode::Auto => "unobserved parts are mirrored",
        SymmetryMode::Always => "all of the denser side is mirrored",
        SymmetryMode::Never => "nothing is mirrored",
        SymmetryMode::Flip => "the photographs are mirrored",
    };
    vec![
        ("rule", rule.into()),
        ("side with more Gaussians", format!("{:?}", done.reference_side).to_lowercase()),
        ("mirror images", shown::count(done.cloned)),
        ("observed Gaussians replaced by mirror images", shown::count(done.replaced)),
        ("mirror images left out, observed anyway", shown::count(done.not_needed)),
    ]
}

fn relight(light: &Relighting) -> Rows {
    vec![
        ("ratio of light from the left to light from the right", number(light.left_over_right.into())),
        ("direction to the sun: forward, left, up", light.sun.map(|v| format!("{v:.2}")).join(", ")),
        ("mirror images corrected", shown::count(light.clones)),
    ]
}

fn calibration(found: &Calibration) -> Rows {
    let verdict = match found.verdict {
        Verdict::NotNeeded => "not needed",
        Verdict::Accepted => "accepted, the cameras were corrected",
        Verdict::Refused => "refused, the cameras are as given",
    };
    let mut rows = vec![("verdict", verdict.into()), ("reason", found.why.clone())];
    if found.verdict != Verdict::NotNeeded {
        rows.extend([
            (
                "plane of symmetry: yaw, roll",
                format!("{}°, {}°", number(found.yaw_degrees), number(found.roll_degrees)),
            ),
            ("plane of symmetry: offset", format!("{} m", number(found.lateral_m))),
        ]);
    }
    rows.push((
        "mask pixels covered by the hull of the other views",
        change([found.coverage_before, found.coverage_after].map(|share| 100.0 * share), "%"),
    ));
    rows.push((
        "mean distance of silhouette edges to that hull",
        change([found.edge_error_before_px, found.edge_error_after_px], "px"),
    ));
    if let (Some(before), Some(after)) = (found.held_out_before_px, found.held_out_after_px) {
        rows.push(("mean distance of held-out edges", change([before, after], "px")));
    }
    rows
}

fn photo(fit: &PhotoFit) -> Rows {
    vec![
        ("patches searched in other views", shown::count(fit.patches)),
        ("patches found", shown::count(fit.found)),
        ("their distance to it", change([fit.before_m, fit.after_m].map(|m| 1e3 * m), "mm")),
    ]
}

fn points(fit: &PointFit) -> Rows {
    vec![
        ("points used", shown::count(fit.used)),
        ("points outside the silhouettes", shown::count(fit.outside)),
        ("their distance to it", change([fit.before_m, fit.after_m].map(|m| 1e3 * m), "mm")),
    ]
}

fn network(fit: &NetworkFit) -> Rows {
    let mut rows = vec![
        ("name", fit.prior.clone()),
        ("size of its input pictures", format!("{} x {}", fit.size[0], fit.size[1])),
        ("metres per unit", number(fit.scale)),
        ("scale corrected by the cameras", if fit.rescaled { "yes" } else { "no" }.into()),
        ("vehicle pixels without depth", shown::count(fit.without_depth)),
    ];
    if let Some(degrees) = fit.ray_degrees {
        rows.push(("angle of its rays to the cameras' rays", format!("{}°", number(degrees))));
    }
    rows
}

fn budget(plan: &BudgetPlan) -> Rows {
    let most = plan.chosen.max_views.map_or("all".into(), |n| n.to_string());
    vec![
        ("given", format!("{} s", number(plan.budget_s))),
        ("predicted", format!("{} s", number(plan.predicted_s))),
        ("taken", format!("{} s{}", number(plan.took_s), if plan.kept { "" } else { ", over budget" })),
        ("depth from", plan.chosen.prior.name().into()),
        ("resolution, fraction of width and height", number(plan.chosen.resolution)),
        ("maximum number of views", most),
    ]
}

fn refinement(done: &Refinement) -> Rows {
    let why = match done.stop {
        Stop::Done => "all steps are done",
        Stop::HeldOut => "the held-out view no longer improved",
        Stop::Diverged => "the error grew: the steps are too large",
        Stop::Unseen => "no view sees the model",
    };
    let mut rows = vec![
        ("steps planned", shown::count(done.iterations as usize)),
        ("steps made", shown::count(done.made as usize)),
        ("steps in the result", shown::count(done.kept as usize)),
        ("reason for stopping", why.into()),
        ("PSNR of the optimised views", change(done.psnr_db, "dB")),
    ];
    if let Some(Densified { cloned, split, pruned, .. }) = done.densified {
        rows.push(("Gaussians cloned, split, pruned", [cloned, split, pruned].map(shown::count).join(", ")));
    }
    if let Some(held_out) = &done.held_out {
        rows.push(("held-out view", held_out.view.clone()));
        rows.push(("PSNR of the held-out view", change(held_out.psnr_db, "dB")));
    }
    rows
}

fn check(used: InputError, report: &Report) -> Rows {
    let given = report.input_error_by_given_cameras.unwrap_or(used);
    let both = |text: &dyn Fn(InputError) -> String| match given == used {
        true => text(used),
        false => format!("{} (by the cameras as given {})", text(used), text(given)),
    };
    vec![
        ("PSNR", both(&|e| format!("{}\u{a0}dB", psnr(e.psnr_db)))),
        ("silhouette IoU", both(&|e| decimals(Some(e.silhouette_iou), 4))),
        (
            "smallest coverage of a mask",
            both(&|e| format!("{}\u{a0}%", decimals(Some(100.0 * e.mask_covered), 1))),
        ),
    ]
}

fn lengths(metres: [f64; 3]) -> String {
    format!("{} m", metres.map(|m| format!("{m:.2}")).join(", "))
}

fn change(values: [f64; 2], unit: &str) -> String {
    let [before, after] = values.map(number);
    // No line break before the unit.
    match before == after {
        true => format!("{before}\u{a0}{unit}"),
        false => format!("{before} → {after}\u{a0}{unit}"),
    }
}

/// Counts after each step, from photographs to Gaussians.
pub(super) fn counts(views: &[View], report: &Report) -> Vec<(&'static str, usize)> {
    let used = || views.iter().filter(|v| report.views_used.contains(&v.name));
    let pixels = |v: &View| v.camera.width as usize * v.camera.height as usize;
    let vehicle = |v: &View| v.mask.as_ref().map_or(pixels(v), Mask::vehicle_pixels);
    let mut rows = vec![
        ("photographs given", views.len()),
        ("photographs used", report.views_used.len()),
        ("pixels of the used photographs", used().map(pixels).sum()),
        ("pixels in their masks", used().map(vehicle).sum()),
    ];
    let symmetry = &report.symmetry;
    let divides = report.refinement.as_ref().is_some_and(|r| r.densified.is_some());
    // After densification, the original Gaussians can no longer be told from the new ones.
    if report.settings.vehicle().is_some() && !divides {
        let placed = report.gaussians + symmetry.replaced - symmetry.cloned;
        rows.extend([
            ("Gaussians placed from pixels", placed),
            ("of these, replaced by mirror images", symmetry.replaced),
            ("mirror images added", symmetry.cloned),
        ]);
    }
    rows.push(("Gaussians of the model", report.gaussians));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unchanged_value_is_written_once() {
        assert_eq!(change([0.5, 0.25], "px"), "0.5 → 0.25\u{a0}px");
        assert_eq!(change([99.98, 99.98], "%"), "99.98\u{a0}%");
    }
}
