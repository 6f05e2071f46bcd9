//! Masks from files, if their meaning is unambiguous.
//!
//! - Pictures with transparent pixels: a cut-out, whose alpha is the mask.
//! - Two colours, one of them black: the other is vehicle, whatever it is (1 of 0 and 1, a palette's colour, 16 bits).
//! - Grey: [`VEHICLE_THRESHOLD`] and above is vehicle.
//! - NumPy arrays: true, 1 of 0 and 1, or the threshold and above.
//!
//! Everything else is an error: grey that stays below the threshold (class numbers), and more colours.

use super::files::in_file;
use super::image::{Wanted, decode_any, transparency};
use super::npy;
use crate::Mask;
use crate::mask::VEHICLE_THRESHOLD;
use image::DynamicImage;
use std::path::Path;
use vg_geometry::{Error, Result};

/// Difference of channels from which a colour is not grey; JPEG compression causes smaller ones.
const GREY_SPREAD: u8 = 16;

/// Decodes the mask in a PNG, a JPEG or a NumPy file; `path` is for messages only.
pub(super) fn decode(bytes: &[u8], path: &Path, wanted: Option<Wanted>) -> Result<Mask> {
    if npy::is_npy(bytes) {
        let (width, height, values) = npy::decode_mask(bytes, path)?;
        if let Some(wanted) = wanted {
            wanted.check_size(path, (width, height))?;
        }
        return mask(path, width, height, &values);
    }
    let decoded = decode_any(bytes, path, wanted)?;
    let (width, height) = (decoded.width(), decoded.height());
    match transparency(&decoded) {
        Some(alpha) => mask(path, width, height, &alpha),
        None => mask(path, width, height, &brightness(decoded, path)?),
    }
}

fn mask(path: &Path, width: u32, height: u32, values: &[u8]) -> Result<Mask> {
    Mask::from_strided("mask", values, width, height, width as usize).map_err(|e| in_file(path, e))
}

/// 0 for black and 255 for the other of two colours; else luminance.
fn brightness(decoded: DynamicImage, path: &Path) -> Result<Vec<u8>> {
    let decoded = match decoded {
        opaque @ DynamicImage::ImageLumaA8(_) => DynamicImage::ImageLuma8(opaque.into_luma8()),
        opaque @ DynamicImage::ImageLumaA16(_) => DynamicImage::ImageLuma16(opaque.into_luma16()),
        opaque @ DynamicImage::ImageRgba8(_) => DynamicImage::ImageRgb8(opaque.into_rgb8()),
        opaque @ DynamicImage::ImageRgba16(_) => DynamicImage::ImageRgb16(opaque.into_rgb16()),
        other => other,
    };
    let two = match &decoded {
        DynamicImage::ImageLuma8(p) => only_color_besides_black(p.as_chunks::<1>().0),
        DynamicImage::ImageLuma16(p) => only_color_besides_black(p.as_chunks::<1>().0),
        DynamicImage::ImageRgb8(p) => only_color_besides_black(p.as_chunks::<3>().0),
        DynamicImage::ImageRgb16(p) => only_color_besides_black(p.as_chunks::<3>().0),
        _ => None,
    };
    if let Some(values) = two {
        return Ok(values);
    }
    if decoded.color().has_color() {
        let colours = decoded.to_rgb8();
        let spread = |p: &[u8; 3]| p.iter().max().unwrap_or(&0) - p.iter().min().unwrap_or(&0);
        if let Some(colour) = colours.as_chunks::<3>().0.iter().find(|p| spread(p) >= GREY_SPREAD) {
            let reason = format!(
                "colours such as {colour:?}; allowed: grey, where {VEHICLE_THRESHOLD} and above is vehicle, or two colours, one of them black and the other vehicle"
            );
            return Err(Error::format(path, "mask", reason));
        }
    }
    Ok(decoded.into_luma8().into_raw())
}

