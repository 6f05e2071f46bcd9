//! Output files and folders: checked before the work starts; a file is written completely or not at all.

use crate::guard::{self, Inputs, is_standard_output};
use crate::job::{Failure, Outcome, Result, USAGE};
use crate::shown;
use std::io::{BufWriter, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use vg::io::splats;

/// Format of a file, which the extension of its name must not contradict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A model, in any format of [`splats::FORMATS`].
    Model,
    Ply,
    Json,
    Csv,
    Markdown,
    Html,
    Svg,
    Png,
}

impl Kind {
    fn name(self) -> String {
        let name = match self {
            Self::Model => {
                let names: Vec<&str> = splats::FORMATS.iter().map(|format| format.name).collect();
                return format!("a {} file", names.join(" or "));
            }
            Self::Ply => "a PLY file",
            Self::Json => "JSON",
            Self::Csv => "CSV",
            Self::Markdown => "Markdown",
            Self::Html => "HTML",
            Self::Svg => "SVG",
            Self::Png => "a PNG picture",
        };
        name.to_owned()
    }

    fn endings(self) -> Vec<&'static str> {
        let endings: &[&str] = match self {
            Self::Model => {
                return splats::FORMATS.iter().flat_map(|format| format.endings).copied().collect();
            }
            Self::Ply => &["ply"],
            Self::Json => &["json"],
            Self::Csv => &["csv"],
            Self::Markdown => &["md", "markdown"],
            Self::Html => &["html", "htm"],
            Self::Svg => &["svg"],
            Self::Png => &["png"],
        };
        endings.to_vec()
    }

    fn is_text(self) -> bool {
        !matches!(self, Self::Model | Self::Ply | Self::Png)
    }

    /// Refuses an extension of another format. A name without extension, a device or a pipe is accepted.
    fn check_name(self, path: &Path) -> Result<()> {
        let is_special = path.exists() && !path.is_file() && !path.is_dir();
        let Some(ending) = path.extension().filter(|_| !is_special && !is_standard_output(path)) else {
            return Ok(());
        };
        if self.endings().iter().any(|allowed| ending.eq_ignore_ascii_case(allowed)) {
            return Ok(());
        }
        let (name, endings) = (self.name(), self.endings().join(" or ."));
        let message =
            format!("{}: the output is {name}; expected a name that ends in .{endings}", path.display());
        Err(Failure { message, code: USAGE })
    }
}

/// Results of a command that are one file each.
#[derive(Debug)]
pub(crate) struct Results(Vec<(Kind, PathBuf)>);

impl Results {
    /// The results that were requested.
    pub(crate) fn new<const N: usize>(asked: [(Kind, Option<&PathBuf>); N]) -> Self {
        Self(asked.into_iter().filter_map(|(kind, path)| Some((kind, path?.clone()))).collect())
    }

    /// Refuses, before any work is done, names that clash, names with another format's extension, and places that
    /// cannot be written.
    pub(crate) fn prepare(&self, inputs: &Inputs) -> Result<()> {
        let paths: Vec<PathBuf> = self.0.iter().map(|(_, path)| path.clone()).collect();
        guard::refuse_clashes(&paths, inputs)?;
        self.0.iter().try_for_each(|(kind, path)| kind.check_name(path))?;
        for (kind, path) in &self.0 {
            if is_standard_output(path) && !kind.is_text() && std::io::stdout().is_terminal() {
                let message =
                    format!("-: {} cannot go to a terminal; redirect it or name a file", kind.name());
                return Err(Failure { message, code: USAGE });
            }
            prepare(path)?;
        }
        Ok(())
    }

    /// The outcome with its text dropped where one of the results is on standard output.
    pub(crate) fn outcome(&self, outcome: Outcome) -> Outcome {
        match self.0.iter().any(|(_, path)| is_standard_output(path)) {
            true => Outcome { text: String::new(), ..outcome },
            false => outcome,
        }
    }
}

/// The file to read for this name: `-` is standard input.
pub(crate) fn input(path: &Path) -> &Path {
    if cfg!(unix) && path.as_os_str() == "-" { Path::new("/dev/stdin") } else { path }
}

/// Ensures that the file's folder exists and is writable, and that the file is not a folder.
fn prepare(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Failure::job(format!("{}: is a folder; expected the name of a file", path.display())));
    }
    if is_standard_output(path) || (path.exists() && !path.is_file()) {
        return Ok(()); // a device or a pipe: its folder is not written to
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    prepare_folder(folder)?;
    Ok(vg::io::check_folder(folder)?)
}

/// Creates the folder and its parents.
pub(crate) fn prepare_folder(folder: &Path) -> Result<()> {
    if folder.as_os_str() == "-" {
        let message =
            "-: several files cannot go to standard output; expected a folder (./- for one named -)";
        return Err(Failure { message: message.into(), code: USAGE });
    }
    std::fs::create_dir_all(folder).map_err(|e| Failure::job(format!("{}: {e}", folder.display())))
}

/// Writes a file atomically, through a temporary file in the same folder, or writes to standard output.
pub(crate) fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    if !is_standard_output(path) {
        return Ok(vg::io::write_atomically(path, write)?);
    }
    let mut out = BufWriter::new(std::io::stdout().lock());
    match write(&mut out).and_then(|()| out.flush()) {
        // A closed pipe is no error: its reader needs no more.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(|e| Failure::job(format!("standard output: {e}"))),
    }
}

/// Writes a value as indented JSON in which all control characters are escaped, also those that JSON allows.
pub(crate) fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let text =
        serde_json::to_string_pretty(value).map_err(|e| Failure::job(format!("{}: {e}", path.display())))?;
    // Outside its strings, this JSON contains no control character other than the line feed.
    let escaped = |c: char| match c == '\n' || shown::is_plain(c) {
        true => c.to_string(),
        false => format!("\\u{:04x}", u32::from(c)),
    };
    let text: String = text.chars().map(escaped).collect();
    self::write(path, |out| writeln!(out, "{text}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extension_of_another_format_is_refused_and_a_missing_one_is_not() {
        for (kind, name) in [
            (Kind::Model, "car.spz"),
            (Kind::Ply, "car.ply.gz"),
            (Kind::Png, "plot.jpg"),
            (Kind::Json, "r.txt"),
            (Kind::Markdown, "t.html"),
        ] {
            let failure = kind.check_name(Path::new(name)).unwrap_err();
            assert!(failure.code == USAGE && failure.message.contains("expected a name that ends in ."));
        }
        for (kind, name) in
            [(Kind::Model, "CAR.PLY"), (Kind::Ply, "car"), (Kind::Html, "a.b.htm"), (Kind::Csv, "-")]
        {
            assert!(kind.check_name(Path::new(name)).is_ok(), "{name}");
        }
    }
}
