//! `vg pareto` on the sample.

use super::*;
use std::fs;

const SWEEP: &str = "pareto . --repeat 2 --csv {}/p.csv --svg {}/p.svg --png {}/p.png --json {}/p.json";

fn sweep(folder: &Path, points: &[&str]) -> Run {
    let mut words: Vec<String> =
        SWEEP.replace("{}", folder.to_str().unwrap()).split(' ').map(Into::into).collect();
    words.extend(["--with".into(), "--prior hull --symmetry always".into()]);
    points.iter().for_each(|point| words.extend(["--point".into(), (*point).into()]));
    vg(&words)
}

#[test]
fn a_sweep_gives_a_table_a_plot_and_the_front() {
    let folder = tempfile::tempdir().unwrap();
    let run = sweep(folder.path(), &["", "coarse, \"half\": --resolution 0.5", "--max-views 1"]);
    assert_eq!((run.code, run.err.as_str()), (0, ""));
    assert_eq!(run.out.lines().count(), 4, "{}", run.out);
    let rows = json(&folder.path().join("p.json"))["points"].as_array().unwrap().clone();
    let names: Vec<&str> = rows.iter().map(|r| r["system"].as_str().unwrap()).collect();
    assert_eq!(names, ["default", "coarse, \"half\"", "--max-views 1"]);
    for row in &rows {
        let number = |key: &str| row[key].as_f64().unwrap();
        let range: Vec<f64> =
            row["seconds_range"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        assert!(range[0] <= number("seconds") && number("seconds") <= range[1] && range[0] > 0.0, "{row}");
        assert!(number("input_psnr_db") > number("psnr_db") && number("input_ssim") > 0.5, "{row}");
    }
    // The point with the smallest error is on the front; which one is the fastest depends on the machine.
    let best =
        rows.iter().max_by(|a, b| a["psnr_db"].as_f64().unwrap().total_cmp(&b["psnr_db"].as_f64().unwrap()));
    assert_eq!(best.unwrap()["on_front"], true);
    let csv = fs::read_to_string(folder.path().join("p.csv")).unwrap();
    assert!(csv.starts_with("point,seconds,") && csv.contains("\"coarse, \"\"half\"\"\""), "{csv}");
    let svg = fs::read_to_string(folder.path().join("p.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && svg.matches("<circle").count() == 3);
    let png = image::open(folder.path().join("p.png")).unwrap();
    assert!(png.width() > 800 && png.height() > 400);
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
}

#[test]
fn an_invalid_point_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (point, cause) in [
        ("fast: --no-such-thing", "--point \"fast: --no-such-thing\": unexpected argument"),
        ("--sh-degree 9", "--sh-degree"),
        ("--prior onnx", "--prior-model"),
    ] {
        let run = sweep(folder.path(), &[point]);
        assert!(run.code == 2 && run.out.is_empty() && run.err.contains(cause), "{run:?}");
        assert_one_error(&run);
    }
}
