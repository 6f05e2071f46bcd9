//! The page itself: self-contained HTML, with nothing for a browser to fetch.

use super::chart;
use super::compare::{self, Compared, Role};
use super::facts;
use super::pictures::{self, Picture};
use super::text::{decimals, escaped, ms, psnr};
use crate::reconstruct::verdict;
use crate::shown;
use std::fmt::{self, Write};
use vg::metrics::ViewErrors;
use vg::pipeline::{CheckedView, InputError, Report};

/// Contents of the page.
pub(super) struct Run<'a> {
    pub(super) vehicle: String,
    /// Description of the input and test views.
    pub(super) chosen: &'a str,
    pub(super) inputs: &'a [Compared],
    /// Test views; empty where all views are inputs.
    pub(super) tests: &'a [Compared],
    pub(super) turntable: Picture,
    pub(super) report: &'a Report,
    /// Counts from photographs to Gaussians.
    pub(super) counts: &'a [(&'static str, usize)],
    pub(super) warnings: &'a [String],
    /// Command that makes this page again.
    pub(super) command: String,
}

/// The whole page.
pub(super) fn html(run: &Run) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = write(&mut out, run);
    out
}

fn write(out: &mut String, run: &Run) -> fmt::Result {
    let vehicle = escaped(&run.vehicle);
    // The policy makes browsers block every request of the page.
    write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
         style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>{vehicle}: reconstruction report</title>\n\
         <style>\n{}</style>\n</head>\n<body>\n",
        include_str!("style.css")
    )?;
    header(out, run, &vehicle)?;
    out.push_str("<main>\n");
    inputs(out, run.inputs)?;
    if !run.tests.is_empty() {
        tests(out, run.tests)?;
    }
    turntable(out, &run.turntable)?;
    let report = run.report;
    write!(
        out,
        "<section id=\"time\">\n<h2>Time per stage</h2>\n{}\n</section>\n",
        chart::stages(&report.stages, report.total_ms)
    )?;
    counts(out, run)?;
    details(out, report)?;
    settings(out, run)?;
    write!(out, "</main>\n<script>\n{}</script>\n</body>\n</html>\n", include_str!("script.js"))
}

/// The vehicle's name and the main figures.
fn header(out: &mut String, run: &Run, vehicle: &str) -> fmt::Result {
    let report = run.report;
    write!(out, "<header>\n<h1>{vehicle}</h1>\n<p>{}</p>\n<dl class=\"headline\">\n", escaped(run.chosen))?;
    let mut figure = |name: &str, value: &str| writeln!(out, "<div><dt>{name}</dt><dd>{value}</dd></div>");
    let (judged, what) = match run.tests {
        [] => (run.inputs, "input view"),
        tests => (tests, "unseen view"),
    };
    if let Some(mean) = compare::mean(judged) {
        let views = shown::counted(judged.len(), what);
        figure(&format!("PSNR, {views}"), &format!("{} dB", psnr(mean.psnr_db)))?;
        figure("SSIM", &decimals(mean.ssim, 3))?;
        figure("silhouette IoU", &decimals(Some(mean.silhouette_iou), 3))?;
    }
    figure("verdict", verdict(report.verdict))?;
    figure("reconstruction time", &format!("{:.2} s", report.total_ms / 1e3))?;
    let mut times: Vec<f64> = judged.iter().map(|one| one.render_ms).collect();
    times.sort_by(f64::total_cmp);
    if let Some(median) = times.get(times.len() / 2) {
        figure("render time", &ms(*median))?;
    }
    figure("Gaussians", &shown::count(report.gaussians))?;
    if let Some(extent) = &report.extent_m {
        figure("length, width, height", &shown::extent(extent))?;
    }
    out.push_str("</dl>\n");
    if !run.warnings.is_empty() {
        out.push_str("<ul class=\"warnings\">\n");
        for warning in run.warnings {
            writeln!(out, "<li>{}</li>", escaped(warning))?;
        }
        out.push_str("</ul>\n");
    }
    out.push_str("</header>\n");
    Ok(())
}

fn inputs(out: &mut String, all: &[Compared]) -> fmt::Result {
    write!(
        out,
        "<section id=\"inputs\">\n<h2>Input views</h2>\n\
         <p>Each photograph, masked, on white, next to a render of the model from its camera.{}</p>\n\
         <div class=\"pairs\">\n",
        selection(all, Role::Input)
    )?;
    for (one, shown) in shown(all) {
        let name = escaped(&one.name);
        writeln!(
            out,
            "<figure class=\"view\">\n<figcaption>{}</figcaption>\n<div class=\"two\">",
            caption(one)
        )?;
        image(out, &shown.photograph, "", &format!("Photograph {name} on white"))?;
        image(out, &shown.render, "", &format!("Render from the camera of {name}"))?;
        out.push_str("</div>\n</figure>\n");
    }
    out.push_str("</div>\n");
    numbers(out, all)?;
    out.push_str("</section>\n");
    Ok(())
}

