//! Outcome of a command: text to print, or a failure with its exit code.

use crate::shown;
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Exit code of a job that failed: bad data, or a file that cannot be read or written.
pub(crate) const FAILED: u8 = 1;

/// Exit code of invalid arguments.
pub(crate) const USAGE: u8 = 2;

/// Outcome of a command that ran to its end.
pub(crate) struct Outcome {
    /// Text for standard output.
    pub(crate) text: String,
    /// `false` if a part of the job failed, which has already been reported.
    pub(crate) complete: bool,
}

impl Outcome {
    /// Outcome of a command that succeeded completely.
    pub(crate) fn done(text: impl Into<String>) -> Self {
        Self { text: text.into(), complete: true }
    }
}

/// Failure of a command.
#[derive(Debug)]
pub(crate) struct Failure {
    /// Cause of the failure.
    pub(crate) message: String,
    /// Exit code.
    pub(crate) code: u8,
}

/// Result of a command.
pub(crate) type Result<T = Outcome> = std::result::Result<T, Failure>;

impl Failure {
    /// Failure caused by the data or the file system.
    pub(crate) fn job(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: FAILED }
    }
}

impl From<vg::Error> for Failure {
    fn from(error: vg::Error) -> Self {
        Self::job(error.to_string())
    }
}

/// Warnings, kept until the job has succeeded or failed.
static NOTES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Records a warning about something legal that looks like a mistake, unless it is already recorded.
pub(crate) fn note(text: &str) {
    let mut notes = notes();
    if !notes.iter().any(|known| known == text) {
        notes.push(text.to_owned());
    }
}

fn notes() -> MutexGuard<'static, Vec<String>> {
    NOTES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The notes so far, for a result that shows them; they are still printed later.
pub(crate) fn noted() -> Vec<String> {
    notes().clone()
}

/// Prints the notes so far as warnings, one line each, for a job that succeeded.
pub(crate) fn print_warnings() {
    notes().drain(..).for_each(|note| line("warning", &note));
}

/// Prints why a job failed, on one line, with the earlier notes, which may explain the cause.
pub(crate) fn print_error(message: &str) {
    let noted: Vec<String> = notes().drain(..).collect();
    match noted.as_slice() {
        [] => line("error", message),
        noted => line("error", &format!("{message} (noted before: {})", noted.join("; "))),
    }
}

/// `vg: <what>: <message>` on standard error.
fn line(what: &str, message: &str) {
    // File names may hold line breaks and terminal commands.
    let line = shown::line(message);
    // A failure to write an error cannot be reported.
    let _ = writeln!(std::io::stderr(), "vg: {what}: {line}");
}

/// Writes the outcome's text to standard output; remaining control characters other than the line feed are escaped. A
/// closed pipe (`vg info x | head -1`) is no error.
pub(crate) fn print(outcome: &Outcome) -> Result<Outcome> {
    let mut out = std::io::stdout().lock();
    let lines: Vec<String> = outcome.text.split('\n').map(shown::line).collect();
    let written = if outcome.text.is_empty() { Ok(()) } else { writeln!(out, "{}", lines.join("\n")) };
    match written.and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::job(format!("standard output: {e}")))
        }
        _ => Ok(Outcome { text: String::new(), complete: outcome.complete }),
    }
}
