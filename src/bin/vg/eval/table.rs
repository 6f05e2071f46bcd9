//! The numbers as a table for people.

use super::measure::Measured;

/// Heading of each column.
const HEADINGS: [&str; 11] = [
    "scene",
    "split",
    "prior",
    "PSNR dB",
    "SSIM",
    "PSNR box",
    "IoU",
    "depth MAE m",
    "reconstruct s",
    "render ms",
    "Gaussians",
];

/// Columns of words are aligned left, columns of numbers right.
const WORDS: usize = 3;

/// Rows of cells below the headings.
pub(crate) struct Table(Vec<[String; HEADINGS.len()]>);

impl Table {
    /// With no rows yet.
    pub(crate) fn new() -> Self {
        Self(vec![HEADINGS.map(Into::into)])
    }

    /// One split, or the mean.
    pub(crate) fn push(&mut self, scene: &str, split: &str, m: &Measured) {
        let number =
            |value: Option<f64>, digits: usize| value.map_or_else(|| "-".into(), |v| format!("{v:.digits$}"));
        // The test views' depth if they have any, else the inputs'.
        let depth = match (m.errors.depth_mae_m, m.input_depth_mae_m) {
            (None, Some(input)) => format!("{input:.4} (in)"),
            (test, _) => number(test, 4),
        };
        self.0.push([
            scene.into(),
            split.into(),
            m.prior.clone(),
            number(Some(m.errors.psnr_db), 3),
            number(m.errors.ssim, 4),
            number(m.errors.psnr_box_db, 3),
            number(Some(m.errors.silhouette_iou), 4),
            depth,
            number(Some(m.reconstruct_ms / 1e3), 3),
            number(Some(m.render_ms), 2),
            format!("{:.0}", m.gaussians),
        ]);
    }

    /// Lines without trailing spaces.
    pub(crate) fn text(&self) -> String {
        let width = |column: usize| self.0.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: [usize; HEADINGS.len()] = std::array::from_fn(width);
        let line = |row: &[String; HEADINGS.len()]| {
            let cells = row.iter().zip(widths).enumerate().map(|(column, (cell, width))| {
                if column < WORDS { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
            });
            cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        };
        self.0.iter().map(line).collect::<Vec<_>>().join("\n")
    }
}
