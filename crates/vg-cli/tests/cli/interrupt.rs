//! External termination: signals, limits, and the end of the parent process.

use super::*;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

fn start(words: &str) -> Child {
    // Tests run in the background inherit that INT is ignored.
    Command::new("env")
        .args(["--default-signal=INT,TERM,HUP", env!("CARGO_BIN_EXE_vg")])
        .args(words.split_whitespace())
        .current_dir(sample())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn send(signal: &str, process: u32) {
    assert!(Command::new("kill").args([signal, &process.to_string()]).status().unwrap().success());
}

/// Waits until `met` holds.
fn wait_until(what: &str, mut met: impl FnMut() -> bool) {
    let start = Instant::now();
    while !met() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited a minute until {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries =
        fs::read_dir(folder).map(|entries| entries.flatten().collect()).unwrap_or_else(|_| Vec::new());
    entries.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn a_signal_leaves_no_temporary_file_and_sets_the_exit_code() {
    let asset = asset().display();
    for (signal, code) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129)] {
        let folder = tempfile::tempdir().unwrap();
        let mut child =
            start(&format!("render {asset} --turntable 5000 --size 160x120 -o {}", folder.path().display()));
        wait_until("pictures are written", || names(folder.path()).len() > 5);
        send(signal, child.id());
        assert_eq!(child.wait().unwrap().code(), Some(code), "{signal}");
        let left = names(folder.path());
        assert!(left.iter().all(|name| name.ends_with(".png")), "{signal}: {left:?}");
        let broken = |name: &&String| image::open(folder.path().join(name)).is_err();
        assert_eq!(left.iter().find(broken), None, "{signal}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_signal_ignored_by_the_parent_is_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let words = "trap '' HUP; exec \"$0\" render \"$1\" --turntable 200 --size 64x48 -o \"$2\"";
    let mut child = Command::new("sh")
        .args(["-c", words, env!("CARGO_BIN_EXE_vg")])
        .args([asset(), folder.path()])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    wait_until("pictures are written", || names(folder.path()).len() > 2);
    send("-HUP", child.id());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(names(folder.path()).len(), 200);
}

#[test]
fn a_file_beyond_the_limit_of_the_process_is_an_error_that_names_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let done = Command::new("sh")
        .args(["-c", "ulimit -f 16; exec \"$0\" demo \"$1\"", env!("CARGO_BIN_EXE_vg")])
        .arg(folder.path())
        .output()
        .unwrap();
    let err = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(1), "{err}");
    assert!(
        err.starts_with("vg: error: ") && err.contains("File too large") && err.contains("(ulimit -f)"),
        "{err}"
    );
    assert!(!err.contains(".part"), "{err}");
    assert!(names(&folder.path().join("scene/images")).is_empty());
}

#[test]
fn a_result_has_the_mode_of_the_file_that_it_replaces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.json");
    fs::write(&path, "old").unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o604)).unwrap();
    succeed(folder.path(), "align . --matrix vehicle_from_world.json -o {}/v.json");
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o604);
    assert!(fs::read_to_string(path).unwrap().contains("vehicle_from_world"));
}

#[test]
fn a_measuring_child_ends_when_its_parent_ends() {
    let mut child = start("reconstruct . --prior hull --refine 600s -o /dev/null --end-with-input");
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "it runs while its input is open");
    drop(child.stdin.take());
    assert_eq!(child.wait().unwrap().code(), Some(129));
}

#[cfg(target_os = "linux")]
#[test]
fn the_child_of_a_sweep_that_is_killed_ends_too() {
    // A point that takes long enough to be interrupted.
    let mut sweep = Command::new(env!("CARGO_BIN_EXE_vg"))
        .args(["pareto", ".", "--repeat", "1", "--point", "slow: --prior hull --refine 1s"])
        .current_dir(sample())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let id = sweep.id();
    let mut children = String::new();
    wait_until("the sweep measures memory", || {
        assert_eq!(sweep.try_wait().unwrap(), None);
        children = fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap_or_default();
        !children.trim().is_empty()
    });
    send("-KILL", id);
    sweep.wait().unwrap();
    let child = children.trim().to_owned();
    let state = || fs::read_to_string(format!("/proc/{child}/stat")).unwrap_or_default();
    // Ended, or a zombie that its new parent has not collected yet.
    wait_until("the child is gone", || {
        let state = state();
        state.is_empty() || state.rsplit(')').next().is_some_and(|rest| rest.trim().starts_with('Z'))
    });
}
