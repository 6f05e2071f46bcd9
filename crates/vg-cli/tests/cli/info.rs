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
fn point_clouds_are_distinguished_from_gaussians() {
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
fn a_closed_pipe_is_not_an_error() {
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

/// The properties of a Gaussian except those of its colour.
const SHAPE: [&str; 11] =
    ["x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];

/// A file of Gaussians with these float properties, all of them `value` except the rotations, which are invalid.
fn ply(path: &Path, properties: &[&str], count: usize, value: f32) {
    let mut bytes = format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n").into_bytes();
    for name in properties {
        bytes.extend(format!("property float {name}\n").bytes());
    }
    bytes.extend(b"end_header\n");
    for i in 0..count {
        for name in properties {
            let number = match *name {
                "rot_0" => 1.0,
                "rot_1" | "rot_2" | "rot_3" => 0.0,
                "x" => i as f32 / (count.max(2) - 1) as f32,
                _ => value,
            };
            bytes.extend(number.to_le_bytes());
        }
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn gaussians_that_cannot_be_drawn_are_named_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let dc = ["f_dc_0", "f_dc_1", "f_dc_2"];
    let rest: Vec<String> = (0..72).map(|i| format!("f_rest_{i}")).collect();
    let rest: Vec<&str> = rest.iter().map(String::as_str).collect();
    let without = |name: &str| SHAPE.into_iter().filter(|n| *n != name).collect::<Vec<_>>();
    let packed = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
    for (properties, kind, way_out) in [
        ([&SHAPE[..], &dc, &rest].concat(), "SH degree 4", "SH degree 3 or less"),
        ([&without("scale_2"), &dc[..]].concat(), "2DGS", "scale_2"),
        ([&SHAPE[..], &["red", "green", "blue"]].concat(), "red, green and blue", "0.28209479"),
        (packed.to_vec(), "SuperSplat", "splat-transform"),
        ([&without("rot_1"), &dc[..]].concat(), "lack a property", "property rot_1: missing"),
    ] {
        ply(&path, &properties, 3, 0.5);
        let out = succeed(folder.path(), "info {}/a.ply").out;
        for word in ["Gaussians: 3", kind, way_out, "render and refine do not accept it"] {
            assert!(out.contains(word), "{word} in {out}");
        }
        assert!(!out.contains("problems: none"), "{out}");
        fail(folder.path(), "render {}/a.ply --turntable 1 -o {}/out", 1, &["a.ply: property ", way_out]);
        assert!(vg::io::ply::read(&path).unwrap_err().to_string().contains(way_out));
    }
}

#[test]
fn scales_and_opacities_without_logarithm_and_logit_give_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    ply(&path, &[&SHAPE[..], &["f_dc_0", "f_dc_1", "f_dc_2"]].concat(), 200, 0.01);
    let out = succeed(folder.path(), "info {}/a.ply").out;
    for word in ["every scale is 1.010 m or more", "ln(0.01) = -4.6", "instead of logits"] {
        assert!(out.contains(word), "{word} in {out}");
    }
    let run = vg_in(folder.path(), "render {}/a.ply --turntable 1 --size 64x48 -o {}/out");
    assert!(run.code == 0 && run.err.contains("vg: warning: every scale is 1.010 m or more"), "{run:?}");
}

#[test]
fn other_formats_are_named_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, says) in [
        ("car.spz", &b"\x1f\x8b\x08\x00\x00\x00\x00\x00"[..], ["SPZ", "splat-transform"]),
        ("car.sog", b"PK\x03\x04\x0a\x00\x00\x00\x00\x00meta.json", ["SOG", "splat-transform"]),
        ("car.splat", &[0; 64], [".splat", "splat-transform"]),
        ("car.ksplat", &[0; 64], [".ksplat", "splat-transform"]),
        ("car.glb", b"glTF\x02\x00\x00\x00", ["GLB", "export"]),
        ("car.usdz", b"PK\x03\x04\x0a\x00\x00\x00\x00\x00car.usdc", ["USDZ", "export"]),
    ] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let says = [name, says[0], "allowed: PLY", says[1]];
        fail(folder.path(), &format!("info {{}}/{name}"), 1, &says);
        fail(folder.path(), &format!("render {{}}/{name} --turntable 1 -o {{}}/out"), 1, &says);
        fail(folder.path(), &format!("reconstruct . --cloud {{}}/{name} -o /dev/null"), 1, &says);
    }
}

