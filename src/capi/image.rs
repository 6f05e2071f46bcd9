//! Pictures in the caller's memory.

use super::read;
use std::ffi::c_void;
use vg::metrics::COLORS;
use vg::scene::{DepthMap, Mask, PixelFormat, RgbImage};
use vg::{Error, Result};

/// What a pixel holds. 8-bit channels are sRGB-encoded, as cameras and picture files have them.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_format {
    /// uint8 R, G, B.
    Rgb8 = 1,
    /// uint8 B, G, R (OpenCV).
    Bgr8 = 2,
    /// uint8 R, G, B, A; alpha is straight.
    Rgba8 = 3,
    /// uint8 B, G, R, A; alpha is straight.
    Bgra8 = 4,
    /// uint8 luminance; the format of masks.
    Gray8 = 5,
    /// float32 R, G, B, A; sRGB-encoded, 0 to 1.
    Rgba32f = 6,
    /// float32 planar depth along the optical axis, metres; 0, negative, NaN and infinite mean no measurement.
    Depth32f = 7,
}

/// A picture that the library reads during the call and does not keep. All zero: no picture.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_image {
    /// The first pixel of the top row. Any alignment. NULL: no picture; the other fields are not looked at.
    pub data: *const c_void,
    /// Bytes from one row to the next (`cv::Mat::step`, ROS `Image.step`); 0: rows without gaps.
    pub row_stride: usize,
    /// Columns; must equal the camera's.
    pub width: u32,
    /// Rows; must equal the camera's.
    pub height: u32,
    /// A `vg_format`.
    pub format: i32,
    /// Reserved: 0.
    pub flags: u32,
}

impl vg_image {
    pub(super) const NONE: Self =
        Self { data: std::ptr::null(), row_stride: 0, width: 0, height: 0, format: 0, flags: 0 };
}

const PIXELS: [(i32, &str, PixelFormat); 5] = [
    (vg_format::Rgb8 as i32, "RGB8", PixelFormat::Rgb8),
    (vg_format::Bgr8 as i32, "BGR8", PixelFormat::Bgr8),
    (vg_format::Rgba8 as i32, "RGBA8", PixelFormat::Rgba8),
    (vg_format::Bgra8 as i32, "BGRA8", PixelFormat::Bgra8),
    (vg_format::Gray8 as i32, "GRAY8", PixelFormat::Gray8),
];

/// Pixels in the caller's memory, borrowed for the duration of a call.
struct BorrowedPixels {
    data: *const u8,
    len: usize,
}

// SAFETY: the caller promised that the pixels are not written during the call.
unsafe impl Send for BorrowedPixels {}
unsafe impl Sync for BorrowedPixels {}

impl AsRef<[u8]> for BorrowedPixels {
    fn as_ref(&self) -> &[u8] {
        // SAFETY: checked by `bytes`; no reference outlives the call.
        unsafe { std::slice::from_raw_parts(self.data, self.len) }
    }
}

/// Reads the colours of a picture, and its alpha, if any, as a mask. RGB8 without gaps is not copied, so the result
/// must not outlive the call.
pub(super) unsafe fn photograph(argument: &str, image: &vg_image) -> Result<(RgbImage, Option<Mask>)> {
    read::not_null(&format!("{argument}.data"), image.data, "the picture's pixels")?;
    let format = checked_format(argument, image, &PIXELS)?;
    let (bytes, stride) = unsafe { bytes(argument, image, format.bytes_per_pixel())? };
    let (width, height) = (image.width, image.height);
    if format == PixelFormat::Rgb8 && stride == width as usize * 3 {
        let lent = BorrowedPixels { data: bytes.as_ptr(), len: bytes.len() };
        return Ok((RgbImage::from_owner(argument, width, height, lent)?, None));
    }
    let picture = RgbImage::from_strided(argument, bytes, width, height, stride, format)?;
    let mask = match format {
        PixelFormat::Rgba8 | PixelFormat::Bgra8 => {
            let mut alpha = Vec::with_capacity(width as usize * height as usize);
            for v in 0..height as usize {
                alpha.extend(bytes[v * stride..][..width as usize * 4].chunks_exact(4).map(|p| p[3]));
            }
            // As for picture files: alpha that is opaque everywhere is no mask.
            match alpha.iter().all(|&a| a == u8::MAX) {
                true => None,
                false => Some(Mask::from_strided(argument, &alpha, width, height, width as usize)?),
            }
        }
        _ => None,
    };
    Ok((picture, mask))
}

/// Reads a mask, if there is one.
pub(super) unsafe fn mask(argument: &str, image: &vg_image) -> Result<Option<Mask>> {
    if image.data.is_null() {
        return Ok(None);
    }
    checked_format(argument, image, &[(vg_format::Gray8 as i32, "GRAY8", ())])?;
    let (bytes, stride) = unsafe { bytes(argument, image, 1)? };
    Mask::from_strided(argument, bytes, image.width, image.height, stride).map(Some)
}

