//! 8-bit colour pictures, sRGB-encoded as written by cameras, row 0 at the top.

use bytes::Bytes;
use vg_geometry::{Error, Result};

/// Channel order of 8-bit pixels in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFormat {
    /// R, G, B
    Rgb8,
    /// B, G, R (OpenCV)
    Bgr8,
    /// R, G, B, A
    Rgba8,
    /// B, G, R, A
    Bgra8,
    /// One luminance
    Gray8,
}

impl PixelFormat {
    /// Bytes from one pixel to the next.
    pub fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Gray8 => 1,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 => 4,
        }
    }
}

/// An RGB picture, rows without gaps. Clones share the pixels, which are immutable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbImage {
    width: u32,
    height: u32,
    /// `[height * width][3]`
    bytes: Bytes,
}

impl RgbImage {
    /// A picture from pixels in row order; `pixels.len()` must be `width * height`.
    pub fn new(width: u32, height: u32, pixels: Vec<[u8; 3]>) -> Result<Self> {
        check_len("image", width, height, pixels.len())?;
        Ok(Self { width, height, bytes: pixels.into_flattened().into() })
    }

    /// Borrows the pixels in place: R, G, B in row order without gaps, `width * height * 3` bytes. `owner` holds
    /// them and is dropped with the last clone of the picture (on an error, before this returns). Until then its
    /// bytes must not change.
    pub fn from_owner(
        argument: &str,
        width: u32,
        height: u32,
        owner: impl AsRef<[u8]> + Send + 'static,
    ) -> Result<Self> {
        let bytes = Bytes::from_owner(owner);
        // Three bytes times the largest size overflow u64.
        let needed = 3 * u128::from(width) * u128::from(height);
        if needed == 0 || needed != bytes.len() as u128 {
            return Err(Error::argument(
                argument,
                format!("{} bytes", bytes.len()),
                format!("{width} * {height} * 3, at least 1x1"),
            ));
        }
        Ok(Self { width, height, bytes })
    }

    /// Copies from the caller's buffer, whose rows start `row_stride` bytes apart.
    pub fn from_strided(
        argument: &str,
        data: &[u8],
        width: u32,
        height: u32,
        row_stride: usize,
        format: PixelFormat,
    ) -> Result<Self> {
        let bytes = format.bytes_per_pixel();
        let rows = strided_rows(argument, data, width, height, row_stride, bytes)?;
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for row in rows {
            pixels.extend(row.chunks_exact(bytes).map(|p| match format {
                PixelFormat::Gray8 => [p[0]; 3],
                PixelFormat::Rgb8 | PixelFormat::Rgba8 => [p[0], p[1], p[2]],
                PixelFormat::Bgr8 | PixelFormat::Bgra8 => [p[2], p[1], p[0]],
            }));
        }
        Ok(Self { width, height, bytes: pixels.into_flattened().into() })
    }

    /// Columns.
    #[inline]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[inline]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Pixels in row order. `[height * width]`
    #[inline]
    pub fn pixels(&self) -> &[[u8; 3]] {
        self.bytes.as_chunks().0
    }

    /// The pixel in column u, row v.
    #[inline]
    pub fn get(&self, u: u32, v: u32) -> [u8; 3] {
        self.pixels()[v as usize * self.width as usize + u as usize]
    }
}

/// The rows of a strided buffer, each `width * element` long, after checking that they lie inside it.
pub(crate) fn strided_rows<'a, T>(
    argument: &str,
    data: &'a [T],
    width: u32,
    height: u32,
    row_stride: usize,
    elements_per_pixel: usize,
) -> Result<impl Iterator<Item = &'a [T]> + Clone + use<'a, T>> {
    if width == 0 || height == 0 {
        return Err(Error::argument(argument, format!("{width}x{height}"), "at least 1x1"));
    }
    let row = width as usize * elements_per_pixel;
    let needed = (height as usize - 1).checked_mul(row_stride).and_then(|n| n.checked_add(row));
    if row_stride < row || needed.is_none_or(|n| n > data.len()) {
        return Err(Error::argument(
            argument,
            format!("{} elements with rows {row_stride} apart", data.len()),
            format!("{height} rows of {row}, stride at least {row}"),
        ));
    }
    Ok((0..height as usize).map(move |v| &data[v * row_stride..v * row_stride + row]))
}