#[test]
fn names_of_properties_and_files_reach_standard_output_as_text() {
    let folder = tempfile::tempdir().unwrap();
    let evil = "\u{1b}[31mRED\u{1b}]0;pwned\u{7}\u{9b}2J\u{202e}gnp.exe";
    let properties = [&SHAPE[..], &["f_dc_0", "f_dc_1", "f_dc_2", evil]].concat();
    let path = folder.path().join(format!("{evil}\n.ply"));
    ply(&path, &properties, 1, -4.0);
    let run = vg(&[Path::new("info"), &path]);
    assert!(
        run.code == 0 && run.out.contains("\\u{1b}[31mRED\\u{1b}]0;pwned\\u{7}\\u{9b}2J\\u{202e}gnp.exe"),
        "{run:?}"
    );
    assert!(run.out.chars().all(|c| c == '\n' || !c.is_control() && c != '\u{202e}'), "{run:?}");

    let report = folder.path().join(format!("{evil}\n.json"));
    let words = ["align", ".", "--matrix", "vehicle_from_world.json", "-o"].map(Path::new);
    let run = vg(&[&words[..], &[&report]].concat());
    assert!(run.code == 0 && run.out.lines().count() == 1, "{run:?}");
    assert!(run.out.chars().all(|c| c == '\n' || !c.is_control()), "{run:?}");

    // Keys of a split, in the table, in Markdown and in JSON.
    let scene = copy_of_sample(&["transforms.json", "images", "masks", "depth"]);
    let split = serde_json::json!({ evil: { "input": ["000", "001"], "test": ["004"] } });
    std::fs::write(scene.path().join("split.json"), split.to_string()).unwrap();
    let words = "eval {} --split {}/split.json --prior given --json {}/e.json --markdown {}/t.md";
    let run = succeed(scene.path(), words);
    let text = |name: &str| std::fs::read_to_string(scene.path().join(name)).unwrap();
    for shown in [run.out, text("e.json"), text("t.md")] {
        assert!(shown.contains("RED"), "{shown}");
        assert!(shown.chars().all(|c| c == '\n' || !c.is_control() && c != '\u{202e}'), "{shown:?}");
    }
    assert_eq!(json(&scene.path().join("e.json"))["splits"][0]["split"], evil, "JSON has the original text");
}

#[cfg(unix)]
#[test]
fn a_model_is_read_from_a_pipe_as_from_a_file() {
    for name in ["-", "/dev/stdin"] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_vg"))
            .args(["info", name])
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = child.stdin.take().unwrap();
        let bytes = std::fs::read(asset()).unwrap();
        std::thread::spawn(move || std::io::Write::write_all(&mut input, &bytes));
        let out = child.wait_with_output().unwrap();
        assert!(out.status.success());
        let from_file = succeed(asset().parent().unwrap(), "info {}/sedan.ply").out;
        assert_eq!(String::from_utf8(out.stdout).unwrap(), from_file, "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo.ply");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let writer = {
        let fifo = fifo.clone();
        // Half of a vertex is missing.
        let mut bytes = std::fs::read(asset()).unwrap();
        bytes.truncate(bytes.len() - 100);
        std::thread::spawn(move || std::fs::write(fifo, bytes))
    };
    fail(folder.path(), "info {}/fifo.ply", 1, &["fifo.ply: vertex", "the file ends after it"]);
    let _ = writer.join().unwrap();
    fail(Path::new("."), "info /dev/zero", 1, &["/dev/zero", "is a device"]);
}
