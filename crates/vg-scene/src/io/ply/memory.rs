//! The same PLY files in memory: for what is sent over a network, kept in an archive, or made by a test.

use super::gaussians::{PlyNotes, read_from, size_of, write_to};
use std::path::Path;
use vg_geometry::Result;
use vg_splat::Gaussians;

/// What errors call bytes that have no file.
const NAME: &str = "PLY in memory";

/// The Gaussians in the bytes of a PLY file, as [`read`](super::read) reads them.
pub fn from_bytes(bytes: &[u8]) -> Result<(Gaussians, PlyNotes)> {
    read_from(bytes, bytes.len() as u64, Path::new(NAME))
}

/// The bytes that [`write`](super::write) puts into a file.
pub fn to_bytes(gaussians: &Gaussians) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(size_of(gaussians));
    write_to(&mut bytes, gaussians).expect("a vector takes what it is given");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::ply::{read, write};

    fn sample(degree: u8, n: usize) -> Gaussians {
        let stride = 3 * (usize::from(degree) + 1).pow(2);
        Gaussians::from_arrays(
            degree,
            (0..n).map(|i| [i as f32, 0.5, -2.0]).collect(),
            vec![[0.5, 0.5, -0.5, 0.5]; n],
            vec![[0.01, 0.02, 0.03]; n],
            vec![0.25; n],
            (0..n * stride).map(|i| i as f32).collect(),
        )
        .unwrap()
    }

    #[test]
    fn bytes_are_those_of_the_file_as_many_as_were_announced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.ply");
        for (degree, n) in [(0, 0), (0, 9), (1, 10), (2, 100), (3, 1001)] {
            let gaussians = sample(degree, n);
            let bytes = to_bytes(&gaussians);
            write(&path, &gaussians).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), bytes);
            assert_eq!(size_of(&gaussians), bytes.len());
            assert_eq!(from_bytes(&bytes).unwrap(), read(&path).unwrap());
        }
    }

    #[test]
    fn bytes_that_end_early_or_are_none_are_an_error_that_says_so() {
        let bytes = to_bytes(&sample(1, 3));
        for cut in [0, 3, 200, bytes.len() - 1] {
            let error = from_bytes(&bytes[..cut]).unwrap_err().to_string();
            assert!(error.starts_with("PLY in memory: "), "{error}");
        }
    }
}
