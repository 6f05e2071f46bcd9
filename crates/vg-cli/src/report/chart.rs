//! Chart of the stage times: one bar with a legend.

use super::text::{escaped, ms};
use std::fmt::Write;
use vg::pipeline::Stage;

/// Length of the bar in its own units.
const LENGTH: f64 = 1000.0;

const HEIGHT: f64 = 36.0;

/// Stages shorter than this appear only in the legend, units of the bar.
const LEAST: f64 = 0.5;

/// Stages that take less had nothing to do, milliseconds.
const IDLE_MS: f64 = 0.005;

/// Fixed colours of the stages, distinguishable on white and on black.
const COLORS: [(&str, &str); 10] = [
    ("plan", "#7f8c9b"),
    ("undistort", "#c9a227"),
    ("calibrate", "#e07b39"),
    ("prior", "#3f7fd1"),
    ("pixels", "#56b3c9"),
    ("head", "#4aa564"),
    ("symmetry", "#a06cc4"),
    ("start", "#8c6d4f"),
    ("refine", "#d1495b"),
    ("check", "#b8a9c9"),
];

/// Colour of other stages and of the time between stages.
const OTHER: &str = "#9aa0a6";

/// The bar and its legend.
pub(super) fn stages(stages: &[Stage], total_ms: f64) -> String {
    let rest = total_ms - stages.iter().map(|s| s.ms).sum::<f64>();
    let all: Vec<(&str, f64)> = stages
        .iter()
        .filter(|s| s.ms >= IDLE_MS)
        .map(|s| (s.name, s.ms))
        .chain((rest > 0.01 * total_ms).then_some(("other", rest)))
        .collect();
    let whole = all.iter().map(|(_, ms)| ms).sum::<f64>().max(f64::MIN_POSITIVE);

    let mut bar = format!(
        "<svg class=\"bar\" viewBox=\"0 0 {LENGTH} {HEIGHT}\" preserveAspectRatio=\"none\" role=\"img\" \
         aria-label=\"Share of each stage in the time\">"
    );
    let (mut legend, mut from) = (String::from("<ul class=\"key\">"), 0.0);
    for (name, took) in all {
        let (name, color, share) = (escaped(name), color(name), took / whole);
        let length = share * LENGTH;
        if length >= LEAST {
            let _ = write!(
                bar,
                "<rect x=\"{from:.2}\" y=\"0\" width=\"{length:.2}\" height=\"{HEIGHT}\" fill=\"{color}\">\
                 <title>{name}: {}</title></rect>",
                ms(took)
            );
        }
        from += length;
        let _ = write!(
            legend,
            "<li><span class=\"swatch\" style=\"background:{color}\"></span>{name} <b>{}</b> <small>{:.0} %</small></li>",
            ms(took),
            100.0 * share
        );
    }
    format!("{bar}</svg>{legend}</ul>")
}

fn color(stage: &str) -> &'static str {
    COLORS.iter().find(|(name, _)| *name == stage).map_or(OTHER, |(_, color)| color)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_shares_of_the_time_and_the_rest_is_shown_as_other() {
        let all = [
            Stage { name: "prior", ms: 60.0 },
            Stage { name: "plan", ms: 0.02 },
            Stage { name: "new", ms: 20.0 },
        ];
        let svg = stages(&all, 100.0);
        assert!(svg.contains("x=\"0.00\" y=\"0\" width=\"600.00\""), "{svg}");
        assert!(svg.contains("other <b>20.0 ms</b> <small>20 %"), "{svg}");
        // `plan` is too short for the bar, but in the legend.
        assert_eq!((svg.matches("<rect").count(), svg.matches("<li>").count()), (3, 4));
        assert!(!stages(&[], 0.0).contains("NaN"));
    }
}
