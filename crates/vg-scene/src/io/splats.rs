//! Models in files: one table of formats, by which every model is read and written. A new format is an entry in
//! [`FORMATS`]; the program, C and Python have it then.

use super::files::write_atomically;
use super::ply::{self, Content, PlyNotes};
use super::stream::{self, Stream};
use std::io::{BufRead, Write};
use std::path::Path;
use vg_geometry::Result;
use vg_splat::Gaussians;

/// Reads a model from front to back.
pub type Reader = fn(&mut dyn BufRead, Option<u64>, &Path) -> Result<(Gaussians, PlyNotes)>;

/// A format of models in files.
#[derive(Clone, Copy, Debug)]
pub struct SplatFormat {
    /// Its name.
    pub name: &'static str,
    /// What names of its files end in, in lower case, without the dot.
    pub endings: &'static [&'static str],
    /// Whether a file is of this format, by its first bytes.
    pub recognizes: fn(&[u8]) -> bool,
    /// Reads a model from front to back; the length is a file's, a pipe has none; the path is for messages.
    pub read: Reader,
    /// Writes a model.
    pub write: fn(&mut dyn Write, &Gaussians) -> std::io::Result<()>,
}

/// All formats. The first is that of names without an ending, and refuses files of formats that are not here.
pub const FORMATS: &[SplatFormat] = &[ply::FORMAT];

/// The model in a file or a pipe, in the format that its first bytes tell, else the ending of its name.
///
/// # Errors
/// Those of the format; for a file of no format here, one that names its format and the way out.
pub fn read(path: &Path) -> Result<(Gaussians, PlyNotes)> {
    let Stream { mut input, length } = stream::open(path)?;
    (recognized(&mut input, path)?.read)(&mut input, length, path)
}

/// What a file or a pipe holds, where the caller does not know: a model of any format, or points.
///
/// # Errors
/// Those of [`read`], but for Gaussians of a kind that is not drawn.
pub fn read_content(path: &Path) -> Result<Content> {
    let Stream { mut input, length } = stream::open(path)?;
    let format = recognized(&mut input, path)?;
    match format.name == ply::FORMAT.name {
        true => ply::content(input, length, path),
        false => {
            (format.read)(&mut input, length, path).map(|(model, notes)| Content::Gaussians(model, notes))
        }
    }
}

/// Writes a model in the format of its name's ending, replacing what was there only once the file is complete.
///
/// # Errors
/// [`Error::Argument`](vg_geometry::Error::Argument) where the ending is that of a format which is not here;
/// [`Error::Io`](vg_geometry::Error::Io).
pub fn write(path: &Path, gaussians: &Gaussians) -> Result<()> {
    match by_ending(path) {
        Some(format) => write_atomically(path, |out| (format.write)(out, gaussians)),
        None => ply::write(path, gaussians),
    }
}

/// Writes a model in the format of the ending of `name`, for a file that the caller has opened.
pub fn write_to(out: &mut dyn Write, name: &Path, gaussians: &Gaussians) -> std::io::Result<()> {
    (by_ending(name).unwrap_or(&FORMATS[0]).write)(out, gaussians)
}

fn recognized(input: &mut impl BufRead, path: &Path) -> Result<&'static SplatFormat> {
    let first = input.fill_buf().map_err(|e| vg_geometry::Error::io(path, e))?;
    let by_content = FORMATS.iter().find(|format| (format.recognizes)(first));
    Ok(by_content.or_else(|| by_ending(path)).unwrap_or(&FORMATS[0]))
}

fn by_ending(path: &Path) -> Option<&'static SplatFormat> {
    let ending = path.extension()?;
    FORMATS.iter().find(|format| format.endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_splat::gaussians::buffer::Gaussian;

    #[test]
    fn names_and_endings_are_each_of_one_format() {
        let mut seen = std::collections::BTreeSet::new();
        for format in FORMATS {
            assert!(seen.insert(format.name), "{}", format.name);
            assert!(format.endings.iter().all(|ending| seen.insert(*ending)), "{}", format.name);
        }
    }

    #[test]
    fn a_model_that_is_written_is_read_again_in_every_format() {
        let mut model = Gaussians::with_capacity(0, 1);
        model.push(&Gaussian {
            mean: [1.0, 2.0, 3.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            scale: [0.1, 0.2, 0.3],
            opacity: 0.5,
            sh0: [0.25, 0.5, 0.75],
        });
        let folder = tempfile::tempdir().unwrap();
        for format in FORMATS {
            for ending in format.endings {
                let path = folder.path().join(format!("a.{ending}"));
                write(&path, &model).unwrap();
                assert_eq!(read(&path).unwrap().0.len(), 1, "{}", format.name);
                let nameless = folder.path().join("a");
                std::fs::copy(&path, &nameless).unwrap();
                assert_eq!(read(&nameless).unwrap().0.means(), [[1.0, 2.0, 3.0]], "{}", format.name);
            }
        }
    }
}
