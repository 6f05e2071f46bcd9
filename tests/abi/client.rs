//! Programs of earlier releases, compiled against the header of their release, run with today's library.

use crate::contents::functions;
use std::path::{Path, PathBuf};
use std::process::Command;
use vg_testing::root;
use vg_testing::tools::{STRICT, cc, compile, cxx, have, library, library_folder, output, run, scratch};

fn releases() -> Vec<PathBuf> {
    let folder = root().join("tests/abi/releases");
    let mut releases: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    releases.sort();
    releases
}

fn sample() -> PathBuf {
    root().join("tests/data/sedan")
}

fn run_client(program: &Path, folder: &Path) -> String {
    run(Command::new(program).arg(sample()).arg(folder))
}

#[test]
fn clients_of_every_release_still_run() {
    if !have(&cc(), "gcc", "clients of earlier releases") {
        return;
    }
    for release in releases() {
        let folder = scratch();
        library_folder(folder.path());
        let source = release.join("client.c");
        let program = compile(&cc(), &["-O1"], &release, &source, folder.path(), "client");
        run_client(&program, folder.path());
    }
}

/// Machine code that a compiler made from a client at the time of its release: it contains only what was promised then.
#[test]
fn objects_compiled_at_each_release_still_link_and_run() {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) || !have(&cc(), "gcc", "old objects") {
        return;
    }
    for release in releases() {
        let object = release.join("client-x86_64-linux.o");
        if std::env::var_os("VG_BLESS").is_some() && !object.exists() {
            let mut command = Command::new(cc());
            command
                .args(["-O1", "-fPIE", "-c", "client.c", "-o", "client-x86_64-linux.o"])
                .current_dir(&release);
            run(&mut command);
        }
        let folder = scratch();
        library_folder(folder.path());
        let program = compile(&cc(), &[], &release, &object, folder.path(), "client");
        run_client(&program, folder.path());
    }
}

#[test]
fn todays_header_contains_the_header_of_the_latest_release() {
    let today = crate::symbols::declared();
    for release in releases() {
        let header = std::fs::read_to_string(release.join("vg.h")).unwrap();
        let source = std::fs::read_to_string(release.join("client.c")).unwrap();
        for name in functions(&header) {
            assert!(today.contains(&name), "{name} of {} is missing", release.display());
            assert!(
                source.contains(&format!("{name}(")),
                "{}: the client does not call {name}",
                release.display()
            );
        }
    }
}

#[test]
fn the_client_compiles_clean_as_c_and_as_cxx_and_prints_the_same_with_the_static_library() {
    if !have(&cc(), "gcc", "today's client") || !have(&cxx(), "g++", "today's client") {
        return;
    }
    let folder = scratch();
    library_folder(folder.path());
    let include = root().join("include");
    let release = releases().pop().unwrap();
    let source = release.join("client.c");
    let mut flags = STRICT.to_vec();
    flags.extend(["-std=gnu11", "-O1"]);
    let as_c = run_client(&compile(&cc(), &flags, &include, &source, folder.path(), "as_c"), folder.path());

    let copy = folder.path().join("client.cpp");
    std::fs::copy(&source, &copy).unwrap();
    let mut flags = STRICT.to_vec();
    flags.extend(["-std=c++17", "-O1"]);
    let as_cxx =
        run_client(&compile(&cxx(), &flags, &include, &copy, folder.path(), "as_cxx"), folder.path());
    assert_eq!(as_c, as_cxx);

    let static_program = folder.path().join("static");
    let mut command = Command::new(cc());
    command
        .arg("-I")
        .arg(&include)
        .arg(&source)
        .arg(library().with_extension("a"))
        .arg("-o")
        .arg(&static_program);
    run(command.args(["-lm", "-lpthread", "-ldl"]));
    assert_eq!(as_c, run_client(&static_program, folder.path()));

    // "positions 2416776 df54cfba06529b5e": the array, and its hash in the golden file.
    let golden = std::fs::read_to_string(vg_testing::tools::golden().join("sedan.hash")).unwrap();
    if golden.lines().next() == Some(&crate::buffers::processor()) {
        for array in golden.lines().skip(1).take(5) {
            let (name, hash) = array.split_once(' ').unwrap();
            assert!(as_c.lines().any(|l| l.starts_with(name) && l.ends_with(hash)), "{array} not in {as_c}");
        }
    }
}

#[test]
fn valgrind_finds_no_error_and_no_leak_in_the_client() {
    if !have("valgrind", "valgrind", "memory errors and leaks") || !have(&cc(), "gcc", "memory errors") {
        return;
    }
    let folder = scratch();
    library_folder(folder.path());
    let source = releases().pop().unwrap().join("client.c");
    let program = compile(&cc(), &["-g"], &root().join("include"), &source, folder.path(), "client");
    let mut command = Command::new("valgrind");
    command.args(["--error-exitcode=99", "--leak-check=full", "--show-leak-kinds=definite,indirect"]);
    command.args(["--errors-for-leak-kinds=definite,indirect", "--track-origins=no", "-q"]);
    let result = output(command.arg(&program).arg(sample()).arg(folder.path()).arg("quick"));
    let errors = String::from_utf8_lossy(&result.stderr);
    assert!(result.status.success() && errors.is_empty(), "{}\n{errors}", result.status);
}

#[test]
#[cfg(target_os = "linux")]
fn a_thread_that_unloads_the_library_can_end_and_no_thread_remains() {
    if !have(&cc(), "gcc", "unloading the library") {
        return;
    }
    let folder = scratch();
    library_folder(folder.path());
    let program = folder.path().join("reload");
    let mut command = Command::new(cc());
    command.args(STRICT).arg("-I").arg(root().join("include")).arg(root().join("tests/abi/reload.c"));
    run(command.arg("-o").arg(&program).args(["-ldl", "-pthread"]));
    run(Command::new(program).arg(library()).arg(sample()).arg(folder.path()));
}

#[test]
#[cfg(target_os = "linux")]
fn a_fork_refuses_its_parents_contexts_and_works_without_them() {
    if !have(&cc(), "gcc", "forks") {
        return;
    }
    let folder = scratch();
    library_folder(folder.path());
    let mut flags = STRICT.to_vec();
    flags.push("-std=gnu11");
    let source = root().join("tests/abi/fork.c");
    run(&mut Command::new(compile(&cc(), &flags, &root().join("include"), &source, folder.path(), "fork")));
}
