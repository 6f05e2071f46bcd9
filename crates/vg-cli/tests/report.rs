//! The page of `vg report` in a real browser, Chromium without a screen: pictures, script, layout, dark mode.
//!
//! Without Chromium the tests are skipped with a printed reason; `VG_NO_SKIP=1` makes that a failure.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use vg_testing::root;
use vg_testing::tools::{have, run, scratch};

const BROWSER: &str = "chromium";

/// Time limit of the browser.
const PATIENCE: Duration = Duration::from_secs(180);

/// Widths of a phone and of a desktop screen, pixels.
const WIDTHS: [u32; 2] = [400, 1280];

/// The sample's page, made once.
fn page() -> &'static Path {
    static PAGE: OnceLock<PathBuf> = OnceLock::new();
    PAGE.get_or_init(|| {
        let page = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report.html");
        let sample = root().join("tests/data/sedan");
        let words = ["--prior".as_ref(), "shape".as_ref(), "-o".as_ref(), page.as_os_str()];
        run(Command::new(env!("CARGO_BIN_EXE_vg")).arg("report").arg(sample).args(words));
        page
    })
}

/// Runs the browser on a page and returns its output.
fn browse(page: &Path, flags: &[&str]) -> String {
    let folder = scratch();
    let printed = folder.path().join("printed");
    let mut browser = Command::new(BROWSER)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .args(flags)
        .arg(format!("file://{}", page.display()))
        .stdin(Stdio::null())
        .stdout(std::fs::File::create(&printed).unwrap())
        .stderr(std::fs::File::create(folder.path().join("errors")).unwrap())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let status = loop {
        if let Some(status) = browser.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > PATIENCE {
            browser.kill().unwrap();
            browser.wait().unwrap();
            panic!("{BROWSER} {flags:?} did not answer within {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let errors = std::fs::read_to_string(folder.path().join("errors")).unwrap();
    assert!(status.success(), "{BROWSER} {flags:?}: {status}\n{errors}");
    std::fs::read_to_string(printed).unwrap()
}

/// Script inserted before that of the page.
const LISTEN: &str = r#"<script>
const complaints = [];
addEventListener("error", (e) => complaints.push(e.message || `${e.target.tagName} failed`), true);
addEventListener("securitypolicyviolation", (e) => complaints.push(`policy: ${e.blockedURI}`));
console.error = console.warn = (...words) => complaints.push(words.join(" "));
</script>"#;

/// Script inserted after it: uses the page as a reader would, and sends the results to the surrounding page.
const TRY: &str = r#"<script>
const tried = async () => {
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const images = [...document.images];
  // Drawn small: an undecodable or all-white picture has no dark pixel.
  const canvas = Object.assign(document.createElement("canvas"), { width: 64, height: 64 });
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  const isEmpty = (image) => {
    if (!image.naturalWidth) return true;
    pen.fillStyle = "white";
    pen.fillRect(0, 0, 64, 64);
    pen.drawImage(image, 0, 0, 64, 64);
    return pen.getImageData(0, 0, 64, 64).data.every((byte) => byte > 240);
  };
  const slider = document.querySelector(".turntable input");
  const button = document.querySelector(".turntable button");
  const view = document.querySelector(".turntable .window");
  const place = () => document.querySelector(".turntable img").style.transform;
  const places = [place()];
  slider.value = 9;
  slider.dispatchEvent(new Event("input"));
  places.push(place());
  const point = (kind, x) => view.dispatchEvent(new PointerEvent(kind, { pointerId: 1, clientX: x }));
  view.setPointerCapture = () => {};
  point("pointerdown", 100);
  point("pointermove", 100 + view.clientWidth / 2);
  point("pointerup", 100);
  point("pointermove", 0);
  places.push(place());
  button.click();
  await wait(450);
  button.click();
  const played = Number(slider.value);
  await wait(450);
  return {
    width: innerWidth,
    complaints,
    images: images.length,
    empty: images.filter(isEmpty).length,
    unnamed: images.filter((image) => !image.alt).length,
    places,
    played,
    stopped: Number(slider.value),
    controls: button.offsetHeight > 0 && slider.offsetWidth > 0,
    overflow: document.documentElement.scrollWidth - innerWidth,
    narrowest: Math.min(...images.map((image) => image.getBoundingClientRect().width)),
    fetched: performance.getEntriesByType("resource").filter((e) => !e.name.startsWith("data:")).length,
  };
};
addEventListener("load", () =>
  tried()
    .catch((e) => ({ width: innerWidth, complaints: [...complaints, String(e)] }))
    .then((found) => parent.postMessage(found, "*")));
</script>"#;

/// The page in frames of several widths, and the results of each.
const AROUND: &str = r#"<!DOCTYPE html><body><pre id="results"></pre><script>
const results = [];
addEventListener("message", (e) => {
  results.push(e.data);
  document.getElementById("results").textContent = JSON.stringify(results).replaceAll("<", "\\u003c").replaceAll("&", "\\u0026");
});
</script>"#;

fn results(dumped: &str) -> Vec<Value> {
    let text =
        dumped.split("<pre id=\"results\">").nth(1).and_then(|rest| rest.split("</pre>").next()).unwrap();
    serde_json::from_str(&text.replace("&gt;", ">")).unwrap_or_else(|e| panic!("{e}: the page sent {text:?}"))
}

#[test]
fn a_browser_shows_all_pictures_at_any_width_and_the_turntable_turns() {
    if !have(BROWSER, BROWSER, "the report in a browser") {
        return;
    }
    let folder = scratch();
    let page = std::fs::read_to_string(page()).unwrap();
    let tried = page.replacen("<title>", &format!("{LISTEN}<title>"), 1);
    let tried = tried.replacen("</body>", &format!("{TRY}</body>"), 1);
    std::fs::write(folder.path().join("tried.html"), tried).unwrap();
    let frames = WIDTHS
        .map(|w| format!("<iframe src=\"tried.html\" style=\"width:{w}px;height:900px;border:0\"></iframe>"));
    let around = folder.path().join("around.html");
    std::fs::write(&around, format!("{AROUND}{}</body>", frames.concat())).unwrap();

    let dumped = browse(&around, &["--dump-dom", "--virtual-time-budget=20000", "--window-size=1400,2000"]);
    let mut all = results(&dumped);
    all.sort_by_key(|one| one["width"].as_u64());
    assert_eq!(all.iter().map(|one| one["width"].as_u64().unwrap() as u32).collect::<Vec<_>>(), WIDTHS);
    for one in all {
        assert_eq!(one["complaints"], serde_json::json!([]), "{one}");
        assert_eq!([&one["images"], &one["empty"], &one["unnamed"]], [21, 0, 0], "{one}");
        assert!(one["overflow"].as_i64() <= Some(0), "{one}");
        assert!(one["narrowest"].as_f64() > Some(120.0), "{one}");
        assert_eq!(one["fetched"], 0, "{one}");
        assert_eq!(one["controls"], true, "{one}");
        // A quarter of the way; from there back by a quarter turn; and on while it plays.
        let places = ["translateY(0%)", "translateY(-25%)", "translateY(0%)"];
        assert_eq!(one["places"], serde_json::json!(places), "{one}");
        assert!((2..=6).contains(&one["played"].as_u64().unwrap()), "{one}");
        assert_eq!(one["played"], one["stopped"], "{one}");
    }
}

#[test]
fn the_page_follows_the_dark_mode_of_the_browser() {
    if !have(BROWSER, BROWSER, "the report's screenshot") {
        return;
    }
    let folder = scratch();
    // Chromium's values for the two: 0 is dark.
    let [dark, light] = [0, 1].map(|scheme| {
        let picture = folder.path().join(format!("{scheme}.png"));
        let screenshot = format!("--screenshot={}", picture.display());
        let scheme = format!("--blink-settings=preferredColorScheme={scheme}");
        browse(page(), &[&screenshot, &scheme, "--window-size=1280,1600"]);
        image::open(&picture).unwrap().into_rgb8()
    });
    let corner = |picture: &image::RgbImage| picture.get_pixel(2, 2).0;
    assert!(corner(&dark).iter().all(|c| *c < 60) && corner(&light).iter().all(|c| *c > 230));
    // Text and photographs are visible.
    for picture in [dark, light] {
        let colors: std::collections::HashSet<[u8; 3]> = picture.pixels().map(|p| p.0).collect();
        assert!(colors.len() > 2000, "{} colours", colors.len());
    }
}
