//! One point of a sweep: settings, and what they cost and are worth.

use crate::args::{DepthArgs, MethodArgs};
use crate::eval::measure::Measured;
use crate::job::{Failure, Result, USAGE};
use clap::Parser;
use serde::Serialize;
use vg::pipeline::Options;

/// A point as it was asked for.
pub(super) struct Point {
    pub(super) name: String,
    pub(super) settings: Options,
    /// Metres per number in the depth files, instead of what the scene says.
    pub(super) depth_scale: Option<f64>,
}

/// The options of one point, as `vg eval` has them.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct PointArgs {
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    depth: DepthArgs,
}

impl Point {
    /// Of `[NAME:] OPTIONS`, after the options that all points have. Words are separated by white space.
    pub(super) fn read(text: &str, common: &str) -> Result<Self> {
        let (name, options) = match text.split_once(':') {
            Some((name, options)) if !name.trim_start().starts_with('-') => (name.trim(), options.trim()),
            _ => (text.trim(), text.trim()),
        };
        let words = common.split_whitespace().chain(options.split_whitespace());
        let args = PointArgs::try_parse_from(words).map_err(|e| {
            let message = format!("--point \"{text}\": {}", crate::one_line(&e.render().to_string()));
            Failure { message, code: USAGE }
        })?;
        if args.method.cloud.is_some() {
            let message = format!("--point \"{text}\": --cloud is not for a sweep");
            return Err(Failure { message, code: USAGE });
        }
        let name = if name.is_empty() { "default" } else { name }.to_owned();
        Ok(Self { name, settings: args.method.options()?, depth_scale: args.depth.depth_scale })
    }
}

/// What one point costs and is worth, over all splits.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) point: String,
    /// Mean over the splits of the median over the repeats.
    pub(super) seconds: f64,
    /// Of the means over the splits, the least and the most of the repeats.
    pub(super) seconds_range: [f64; 2],
    /// Standard error of the mean PSNR over the splits; `None` of one split.
    pub(super) psnr_standard_error_db: Option<f64>,
    /// No other point is both faster and nearer.
    pub(super) on_front: bool,
    #[serde(flatten)]
    pub(super) measured: Measured,
}

/// What was measured of one point: the errors of each split, and the seconds of each repeat of it.
#[derive(Default)]
pub(super) struct Runs {
    pub(super) measured: Vec<Measured>,
    /// `[split][repeat]`
    pub(super) seconds: Vec<Vec<f64>>,
}

impl Runs {
    /// `None` where nothing was measured.
    pub(super) fn row(mut self, point: &str) -> Option<Row> {
        let measured = crate::eval::measure::mean(&self.measured.iter().collect::<Vec<_>>())?;
        let splits = self.seconds.len() as f64;
        let repeats = self.seconds[0].len();
        let of_repeat = |r: usize| self.seconds.iter().map(|s| s[r]).sum::<f64>() / splits;
        let means: Vec<f64> = (0..repeats).map(of_repeat).collect();
        let medians = self.seconds.iter_mut().map(|s| crate::eval::measure::median(s));
        let seconds = medians.sum::<f64>() / splits;
        let psnr = self.measured.iter().map(|m| m.errors.psnr_db);
        let squares = psnr.map(|p| (p - measured.errors.psnr_db).powi(2)).sum::<f64>();
        Some(Row {
            point: point.to_owned(),
            seconds,
            seconds_range: [
                means.iter().copied().fold(f64::INFINITY, f64::min),
                means.iter().copied().fold(0.0, f64::max),
            ],
            psnr_standard_error_db: (splits > 1.0).then(|| (squares / (splits - 1.0) / splits).sqrt()),
            on_front: false,
            measured,
        })
    }
}

/// Marks the rows that no other row beats in both time and PSNR.
pub(super) fn mark_front(rows: &mut [Row]) {
    let beats = |a: &Row, b: &Row| {
        let (quicker, nearer) =
            (a.seconds <= b.seconds, a.measured.errors.psnr_db >= b.measured.errors.psnr_db);
        let differs = a.seconds < b.seconds || a.measured.errors.psnr_db > b.measured.errors.psnr_db;
        quicker && nearer && differs
    };
    for i in 0..rows.len() {
        rows[i].on_front = !rows.iter().any(|other| beats(other, &rows[i]));
    }
}
