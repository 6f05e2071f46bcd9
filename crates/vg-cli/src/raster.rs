//! Rasterises a drawing as PNG, with letters inside the program, so that every machine makes the same bytes.

use crate::drawing::{Anchor, Color, DOT, Direction, Drawing, Font, Shape, THICK, THIN, Text};
use crate::job::{Failure, Result};
use crate::shown;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// Pixels per unit of the drawing, for screens with small pixels.
const SCALE: f64 = 2.0;

/// The available size of letters that is closest to 13 units: 12.
const LETTERS: RasterHeight = RasterHeight::Size32;

/// Rows of a letter above its baseline.
const BASELINE: i64 = 25;

/// Replacement for letters that are not available, such as Greek and Cyrillic.
const UNKNOWN: char = '\u{fffd}';

/// The drawing as a PNG of twice its size.
pub(crate) fn png(drawing: &Drawing) -> Result<Vec<u8>> {
    let [width, height] = drawing.size.map(|side| (SCALE * side).ceil() as usize);
    let mut picture = Picture { width, pixels: vec![[u8::MAX; 3]; width * height] };
    for shape in &drawing.shapes {
        picture.draw(shape);
    }
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(picture.pixels.as_flattened(), width as u32, height as u32, ExtendedColorType::Rgb8)
        .map_err(|e| Failure::job(format!("the plot cannot be drawn: {e}")))?;
    Ok(png)
}

/// Pixels in row order.
struct Picture {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn draw(&mut self, shape: &Shape) {
        match shape {
            Shape::Rules { ends, color, opacity } => self.strokes(ends, THIN, *color, *opacity),
            Shape::Path { points, color } => {
                let ends: Vec<[[f64; 2]; 2]> = points.windows(2).map(|ends| [ends[0], ends[1]]).collect();
                self.strokes(&ends, THICK, *color, 1.0);
            }
            Shape::Dot { center, color } => self.strokes(&[[*center; 2]], 2.0 * DOT, *color, 1.0),
            Shape::Text(text) => self.text(text),
        }
    }

    /// Draws lines with round ends as one shape: a crossing covers no more than one line.
    fn strokes(&mut self, ends: &[[[f64; 2]; 2]], width: f64, color: Color, opacity: f64) {
        let radius = 0.5 * SCALE * width;
        let ends: Vec<[[f64; 2]; 2]> = ends.iter().map(|line| line.map(|p| p.map(|x| SCALE * x))).collect();
        let side = |k: usize, size: usize| {
            let all = || ends.iter().flatten().map(|p| p[k]);
            let low = all().fold(f64::INFINITY, f64::min) - radius - 1.0;
            let high = all().fold(f64::NEG_INFINITY, f64::max) + radius + 1.0;
            low.max(0.0) as usize..(high.max(0.0) as usize).min(size)
        };
        let (columns, rows) = (side(0, self.width), side(1, self.pixels.len() / self.width));
        for row in rows {
            for column in columns.clone() {
                let center = [column as f64 + 0.5, row as f64 + 0.5];
                let nearest = ends.iter().map(|line| distance(center, line)).fold(f64::INFINITY, f64::min);
                // Pixels on the edge are covered in part.
                let coverage = (radius + 0.5 - nearest).clamp(0.0, 1.0);
                self.blend(column as i64, row as i64, color, opacity * coverage);
            }
        }
    }

    fn text(&mut self, text: &Text) {
        let weight = match text.font {
            Font::Body => FontWeight::Regular,
            Font::Heading => FontWeight::Bold,
        };
        let line = shown::line(&text.text);
        let advance = get_raster_width(weight, LETTERS) as i64;
        let length = advance * line.chars().count() as i64;
        let before = match text.anchor {
            Anchor::Start => 0,
            Anchor::Middle => length / 2,
            Anchor::End => length,
        };
        let [x, y] = text.at.map(|x| (SCALE * x).round() as i64);
        for (i, c) in line.chars().enumerate() {
            let letter = get_raster(c, weight, LETTERS).or_else(|| get_raster(UNKNOWN, weight, LETTERS));
            let Some(letter) = letter else { continue };
            for (row, values) in letter.rows().enumerate() {
                for (column, value) in values.iter().enumerate() {
                    let along = advance * i as i64 - before + column as i64;
                    let below = row as i64 - BASELINE;
                    let (column, row) = match text.direction {
                        Direction::Right => (x + along, y + below),
                        Direction::Up => (x + below, y - along),
                    };
                    self.blend(column, row, text.color, f64::from(*value) / 255.0);
                }
            }
        }
    }

