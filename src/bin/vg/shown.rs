//! Progress on a terminal, and numbers as people read them.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::ops::ControlFlow;
use vg::progress::Progress;

/// Steps of the bar per stage.
const STEPS: u64 = 100;

/// The stages in order, as a reconstruction reports them; no kind has all.
const STAGES: [&str; 10] =
    ["plan", "undistort", "calibrate", "prior", "pixels", "head", "symmetry", "start", "refine", "check"];

/// What a bar of stages looks like.
const STAGE: &str = "{wide_bar} {msg:9} {elapsed:>4}";

/// A bar on standard error, where that is a terminal; else nothing.
pub(crate) struct Bar {
    bar: ProgressBar,
    /// The stage it begins with.
    first: usize,
}

impl Bar {
    /// Of one reconstruction.
    pub(crate) fn of_reconstruction() -> Self {
        Self::with(STAGES.len() as u64 * STEPS, STAGE)
    }

    /// Of a refinement alone: of the stages, it has the one.
    pub(crate) fn of_refinement() -> Self {
        let first = STAGES.iter().position(|s| *s == "refine").unwrap_or(0);
        let mut bar = Self::with(STEPS, STAGE);
        bar.first = first;
        bar
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
        Self { bar, first: 0 }
    }

    /// Where a reconstruction stands.
    pub(crate) fn show(&self, progress: Progress) -> ControlFlow<()> {
        match progress.loss {
            Some(loss) => self.bar.set_message(format!("{}, loss {loss:.5}", progress.stage)),
            None => self.bar.set_message(progress.stage),
        }
        // Time goes on while a stage stands; no thread of its own shows that.
        self.bar.tick();
        if let Some(stage) = STAGES.iter().position(|s| *s == progress.stage) {
            self.bar.set_position(
                stage.saturating_sub(self.first) as u64 * STEPS + (progress.fraction * STEPS as f64) as u64,
            );
        }
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