/// Reads a depth map, if there is one.
pub(super) unsafe fn depth(argument: &str, image: &vg_image) -> Result<Option<DepthMap>> {
    const FLOAT: usize = size_of::<f32>();
    if image.data.is_null() {
        return Ok(None);
    }
    checked_format(argument, image, &[(vg_format::Depth32f as i32, "DEPTH32F", ())])?;
    let (bytes, stride) = unsafe { bytes(argument, image, FLOAT)? };
    let (width, height) = (image.width as usize, image.height as usize);
    let mut depth = Vec::with_capacity(width * height);
    for v in 0..height {
        // Read bytewise: rows need not be aligned to floats.
        let row = bytes[v * stride..][..width * FLOAT].chunks_exact(FLOAT);
        depth.extend(row.map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])));
    }
    DepthMap::new(image.width, image.height, depth).map(Some)
}

/// Reads a picture and composites it on white, RGB in [0, 1]. `[height * width]`
pub(super) unsafe fn on_white(argument: &str, image: &vg_image) -> Result<Vec<[f32; 3]>> {
    const WITH_ALPHA: [(i32, &str, [usize; 3]); 2] =
        [(vg_format::Rgba8 as i32, "RGBA8", [0, 1, 2]), (vg_format::Bgra8 as i32, "BGRA8", [2, 1, 0])];
    read::not_null(&format!("{argument}.data"), image.data, "the picture's pixels")?;
    let (width, height) = (image.width as usize, image.height as usize);
    let over = |rgb: [f32; 3], alpha: f32| rgb.map(|c| alpha * c + (1.0 - alpha));
    let mut pixels = Vec::new();
    if let Some((.., order)) = WITH_ALPHA.into_iter().find(|(n, ..)| *n == image.format) {
        checked_format(argument, image, &WITH_ALPHA)?;
        let (bytes, stride) = unsafe { bytes(argument, image, 4)? };
        for v in 0..height {
            let row = bytes[v * stride..][..4 * width].as_chunks::<4>().0;
            let byte = |b: u8| f32::from(b) / 255.0;
            pixels.extend(row.iter().map(|p| over(order.map(|k| byte(p[k])), byte(p[3]))));
        }
        return Ok(pixels);
    }
    if image.format == vg_format::Rgba32f as i32 {
        const CHANNEL: usize = size_of::<f32>();
        checked_format(argument, image, &[(vg_format::Rgba32f as i32, "RGBA32F", ())])?;
        let (bytes, stride) = unsafe { bytes(argument, image, 4 * CHANNEL)? };
        for v in 0..height {
            // Read bytewise: rows need not be aligned to floats.
            for (u, p) in bytes[v * stride..][..4 * CHANNEL * width].as_chunks::<16>().0.iter().enumerate() {
                let p: [f32; 4] = bytemuck::pod_read_unaligned(p);
                if !p.iter().all(|c| COLORS.contains(c)) {
                    let at = format!("{argument}, column {u}, row {v}");
                    let allowed = "0 to 1, and at most 1 beyond; divide the picture by its range first";
                    return Err(Error::argument(at, format!("{p:?}"), allowed));
                }
                let [r, g, b, alpha] = p;
                pixels.push(over([r, g, b], alpha.clamp(0.0, 1.0)));
            }
        }
        return Ok(pixels);
    }
    let (picture, _) = unsafe { photograph(argument, image)? };
    Ok(picture.pixels().iter().map(|p| p.map(|c| f32::from(c) / 255.0)).collect())
}

/// Checks that the picture has one of these formats and that its reserved fields are zero.
fn checked_format<T: Copy>(argument: &str, image: &vg_image, formats: &[(i32, &str, T)]) -> Result<T> {
    read::zero(&format!("{argument}.flags"), image.flags == 0)?;
    read::one_of(&format!("{argument}.format"), image.format, formats)
}

/// The bytes from the first to the last pixel, and the stride, after checking that their number does not overflow.
unsafe fn bytes<'a>(argument: &str, image: &vg_image, pixel: usize) -> Result<(&'a [u8], usize)> {
    let (len, stride) = extent(argument, ".row_stride", image.width, image.height, image.row_stride, pixel)?;
    Ok((unsafe { std::slice::from_raw_parts(image.data.cast(), len) }, stride))
}

/// Number of bytes from the first pixel to the end of the last, and the stride, of a picture of this size. In errors,
/// the stride is called by the picture's name followed by `stride_name`.
pub(super) fn extent(
    argument: &str,
    stride_name: &str,
    width: u32,
    height: u32,
    row_stride: usize,
    pixel: usize,
) -> Result<(usize, usize)> {
    use vg::geometry::camera::MAX_SIDE;
    if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
        return Err(Error::argument(
            argument,
            format!("{width}x{height}"),
            format!("1x1 to {MAX_SIDE}x{MAX_SIDE}"),
        ));
    }
    let row = width as usize * pixel;
    let stride = if row_stride == 0 { row } else { row_stride };
    let len = (height as usize - 1).checked_mul(stride).and_then(|n| n.checked_add(row));
    match len.filter(|&n| stride >= row && isize::try_from(n).is_ok()) {
        Some(len) => Ok((len, stride)),
        None => Err(Error::argument(
            format!("{argument}{stride_name}"),
            format!("{row_stride} bytes"),
            format!(
                "0, or at least {row} bytes for {width} pixels of {pixel}, and {height} rows that fit into memory"
            ),
        )),
    }
}
