//! The program as a user runs it: on the bundled sample, and with every kind of error of a user.

mod align;
mod demo;
mod errors;
mod eval;
mod hostile;
mod info;
#[cfg(unix)]
mod interrupt;
mod pareto;
mod reconstruct;
mod refine;
mod render;
mod report;
mod results;
#[cfg(target_os = "linux")]
mod threads;
#[cfg(target_os = "linux")]
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The sample's input views; the others show the other side.
const INPUTS: &str = "000,001,002,003";

/// Results of a run.
#[derive(Debug)]
struct Run {
    code: i32,
    out: String,
    err: String,
}

/// Runs the program in the sample's folder.
fn vg<S: AsRef<std::ffi::OsStr>>(args: &[S]) -> Run {
    ran(Command::new(env!("CARGO_BIN_EXE_vg")).args(args).current_dir(sample()))
}

fn ran(command: &mut Command) -> Run {
    let done = command.output().unwrap();
    Run {
        code: done.status.code().expect("an exit code"),
        out: String::from_utf8_lossy(&done.stdout).into_owned(),
        err: String::from_utf8_lossy(&done.stderr).into_owned(),
    }
}

/// Runs the program with these arguments, in which `{}` stands for a folder.
fn vg_in(folder: &Path, words: &str) -> Run {
    let folder = folder.to_str().unwrap();
    vg(&words.split_whitespace().map(|word| word.replace("{}", folder)).collect::<Vec<_>>())
}

/// Runs as [`vg_in`] and asserts success without output on standard error.
fn succeed(folder: &Path, words: &str) -> Run {
    let run = vg_in(folder, words);
    assert_eq!((run.code, run.err.as_str()), (0, ""), "vg {words}: {run:?}");
    run
}

/// Runs as [`vg_in`] and asserts success with nothing but warnings on standard error.
fn succeed_with_warnings(folder: &Path, words: &str) -> Run {
    let run = vg_in(folder, words);
    assert_eq!(run.code, 0, "vg {words}: {run:?}");
    assert!(run.err.lines().all(|line| line.starts_with("vg: warning: ")), "vg {words}: {run:?}");
    run
}

/// Runs as [`vg_in`] and asserts failure: the exit code, nothing on standard output, and one line on standard error
/// with all of `causes`.
fn fail(folder: &Path, words: &str, code: i32, causes: &[&str]) {
    let run = vg_in(folder, words);
    assert_eq!((run.code, run.out.as_str()), (code, ""), "vg {words}: {run:?}");
    assert_one_error(&run);
    for cause in causes {
        assert!(run.err.contains(cause), "vg {words}: {:?} lacks {cause:?}", run.err);
    }
}

fn assert_one_error(run: &Run) {
    assert!(run.err.starts_with("vg: error: "), "{run:?}");
    assert_eq!(run.err.trim_end().lines().count(), 1, "{run:?}");
    assert!(!run.err.contains("panicked"), "{run:?}");
}

fn sample() -> PathBuf {
    vg_testing::root().join("tests/data/sedan")
}

/// The model of the sample's inputs by the shape prior, made once by the program.
fn asset() -> &'static Path {
    static ASSET: OnceLock<PathBuf> = OnceLock::new();
    ASSET.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
        succeed(folder, &format!("reconstruct . --views {INPUTS} --prior shape -o {{}}/sedan.ply"));
        folder.join("sedan.ply")
    })
}

/// A copy of parts of the sample, for modification.
fn copy_of_sample(parts: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for part in parts {
        copy(&sample().join(part), &folder.path().join(part));
    }
    folder
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to.parent().unwrap()).unwrap();
    if from.is_dir() {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let name = entry.unwrap().file_name();
            copy(&from.join(&name), &to.join(&name));
        }
    } else {
        std::fs::copy(from, to).unwrap();
    }
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn help_documents_every_command_and_the_exit_codes() {
    let folder = Path::new(".");
    let help = succeed(folder, "--help").out;
    let commands = ["reconstruct", "render", "info", "refine", "eval", "pareto", "report", "demo", "align"];
    for word in commands.into_iter().chain(["Exit codes: 0", "130"]) {
        assert!(help.contains(word), "{word} in {help}");
    }
    for command in commands {
        assert!(succeed(folder, &format!("{command} --help")).out.contains("Usage: vg"));
    }
    assert_eq!(succeed(folder, "--version").out, concat!("vg ", env!("CARGO_PKG_VERSION"), "\n"));
}
