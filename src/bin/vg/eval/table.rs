//! The numbers as a table for people.

use super::measure::Measured;

/// Heading of each column.
const HEADINGS: [&str; 14] = [
    "scene",
    "split",
    "prior",
    "PSNR dB",
    "SSIM",
    "PSNR box",
    "IoU",
    "depth MAE m",
    "in. PSNR dB",
    "in. depth MAE m",
    "p90",
    "reconstruct s",
    "render ms",
    "Gaussians",
];

/// Columns of words are aligned left, columns of numbers right.
const WORDS: usize = 3;

/// Columns that are shown only where one of the rows has a number for them.
const OPTIONAL: std::ops::Range<usize> = 8..11;

/// What stands for no number.
const NONE: &str = "-";

/// Rows of cells below the headings.
pub(crate) struct Table(Vec<[String; HEADINGS.len()]>);

impl Table {
    /// With no rows yet.
    pub(crate) fn new() -> Self {
        Self(vec![HEADINGS.map(Into::into)])
    }

    /// One split, or the mean.
    pub(crate) fn push(&mut self, scene: &str, split: &str, m: &Measured) {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| NONE.into(), |v| format!("{v:.digits$}"))
        };
        self.0.push([
            scene.into(),
            split.into(),
            m.prior.clone(),
            number(Some(m.errors.psnr_db), 3),
            number(m.errors.ssim, 4),
            number(m.errors.psnr_box_db, 3),
            number(Some(m.errors.silhouette_iou), 4),
            number(m.errors.depth_mae_m, 4),
            number(m.input_psnr_db, 3),
            number(m.input_depth_mae_m, 4),
            number(m.input_depth_p90_m, 4),
            number(Some(m.reconstruct_ms / 1e3), 3),
            number(Some(m.render_ms), 2),
            format!("{:.0}", m.gaussians),
        ]);
    }

    /// Lines without trailing spaces.
    pub(crate) fn text(&self) -> String {
        let is_shown =
            |column: &usize| !OPTIONAL.contains(column) || self.0[1..].iter().any(|row| row[*column] != NONE);
        let width = |column: usize| self.0.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let columns: Vec<(usize, usize)> =
            (0..HEADINGS.len()).filter(is_shown).map(|column| (column, width(column))).collect();
        let line = |row: &[String; HEADINGS.len()]| {
            let cells = columns.iter().map(|&(column, width)| {
                let cell = &row[column];
                if column < WORDS { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
            });
            cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        };
        self.0.iter().map(line).collect::<Vec<_>>().join("\n")
    }
}
