//! PLY files in memory, for networks, archives and tests.

use super::gaussians::{PlyNotes, read_from, size_of, write_to};
use std::path::Path;
use vg_geometry::Result;
use vg_splat::Gaussians;

/// Name of bytes without a file in errors.
const NAME: &str = "PLY in memory";

/// Reads the Gaussians in the bytes of a PLY file, as [`read`](super::read).
pub fn from_bytes(bytes: &[u8]) -> Result<(Gaussians, PlyNotes)> {
    read_from(bytes, bytes.len() as u64, Path::new(NAME))
}

/// The bytes of the file that [`write`](super::write) writes.
pub fn to_bytes(gaussians: &Gaussians) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(size_of(gaussians));
    write_to(&mut bytes, gaussians).expect("writing to a vector cannot fail");
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
    fn bytes_equal_those_of_the_file_and_have_the_announced_size() {
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
    fn truncated_or_empty_bytes_are_an_error_that_names_them() {
        let bytes = to_bytes(&sample(1, 3));
        for cut in [0, 3, 200, bytes.len() - 1] {
            let error = from_bytes(&bytes[..cut]).unwrap_err().to_string();
            assert!(error.starts_with("PLY in memory: "), "{error}");
        }
    }
}
