//! What every reader and writer here needs of the file system: bounded reading, paths that stay inside the
//! scene, and writing that never leaves half a file behind.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{BufWriter, Read, Write};
use std::path::{Component, Path, PathBuf};

/// The whole file, if it is a file and not longer than `limit` bytes.
pub(crate) fn read_limited(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let meta = file.metadata().map_err(|e| Error::io(path, e))?;
    if meta.is_dir() {
        return Err(Error::format(path, "file", "is a folder; allowed: a file"));
    }
    let too_long = |n: u64| Error::format(path, "size", format!("{n} bytes; allowed: at most {limit}"));
    if meta.len() > limit {
        return Err(too_long(meta.len()));
    }
    let mut bytes = Vec::with_capacity(meta.len() as usize);
    // A pipe states no length; a file may grow meanwhile.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    if bytes.len() as u64 > limit {
        return Err(too_long(bytes.len() as u64));
    }
    Ok(bytes)
}

/// A path written in a scene file: relative, and inside the scene's folder, so that a scene from elsewhere
/// reads nothing but itself. The error is the reason, without file and field.
pub(crate) fn relative_inside(text: &str) -> std::result::Result<PathBuf, String> {
    let mut inside = PathBuf::new();
    for component in Path::new(text).components() {
        match component {
            Component::Normal(part) => inside.push(part),
            Component::CurDir => {}
            _ => {
                return Err(format!(
                    "{text:?} leads out of the scene's folder; allowed: a relative path without .."
                ));
            }
        }
    }
    if inside.as_os_str().is_empty() || text.contains('\0') {
        return Err(format!("{text:?}; allowed: a relative path to a file"));
    }
    Ok(inside)
}

/// An argument error raised while a file was read, as an error of that file: its argument is the field.
pub(crate) fn in_file(path: &Path, error: Error) -> Error {
    match error {
        Error::Argument { argument, found, allowed } => {
            Error::format(path, argument, format!("{found}; allowed: {allowed}"))
        }
        other => other,
    }
}

/// Writes `path` by way of a temporary file in the same folder that replaces it at the end: when anything
/// fails, what was there before is still there. Devices and pipes are written to directly.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    let io = |e| Error::io(path, e);
    // Through a link, so that the link stays a link; a file that does not exist yet has nothing to resolve.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    match fs::metadata(&target) {
        Ok(meta) if meta.is_dir() => {
            return Err(Error::format(path, "file", "is a folder; allowed: a file to write"));
        }
        Ok(meta) if !meta.is_file() => {
            let mut out = BufWriter::new(File::options().write(true).open(&target).map_err(io)?);
            return write(&mut out).and_then(|()| out.flush()).map_err(io);
        }
        _ => {}
    }
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".vg-").suffix(".part");
    // Temporary files are private by default; this one becomes an ordinary file, as the umask says.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut out = BufWriter::with_capacity(1 << 16, builder.tempfile_in(folder).map_err(io)?);
    write(&mut out).map_err(io)?;
    let file = out.into_inner().map_err(|e| io(e.into_error()))?;
    file.persist(&target).map_err(|e| io(e.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("model.ply");
        fs::write(&path, "old").unwrap();
        let failed = write_atomically(&path, |out| {
            out.write_all(b"new")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        write_atomically(&path, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn paths_that_leave_the_folder_are_refused() {
        for bad in ["", ".", "/etc/passwd", "../a.png", "images/../../a.png", "a\0b"] {
            assert!(relative_inside(bad).is_err(), "{bad:?}");
        }
        assert_eq!(relative_inside("./images/a.png").unwrap(), Path::new("images/a.png"));
    }
}
