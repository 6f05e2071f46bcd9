//! The similarity from a scene's own world to the vehicle's frame: as a JSON file, and from measured camera centres.

use super::files::{in_file, read_limited_or_piped, write_atomically};
use super::{json, listing, select};
use glam::DVec3;
use serde_json::Value;
use std::path::Path;
use vg_geometry::{Error, Result, RobustFit, Similarity};

/// Maximum size of a file, bytes.
const MAX_FILE: u64 = 4 << 20;

/// Reads `{"vehicle_from_world": M}` or bare `M`, where M is a row-major 4x4 matrix as four rows or 16 numbers.
pub fn read_vehicle_from_world(path: &Path) -> Result<Similarity> {
    parse_vehicle_from_world(&read_limited_or_piped(path, MAX_FILE)?, path)
}

/// Parses the file of [`read_vehicle_from_world`] from bytes; `path` is for messages only.
pub fn parse_vehicle_from_world(bytes: &[u8], path: &Path) -> Result<Similarity> {
    const FIELD: &str = "vehicle_from_world";
    let error = |reason: &str| Error::format(path, FIELD, reason);
    let document: Value = json::parse(bytes, path)?;
    let matrix = match &document {
        Value::Object(keys) => keys.get(FIELD).ok_or_else(|| error("missing; allowed: a 4x4 matrix"))?,
        bare => bare,
    };
    let not_4x4 = || error("not a 4x4 matrix; allowed: four rows of four numbers, or 16 numbers, row-major");
    let rows = matrix.as_array().ok_or_else(not_4x4)?;
    let numbers: Vec<&Value> = if rows.len() == 4 {
        let rows: Vec<&Vec<Value>> =
            rows.iter().map(Value::as_array).collect::<Option<_>>().ok_or_else(not_4x4)?;
        if rows.iter().any(|row| row.len() != 4) {
            return Err(not_4x4());
        }
        rows.into_iter().flatten().collect()
    } else {
        rows.iter().collect()
    };
    let numbers: Vec<f64> =
        numbers.into_iter().map(Value::as_f64).collect::<Option<_>>().ok_or_else(not_4x4)?;
    let matrix: [f64; 16] = numbers.try_into().map_err(|_| not_4x4())?;
    Similarity::from_row_major(FIELD, &matrix).map_err(|e| in_file(path, e))
}

/// Reads the file of [`read_vehicle_from_world`], or plain text of 16 numbers, row-major, with blanks or commas
/// between.
pub fn read_matrix(path: &Path) -> Result<Similarity> {
    parse_matrix(&read_limited_or_piped(path, MAX_FILE)?, path)
}

/// Parses the file of [`read_matrix`] from bytes; `path` is for messages only.
pub fn parse_matrix(bytes: &[u8], path: &Path) -> Result<Similarity> {
    if matches!(bytes.trim_ascii_start().first(), Some(b'{' | b'[' | 0xef)) {
        return parse_vehicle_from_world(bytes, path);
    }
    let error = |reason: String| Error::format(path, "matrix", reason);
    let text =
        std::str::from_utf8(bytes).map_err(|_| error("not a text; allowed: JSON or 16 numbers".into()))?;
    let words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let number = |word: &str| {
        let shown: String = word.chars().take(20).collect();
        word.parse::<f64>().map_err(|_| error(format!("{shown:?}; allowed: 16 numbers")))
    };
    // One more than allowed is enough to detect too many.
    let numbers: Vec<f64> = words.take(17).map(number).collect::<Result<_>>()?;
    let found = numbers.len();
    let matrix: [f64; 16] = numbers.try_into().map_err(|_| {
        let found = if found > 16 { "more than 16".to_owned() } else { found.to_string() };
        error(format!("{found} numbers; allowed: 16, row-major, blanks or commas between"))
    })?;
    Similarity::from_row_major("matrix", &matrix).map_err(|e| in_file(path, e))
}

/// Quality of a similarity's fit to its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitQuality {
    /// Typical distance of points that should coincide, metres.
    pub residual_m: f64,
    /// Confidence, 0 to 1.
    pub confidence: f64,
}

/// Writes the file that [`read_vehicle_from_world`] reads.
pub fn write_vehicle_from_world(path: &Path, vehicle_from_world: &Similarity) -> Result<()> {
    write_alignment(path, vehicle_from_world, None)
}

