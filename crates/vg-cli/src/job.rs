//! What a command leaves behind: text to print, or a failure with its exit code.

use crate::shown;
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Exit code of a job that failed: bad data, or a file that cannot be read or written.
pub(crate) const FAILED: u8 = 1;

/// Exit code of arguments that make no sense.
pub(crate) const USAGE: u8 = 2;

/// What a command that ran to its end says.
pub(crate) struct Outcome {
    /// For standard output.
    pub(crate) text: String,
    /// `false` if a part of the job failed, which has been said already.
    pub(crate) complete: bool,
}

impl Outcome {
    /// Everything went well.
    pub(crate) fn done(text: impl Into<String>) -> Self {
        Self { text: text.into(), complete: true }
    }
}

/// Why a command did not do its job.
#[derive(Debug)]
pub(crate) struct Failure {
    /// The cause.
    pub(crate) message: String,
    /// Exit code.
    pub(crate) code: u8,
}

/// What a command returns.
pub(crate) type Result<T = Outcome> = std::result::Result<T, Failure>;

impl Failure {
    /// The data or the file system is at fault.
    pub(crate) fn job(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: FAILED }
    }
}

impl From<vg::Error> for Failure {
    fn from(error: vg::Error) -> Self {
        Self::job(error.to_string())
    }
}

/// What looks like a mistake, kept until it is known how the job ends.
static NOTES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Notes something that is legal but looks like a mistake, once.
pub(crate) fn note(text: &str) {
    let mut notes = notes();
    if !notes.iter().any(|known| known == text) {
        notes.push(text.to_owned());
    }
}

fn notes() -> MutexGuard<'static, Vec<String>> {
    NOTES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The notes so far, for a result that shows them; they remain to be told.
pub(crate) fn noted() -> Vec<String> {
    notes().clone()
}

/// The notes so far as warnings, a line each: for a job that went well.
pub(crate) fn warn() {
    notes().drain(..).for_each(|note| line("warning", &note));
}

/// Why a job failed, in one line. What was noted before may be the reason behind the reason.
pub(crate) fn complain(message: &str) {
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
    // Nobody is left to tell if this fails.
    let _ = writeln!(std::io::stderr(), "vg: {what}: {line}");
}

/// Writes the outcome's text to standard output; what is left of control characters but the line feed is escaped. A reader that has gone away (`vg info x | head -1`) has what it
/// wanted.
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
