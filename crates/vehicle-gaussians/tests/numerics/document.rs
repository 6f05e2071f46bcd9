//! Writes docs/NUMERICS.md from the tables of the tests, and checks that it equals them.

use crate::cases::{self, Case};
use crate::inputs;
use crate::measure::{self, Error, Figures};
use crate::properties;
use crate::refinement::{self, Outcome};
use std::fmt::Write;

/// Factor between figures of different processors, whose multiply-add or exp rounds differently.
const ANOTHER_PROCESSOR: f64 = 8.0;
/// Errors below this are rounding noise and count as equal.
const ROUNDING: f64 = 2e-7;

const HEAD: &str = "\
# Behaviour at numerical limits

Behaviour on stiff and extreme input: either an error that names the argument, or a finite result with a bounded distance from
the f64 reference (`render::Reference`). This page is written by
`crates/vehicle-gaussians/tests/numerics`, whose tests check each row against its bound and this page against the rows:

```text
VG_BLESS=1 cargo test --test numerics      writes this page
cargo test --test numerics                 fails if it differs, except in times
```

";

const SCENES: &str = "\
## Pictures and gradients

`CpuRenderer` (f32) against the reference (f64): largest error / root mean square. Colour is relative to the largest colour of
the picture (at least 1), depth is relative to itself (expected depth). Gradients are those of a loss with random weights on all
planes: the largest error of any entry, relative to the largest entry of its tensor, and the name of that tensor; then the same
for the f64 gradients against central differences of the f64 picture with its cuts held, 14 variables. Times are for one picture
with its gradients in the test build, with all tests running in parallel: they show which case is slow. `RENDERER.md` has the
speed of the renderer.

";

const LIMITS: &str = "\n\
Limits of the tests: colour and alpha 5e-6, depth 3e-6 of itself (f32 sums of tens of layers), gradients 1e-4 (f32 sums over
hundreds of pixels; expected depth divides the f32 step of depth, 5e-7 m at 5 m, by an alpha of down to 1/255), central
differences 1e-5 (fourth order in f64) for tensors that are large enough. The limit for the gradients of the veil is 1e-3: the
f32 step at 8 m is 1e-6 m, 2e-4 of its alpha. It is also 1e-3 for the stack of 1e5 (picture 1e-4, depth 1e-5), where T is a
product of up to 1,800 rounded factors. From 1e6 m the vehicle is 70 steps of f32 deep, and gradients of a loss on expected
depth have little meaning: place such a camera nearer, or use no depth.

";

const INPUTS: &str = "\
## Other input

The call, and its result or the text of its error.

";

const REFINEMENT: &str = "\
## Refinement

40 steps are planned on an ellipsoid of 4.4 x 1.8 x 1.4 m with four photographs of 48x36, depth given; rows that begin with
`a model` call `vg::refine::model` instead, with the same photographs. All results are finite, and no result is worse in its own
photographs than the initial model: if no step was better, `kept` is 0 and the initial model is returned.

";

const PROPERTIES: &str = "\
## Properties of every scene

Tested on random scenes (`proptest`, fixed seeds; `PROPTEST_RNG_SEED` and `PROPTEST_CASES` choose others and more). A tolerance
applies to colour, relative to the largest of the picture, and to alpha. Two pixels of a thousand, and at least one, may lie on
a cut (alpha < 1/255, T <= 1e-4) and differ by 1e-2.

";

const TAIL: &str = include_str!("tail.md");

fn page() -> String {
    let mut out = String::from(HEAD);
    out.push_str(SCENES);
    out.push_str("| condition | behaviour | colour | alpha | depth | gradient | f64 gradient | ms |\n");
    out.push_str("| --- | --- | --- | --- | --- | --- | --- | --- |\n");
    for (case, figures) in cases::all().iter().zip(measure::all()) {
        scene_row(&mut out, case, figures);
    }
    out.push_str(LIMITS);
    out.push_str(INPUTS);
    out.push_str("| condition | call | result |\n| --- | --- | --- |\n");
    for input in inputs::all() {
        let answer = match input.outcome() {
            Ok(words) => words,
            Err(words) => format!("error: `{words}`"),
        };
        let _ = writeln!(out, "| {} | `{}` | {} |", input.condition, input.call, answer.replace('|', "\\|"));
    }
    out.push('\n');
    out.push_str(REFINEMENT);
    out.push_str("| condition | stopped | made | kept | PSNR before, dB | after | ms |\n");
    out.push_str("| --- | --- | --- | --- | --- | --- | --- |\n");
    for (stiff, Outcome { refinement: done, ms, .. }) in refinement::all().iter().zip(refinement::outcomes())
    {
        let why = match done.stop {
            vg::refine::Stop::Done => "all steps made",
            vg::refine::Stop::Diverged => "diverged: loss above 3 times the initial one",
            vg::refine::Stop::HeldOut => "the held-out view did not improve",
            vg::refine::Stop::Unseen => "no view sees any of it",
        };
        let [before, after] = done.psnr_db;
        let _ = writeln!(
            out,
            "| {} | {why} | {} | {} | {before:.1} | {after:.1} | {ms:.0} |",
            stiff.condition, done.made, done.kept
        );
    }
    out.push('\n');
    out.push_str(PROPERTIES);
    out.push_str("| claim | tolerance | why |\n| --- | --- | --- |\n");
    for p in properties::ALL {
        let tolerance = p.tolerance.map_or("none".to_owned(), |t| format!("{t:.0e}"));
        let _ = writeln!(out, "| {} | {tolerance} | {} |", p.claim, p.why);
    }
    out.push('\n');
    out.push_str(TAIL);
    out
}

