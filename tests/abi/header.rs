//! `include/vg.h` equals what cbindgen generates from `src/capi`, and compiles everywhere.

use std::process::Command;
use vg_testing::root;
use vg_testing::tools::{STRICT, assert_golden, cc, cxx, have, run, scratch};

/// The chapters of the header.
const CHAPTERS: [&str; 21] = [
    "version",
    "status",
    "context",
    "image",
    "camera",
    "view",
    "model",
    "options",
    "report",
    "gaussians",
    "select",
    "placed",
    "reconstruct",
    "refine",
    "render",
    "renderer",
    "gradient",
    "segment",
    "metrics",
    "align",
    "scene",
];

#[test]
fn the_header_equals_the_one_generated_from_the_source() {
    let config = cbindgen::Config::from_file(root().join("cbindgen.toml")).expect("cbindgen.toml");
    let builder = CHAPTERS.iter().fold(cbindgen::Builder::new().with_config(config), |builder, chapter| {
        builder.with_src(root().join(format!("src/capi/{chapter}.rs")))
    });
    let mut header = Vec::new();
    builder.generate().expect("a header").write(&mut header);
    let header = String::from_utf8(header).expect("UTF-8");
    let why = "VG_BLESS=1 cargo test --test abi rewrites the header; programs must still compile against it";
    assert_golden(&root().join("include/vg.h"), &header, why);
}

#[test]
fn every_chapter_of_the_source_is_in_the_header() {
    let inside = ["mod", "guard", "overlap", "read", "tests", "watched"];
    for entry in std::fs::read_dir(root().join("src/capi")).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        assert!(CHAPTERS.contains(&stem.as_str()) || inside.contains(&stem.as_str()), "src/capi/{stem}.rs");
    }
}

/// The header's version macros are the package's version.
#[test]
fn the_version_macros_are_the_package_version() {
    use vg_face::capi::{VG_VERSION_MAJOR, VG_VERSION_MINOR, VG_VERSION_PATCH};
    let macros = format!("{VG_VERSION_MAJOR}.{VG_VERSION_MINOR}.{VG_VERSION_PATCH}");
    assert_eq!(macros, env!("CARGO_PKG_VERSION"));
}

#[test]
fn the_header_compiles_alone_and_clean_in_every_language() {
    let mut compilers = vec![(cc(), false), (cxx(), true)];
    for (program, is_cxx) in [("gcc", false), ("g++", true), ("clang", false), ("clang++", true)] {
        if have(program, "gcc g++ clang", &format!("the header under {program}")) {
            compilers.push((program.into(), is_cxx));
        }
    }
    for (compiler, is_cxx) in compilers {
        let standards: &[&str] = if is_cxx { &["c++17", "c++20"] } else { &["c99", "c11", "c2x"] };
        if !have(&compiler, "gcc g++", "the header's own compile") {
            continue;
        }
        for standard in standards {
            let mut command = Command::new(&compiler);
            command.args(STRICT).arg(format!("-std={standard}")).arg("-fsyntax-only");
            command.args(["-x", if is_cxx { "c++" } else { "c" }]).arg(root().join("include/vg.h"));
            run(&mut command);
        }
    }
}

#[test]
fn two_files_of_one_program_may_include_it() {
    if !have(&cc(), "gcc", "two files with the header") {
        return;
    }
    let folder = scratch();
    let include = "#include \"vg.h\"\n#include \"vg.h\"\n";
    let first = folder.path().join("first.c");
    let second = folder.path().join("second.c");
    std::fs::write(&first, format!("{include}int other(void);\nint main(void) {{ return other(); }}\n"))
        .unwrap();
    std::fs::write(
        &second,
        format!("{include}int other(void);\nint other(void) {{ return VG_STATUS_OK; }}\n"),
    )
    .unwrap();
    let program = folder.path().join("program");
    let mut command = Command::new(cc());
    command
        .args(STRICT)
        .arg("-I")
        .arg(root().join("include"))
        .args([&first, &second])
        .arg("-o")
        .arg(&program);
    run(&mut command);
    run(&mut Command::new(program));
}
