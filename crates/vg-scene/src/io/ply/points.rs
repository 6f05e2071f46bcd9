//! Coloured point clouds: `x y z` float, `red green blue` uchar.

use super::foreign;
use super::header::{self, Header};
use super::rows::{self, finite};
use crate::io::files::write_atomically;
use crate::io::stream;
use std::io::{BufRead, Write};
use std::path::Path;
use vg_geometry::{Error, Result};

/// Positions and their colours, in equal numbers.
pub type ColoredPoints = (Vec<[f32; 3]>, Vec<[u8; 3]>);

/// Reads the point cloud in a PLY file, which may be a pipe; points without colour are mid-grey.
pub fn read_points(path: &Path) -> Result<ColoredPoints> {
    let stream = stream::open(path)?;
    let (header, input) = header::open(stream.input, stream.length, path)?;
    read_rows(input, &header, path)
}

/// Reads a point cloud from any source of `length` bytes, as [`read_points`]; `path` is for messages only.
pub fn read_points_from(input: impl BufRead, length: u64, path: &Path) -> Result<ColoredPoints> {
    let (header, input) = header::open(input, Some(length), path)?;
    read_rows(input, &header, path)
}

/// Reads the points that follow a header.
pub(super) fn read_rows(input: impl BufRead, header: &Header, path: &Path) -> Result<ColoredPoints> {
    let find = |name: &str| {
        let missing = || Error::format(path, format!("property {name}"), "missing; allowed: x y z");
        header.find(name).ok_or_else(missing)
    };
    let position = [find("x")?, find("y")?, find("z")?];
    let color = ["red", "green", "blue"].map(|name| header.find(name));
    let mut positions = Vec::with_capacity(header.reserve);
    let mut colors = Vec::with_capacity(header.reserve);
    rows::for_each(input, header, path, |vertex, row| {
        let get = |k: usize| finite(row, position[k], vertex, path);
        positions.push([get(0)?, get(1)?, get(2)?]);
        // `as` saturates.
        colors.push(color.map(|c| c.map_or(128, |c| rows::value(row, c) as u8)));
        Ok(())
    })?;
    Ok((positions, colors))
}

/// Writes a point cloud; an existing file is replaced once the new one is complete. The extension of another format, as
/// in car.las, is an error.
pub fn write_points(path: &Path, positions: &[[f32; 3]], colors: &[[u8; 3]]) -> Result<()> {
    foreign::refuse_name(path)?;
    if positions.len() != colors.len() {
        let allowed = format!("{}, one for each position", positions.len());
        return Err(Error::argument("colors", colors.len().to_string(), allowed));
    }
    write_atomically(path, |out| write_points_to(out, positions, colors))
}

/// Writes points a row at a time, as many as there are both positions and colours.
pub fn write_points_to(
    out: &mut dyn Write,
    positions: &[[f32; 3]],
    colors: &[[u8; 3]],
) -> std::io::Result<()> {
    let points = positions.len().min(colors.len());
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {points}\n")?;
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
