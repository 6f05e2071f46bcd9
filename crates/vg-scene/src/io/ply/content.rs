//! Content of a PLY file of unknown kind: Gaussians, Gaussians of an unsupported kind, or points.

use super::gaussians::{self, Layout, PlyNotes};
use super::header::{self, Header};
use super::points::{self, ColoredPoints};
use super::rows;
use super::variant::{Variant, holds_splats};
use crate::io::stream;
use std::io::BufRead;
use std::path::Path;
use vg_geometry::Result;
use vg_splat::Gaussians;

/// Content of a PLY file.
#[derive(Clone, Debug)]
pub enum Content {
    /// Gaussians that can be rendered.
    Gaussians(Gaussians, PlyNotes),
    /// Gaussians that [`read`](super::read) refuses.
    Others(OtherGaussians),
    /// Points, which have no properties of Gaussians.
    Points(ColoredPoints),
}

/// Gaussians of an unsupported kind.
#[derive(Clone, Debug)]
pub struct OtherGaussians {
    /// The number of Gaussians.
    pub count: usize,
    /// Name of the kind.
    pub kind: String,
    /// Reason why [`read`](super::read) refuses them, with the way out.
    pub why: String,
    /// Lowest and highest centre, if there are positions; numbers that are not finite are ignored.
    pub bounds: Option<([f32; 3], [f32; 3])>,
}

/// Reads a PLY file of any content in one pass; the file may be a pipe.
pub fn read_content(path: &Path) -> Result<Content> {
    let stream = stream::open(path)?;
    content(stream.input, stream.length, path)
}

/// Reads the content of an open source.
pub(in crate::io) fn content(input: impl BufRead, length: Option<u64>, path: &Path) -> Result<Content> {
    let (header, input) = header::open(input, length, path)?;
    match Layout::from_header(&header, path) {
        Ok(layout) => {
            gaussians::read_rows(input, &header, &layout, path).map(|(g, n)| Content::Gaussians(g, n))
        }
        Err(error) if holds_splats(&header) => Ok(Content::Others(OtherGaussians {
            count: header.vertices,
            kind: Variant::from_header(&header)
                .map_or_else(|| "Gaussians that lack a property".into(), Variant::kind),
            why: error.to_string(),
            bounds: bounds(input, &header, path)?,
        })),
        Err(_) => points::read_rows(input, &header, path).map(Content::Points),
    }
}

fn bounds(input: impl BufRead, header: &Header, path: &Path) -> Result<Option<([f32; 3], [f32; 3])>> {
    let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|name| header.find(name)) else { return Ok(None) };
    let mut bounds: Option<([f32; 3], [f32; 3])> = None;
    rows::for_each(input, header, path, |_, row| {
        let place = [x, y, z].map(|property| rows::value(row, property) as f32);
        if place.iter().all(|v| v.is_finite()) {
            let (low, high) = bounds.unwrap_or((place, place));
            let least = std::array::from_fn(|k| low[k].min(place[k]));
            bounds = Some((least, std::array::from_fn(|k| high[k].max(place[k]))));
        }
        Ok(())
    })?;
    Ok(bounds)
}
