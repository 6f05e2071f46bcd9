//! Downsampling of views.
//!
//! Colour is averaged over each new pixel's area. A new pixel of the mask has the label of at least half of its area.
//! Depth is sampled as in [`undistort`](super::undistort), exactly on planes and never between two surfaces.

use super::mask::{Label, Mask};
use super::undistort::depth_at;
use super::{DepthMap, RgbImage, View};
use rayon::prelude::*;
use vg_geometry::Result;
use vg_geometry::resample::Taps;

/// The view at `share` of its width and height, rounded, at least 1 x 1; at 1 the view itself, sharing its pixels.
/// Distortion is defined in normalised coordinates and does not change.
pub fn resized(view: &View, share: f64) -> Result<View> {
    let side = |pixels: u32| ((f64::from(pixels) * share).round() as u32).clamp(1, pixels);
    let (width, height) = (side(view.camera.width), side(view.camera.height));
    if (width, height) == (view.camera.width, view.camera.height) {
        return Ok(view.clone());
    }
    let camera = view.camera.resized(width, height)?;
    let (columns, rows) = (spans(view.camera.width, width), spans(view.camera.height, height));
    let area = Area { columns: &columns, rows: &rows, stride: view.camera.width as usize };
    let depth = view.depth.as_ref().map(|depth| resized_depth(depth, width, height)).transpose()?;
    Ok(View {
        name: view.name.clone(),
        camera,
        image: RgbImage::new(width, height, area.colors(view.image.pixels()))?,
        mask: view
            .mask
            .as_ref()
            .map(|mask| Mask::new(width, height, area.labels(mask.labels())))
            .transpose()?,
        depth,
    })
}

/// The old pixels that a new one covers along an axis.
struct Span {
    first: usize,
    /// Weight of each pixel; the sum is 1.
    shares: Vec<f32>,
}

/// One span for each of `new` pixels that together cover `old` ones.
fn spans(old: u32, new: u32) -> Vec<Span> {
    let length = f64::from(old) / f64::from(new);
    (0..new)
        .map(|i| {
            let (start, end) = (f64::from(i) * length, f64::from(i + 1) * length);
            let (first, last) = (start as u32, (end.ceil() as u32).min(old));
            let covered =
                |p: u32| ((f64::from(p) + 1.0).min(end) - f64::from(p).max(start)).max(0.0) / length;
            Span { first: first as usize, shares: (first..last).map(|p| covered(p) as f32).collect() }
        })
        .collect()
}

/// The areas of a picture that new pixels cover.
struct Area<'a> {
    columns: &'a [Span],
    rows: &'a [Span],
    stride: usize,
}

impl Area<'_> {
    /// Calls `each(index of an old pixel, its share)` for all old pixels that a new pixel covers.
    fn visit(&self, row: &Span, column: &Span, mut each: impl FnMut(usize, f32)) {
        for (v, down) in row.shares.iter().enumerate() {
            let start = (row.first + v) * self.stride + column.first;
            column.shares.iter().enumerate().for_each(|(u, across)| each(start + u, down * across));
        }
    }

    fn map<T: Send>(&self, new: impl Fn(&Span, &Span) -> T + Sync) -> Vec<T> {
        let new = &new;
        let rows = self.rows.par_iter();
        rows.flat_map_iter(|row| self.columns.iter().map(move |column| new(row, column))).collect()
    }

    fn colors(&self, pixels: &[[u8; 3]]) -> Vec<[u8; 3]> {
        self.map(|row, column| {
            let mut sum = [0.0f32; 3];
            self.visit(row, column, |i, share| {
                sum.iter_mut().zip(pixels[i]).for_each(|(sum, c)| *sum += share * f32::from(c));
            });
            sum.map(|c| c.round() as u8)
        })
    }

    fn labels(&self, labels: &[Label]) -> Vec<Label> {
        // Tolerance for the rounding of sums of shares that are exactly one half.
        const HALF: f32 = 0.5 - 1e-4;
        self.map(|row, column| {
            let (mut vehicle, mut background) = (0.0f32, 0.0f32);
            self.visit(row, column, |i, share| match labels[i] {
                Label::Vehicle => vehicle += share,
                Label::Background => background += share,
                Label::Unknown => {}
            });
            match () {
                () if vehicle >= HALF => Label::Vehicle,
                () if background >= HALF => Label::Background,
                () => Label::Unknown,
            }
        })
    }
}

