//! Measurements as tables.

use super::contest::Row;
use super::measure::Measured;
use crate::grid::{Column, Grid, number};
use crate::shown;
use Column::{Numbers, Rare, Words};

/// A table with a row for each split and a row for the mean.
pub(crate) fn by_split<'a>(rows: impl IntoIterator<Item = (&'a str, &'a str, &'a Measured)>) -> Grid {
    let mut grid = Grid::new(&[
        Words("scene"),
        Words("split"),
        Words("prior"),
        Numbers("PSNR dB"),
        Numbers("SSIM"),
        Rare("LPIPS"),
        Numbers("PSNR box"),
        Numbers("IoU"),
        Numbers("depth MAE m"),
        Rare("Chamfer m"),
        Rare("F 5 cm"),
        Rare("length %"),
        Rare("width %"),
        Rare("height %"),
        Rare("in. PSNR dB"),
        Rare("in. depth MAE m"),
        Rare("p90"),
        Numbers("reconstruct s"),
        Numbers("render ms"),
        Numbers("Gaussians"),
    ]);
    for (scene, split, m) in rows {
        let [chamfer, f_score, length, width, height] = surface(m);
        grid.push([
            scene.into(),
            split.into(),
            m.prior.clone(),
            number(Some(m.errors.psnr_db), 3),
            number(m.errors.ssim, 4),
            number(m.lpips, 4),
            number(m.errors.psnr_box_db, 3),
            number(Some(m.errors.silhouette_iou), 4),
            number(m.errors.depth_mae_m, 4),
            chamfer,
            f_score,
            length,
            width,
            height,
            number(m.input_psnr_db, 3),
            number(m.input_depth_mae_m, 4),
            number(m.input_depth_p90_m, 4),
            number(m.reconstruct_ms.map(|ms| ms / 1e3), 3),
            number(Some(m.render_ms), 2),
            format!("{:.0}", m.gaussians),
        ]);
    }
    grid
}

/// A table with a row for each system. With `beside`, also the differences to the first row: dB, seconds, MiB.
pub(crate) fn by_system(rows: &[Row], beside: bool) -> Grid {
    let mut grid = Grid::new(&[
        Words("system"),
        Numbers("splits"),
        Numbers("PSNR dB"),
        Rare("+-"),
        Numbers("SSIM"),
        Rare("LPIPS"),
        Numbers("IoU"),
        Rare("depth MAE m"),
        Rare("Chamfer m"),
        Rare("F 5 cm"),
        Rare("length %"),
        Rare("width %"),
        Rare("height %"),
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
    let first = rows.first().filter(|_| beside);
    for row in rows {
        let m = row.mean.as_ref();
        let of = |get: &dyn Fn(&Measured) -> Option<f64>| m.and_then(get);
        let mib = |row: &Row| row.peak_bytes.map(|bytes| bytes as f64 / f64::from(1 << 20));
        let psnr = |row: &Row| row.mean.as_ref().map(|m| m.errors.psnr_db);
        let more = |get: &dyn Fn(&Row) -> Option<f64>| Some(get(row)? - get(first?)?);
        let [chamfer, f_score, length, width, height] =
            m.map_or_else(|| [(); 5].map(|()| number(None, 0)), surface);
        grid.push([
            row.system.clone(),
            row.splits.to_string(),
            number(psnr(row), 3),
            number(row.psnr_standard_error_db, 3),
            number(of(&|m| m.errors.ssim), 4),
            number(of(&|m| m.lpips), 4),
            number(of(&|m| Some(m.errors.silhouette_iou)), 4),
            number(of(&|m| m.errors.depth_mae_m), 4),
            chamfer,
            f_score,
            length,
            width,
            height,
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
    }
    grid
}

/// Chamfer distance, F-score, and errors of length, width and height.
fn surface(m: &Measured) -> [String; 5] {
    let of =
        |get: fn(&vg::metrics::SurfaceErrors) -> f64, digits| number(m.surface.as_ref().map(get), digits);
    [
        of(|s| s.chamfer_m, 4),
        of(|s| s.f_score, 3),
        of(|s| s.length_error_percent, 2),
        of(|s| s.width_error_percent, 2),
        of(|s| s.height_error_percent, 2),
    ]
}

/// Reasons why rows have no numbers, one line each.
pub(crate) fn missing(rows: &[Row]) -> String {
    let lines = rows
        .iter()
        .flat_map(|row| row.missing.iter().map(|why| shown::line(&format!("{}: {why}", row.system))));
    lines.collect::<Vec<_>>().join("\n")
}
