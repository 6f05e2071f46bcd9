//! OpenEXR, as far as a depth map needs it: one flat layer with a channel named Z, depth, Y or R.

use super::depth::checked_size;
use crate::error::{Error, Result};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
use std::io::Cursor;
use std::path::Path;

/// Channel names that hold depth, best first.
const CHANNELS: [&str; 6] = ["Z", "depth", "depth.Z", "Depth.Z", "Y", "R"];

/// Most bytes of all channels together: beside depth, a renderer's file may hold colour and normals.
const MAX_DECODED: u64 = 2 << 30;

/// Width, height and values in row order.
pub(super) fn decode(bytes: &[u8], path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    let failed = |e: exr::error::Error| Error::format(path, "exr", e.to_string());
    // The header first: its numbers are checked before anything is allocated by them.
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?;
    let mut decoded = 0u64;
    for header in &meta.headers {
        let size = header.layer_size;
        checked_size(path, size.width() as u64, size.height() as u64)?;
        decoded += size.area() as u64 * 4 * header.channels.list.len() as u64;
    }
    if decoded > MAX_DECODED {
        return Err(Error::format(path, "channels", format!("{decoded} bytes; allowed: {MAX_DECODED}")));
    }

    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(failed)?;
    let layer = image.layer_data;
    let (width, height) = checked_size(path, layer.size.width() as u64, layer.size.height() as u64)?;
    let list = &layer.channel_data.list;
    let find = |name: &&str| list.iter().find(|channel| channel.name.eq_case_insensitive(name));
    let Some(channel) = CHANNELS.iter().find_map(find) else {
        let names: Vec<String> = list.iter().take(8).map(|c| c.name.to_string()).collect();
        let reason = format!("{names:?}; allowed: one named Z, depth, Y or R");
        return Err(Error::format(path, "channels", reason));
    };
    let values: Vec<f32> = match &channel.sample_data {
        FlatSamples::F16(v) => v.iter().map(|v| v.to_f32()).collect(),
        FlatSamples::F32(v) => v.clone(),
        FlatSamples::U32(v) => v.iter().map(|&v| v as f32).collect(),
    };
    if values.len() != width as usize * height as usize {
        let reason = format!("{} samples for {width}x{height}; allowed: one a pixel", values.len());
        return Err(Error::format(path, "channels", reason));
    }
    Ok((width, height, values))
}
