//! `cameras.bin`, `images.bin`, `points3D.bin`: little-endian records after a 64-bit count.

use super::model::{ModelCamera, ModelImage, SparsePoints, model_from_id};
use std::collections::HashMap;
use std::path::Path;
use vg_geometry::{Error, Result};

/// Bytes of the shortest possible record of each file, which bound its count.
const MIN_CAMERA: u64 = 4 + 4 + 8 + 8 + 3 * 8;
const MIN_IMAGE: u64 = 4 + 7 * 8 + 4 + 1 + 8;
const MIN_POINT: u64 = 8 + 3 * 8 + 3 + 8 + 8;

/// Bytes of a feature of an image (x, y, point id) and of an element of a point's track (image id, feature).
const FEATURE: u64 = 8 + 8 + 8;
const TRACK_ELEMENT: u64 = 4 + 4;

/// Cameras by id; `path` is for messages only.
pub fn cameras_from_binary(bytes: &[u8], path: &Path) -> Result<HashMap<u32, ModelCamera>> {
    let (mut records, count) = Records::new(bytes, path, "camera", MIN_CAMERA)?;
    let mut cameras = HashMap::with_capacity(count);
    for _ in 0..count {
        records.next_record();
        let id = records.u32()?;
        let model = model_from_id(records.u32()? as i32, id, path)?;
        let size = (records.u64()?, records.u64()?);
        let params = (0..model.parameter_count()).map(|_| records.f64()).collect::<Result<_>>()?;
        if cameras.insert(id, ModelCamera::new(id, model, size, params, path)?).is_some() {
            return Err(Error::format(path, format!("camera {id}.id"), "used twice; allowed: once"));
        }
    }
    records.end()?;
    Ok(cameras)
}

/// Posed images; their features are skipped.
pub fn images_from_binary(bytes: &[u8], path: &Path) -> Result<Vec<ModelImage>> {
    let (mut records, count) = Records::new(bytes, path, "image", MIN_IMAGE)?;
    let mut images = Vec::with_capacity(count);
    for _ in 0..count {
        records.next_record();
        let id = records.u32()?;
        let qvec_wxyz = [records.f64()?, records.f64()?, records.f64()?, records.f64()?];
        let tvec = [records.f64()?, records.f64()?, records.f64()?];
        let camera_id = records.u32()?;
        let name = records.until_zero()?;
        images.push(ModelImage::new(id, qvec_wxyz, tvec, camera_id, name, path)?);
        let features = records.u64()?;
        records.skip(features, FEATURE, "features")?;
    }
    records.end()?;
    Ok(images)
}

/// Sparse points; their tracks are skipped.
pub fn points_from_binary(bytes: &[u8], path: &Path) -> Result<SparsePoints> {
    let (mut records, count) = Records::new(bytes, path, "point", MIN_POINT)?;
    let mut points = SparsePoints::default();
    points.positions.reserve_exact(count);
    points.colors.reserve_exact(count);
    for _ in 0..count {
        records.next_record();
        let id = records.u64()?;
        let position = [records.f64()?, records.f64()?, records.f64()?];
        let color = records.take()?;
        let _reprojection_error = records.f64()?;
        points.push(id, position, color, path)?;
        let track = records.u64()?;
        records.skip(track, TRACK_ELEMENT, "track elements")?;
    }
    records.end()?;
    Ok(points)
}

/// The unread bytes, and the number of the record that they belong to.
struct Records<'a> {
    rest: &'a [u8],
    path: &'a Path,
    kind: &'static str,
    record: u64,
    count: u64,
}

impl<'a> Records<'a> {
    /// Reads the count and checks it against the file: each record takes at least `min_bytes`.
    fn new(bytes: &'a [u8], path: &'a Path, kind: &'static str, min_bytes: u64) -> Result<(Self, usize)> {
        let mut records = Self { rest: bytes, path, kind, record: 0, count: 0 };
        let count = records.u64()?;
        let most = records.rest.len() as u64 / min_bytes;
        if count > most {
            let reason = format!("{count} {kind}s, but the file has room for {most}");
            return Err(Error::format(path, "count", reason));
        }
        records.count = count;
        Ok((records, count as usize))
    }

    fn next_record(&mut self) {
        self.record += 1;
    }

    fn truncated(&self) -> Error {
        let field = match self.record {
            0 => "count".to_owned(),
            record => format!("{} record {record} of {}", self.kind, self.count),
        };
        Error::format(self.path, field, "the file ends inside it; allowed: a complete model")
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let (head, rest) = self.rest.split_first_chunk().ok_or_else(|| self.truncated())?;
        self.rest = rest;
        Ok(*head)
    }

    fn u32(&mut self) -> Result<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn until_zero(&mut self) -> Result<&'a [u8]> {
        let end = self.rest.iter().position(|&b| b == 0).ok_or_else(|| self.truncated())?;
        let text = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        Ok(text)
    }

    fn skip(&mut self, count: u64, bytes_each: u64, what: &str) -> Result<()> {
        match count.checked_mul(bytes_each) {
            Some(bytes) if bytes <= self.rest.len() as u64 => {
                self.rest = &self.rest[bytes as usize..];
                Ok(())
            }
            _ => {
                let field = format!("{} record {} of {}", self.kind, self.record, self.count);
                let reason = format!("{count} {what}, but {} bytes follow", self.rest.len());
                Err(Error::format(self.path, field, reason))
            }
        }
    }

    /// Returns an error if bytes follow: a count that is too small would silently lose records.
    fn end(&self) -> Result<()> {
        if self.rest.is_empty() {
            return Ok(());
        }
        let reason = format!("{} bytes after the last {}; allowed: none", self.rest.len(), self.kind);
        Err(Error::format(self.path, "count", reason))
    }
}
