//! Tables of numbers: for a terminal, as Markdown, as CSV.

use crate::shown;

/// Placeholder for a missing number.
const NONE: &str = "-";

/// Heading and kind of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Column {
    /// Words, aligned to the left.
    Words(&'static str),
    /// Numbers, aligned to the right.
    Numbers(&'static str),
    /// Numbers; the column is shown only if a row has one.
    Rare(&'static str),
}

impl Column {
    fn heading(self) -> &'static str {
        match self {
            Self::Words(heading) | Self::Numbers(heading) | Self::Rare(heading) => heading,
        }
    }
}

/// A table: headings and rows of cells.
pub(crate) struct Grid {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

/// A number as a cell.
pub(crate) fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| NONE.into(), |v| format!("{v:.digits$}"))
}

impl Grid {
    /// A table without rows.
    pub(crate) fn new(columns: &[Column]) -> Self {
        Self { columns: columns.to_vec(), rows: Vec::new() }
    }

    /// Appends a row with a cell for each column, each one line of text.
    pub(crate) fn push(&mut self, cells: impl Into<Vec<String>>) {
        let cells: Vec<String> = cells.into().iter().map(|cell| shown::line(cell)).collect();
        debug_assert_eq!(cells.len(), self.columns.len());
        self.rows.push(cells);
    }

    /// Indices of the columns that are shown.
    fn shown(&self) -> Vec<usize> {
        let has_any = |c: usize| self.rows.iter().any(|row| row[c] != NONE);
        let is_shown = |&c: &usize| !matches!(self.columns[c], Column::Rare(_)) || has_any(c);
        (0..self.columns.len()).filter(is_shown).collect()
    }

    /// The headings, then the rows.
    fn lines(&self) -> impl Iterator<Item = Vec<&str>> {
        let headings = self.columns.iter().map(|column| column.heading()).collect();
        std::iter::once(headings).chain(self.rows.iter().map(|row| row.iter().map(String::as_str).collect()))
    }

    /// The table as text without trailing spaces; empty if there are no rows.
    pub(crate) fn text(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let shown = self.shown();
        let width = |c: usize| self.lines().map(|line| line[c].chars().count()).max().unwrap_or(0);
        let columns: Vec<(usize, usize)> = shown.into_iter().map(|c| (c, width(c))).collect();
        let line = |cells: Vec<&str>| {
            let cells = columns.iter().map(|&(c, width)| match self.columns[c] {
                Column::Words(_) => format!("{:<width$}", cells[c]),
                _ => format!("{:>width$}", cells[c]),
            });
            cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        };
        self.lines().map(line).collect::<Vec<_>>().join("\n")
    }

    /// The table as Markdown, with the columns that [`Grid::text`] shows.
    pub(crate) fn markdown(&self) -> String {
        let shown = self.shown();
        let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut lines = self.lines();
        let escaped = |text: &str| text.replace('|', "\\|");
        let cells = |line: Vec<&str>| row(shown.iter().map(|&c| escaped(line[c])).collect());
        let headings = lines.next().map(cells).unwrap_or_default();
        let rule = shown.iter().map(|&c| match self.columns[c] {
            Column::Words(_) => "---".to_owned(),
            _ => "---:".to_owned(),
        });
        let rule = row(rule.collect());
        headings + &rule + &lines.map(cells).collect::<String>()
    }

    /// The table as comma-separated values, all columns; a missing number is an empty cell.
    pub(crate) fn csv(&self) -> String {
        let quoted = |text: &str| {
            let plain = !text.contains([',', '"', '\n', '\r']);
            if plain { text.to_owned() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
        };
        let cell = |text: &str| if text == NONE { String::new() } else { quoted(text) };
        let line = |line: Vec<&str>| line.into_iter().map(cell).collect::<Vec<_>>().join(",") + "\n";
        self.lines().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_aligned_and_leaves_out_columns_without_numbers() {
        let mut grid = Grid::new(&[Column::Words("a"), Column::Numbers("number"), Column::Rare("rare")]);
        assert_eq!((grid.text(), grid.csv()), (String::new(), "a,number,rare\n".into()));
        grid.push(["x, y".into(), number(Some(1.25), 1), number(None, 3)]);
        grid.push(["z|".into(), number(None, 1), number(None, 3)]);
        assert_eq!(grid.text(), "a     number\nx, y     1.2\nz|         -");
        assert_eq!(grid.markdown(), "| a | number |\n| --- | ---: |\n| x, y | 1.2 |\n| z\\| | - |\n");
        assert_eq!(grid.csv(), "a,number,rare\n\"x, y\",1.2,\nz|,,\n");
    }

    #[test]
    fn control_characters_are_escaped_in_every_kind_of_table() {
        let mut grid = Grid::new(&[Column::Words("a")]);
        grid.push(["x\u{1b}[2J\ny".into()]);
        assert_eq!(grid.text(), "a\nx\\u{1b}[2J\\ny");
        assert_eq!(grid.markdown(), "| a |\n| --- |\n| x\\u{1b}[2J\\ny |\n");
        assert_eq!(grid.csv(), "a\nx\\u{1b}[2J\\ny\n");
    }
}
