//! `vg info`.

use super::*;

#[test]
fn gaussians_are_counted_and_measured() {
    let out = succeed(asset().parent().unwrap(), "info {}/sedan.ply").out;
    let (gaussians, _) = vg::io::ply::read(asset()).unwrap();
    let digits: String = out.lines().next().unwrap().chars().filter(char::is_ascii_digit).collect();
    assert_eq!(digits, gaussians.len().to_string());
    for word in ["SH degree:", "extent: 4.", "problems: none"] {
        assert!(out.contains(word), "{out}");
    }
}

#[test]
fn point_clouds_are_told_from_gaussians() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.ply");
    vg::io::ply::write_points(&path, &[[0.0; 3], [400.0, 0.0, 0.0]], &[[1; 3]; 2]).unwrap();
    let out = succeed(folder.path(), "info {}/p.ply").out;
    assert!(out.starts_with("points: 2\n") && out.contains("is the unit a metre?"), "{out}");
}

#[test]
fn problems_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let gaussians = vg::Gaussians::from_arrays(
        0,
        vec![[0.0; 3], [1.0, 0.0, 0.0]],
        vec![[1.0, 0.0, 0.0, 0.0]; 2],
        vec![[0.01; 3], [5.0; 3]],
        vec![0.9, 0.001],
        vec![0.0; 6],
    );
    vg::io::ply::write(&folder.path().join("a.ply"), &gaussians.unwrap()).unwrap();
    let out = succeed(folder.path(), "info {}/a.ply").out;
    assert!(out.contains("never drawn") && out.contains("larger than 3 m"), "{out}");
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_vg"))
        .args(["info", asset().to_str().unwrap()])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let done = child.wait_with_output().unwrap();
    assert_eq!((done.status.code(), done.stderr.as_slice()), (Some(0), &b""[..]));
}