fn scene_row(out: &mut String, case: &Case, f: &Figures) {
    let pair =
        |e: Error| if e.max == 0.0 { "0".to_owned() } else { format!("{:.0e} / {:.0e}", e.max, e.rms) };
    let worst = |(error, tensor): (f64, &str)| {
        if error == 0.0 { "0".to_owned() } else { format!("{error:.0e} {tensor}") }
    };
    let _ = writeln!(
        out,
        "| {} | {} | {} | {} | {} | {} | {} | {:.1} |",
        case.condition,
        case.contract,
        pair(f.color),
        pair(f.alpha),
        pair(f.depth),
        worst(f.gradient),
        worst(f.differences),
        f.ms
    );
}

/// Whether two pages are equal: words exactly, figures within the difference between processors, times ignored.
fn same(found: &str, stored: &str) -> Result<(), String> {
    let (found, stored): (Vec<&str>, Vec<&str>) = (found.lines().collect(), stored.lines().collect());
    let mut timed = false;
    for (i, found) in found.iter().enumerate() {
        let Some(stored) = stored.get(i) else { return Err(format!("line {} is missing: {found}", i + 1)) };
        timed = found.starts_with('|') && (timed || found.ends_with("| ms |"));
        let cells = |line: &str| line.split('|').map(str::to_owned).collect::<Vec<String>>();
        let (mut a, mut b) = (cells(found), cells(stored));
        if timed && a.len() == b.len() && a.len() > 2 {
            // The time, and the text after the last bar.
            a.truncate(a.len() - 2);
            b.truncate(b.len() - 2);
        }
        let equal = a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| same_cell(a, b, timed));
        if !equal {
            return Err(format!("line {}\n  found  {found}\n  stored {stored}", i + 1));
        }
    }
    if stored.len() > found.len() {
        return Err(format!("line {} is too many: {}", found.len() + 1, stored[found.len()]));
    }
    Ok(())
}

/// Compares cells of figures (`3e-7 / 2e-8 means`, `31.4`) within tolerance, all others exactly. The name of the worst
/// tensor is not compared: a tie may go either way.
fn same_cell(a: &str, b: &str, measured: bool) -> bool {
    if a == b {
        return true;
    }
    let numbers =
        |cell: &str| cell.split_whitespace().filter_map(|w| w.parse::<f64>().ok()).collect::<Vec<f64>>();
    let starts_with_number = |cell: &str| cell.trim().starts_with(|c: char| c.is_ascii_digit());
    let (x, y) = (numbers(a), numbers(b));
    if !(measured && starts_with_number(a) && starts_with_number(b)) {
        return false;
    }
    // 0 is written once, without its mean square.
    let at = |v: &[f64], k: usize| v.get(k).copied().unwrap_or(0.0);
    (0..x.len().max(y.len())).all(|k| {
        let (x, y) = (at(&x, k), at(&y, k));
        let (small, large) = (x.min(y), x.max(y));
        if large >= 1.0 { large - small <= 0.5 } else { large <= ANOTHER_PROCESSOR * small.max(ROUNDING) }
    })
}

#[test]
fn docs_numerics_equals_the_results_of_the_tests() {
    let path = vg_testing::root().join("docs/NUMERICS.md");
    let found = page();
    if std::env::var_os("VG_BLESS").is_some() {
        std::fs::write(&path, &found).unwrap();
        return;
    }
    let stored = std::fs::read_to_string(&path).unwrap();
    if let Err(difference) = same(&found, &stored) {
        panic!(
            "docs/NUMERICS.md differs from the results of the tests; VG_BLESS=1 rewrites it\n{difference}"
        );
    }
}

#[test]
fn pages_are_compared_by_words_and_figures_but_not_by_times() {
    let table = |row: &str| format!("| a | error | ms |\n| --- | --- | --- |\n{row}\nend\n");
    let stored = table("| x | 3e-7 / 1e-7 means | 12 |");
    for (row, equal) in [
        ("| x | 3e-7 / 1e-7 means | 99 |", true),
        ("| x | 4e-7 / 2e-7 scales | 12 |", true),
        ("| x | 3e-5 / 1e-7 means | 12 |", false),
        ("| x | NaN / 1e-7 means | 12 |", false),
        ("| y | 3e-7 / 1e-7 means | 12 |", false),
    ] {
        assert_eq!(same(&table(row), &stored).is_ok(), equal, "{row}");
    }
    let words = "| a | answer |\n| --- | --- |\n| x | 12 Gaussians |\n";
    assert!(same(words, &words.replace("12", "13")).is_err());
    assert!(same(words, &format!("{words}more\n")).is_err());
}