pub(crate) fn check_len(argument: &str, width: u32, height: u32, len: usize) -> Result<()> {
    if width == 0 || height == 0 || width as usize * height as usize != len {
        return Err(Error::argument(
            argument,
            format!("{len} pixels"),
            format!("{width} * {height}, at least 1x1"),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strided_bgr_buffer_reads_as_rgb_and_its_padding_is_skipped() {
        let data = [1, 2, 3, 4, 5, 6, 99, 99, 7, 8, 9, 10, 11, 12];
        let image = RgbImage::from_strided("image", &data, 2, 2, 8, PixelFormat::Bgr8).unwrap();
        assert_eq!(image.pixels(), [[3, 2, 1], [6, 5, 4], [9, 8, 7], [12, 11, 10]]);
    }

    /// Pixels that report when they are dropped.
    struct Lent {
        bytes: Vec<u8>,
        released: std::sync::mpsc::Sender<()>,
    }

    impl AsRef<[u8]> for Lent {
        fn as_ref(&self) -> &[u8] {
            &self.bytes
        }
    }

    impl Drop for Lent {
        fn drop(&mut self) {
            let _ = self.released.send(());
        }
    }

    #[test]
    fn lent_pixels_are_read_in_place_and_given_back_with_the_last_clone() {
        let (released, given_back) = std::sync::mpsc::channel();
        let bytes: Vec<u8> = (0..18).collect();
        let address = bytes.as_ptr();
        let image = RgbImage::from_owner("image", 3, 2, Lent { bytes, released }).unwrap();
        assert_eq!(image.pixels().as_ptr().cast(), address);
        assert_eq!((image.get(0, 0), image.get(2, 1)), ([0, 1, 2], [15, 16, 17]));
        let clone = image.clone();
        drop(image);
        assert!(given_back.try_recv().is_err());
        assert_eq!(
            clone,
            RgbImage::from_strided("image", &(0..18).collect::<Vec<_>>(), 3, 2, 9, PixelFormat::Rgb8)
                .unwrap()
        );
        drop(clone);
        assert!(given_back.try_recv().is_ok());
    }

    #[test]
    fn lent_pixels_of_another_size_are_refused_and_given_back() {
        for (width, height, bytes) in [(3, 2, 17), (3, 2, 19), (0, 2, 0), (u32::MAX, u32::MAX, 3)] {
            let (released, given_back) = std::sync::mpsc::channel();
            let lent = Lent { bytes: vec![0; bytes], released };
            let error = RgbImage::from_owner("views[0].image", width, height, lent).unwrap_err().to_string();
            assert!(error.starts_with("views[0].image: "), "{error}");
            assert!(given_back.try_recv().is_ok());
        }
    }

    #[test]
    fn pixels_that_are_moved_in_are_not_copied_and_clones_share_them() {
        let pixels = vec![[1, 2, 3]; 6];
        let address = pixels.as_ptr();
        let image = RgbImage::new(3, 2, pixels).unwrap();
        assert_eq!(image.pixels().as_ptr(), address);
        assert_eq!(image.clone().pixels().as_ptr(), address);
    }

    #[test]
    fn a_buffer_that_is_too_short_or_a_stride_that_overflows_is_refused() {
        let data = [0u8; 13];
        for stride in [8, 5, usize::MAX / 2, usize::MAX] {
            let error = RgbImage::from_strided("views[0].image", &data, 2, 2, stride, PixelFormat::Rgb8);
            assert!(error.unwrap_err().to_string().starts_with("views[0].image"));
        }
    }
}
