//! Progress on a terminal, and text and numbers as people read them.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::ops::ControlFlow;
use std::path::Path;
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

/// Whether a character is nothing but text: no command to a terminal, no line break, no turn of the direction of writing.
pub(crate) fn is_plain(c: char) -> bool {
    let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    !(c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}'))
}

/// Text from elsewhere on one line; characters that are not plain become escapes, `\u{1b}`.
pub(crate) fn line(text: &str) -> String {
    let one = |c: char| if is_plain(c) { vec![c] } else { c.escape_default().collect() };
    text.chars().flat_map(one).collect()
}

/// A file's name on one line.
pub(crate) fn path(path: &Path) -> String {
    line(&path.display().to_string())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_to_a_terminal_and_turned_text_become_escapes_and_letters_stay() {
        assert_eq!(line("a\u{1b}[31m\n\u{9b}\u{202e}gnp.exe"), "a\\u{1b}[31m\\n\\u{9b}\\u{202e}gnp.exe");
        assert_eq!(line("Käfer 車 🚗 \\ \""), "Käfer 車 🚗 \\ \"");
    }
}
