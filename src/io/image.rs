//! Pictures and masks from PNG and JPEG files, and PNG files of what was rendered.

use super::files::{read_limited, write_atomically};
use super::npy;
use crate::error::{Error, Result};
use crate::geometry::camera::MAX_SIDE;
use crate::scene::mask::VEHICLE_THRESHOLD;
use crate::scene::{Mask, RgbImage};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader};
use std::io::Cursor;
use std::path::Path;

/// Longest picture file that is read. The largest picture, 8192 x 8192 at 16 bits and 4 channels, holds this
/// many bytes uncompressed.
const MAX_FILE: u64 = 512 << 20;

/// A picture, with its alpha channel where it has one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Colour as stored; transparent pixels keep theirs.
    pub image: RgbImage,
    /// Alpha in row order, `[height * width]`. `None` also where every pixel is opaque: that says nothing.
    pub alpha: Option<Vec<u8>>,
}

/// A PNG or JPEG picture.
pub fn read(path: &Path) -> Result<Picture> {
    decode(&read_limited(path, MAX_FILE)?, path)
}

/// The same from bytes; `path` is for messages only.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Picture> {
    let decoded = decode_any(bytes, path)?;
    let alpha = transparency(&decoded);
    let rgb = decoded.into_rgb8();
    let (width, height) = rgb.dimensions();
    Ok(Picture { image: RgbImage::from_owner("image", width, height, rgb.into_raw())?, alpha })
}

/// A mask: luminance of [`VEHICLE_THRESHOLD`] and above is vehicle. A picture that is transparent somewhere is
/// a cut-out, and counts by its alpha instead. Of a NumPy array, true counts, or [`VEHICLE_THRESHOLD`] and above.
pub fn read_mask(path: &Path) -> Result<Mask> {
    decode_mask(&read_limited(path, MAX_FILE)?, path).map(|(mask, _)| mask)
}

/// The mask and its largest value, which tells a mask of zeros and ones from an empty one.
pub(crate) fn decode_mask(bytes: &[u8], path: &Path) -> Result<(Mask, u8)> {
    let (width, height, values) = if npy::is_npy(bytes) {
        npy::decode_mask(bytes, path)?
    } else {
        let decoded = decode_any(bytes, path)?;
        let (width, height) = (decoded.width(), decoded.height());
        (width, height, transparency(&decoded).unwrap_or_else(|| decoded.into_luma8().into_raw()))
    };
    let largest = values.iter().copied().max().unwrap_or(0);
    Ok((Mask::from_strided("mask", &values, width, height, width as usize)?, largest))
}

pub(crate) fn read_mask_and_largest(path: &Path) -> Result<(Mask, u8)> {
    decode_mask(&read_limited(path, MAX_FILE)?, path)
}

/// A mask from the alpha of a picture.
pub(crate) fn mask_of_alpha(width: u32, height: u32, alpha: &[u8]) -> Result<Mask> {
    Mask::from_strided("alpha", alpha, width, height, width as usize)
}

/// Width and height, from the header alone.
pub fn size(path: &Path) -> Result<(u32, u32)> {
    let reader = ImageReader::open(path).map_err(|e| Error::io(path, e))?;
    let reader = reader.with_guessed_format().map_err(|e| Error::io(path, e))?;
    let size = reader.into_dimensions().map_err(|e| image_error(path, e))?;
    check_size(path, size)?;
    Ok(size)
}

/// 16-bit grey values in row order, and the size.
pub(crate) fn decode_gray16(bytes: &[u8], path: &Path) -> Result<(u32, u32, Vec<u16>)> {
    match decode_any(bytes, path)? {
        DynamicImage::ImageLuma16(gray) => Ok((gray.width(), gray.height(), gray.into_raw())),
        other => Err(Error::format(
            path,
            "pixels",
            format!("{:?}; allowed: 16-bit grey (one channel)", other.color()),
        )),
    }
}

fn decode_any(bytes: &[u8], path: &Path) -> Result<DynamicImage> {
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| Error::io(path, e))?;
    match reader.format() {
        Some(ImageFormat::Png) => {}
        Some(ImageFormat::Jpeg) => jpeg_is_whole(bytes, path)?,
        Some(other) => {
            return Err(Error::format(path, "format", format!("{other:?}; allowed: PNG or JPEG")));
        }
        None => return Err(Error::format(path, "format", "unknown; allowed: PNG or JPEG")),
    }
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_FILE + (64 << 20));
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| image_error(path, e))?;
    check_size(path, decoder.dimensions())?;
    DynamicImage::from_decoder(decoder).map_err(|e| image_error(path, e))
}

fn check_size(path: &Path, (width, height): (u32, u32)) -> Result<()> {
    if (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) {
        return Ok(());
    }
    let reason = format!("{width}x{height}; allowed: 1x1 to {MAX_SIDE}x{MAX_SIDE}");
    Err(Error::format(path, "size", reason))
}

fn image_error(path: &Path, error: image::ImageError) -> Error {
    match error {
        image::ImageError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Error::io(path, e),
        other => Error::format(path, "picture", format!("{other}; allowed: a whole PNG or JPEG")),
    }
}

