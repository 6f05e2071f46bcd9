//! `vg align`: the similarity from a scene's world to the vehicle's frame, from a scan, from measured camera centres,
//! from the vehicle's size, or from a matrix.

use crate::args::{AlignArgs, Mode};
use crate::files::{Kind, Results};
use crate::guard::Inputs;
use crate::job::{self, Failure, Outcome, Result};
use crate::{files, shown};
use std::fmt::Write;
use std::path::Path;
use vg::Error;
use vg::align::{Heading, ScanAlignment, folder_to_scan, masks_of, scan_of, to_box};
use vg::geometry::Similarity;
use vg::io::{self, FitQuality, MaskedViews};
use vg::progress::Threads;

/// Smallest number of camera centres; two leave the rotation about their line undetermined.
const FEWEST: usize = 3;

/// A similarity and how well it fits.
struct Found {
    vehicle_from_world: Similarity,
    quality: Option<FitQuality>,
    /// Details for the user, one line each.
    lines: Vec<String>,
    /// Warnings for the user.
    notes: Vec<String>,
}

/// Finds and writes the similarity, and prints how well it fits.
pub(crate) fn run(args: &AlignArgs) -> Result {
    let mode = args.mode();
    let scan = match mode {
        Mode::Scan(named) => {
            Some(scan_of(&args.scene, named).map_err(|e| self::named(e, &args.scene, named))?)
        }
        _ => None,
    };
    let input = match mode {
        Mode::Scan(_) | Mode::Box(_) => scan.clone(),
        Mode::Centers(path) | Mode::Matrix(path) => Some(path.to_owned()),
    };
    let results = Results::new([(Kind::Json, Some(&args.output))]);
    results.prepare(&Inputs::for_alignment().files(&input).scene(&args.scene))?;
    let found = Threads::new(args.threads)?.run(|| match mode {
        Mode::Scan(_) => by_scan(args, scan.as_deref().unwrap_or(Path::new(""))),
        Mode::Centers(path) => by_centers(args, path),
        Mode::Box(size) => by_box(args, size),
        Mode::Matrix(path) => by_matrix(args, path),
    })?;
    let similarity = io::alignment_text(&found.vehicle_from_world, found.quality)?;
    files::write(&args.output, |out| out.write_all(similarity.as_bytes()))?;
    let mut text = format!("{}: scale {:.6}", shown::path(&args.output), found.vehicle_from_world.scale);
    if let Some(quality) = found.quality {
        let _ = write!(text, ", residual {:.4} m, confidence {:.2}", quality.residual_m, quality.confidence);
    }
    found.notes.iter().for_each(|note| job::note(note));
    found.lines.iter().for_each(|line| {
        let _ = write!(text, "\n  {}", shown::line(line));
    });
    Ok(results.outcome(Outcome::done(text)))
}

/// Finds the similarity to a scan: `scan`, or the scan in the scene's folder.
pub(crate) fn align_to_scan(
    scene: &Path,
    scan: Option<&Path>,
    heading: Heading,
    threads: &Threads,
) -> Result<ScanAlignment> {
    Ok(threads.run(|| by_masks(scene, scan, heading))?.1)
}

fn by_masks(path: &Path, scan: Option<&Path>, heading: Heading) -> Result<(MaskedViews, ScanAlignment)> {
    folder_to_scan(path, scan, heading).map_err(|e| named(e, path, scan))
}

fn by_scan(args: &AlignArgs, path: &Path) -> Result<Found> {
    let (scene, found) = by_masks(&args.scene, Some(path), args.heading)?;
    let mut lines = vec![masks_line(found.views, &scene)];
    lines.push(format!(
        "outlines differ by {:.2} pixels on average, with front and rear swapped by {:.2}",
        found.residual_px, found.other_px
    ));
    lines.push(format!("{} sparse points lie within {:.4} m of the scan", found.points, found.points_m));
    let quality = FitQuality { residual_m: found.residual_m, confidence: found.confidence };
    let notes = scene.notes;
    Ok(Found { vehicle_from_world: found.vehicle_from_world, quality: Some(quality), lines, notes })
}

fn by_box(args: &AlignArgs, size: [f64; 3]) -> Result<Found> {
    let scene = masks_of(&args.scene)?;
    let found = to_box(&scene.views, &scene.points, size, args.heading);
    let found = found.map_err(|e| named(e, &args.scene, None))?;
    let [l, w, h] = found.found_m;
    let lines = vec![
        masks_line(found.views, &scene),
        format!("the visual hull of the masks measures {l:.3} x {w:.3} x {h:.3} m"),
        format!("front decided by view {}", found.heading_view),
    ];
    let quality = FitQuality { residual_m: found.residual_m, confidence: found.confidence };
    let notes = scene.notes;
    Ok(Found { vehicle_from_world: found.vehicle_from_world, quality: Some(quality), lines, notes })
}

fn by_centers(args: &AlignArgs, path: &Path) -> Result<Found> {
    let known = io::read_known_centers(path)?;
    if known.len() < FEWEST {
        let (path, n) = (path.display(), known.len());
        return Err(Failure::job(format!(
            "{path}: found {n} camera centres; expected at least {FEWEST} that are not on one line"
        )));
    }
    let alignment = io::vehicle_from_known_centers(&args.scene, &known)?;
    let pairs = known.iter().zip(alignment.residuals.iter().zip(&alignment.kept));
    let line = |((name, _), (residual, kept)): (&(String, _), (&f64, &bool))| {
        format!(
            "{name}: {residual:.4} m{}",
            if *kept { "" } else { ", left out: inconsistent with the others" }
        )
    };
    let quality = FitQuality { residual_m: alignment.residual(), confidence: alignment.confidence() };
    let lines = pairs.map(line).collect();
    let vehicle_from_world = alignment.similarity;
    Ok(Found { vehicle_from_world, quality: Some(quality), lines, notes: Vec::new() })
}

fn by_matrix(args: &AlignArgs, path: &Path) -> Result<Found> {
    // A path that is not a scene is reported.
    let options = io::SceneOptions { vehicle_from_world: Some(io::read_matrix(path)?), ..Default::default() };
    io::list_scene(&args.scene, &options)?;
    let vehicle_from_world = options.vehicle_from_world.unwrap_or(Similarity::IDENTITY);
    Ok(Found { vehicle_from_world, quality: None, lines: Vec::new(), notes: Vec::new() })
}

fn masks_line(used: usize, scene: &MaskedViews) -> String {
    match scene.views.len() + scene.unmasked - used {
        0 => format!("{used} masks"),
        1 => format!("{used} masks; 1 view without a mask was left out"),
        without => format!("{used} masks; {without} views without a mask were left out"),
    }
}

/// The library's error with the argument as it is called on the command line.
fn named(error: Error, scene: &Path, scan: Option<&Path>) -> Failure {
    match error {
        Error::Argument { argument, found, allowed } => Failure::job(match argument.as_str() {
            "heading" => format!("--heading: {found}; allowed: {allowed}"),
            "scan" => {
                let scan = scan.map_or_else(String::new, |path| format!(" {}", path.display()));
                format!("--scan{scan}: {found}; allowed: {allowed}")
            }
            "size" => format!("--box: {found}; allowed: {allowed}"),
            "sparse" => format!("--box: {}: {found}; allowed: {allowed}", scene.display()),
            other => format!("{}: {other}: {found}; allowed: {allowed}", scene.display()),
        }),
        other => other.into(),
    }
}
