//! `vg align`: the similarity from a scene's world to the vehicle's frame, from camera centres somebody measured.

use crate::args::AlignArgs;
use crate::files;
use crate::job::{Failure, Outcome, Result};
use std::fmt::Write;
use vg::io;

/// Fewer centres leave the turn about their line open.
const FEWEST: usize = 3;

/// Fits, writes, and says how well it fits.
pub(crate) fn run(args: &AlignArgs) -> Result {
    let known = io::read_known_centers(&args.known_centers)?;
    if known.len() < FEWEST {
        let (path, n) = (args.known_centers.display(), known.len());
        return Err(Failure::job(format!(
            "{path}: {n} camera centres; expected at least {FEWEST}, not on one line"
        )));
    }
    let alignment = io::vehicle_from_known_centers(&args.scene, &known)?;
    files::refuse_clashes(std::slice::from_ref(&args.output), std::slice::from_ref(&args.known_centers))?;
    files::prepare(&args.output)?;
    io::write_vehicle_from_world(&args.output, &alignment.vehicle_from_world)?;

    let residuals = &alignment.residuals;
    let rms = (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64).sqrt();
    let scale = alignment.vehicle_from_world.scale;
    let mut text = format!("{}: scale {scale:.6}, rms residual {rms:.4} m", args.output.display());
    for ((name, _), residual) in known.iter().zip(residuals) {
        let _ = write!(text, "\n  {name}: {residual:.4} m");
    }
    Ok(Outcome::done(text))
}