/// 255 for pixels of the only colour other than black, 0 for black ones; `None` if there are more colours, or no black.
fn only_color_besides_black<T: Copy + Default + PartialEq, const N: usize>(
    pixels: &[[T; N]],
) -> Option<Vec<u8>> {
    let black = [T::default(); N];
    let other = *pixels.iter().find(|p| **p != black)?;
    let mut has_black = false;
    let values = pixels.iter().map(|p| {
        has_black |= *p == black;
        if *p == black { Some(0) } else { (*p == other).then_some(u8::MAX) }
    });
    let values = values.collect::<Option<Vec<u8>>>()?;
    has_black.then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, ImageFormat, Luma, Pixel, Rgb};
    use std::io::Cursor;

    /// The number of vehicle pixels of a mask of two rows of four that is written as a PNG, or the error.
    fn read<P: Pixel>(pixels: [P; 8]) -> std::result::Result<usize, String>
    where
        DynamicImage: From<ImageBuffer<P, Vec<P::Subpixel>>>,
    {
        let picture = ImageBuffer::from_fn(4, 2, |u, v| pixels[(4 * v + u) as usize]);
        let mut png = Cursor::new(Vec::new());
        DynamicImage::from(picture).write_to(&mut png, ImageFormat::Png).unwrap();
        let mask = decode(png.get_ref(), Path::new("m.png"), None).map_err(|e| e.to_string())?;
        Ok(mask.vehicle_pixels())
    }

    fn grey(values: [u8; 8]) -> std::result::Result<usize, String> {
        read(values.map(|v| Luma([v])))
    }

    fn deep(values: [u16; 8]) -> std::result::Result<usize, String> {
        read(values.map(|v| Luma([v])))
    }

    fn colour(values: [[u8; 3]; 8]) -> std::result::Result<usize, String> {
        read(values.map(Rgb))
    }

    #[test]
    fn two_values_are_background_and_vehicle_whatever_they_are() {
        const RED: [u8; 3] = [128, 0, 0];
        for v in [1, 2, 38, 127, 128, 255] {
            assert_eq!(grey([0, v, v, 0, 0, 0, 0, v]), Ok(3), "{v}");
        }
        for v in [1, 255, 256, u16::MAX] {
            assert_eq!(deep([0, v, v, 0, 0, 0, 0, v]), Ok(3), "{v}");
        }
        assert_eq!(colour([[0; 3], RED, RED, [0; 3], [0; 3], [0; 3], [0; 3], RED]), Ok(3));
    }

    #[test]
    fn several_greys_are_split_at_the_threshold_and_a_single_one_is_allowed() {
        assert_eq!(grey([0, 10, 127, 128, 129, 200, 254, 255]), Ok(5));
        assert_eq!(grey([50, 50, 50, 50, 200, 200, 200, 200]), Ok(4));
        assert_eq!(deep([0, 1, 300, 25_000, 40_000, 60_000, 65_534, 65_535]), Ok(4));
        // JPEG compression tints grey.
        assert_eq!(
            colour([[0; 3], [3, 0, 5], [250, 255, 249], [255; 3], [0; 3], [0; 3], [0; 3], [1; 3]]),
            Ok(2)
        );
        for (value, pixels) in [(0, 0), (1, 8), (128, 8), (255, 8)] {
            assert_eq!(grey([value; 8]), Ok(pixels), "{value}");
        }
    }

    #[test]
    fn ambiguous_masks_are_refused_with_the_allowed_formats() {
        let classes = grey([0, 1, 2, 3, 0, 0, 0, 0]).unwrap_err();
        assert!(classes.starts_with("m.png: mask: largest value 3; allowed: 0 and 255"), "{classes}");
        assert!(grey([38; 8]).is_err());
        let (red, white, blue) = ([200, 0, 0], [255; 3], [0, 0, 200]);
        for colours in [[red, white], [red, blue]] {
            let [a, b] = colours;
            let error = colour([a, a, b, b, a, a, b, b]).unwrap_err();
            assert!(error.contains("m.png: mask: colours") && error.contains("black"), "{error}");
        }
        assert!(colour([[0; 3], red, blue, red, [0; 3], red, blue, red]).is_err());
    }
}
