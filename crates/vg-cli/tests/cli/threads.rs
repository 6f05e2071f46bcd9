//! `--threads`: the total number of threads that a command starts, and one clear error if the system starts fewer.

use super::*;
use vg_testing::tools::{cc, few_threads, have, scratch};

/// Commands that read, reconstruct, measure, align, optimise, draw and write, each as small as possible.
const COMMANDS: [&str; 8] = [
    "reconstruct . --views 000,001 --resolution 0.2 -o {}/a.ply --points {}/p.ply --report {}/r.json",
    "reconstruct . --views 000,001 --prior shape --resolution 0.2 --refine 2 -o {}/b.ply",
    "refine {}/a.ply . --views 000,001 --amount 2 -o {}/c.ply",
    "render {}/a.ply --cameras . --views 000 --depth -o {}",
    "render {}/a.ply --turntable 2 --size 64x48 --background transparent -o {}/t",
    "eval . --prior hull --resolution 0.2 --json {}/e.json",
    "report . --views 000 --prior hull --resolution 0.2 -o {}/page.html",
    "align . --scan {}/scan.ply -o {}/v.json",
];

/// Runs a command on a system that can start at most `allowed` threads.
fn vg_where_few_start(folder: &Path, words: &str, allowed: u32) -> Run {
    let library = folder.join("few_threads.so");
    if !library.exists() {
        few_threads(folder);
    }
    let place = folder.to_str().unwrap();
    let args: Vec<String> = words.split_whitespace().map(|word| word.replace("{}", place)).collect();
    let mut command = Command::new(env!("CARGO_BIN_EXE_vg"));
    command.args(&args).current_dir(sample());
    // This variable of rayon must have no effect.
    command.env("RAYON_NUM_THREADS", "5");
    command.env("LD_PRELOAD", library).env("VG_TEST_THREADS", allowed.to_string());
    ran(&mut command)
}

#[test]
fn one_thread_is_the_main_thread_and_three_are_three_in_total() {
    if !have(&cc(), "gcc", "a system that starts few threads") {
        return;
    }
    let folder = scratch();
    let at = folder.path();
    crate::align::write_scan(&at.join("scan.ply"));
    let mut bytes = Vec::new();
    for (threads, allowed) in [(1, 0), (3, 3)] {
        for words in COMMANDS {
            let words = format!("{words} --threads {threads}");
            let run = vg_where_few_start(at, &words, allowed);
            assert_eq!(run.code, 0, "vg {words}, {allowed} threads can start: {run:?}");
        }
        let results = ["a.ply", "b.ply", "c.ply", "p.ply", "000.png", "depth/000.png", "t/001.png", "v.json"];
        bytes.push(results.map(|name| std::fs::read(at.join(name)).unwrap()));
        assert_eq!(json(&at.join("r.json"))["threads"], threads);
    }
    assert!(bytes[0] == bytes[1], "the bytes depend on the number of threads");
}

#[test]
fn threads_that_cannot_start_are_one_error_with_the_remedy() {
    if !have(&cc(), "gcc", "a system that starts few threads") {
        return;
    }
    let folder = scratch();
    let at = folder.path();
    crate::align::write_scan(&at.join("scan.ply"));
    let words = "reconstruct . --views 000,001 --resolution 0.2 -o {}/a.ply --threads 1";
    assert_eq!(vg_where_few_start(at, words, 0).code, 0);
    let cause = "threads: 2 of 3 could be started: Resource temporarily unavailable (os error 11); raise the system's \
                 limit of threads (ulimit -u), or ask for 1, which starts none";
    for words in COMMANDS {
        let run = vg_where_few_start(at, &format!("{words} --threads 3"), 2);
        assert_eq!((run.code, run.out.as_str()), (1, ""), "vg {words}: {run:?}");
        assert_one_error(&run);
        assert!(run.err.contains(cause), "vg {words}: {run:?}");
    }
    // Commands that need no thread still work.
    let run = vg_where_few_start(at, "info {}/a.ply", 0);
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{run:?}");
}
