//! The portable float map: `Pf`, size and byte order as text, then f32 rows from the bottom up.

use super::depth::checked_size;
use std::path::Path;
use vg_geometry::{Error, Result};

/// Decodes width, height and values in row order from the top. The sign of the header's scale is the byte order; its
/// magnitude is a display hint that writers set arbitrarily, and is not applied.
pub(super) fn decode(bytes: &[u8], path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    let error = |field: &str, reason: String| Error::format(path, field, reason);
    let mut rest = bytes;
    let mut token = || -> Option<&str> {
        rest = rest.trim_ascii_start();
        let end = rest.iter().position(u8::is_ascii_whitespace)?;
        let text = std::str::from_utf8(&rest[..end]).ok()?;
        // Exactly one white-space byte ends the header; the data may begin with a byte that looks like another.
        rest = &rest[end + 1..];
        Some(text)
    };
    match token() {
        Some("Pf") => {}
        found => {
            return Err(error("magic", format!("{found:?}; allowed: Pf (one channel)")));
        }
    }
    let mut number = |field: &str| -> Result<f64> {
        let text = token().unwrap_or("");
        text.parse().map_err(|_| error(field, format!("{text:?}; allowed: a number")))
    };
    let (width, height, scale) = (number("width")?, number("height")?, number("scale")?);
    // `as` saturates, and turns NaN and negative numbers into 0, which is no size.
    let (width, height) = checked_size(path, width as u64, height as u64)?;
    if scale == 0.0 || !scale.is_finite() {
        return Err(error("scale", format!("{scale}; allowed: not zero")));
    }
    let (columns, rows) = (width as usize, height as usize);
    if rest.len() != columns * rows * 4 {
        return Err(error("data", format!("{} bytes; the size needs {}", rest.len(), columns * rows * 4)));
    }
    let decode = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let rows_from_top = rest.chunks_exact(columns * 4).rev();
    let values = rows_from_top.flat_map(|row| row.as_chunks::<4>().0).map(|b| decode(*b)).collect();
    Ok((width, height, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_row_of_the_file_is_the_top_row_in_either_byte_order() {
        let values = [1.0f32, 2.0, 3.0, 4.0];
        let mut little = b"Pf\n2 2\n-1.0\n".to_vec();
        little.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        let mut big = b"Pf 2 2 1\n".to_vec();
        big.extend(values.iter().flat_map(|v| v.to_be_bytes()));
        for bytes in [little, big] {
            let found = decode(&bytes, Path::new("d.pfm")).unwrap();
            assert_eq!(found, (2, 2, vec![3.0, 4.0, 1.0, 2.0]));
            assert!(decode(&bytes[..bytes.len() - 1], Path::new("d.pfm")).is_err());
        }
    }
}
