//! Pictures and masks from PNG and JPEG files, and PNG output.

use super::files::{in_file, open_regular, read_limited, write_atomically};
use super::mask;
use crate::mask::VEHICLE_THRESHOLD;
use crate::{Mask, RgbImage};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::metadata::Orientation;
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader};
use std::io::{BufReader, Cursor};
use std::path::Path;
use vg_geometry::camera::MAX_SIDE;
use vg_geometry::{Error, Result};

/// Longest picture file that is read. The largest picture, 8192 x 8192 at 16 bits and 4 channels, holds this
/// many bytes uncompressed.
const MAX_FILE: u64 = 512 << 20;

/// A picture with its alpha channel, if it has one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Colour as stored, also of transparent pixels.
    pub image: RgbImage,
    /// Alpha in row order, `[height * width]`. `None` also if every pixel is opaque: such alpha is no mask.
    pub alpha: Option<Vec<u8>>,
}

/// The expected size and pixel order of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted {
    /// Required width and height.
    pub(crate) size: (u32, u32),
    /// Source of that size, for messages.
    pub(crate) whose: &'static str,
    /// Pixel order of the camera if EXIF rotates the picture.
    pub(crate) exif: ExifPixels,
}

/// The pixel order in which the camera of a picture with an EXIF orientation is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExifPixels {
    /// As stored, like COLMAP, unless only the rotated picture has the size.
    Stored,
    /// As stored or rotated (like OpenCV), whichever has the size; an error if both have.
    BySize,
}

impl Wanted {
    /// Checks the size of a picture without an EXIF orientation.
    pub(crate) fn check_size(&self, path: &Path, found: (u32, u32)) -> Result<()> {
        turn(path, found, Orientation::NoTransforms, Some(*self)).map(|_| ())
    }
}

/// Reads a PNG or JPEG picture. One with an EXIF orientation is refused: the camera's pixel order is unknown.
pub fn read(path: &Path) -> Result<Picture> {
    decode(&read_limited(path, MAX_FILE)?, path)
}

/// Decodes a picture from bytes, as [`read`]; `path` is for messages only.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Picture> {
    picture(decode_any(bytes, path, None)?)
}

/// Reads the picture in a file; its size is checked in the header before a pixel is decoded.
pub(crate) fn read_wanted(path: &Path, wanted: Wanted) -> Result<Picture> {
    picture(decode_any(&read_limited(path, MAX_FILE)?, path, Some(wanted))?)
}

fn picture(decoded: DynamicImage) -> Result<Picture> {
    let alpha = transparency(&decoded);
    let rgb = decoded.into_rgb8();
    let (width, height) = rgb.dimensions();
    Ok(Picture { image: RgbImage::from_owner("image", width, height, rgb.into_raw())?, alpha })
}

/// Reads the mask in a PNG, JPEG or NumPy file; docs/SCENES.md defines which pixels are vehicle.
pub fn read_mask(path: &Path) -> Result<Mask> {
    mask::decode(&read_limited(path, MAX_FILE)?, path, None)
}

/// [`read_mask`] with a check of the size.
pub(crate) fn read_mask_wanted(path: &Path, wanted: Wanted) -> Result<Mask> {
    mask::decode(&read_limited(path, MAX_FILE)?, path, Some(wanted))
}

/// A mask from the alpha of the picture in `path`.
pub(crate) fn mask_from_alpha(path: &Path, width: u32, height: u32, alpha: &[u8]) -> Result<Mask> {
    Mask::from_strided("alpha", alpha, width, height, width as usize).map_err(|e| in_file(path, e))
}

/// Width and height of a picture, from the header alone.
pub fn size(path: &Path) -> Result<(u32, u32)> {
    let reader = ImageReader::new(BufReader::new(open_regular(path)?));
    let reader = reader.with_guessed_format().map_err(|e| Error::io(path, e))?;
    let mut decoder = reader.into_decoder().map_err(|e| image_error(path, e))?;
    let size = decoder.dimensions();
    check_size(path, size)?;
    turn(path, size, exif_orientation(&mut decoder), None)?;
    Ok(size)
}