/// The decoder fills what is missing of a truncated JPEG with grey and says nothing. An end-of-image marker
/// cannot occur inside coded data, so one after the first scan's start means that the file is whole.
fn jpeg_is_whole(bytes: &[u8], path: &Path) -> Result<()> {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    let mut at = 2;
    loop {
        match bytes.get(at..at + 4) {
            Some(&[0xff, 0xff, ..]) => at += 1,
            Some(&[0xff, START_OF_SCAN, ..]) if bytes[at..].windows(2).any(|b| b == END_OF_IMAGE) => break,
            Some(&[0xff, marker, high, low]) if marker != START_OF_SCAN => {
                at += 2 + usize::from(u16::from_be_bytes([high, low]));
            }
            // Something between the segments: the decoder knows better what may be there.
            Some(&[other, ..]) if other != 0xff => break,
            _ => {
                let reason = "ends before its end-of-image marker; allowed: a whole JPEG";
                return Err(Error::format(path, "picture", reason));
            }
        }
    }
    Ok(())
}

fn transparency(decoded: &DynamicImage) -> Option<Vec<u8>> {
    if !decoded.color().has_alpha() {
        return None;
    }
    let alpha: Vec<u8> = match decoded {
        DynamicImage::ImageRgba8(p) => p.pixels().map(|p| p.0[3]).collect(),
        DynamicImage::ImageLumaA8(p) => p.pixels().map(|p| p.0[1]).collect(),
        other => other.to_luma_alpha8().pixels().map(|p| p.0[1]).collect(),
    };
    alpha.iter().any(|&a| a != u8::MAX).then_some(alpha)
}

/// An RGB picture as an 8-bit PNG, replacing what was there only once it is complete.
pub fn write_rgb8(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<()> {
    write_png(path, width, height, pixels.as_flattened(), ExtendedColorType::Rgb8)
}

/// An RGBA picture with straight alpha as an 8-bit PNG.
pub fn write_rgba8(path: &Path, width: u32, height: u32, pixels: &[[u8; 4]]) -> Result<()> {
    write_png(path, width, height, pixels.as_flattened(), ExtendedColorType::Rgba8)
}

/// A mask as an 8-bit grey PNG: 255 where vehicle, 0 elsewhere (unknown too).
pub fn write_mask(path: &Path, mask: &Mask) -> Result<()> {
    let value = |l: &crate::scene::mask::Label| {
        if *l as u8 >= VEHICLE_THRESHOLD { u8::MAX } else { 0 }
    };
    let values: Vec<u8> = mask.labels().iter().map(value).collect();
    write_png(path, mask.width(), mask.height(), &values, ExtendedColorType::L8)
}

/// Depth in metres as a 16-bit PNG of millimetres, 0 = none. Returns how many measured pixels lie beyond the
/// 65.535 m that fit and were written as none; a measurement below 1 mm becomes 1 mm, so that it stays one.
pub fn write_depth16(path: &Path, width: u32, height: u32, depth: &[f32]) -> Result<usize> {
    let mut left_out = 0;
    let mut bytes = Vec::with_capacity(depth.len() * 2);
    for &metres in depth {
        let millimetres = (f64::from(metres) * 1e3).round();
        let stored = if !metres.is_finite() || metres <= 0.0 {
            0
        } else if millimetres > f64::from(u16::MAX) {
            left_out += 1;
            0
        } else {
            (millimetres as u16).max(1)
        };
        bytes.extend_from_slice(&stored.to_ne_bytes());
    }
    write_png(path, width, height, &bytes, ExtendedColorType::L16)?;
    Ok(left_out)
}

fn write_png(path: &Path, width: u32, height: u32, bytes: &[u8], color: ExtendedColorType) -> Result<()> {
    let expected = u64::from(width) * u64::from(height) * u64::from(color.bits_per_pixel() / 8);
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE || bytes.len() as u64 != expected {
        return Err(Error::argument(
            "pixels",
            format!("{} bytes for {width}x{height}", bytes.len()),
            format!("{expected} bytes, size 1x1 to {MAX_SIDE}x{MAX_SIDE}"),
        ));
    }
    write_atomically(path, |out| {
        PngEncoder::new_with_quality(out, CompressionType::Default, FilterType::Adaptive)
            .write_image(bytes, width, height, color)
            .map_err(std::io::Error::other)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jpeg_cut_off_anywhere_is_refused() {
        let mut bytes = Cursor::new(Vec::new());
        let noise =
            |u: u32, v: u32| image::Rgb([(u * 37 % 251) as u8, (v * 91 % 241) as u8, (u * v % 256) as u8]);
        let picture = image::RgbImage::from_fn(64, 48, noise);
        picture.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        let bytes = bytes.into_inner();
        let decoded = decode(&bytes, Path::new("a.jpg")).unwrap();
        assert_eq!((decoded.image.width(), decoded.image.height(), decoded.alpha), (64, 48, None));
        for end in 0..bytes.len() - 1 {
            assert!(decode(&bytes[..end], Path::new("a.jpg")).is_err(), "{end} of {}", bytes.len());
        }
    }

    #[test]
    fn a_16_bit_grey_picture_reads_as_8_bit_colour_and_as_a_mask() {
        let mut bytes = Cursor::new(Vec::new());
        let deep = image::ImageBuffer::from_fn(3, 2, |u, _| image::Luma([u as u16 * 257 * 100]));
        DynamicImage::ImageLuma16(deep).write_to(&mut bytes, ImageFormat::Png).unwrap();
        let decoded = decode(bytes.get_ref(), Path::new("a.png")).unwrap();
        assert_eq!(decoded.image.pixels()[..3], [[0; 3], [100; 3], [200; 3]]);
        let (mask, largest) = decode_mask(bytes.get_ref(), Path::new("a.png")).unwrap();
        assert_eq!((mask.vehicle_pixels(), largest), (2, 200));
    }
}
