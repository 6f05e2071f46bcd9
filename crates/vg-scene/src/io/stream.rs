//! Opens inputs that are read from start to end: a file, or a pipe, whose length is unknown before its end.
//!
//! Reading a pipe with a writer blocks as long as necessary, as in any program. A pipe that no program opens for
//! writing within [`WRITER_WAIT`] is an error: otherwise a forgotten FIFO would block its reader for ever.

use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;
use std::time::Duration;
use vg_geometry::{Error, Result};

/// Maximum time that a pipe may have no writer.
const WRITER_WAIT: Duration = Duration::from_secs(10);

/// A file or a pipe, from its first byte.
pub(super) struct Stream {
    pub(super) input: BufReader<std::io::Chain<Cursor<Vec<u8>>, File>>,
    /// Length of a file, bytes; `None` for a pipe.
    pub(super) length: Option<u64>,
}

/// Opens `path`, a file or a pipe.
pub(super) fn open(path: &Path) -> Result<Stream> {
    open_within(WRITER_WAIT, path)
}

fn open_within(wait: Duration, path: &Path) -> Result<Stream> {
    let io = |e| Error::io(path, e);
    let file = open_without_waiting(path).map_err(io)?;
    let meta = file.metadata().map_err(io)?;
    let (length, begun) = match () {
        () if meta.is_dir() => {
            return Err(io(std::io::ErrorKind::IsADirectory.into()));
        }
        () if meta.is_file() => (Some(meta.len()), Vec::new()),
        () => (None, begin_pipe(&file, path, wait)?),
    };
    Ok(Stream { input: BufReader::with_capacity(1 << 16, Cursor::new(begun).chain(file)), length })
}

/// Opens a FIFO whether it has a writer or not.
#[cfg(unix)]
fn open_without_waiting(path: &Path) -> std::io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt;
    let flags = nix::fcntl::OFlag::O_NONBLOCK.bits();
    File::options().read(true).custom_flags(flags).open(path)
}

/// Waits for a writer; returns the bytes that had to be read to detect it.
#[cfg(unix)]
fn begin_pipe(mut file: &File, path: &Path, wait: Duration) -> Result<Vec<u8>> {
    use nix::errno::Errno;
    use nix::fcntl::{FcntlArg, OFlag, fcntl};
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    use std::os::fd::AsFd;
    use std::os::unix::fs::FileTypeExt;
    let io = |e| Error::io(path, e);
    if !file.metadata().map_err(io)?.file_type().is_fifo() {
        return Err(Error::format(path, "file", "is a device; allowed: a file or a pipe"));
    }
    let time = PollTimeout::try_from(wait).map_err(|e| io(std::io::Error::other(e)))?;
    let mut begun = Vec::new();
    let mut fds = [PollFd::new(file.as_fd(), PollFlags::POLLIN)];
    let ready = loop {
        match poll(&mut fds, time) {
            // A signal interrupted the wait.
            Err(Errno::EINTR) => {}
            ready => break ready.map_err(|e| io(e.into()))?,
        }
    };
    // After a timeout, the writer is either still at work or does not exist.
    if ready == 0 {
        let mut byte = [0];
        match file.read(&mut byte) {
            Ok(0) => {
                let reason = format!(
                    "a pipe that no program has opened for writing for {} s; start the writing program first",
                    wait.as_secs_f64()
                );
                return Err(Error::format(path, "file", reason));
            }
            Ok(_) => begun.extend(byte),
            Err(e) if e.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(e) => return Err(io(e)),
        }
    }
    let flags = fcntl(file, FcntlArg::F_GETFL).map_err(|e| io(e.into()))?;
    let waiting = OFlag::from_bits_retain(flags) - OFlag::O_NONBLOCK;
    fcntl(file, FcntlArg::F_SETFL(waiting)).map_err(|e| io(e.into()))?;
    Ok(begun)
}

#[cfg(not(unix))]
fn open_without_waiting(path: &Path) -> std::io::Result<File> {
    File::open(path)
}

#[cfg(not(unix))]
fn begin_pipe(_: &File, _: &Path, _: Duration) -> Result<Vec<u8>> {
    Ok(Vec::new())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::io::Write;
    use std::path::PathBuf;
    use std::process::Command;
    use std::time::Instant;

    const SHORT: Duration = Duration::from_millis(100);

    fn fifo(folder: &Path) -> PathBuf {
        let path = folder.join("fifo");
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
        path
    }

    #[test]
    fn a_pipe_without_a_writer_is_an_error_and_does_not_block() {
        let folder = tempfile::tempdir().unwrap();
        let begun = Instant::now();
        let error = open_within(SHORT, &fifo(folder.path())).map(drop).unwrap_err().to_string();
        assert!(error.contains("no program has opened for writing for 0.1 s"), "{error}");
        assert!(begun.elapsed() >= SHORT);
    }

    #[test]
    fn a_slow_writer_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = fifo(folder.path());
        let writer = std::thread::spawn({
            let path = path.clone();
            move || {
                let mut pipe = File::options().write(true).open(path).unwrap();
                for part in ["slow", "ly"] {
                    std::thread::sleep(3 * SHORT);
                    pipe.write_all(part.as_bytes()).unwrap();
                }
            }
        });
        // The writer has opened the pipe before the wait is over, or this side waits for it in the second try.
        let stream = (0..50).find_map(|_| open_within(SHORT, &path).ok()).unwrap();
        let mut text = String::new();
        let Stream { mut input, length } = stream;
        input.read_to_string(&mut text).unwrap();
        assert_eq!((text.as_str(), length), ("slowly", None));
        writer.join().unwrap();
    }

    #[test]
    fn files_have_a_length_and_devices_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "abc").unwrap();
        assert_eq!(open(&path).map(|stream| stream.length).unwrap(), Some(3));
        assert!(open(Path::new("/dev/null")).is_err_and(|e| e.to_string().contains("is a device")));
        assert!(open(folder.path()).is_err_and(|e| matches!(e, Error::Io { .. })));
    }
}
