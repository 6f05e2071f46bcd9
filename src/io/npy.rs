//! NumPy's `.npy`, versions 1 to 3, as far as depth maps and masks need it: one array in C order, of little-endian f4
//! or f8, or of booleans or bytes.

use super::depth::checked_size;
use crate::error::{Error, Result};
use std::path::Path;

/// Width, height and values in row order of a `[height][width]` array; axes of length one around it are dropped.
pub(super) fn decode(bytes: &[u8], path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    let array = array(bytes, path, &[("<f4", 4), ("<f8", 8)])?;
    let values = if array.kind == "<f4" {
        array.data.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    } else {
        array.data.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b) as f32).collect()
    };
    Ok((array.width, array.height, values))
}

/// The same of a mask: bytes as they are, of booleans 255 for true.
pub(super) fn decode_mask(bytes: &[u8], path: &Path) -> Result<(u32, u32, Vec<u8>)> {
    let array = array(bytes, path, &[("|b1", 1), ("|u1", 1)])?;
    let is_truth = array.kind == "|b1";
    let value = |&b: &u8| if is_truth { 255 * u8::from(b != 0) } else { b };
    Ok((array.width, array.height, array.data.iter().map(value).collect()))
}

/// Whether these are the first bytes of such a file.
pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

const MAGIC: &[u8] = b"\x93NUMPY";

struct Array<'a> {
    width: u32,
    height: u32,
    kind: &'static str,
    data: &'a [u8],
}

/// An array whose items are of one of `kinds`, each with its size in bytes.
fn array<'a>(bytes: &'a [u8], path: &Path, kinds: &[(&'static str, usize)]) -> Result<Array<'a>> {
    let error = |field: &str, reason: String| Error::format(path, field, reason);
    let (header, data) = split(bytes)
        .ok_or_else(|| error("header", "not a whole .npy header; allowed: versions 1 to 3".into()))?;
    let missing = |key: &str| error(key, format!("missing in {header:?}"));

    let descr = value_of(header, "descr").ok_or_else(|| missing("descr"))?.trim_matches(['\'', '"', ' ']);
    let Some(&(kind, item)) = kinds.iter().find(|kind| kind.0 == descr) else {
        let allowed: Vec<String> = kinds.iter().map(|kind| format!("'{}'", kind.0)).collect();
        return Err(error("descr", format!("{descr:?}; allowed: {}", allowed.join(" or "))));
    };
    match value_of(header, "fortran_order").ok_or_else(|| missing("fortran_order"))?.trim() {
        "False" => {}
        other => return Err(error("fortran_order", format!("{other}; allowed: False (C order)"))),
    }
    let shape_text = value_of(header, "shape").ok_or_else(|| missing("shape"))?;
    let shape_error = || error("shape", format!("{shape_text}; allowed: (height, width)"));
    let mut shape = Vec::new();
    for part in shape_text.trim().trim_matches(['(', ')']).split(',').map(str::trim) {
        match part {
            "" => {}
            part if shape.len() < 4 => shape.push(part.parse::<u64>().map_err(|_| shape_error())?),
            _ => return Err(shape_error()),
        }
    }
    while shape.len() > 2 && shape.last() == Some(&1) {
        shape.pop();
    }
    while shape.len() > 2 && shape[0] == 1 {
        shape.remove(0);
    }
    let &[height, width] = shape.as_slice() else { return Err(shape_error()) };
    let (width, height) = checked_size(path, width, height)?;

    let expected = width as usize * height as usize * item;
    if data.len() != expected {
        return Err(error("data", format!("{} bytes; the shape needs {expected}", data.len())));
    }
    Ok(Array { width, height, kind, data })
}

/// Header text and data.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (version, rest) = rest.split_at_checked(2)?;
    let (length, rest) = match version[0] {
        1 => {
            let (length, rest) = rest.split_first_chunk::<2>()?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        }
        2 | 3 => {
            let (length, rest) = rest.split_first_chunk::<4>()?;
            (u32::from_le_bytes(*length) as usize, rest)
        }
        _ => return None,
    };
    let (header, data) = rest.split_at_checked(length)?;
    // The header is a Python dict literal of some eighty characters.
    (length <= 1 << 16).then_some((std::str::from_utf8(header).ok()?, data))
}

/// The text of `key`'s value in the dict literal: up to the next comma outside parentheses, or the closing brace.
fn value_of<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let start = [format!("'{key}'"), format!("\"{key}\"")]
        .iter()
        .find_map(|quoted| header.find(quoted.as_str()).map(|at| at + quoted.len()))?;
    let value = header[start..].trim_start().strip_prefix(':')?;
    let mut depth = 0i32;
    let end = value.find(|c| {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        (c == ',' && depth == 0) || c == '}'
    })?;
    Some(value[..end].trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u8, header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        match version {
            1 => bytes.extend((header.len() as u16).to_le_bytes()),
            _ => bytes.extend((header.len() as u32).to_le_bytes()),
        }
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn masks_are_booleans_or_bytes() {
        let header = |descr| format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1, 3), }}");
        let decode = |descr| decode_mask(&file(1, &header(descr), &[0, 1, 200]), Path::new("m.npy"));
        assert_eq!(decode("|b1").unwrap(), (3, 1, vec![0, 255, 255]));
        assert_eq!(decode("|u1").unwrap(), (3, 1, vec![0, 1, 200]));
        assert!(decode("<f4").unwrap_err().to_string().contains("'|b1' or '|u1'"));
    }

    #[test]
    fn rows_come_first_in_the_shape_and_unit_axes_are_dropped() {
        let data: Vec<u8> = (0..6).flat_map(|i| (i as f32).to_le_bytes()).collect();
        for (version, shape) in [(1, "(2, 3)"), (2, "(2, 3, 1)"), (3, "(1, 2, 3)")] {
            let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}   \n");
            let (w, h, values) = decode(&file(version, &header, &data), Path::new("d.npy")).unwrap();
            assert_eq!((w, h, values), (3, 2, vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
        }
    }

    #[test]
    fn other_types_orders_and_lengths_are_refused_by_field() {
        let cases = [
            ("{'descr': '>f4', 'fortran_order': False, 'shape': (1, 1), }", "descr"),
            ("{'descr': '<f4', 'fortran_order': True, 'shape': (1, 1), }", "fortran_order"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (1,), }", "shape"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }", "data"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 99999999999), }", "size"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (1, -2), }", "shape"),
            ("{'descr': '<f4', 'fortran_order': False}", "shape"),
        ];
        for (header, field) in cases {
            let error = decode(&file(1, header, &[0; 4]), Path::new("d.npy")).unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
