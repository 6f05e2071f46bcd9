//! The error type. Every message names the argument (or file and field), what was found and what is allowed.

use std::path::{Path, PathBuf};

/// Result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The reason why a call failed. Nothing that the caller owns was changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside what the function accepts.
    #[error("{argument}: {found}; allowed: {allowed}")]
    Argument {
        /// The argument, with its index where it is a list: `views[2].mask`.
        argument: String,
        /// The value found there.
        found: String,
        /// The accepted values.
        allowed: String,
    },
    /// A file's content does not conform to its format.
    #[error("{}: {field}: {reason}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The field, record or key in it.
        field: String,
        /// The defect, and what is expected.
        reason: String,
    },
    /// The operating system refused a file operation.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The input is well formed, but this method cannot make a vehicle of it.
    #[error("{stage}: {reason}")]
    Reconstruction {
        /// The stage that failed.
        stage: &'static str,
        /// The reason, and what would help.
        reason: String,
    },
    /// The requested feature exists, but this build of the library does not contain it.
    #[error("{argument}: {found} is not in this build; {remedy}")]
    NotBuilt {
        /// The argument that requested it.
        argument: String,
        /// The requested feature.
        found: String,
        /// How to get it, or what to use instead.
        remedy: String,
    },
    /// The request needs something that this machine lacks or has only in an unusable version.
    #[error("{what}: {found}; {remedy}")]
    Missing {
        /// The missing component.
        what: &'static str,
        /// The state found instead, and where.
        found: String,
        /// The component to install, and where to configure it.
        remedy: String,
    },
    /// The operating system did not start all of the requested threads.
    #[error(
        "threads: {started} of {count} could be started: {found}; raise the system's limit of threads (ulimit -u), or \
         ask for 1, which starts none"
    )]
    Threads {
        /// The number of requested threads.
        count: usize,
        /// The number of threads that started, and have ended again.
        started: usize,
        /// The system's error text.
        found: String,
    },
    /// The progress callback requested a stop.
    #[error("cancelled during {stage}")]
    Cancelled {
        /// The stage that was running.
        stage: &'static str,
    },
}

/// The kind of an [`Error`], by the numbers that C (`vg_status`) and Python (`Status`) give it. Numbers are never reused.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// [`Error::Argument`].
    Argument = 1,
    /// [`Error::Format`].
    Format = 2,
    /// [`Error::Io`].
    Io = 3,
    /// [`Error::Reconstruction`].
    Reconstruction = 4,
    /// [`Error::Cancelled`].
    Cancelled = 5,
    /// [`Error::NotBuilt`].
    NotBuilt = 6,
    /// A bug in the library: a panic, which is no [`Error`].
    Internal = 7,
    /// [`Error::Missing`].
    Missing = 8,
    /// [`Error::Threads`].
    Threads = 9,
}

impl Error {
    /// The kind of this error.
    pub fn status(&self) -> Status {
        match self {
            Self::Argument { .. } => Status::Argument,
            Self::Format { .. } => Status::Format,
            Self::Io { .. } => Status::Io,
            Self::Reconstruction { .. } => Status::Reconstruction,
            Self::Cancelled { .. } => Status::Cancelled,
            Self::NotBuilt { .. } => Status::NotBuilt,
            Self::Missing { .. } => Status::Missing,
            Self::Threads { .. } => Status::Threads,
        }
    }

    /// An argument error; see [`Error::Argument`].
    pub fn argument(
        argument: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Argument { argument: argument.into(), found: found.into(), allowed: allowed.into() }
    }

    /// A file-format error; see [`Error::Format`].
    pub fn format(path: &Path, field: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Format { path: path.to_owned(), field: field.into(), reason: reason.into() }
    }

    /// An I/O error with the path it concerns.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), source }
    }
}
