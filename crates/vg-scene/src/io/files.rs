//! File system functions of all readers and writers: bounded reading, paths that stay inside the scene, and atomic
//! writing.

use super::writes::writes;
use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Component, Path, PathBuf};
use vg_geometry::{Error, Result};

/// Reads a whole regular file of at most `limit` bytes. A pipe or a device is refused before it is opened:
/// opening a pipe without a writer blocks for ever.
pub(crate) fn read_limited(path: &Path, limit: u64) -> Result<Vec<u8>> {
    read_up_to(open_regular(path)?, path, limit)
}

/// [`read_limited`] for a file that the caller named explicitly, which may be a pipe.
pub(crate) fn read_limited_or_piped(path: &Path, limit: u64) -> Result<Vec<u8>> {
    read_up_to(File::open(path).map_err(|e| Error::io(path, e))?, path, limit)
}

/// Opens a regular file for reading; an error names any other kind of file.
pub(crate) fn open_regular(path: &Path) -> Result<File> {
    let io = |e| Error::io(path, e);
    // Checked before and after opening: the name may refer to another file in between.
    refuse_special(path, &fs::metadata(path).map_err(io)?)?;
    let file = File::open(path).map_err(io)?;
    refuse_special(path, &file.metadata().map_err(io)?)?;
    Ok(file)
}

fn refuse_special(path: &Path, meta: &fs::Metadata) -> Result<()> {
    match meta.file_type() {
        kind if kind.is_file() => Ok(()),
        kind if kind.is_dir() => Err(Error::format(path, "file", "is a folder; allowed: a file")),
        _ => Err(Error::format(path, "file", "is a pipe, a socket or a device; allowed: a regular file")),
    }
}

fn read_up_to(file: File, path: &Path, limit: u64) -> Result<Vec<u8>> {
    let meta = file.metadata().map_err(|e| Error::io(path, e))?;
    if meta.is_dir() {
        return Err(Error::format(path, "file", "is a folder; allowed: a file"));
    }
    let too_long = |n: u64| Error::format(path, "size", format!("{n} bytes; allowed: at most {limit}"));
    if meta.len() > limit {
        return Err(too_long(meta.len()));
    }
    let mut bytes = Vec::with_capacity(meta.len() as usize);
    // A pipe has no length; a file may grow meanwhile.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    if bytes.len() as u64 > limit {
        return Err(too_long(bytes.len() as u64));
    }
    Ok(bytes)
}

/// Whether something other than a folder has this name. It need not be readable: reading it reports the error.
pub(crate) fn is_there(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| !meta.is_dir())
}

/// Checks a path from a scene file: it must be relative and inside the scene's folder, so that a foreign scene
/// reads only its own files. Backslashes, as in files from Windows, count as slashes. The error is the reason without
/// file and field.
pub(crate) fn relative_inside(text: &str) -> std::result::Result<PathBuf, String> {
    let leads_out =
        || Err(format!("{text:?} leads out of the scene's folder; allowed: a relative path without .."));
    let slashed = text.replace('\\', "/");
    let has_drive = matches!(slashed.as_bytes(), [drive, b':', b'/', ..] if drive.is_ascii_alphabetic());
    let mut inside = PathBuf::new();
    for component in Path::new(&slashed).components() {
        match component {
            Component::Normal(part) if !has_drive => inside.push(part),
            Component::CurDir => {}
            _ => return leads_out(),
        }
    }
    if inside.as_os_str().is_empty() || text.contains('\0') {
        return Err(format!("{text:?}; allowed: a relative path to a file"));
    }
    Ok(inside)
}

/// Converts an argument error raised while a file was read to an error of that file; the argument becomes the field.
pub(crate) fn in_file(path: &Path, error: Error) -> Error {
    match error {
        Error::Argument { argument, found, allowed } => {
            Error::format(path, argument, format!("{found}; allowed: {allowed}"))
        }
        other => other,
    }
}

/// Maximum of links that are followed, as in Linux.
const MAX_LINKS: usize = 40;

/// Writes `path` through a temporary file in the same folder that replaces it at the end: if anything fails, the old
/// file remains. The new file is synchronised to disk before it replaces the old one, and gets its permissions. Devices
/// and pipes are written directly.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let failed = |e| Error::io(path, explained(e));
    // Resolve links, so that a link stays a link.
    let target = resolved(path);
    let permissions = match fs::metadata(&target) {
        Ok(meta) if meta.is_dir() => {
            return Err(Error::format(path, "file", "is a folder; allowed: a file to write"));
        }
        Ok(meta) if !meta.is_file() => {
            let mut out = BufWriter::new(File::options().write(true).open(&target).map_err(failed)?);
            return write(&mut out).and_then(|()| out.flush()).map_err(failed);
        }
        Ok(meta) => Some(meta.permissions()),
        Err(_) => None,
    };
    writes().run(|| replace(&target, permissions, write)).map_err(failed)
}

fn replace(
    target: &Path,
    permissions: Option<fs::Permissions>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut temporary = temporary_in(folder_of(target))?;
    // Write to the file itself: its errors do not contain the temporary name.
    let file = temporary.as_file_mut();
    let mut out = BufWriter::with_capacity(1 << 16, writes().stoppable(&mut *file));
    write(&mut out)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)?;
    if let Some(permissions) = permissions
        && permissions != file.metadata()?.permissions()
    {
        file.set_permissions(permissions)?;
    }
    file.sync_all()?;
    temporary.persist(target).map_err(|e| e.error)?;
    Ok(())
}

