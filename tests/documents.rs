//! What pages and comments name is there: files, folders, links and headings.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use vg_testing::root;

/// Folders of the repository whose files are named by their path from the root.
const ROOMS: [&str; 13] = [
    ".ci/",
    "benches/",
    "bindings/",
    "cpp-examples/",
    "crates/",
    "docs/",
    "fuzz/",
    "include/",
    "python-examples/",
    "scripts/",
    "src/",
    "tests/",
    "training/",
];

/// Files of the repository with one of these endings, by their paths from the root.
fn files(endings: &[&str]) -> Vec<String> {
    fn walk(folder: &Path, endings: &[&str], found: &mut Vec<String>) {
        for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let (path, name) = (entry.path(), entry.file_name().into_string().unwrap());
            let is_made = ["target", "build", "node_modules"].contains(&&*name) || name.starts_with('.');
            if path.is_dir() && !is_made {
                walk(&path, endings, found);
            } else if endings.iter().any(|ending| name.ends_with(ending)) {
                found.push(path.strip_prefix(root()).unwrap().to_str().unwrap().to_owned());
            }
        }
    }
    let mut found = Vec::new();
    walk(root(), endings, &mut found);
    found
}

/// Paths of this repository among the code spans of a text.
fn named(text: &str) -> impl Iterator<Item = &str> {
    let spans = text.split('`').skip(1).step_by(2);
    spans.flat_map(str::split_whitespace).filter(|word| {
        let is_path = ROOMS.iter().any(|room| word.starts_with(room));
        is_path
            && !word.contains(['*', '<', '{', '$', '(', '…'])
            && !word.contains("VERSION")
            && !word.ends_with("...")
    })
}

#[test]
fn every_path_in_backticks_is_there() {
    let mut missing = BTreeSet::new();
    for file in files(&[".md", ".rs", ".py", ".toml", ".hpp", ".cpp"]) {
        let text = fs::read_to_string(root().join(&file)).unwrap();
        // Changes name what there was.
        if file != "CHANGELOG.md" {
            // Inside a crate, from its folder too.
            let own = root().join(file.splitn(3, '/').take(2).collect::<PathBuf>());
            let gone = |path: &&str| {
                let path = path.trim_end_matches([',', '.', ':', ';']);
                !root().join(path).exists() && !own.join(path).exists()
            };
            missing.extend(named(&text).filter(gone).map(|path| format!("{file}: {path}")));
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
}

/// A heading as GitHub's anchors spell it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

fn headings(page: &Path) -> BTreeSet<String> {
    let text = fs::read_to_string(page).unwrap_or_default();
    text.lines()
        .filter(|line| line.starts_with('#'))
        .map(|line| anchor(line.trim_start_matches('#')))
        .collect()
}

#[test]
fn every_link_between_pages_leads_somewhere() {
    let mut broken = Vec::new();
    for file in files(&[".md"]) {
        let text = fs::read_to_string(root().join(&file)).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let (path, heading) = target.split_once('#').unwrap_or((target, ""));
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let folder = root().join(&file).parent().unwrap().to_owned();
            let page: PathBuf = if path.is_empty() { root().join(&file) } else { folder.join(path) };
            if !page.exists() || (!heading.is_empty() && !headings(&page).contains(heading)) {
                broken.push(format!("{file}: {target}"));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

/// Rows of the table below a heading of docs/ARCHITECTURE.md, as cells without their code marks.
fn rows(heading: &str) -> Vec<Vec<String>> {
    let page = fs::read_to_string(root().join("docs/ARCHITECTURE.md")).unwrap();
    let chapter = page.split("\n## ").find(|chapter| chapter.starts_with(heading)).expect("the chapter");
    let lines = chapter.lines().filter(|line| line.starts_with("| "));
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().replace('`', "")).collect();
    lines.skip(2).map(cells).collect()
}

#[test]
fn every_equation_of_the_paper_is_where_the_table_says() {
    let mut numbers = BTreeSet::new();
    for row in rows("Where the paper's equations are") {
        let [_, equations, _, function, file, _] = &row[..] else { panic!("{row:?}") };
        let text = fs::read_to_string(root().join(file)).unwrap();
        let defines = ["fn ", "def "].iter().any(|word| text.contains(&format!("{word}{function}")));
        assert!(defines, "{file} has no {function}");
        for number in equations.split(", ") {
            // "paper eq. 3", "paper eqs. 3, 4".
            let cited = text.split("paper eq").skip(1).any(|rest| {
                let list = rest.trim_start_matches(['s', '.', ' ']);
                let list = list.split(|c: char| !(c.is_ascii_digit() || ", ".contains(c))).next().unwrap();
                list.split(", ").any(|cited| cited.trim().trim_end_matches(',') == number)
            });
            assert!(cited, "{file} does not cite equation {number}");
            numbers.insert(number.parse::<u32>().unwrap());
        }
    }
    assert_eq!(numbers, (1..=13).collect());
}
