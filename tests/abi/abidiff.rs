//! The types of every function and field, as the compiler wrote them down, against those of the first release.

use crate::symbols::declared;
use crate::tools::{golden, have, output, run, scratch, target};
use std::process::Command;

#[test]
fn abidiff_finds_nothing_that_would_break_a_program() {
    let what = "types of functions and fields";
    if !have("abidiff", "abigail-tools", what) || !have("abidw", "abigail-tools", what) {
        return;
    }
    let library = target().join("libvg.so");
    let golden = golden().join("libvg-0.abi");
    let folder = scratch();
    let today = folder.path().join("today.abi");
    let mut dump = Command::new("abidw");
    dump.args(["--no-comp-dir-path", "--no-corpus-path", "--no-show-locs", "--no-architecture"]);
    run(dump.arg("--out-file").arg(&today).arg(&library));
    let written = std::fs::read_to_string(&today).unwrap();
    // Without debug information there is nothing to compare, and abidiff is content.
    for function in declared() {
        assert!(
            written.contains(&format!("mangled-name='{function}'")),
            "{function}: no type information: was the library built without debug information?"
        );
    }
    if std::env::var_os("VG_BLESS").is_some() {
        std::fs::write(&golden, written).unwrap();
        return;
    }
    // New functions are welcome.
    let result = output(Command::new("abidiff").arg("--no-added-syms").arg(&golden).arg(&library));
    assert_eq!(
        result.status.code(),
        Some(0),
        "{}\nVG_BLESS=1 rewrites the golden file, for a change that old programs survive",
        String::from_utf8_lossy(&result.stdout)
    );
}
