//! Coloured point clouds: `x y z` float, `red green blue` uchar.

use super::header;
use super::rows::{self, finite};
use crate::error::{Error, Result};
use crate::io::files::write_atomically;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Positions and their colours, equally many.
pub type ColoredPoints = (Vec<[f32; 3]>, Vec<[u8; 3]>);

/// The point cloud in a PLY file; points without colour are mid-grey.
pub fn read_points(path: &Path) -> Result<ColoredPoints> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let length = file.metadata().map_err(|e| Error::io(path, e))?.len();
    read_points_from(BufReader::with_capacity(1 << 16, file), length, path)
}

/// The same from any source of `length` bytes; `path` is for messages only.
pub fn read_points_from(mut input: impl BufRead, length: u64, path: &Path) -> Result<ColoredPoints> {
    let header = header::read(&mut input, length, path)?;
    let find = |name: &str| {
        let missing = || Error::format(path, format!("property {name}"), "missing; allowed: x y z");
        header.find(name).ok_or_else(missing)
    };
    let position = [find("x")?, find("y")?, find("z")?];
    let color = ["red", "green", "blue"].map(|name| header.find(name));
    let mut positions = Vec::with_capacity(header.vertices);
    let mut colors = Vec::with_capacity(header.vertices);
    rows::for_each(input, &header, path, |vertex, row| {
        let get = |k: usize| finite(row, position[k], vertex, path);
        positions.push([get(0)?, get(1)?, get(2)?]);
        // `as` saturates.
        colors.push(color.map(|c| c.map_or(128, |c| rows::value(row, c) as u8)));
        Ok(())
    })?;
    Ok((positions, colors))
}

/// Writes a point cloud, replacing what was there only once the file is complete.
pub fn write_points(path: &Path, positions: &[[f32; 3]], colors: &[[u8; 3]]) -> Result<()> {
    if positions.len() != colors.len() {
        let allowed = format!("{}, one a position", positions.len());
        return Err(Error::argument("colors", colors.len().to_string(), allowed));
    }
    write_atomically(path, |out| {
        write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", positions.len())?;
        out.write_all(b"property float x\nproperty float y\nproperty float z\n")?;
        out.write_all(b"property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n")?;
        for (position, color) in positions.iter().zip(colors) {
            let mut row = [0; 15];
            for k in 0..3 {
                row[4 * k..4 * k + 4].copy_from_slice(&position[k].to_le_bytes());
            }
            row[12..].copy_from_slice(color);
            out.write_all(&row)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_cloud_is_read_back_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("points.ply");
        let points = (vec![[1.0, -2.0, 3.5], [0.0, 1e-30, -1e30]], vec![[1, 2, 3], [0, 128, 255]]);
        write_points(&path, &points.0, &points.1).unwrap();
        assert_eq!(read_points(&path).unwrap(), points);
        assert!(write_points(&path, &points.0, &[]).is_err());
    }
}
