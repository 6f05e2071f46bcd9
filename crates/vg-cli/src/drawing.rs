//! A drawing of lines, dots and text on white, as SVG; `raster` makes a PNG of it.

use crate::shown;
use std::fmt::Write;

/// Red, green and blue, sRGB.
pub(crate) type Color = [u8; 3];

/// Radius of a dot.
pub(crate) const DOT: f64 = 4.0;

/// Width of lines that are straight up or level, and of those that join points.
pub(crate) const THIN: f64 = 1.0;
pub(crate) const THICK: f64 = 1.5;

const BLACK: Color = [0; 3];

/// Lengths are pixels of a screen, places (right, down) from the top-left corner.
pub(crate) struct Drawing {
    /// Width and height.
    pub(crate) size: [f64; 2],
    /// The last one lies on top.
    pub(crate) shapes: Vec<Shape>,
}

pub(crate) enum Shape {
    /// Lines from end to end, [`THIN`], each straight up or level.
    Rules {
        ends: Vec<[[f64; 2]; 2]>,
        color: Color,
        opacity: f64,
    },
    /// A line from point to point, [`THICK`].
    Path {
        points: Vec<[f64; 2]>,
        color: Color,
    },
    /// A filled circle.
    Dot {
        center: [f64; 2],
        color: Color,
    },
    Text(Text),
}

pub(crate) struct Text {
    /// Where its baseline begins, or the point of it that `anchor` says.
    pub(crate) at: [f64; 2],
    pub(crate) anchor: Anchor,
    pub(crate) direction: Direction,
    pub(crate) font: Font,
    pub(crate) color: Color,
    /// Characters that are no text are shown as escapes.
    pub(crate) text: String,
}

/// Which point of a text is given.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// Which way a text runs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    Right,
    Up,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Font {
    Body,
    Heading,
}

impl Text {
    /// Black, in the font of the body, from `at` to the right.
    pub(crate) fn new(at: [f64; 2], text: impl Into<String>) -> Self {
        let (anchor, direction, font) = (Anchor::Start, Direction::Right, Font::Body);
        Self { at, anchor, direction, font, color: BLACK, text: text.into() }
    }
}

impl Drawing {
    /// The drawing as a document.
    pub(crate) fn svg(&self) -> String {
        let [width, height] = self.size;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
             font-size=\"13\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
        );
        for shape in &self.shapes {
            shape.write(&mut out);
        }
        out.push_str("</svg>\n");
        out
    }
}

impl Shape {
    fn write(&self, out: &mut String) {
        // Writing to a string cannot fail.
        let _ = match self {
            Self::Rules { ends, color, opacity } => {
                let line = |[[x0, y0], [x1, y1]]: &[[f64; 2]; 2]| {
                    if x0 == x1 {
                        format!("M{x0:.1} {y0:.1}V{y1:.1}")
                    } else {
                        format!("M{x0:.1} {y0:.1}H{x1:.1}")
                    }
                };
                let lines: String = ends.iter().map(line).collect();
                let opacity =
                    if *opacity < 1.0 { format!(" stroke-opacity=\"{opacity}\"") } else { String::new() };
                writeln!(out, "<path d=\"{lines}\" stroke=\"{}\"{opacity}/>", hex(*color))
            }
            Self::Path { points, color } => {
                let places: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
                writeln!(
                    out,
                    "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{THICK}\"/>",
                    places.join(" "),
                    hex(*color)
                )
            }
            Self::Dot { center: [x, y], color } => {
                writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{DOT}\" fill=\"{}\"/>", hex(*color))
            }
            Self::Text(text) => text.write(out),
        };
    }
}

impl Text {
    fn write(&self, out: &mut String) -> std::fmt::Result {
        let [x, y] = self.at;
        match self.direction {
            Direction::Right => write!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\"")?,
            Direction::Up => write!(out, "<text transform=\"translate({x:.1} {y:.1}) rotate(-90)\"")?,
        }
        if self.font == Font::Heading {
            out.push_str(" font-size=\"16\"");
        }
        out.push_str(match self.anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        });
        if self.color != BLACK {
            write!(out, " fill=\"{}\"", hex(self.color))?;
        }
        let text = shown::line(&self.text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        writeln!(out, ">{text}</text>")
    }
}

fn hex([red, green, blue]: Color) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_the_picture() {
        let text = Shape::Text(Text::new([1.0, 2.5], "a<b>&\u{1b}\n"));
        let svg = Drawing { size: [10.0, 20.0], shapes: vec![text] }.svg();
        assert!(svg.contains("<text x=\"1.0\" y=\"2.5\">a&lt;b&gt;&amp;\\u{1b}\\n</text>\n"), "{svg}");
    }
}