fn resized_depth(depth: &DepthMap, width: u32, height: u32) -> Result<DepthMap> {
    let (old_width, old_height) = (depth.width(), depth.height());
    let sx = old_width as f32 / width as f32;
    let sy = old_height as f32 / height as f32;
    let taps = |i: usize| {
        let (u, v) = (i % width as usize, i / width as usize);
        Taps::new([(u as f32 + 0.5) * sx, (v as f32 + 0.5) * sy], old_width, old_height)
    };
    let pixels = 0..width as usize * height as usize;
    let new = pixels.clone().into_par_iter().map(|i| depth_at(depth, &taps(i))).collect();
    let new = DepthMap::new(width, height, new)?;
    match depth.confidence() {
        Some(confidence) => {
            new.with_confidence(pixels.into_par_iter().map(|i| confidence[taps(i).nearest()]).collect())
        }
        None => Ok(new),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::{Camera, Intrinsics, Pose};

    const WIDTH: u32 = 120;
    const HEIGHT: u32 = 90;

    /// A slanted plane inside a disc, nothing elsewhere.
    fn view() -> View {
        let intrinsics = Intrinsics { fx: 100.0, fy: 110.0, cx: 61.0, cy: 43.0 };
        let camera = Camera::pinhole(WIDTH, HEIGHT, intrinsics, Pose::IDENTITY).unwrap();
        let pixels = || (0..WIDTH * HEIGHT).map(|i| [f64::from(i % WIDTH) + 0.5, f64::from(i / WIDTH) + 0.5]);
        let inside = |p: &[f64; 2]| (p[0] - 60.0).hypot(p[1] - 45.0) < 30.0;
        let labels = pixels().map(|p| if inside(&p) { Label::Vehicle } else { Label::Background });
        let depths = pixels().map(|p| if inside(&p) { plane(&camera, p) as f32 } else { 0.0 });
        let ramp = pixels().map(|p| [p[0] as u8, p[1] as u8, 7]);
        View {
            name: String::new(),
            camera,
            image: RgbImage::new(WIDTH, HEIGHT, ramp.collect()).unwrap(),
            mask: Some(Mask::new(WIDTH, HEIGHT, labels.collect()).unwrap()),
            depth: Some(DepthMap::new(WIDTH, HEIGHT, depths.collect()).unwrap()),
        }
    }

    /// Depth where a pixel's ray meets 0.2 x + 0.1 y + z = 5.
    fn plane(camera: &Camera, pixel: [f64; 2]) -> f64 {
        let [x, y] = camera.intrinsics.normalized_from_pixel(pixel);
        5.0 / (0.2 * x + 0.1 * y + 1.0)
    }

    #[test]
    fn a_plane_keeps_its_depth_and_a_mask_its_area() {
        let view = view();
        let area = |v: &View| {
            let pixels = f64::from(v.camera.width * v.camera.height);
            v.mask.as_ref().unwrap().vehicle_pixels() as f64 / pixels
        };
        for share in [0.9, 0.75, 0.5, 0.35, 0.25] {
            let small = resized(&view, share).unwrap();
            small.validate("small").unwrap();
            assert_eq!(small.camera.width, (f64::from(WIDTH) * share).round() as u32);
            assert!((area(&small) / area(&view) - 1.0).abs() < 0.06, "{share}: {}", area(&small));
            let depth = small.depth.as_ref().unwrap();
            let mut measured = 0;
            for (v, u) in (0..small.camera.height).flat_map(|v| (0..small.camera.width).map(move |u| (v, u)))
            {
                let Some(z) = depth.get(u, v) else { continue };
                let true_z = plane(&small.camera, [f64::from(u) + 0.5, f64::from(v) + 0.5]);
                let at_edge = !(1..small.camera.width - 1).contains(&u)
                    || !(1..small.camera.height - 1).contains(&v)
                    || (0..9).any(|k| depth.get(u + k % 3 - 1, v + k / 3 - 1).is_none());
                // At the edge, depth is that of the nearest pixel, up to half an old pixel away.
                let tolerance = if at_edge { 0.02 } else { 1e-5 };
                assert!((f64::from(z) - true_z).abs() < tolerance, "{share} ({u}, {v}): {z} {true_z}");
                measured += 1;
            }
            assert!(measured > 50, "{share}: {measured}");
        }
    }

    #[test]
    fn depths_of_two_surfaces_are_never_averaged() {
        let mut view = view();
        let columns = (0..WIDTH * HEIGHT).map(|i| if i % WIDTH < 33 { 3.0 } else { 8.0 });
        view.depth = Some(DepthMap::new(WIDTH, HEIGHT, columns.collect()).unwrap());
        for share in [0.75, 0.5, 0.3] {
            let small = resized(&view, share).unwrap();
            assert!(small.depth.unwrap().depth().iter().all(|z| [3.0, 8.0].contains(z)), "{share}");
        }
    }

    #[test]
    fn colour_is_the_mean_over_the_new_pixels_area() {
        let small = resized(&view(), 0.25).unwrap();
        // Columns 4u to 4u + 3 of the ramp; each new row covers about four rows.
        assert!(
            small.image.pixels()[..30]
                .iter()
                .enumerate()
                .all(|(u, c)| { (f64::from(c[0]) - (4.0 * u as f64 + 1.5)).abs() <= 0.51 && c[2] == 7 })
        );
    }

    #[test]
    fn the_smallest_picture_has_one_pixel_and_a_share_of_1_copies_nothing() {
        let view = view();
        let dot = resized(&view, 1e-9).unwrap();
        assert_eq!((dot.camera.width, dot.camera.height), (1, 1));
        assert_eq!(resized(&dot, 0.5).unwrap().camera, dot.camera);
        let same = resized(&view, 1.0).unwrap();
        assert_eq!(same.image.pixels().as_ptr(), view.image.pixels().as_ptr());
    }

    #[test]
    fn pixels_that_are_mostly_unknown_stay_unknown() {
        let mut view = view();
        view.mask = Some(Mask::new(WIDTH, HEIGHT, vec![Label::Unknown; 10800]).unwrap());
        let small = resized(&view, 0.4).unwrap();
        assert!(small.mask.unwrap().labels().iter().all(|l| *l == Label::Unknown));
    }
}
