//! Invalid arguments: never a panic, always one line.

use super::*;

/// Arguments, and the expected exit code.
const TABLE: &[(&[&str], i32)] = &[
    (&["unknown"], 2),
    (&["--unknown"], 2),
    (&["reconstruct"], 2),
    (&["reconstruct", "."], 2),
    (&["reconstruct", "", "-o", "x"], 2),
    (&["reconstruct", ".", "-o", ""], 2),
    (&["reconstruct", ".", "--views", "", "-o", "/dev/null"], 2),
    (&["reconstruct", ".", "--views", "000,,001", "-o", "/dev/null"], 2),
    (&["reconstruct", ".", "--views", "../../../etc/passwd", "-o", "/dev/null"], 1),
    (&["reconstruct", "line\nbreak\u{1b}[31m", "-o", "x"], 1),
    (&["reconstruct", ".", "--views", "a\nb", "-o", "/dev/null"], 1),
    (&["reconstruct", ".", "--threads", "-1", "-o", "x"], 2),
    (&["reconstruct", ".", "--threads", "99999999", "-o", "/dev/null"], 1),
    (&["reconstruct", ".", "--threads", "99999999999999999999999", "-o", "x"], 2),
    (&["reconstruct", ".", "--sh-degree", "4", "-o", "x"], 2),
    (&["reconstruct", ".", "--keep", "everything", "-o", "x"], 2),
    (&["reconstruct", ".", "--prior", "best", "-o", "x"], 2),
    (&["reconstruct", ".", "--symmetry", "AUTO\n", "-o", "x"], 2),
    (&["reconstruct", ".", "--depth-scale", "0", "-o", "x"], 2),
    (&["reconstruct", ".", "--depth-scale", "inf", "-o", "x"], 2),
    (&["reconstruct", ".", "--vehicle-from-world", "split.json", "-o", "/dev/null"], 1),
    (&["reconstruct", "/dev/null", "-o", "x"], 1),
    (&["reconstruct", "/proc/self/mem", "-o", "x"], 1),
    (&["render", "/dev/null", "--turntable", "2", "-o", "x"], 1),
    (&["render", "x.ply", "-o", "x"], 2),
    (&["render", "x.ply", "--cameras", ".", "--turntable", "2", "-o", "x"], 2),
    (&["render", "x.ply", "--turntable", "0", "-o", "x"], 2),
    (&["render", "x.ply", "--turntable", "2", "--size", "0x5", "-o", "x"], 2),
    (&["render", "x.ply", "--turntable", "2", "--size", "99999x99999", "-o", "x"], 2),
    (&["info"], 2),
    (&["info", "/dev/null"], 1),
    (&["info", "/"], 1),
    (&["info", "a", "b"], 2),
    (&["eval"], 2),
    (&["eval", ".", "--repeat", "0"], 2),
    (&["eval", ".", "--split", "/dev/null"], 1),
    (&["demo", "a", "b"], 2),
    (&["demo", "/dev/null"], 1),
    (&["align", "."], 2),
    (&["align", ".", "--known-centers", "/dev/null", "-o", "/dev/null"], 1),
];

#[test]
fn invalid_arguments_are_errors_of_one_line() {
    for (args, code) in TABLE {
        let run = vg(args);
        assert_eq!((run.code, run.out.as_str()), (*code, ""), "{args:?}: {run:?}");
        assert_one_error(&run);
        assert!(run.err.trim_end().chars().all(|c| !c.is_control()), "{args:?}: {run:?}");
    }
}

#[test]
fn without_arguments_the_help_is_printed_as_a_usage_error() {
    let run = vg::<&str>(&[]);
    assert_eq!((run.code, run.out.as_str()), (2, ""));
    assert!(run.err.contains("Usage: vg"));
}

#[cfg(unix)]
#[test]
fn arguments_that_are_not_text_are_errors() {
    use std::os::unix::ffi::OsStrExt;
    let strange = std::ffi::OsStr::from_bytes(b"\xff\xfe.ply");
    for args in
        [vec!["info".as_ref(), strange], vec!["reconstruct".as_ref(), strange, "-o".as_ref(), strange]]
    {
        let run = vg(&args);
        assert_eq!(run.code, 1, "{run:?}");
        assert_one_error(&run);
    }
}
