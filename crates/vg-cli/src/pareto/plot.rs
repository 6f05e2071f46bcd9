//! Plot of the sweep: error against run time.

use super::{Point, labels, place};
use crate::drawing::{Anchor, Color, Direction, Drawing, Font, Shape, Text};

const SIZE: [f64; 2] = [860.0, 520.0];
/// Left, top, right, bottom.
const MARGIN: [f64; 4] = [64.0, 48.0, 24.0, 56.0];
const GREY: Color = [0x6b, 0x72, 0x80];
const PALE: Color = [0xe5, 0xe7, 0xeb];
const FRONT: Color = [0x1d, 0x4e, 0xd8];
const BEHIND: Color = [0xb4, 0x53, 0x09];

/// An axis: maps values to coordinates of the picture.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
    /// Whether the axis is logarithmic.
    is_log: bool,
}

impl Axis {
    fn at(&self, value: f64) -> f64 {
        let of = |v: f64| if self.is_log { v.log10() } else { v };
        self.from + (of(value) - of(self.low)) / (of(self.high) - of(self.low)) * (self.to - self.from)
    }

    /// Ticks at 1, 2 and 5 of each decade; on a linear axis, multiples of such a number.
    fn ticks(&self) -> Vec<f64> {
        if self.is_log {
            let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
            let all = decades.flat_map(|d| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(d)));
            return all.filter(|t| (self.low..=self.high).contains(t)).collect();
        }
        let rough = (self.high - self.low) / 6.0;
        let decade = 10f64.powf(rough.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        (first..=last).map(|k| k as f64 * step).collect()
    }
}

/// A point of the plot with its spread.
struct Mark<'a> {
    name: &'a str,
    seconds: f64,
    seconds_range: [f64; 2],
    psnr: f64,
    psnr_range: [f64; 2],
    on_front: bool,
}

impl<'a> Mark<'a> {
    /// `None` for a point that was not measured, or whose PSNR is infinite.
    fn from_point(point: &'a Point) -> Option<Self> {
        let row = &point.row;
        let [seconds, psnr] = place(row).filter(|place| place[1].is_finite())?;
        let error = row.psnr_standard_error_db.unwrap_or(0.0);
        Some(Self {
            name: &row.system,
            seconds,
            seconds_range: row.seconds_range?,
            psnr,
            psnr_range: [psnr - error, psnr + error],
            on_front: point.on_front,
        })
    }
}

/// PSNR of the test views against seconds, both with their spread; a line joins the front. `None` without points.
pub(super) fn draw(points: &[Point], title: &str) -> Option<Drawing> {
    let rows: Vec<Mark> = points.iter().filter_map(Mark::from_point).collect();
    if rows.is_empty() {
        return None;
    }
    let [width, height] = SIZE;
    let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
    let x = Axis {
        low: least(&mut rows.iter().map(|r| r.seconds_range[0])).max(1e-4) / 1.3,
        high: most(&mut rows.iter().map(|r| r.seconds_range[1])).max(1e-3) * 1.5,
        from: MARGIN[0],
        to: width - MARGIN[2],
        is_log: true,
    };
    let y = Axis {
        low: least(&mut rows.iter().map(|r| r.psnr_range[0])) - 0.15,
        high: most(&mut rows.iter().map(|r| r.psnr_range[1])) + 0.15,
        from: height - MARGIN[3],
        to: MARGIN[1],
        is_log: false,
    };
    let mut shapes = vec![Shape::Text(Text { font: Font::Heading, ..Text::new([MARGIN[0], 26.0], title) })];
    grid(&mut shapes, &x, &y);

    let mut front: Vec<&Mark> = rows.iter().filter(|r| r.on_front).collect();
    front.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    let front: Vec<[f64; 2]> = front.iter().map(|r| [x.at(r.seconds), y.at(r.psnr)]).collect();
    let named: Vec<([f64; 2], &str)> =
        rows.iter().map(|r| ([x.at(r.seconds), y.at(r.psnr)], r.name)).collect();
    let names = labels::places(&named, &front, [x.from, y.to - 10.0, x.to, y.from]);
    shapes.push(Shape::Path { points: front, color: FRONT });
    for (row, name_at) in rows.iter().zip(names) {
        let color = if row.on_front { FRONT } else { BEHIND };
        let (at_x, at_y) = (x.at(row.seconds), y.at(row.psnr));
        let [y0, y1] = row.psnr_range.map(|v| y.at(v));
        let [x0, x1] = row.seconds_range.map(|v| x.at(v));
        let spread = vec![[[at_x, y0], [at_x, y1]], [[x0, at_y], [x1, at_y]]];
        shapes.push(Shape::Rules { ends: spread, color, opacity: 0.4 });
        shapes.push(Shape::Dot { center: [at_x, at_y], color });
        shapes.push(Shape::Text(Text { color, ..Text::new(name_at, row.name) }));
    }
    Some(Drawing { size: SIZE, shapes })
}

fn grid(shapes: &mut Vec<Shape>, x: &Axis, y: &Axis) {
    let rule = |from, to| Shape::Rules { ends: vec![[from, to]], color: PALE, opacity: 1.0 };
    let text = |at, anchor, color, text: String| Shape::Text(Text { anchor, color, ..Text::new(at, text) });
    for tick in x.ticks() {
        let at = x.at(tick);
        shapes.push(rule([at, y.from], [at, y.to]));
        shapes.push(text([at, y.from + 18.0], Anchor::Middle, GREY, tick.to_string()));
    }
    for tick in y.ticks() {
        let at = y.at(tick);
        shapes.push(rule([x.from, at], [x.to, at]));
        shapes.push(text([x.from - 8.0, at + 4.5], Anchor::End, GREY, format!("{tick:.1}")));
    }
    let seconds = Text::new([0.5 * (x.from + x.to), y.from + 42.0], "seconds per reconstruction");
    shapes.push(Shape::Text(Text { anchor: Anchor::Middle, ..seconds }));
    let psnr = Text::new([18.0, 0.5 * (y.from + y.to)], "PSNR of the test views, dB");
    shapes.push(Shape::Text(Text { anchor: Anchor::Middle, direction: Direction::Up, ..psnr }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_axis() {
        let x = Axis { low: 0.3, high: 40.0, from: 0.0, to: 100.0, is_log: true };
        assert_eq!(x.ticks(), [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]);
        assert!(x.at(0.3).abs() < 1e-9 && (x.at(40.0) - 100.0).abs() < 1e-9);
        let y = Axis { low: 21.93, high: 24.1, from: 10.0, to: 0.0, is_log: false };
        assert_eq!(y.ticks().len(), 5);
        assert!((y.ticks()[0] - 22.0).abs() < 1e-9 && (y.at(21.93) - 10.0).abs() < 1e-9);
    }
}