    /// Blends a colour into a pixel; pixels outside the picture are ignored.
    fn blend(&mut self, column: i64, row: i64, color: Color, coverage: f64) {
        let inside = (0..self.width as i64).contains(&column) && row >= 0;
        let pixel = inside.then(|| row as usize * self.width + column as usize);
        if let Some(pixel) = pixel.and_then(|i| self.pixels.get_mut(i)) {
            for (below, above) in pixel.iter_mut().zip(color) {
                let mixed = f64::from(*below) + coverage * (f64::from(above) - f64::from(*below));
                *below = mixed.round() as u8;
            }
        }
    }
}

/// Distance of a point from a line segment.
fn distance([x, y]: [f64; 2], [[x0, y0], [x1, y1]]: &[[f64; 2]; 2]) -> f64 {
    let (dx, dy) = (x1 - x0, y1 - y0);
    let squared = dx * dx + dy * dy;
    let along = if squared > 0.0 { ((x - x0) * dx + (y - y0) * dy) / squared } else { 0.0 };
    let along = along.clamp(0.0, 1.0);
    (x - x0 - along * dx).hypot(y - y0 - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shapes on 120 x 40 units.
    fn drawn(shapes: Vec<Shape>) -> image::GrayImage {
        let png = png(&Drawing { size: [120.0, 40.0], shapes }).unwrap();
        image::load_from_memory(&png).unwrap().into_luma8()
    }

    fn text(text: &str) -> Shape {
        Shape::Text(Text::new([8.0, 26.0], text))
    }

    /// Pixels darker than half.
    fn ink(picture: &image::GrayImage) -> usize {
        assert_eq!(picture.dimensions(), (240, 80));
        picture.pixels().filter(|p| p.0[0] < 128).count()
    }

    #[test]
    fn letters_are_drawn_at_twice_the_size() {
        let [none, few, more] = ["", "dB", "PSNR, dB"].map(|word| ink(&drawn(vec![text(word)])));
        assert!(none == 0 && few > 50 && more > 2 * few, "{none}, {few}, {more} dark pixels");
    }

    #[test]
    fn letters_stand_on_the_baseline_and_those_that_are_not_there_leave_a_sign() {
        let last_row = |word| {
            let picture = drawn(vec![text(word)]);
            picture.enumerate_pixels().filter(|(.., p)| p.0[0] < 128).map(|(_, v, _)| v).max()
        };
        assert_eq!([last_row("HIE"), last_row("ÄÖŐ")], [Some(51), Some(51)]);
        assert!(last_row("車").is_some());
    }

    #[test]
    fn a_text_upwards_is_the_same_text_turned() {
        let up = Text { at: [60.0, 30.0], direction: Direction::Up, ..Text::new([0.0; 2], "dB") };
        let right = Text { at: [60.0, 30.0], ..Text::new([0.0; 2], "dB") };
        let [up, right] = [up, right].map(|text| drawn(vec![Shape::Text(text)]));
        assert!(ink(&right) > 50);
        for (u, v, pixel) in right.enumerate_pixels().filter(|(.., p)| p.0[0] < 255) {
            assert_eq!(up.get_pixel(120 + v - 60, 60 + 120 - u), pixel);
        }
    }

    #[test]
    fn lines_and_dots_cover_their_area_and_crossings_no_more() {
        let area =
            |shape: Shape| drawn(vec![shape]).pixels().map(|p| 1.0 - f64::from(p.0[0]) / 255.0).sum::<f64>();
        let color = [0; 3];
        let dot = area(Shape::Dot { center: [50.3, 20.1], color });
        assert!((dot - std::f64::consts::PI * (2.0 * DOT).powi(2)).abs() < 2.0, "{dot}");
        let path = area(Shape::Path { points: vec![[20.0, 10.0], [50.0, 30.0], [100.0, 12.0]], color });
        let length = 2.0 * ((30f64).hypot(20.0) + 50f64.hypot(18.0));
        assert!((path / (2.0 * THICK * length) - 1.0).abs() < 0.05, "{path}");
        let cross = vec![[[60.0, 10.0], [60.0, 30.0]], [[50.0, 20.0], [70.0, 20.0]]];
        let darkest = drawn(vec![Shape::Rules { ends: cross, color, opacity: 0.4 }]);
        assert_eq!(darkest.pixels().map(|p| p.0[0]).min(), Some(153));
    }

    #[test]
    fn shapes_are_clipped_to_the_picture() {
        let outside = Shape::Path { points: vec![[-50.0, -20.0], [500.0, 300.0]], color: [0; 3] };
        assert!(ink(&drawn(vec![outside, text("a long text that does not end before the edge")])) > 100);
    }
}
