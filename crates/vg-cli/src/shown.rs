//! Progress on a terminal, and formatting of text and numbers.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::ops::ControlFlow;
use std::path::Path;
use vg::progress::Progress;

/// Steps of the progress bar of a reconstruction, more than a terminal has columns.
const STEPS: u64 = 1000;

/// Template of the bar of a reconstruction.
const STAGE: &str = "{wide_bar} {msg:9} {elapsed:>4}";

/// A progress bar on standard error, shown only on a terminal.
pub(crate) struct Bar {
    bar: ProgressBar,
}

impl Bar {
    /// A bar for one reconstruction, or for a refinement alone.
    pub(crate) fn for_reconstruction() -> Self {
        Self::with(STEPS, STAGE)
    }

    /// A bar for `n` pictures.
    pub(crate) fn for_pictures(n: usize) -> Self {
        Self::with(n as u64, "{wide_bar} {pos}/{len} {elapsed:>4}")
    }

    fn with(length: u64, template: &str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// Shows the progress of a reconstruction.
    pub(crate) fn show(&self, progress: Progress) -> ControlFlow<()> {
        match progress.loss {
            Some(loss) => self.bar.set_message(format!("{}, loss {loss:.5}", progress.stage)),
            None => self.bar.set_message(progress.stage),
        }
        self.bar.set_position((progress.overall * STEPS as f64) as u64);
        // Updates the elapsed time, because no timer thread does.
        self.bar.tick();
        ControlFlow::Continue(())
    }

    /// Advances the bar by one picture.
    pub(crate) fn advance(&self) {
        self.bar.inc(1);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Whether a character is plain text: no terminal control, no line break, no change of the writing direction.
pub(crate) fn is_plain(c: char) -> bool {
    let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    !(c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}'))
}

/// Foreign text on one line; characters that are not plain become escapes, `\u{1b}`.
pub(crate) fn line(text: &str) -> String {
    let one = |c: char| if is_plain(c) { vec![c] } else { c.escape_default().collect() };
    text.chars().flat_map(one).collect()
}

/// A path on one line.
pub(crate) fn path(path: &Path) -> String {
    line(&path.display().to_string())
}

/// A count with grouped digits, `1 234 567`.
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

/// A count with its noun, `1 view` or `2 views`.
pub(crate) fn counted(n: usize, noun: &str) -> String {
    format!("{} {noun}{}", count(n), if n == 1 { "" } else { "s" })
}

/// Extent between the lowest and the highest centre, `4.63 x 1.89 x 1.45 m`.
pub(crate) fn extent((low, high): &([f32; 3], [f32; 3])) -> String {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| high[k] - low[k]);
    format!("{x:.2} x {y:.2} x {z:.2} m")
}

/// Length, width and height with the largest of their uncertainties.
pub(crate) fn size(vehicle: &vg::pipeline::VehicleSize) -> String {
    let [l, w, h] = vehicle.size_m;
    let worst = vehicle.uncertainty_m.into_iter().fold(0.0, f64::max);
    format!("{l:.2} x {w:.2} x {h:.2} m (± {worst:.2})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminal_controls_and_direction_marks_are_escaped_and_letters_stay() {
        assert_eq!(line("a\u{1b}[31m\n\u{9b}\u{202e}gnp.exe"), "a\\u{1b}[31m\\n\\u{9b}\\u{202e}gnp.exe");
        assert_eq!(line("Käfer 車 🚗 \\ \""), "Käfer 車 🚗 \\ \"");
    }
}
