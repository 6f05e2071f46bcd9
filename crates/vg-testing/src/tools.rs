//! Compilers and other programs, golden files, and the messages for missing ones.

use crate::{root, say};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// Folder of the golden files.
pub fn golden() -> PathBuf {
    root().join("tests/abi/golden")
}

/// A temporary folder on the disk of the build, deleted after the test.
pub fn scratch() -> tempfile::TempDir {
    tempfile::tempdir_in(target()).expect("a folder below target")
}

/// The folder of this test: `target/debug/deps`.
pub fn target() -> PathBuf {
    let exe = std::env::current_exe().expect("the test's own path");
    exe.parent().expect("a folder").to_owned()
}

/// Whether `program` runs. If not, prints that `what` is skipped, or fails under `VG_NO_SKIP`.
pub fn have(program: &str, package: &str, what: &str) -> bool {
    // The option for the version differs between programs; it is enough that they start.
    if Command::new(program).arg("--version").output().is_ok() {
        return true;
    }
    let line = format!("skipped: {what}: no {program} here (Debian: {package})");
    assert!(std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
    say(&line);
    false
}

/// The C compiler: `$CC`, or cc.
pub fn cc() -> String {
    std::env::var("CC").unwrap_or_else(|_| "cc".into())
}

/// The C++ compiler: `$CXX`, or c++.
pub fn cxx() -> String {
    std::env::var("CXX").unwrap_or_else(|_| "c++".into())
}

/// Flags for the warnings that must not occur.
pub const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"];

/// Runs a program that must succeed, and returns its output.
pub fn run(command: &mut Command) -> String {
    let output = output(command);
    assert!(
        output.status.success(),
        "{command:?}: {}\n{}\n{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).expect("UTF-8 output")
}

/// Runs a program that may fail.
pub fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"))
}

/// The shared library, built as this test was: cargo builds none for tests, which cannot be linked with it.
pub fn library() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let profile = target().parent().expect("a profile's folder").to_owned();
        let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo.args(["build", "--quiet", "--locked", "--package", "libvg", "--lib"]).current_dir(root());
        cargo.arg("--target-dir").arg(profile.parent().expect("cargo's folder"));
        if profile.ends_with("release") {
            cargo.arg("--release");
        }
        for (feature, is_on) in [("onnx", cfg!(feature = "onnx")), ("gpu", cfg!(feature = "gpu"))] {
            if is_on {
                cargo.args(["--features", feature]);
            }
        }
        run(&mut cargo);
        profile.join("libvg.so")
    })
}

/// Fills a folder with the shared library under the names that programs link and load.
pub fn library_folder(folder: &Path) {
    for name in ["libvg.so", "libvg.so.0"] {
        std::os::unix::fs::symlink(library(), folder.join(name)).expect("a link to the library");
    }
}

/// Compiles one C file into a program that loads the shared library from `folder`.
pub fn compile(
    compiler: &str,
    flags: &[&str],
    include: &Path,
    source: &Path,
    folder: &Path,
    name: &str,
) -> PathBuf {
    let program = folder.join(name);
    let mut command = Command::new(compiler);
    command.args(flags).arg("-I").arg(include).arg(source).arg("-o").arg(&program);
    command.arg("-L").arg(folder).arg(format!("-Wl,-rpath,{}", folder.display()));
    run(command.args(["-lvg", "-lm", "-pthread"]));
    program
}

/// A library to preload that limits a process to `VG_TEST_THREADS` threads.
pub fn few_threads(folder: &Path) -> PathBuf {
    let library = folder.join("few_threads.so");
    let mut command = Command::new(cc());
    command.args(STRICT).args(["-std=gnu11", "-shared", "-fPIC"]);
    run(command.arg(root().join("crates/vg-testing/src/few_threads.c")).arg("-o").arg(&library).arg("-ldl"));
    library
}

/// Compares with a golden file, or rewrites it under `VG_BLESS`. `why` explains a difference.
pub fn assert_golden(path: &Path, found: &str, why: &str) {
    if std::env::var_os("VG_BLESS").is_some() {
        std::fs::write(path, found).expect("the golden file is written");
        return;
    }
    let expected = std::fs::read_to_string(path).unwrap_or_default();
    if expected == found {
        return;
    }
    let first = expected.lines().zip(found.lines()).position(|(a, b)| a != b);
    let line = first.unwrap_or(expected.lines().count().min(found.lines().count()));
    panic!(
        "{} differs at line {}:\n  golden: {}\n  found:  {}\n{why}",
        path.display(),
        line + 1,
        expected.lines().nth(line).unwrap_or("(end)"),
        found.lines().nth(line).unwrap_or("(end)"),
    );
}
