//! Files and folders a command writes: checked before the work, complete or not there at all after it.

use crate::guard::{self, Inputs};
use crate::job::{Failure, Outcome, Result, USAGE};
use crate::shown;
use std::io::{BufWriter, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use vg::io::splats;

/// What a file holds, which the ending of its name must not contradict.
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

    /// A name without an ending says nothing; devices and pipes are called what they are called.
    fn check_name(self, path: &Path) -> Result<()> {
        let is_special = path.exists() && !path.is_file() && !path.is_dir();
        let Some(ending) = path.extension().filter(|_| !is_special && !is_standard_output(path)) else {
            return Ok(());
        };
        if self.endings().iter().any(|allowed| ending.eq_ignore_ascii_case(allowed)) {
            return Ok(());
        }
        let (name, endings) = (self.name(), self.endings().join(" or ."));
        let message = format!("{}: this is {name}; expected a name that ends in .{endings}", path.display());
        Err(Failure { message, code: USAGE })
    }
}

/// The results of a command that are one file each.
#[derive(Debug)]
pub(crate) struct Results(Vec<(Kind, PathBuf)>);

impl Results {
    /// Those that were asked for.
    pub(crate) fn new<const N: usize>(asked: [(Kind, Option<&PathBuf>); N]) -> Self {
        Self(asked.into_iter().filter_map(|(kind, path)| Some((kind, path?.clone()))).collect())
    }

    /// Refuses, before work is spent on them, names that clash, names that say something else, and places that take no
    /// files.
    pub(crate) fn prepare(&self, inputs: &Inputs) -> Result<()> {
        let paths: Vec<PathBuf> = self.0.iter().map(|(_, path)| path.clone()).collect();
        guard::refuse_clashes(&paths, inputs)?;
        self.0.iter().try_for_each(|(kind, path)| kind.check_name(path))?;
        for (kind, path) in &self.0 {
            if is_standard_output(path) && !kind.is_text() && std::io::stdout().is_terminal() {
                let message = format!("-: standard output is a terminal and takes no {}", kind.name());
                return Err(Failure { message, code: USAGE });
            }
            prepare(path)?;
        }
        Ok(())
    }

    /// What the command says beside its results: nothing where one of them is on standard output.
    pub(crate) fn outcome(&self, outcome: Outcome) -> Outcome {
        match self.0.iter().any(|(_, path)| is_standard_output(path)) {
            true => Outcome { text: String::new(), ..outcome },
            false => outcome,
        }
    }
}

/// Whether a file by this name is standard output: `-`, or what the system calls it.
pub(crate) fn is_standard_output(path: &Path) -> bool {
    let names = ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
    names.iter().any(|name| path.as_os_str() == *name)
}

/// The file to read by this name: `-` is standard input.
pub(crate) fn input(path: &Path) -> &Path {
    if cfg!(unix) && path.as_os_str() == "-" { Path::new("/dev/stdin") } else { path }
}

/// Makes sure that the file's folder exists and takes files, and that the file is no folder.
fn prepare(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Failure::job(format!("{}: is a folder; expected a file to write", path.display())));
    }
    if is_standard_output(path) || (path.exists() && !path.is_file()) {
        return Ok(()); // a device or a pipe: its folder is not written to
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    prepare_folder(folder)?;
    Ok(vg::io::check_folder(folder)?)
}

/// Creates the folder with those above it.
pub(crate) fn prepare_folder(folder: &Path) -> Result<()> {
    if folder.as_os_str() == "-" {
        let message = "-: several files do not go to standard output; expected a folder (./- is one)";
        return Err(Failure { message: message.into(), code: USAGE });
    }
    std::fs::create_dir_all(folder).map_err(|e| Failure::job(format!("{}: {e}", folder.display())))
}

/// Writes a file by way of a temporary one beside it, so that nobody meets half of it, or standard output.
pub(crate) fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    if !is_standard_output(path) {
        return Ok(vg::io::write_atomically(path, write)?);
    }
    let mut out = BufWriter::new(std::io::stdout().lock());
    match write(&mut out).and_then(|()| out.flush()) {
        // A reader that has gone away has what it wanted.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(|e| Failure::job(format!("standard output: {e}"))),
    }
}

/// Writes a value as indented JSON, in which control characters are escaped, also those that JSON would let be.
pub(crate) fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let text =
        serde_json::to_string_pretty(value).map_err(|e| Failure::job(format!("{}: {e}", path.display())))?;
    // Outside its strings JSON holds no such character but the line feed.
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
    fn a_name_that_says_another_format_is_refused_and_one_that_says_none_is_not() {
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