fn temporary_in(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".vg-").suffix(".part");
    // Temporary files are private by default; this one becomes an ordinary file with the umask's permissions.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|e| {
        // Remove the temporary name, which is meaningless to a user.
        let text = e.to_string();
        io::Error::new(e.kind(), text.split(" at path ").next().unwrap_or(&text).to_owned())
    })
}

/// Checks that files can be created in `folder` by creating and removing one.
pub fn check_folder(folder: &Path) -> Result<()> {
    writes().run(|| temporary_in(folder).map(drop)).map_err(|e| Error::io(folder, e))
}

/// Whether the file system of `folder`, which must be writable, ignores case in names.
pub fn folds_case(folder: &Path) -> bool {
    let probe = || {
        let file = temporary_in(folder)?;
        let name = file.path().file_name().unwrap_or_default().to_string_lossy().to_uppercase();
        Ok(folder.join(name).exists())
    };
    writes().run(probe).unwrap_or(false)
}

/// The canonical absolute path of the file that a write to `path` would create or replace. Links are followed, even to
/// files that do not exist yet. After a folder that does not exist yet, `..` removes its name.
pub fn resolved(path: &Path) -> PathBuf {
    follow(path, MAX_LINKS)
}

fn follow(path: &Path, links: usize) -> PathBuf {
    if let Ok(found) = fs::canonicalize(path) {
        return found;
    }
    let Some(parent) = path.parent() else { return path.to_owned() };
    let parent = follow(if parent.as_os_str().is_empty() { Path::new(".") } else { parent }, links);
    let Some(name) = path.file_name() else { return parent.parent().unwrap_or(&parent).to_owned() };
    let joined = parent.join(name);
    match fs::read_link(&joined) {
        Ok(link) if links > 0 => follow(&parent.join(link), links - 1),
        _ => joined,
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The system's error, with the process's limit if the file exceeds it.
fn explained(e: io::Error) -> io::Error {
    match largest_file().filter(|_| e.kind() == io::ErrorKind::FileTooLarge) {
        Some(limit) => {
            let text = format!("{e}; files of this process may have at most {limit} bytes (ulimit -f)");
            io::Error::new(e.kind(), text)
        }
        None => e,
    }
}

/// Maximum size of a file by the limits of this process, bytes.
#[cfg(unix)]
fn largest_file() -> Option<nix::sys::resource::rlim_t> {
    use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
    let (limit, _) = getrlimit(Resource::RLIMIT_FSIZE).ok()?;
    (limit != RLIM_INFINITY).then_some(limit)
}

#[cfg(not(unix))]
fn largest_file() -> Option<u64> {
    None
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

    #[cfg(unix)]
    #[test]
    fn a_replaced_file_keeps_its_mode_and_a_new_one_follows_the_umask() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let (old, new) = (dir.path().join("old.ply"), dir.path().join("new.ply"));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o7777;
        fs::write(&old, "old").unwrap();
        let plain = mode(&old);
        fs::set_permissions(&old, fs::Permissions::from_mode(0o640)).unwrap();
        for path in [&old, &new] {
            write_atomically(path, |out| out.write_all(b"new")).unwrap();
        }
        assert_eq!((mode(&old), mode(&new)), (0o640, plain));
    }

    #[cfg(unix)]
    #[test]
    fn every_spelling_of_a_missing_file_resolves_to_one_path() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::create_dir_all(at("a/b")).unwrap();
        symlink("a", at("link")).unwrap();
        symlink("b/model.ply", at("a/dangling.ply")).unwrap();
        symlink("loop", at("loop")).unwrap();
        let expected = fs::canonicalize(at("a/b")).unwrap().join("model.ply");
        for spelled in [
            "a/b/model.ply",
            "a/../a/./b/model.ply",
            "link/b/model.ply",
            "a/dangling.ply",
            "a/b/new/../model.ply",
        ] {
            assert_eq!(resolved(&at(spelled)), expected, "{spelled}");
        }
        assert_eq!(resolved(&at("loop")).file_name().unwrap(), "loop");
        assert_eq!(resolved(Path::new("new.ply")), fs::canonicalize(".").unwrap().join("new.ply"));
        // A write through a link leaves the link.
        write_atomically(&at("a/dangling.ply"), |out| out.write_all(b"new")).unwrap();
        assert!(at("a/dangling.ply").is_symlink() && expected.is_file());
    }

    #[test]
    fn paths_that_leave_the_folder_are_refused() {
        let bad = ["", ".", "/etc/passwd", "../a.png", "images/../../a.png", "a\0b"];
        for bad in bad.into_iter().chain(["..\\a.png", "\\a.png", "C:\\cars\\a.png", "c:/a.png"]) {
            assert!(relative_inside(bad).is_err(), "{bad:?}");
        }
        assert_eq!(relative_inside("./images/a.png").unwrap(), Path::new("images/a.png"));
        assert_eq!(relative_inside(".\\images\\a.png").unwrap(), Path::new("images/a.png"));
    }
}