fn tests(out: &mut String, all: &[Compared]) -> fmt::Result {
    write!(
        out,
        "<section id=\"tests\">\n<h2>The unseen side</h2>\n\
         <p>Views that the method did not use: the photograph on white, the model rendered on white, and their \
         difference.{}</p>\n",
        selection(all, Role::Test)
    )?;
    legend(out)?;
    for (one, shown) in shown(all) {
        let name = escaped(&one.name);
        writeln!(
            out,
            "<figure class=\"view\">\n<figcaption>{}</figcaption>\n<div class=\"three\">",
            caption(one)
        )?;
        image(out, &shown.photograph, "photograph", &format!("Photograph {name} on white"))?;
        image(out, &shown.render, "model", &format!("Render from the camera of {name}"))?;
        if let Some(error) = &shown.error {
            image(out, error, "difference", &format!("Difference of photograph and model in {name}"))?;
        }
        out.push_str("</div>\n</figure>\n");
    }
    numbers(out, all)?;
    out.push_str("</section>\n");
    Ok(())
}

/// Sentence for a section that does not show all views.
fn selection(all: &[Compared], role: Role) -> String {
    let (n, most) = (all.len(), role.most());
    if n <= most {
        return String::new();
    }
    format!(" {most} of {n} views are shown, evenly spaced; the numbers below cover all views.")
}

fn shown(all: &[Compared]) -> impl Iterator<Item = (&Compared, &compare::Shown)> {
    all.iter().filter_map(|one| Some((one, one.shown.as_ref()?)))
}

/// The view's name and its main numbers.
fn caption(one: &Compared) -> String {
    let ViewErrors { psnr_db, ssim, silhouette_iou, .. } = one.errors;
    format!(
        "<b>{}</b> <span>PSNR {} dB</span> <span>SSIM {}</span> <span>IoU {silhouette_iou:.3}</span>",
        escaped(&one.name),
        psnr(psnr_db),
        decimals(ssim, 3)
    )
}

/// A picture with its label below it, if any.
fn image(out: &mut String, picture: &Picture, label: &str, alt: &str) -> fmt::Result {
    let Picture { data, width, height } = picture;
    write!(out, "<div><img src=\"{data}\" width=\"{width}\" height=\"{height}\" alt=\"{alt}\">")?;
    if !label.is_empty() {
        write!(out, "<small>{label}</small>")?;
    }
    out.push_str("</div>\n");
    Ok(())
}

/// The scale of the differences.
fn legend(out: &mut String) -> fmt::Result {
    let colors = pictures::ERROR_COLORS.map(|[r, g, b]| format!("rgb({r},{g},{b})")).join(",");
    writeln!(
        out,
        "<div class=\"legend\"><span>0</span><span class=\"scale\" role=\"img\" \
         aria-label=\"Colours of the difference, from white to dark\" \
         style=\"background:linear-gradient(90deg,{colors})\"></span><span>{:.0} % and more</span>\
         <small>absolute difference, mean over red, green and blue, 100 % from black to white; all pages use this \
         scale</small></div>",
        100.0 * pictures::ERROR_MOST
    )
}

