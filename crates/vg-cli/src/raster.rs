//! Rasterises a plot: SVG to PNG with the bundled font, so that every machine makes the same bytes.

use crate::job::{Failure, Result};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Pixels per unit of the SVG, for high-resolution screens.
const SCALE: f32 = 2.0;

/// Family name of the font.
const FONT: &str = "Noto Sans";

/// Draws an SVG of a known size on a transparent background. Characters that Noto Sans lacks are left out.
pub(crate) fn png(svg: &str) -> Result<Vec<u8>> {
    let broken = |why: String| Failure::job(format!("the plot cannot be drawn: {why}"));
    let mut options = Options { font_family: FONT.into(), ..Options::default() };
    let fonts = options.fontdb_mut();
    fonts.load_font_data(notosans::REGULAR_TTF.to_vec());
    fonts.set_sans_serif_family(FONT);

    let tree = Tree::from_str(svg, &options).map_err(|e| broken(e.to_string()))?;
    let size = tree.size().to_int_size().scale_by(SCALE).ok_or_else(|| broken("no size".into()))?;
    let mut picture = Pixmap::new(size.width(), size.height()).ok_or_else(|| broken("too large".into()))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut picture.as_mut());
    picture.encode_png().map_err(|e| broken(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A word, or nothing, on white.
    fn drawn(word: &str) -> Vec<u8> {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 120 40\" font-family=\"sans-serif\" \
             font-size=\"13\"><rect width=\"120\" height=\"40\" fill=\"#ffffff\"/>\
             <text x=\"8\" y=\"26\">{word}</text></svg>"
        );
        png(&svg).unwrap()
    }

    /// Pixels darker than half.
    fn ink(png: &[u8]) -> usize {
        let picture = image::load_from_memory(png).unwrap().into_luma8();
        assert_eq!(picture.dimensions(), (240, 80));
        picture.pixels().filter(|p| p.0[0] < 128).count()
    }

    #[test]
    fn letters_are_drawn_at_twice_the_size() {
        let (none, few, more) = (ink(&drawn("")), ink(&drawn("dB")), ink(&drawn("PSNR, dB")));
        assert!(none == 0 && few > 50 && more > 2 * few, "{none}, {few}, {more} dark pixels");
    }

    #[test]
    fn the_same_plot_gives_the_same_bytes() {
        assert!(drawn("seconds per reconstruction") == drawn("seconds per reconstruction"));
    }

    #[test]
    fn invalid_svg_is_an_error() {
        assert!(png("<svg").unwrap_err().message.starts_with("the plot cannot be drawn: "));
    }
}