/// Decodes the size and 16-bit grey values in row order.
pub(crate) fn decode_gray16(
    bytes: &[u8],
    path: &Path,
    wanted: Option<Wanted>,
) -> Result<(u32, u32, Vec<u16>)> {
    match decode_any(bytes, path, wanted)? {
        DynamicImage::ImageLuma16(gray) => Ok((gray.width(), gray.height(), gray.into_raw())),
        other => Err(Error::format(
            path,
            "pixels",
            format!("{:?}; allowed: 16-bit grey (one channel)", other.color()),
        )),
    }
}

/// Decodes a PNG or a JPEG, rotated by its EXIF orientation if `wanted` requires it.
pub(super) fn decode_any(bytes: &[u8], path: &Path, wanted: Option<Wanted>) -> Result<DynamicImage> {
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
    let mut decoder = reader.into_decoder().map_err(|e| image_error(path, e))?;
    let size = decoder.dimensions();
    check_size(path, size)?;
    let turn = turn(path, size, exif_orientation(&mut decoder), wanted)?;
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(|e| image_error(path, e))?;
    decoded.apply_orientation(turn);
    Ok(decoded)
}

/// The EXIF orientation of a file; a tag that cannot be read counts as none.
fn exif_orientation(decoder: &mut impl ImageDecoder) -> Orientation {
    decoder.orientation().unwrap_or(Orientation::NoTransforms)
}

/// The rotation that takes the stored pixels, of size `stored`, to the wanted ones.
fn turn(path: &Path, stored: (u32, u32), exif: Orientation, wanted: Option<Wanted>) -> Result<Orientation> {
    use Orientation::{NoTransforms, Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    let swaps_sides = matches!(exif, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH);
    let shown = if swaps_sides { (stored.1, stored.0) } else { stored };
    let unclear = || {
        let reason = format!(
            "{}, and the camera may refer to the pixels as stored (as COLMAP reads them) or as shown (as OpenCV does); allowed: 1. If it refers to the pixels as stored, drop the tag (exiftool -Orientation= FILE); if to the pixels as shown, rotate the pixels (mogrify -auto-orient FILE)",
            exif.to_exif()
        );
        Err(Error::format(path, "EXIF orientation", reason))
    };
    let Some(Wanted { size, whose, exif: pixels }) = wanted else {
        return if exif == NoTransforms { Ok(exif) } else { unclear() };
    };
    match (stored == size, shown == size) {
        (true, _) if exif == NoTransforms || pixels == ExifPixels::Stored => Ok(NoTransforms),
        (true, true) => unclear(),
        (true, false) => Ok(NoTransforms),
        (false, true) => Ok(exif),
        (false, false) => {
            let turned = match exif {
                NoTransforms => String::new(),
                _ => format!(" (EXIF orientation {})", exif.to_exif()),
            };
            let reason = format!("{}x{}{turned}, but {whose} is {}x{}", stored.0, stored.1, size.0, size.1);
            Err(Error::format(path, "size", reason))
        }
    }
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
        other => Error::format(path, "picture", format!("{other}; allowed: a complete PNG or JPEG")),
    }
}

/// Returns an error if a JPEG is truncated: the decoder silently fills the missing part with grey. An end-of-image
/// marker cannot occur inside coded data, so one after the first scan's start means that the file is complete.
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
            // Other bytes between the segments are left to the decoder.
            Some(&[other, ..]) if other != 0xff => break,
            _ => {
                let reason = "ends before its end-of-image marker; allowed: a complete JPEG";
                return Err(Error::format(path, "picture", reason));
            }
        }
    }
    Ok(())
}

