//! The vertices of a binary PLY file, a block of rows at a time, each property as f64.

use super::header::{Header, Property, Scalar};
use std::io::{BufRead, Read};
use std::path::Path;
use vg_geometry::{Error, Result};

/// Bytes read at once.
const BLOCK: usize = 1 << 18;

/// Calls `row` with the number and the bytes of every vertex, in order; only a block of the file is in memory at a
/// time.
pub(super) fn for_each(
    mut input: impl BufRead,
    header: &Header,
    path: &Path,
    mut row: impl FnMut(usize, &[u8]) -> Result<()>,
) -> Result<()> {
    let skipped = std::io::copy(&mut (&mut input).take(header.skip), &mut std::io::sink());
    skipped.map_err(|e| Error::io(path, e))?;
    let rows_at_once = (BLOCK / header.row_bytes).max(1);
    let mut block = vec![0; rows_at_once.min(header.vertices) * header.row_bytes];
    let mut first = 0;
    while first < header.vertices {
        let rows = rows_at_once.min(header.vertices - first);
        let bytes = &mut block[..rows * header.row_bytes];
        input.read_exact(bytes).map_err(|e| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                Error::format(path, format!("vertex {first}"), "the file ends after it; allowed: all rows")
            }
            _ => Error::io(path, e),
        })?;
        for (i, bytes) in bytes.chunks_exact(header.row_bytes).enumerate() {
            row(first + i, bytes)?;
        }
        first += rows;
    }
    Ok(())
}

/// The value of a property in a row.
pub(super) fn value(row: &[u8], property: &Property) -> f64 {
    let at = &row[property.offset..];
    match property.scalar {
        Scalar::F32 => f64::from(f32::from_le_bytes(take(at))),
        Scalar::F64 => f64::from_le_bytes(take(at)),
        Scalar::I8 => f64::from(i8::from_le_bytes(take(at))),
        Scalar::U8 => f64::from(at[0]),
        Scalar::I16 => f64::from(i16::from_le_bytes(take(at))),
        Scalar::U16 => f64::from(u16::from_le_bytes(take(at))),
        Scalar::I32 => f64::from(i32::from_le_bytes(take(at))),
        Scalar::U32 => f64::from(u32::from_le_bytes(take(at))),
    }
}

fn take<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|i| bytes[i])
}

/// A value in the range of f32, or an error that names vertex and property.
pub(super) fn finite(row: &[u8], property: &Property, vertex: usize, path: &Path) -> Result<f32> {
    let value = value(row, property);
    if value.abs() <= f64::from(f32::MAX) {
        return Ok(value as f32);
    }
    let field = format!("vertex {vertex}.{}", property.name);
    Err(Error::format(path, field, format!("{value}; allowed: finite numbers in the range of f32")))
}
