//! The exported symbols of the shared library, and its soname.

use crate::contents::functions;
use std::collections::BTreeSet;
use std::process::Command;
use vg_testing::root;
use vg_testing::tools::{assert_golden, golden, have, library, run};

/// Names of the functions in the header.
pub(crate) fn declared() -> BTreeSet<String> {
    let header = std::fs::read_to_string(root().join("include/vg.h")).unwrap();
    functions(&header)
}

#[test]
fn exactly_the_functions_of_the_golden_list_are_exported() {
    if !have("nm", "binutils", "exported symbols") {
        return;
    }
    let listing = run(Command::new("nm").args(["-D", "--defined-only", "-f", "posix"]).arg(library()));
    let mut exported: Vec<String> = listing
        .lines()
        .map(|line| {
            let mut parts = line.split(' ');
            format!("{} {}", parts.next().unwrap(), parts.next().unwrap())
        })
        .collect();
    exported.sort();
    let found = exported.join("\n") + "\n";
    let why = "programs may call any function that was ever exported; a new one is blessed with VG_BLESS=1";
    assert_golden(&golden().join("symbols.txt"), &found, why);

    let exported: BTreeSet<String> =
        exported.iter().map(|l| l.split(' ').next().unwrap().to_owned()).collect();
    assert_eq!(exported, declared(), "the library exports the functions of the header");
}

#[test]
fn the_library_has_its_soname() {
    if !have("readelf", "binutils", "soname") {
        return;
    }
    let dynamic = run(Command::new("readelf").args(["-d", "-W"]).arg(library()));
    assert!(dynamic.contains("Library soname: [libvg.so.0]"), "{dynamic}");
}

/// Code that runs at the end of a thread stays in memory even if the host has unloaded the library.
#[test]
fn the_library_stays_in_memory_when_it_is_unloaded() {
    if !have("readelf", "binutils", "the flags of the library") {
        return;
    }
    let dynamic = run(Command::new("readelf").args(["-d", "-W"]).arg(library()));
    assert!(dynamic.lines().any(|line| line.contains("(FLAGS_1)") && line.contains("NODELETE")), "{dynamic}");
}

#[test]
fn the_library_needs_nothing_but_the_system() {
    if !have("readelf", "binutils", "needed libraries") {
        return;
    }
    let dynamic = run(Command::new("readelf").args(["-d", "-W"]).arg(library()));
    let needed: Vec<&str> = dynamic
        .lines()
        .filter(|line| line.contains("(NEEDED)"))
        .map(|line| line.split(['[', ']']).nth(1).unwrap())
        .collect();
    let system = ["libc.so.6", "libm.so.6", "libgcc_s.so.1", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"];
    assert!(needed.iter().all(|library| system.contains(library)), "{needed:?}");
}
