//! Pictures inside the page: small JPEGs as data URIs.

use crate::job::{Failure, Result};
use crate::render;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use image::{ImageBuffer, Luma, Rgb, Rgb32FImage};
use vg::Gaussians;
use vg::progress::Threads;
use vg::render::{CpuRenderer, RenderOptions, Renderer};

/// Largest width of a picture; wider ones are scaled down, pixels.
pub(super) const MOST_WIDE: u32 = 512;

/// JPEG quality, 1 to 100; at this value edges show no visible ringing.
const QUALITY: u8 = 88;

/// Difference from which on the last of [`ERROR_COLORS`] is used; 1 is the difference of black and white.
pub(super) const ERROR_MOST: f32 = 0.25;

/// Colours of differences from 0 to [`ERROR_MOST`], in even steps.
pub(super) const ERROR_COLORS: [[u8; 3]; 5] =
    [[255, 255, 255], [255, 222, 115], [244, 125, 60], [193, 29, 74], [54, 5, 66]];

/// Number of pictures of the turntable.
pub(super) const FRAMES: u32 = 36;

/// Size of a turntable picture, pixels; whole JPEG blocks high, so that neighbours in the strip do not mix.
const FRAME: (u32, u32) = (384, 288);

/// An encoded picture.
pub(super) struct Picture {
    /// `data:image/jpeg;base64,...`
    pub(super) data: String,
    pub(super) width: u32,
    pub(super) height: u32,
}

/// Encodes colours in [0, 1]; larger values are clamped.
pub(super) fn picture((width, height): (u32, u32), colors: &[[f32; 3]]) -> Result<Picture> {
    let full = Rgb32FImage::from_fn(width, height, |u, v| {
        Rgb(colors[(v * width + u) as usize].map(|c| c.clamp(0.0, 1.0)))
    });
    let small = match small((width, height)) {
        size if size == (width, height) => full,
        (w, h) => imageops::resize(&full, w, h, FilterType::Triangle),
    };
    let pixels: Vec<u8> = small.as_raw().iter().map(|c| (c * 255.0).round() as u8).collect();
    encoded(small.dimensions(), &pixels)
}

/// Encodes the absolute difference of two pictures, the mean over red, green and blue, as a colour.
pub(super) fn error((width, height): (u32, u32), a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<Picture> {
    let difference = |u: u32, v: u32| {
        let i = (v * width + u) as usize;
        (0..3).map(|c| (a[i][c].clamp(0.0, 1.0) - b[i][c].clamp(0.0, 1.0)).abs()).sum::<f32>() / 3.0
    };
    let full = ImageBuffer::from_fn(width, height, |u, v| Luma([difference(u, v)]));
    let (w, h) = small((width, height));
    let small = imageops::resize(&full, w, h, FilterType::Triangle);
    let pixels: Vec<u8> = small.pixels().flat_map(|p| error_color(p.0[0])).collect();
    encoded((w, h), &pixels)
}

fn error_color(difference: f32) -> [u8; 3] {
    let last = ERROR_COLORS.len() - 1;
    let at = (difference / ERROR_MOST).clamp(0.0, 1.0) * last as f32;
    let below = (at as usize).min(last - 1);
    let (low, high, share) = (ERROR_COLORS[below], ERROR_COLORS[below + 1], at - below as f32);
    std::array::from_fn(|c| (f32::from(low[c]) * (1.0 - share) + f32::from(high[c]) * share).round() as u8)
}

/// Renders of the model from all around, one below the other; the first is from the front left.
pub(super) fn turntable(gaussians: &Gaussians, threads: &Threads) -> Result<Picture> {
    let mut cameras = render::turntable(gaussians, FRAMES, FRAME)?;
    // The view from straight ahead shows least of a vehicle.
    cameras.rotate_left(FRAMES as usize / 10);
    let (renderer, options) = (CpuRenderer::new(), RenderOptions::default());
    let mut strip = Vec::with_capacity((FRAME.0 * FRAME.1 * FRAMES * 3) as usize);
    for named in &cameras {
        let drawn = threads.run(|| renderer.render(gaussians, &named.camera, &options))?;
        strip.extend(drawn.to_rgb8().into_iter().flatten());
    }
    encoded((FRAME.0, FRAME.1 * FRAMES), &strip)
}

/// Size on the page of a picture of this size.
fn small((width, height): (u32, u32)) -> (u32, u32) {
    if width <= MOST_WIDE {
        return (width, height);
    }
    let scaled = f64::from(height) * f64::from(MOST_WIDE) / f64::from(width);
    (MOST_WIDE, (scaled.round() as u32).max(1))
}

fn encoded((width, height): (u32, u32), rgb: &[u8]) -> Result<Picture> {
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY)
        .encode(rgb, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|e| Failure::job(format!("encoding a picture of {width}x{height}: {e}")))?;
    Ok(Picture { data: format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg)), width, height })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_map_to_the_colours_and_are_clamped_at_the_last() {
        assert_eq!(error_color(0.0), ERROR_COLORS[0]);
        assert_eq!(error_color(0.5 * ERROR_MOST), ERROR_COLORS[2]);
        assert_eq!([error_color(ERROR_MOST), error_color(1.0)], [ERROR_COLORS[4]; 2]);
    }

    #[test]
    fn wide_pictures_become_narrow_and_keep_their_shape() {
        assert_eq!(
            [small((512, 384)), small((4000, 3000)), small((9000, 1))],
            [(512, 384), (512, 384), (512, 1)]
        );
        let picture = picture((1024, 512), &vec![[1.5, 0.5, -0.1]; 1024 * 512]).unwrap();
        assert_eq!((picture.width, picture.height), (512, 256));
        assert!(picture.data.starts_with("data:image/jpeg;base64,/9j/"));
    }
}
