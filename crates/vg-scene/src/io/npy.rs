//! The subset of NumPy's `.npy`, versions 1 to 3, for depth maps and masks: one array in C order, of little-endian
//! floats or integers, or of booleans.

use super::depth::checked_size;
use std::path::Path;
use vg_geometry::{Error, Result};

/// The depths of a file.
#[derive(Debug)]
pub(super) struct Depths {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Values in row order.
    pub(super) values: Vec<f32>,
    /// Whether the file holds integers.
    pub(super) is_integer: bool,
}

const FLOATS: [(&str, usize); 2] = [("<f4", 4), ("<f8", 8)];
const INTEGERS: [(&str, usize); 6] = [("<u2", 2), ("<i2", 2), ("<u4", 4), ("<i4", 4), ("<u8", 8), ("<i8", 8)];
const BYTES: [(&str, usize); 3] = [("|b1", 1), ("|u1", 1), ("|i1", 1)];

/// Decodes the values of a `[height][width]` array; outer axes of length one are dropped.
pub(super) fn decode(bytes: &[u8], path: &Path) -> Result<Depths> {
    let array = array(bytes, path, &[&FLOATS[..], &INTEGERS].concat())?;
    let is_integer = !FLOATS.iter().any(|float| float.0 == array.kind);
    let values = array.values().map(|v| v as f32).collect();
    Ok(Depths { width: array.width, height: array.height, values, is_integer })
}

/// Decodes a mask: integers unchanged, 255 for true.
pub(super) fn decode_mask(bytes: &[u8], path: &Path) -> Result<(u32, u32, Vec<u8>)> {
    let array = array(bytes, path, &[&BYTES[..], &INTEGERS].concat())?;
    if array.kind == "|b1" {
        let values = array.data.iter().map(|&b| if b != 0 { u8::MAX } else { 0 }).collect();
        return Ok((array.width, array.height, values));
    }
    let beyond = array.values().find(|v| !(0.0..=255.0).contains(v));
    if let Some(value) = beyond {
        return Err(Error::format(path, "data", format!("{value} in a mask; allowed: 0 to 255")));
    }
    Ok((array.width, array.height, array.values().map(|v| v as u8).collect()))
}

/// Whether these are the first bytes of a `.npy` file.
pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

const MAGIC: &[u8] = b"\x93NUMPY";

struct Array<'a> {
    width: u32,
    height: u32,
    kind: &'static str,
    /// Size of a number, bytes.
    item: usize,
    data: &'a [u8],
}

impl<'a> Array<'a> {
    /// The numbers in row order; integers of 64 bits are rounded to 53.
    fn values(&self) -> impl Iterator<Item = f64> + use<'a> {
        let number = match self.kind {
            "<f4" => |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap_or_default())),
            "<f8" => |b: &[u8]| f64::from_le_bytes(b.try_into().unwrap_or_default()),
            "<u2" => |b: &[u8]| f64::from(u16::from_le_bytes(b.try_into().unwrap_or_default())),
            "<i2" => |b: &[u8]| f64::from(i16::from_le_bytes(b.try_into().unwrap_or_default())),
            "<u4" => |b: &[u8]| f64::from(u32::from_le_bytes(b.try_into().unwrap_or_default())),
            "<i4" => |b: &[u8]| f64::from(i32::from_le_bytes(b.try_into().unwrap_or_default())),
            "<u8" => |b: &[u8]| u64::from_le_bytes(b.try_into().unwrap_or_default()) as f64,
            "<i8" => |b: &[u8]| i64::from_le_bytes(b.try_into().unwrap_or_default()) as f64,
            "|i1" => |b: &[u8]| f64::from(b[0] as i8),
            _ => |b: &[u8]| f64::from(b[0]),
        };
        self.data.chunks_exact(self.item).map(number)
    }
}

/// Parses an array whose items are of one of `kinds`, each with its size in bytes.
fn array<'a>(bytes: &'a [u8], path: &Path, kinds: &[(&'static str, usize)]) -> Result<Array<'a>> {
    let error = |field: &str, reason: String| Error::format(path, field, reason);
    let (header, data) = split(bytes)
        .ok_or_else(|| error("header", "not a complete .npy header; allowed: versions 1 to 3".into()))?;
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
    Ok(Array { width, height, kind, item, data })
}

/// Splits a file into header text and data.
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
    fn masks_are_booleans_or_integers_from_0_to_255() {
        let header = |descr| format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1, 3), }}");
        let decode = |descr, data: &[u8]| decode_mask(&file(1, &header(descr), data), Path::new("m.npy"));
        assert_eq!(decode("|b1", &[0, 1, 200]).unwrap(), (3, 1, vec![0, 255, 255]));
        assert_eq!(decode("|u1", &[0, 1, 200]).unwrap(), (3, 1, vec![0, 1, 200]));
        let long: Vec<u8> = [0i64, 1, 200].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(decode("<i8", &long).unwrap(), (3, 1, vec![0, 1, 200]));
        assert!(decode("|i1", &[0, 1, 200]).unwrap_err().to_string().contains("m.npy: data: -56 in a mask"));
        assert!(decode("<f4", &[0; 12]).unwrap_err().to_string().contains("'|b1' or '|u1'"));
    }

    #[test]
    fn integers_of_any_width_give_equal_depths_and_are_distinguished_from_floats() {
        let header = |descr| format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1, 2), }}");
        let numbers: [(&str, Vec<u8>); 4] = [
            ("<u2", [7u16, 1234].iter().flat_map(|v| v.to_le_bytes()).collect()),
            ("<i2", [7i16, 1234].iter().flat_map(|v| v.to_le_bytes()).collect()),
            ("<i4", [7i32, 1234].iter().flat_map(|v| v.to_le_bytes()).collect()),
            ("<u8", [7u64, 1234].iter().flat_map(|v| v.to_le_bytes()).collect()),
        ];
        for (descr, data) in numbers {
            let found = decode(&file(1, &header(descr), &data), Path::new("d.npy")).unwrap();
            assert_eq!((found.values, found.is_integer), (vec![7.0, 1234.0], true), "{descr}");
        }
    }

    #[test]
    fn rows_come_first_in_the_shape_and_unit_axes_are_dropped() {
        let data: Vec<u8> = (0..6).flat_map(|i| (i as f32).to_le_bytes()).collect();
        for (version, shape) in [(1, "(2, 3)"), (2, "(2, 3, 1)"), (3, "(1, 2, 3)")] {
            let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}   \n");
            let found = decode(&file(version, &header, &data), Path::new("d.npy")).unwrap();
            assert_eq!((found.width, found.height, found.is_integer), (3, 2, false));
            assert_eq!(found.values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
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
