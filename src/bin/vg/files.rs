//! Files and folders a command writes: checked before the work, complete or not there at all after it.

use crate::job::{Failure, Result};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Makes sure that the file's folder exists and takes files, and that the file is no folder, before work is spent
/// on it.
pub(crate) fn prepare(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Failure::job(format!("{}: is a folder; expected a file to write", path.display())));
    }
    if path.exists() && !path.is_file() {
        return Ok(()); // a device or a pipe: its folder is not written to
    }
    let folder = folder_of(path);
    prepare_folder(folder)?;
    let probe = tempfile::Builder::new().prefix(".vg-").suffix(".part").tempfile_in(folder);
    probe.map(drop).map_err(|e| Failure::job(format!("{}: {}", folder.display(), cause(&e))))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Without the temporary file's name, which says nothing to a user.
fn cause(error: &std::io::Error) -> String {
    let text = error.to_string();
    text.split(" at path ").next().unwrap_or(&text).to_owned()
}

/// Creates the folder with those above it.
pub(crate) fn prepare_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::job(format!("{}: {e}", folder.display())))
}

/// Refuses two outputs of one name, and outputs that would replace what was read.
pub(crate) fn refuse_clashes(outputs: &[PathBuf], inputs: &[PathBuf]) -> Result<()> {
    // Different spellings of one existing file are one file; what does not exist yet is compared as written.
    let place = |path: &PathBuf| std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
    let inputs: std::collections::HashSet<PathBuf> = inputs.iter().map(place).collect();
    let mut seen = HashMap::new();
    for (i, output) in outputs.iter().enumerate() {
        let place = place(output);
        if inputs.contains(&place) {
            return Err(Failure::job(format!(
                "{}: is read by this job and would be replaced",
                output.display()
            )));
        }
        if let Some(first) = seen.insert(place, i) {
            return Err(Failure::job(format!(
                "{}: two results (number {} and number {}) would have this name",
                output.display(),
                first + 1,
                i + 1
            )));
        }
    }
    Ok(())
}

/// Writes a file by way of a temporary one beside it, so that nobody meets half of it.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Ok(vg::io::write_atomically(path, |out| out.write_all(bytes))?)
}

/// Writes a value as indented JSON.
pub(crate) fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let mut text =
        serde_json::to_vec_pretty(value).map_err(|e| Failure::job(format!("{}: {e}", path.display())))?;
    text.push(b'\n');
    write(path, &text)
}
