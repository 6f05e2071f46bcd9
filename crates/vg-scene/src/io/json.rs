//! JSON with errors that contain their place in the document.

use serde::de::DeserializeOwned;
use std::path::Path;
use vg_geometry::{Error, Result};

/// Longest JSON file that is read. Four thousand frames take about 4 MB.
pub(super) const MAX_FILE: u64 = 64 << 20;

/// Parses a document; the field of an error is the path to the value: `frames[3].transform_matrix[0]`.
pub(super) fn parse<T: DeserializeOwned>(bytes: &[u8], path: &Path) -> Result<T> {
    // The byte order mark that some editors write is refused by the parser.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let value = serde_path_to_error::deserialize(&mut deserializer).map_err(|e| {
        let field = match e.path().to_string() {
            root if root == "." => "document".to_owned(),
            field => field,
        };
        Error::format(path, field, e.inner().to_string())
    })?;
    deserializer.end().map_err(|e| Error::format(path, "end of document", e.to_string()))?;
    Ok(value)
}

/// [`parse`] for a document that must be an object; otherwise an array would count as the keys' values in order.
pub(super) fn parse_object<T: DeserializeOwned>(bytes: &[u8], path: &Path) -> Result<T> {
    match bytes.trim_ascii_start().first() {
        Some(b'[' | b'"' | b'0'..=b'9' | b'-') => {
            Err(Error::format(path, "document", "not an object; allowed: { ... }"))
        }
        _ => parse(bytes, path),
    }
}
