//! The header of a PLY file: the properties of a vertex, their types, and the position of the rows.

use super::foreign::{self, FIRST_BYTES};
use std::io::{BufRead, Cursor, Read};
use std::path::Path;
use vg_geometry::{Error, Result};

/// Maximum size of a header, bytes; that of Gaussians of degree 3 takes about 1600.
const MAX_HEADER: u64 = 1 << 20;

/// Maximum of properties, more than any writer's; the search for repeated names is quadratic.
const MAX_PROPERTIES: usize = 1024;

/// Maximum of vertices, so that an i32 can count them everywhere.
const MAX_VERTICES: u64 = i32::MAX as u64;

/// Maximum of vertices for which memory is reserved if the length of the input is unknown.
const RESERVED: usize = 1 << 16;

/// Type of a scalar property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A scalar property of a vertex and its offset in a row.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) offset: usize,
}

/// The header's description of the vertices.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) vertices: usize,
    pub(super) properties: Vec<Property>,
    pub(super) row_bytes: usize,
    /// Bytes of other elements between the header and the vertices.
    pub(super) skip: u64,
    /// The number of vertices to reserve memory for before the first is read, which the header alone must not inflate.
    pub(super) reserve: usize,
}

impl Header {
    /// The property named `name`.
    pub(super) fn find(&self, name: &str) -> Option<&Property> {
        self.properties.iter().find(|p| p.name == name)
    }
}

/// Reads up to and including `end_header`; returns the header and the rest of the input. `length` is the whole file's,
/// if it is known: the rows that the header announces must fit in it.
pub(super) fn open<R: BufRead>(
    mut input: R,
    length: Option<u64>,
    path: &Path,
) -> Result<(Header, impl BufRead + use<R>)> {
    let mut first = Vec::new();
    (&mut input).take(FIRST_BYTES as u64).read_to_end(&mut first).map_err(|e| Error::io(path, e))?;
    foreign::refuse(&first, path)?;
    let mut input = Cursor::new(first).chain(input);
    let header = read(&mut input, length, path)?;
    Ok((header, input))
}

fn read(input: &mut impl BufRead, length: Option<u64>, path: &Path) -> Result<Header> {
    let error = |field: &str, reason: String| Error::format(path, field, reason);
    let mut lines = Lines { input: input.take(MAX_HEADER), consumed: 0 };
    if lines.next(path)? != "ply" {
        return Err(error("magic", "the first line is not \"ply\"; allowed: a PLY file".into()));
    }
    let format = lines.next(path)?;
    if format != "format binary_little_endian 1.0" {
        let way_out = "convert it: `splat-transform IN.ply OUT.ply`, or save it as binary, little-endian";
        return Err(error(
            "format",
            format!("{format:?}; allowed: format binary_little_endian 1.0; {way_out}"),
        ));
    }
    let elements = read_elements(&mut lines, path)?;

    let mut skip = 0u64;
    let mut vertex = None;
    for element in elements {
        if element.name == "vertex" {
            vertex = Some(element);
            break;
        }
        skip = skip.saturating_add(element.count.saturating_mul(element.row_bytes as u64));
    }
    let vertex = vertex.ok_or_else(|| error("element vertex", "missing; allowed: one".into()))?;
    let Element { count, properties, row_bytes, .. } = vertex;
    let available = length.map(|length| length.saturating_sub(lines.consumed).saturating_sub(skip));
    let needed = count.checked_mul(row_bytes as u64);
    if row_bytes == 0 || available.is_some_and(|available| needed.is_none_or(|n| n > available)) {
        let follow = available.map_or_else(|| "some".into(), |n| n.to_string());
        let reason = format!("{count} rows of {row_bytes} bytes, but {follow} bytes follow");
        return Err(error("element vertex", reason));
    }
    if count > MAX_VERTICES {
        return Err(error("element vertex", format!("{count}; allowed: at most {MAX_VERTICES}")));
    }
    let vertices = count as usize;
    let reserve = if length.is_some() { vertices } else { vertices.min(RESERVED) };
    Ok(Header { vertices, properties, row_bytes, skip, reserve })
}

/// One element of the header.
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
    row_bytes: usize,
}

/// Reads the elements up to the vertices, with their properties; elements after the vertices are ignored.
fn read_elements<R: BufRead>(lines: &mut Lines<R>, path: &Path) -> Result<Vec<Element>> {
    let error = |field: &str, reason: String| Error::format(path, field, reason);
    let mut elements: Vec<Element> = Vec::new();
    let mut past_vertex = false;
    loop {
        let line = lines.next(path)?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match *words.as_slice() {
            ["end_header"] => return Ok(elements),
            ["comment" | "obj_info", ..] => {}
            ["element", name, count] => {
                let count = count.parse().map_err(|_| {
                    error(&format!("element {name}"), format!("count {count:?}; allowed: 0 or more"))
                })?;
                past_vertex = past_vertex || elements.last().is_some_and(|e| e.name == "vertex");
                if past_vertex && name == "vertex" {
                    return Err(error("element vertex", "given twice; allowed: once".into()));
                }
                if !past_vertex {
                    let properties = Vec::new();
                    elements.push(Element { name: name.into(), count, properties, row_bytes: 0 });
                }
            }
            ["property", ..] if past_vertex => {}
            ["property", ref rest @ ..] => {
                let Some(element) = elements.last_mut() else {
                    return Err(error("property", format!("{line:?} before any element")));
                };
                let field = format!("property of {}", element.name);
                element.add(rest).map_err(|reason| error(&field, reason))?;
            }
            _ => {
                let reason = format!("{line:?}; allowed: element, property, comment, end_header");
                return Err(error("header", reason));
            }
        }
    }
}

impl Element {
    fn add(&mut self, words: &[&str]) -> std::result::Result<(), String> {
        let &[kind, name] = words else {
            return Err(format!("{:?}; allowed: TYPE NAME, and no list", words.join(" ")));
        };
        let scalar = Scalar::from_name(kind)
            .ok_or_else(|| format!("{name}: type {kind:?}; allowed: char to double, int8 to float64"))?;
        if self.properties.iter().any(|p| p.name == name) {
            return Err(format!("{name} twice; allowed: once"));
        }
        if self.properties.len() == MAX_PROPERTIES {
            return Err(format!("more than {MAX_PROPERTIES}"));
        }
        self.properties.push(Property { name: name.to_owned(), scalar, offset: self.row_bytes });
        self.row_bytes += scalar.size();
        Ok(())
    }
}

struct Lines<R> {
    input: std::io::Take<R>,
    consumed: u64,
}

impl<R: BufRead> Lines<R> {
    /// The next line without its line ending (LF or CR LF).
    fn next(&mut self, path: &Path) -> Result<String> {
        let mut line = Vec::new();
        self.input.read_until(b'\n', &mut line).map_err(|e| Error::io(path, e))?;
        self.consumed += line.len() as u64;
        if line.pop() != Some(b'\n') {
            let reason = "ends before end_header; allowed: a complete header of at most 1 MiB";
            return Err(Error::format(path, "header", reason));
        }
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        String::from_utf8(line).map_err(|_| Error::format(path, "header", "not text; allowed: a PLY header"))
    }
}
