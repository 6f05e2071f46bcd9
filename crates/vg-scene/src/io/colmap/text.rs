//! `cameras.txt`, `images.txt`, `points3D.txt`: lines of words, `#` begins a comment line.

use super::model::{ModelCamera, ModelImage, SparsePoints, model_from_name};
use std::collections::HashMap;
use std::path::Path;
use std::str::FromStr;
use vg_geometry::{Error, Result};

/// Cameras by id; `path` is for messages only.
pub fn cameras_from_text(bytes: &[u8], path: &Path) -> Result<HashMap<u32, ModelCamera>> {
    let mut cameras = HashMap::new();
    for line in Line::all(bytes, path).filter(Line::is_record) {
        let mut words = line.words()?;
        let id = words.number("CAMERA_ID")?;
        let model = model_from_name(words.word("MODEL")?, id, path)?;
        let size = (words.number("WIDTH")?, words.number("HEIGHT")?);
        let mut params = Vec::new();
        while !words.is_empty() && params.len() <= model.parameter_count() {
            params.push(words.number("PARAMS")?);
        }
        if cameras.insert(id, ModelCamera::new(id, model, size, params, path)?).is_some() {
            return Err(Error::format(path, format!("camera {id}.id"), "used twice; allowed: once"));
        }
    }
    Ok(cameras)
}

/// Posed images; the second line of each, its features, is skipped and may be empty.
pub fn images_from_text(bytes: &[u8], path: &Path) -> Result<Vec<ModelImage>> {
    let mut images = Vec::new();
    let mut lines = Line::all(bytes, path);
    while let Some(line) = lines.next() {
        if !line.is_record() {
            continue;
        }
        let mut words = line.words()?;
        let id = words.number("IMAGE_ID")?;
        let mut pose = [0.0; 7];
        for (value, name) in pose.iter_mut().zip(["QW", "QX", "QY", "QZ", "TX", "TY", "TZ"]) {
            *value = words.number(name)?;
        }
        let camera_id = words.number("CAMERA_ID")?;
        // Names may hold spaces.
        let name = words.rest;
        let [qw, qx, qy, qz, tx, ty, tz] = pose;
        let image = ModelImage::new(id, [qw, qx, qy, qz], [tx, ty, tz], camera_id, name.as_bytes(), path)?;
        images.push(image);
        if let Some(features) = lines.next() {
            features.check_features()?;
        }
    }
    Ok(images)
}

/// Sparse points; their tracks are skipped.
pub fn points_from_text(bytes: &[u8], path: &Path) -> Result<SparsePoints> {
    let mut points = SparsePoints::default();
    for line in Line::all(bytes, path).filter(Line::is_record) {
        let mut words = line.words()?;
        let id = words.number("POINT3D_ID")?;
        let position = [words.number("X")?, words.number("Y")?, words.number("Z")?];
        let color = [words.number("R")?, words.number("G")?, words.number("B")?];
        points.push(id, position, color, path)?;
    }
    Ok(points)
}

/// A line with its number, starting at 1.
struct Line<'a> {
    bytes: &'a [u8],
    number: usize,
    path: &'a Path,
}

impl<'a> Line<'a> {
    fn all(bytes: &'a [u8], path: &'a Path) -> impl Iterator<Item = Self> {
        let lines = bytes.split(|&b| b == b'\n').enumerate();
        lines.map(move |(i, line)| Self { bytes: line.trim_ascii(), number: i + 1, path })
    }

    /// Whether the line is neither empty nor a comment.
    fn is_record(&self) -> bool {
        !self.bytes.is_empty() && self.bytes[0] != b'#'
    }

    fn words(&self) -> Result<Words<'a>> {
        let rest = std::str::from_utf8(self.bytes).map_err(|_| self.error("not UTF-8; allowed: UTF-8"))?;
        Ok(Words { rest, number: self.number, path: self.path })
    }

    /// Returns an error unless the line holds features, triples of X Y POINT3D_ID. In a model whose empty lines were
    /// removed it is the next image, which would be lost.
    fn check_features(&self) -> Result<()> {
        let mut words = self.words()?.rest.split_ascii_whitespace();
        while let Some(x) = words.next() {
            let is_feature = x.parse::<f64>().is_ok()
                && words.next().is_some_and(|y| y.parse::<f64>().is_ok())
                && words.next().is_some_and(|id| id.parse::<i128>().is_ok());
            if !is_feature {
                let reason = "not POINTS2D as triples X Y POINT3D_ID; allowed: those, or an empty line";
                return Err(self.error(reason));
            }
        }
        Ok(())
    }

    fn error(&self, reason: &str) -> Error {
        Error::format(self.path, format!("line {}", self.number), reason)
    }
}

/// The unread words of a line.
struct Words<'a> {
    rest: &'a str,
    number: usize,
    path: &'a Path,
}

impl<'a> Words<'a> {
    fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    fn word(&mut self, name: &str) -> Result<&'a str> {
        let end = self.rest.find(|c: char| c.is_ascii_whitespace()).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest.trim_ascii_start();
        if word.is_empty() {
            return Err(Error::format(self.path, format!("line {}.{name}", self.number), "missing"));
        }
        Ok(word)
    }

    fn number<T: FromStr>(&mut self, name: &str) -> Result<T> {
        let word = self.word(name)?;
        word.parse().map_err(|_| {
            let kind = std::any::type_name::<T>();
            let reason = format!("{word:?}; allowed: a number ({kind})");
            Error::format(self.path, format!("line {}.{name}", self.number), reason)
        })
    }
}
