//! Compares the types of every function and field, from debug information, with those of the first release.

use crate::abixml;
use crate::symbols::declared;
use std::process::Command;
use vg_testing::say;
use vg_testing::tools::{golden, have, library, output, run, scratch};

#[test]
fn abidiff_finds_nothing_that_would_break_a_program() {
    if !cfg!(target_arch = "x86_64") {
        say("skipped: the golden types are of x86-64");
        return;
    }
    let what = "types of functions and fields";
    if !have("abidiff", "abigail-tools", what) || !have("abidw", "abigail-tools", what) {
        return;
    }
    let folder = scratch();
    let dump = folder.path().join("whole.abi");
    let mut abidw = Command::new("abidw");
    abidw.args(["--no-comp-dir-path", "--no-corpus-path", "--no-show-locs"]);
    run(abidw.arg("--out-file").arg(&dump).arg(library()));
    let found = abixml::c_functions(&std::fs::read_to_string(&dump).unwrap());
    // Without debug information abidiff has nothing to compare and reports no difference.
    for function in declared() {
        assert!(
            found.contains(&format!("mangled-name='{function}'")),
            "{function}: no type information: was the library built without debug information?"
        );
    }
    let golden = golden().join("libvg-0-x86_64.abi");
    if std::env::var_os("VG_BLESS").is_some() {
        std::fs::write(&golden, found).unwrap();
        return;
    }
    let today = folder.path().join("today.abi");
    std::fs::write(&today, found).unwrap();
    // New functions are allowed.
    let result = output(Command::new("abidiff").arg("--no-added-syms").arg(&golden).arg(&today));
    assert_eq!(
        result.status.code(),
        Some(0),
        "{}\nVG_BLESS=1 rewrites the golden file, for a change that old programs still run with",
        String::from_utf8_lossy(&result.stdout)
    );
}
