//! `vg info`: contents and problems of a PLY file.

use crate::args::InfoArgs;
use crate::files;
use crate::job::{Outcome, Result};
use crate::shown;
use std::fmt::Write;
use vg::Gaussians;
use vg::io::ply::{Content, OtherGaussians, PlyNotes};
use vg::io::splats;
use vg::render::options::ALPHA_THRESHOLD;

/// Largest side of a vehicle, metres, as `--box` accepts it.
const LARGEST_M: f32 = 30.0;

/// Smallest length of a vehicle, metres.
const SMALLEST_M: f32 = 0.1;

/// Largest standard deviation of a Gaussian that a reconstruction makes, metres.
const LARGEST_SCALE_M: f32 = 3.0;

/// Scale that no Gaussian of a vehicle reaches, but exp(s) of a small s in metres exceeds.
const SMALLEST_LINEAR_SCALE: f32 = 1.0;

/// Logistic function of 0 to 1: the range of opacities that were stored without taking logits.
const SIGMOID_OF_UNIT_INTERVAL: std::ops::RangeInclusive<f32> = 0.5..=0.731_06;

/// With fewer opacities than this, all may lie in that range by chance.
const FEW: usize = 100;

/// Describes Gaussians, Gaussians of a kind that is not rendered, or coloured points.
pub(crate) fn run(args: &InfoArgs) -> Result {
    Ok(Outcome::done(match splats::read_content(files::input(&args.file))? {
        Content::Gaussians(gaussians, notes) => describe_gaussians(&gaussians, &notes),
        Content::Others(others) => describe_others(&others),
        Content::Points((positions, _)) => describe_points(&positions),
    }))
}

fn describe_gaussians(gaussians: &Gaussians, notes: &PlyNotes) -> String {
    let mut text = format!("Gaussians: {}\n", shown::count(gaussians.len()));
    let _ = writeln!(text, "SH degree: {}", gaussians.sh_degree());
    text += &extent(gaussians.bounds());
    if !gaussians.is_empty() {
        let mut scales: Vec<f32> = gaussians.scales().as_flattened().to_vec();
        scales.sort_by(f32::total_cmp);
        let mm = |part: f64| scales[((scales.len() - 1) as f64 * part) as usize] * 1e3;
        let _ = writeln!(text, "scales: {:.3} to {:.3} mm, median {:.3} mm", mm(0.0), mm(1.0), mm(0.5));
        let mean = gaussians.opacities().iter().map(|&o| f64::from(o)).sum::<f64>() / gaussians.len() as f64;
        let _ = writeln!(text, "mean opacity: {mean:.3}");
    }
    text + &listed(&problems(gaussians, notes))
}

fn describe_others(others: &OtherGaussians) -> String {
    let mut text = format!("Gaussians: {}\nkind: {}\n", shown::count(others.count), others.kind);
    text += &extent(others.bounds);
    let mut problems = vec![format!("render and refine do not accept it: {}", shown::line(&others.why))];
    problems.extend(others.bounds.and_then(|bounds| implausible_size(Some(&bounds), false)));
    text + &listed(&problems)
}

fn describe_points(positions: &[[f32; 3]]) -> String {
    let bounds = positions.iter().fold(None, |bounds: Option<([f32; 3], [f32; 3])>, p| {
        let (low, high) = bounds.unwrap_or((*p, *p));
        Some((std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))))
    });
    let mut problems = Vec::new();
    problems.extend(implausible_size(bounds.as_ref(), positions.is_empty()));
    format!("points: {}\n", shown::count(positions.len())) + &extent(bounds) + &listed(&problems)
}

fn extent(bounds: Option<([f32; 3], [f32; 3])>) -> String {
    bounds.map_or_else(String::new, |bounds| {
        let (low, high) = bounds;
        let axis = |name: char, k: usize| format!("{name} {:.3} to {:.3}", low[k], high[k]);
        let axes = [axis('x', 0), axis('y', 1), axis('z', 2)].join(", ");
        format!("extent: {} ({axes})\n", shown::extent(&bounds))
    })
}

fn listed(problems: &[String]) -> String {
    match problems {
        [] => "problems: none".into(),
        found => format!("problems:\n  {}", found.join("\n  ")),
    }
}

fn problems(gaussians: &Gaussians, notes: &PlyNotes) -> Vec<String> {
    let mut found = Vec::new();
    if !notes.ignored.is_empty() {
        let names: Vec<String> = notes.ignored.iter().map(|name| shown::line(name)).collect();
        found.push(format!("unknown properties, ignored: {}", names.join(", ")));
    }
    if notes.clamped_scales > 0 {
        found.push(format!("scales too small for a float, raised: {}", shown::count(notes.clamped_scales)));
    }
    found.extend(implausible_size(gaussians.bounds().as_ref(), gaussians.is_empty()));
    found.extend(linear_numbers(gaussians));
    let count = |test: &dyn Fn(usize) -> bool| (0..gaussians.len()).filter(|&i| test(i)).count();
    let invisible = count(&|i| gaussians.opacities()[i] < ALPHA_THRESHOLD);
    if invisible > 0 {
        found.push(format!(
            "Gaussians that are never drawn, opacity below 1/255: {}",
            shown::count(invisible)
        ));
    }
    let huge = count(&|i| gaussians.scales()[i].iter().any(|&s| s > LARGEST_SCALE_M));
    if huge > 0 {
        found.push(format!("Gaussians larger than {LARGEST_SCALE_M} m: {}", shown::count(huge)));
    }
    found
}

/// Signs that scales and opacities were stored directly; the layout requires logarithms and logits.
pub(crate) fn linear_numbers(gaussians: &Gaussians) -> Vec<String> {
    let mut found = Vec::new();
    let smallest = gaussians.scales().as_flattened().iter().copied().fold(f32::INFINITY, f32::min);
    if !gaussians.is_empty() && smallest >= SMALLEST_LINEAR_SCALE {
        found.push(format!(
            "every scale is {smallest:.3} m or more: are scale_0 to scale_2 metres instead of natural logarithms? \
             The layout requires ln(0.01) = -4.6 for 1 cm"
        ));
    }
    if gaussians.len() >= FEW && gaussians.opacities().iter().all(|o| SIGMOID_OF_UNIT_INTERVAL.contains(o)) {
        found.push(
            "every opacity lies between 0.5 and 0.73: does the file hold opacities instead of logits?".into(),
        );
    }
    found
}

fn implausible_size(bounds: Option<&([f32; 3], [f32; 3])>, is_empty: bool) -> Option<String> {
    if is_empty {
        return Some("the file holds no points".into());
    }
    let (low, high) = bounds?;
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
    (!(SMALLEST_M..=LARGEST_M).contains(&longest)).then(|| {
        format!(
            "the longest side is {longest} m; expected {SMALLEST_M} to {LARGEST_M} m: is the unit a metre?"
        )
    })
}