/// Table of the numbers of all views. Columns without a number are left out.
fn numbers(out: &mut String, all: &[Compared]) -> fmt::Result {
    type Column = (&'static str, fn(&ViewErrors) -> String, fn(&ViewErrors) -> bool);
    let columns: [Column; 6] = [
        ("PSNR, dB", |e| psnr(e.psnr_db), |_| true),
        ("SSIM", |e| decimals(e.ssim, 4), |e| e.ssim.is_some()),
        (
            "PSNR in the mask's box, dB",
            |e| e.psnr_box_db.map_or("–".into(), psnr),
            |e| e.psnr_box_db.is_some(),
        ),
        ("silhouette IoU", |e| decimals(Some(e.silhouette_iou), 4), |_| true),
        (
            "mean depth error, cm",
            |e| decimals(e.depth_mae_m.map(|m| 100.0 * m), 1),
            |e| e.depth_mae_m.is_some(),
        ),
        (
            "its 90th percentile, cm",
            |e| decimals(e.depth_p90_m.map(|m| 100.0 * m), 1),
            |e| e.depth_p90_m.is_some(),
        ),
    ];
    let columns: Vec<&Column> =
        columns.iter().filter(|(_, _, has)| all.iter().any(|one| has(&one.errors))).collect();
    out.push_str("<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">view</th>");
    for (name, ..) in &columns {
        write!(out, "<th scope=\"col\">{name}</th>")?;
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    let mut row = |name: &str, errors: &ViewErrors| {
        write!(out, "<tr><th scope=\"row\">{name}</th>")?;
        for (_, text, _) in &columns {
            write!(out, "<td>{}</td>", text(errors))?;
        }
        writeln!(out, "</tr>")
    };
    for one in all {
        row(&escaped(&one.name), &one.errors)?;
    }
    if let Some(mean) = compare::mean(all).filter(|_| all.len() > 1) {
        row("mean", &mean)?;
    }
    out.push_str("</tbody>\n</table></div>\n");
    Ok(())
}

/// The turntable. The script finds it by class; without scripts the first picture is shown.
fn turntable(out: &mut String, strip: &Picture) -> fmt::Result {
    let (n, height) = (pictures::FRAMES, strip.height / pictures::FRAMES);
    write!(
        out,
        "<section id=\"around\">\n<h2>All around</h2>\n<div class=\"turntable\">\n\
         <div class=\"window\" style=\"aspect-ratio:{}/{height}\"><img src=\"{}\" width=\"{}\" height=\"{}\" \
         alt=\"The model from all around, {n} pictures\" draggable=\"false\"></div>\n\
         <div class=\"controls\" hidden><button type=\"button\">Play</button>\
         <input type=\"range\" min=\"0\" max=\"{}\" value=\"0\" aria-label=\"Direction of view\"></div>\n\
         </div>\n</section>\n",
        strip.width,
        strip.data,
        strip.width,
        strip.height,
        n - 1
    )
}

/// Counts after each step, and what was left out.
fn counts(out: &mut String, run: &Run) -> fmt::Result {
    out.push_str("<section id=\"counts\">\n<h2>From pixels to Gaussians</h2>\n<div class=\"scroll\"><table>\n<tbody>\n");
    for (name, count) in run.counts {
        writeln!(out, "<tr><th scope=\"row\">{name}</th><td>{}</td></tr>", shown::count(*count))?;
    }
    out.push_str("</tbody>\n</table></div>\n<h3>Left out</h3>\n");
    if run.report.left_out.is_empty() {
        out.push_str("<p>Nothing.</p>\n");
    } else {
        out.push_str(
            "<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">item</th><th scope=\"col\">count</th>\
             <th scope=\"col\" class=\"words\">reason</th></tr></thead>\n<tbody>\n",
        );
        for left in &run.report.left_out {
            writeln!(
                out,
                "<tr><th scope=\"row\">{}</th><td>{}</td><td class=\"words\">{}</td></tr>",
                escaped(&left.what),
                shown::count(left.count),
                escaped(&left.why)
            )?;
        }
        out.push_str("</tbody>\n</table></div>\n");
    }
    out.push_str("</section>\n");
    Ok(())
}

/// Findings of the stages.
fn details(out: &mut String, report: &Report) -> fmt::Result {
    out.push_str("<section id=\"facts\">\n<h2>Details of the stages</h2>\n<div class=\"parts\">\n");
    for part in facts::parts(report) {
        writeln!(out, "<div class=\"part\">\n<h3>{}</h3>\n<dl>", part.heading)?;
        for (name, value) in part.rows {
            writeln!(out, "<div><dt>{name}</dt><dd>{}</dd></div>", escaped(&value))?;
        }
        out.push_str("</dl>\n</div>\n");
    }
    out.push_str("</div>\n");
    checked(out, &report.input_views)?;
    out.push_str("</section>\n");
    Ok(())
}

/// Result of the method's own check in each input view.
fn checked(out: &mut String, views: &[CheckedView]) -> fmt::Result {
    if views.is_empty() {
        return Ok(());
    }
    out.push_str("<h3>Check of each input view, with the camera as used and as given</h3>\n");
    out.push_str("<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">view</th>");
    for name in ["PSNR, dB", "as given", "silhouette IoU", "as given", "mask covered, %", "as given"] {
        write!(out, "<th scope=\"col\">{name}</th>")?;
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for CheckedView { name, errors, by_given_camera } in views {
        write!(out, "<tr><th scope=\"row\">{}</th>", escaped(name))?;
        let columns: [fn(&InputError) -> String; 3] = [
            |e| psnr(e.psnr_db),
            |e| decimals(Some(e.silhouette_iou), 4),
            |e| decimals(Some(100.0 * e.mask_covered), 1),
        ];
        for text in columns {
            write!(out, "<td>{}</td><td>{}</td>", text(errors), text(by_given_camera))?;
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table></div>\n");
    Ok(())
}

/// Settings, and the command that makes the page again.
fn settings(out: &mut String, run: &Run) -> fmt::Result {
    let report = run.report;
    let memory = report.peak_rss_bytes.map_or_else(String::new, |bytes| {
        format!(", peak memory {} MB", shown::count((bytes / 1_000_000) as usize))
    });
    let json = |value: &dyn Fn() -> serde_json::Result<String>| escaped(&value().unwrap_or_default());
    write!(
        out,
        "<section id=\"settings\">\n<h2>How it was made</h2>\n\
         <p>vg {}, prior {}, head {}, threads: {}{memory}. Pictures are JPEGs at most {} pixels wide; numbers are \
         measured at full size.</p>\n<pre><code>{}</code></pre>\n\
         <p>Times and memory differ from run to run, and so do results that depend on a time limit. All other \
         results are reproducible.</p>\n\
         <details><summary>Settings</summary><pre><code>{}</code></pre></details>\n\
         <details><summary>The whole report, as written by <code>vg reconstruct --report</code></summary>\
         <pre><code>{}</code></pre></details>\n</section>\n",
        report.version,
        escaped(report.prior),
        escaped(report.head),
        report.threads,
        pictures::MOST_WIDE,
        escaped(&run.command),
        json(&|| serde_json::to_string_pretty(&report.settings)),
        json(&|| serde_json::to_string_pretty(report)),
    )
}
