//! The similarity that takes a scene's own world to the vehicle's frame: as a JSON file, and from camera centres
//! that somebody measured.

use super::files::{in_file, read_limited, write_atomically};
use super::{json, listing, select};
use crate::error::{Error, Result};
use crate::geometry::Similarity;
use glam::DVec3;
use serde_json::Value;
use std::path::Path;

/// Longest file of either kind.
const MAX_FILE: u64 = 4 << 20;

/// Reads `{"vehicle_from_world": M}` or bare `M`, where M is a row-major 4x4 matrix as four rows or 16 numbers.
pub fn read_vehicle_from_world(path: &Path) -> Result<Similarity> {
    parse_vehicle_from_world(&read_limited(path, MAX_FILE)?, path)
}

/// The same from bytes; `path` is for messages only.
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

/// Writes the file that [`read_vehicle_from_world`] reads.
pub fn write_vehicle_from_world(path: &Path, vehicle_from_world: &Similarity) -> Result<()> {
    let m = vehicle_from_world.to_row_major();
    if !m.iter().all(|v| v.is_finite()) {
        return Err(Error::argument("vehicle_from_world", "a NaN or infinite entry", "finite numbers"));
    }
    let rows: Vec<String> =
        m.chunks_exact(4).map(|r| format!("    [{:?}, {:?}, {:?}, {:?}]", r[0], r[1], r[2], r[3])).collect();
    let text = format!("{{\n  \"vehicle_from_world\": [\n{}\n  ]\n}}\n", rows.join(",\n"));
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

/// A similarity found from camera centres, and how well it fits.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// The least-squares similarity.
    pub vehicle_from_world: Similarity,
    /// How far each camera's centre ends from where it was measured, metres, in the order given.
    pub residuals: Vec<f64>,
}

/// Reads camera centres in the vehicle's frame, metres: `{"000.png": [x, y, z], ...}`.
pub fn read_known_centers(path: &Path) -> Result<Vec<(String, DVec3)>> {
    parse_known_centers(&read_limited(path, MAX_FILE)?, path)
}

/// The same from bytes; `path` is for messages only.
pub fn parse_known_centers(bytes: &[u8], path: &Path) -> Result<Vec<(String, DVec3)>> {
    let centers: std::collections::BTreeMap<String, [f64; 3]> = json::parse(bytes, path)?;
    Ok(centers.into_iter().map(|(name, center)| (name, DVec3::from_array(center))).collect())
}

/// The similarity that best takes the camera centres of the scene at `path` to known ones (Umeyama 1991). Cameras
/// are known by name as in [`super::SceneOptions::views`]; at least three, not on one line.
pub fn vehicle_from_known_centers(path: &Path, known: &[(String, DVec3)]) -> Result<Alignment> {
    let listing = listing::list(path, None)?;
    let names: Vec<String> = known.iter().map(|(name, _)| name.clone()).collect();
    let chosen = select::select(&listing.views, &names)?;
    let centers: Vec<DVec3> = chosen.into_iter().map(|i| listing.views[i].camera.center()).collect();
    let targets: Vec<DVec3> = known.iter().map(|(_, center)| *center).collect();
    let vehicle_from_world = Similarity::umeyama(&centers, &targets)?;
    let residual = |(from, to): (&DVec3, &DVec3)| vehicle_from_world.transform_point(*from).distance(*to);
    let residuals = centers.iter().zip(&targets).map(residual).collect();
    Ok(Alignment { vehicle_from_world, residuals })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_rows_and_flat_numbers_and_bare_matrices_read_alike_and_survive_writing() {
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
