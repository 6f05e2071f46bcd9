//! Measurements as tables.

use super::contest::Row;
use super::measure::Measured;
use crate::grid::{Column, Grid, number};
use crate::shown;
use Column::{Numbers, Rare, Words};
use vg::geometry::measures::Measure;
use vg::metrics::{SurfaceErrors, ViewErrors};

/// The column of a measure; `None` where a table leaves it out.
type ColumnOf = fn(&Measure) -> Option<Column>;

/// Columns of measures, and others behind some of them.
fn columns(measures: &[Measure], column_of: ColumnOf, behind: &[(&str, Column)]) -> Vec<Column> {
    let mut columns = Vec::new();
    for measure in measures {
        if let Some(column) = column_of(measure) {
            columns.push(column);
            columns.extend(behind.iter().filter(|other| other.0 == measure.name).map(|other| other.1));
        }
    }
    columns
}

/// The cells of those columns; without values, empty ones.
fn cells(
    measures: &[Measure],
    values: Option<Vec<Option<f64>>>,
    column_of: ColumnOf,
    behind: &[(&str, String)],
) -> Vec<String> {
    let values = values.unwrap_or_else(|| vec![None; measures.len()]);
    let mut cells = Vec::new();
    for (measure, value) in measures.iter().zip(values) {
        if column_of(measure).is_some() {
            cells.push(number(value, measure.digits.into()));
            cells.extend(behind.iter().filter(|other| other.0 == measure.name).map(|other| other.1.clone()));
        }
    }
    cells
}

fn of_view(measure: &Measure) -> Option<Column> {
    (!measure.title.is_empty()).then_some(Numbers(measure.title))
}

fn of_views_in_short(measure: &Measure) -> Option<Column> {
    match measure.name {
        "psnr_box_db" => None,
        "psnr_db" | "ssim" | "silhouette_iou" => Some(Numbers(measure.title)),
        _ => of_surface(measure),
    }
}

fn of_surface(measure: &Measure) -> Option<Column> {
    (!measure.title.is_empty()).then_some(Rare(measure.title))
}

/// A table with a row for each split and a row for the mean.
pub(crate) fn by_split<'a>(rows: impl IntoIterator<Item = (&'a str, &'a str, &'a Measured)>) -> Grid {
    let mut headings = vec![Words("scene"), Words("split"), Words("prior")];
    headings.extend(columns(ViewErrors::MEASURES, of_view, &[("ssim", Rare("LPIPS"))]));
    headings.extend(columns(SurfaceErrors::MEASURES, of_surface, &[]));
    headings.extend([
        Rare("in. PSNR dB"),
        Rare("in. depth MAE m"),
        Rare("p90"),
        Numbers("reconstruct s"),
        Numbers("render ms"),
        Numbers("Gaussians"),
    ]);
    let mut grid = Grid::new(&headings);
    for (scene, split, m) in rows {
        let mut row = vec![scene.to_owned(), split.to_owned(), m.prior.clone()];
        let lpips = ("ssim", number(m.lpips, 4));
        row.extend(cells(ViewErrors::MEASURES, Some(m.errors.values()), of_view, &[lpips]));
        row.extend(cells(SurfaceErrors::MEASURES, m.surface.map(|s| s.values()), of_surface, &[]));
        row.extend([
            number(m.input_psnr_db, 3),
            number(m.input_depth_mae_m, 4),
            number(m.input_depth_p90_m, 4),
            number(m.reconstruct_ms.map(|ms| ms / 1e3), 3),
            number(Some(m.render_ms), 2),
            format!("{:.0}", m.gaussians),
        ]);
        grid.push(row);
    }
    grid
}

/// A table with a row for each system. With `beside`, also the differences to the first row: dB, seconds, MiB.
pub(crate) fn by_system(rows: &[Row], beside: bool) -> Grid {
    let mut headings = vec![Words("system"), Numbers("splits")];
    let behind = [("psnr_db", Rare("+-")), ("ssim", Rare("LPIPS"))];
    headings.extend(columns(ViewErrors::MEASURES, of_views_in_short, &behind));
    headings.extend(columns(SurfaceErrors::MEASURES, of_surface, &[]));
    headings.extend([
        Rare("in. PSNR dB"),
        Numbers("seconds"),
        Rare("least"),
        Rare("most"),
        Rare("peak MiB"),
        Numbers("Gaussians"),
        Rare("dB more"),
        Rare("s more"),
        Rare("MiB more"),
    ]);
    let mut grid = Grid::new(&headings);
    let first = rows.first().filter(|_| beside);
    for row in rows {
        let m = row.mean.as_ref();
        let of = |get: &dyn Fn(&Measured) -> Option<f64>| m.and_then(get);
        let mib = |row: &Row| row.peak_bytes.map(|bytes| bytes as f64 / f64::from(1 << 20));
        let psnr = |row: &Row| row.mean.as_ref().map(|m| m.errors.psnr_db);
        let more = |get: &dyn Fn(&Row) -> Option<f64>| Some(get(row)? - get(first?)?);
        let mut numbers = vec![row.system.clone(), row.splits.to_string()];
        let behind =
            [("psnr_db", number(row.psnr_standard_error_db, 3)), ("ssim", number(of(&|m| m.lpips), 4))];
        let errors = m.map(|m| m.errors.values());
        numbers.extend(cells(ViewErrors::MEASURES, errors, of_views_in_short, &behind));
        let surface = m.and_then(|m| m.surface).map(|surface| surface.values());
        numbers.extend(cells(SurfaceErrors::MEASURES, surface, of_surface, &[]));
        numbers.extend([
            number(of(&|m| m.input_psnr_db), 3),
            number(row.seconds, 3),
            number(row.seconds_range.map(|r| r[0]), 3),
            number(row.seconds_range.map(|r| r[1]), 3),
            number(mib(row), 0),
            number(of(&|m| Some(m.gaussians)), 0),
            number(more(&psnr), 3),
            number(more(&|row| row.seconds), 3),
            number(more(&mib), 0),
        ]);
        grid.push(numbers);
    }
    grid
}

/// Reasons why rows have no numbers, one line each.
pub(crate) fn missing(rows: &[Row]) -> String {
    let lines = rows
        .iter()
        .flat_map(|row| row.missing.iter().map(|why| shown::line(&format!("{}: {why}", row.system))));
    lines.collect::<Vec<_>>().join("\n")
}
