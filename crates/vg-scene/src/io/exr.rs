//! OpenEXR depth maps: one flat layer with a channel named Z, depth, Y, V or R.

use super::depth::checked_size;
use super::image::Wanted;
use exr::meta::MetaData;
use exr::meta::attribute::Text;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel};
use std::io::Cursor;
use std::path::Path;
use vg_geometry::{Error, Result};

/// Maximum size of an unpacked block, bytes, all channels together: 128 float channels of 8192 columns in the 16 rows
/// that ZIP packs together. A block is decoded entirely, in a few copies, whichever of its channels is needed.
const MAX_BLOCK: usize = 64 << 20;

/// Decodes width, height and values in row order. Other channels are decoded and dropped, block by block.
pub(super) fn decode(bytes: &[u8], path: &Path, wanted: Option<Wanted>) -> Result<(u32, u32, Vec<f32>)> {
    let failed = |e: exr::error::Error| Error::format(path, "exr", format!("{e}; allowed: a complete file"));
    // The header is checked before memory is allocated for the sizes in it.
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?;
    for header in &meta.headers {
        let size = checked_size(path, header.layer_size.width() as u64, header.layer_size.height() as u64)?;
        if let Some(wanted) = wanted.filter(|_| meta.headers.len() == 1) {
            wanted.check_size(path, size)?;
        }
        let pixels = header.max_block_pixel_size();
        let block = pixels.area().checked_mul(header.channels.bytes_per_pixel);
        if block.is_none_or(|bytes| bytes > MAX_BLOCK) {
            let reason = format!(
                "{} in blocks of {}x{}, more than {} MiB each; allowed: fewer channels or rows in a block",
                header.channels.list.len(),
                pixels.width(),
                pixels.height(),
                MAX_BLOCK >> 20
            );
            return Err(Error::format(path, "channels", reason));
        }
    }
    let channel = depth_channel(&meta, path)?;

    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required(channel)
        .collect_pixels(
            |size, _| (size.width(), vec![0.0; size.area()]),
            |(width, values): &mut (usize, Vec<f32>), at, (value,): (f32,)| {
                if let Some(slot) = values.get_mut(at.y() * *width + at.x()) {
                    *slot = value;
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(failed)?;
    let layer = image.layer_data;
    let (width, height) = checked_size(path, layer.size.width() as u64, layer.size.height() as u64)?;
    Ok((width, height, layer.channel_data.pixels.1))
}

/// The channel named as depth, or else as luminance or red.
fn depth_channel(meta: &MetaData, path: &Path) -> Result<Text> {
    let names = || meta.headers.iter().flat_map(|h| &h.channels.list).map(|channel| &channel.name);
    for wanted in ["z", "depth", "y", "v", "r"] {
        // Renderers prefix the layer: `ViewLayer.Depth.Z`.
        let matches = |name: &&Text| {
            let name = name.to_string().to_ascii_lowercase();
            name == wanted || (name.ends_with(&format!(".{wanted}")) && ["z", "depth"].contains(&wanted))
        };
        if let Some(name) = names().find(matches) {
            return Ok(name.clone());
        }
    }
    let found: Vec<String> = names().take(8).map(ToString::to_string).collect();
    Err(Error::format(path, "channels", format!("{found:?}; allowed: one named Z, depth, Y, V or R")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::*;

    fn file(channels: Vec<AnyChannel<FlatSamples>>, compression: Compression) -> Vec<u8> {
        let encoding = Encoding { compression, ..Encoding::default() };
        let channels = AnyChannels::sort(channels.into());
        let layer = Layer::new((3, 2), LayerAttributes::default(), encoding, channels);
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn the_depth_channel_is_found_among_others_in_any_number_format_and_compression() {
        let values = [1.0f32, 2.0, 3.0, 4.0, 5.5, 0.0];
        let halves = values.map(f16::from_f32).to_vec();
        let z = || AnyChannel::new("ViewLayer.Depth.Z", FlatSamples::F32(values.to_vec()));
        let r = || AnyChannel::new("R", FlatSamples::F16(vec![f16::ONE; 6]));
        let y = AnyChannel::new("Y", FlatSamples::F16(halves));
        for compression in [Compression::Uncompressed, Compression::RLE, Compression::ZIP16] {
            for channels in [vec![z()], vec![r(), z()], vec![y.clone(), r()]] {
                let found = decode(&file(channels, compression), Path::new("d.exr"), None).unwrap();
                assert_eq!(found, (3, 2, values.to_vec()));
            }
        }
        let strange = AnyChannel::new("id", FlatSamples::U32(vec![7; 6]));
        let error = decode(&file(vec![strange], Compression::RLE), Path::new("d.exr"), None).unwrap_err();
        assert!(error.to_string().contains("d.exr: channels: [\"id\"]"), "{error}");
    }

    #[test]
    fn channels_whose_blocks_would_fill_the_memory_are_refused_by_the_header() {
        // 8192 columns in blocks of 16 rows take 512 kB per channel. For the header, one row is enough.
        let wide = |channels: usize| {
            let samples = || FlatSamples::F32(vec![1.0; 8192]);
            let channel = |i: usize| AnyChannel::new(format!("c{i:04}").as_str(), samples());
            let list = std::iter::once(AnyChannel::new("Z", samples())).chain((1..channels).map(channel));
            let encoding = Encoding {
                compression: Compression::ZIP16,
                blocks: Blocks::ScanLines,
                line_order: LineOrder::Increasing,
            };
            let channels = AnyChannels::sort(list.collect());
            let layer = Layer::new((8192, 1), LayerAttributes::default(), encoding, channels);
            let mut bytes = Cursor::new(Vec::new());
            Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
            decode(bytes.get_ref(), Path::new("d.exr"), None)
        };
        assert!(wide(128).unwrap().2 == [1.0; 8192]);
        let error = wide(129).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("d.exr: channels: 129 in blocks of 8192x16, more than 64 MiB"), "{error}");
    }
}
