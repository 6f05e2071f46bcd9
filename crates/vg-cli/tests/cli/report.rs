//! `vg report`: the page as a file. `tests/report.rs` opens it in a browser.

use super::*;
use std::fs;

/// The page of the sample by the shape prior, and the output of the program, made once.
fn page() -> &'static (Run, String) {
    static PAGE: OnceLock<(Run, String)> = OnceLock::new();
    PAGE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = succeed(folder.path(), "report . --prior shape -o {}/new/page.html");
        let text = fs::read_to_string(folder.path().join("new/page.html")).unwrap();
        (run, text)
    })
}

/// All texts between `from` and the next `to`.
fn all_between<'a>(text: &'a str, from: &str, to: &str) -> Vec<&'a str> {
    text.split(from).skip(1).map(|rest| rest.split(to).next().unwrap()).collect()
}

/// Fails at the first closing tag without an opening one.
fn assert_closed(page: &str) {
    const VOID: [&str; 4] = ["meta", "link", "img", "input"];
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page.strip_prefix("<!DOCTYPE html>").unwrap();
    while let Some(at) = rest.find('<') {
        let (tag, after) = rest[at + 1..].split_once('>').unwrap();
        rest = after;
        let name = tag.split([' ', '\n']).next().unwrap();
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "</{name}> before {}", rest.get(..60).unwrap_or(rest));
        } else if name == "style" || name == "script" {
            rest = rest.split_once(&format!("</{name}>")).unwrap().1;
        } else if !VOID.contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn the_page_needs_no_other_file_and_contains_all_results() {
    let (run, page) = page();
    assert!(run.out.contains("in 4 test views PSNR 25."), "{}", run.out);
    assert!((500_000..4_000_000).contains(&page.len()), "{} bytes", page.len());
    assert_closed(page);
    for reference in ["src=\"", "href=\"", "url("] {
        for target in all_between(page, reference, "\"") {
            assert!(target.starts_with("data:"), "{reference}{}", target.get(..80).unwrap_or(target));
        }
    }
    let words: Vec<&str> = page.split(|c: char| !c.is_alphanumeric()).collect();
    assert!(!words.contains(&"NaN") && !words.contains(&"inf"));
    assert!(!page.contains("http:") && !page.contains("https:"));
    // Input and render; photograph, render and error; the turntable.
    assert_eq!(page.matches("<img ").count(), 4 * 2 + 4 * 3 + 1);
    assert_eq!(page.matches("alt=\"\"").count(), 0);
    let version = concat!("vg ", env!("CARGO_PKG_VERSION"), ", prior shape, head surfel");
    for text in
        ["Split right_to_left of", "4 unseen views", "176 973", "outside the mask", "prior <b>", version]
    {
        assert!(page.contains(text), "{text}");
    }
    assert!(page.contains("vg report . --prior shape -o /"), "the page lacks its command");
    assert!(page.contains("<dt>verdict</dt><dd>good</dd>") && !page.contains("class=\"warnings\""));
    let check = all_between(page, "Check of each input view", "</table>")[0];
    assert_eq!(check.matches("<tr><th scope=\"row\">").count(), 4);
}

#[test]
fn another_run_gives_the_same_pictures_and_numbers() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), "report . --prior shape --threads 1 -o {}/page.html");
    let again = fs::read_to_string(folder.path().join("page.html")).unwrap();
    for (from, to) in [("src=\"", "\""), ("<figcaption>", "</figcaption>"), ("<tbody>", "</tbody>")] {
        assert!(all_between(&page().1, from, to) == all_between(&again, from, to), "{from}");
    }
}

#[test]
fn names_of_files_are_escaped() {
    let scene = copy_of_sample(&["images", "masks", "transforms.json"]);
    let folder = scene.path().join("a <b>&\"'car");
    fs::create_dir(&folder).unwrap();
    for part in ["images", "masks", "transforms.json"] {
        fs::rename(scene.path().join(part), folder.join(part)).unwrap();
    }
    let strange = "<script>alert(1)</script>.png".replace('/', "\u{2215}");
    fs::rename(folder.join("images/000.png"), folder.join("images").join(&strange)).unwrap();
    let cameras = fs::read_to_string(folder.join("transforms.json")).unwrap();
    fs::write(
        folder.join("transforms.json"),
        cameras.replace("images/000.png", &format!("images/{strange}")),
    )
    .unwrap();
    let out = scene.path().join("page.html");
    let words = ["report", folder.to_str().unwrap(), "--views", &strange, "--prior", "hull", "-o"];
    let run = vg(&[words.as_slice(), &[out.to_str().unwrap()]].concat());
    assert_eq!(run.code, 0, "{run:?}");
    let page = fs::read_to_string(&out).unwrap();
    assert_closed(&page);
    assert_eq!(page.matches("<script>").count(), 1);
    assert!(page.contains("<h1>a &lt;b&gt;&amp;&quot;&#39;car</h1>"));
    assert!(page.contains("Photograph &lt;script&gt;alert(1)"));
}

#[test]
fn the_test_views_follow_the_split_and_the_page_describes_them() {
    let folder = tempfile::tempdir().unwrap();
    let made = |words: &str| {
        succeed_with_warnings(folder.path(), &format!("report . --prior hull {words} -o {{}}/page.html"));
        fs::read_to_string(folder.path().join("page.html")).unwrap()
    };
    let page = made("--views 001,002");
    assert!(page.contains("chosen by --views") && page.contains("2 input views"));
    assert!(!page.contains("id=\"tests\""));

    let split =
        r#"{"b": {"input": ["001"], "test": ["004"]}, "a": {"input": ["000", "001"], "test": ["005"]}}"#;
    fs::write(folder.path().join("two.json"), split).unwrap();
    let page = made(&format!("--split {}/two.json", folder.path().display()));
    assert!(page.contains("Split a of") && page.contains("the first of 2"));
    assert!(page.contains("PSNR, 1 unseen view<"));
    let page = made(&format!("--split {}/two.json --only b", folder.path().display()));
    assert!(page.contains("Split b of") && !page.contains("the first of"));
}

#[test]
fn errors_are_named_and_no_input_is_replaced() {
    let scene = copy_of_sample(&["images", "masks", "transforms.json"]);
    let at = scene.path();
    // The sample's own folder has a split.
    let done = Command::new(env!("CARGO_BIN_EXE_vg"))
        .args(["report", ".", "--only", "x", "-o", "page.html"])
        .current_dir(at)
        .output()
        .unwrap();
    let error = String::from_utf8(done.stderr).unwrap();
    assert!(error.starts_with("vg: error: --only x: no split.json here"), "{error}");
    assert_eq!(done.status.code(), Some(1));
    fail(at, "report {} --views 000 --split s.json -o {}/page.html", 2, &["--split", "--views"]);
    fail(at, "report {}", 2, &["--output <PAGE.html>"]);
    fs::copy(sample().join("split.json"), at.join("split.json")).unwrap();
    fail(at, "report {} --only x -o {}/page.html", 1, &["x: no such key", "right_to_left"]);
    for input in ["images/000.png", "masks/005.png", "transforms.json"] {
        fail(at, &format!("report {{}} -o {{}}/{input}"), 1, &[input, "would be replaced"]);
    }
    fail(at, "report {} -o {}/images", 1, &["images", "is a folder"]);
    assert!(!at.join("page.html").exists());
}
