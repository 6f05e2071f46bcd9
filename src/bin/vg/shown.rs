//! Progress on a terminal, and numbers as people read them.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::ops::ControlFlow;
use vg::progress::Progress;

/// Steps of the bar of a reconstruction: finer than columns of a terminal.
const STEPS: u64 = 1000;

/// What a bar of stages looks like.
const STAGE: &str = "{wide_bar} {msg:9} {elapsed:>4}";

/// A bar on standard error, where that is a terminal; else nothing.
pub(crate) struct Bar {
    bar: ProgressBar,
}

impl Bar {
    /// Of one reconstruction, or of a refinement alone.
    pub(crate) fn of_reconstruction() -> Self {
        Self::with(STEPS, STAGE)
    }

    /// Of `n` pictures.
    pub(crate) fn of_pictures(n: usize) -> Self {
        Self::with(n as u64, "{wide_bar} {pos}/{len} {elapsed:>4}")
    }

    fn with(length: u64, template: &str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// Where a reconstruction stands.
    pub(crate) fn show(&self, progress: Progress) -> ControlFlow<()> {
        match progress.loss {
            Some(loss) => self.bar.set_message(format!("{}, loss {loss:.5}", progress.stage)),
            None => self.bar.set_message(progress.stage),
        }
        self.bar.set_position((progress.overall * STEPS as f64) as u64);
        // Time goes on while a stage stands; no thread of its own shows that.
        self.bar.tick();
        ControlFlow::Continue(())
    }

    /// One more picture.
    pub(crate) fn advance(&self) {
        self.bar.inc(1);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// `1 234 567`
pub(crate) fn count(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

/// `4.63 x 1.89 x 1.45 m`, of the lowest and the highest centre.
pub(crate) fn extent((low, high): &([f32; 3], [f32; 3])) -> String {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| high[k] - low[k]);
    format!("{x:.2} x {y:.2} x {z:.2} m")
}

/// Length, width and height with their uncertainty, where it is the same for all to a centimetre once.
pub(crate) fn size(vehicle: &vg::pipeline::VehicleSize) -> String {
    let [l, w, h] = vehicle.size_m;
    let worst = vehicle.uncertainty_m.into_iter().fold(0.0, f64::max);
    format!("{l:.2} x {w:.2} x {h:.2} m (± {worst:.2})")
}