/// Writes the file of [`write_vehicle_from_world`] with the quality of the fit, which readers ignore; `null` if it was
/// not measured.
pub fn write_alignment(
    path: &Path,
    vehicle_from_world: &Similarity,
    quality: Option<FitQuality>,
) -> Result<()> {
    let text = alignment_text(vehicle_from_world, quality)?;
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

/// The text of the file that [`write_alignment`] writes.
pub fn alignment_text(vehicle_from_world: &Similarity, quality: Option<FitQuality>) -> Result<String> {
    let m = vehicle_from_world.to_row_major();
    if !m.iter().all(|v| v.is_finite()) {
        return Err(Error::argument("vehicle_from_world", "a NaN or infinite entry", "finite numbers"));
    }
    let rows: Vec<String> =
        m.chunks_exact(4).map(|r| format!("    [{:?}, {:?}, {:?}, {:?}]", r[0], r[1], r[2], r[3])).collect();
    let number = |value: Option<f64>| {
        let value = value.filter(|v| v.is_finite());
        value.map_or_else(|| "null".to_owned(), |v| format!("{v:?}"))
    };
    Ok(format!(
        "{{\n  \"vehicle_from_world\": [\n{}\n  ],\n  \"scale\": {:?},\n  \"residual_m\": {},\n  \"confidence\": {}\n}}\n",
        rows.join(",\n"),
        vehicle_from_world.scale,
        number(quality.map(|q| q.residual_m)),
        number(quality.map(|q| q.confidence)),
    ))
}

/// Reads camera centres in the vehicle's frame, metres: `{"000.png": [x, y, z], ...}`.
pub fn read_known_centers(path: &Path) -> Result<Vec<(String, DVec3)>> {
    parse_known_centers(&read_limited_or_piped(path, MAX_FILE)?, path)
}

/// Parses the file of [`read_known_centers`] from bytes; `path` is for messages only.
pub fn parse_known_centers(bytes: &[u8], path: &Path) -> Result<Vec<(String, DVec3)>> {
    let centers: std::collections::BTreeMap<String, [f64; 3]> = json::parse(bytes, path)?;
    Ok(centers.into_iter().map(|(name, center)| (name, DVec3::from_array(center))).collect())
}

/// The similarity that best takes the camera centres of the scene at `path` to known ones; outliers are left out
/// ([`Similarity::umeyama_robust`]). Cameras are named as in [`super::SceneOptions::views`]; at least three, not
/// on one line.
pub fn vehicle_from_known_centers(path: &Path, known: &[(String, DVec3)]) -> Result<RobustFit> {
    let listing = listing::list(path, super::colmap_format(path))?;
    let names: Vec<String> = known.iter().map(|(name, _)| name.clone()).collect();
    let chosen = select::select(&listing.views, &names)?;
    let centers: Vec<DVec3> = chosen.into_iter().map(|i| listing.views[i].camera.center()).collect();
    let targets: Vec<DVec3> = known.iter().map(|(_, center)| *center).collect();
    Similarity::umeyama_robust(&centers, &targets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_rows_flat_numbers_and_bare_matrices_are_equal_and_survive_writing() {
        let rows = "[[0,-2,0,1.5],[2,0,0,-1],[0,0,2,0.25],[0,0,0,1]]";
        let flat = "[0,-2,0,1.5, 2,0,0,-1, 0,0,2,0.25, 0,0,0,1]";
        let texts = [
            format!("{{\"vehicle_from_world\": {rows}, \"note\": [1]}}"),
            format!("{{\"vehicle_from_world\": {flat}}}"),
            rows.to_owned(),
            flat.to_owned(),
        ];
        let path = Path::new("v.json");
        let first = parse_vehicle_from_world(texts[0].as_bytes(), path).unwrap();
        assert!((first.scale - 2.0).abs() < 1e-15);
        assert_eq!(first.transform_point(DVec3::X).to_array(), [1.5, 1.0, 0.25]);
        for text in &texts {
            assert_eq!(parse_vehicle_from_world(text.as_bytes(), path).unwrap(), first);
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("v.json");
        write_vehicle_from_world(&path, &first).unwrap();
        assert_eq!(read_vehicle_from_world(&path).unwrap(), first);
        write_alignment(&path, &first, Some(FitQuality { residual_m: 0.01, confidence: 0.9 })).unwrap();
        assert_eq!(read_vehicle_from_world(&path).unwrap(), first);
    }

    #[test]
    fn a_matrix_is_json_or_sixteen_numbers_of_a_similarity() {
        let parse = |text: &str| parse_matrix(text.as_bytes(), Path::new("m.txt"));
        let found = parse("0 -2 0 1.5\n2, 0, 0, -1\n0 0 2 2.5e-1\n0 0 0 1\n").unwrap();
        assert_eq!(found, parse("[[0,-2,0,1.5],[2,0,0,-1],[0,0,2,0.25],[0,0,0,1]]").unwrap());
        for (bad, cause) in [
            ("", "0 numbers"),
            ("1 2 3", "3 numbers"),
            ("0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1", "more than 16"),
            ("1 0 0 0 0 one", "\"one\""),
            ("1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1", "determinant > 0"),
            ("1 0 0 0 0 2 0 0 0 0 1 0 0 0 0 1", "matrix"),
            ("nan 0 0 0 0 2 0 0 0 0 1 0 0 0 0 1", "matrix"),
        ] {
            let error = parse(bad).unwrap_err().to_string();
            assert!(error.contains(cause) && error.contains("m.txt"), "{bad}: {error}");
        }
    }

    #[test]
    fn mirrors_shears_and_other_shapes_are_refused() {
        for bad in [
            "[[0,2,0,0],[2,0,0,0],[0,0,2,0],[0,0,0,1]]",
            "[[1,1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
            "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]",
            "[[1,0,0,0],[0,1,0,0],[0,0,1,0]]",
            "[1,2,3]",
            "{\"world\": []}",
            "7",
        ] {
            let error = parse_vehicle_from_world(bad.as_bytes(), Path::new("v.json")).unwrap_err();
            assert!(error.to_string().contains("vehicle_from_world"), "{error}");
        }
    }
}