/// Alpha in row order, if any pixel is transparent.
pub(super) fn transparency(decoded: &DynamicImage) -> Option<Vec<u8>> {
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

/// Writes an RGB picture as an 8-bit PNG; an existing file is replaced once the new one is complete.
pub fn write_rgb8(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<()> {
    write_png(path, width, height, pixels.as_flattened(), ExtendedColorType::Rgb8)
}

/// Writes an RGBA picture with straight alpha as an 8-bit PNG.
pub fn write_rgba8(path: &Path, width: u32, height: u32, pixels: &[[u8; 4]]) -> Result<()> {
    write_png(path, width, height, pixels.as_flattened(), ExtendedColorType::Rgba8)
}

/// Writes a mask as an 8-bit grey PNG: 255 for vehicle pixels, 0 for all others (also unknown).
pub fn write_mask(path: &Path, mask: &Mask) -> Result<()> {
    let value = |l: &crate::mask::Label| {
        if *l as u8 >= VEHICLE_THRESHOLD { u8::MAX } else { 0 }
    };
    let values: Vec<u8> = mask.labels().iter().map(value).collect();
    write_png(path, mask.width(), mask.height(), &values, ExtendedColorType::L8)
}

/// Writes depth in metres as a 16-bit PNG of millimetres, 0 = none. Returns the number of measured pixels beyond the
/// limit of 65.535 m, which are written as none; a measurement below 1 mm becomes 1 mm, so that it remains one.
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
    fn a_16_bit_grey_picture_reads_as_8_bit_colour() {
        let mut bytes = Cursor::new(Vec::new());
        let deep = image::ImageBuffer::from_fn(3, 2, |u, _| image::Luma([u as u16 * 257 * 100]));
        DynamicImage::ImageLuma16(deep).write_to(&mut bytes, ImageFormat::Png).unwrap();
        let decoded = decode(bytes.get_ref(), Path::new("a.png")).unwrap();
        assert_eq!(decoded.image.pixels()[..3], [[0; 3], [100; 3], [200; 3]]);
    }

    /// A JPEG with this EXIF orientation.
    fn turned(width: u32, height: u32, orientation: u8) -> Vec<u8> {
        let mut jpeg = Cursor::new(Vec::new());
        let bright_top = |_, v| image::Luma([if v < height / 2 { 250 } else { 5 }]);
        image::GrayImage::from_fn(width, height, bright_top).write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
        // One entry of a little-endian TIFF: tag 0x112, one SHORT.
        let entry = [1, 0, 0x12, 1, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0, 0, 0, 0, 0];
        let exif = [&b"Exif\0\0II*\0\x08\0\0\0"[..], &entry].concat();
        let length = (exif.len() as u16 + 2).to_be_bytes();
        let jpeg = jpeg.into_inner();
        [&jpeg[..2], &[0xff, 0xe1], &length, &exif, &jpeg[2..]].concat()
    }

    #[test]
    fn exif_rotates_a_picture_if_the_camera_s_size_requires_it_and_is_refused_if_ambiguous() {
        let path = Path::new("a.jpg");
        let read = |width, height, orientation, size, exif| {
            let wanted = Wanted { size, whose: "its camera", exif };
            decode_any(&turned(width, height, orientation), path, Some(wanted)).map(DynamicImage::into_luma8)
        };
        use ExifPixels::{BySize, Stored};
        let upright = read(16, 8, 1, (16, 8), BySize).unwrap();
        assert!(upright.get_pixel(8, 1)[0] > 200 && upright.get_pixel(8, 6)[0] < 50);
        for exif in [BySize, Stored] {
            // The sides are swapped: the size decides.
            assert_eq!(read(16, 8, 6, (16, 8), exif).unwrap(), upright);
            let shown = read(16, 8, 6, (8, 16), exif).unwrap();
            assert!(shown.get_pixel(6, 8)[0] > 200 && shown.get_pixel(1, 8)[0] < 50, "{exif:?}");
            let error = read(16, 8, 6, (9, 16), exif).unwrap_err().to_string();
            assert!(error.contains("size: 16x8 (EXIF orientation 6), but its camera is 9x16"), "{error}");
        }
        // The sides are not swapped: only COLMAP's convention is unambiguous.
        for (width, orientation) in [(16, 2), (16, 3), (16, 4), (8, 6), (8, 8)] {
            let error = read(width, 8, orientation, (width, 8), BySize).unwrap_err().to_string();
            assert!(error.contains(&format!("a.jpg: EXIF orientation: {orientation}")), "{error}");
            assert!(read(width, 8, orientation, (width, 8), Stored).is_ok());
            assert!(decode(&turned(width, 8, orientation), path).is_err());
        }
    }
}
