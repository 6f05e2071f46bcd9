//! Malformed files and arguments: each is refused by an error that names the file and field, or the argument.
//! One row per defect: its name, the words in the error, and the call.

use glam::{DMat3, DVec3};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use vg::geometry::{Camera, CameraModel, Intrinsics, Pose, Similarity};
use vg::io::depth::DepthFormat;
use vg::io::{SceneOptions, colmap, depth, image, list_scene, open_scene, ply, transforms, vehicle_frame};
use vg::render::{Background, RenderOptions};
use vg::scene::mask::{Label, Mask};
use vg::scene::{DepthMap, PixelFormat, RgbImage, Scene, View};
use vg::{Gaussians, Result};

/// Runs rows and collects failures.
#[derive(Default)]
struct Table {
    rows: usize,
    wrong: Vec<String>,
}

impl Table {
    /// `call` must fail with an error that contains all of `words`, and must not panic.
    fn row<T>(&mut self, defect: &str, words: &[&str], call: impl FnOnce() -> Result<T>) {
        self.rows += 1;
        let wrong = match catch_unwind(AssertUnwindSafe(call)) {
            Err(_) => "panicked".to_owned(),
            Ok(Ok(_)) => "was accepted".to_owned(),
            Ok(Err(e)) => {
                let text = e.to_string();
                match words.iter().find(|s| !text.contains(**s)) {
                    None => return,
                    Some(missing) => format!("the error lacks {missing:?}: {text}"),
                }
            }
        };
        self.wrong.push(format!("{defect}: {wrong}"));
    }

    fn finish(self, at_least: usize) {
        println!("{} malformed inputs refused by name", self.rows - self.wrong.len());
        assert!(self.wrong.is_empty(), "\n{}", self.wrong.join("\n"));
        assert!(self.rows >= at_least, "{} rows", self.rows);
    }
}

const POSE: &str = r#""transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]"#;

/// A document of one frame with these keys at the top and in the frame.
fn document(top: &str, frame: &str) -> String {
    format!(r#"{{{top} "frames": [{{"file_path": "images/a.png", {frame} {POSE}}}]}}"#)
}

#[test]
fn transforms() {
    let mut table = Table::default();
    let mut row = |defect: &str, words: &[&str], text: &str| {
        let words: Vec<&str> = [&["t.json: "], words].concat();
        table.row(defect, &words, || transforms::parse(text.as_bytes(), Path::new("t.json")));
    };
    let good = document(r#""fl_x": 100,"#, "");
    transforms::parse(good.as_bytes(), Path::new("t.json")).unwrap();
    row("empty file", &["EOF"], "");
    row("not JSON", &["line 1"], "fl_x = 100");
    row("cut off", &["EOF"], &good[..good.len() - 2]);
    row("text after the end", &["end of document"], &format!("{good} x"));
    row("nested without end", &["frames"], &format!("{{\"frames\": {}", "[".repeat(100_000)));
    row("an array for a document", &["document: not an object"], "[[]]");
    row("no frames key", &["frames"], "{}");
    row("no frames", &["frames", "empty"], r#"{"fl_x": 1, "frames": []}"#);
    row("frames is an object", &["frames"], r#"{"fl_x": 1, "frames": {}}"#);
    row("a frame is a number", &["frames[0]"], r#"{"fl_x": 1, "frames": [7]}"#);
    row("no file_path", &["frames[0]", "file_path"], &format!(r#"{{"fl_x": 1, "frames": [{{{POSE}}}]}}"#));
    row(
        "no transform_matrix",
        &["frames[0]", "transform_matrix"],
        r#"{"fl_x": 1, "frames": [{"file_path": "a.png"}]}"#,
    );
    for (defect, path) in [
        ("absolute file_path", "/etc/passwd"),
        ("file_path above the folder", "../a.png"),
        ("file_path above the folder by a detour", "images/../../a.png"),
        ("empty file_path", ""),
        ("file_path of a dot", "."),
    ] {
        let text = good.replace("images/a.png", path);
        row(defect, &["frames[0].file_path", "allowed"], &text);
    }
    row(
        "mask_path above the folder",
        &["frames[0].mask_path"],
        &document(r#""fl_x": 1,"#, r#""mask_path": "../m.png","#),
    );
    row(
        "depth_file_path absolute",
        &["frames[0].depth_file_path"],
        &document(r#""fl_x": 1,"#, r#""depth_file_path": "/d.png","#),
    );
    for (defect, matrix, words) in [
        ("a matrix of three columns", "[[1,0,0],[0,1,0],[0,0,1]]", "transform_matrix[0]"),
        ("a matrix of two rows", "[[1,0,0,0],[0,1,0,0]]", "transform_matrix"),
        ("a matrix of five rows", "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1],[0,0,0,1]]", "5"),
        ("a last row that is no last row", "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]", "last row"),
        ("a word in the matrix", "[[1,0,0,\"x\"],[0,1,0,0],[0,0,1,0]]", "transform_matrix[0][3]"),
        ("NaN in the matrix", "[[NaN,0,0,0],[0,1,0,0],[0,0,1,0]]", "transform_matrix[0]"),
        ("1e999 in the matrix", "[[1e999,0,0,0],[0,1,0,0],[0,0,1,0]]", "transform_matrix[0]"),
        ("a mirrored pose", "[[-1,0,0,0],[0,1,0,0],[0,0,1,0]]", "frames[0].transform_matrix: |R^T R"),
        ("a scaled pose", "[[2,0,0,0],[0,2,0,0],[0,0,2,0]]", "frames[0].transform_matrix: |R^T R"),
        ("a zero pose", "[[0,0,0,0],[0,0,0,0],[0,0,0,0]]", "frames[0].transform_matrix"),
        ("a matrix that is null", "null", "frames[0].transform_matrix"),
    ] {
        let text =
            format!(r#"{{"fl_x": 1, "frames": [{{"file_path": "a.png", "transform_matrix": {matrix}}}]}}"#);
        row(defect, &[words], &text);
    }
    for (defect, top, frame, words) in [
        ("no focal length", "", "", "frames[0].fl_x"),
        ("a focal length of zero", r#""fl_x": 0,"#, "", "frames[0].focal length"),
        ("a negative focal length", "", r#""fl_x": -5,"#, "frames[0].focal length"),
        ("a focal length that is a word", r#""fl_x": "100","#, "", "fl_x: invalid type"),
        ("a field of view of 0", r#""camera_angle_x": 0,"#, "", "frames[0].focal length"),
        ("a field of view of 2 pi", r#""camera_angle_x": 6.283185307179586,"#, "", "frames[0].focal length"),
        ("a principal point at 1e300", r#""fl_x": 1, "cx": 1e300,"#, "", "frames[0].principal point"),
        ("w without h", r#""fl_x": 1, "w": 5,"#, "", "frames[0].w, h"),
        ("half a pixel of width", r#""fl_x": 1, "w": 5.5, "h": 5,"#, "", "frames[0].w, h: 5.5x5"),
        ("a width of 0", r#""fl_x": 1, "w": 0, "h": 5,"#, "", "frames[0].w, h: 0x5"),
        ("a width of 1e9", r#""fl_x": 1, "w": 1e9, "h": 5,"#, "", "8192x8192"),
        (
            "an unknown camera model",
            r#""fl_x": 1, "camera_model": "EQUIRECTANGULAR","#,
            "",
            "EQUIRECTANGULAR",
        ),
        (
            "a pinhole with k1",
            r#""fl_x": 1, "k1": 0.1, "camera_model": "PINHOLE","#,
            "",
            "frames[0].camera_model",
        ),
        ("OPENCV with k4", r#""fl_x": 1, "k4": 0.1,"#, "", "frames[0].camera_model"),
        ("a fisheye with p1", r#""fl_x": 1, "p1": 1, "camera_model": "OPENCV_FISHEYE","#, "", "camera_model"),
        (
            "a depth unit of 0",
            r#""fl_x": 1, "depth_unit_scale_factor": 0,"#,
            "",
            "depth_unit_scale_factor: 0",
        ),
        (
            "a negative depth unit",
            r#""fl_x": 1, "depth_unit_scale_factor": -1,"#,
            "",
            "depth_unit_scale_factor",
        ),
        (
            "an applied_transform of one row",
            r#""fl_x": 1, "applied_transform": [[1,0,0,0]],"#,
            "",
            "applied_transform",
        ),
    ] {
        row(defect, &[words], &document(top, frame));
    }
    table.row("a file name that is no UTF-8", &["t.json"], || {
        let bytes = good.replace("a.png", "a.p\u{1}g").into_bytes();
        let bytes: Vec<u8> = bytes.into_iter().map(|b| if b == 1 { 0xff } else { b }).collect();
        transforms::parse(&bytes, Path::new("t.json"))
    });
    table.finish(40);
}

/// Little-endian bytes of the parts of a record.
#[derive(Clone, Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn u32(mut self, v: u32) -> Self {
        self.0.extend(v.to_le_bytes());
        self
    }
    fn u64(mut self, v: u64) -> Self {
        self.0.extend(v.to_le_bytes());
        self
    }
    fn f64s(mut self, v: &[f64]) -> Self {
        self.0.extend(v.iter().flat_map(|v| v.to_le_bytes()));
        self
    }
    fn text(mut self, v: &[u8]) -> Self {
        self.0.extend(v);
        self
    }
    fn camera(self, id: u32, model: u32, w: u64, h: u64, params: &[f64]) -> Self {
        self.u32(id).u32(model).u64(w).u64(h).f64s(params)
    }
    fn image(self, id: u32, pose: &[f64; 7], camera: u32, name: &[u8], features: u64) -> Self {
        self.u32(id).f64s(pose).u32(camera).text(name).text(&[0]).u64(features)
    }
}

const PINHOLE: [f64; 4] = [100.0, 100.0, 32.0, 24.0];
const STILL: [f64; 7] = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

#[test]
fn colmap_binary() {
    let mut table = Table::default();
    let mut cameras = |defect: &str, words: &[&str], bytes: Bytes| {
        let words: Vec<&str> = [&["cameras.bin: "], words].concat();
        table.row(defect, &words, || colmap::cameras_from_binary(&bytes.0, Path::new("cameras.bin")));
    };
    let b = Bytes::default;
    let one = |w, h, params: &[f64]| b().u64(1).camera(3, 1, w, h, params);
    let good = one(64, 48, &PINHOLE);
    assert_eq!(colmap::cameras_from_binary(&good.0, Path::new("c")).unwrap().len(), 1);
    cameras("empty", &["count"], b());
    cameras("half a count", &["count"], b().u32(1));
    cameras("2^64 - 1 cameras", &["count: 18446744073709551615"], b().u64(u64::MAX));
    cameras("more cameras than bytes", &["count: 2 cameras", "room for 1"], {
        b().u64(2).camera(3, 1, 64, 48, &PINHOLE)
    });
    cameras("parameters cut off", &["camera record 1 of 1"], b().u64(1).camera(3, 6, 64, 48, &[1.0; 11]));
    cameras("a byte too many", &["count: 1 bytes after"], good.clone().text(b"x"));
    cameras("model 5000", &["camera 3.model: model 5000"], b().u64(1).camera(3, 5000, 64, 48, &PINHOLE));
    cameras("model -1", &["camera 3.model: model -1"], b().u64(1).camera(3, u32::MAX, 64, 48, &PINHOLE));
    for (id, name) in
        [(7, "FOV"), (8, "SIMPLE_RADIAL_FISHEYE"), (10, "THIN_PRISM_FISHEYE"), (17, "EQUIRECTANGULAR")]
    {
        let words = format!("camera 3.model: {name};");
        cameras(name, &[&words, "image_undistorter"], b().u64(1).camera(3, id, 64, 48, &PINHOLE));
    }
    cameras("no width", &["camera 3.size"], one(0, 48, &PINHOLE));
    cameras("a height of 2^40", &["camera 3.size"], one(64, 1 << 40, &PINHOLE));
    cameras("a NaN focal length", &["camera 3.focal length"], one(64, 48, &[f64::NAN, 1.0, 1.0, 1.0]));
    cameras(
        "an infinite centre",
        &["camera 3.principal point"],
        one(64, 48, &[1.0, 1.0, f64::INFINITY, 1.0]),
    );
    cameras("a NaN coefficient", &["camera 3.distortion"], {
        b().u64(1).camera(3, 2, 64, 48, &[1.0, 1.0, 1.0, f64::NAN])
    });
    cameras("one id twice", &["camera 3.id"], {
        b().u64(2).camera(3, 1, 64, 48, &PINHOLE).camera(3, 1, 64, 48, &PINHOLE)
    });

    let mut images = |defect: &str, words: &[&str], bytes: Bytes| {
        let words: Vec<&str> = [&["images.bin: "], words].concat();
        table.row(defect, &words, || {
            let cameras = colmap::cameras_from_binary(&good.0, Path::new("cameras.bin"))?;
            let path = Path::new("images.bin");
            colmap::Model::new(cameras, colmap::images_from_binary(&bytes.0, path)?, path)
        });
    };
    let named = |name: &[u8]| b().u64(1).image(9, &STILL, 3, name, 0);
    let posed = |pose: &[f64; 7]| b().u64(1).image(9, pose, 3, b"a.png", 0);
    images("no images", &["images: none"], b().u64(0));
    images("2^60 images", &["count"], b().u64(1 << 60));
    images("a pose cut off", &["image record 2 of 2"], {
        b().u64(2).image(9, &STILL, 3, b"a.png", 3).f64s(&[0.0; 9]).u32(4).f64s(&STILL)
    });
    images("a name without end", &["image record 1 of 1"], {
        b().u64(1).u32(9).f64s(&STILL).u32(3).text(b"a.png and so on and on")
    });
    images(
        "2^61 features",
        &["image record 1 of 1", "features"],
        b().u64(1).image(9, &STILL, 3, b"a", 1 << 61),
    );
    images("features cut off", &["image record 1 of 1", "features"], {
        b().u64(1).image(9, &STILL, 3, b"a", 2).f64s(&[0.0; 5])
    });
    images("a zero quaternion", &["image 9.pose", "quaternion"], posed(&[0.0; 7]));
    images("a NaN quaternion", &["image 9.pose"], posed(&[f64::NAN, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]));
    images(
        "an infinite translation",
        &["image 9.pose"],
        posed(&[1.0, 0.0, 0.0, 0.0, f64::INFINITY, 0.0, 0.0]),
    );
    images("a name that is no UTF-8", &["image 9.name", "UTF-8"], named(b"a\xff.png"));
    images("an absolute name", &["image 9.name"], named(b"/etc/passwd"));
    images("a name above the folder", &["image 9.name"], named(b"../../a.png"));
    images("no name", &["image 9.name"], named(b""));
    images("a camera that is not there", &["image 9.camera_id: 4"], b().u64(1).image(9, &STILL, 4, b"a", 0));
    images("one id twice", &["image 9.id"], {
        b().u64(2).image(9, &STILL, 3, b"a.png", 0).image(9, &STILL, 3, b"b.png", 0)
    });
    images("one name twice", &["image 8.name", "image 9"], {
        b().u64(2).image(9, &STILL, 3, b"a.png", 0).image(8, &STILL, 3, b"./a.png", 0)
    });

    let mut points = |defect: &str, words: &[&str], bytes: Bytes| {
        let words: Vec<&str> = [&["points3D.bin: "], words].concat();
        table.row(defect, &words, || colmap::points_from_binary(&bytes.0, Path::new("points3D.bin")));
    };
    let point = |xyz: &[f64; 3], track| b().u64(1).u64(5).f64s(xyz).text(&[1, 2, 3]).f64s(&[0.5]).u64(track);
    points("2^50 points", &["count"], b().u64(1 << 50));
    points("a NaN point", &["point 5.xyz"], point(&[0.0, f64::NAN, 0.0], 0));
    points("2^61 track elements", &["point record 1 of 1"], point(&[0.0; 3], 1 << 61));
    table.finish(37);
}

#[test]
fn colmap_text() {
    let mut table = Table::default();
    let mut cameras = |defect: &str, words: &str, text: &str| {
        table.row(defect, &["cameras.txt: ", words], || {
            colmap::cameras_from_text(text.as_bytes(), Path::new("cameras.txt"))
        });
    };
    cameras("no model", "line 2.MODEL: missing", "# cameras\n3\n");
    cameras("an id that is a word", "line 1.CAMERA_ID", "three PINHOLE 64 48 1 1 1 1");
    cameras("a negative id", "line 1.CAMERA_ID", "-3 PINHOLE 64 48 1 1 1 1");
    cameras("an unknown model", "camera 3.model: FOV", "3 FOV 64 48 1 1 1 1 1");
    cameras("a width with a comma", "line 1.WIDTH", "3 PINHOLE 64, 48 1 1 1 1");
    cameras("too few parameters", "camera 3.params: 3 numbers", "3 PINHOLE 64 48 1 1 1");
    cameras("too many parameters", "camera 3.params: 5 numbers", "3 PINHOLE 64 48 1 1 1 1 1 1 1");
    cameras("a parameter that is a word", "line 1.PARAMS", "3 PINHOLE 64 48 1 1 x 1");
    cameras("a NaN parameter", "camera 3.focal length", "3 PINHOLE 64 48 nan 1 1 1");
    cameras("one id twice", "camera 3.id", "3 PINHOLE 64 48 1 1 1 1\n3 PINHOLE 64 48 1 1 1 1");
    let mut images = |defect: &str, words: &str, text: &[u8]| {
        table.row(defect, &["images.txt: ", words], || {
            colmap::images_from_text(text, Path::new("images.txt"))
        });
    };
    images("a pose cut off", "line 1.TX: missing", b"9 1 0 0 0");
    images("a quaternion that is a word", "line 1.QY", b"9 1 0 i 0 0 0 0 3 a.png\n\n");
    images("no name", "image 9.name", b"9 1 0 0 0 0 0 0 3\n\n");
    images("a zero quaternion", "image 9.pose", b"9 0 0 0 0 0 0 0 3 a.png\n\n");
    images("an absolute name", "image 9.name", b"9 1 0 0 0 0 0 0 3 /a.png\n\n");
    images("bytes that are no UTF-8", "line 1", b"9 1 0 0 0 0 0 0 3 a\xff.png\n\n");
    images(
        "no line of features",
        "line 2: not POINTS2D",
        b"9 1 0 0 0 0 0 0 3 a.png\n8 1 0 0 0 0 0 0 3 b.png\n",
    );
    table.row("a point without colour", &["points3D.txt: line 1.R: missing"], || {
        colmap::points_from_text(b"5 1 2 3", Path::new("points3D.txt"))
    });
    table.row("a colour of 256", &["points3D.txt: line 1.G"], || {
        colmap::points_from_text(b"5 1 2 3 0 256 0 0", Path::new("points3D.txt"))
    });
    table.finish(19);
}

const GAUSSIAN: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
    "rot_1", "rot_2", "rot_3",
];

/// A PLY file of one Gaussian, its header changed by `edit` and one value replaced.
fn ply_file(edit: impl Fn(String) -> String, value: Option<(&str, f32)>) -> Vec<u8> {
    let properties: String = GAUSSIAN.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{properties}end_header\n");
    let mut bytes = edit(header).into_bytes();
    for name in GAUSSIAN {
        let v = match value {
            Some((changed, v)) if changed == name => v,
            _ => f32::from(u8::from(name == "rot_0")),
        };
        bytes.extend(v.to_le_bytes());
    }
    bytes
}

#[test]
fn ply_files() {
    let mut table = Table::default();
    let read = |bytes: &[u8]| ply::read_from(bytes, bytes.len() as u64, Path::new("m.ply"));
    read(&ply_file(|h| h, None)).unwrap();
    for (defect, words, from, to) in [
        ("not PLY", "magic", "ply\n", "plx\n"),
        ("ASCII", "format: \"format ascii 1.0\"", "binary_little_endian", "ascii"),
        ("big-endian", "binary_big_endian", "little", "big"),
        ("no end of the header", "header: ends before", "end_header\n", ""),
        ("a count that is a word", "element vertex: count", "vertex 1", "vertex one"),
        ("a negative count", "element vertex: count", "vertex 1", "vertex -1"),
        ("more rows than bytes", "element vertex: 2 rows", "vertex 1", "vertex 2"),
        ("2^64 - 1 rows", "element vertex: 18446744073709551615", "vertex 1", "vertex 18446744073709551615"),
        ("a count beyond 64 bits", "element vertex: count", "vertex 1", "vertex 99999999999999999999"),
        ("no vertices", "element vertex: missing", "element vertex", "element point"),
        ("vertices twice", "element vertex: given twice", "end_header", "element vertex 1\nend_header"),
        ("a list property", "property of vertex", "end_header", "property list uchar int n\nend_header"),
        ("an unknown type", "type \"half\"", "float x", "half x"),
        ("a property twice", "x twice", "float y", "float x"),
        ("a property before any element", "before any element", "element vertex 1\n", ""),
        ("a line that is none of PLY's", "header: \"vertices 3\"", "end_header", "vertices 3\nend_header"),
        ("no z", "property z: missing", "float z", "float zz"),
        ("no opacity", "property opacity: missing", "float opacity", "float alpha"),
        ("no rotation", "property rot_3: missing", "float rot_3", "float rot_4"),
        ("no colour", "property f_dc_0: missing", "float f_dc_0", "float red"),
        ("one f_rest", "property f_rest_*: 1 of them", "end_header", "property float f_rest_0\nend_header"),
    ] {
        // Four bytes more than the row needs, for the rows with one property more.
        let bytes = ply_file(|h| h.replacen(from, to, 1), None);
        let bytes = [bytes, vec![0; 4]].concat();
        let bytes = if defect == "more rows than bytes" { &bytes[..bytes.len() - 4] } else { &bytes[..] };
        table.row(defect, &["m.ply: ", words], || read(bytes));
    }
    for (name, value) in [
        ("x", f32::NAN),
        ("z", f32::INFINITY),
        ("f_dc_2", f32::NEG_INFINITY),
        ("opacity", f32::NAN),
        ("scale_1", f32::NAN),
        ("scale_1", f32::INFINITY),
        ("scale_2", 50.0),
        ("rot_0", 0.0),
        ("rot_2", f32::NAN),
    ] {
        let field = format!("vertex 0.{name}");
        table.row(&format!("{name} = {value}"), &["m.ply: ", &field], || {
            read(&ply_file(|h| h, Some((name, value))))
        });
    }
    table.row("empty", &["m.ply: header"], || read(b""));
    table.row("a header that is no UTF-8", &["m.ply: header"], || read(b"ply\n\xff\xfe\n"));
    table.row("a header without end", &["m.ply: header"], || {
        let comments = b"comment and so on\n".repeat(1 << 16);
        read(&[&b"ply\nformat binary_little_endian 1.0\n"[..], &comments].concat())
    });
    table.row("a file shorter than its header claims", &["m.ply: vertex 0"], || {
        let bytes = ply_file(|h| h, None);
        ply::read_from(&bytes[..bytes.len() - 1], bytes.len() as u64, Path::new("m.ply"))
    });
    table.row("points without z", &["p.ply: property z"], || {
        let bytes = ply_file(|h| h.replacen("float z", "float zz", 1), None);
        ply::read_points_from(&bytes[..], bytes.len() as u64, Path::new("p.ply"))
    });
    table.row("colours fewer than points", &["colors"], || {
        ply::write_points(Path::new("/nowhere/p.ply"), &[[0.0; 3]], &[])
    });
    table.row("a folder that is not there", &["/nowhere/m.ply"], || {
        ply::write(Path::new("/nowhere/m.ply"), &Gaussians::with_capacity(0, 0))
    });
    table.finish(35);
}

#[test]
fn pictures_and_depth() {
    let mut table = Table::default();
    let dir = tempfile::tempdir().unwrap();
    let png = {
        let path = dir.path().join("a.png");
        image::write_rgb8(&path, 4, 2, &[[7; 3]; 8]).unwrap();
        fs::read(path).unwrap()
    };
    let decode = |bytes: &[u8]| image::decode(bytes, Path::new("a.png"));
    decode(&png).unwrap();
    table.row("empty picture", &["a.png: format: unknown"], || decode(b""));
    table.row("text for a picture", &["a.png: format: unknown"], || decode(b"hello, picture"));
    table.row("a GIF", &["a.png: format: Gif"], || decode(b"GIF89a\x01\0\x01\0\0\0\0"));
    table.row("a PNG cut off", &["a.png: picture"], || decode(&png[..png.len() - 20]));
    table.row("a PNG of its magic alone", &["a.png: picture"], || decode(&png[..8]));
    let mut huge = png.clone();
    huge[16..20].copy_from_slice(&60000u32.to_be_bytes());
    // The checksum of the header is wrong as well; either error is correct, but 60000 columns must not be allocated.
    table.row("a PNG 60000 wide", &["a.png: "], || decode(&huge));
    table.row("a JPEG cut off", &["a.png: picture: ends before"], || {
        decode(&[0xff, 0xd8, 0xff, 0xda, 0, 2, 1, 2])
    });
    table.row("a colour picture for depth", &["a.png: pixels", "16-bit grey"], || {
        depth::decode(DepthFormat::Png, &png, Path::new("a.png"), 1.0)
    });
    table.row("a folder for a picture", &["is a folder"], || image::read(dir.path()));
    table.row("no picture", &["none.png"], || image::read(&dir.path().join("none.png")));
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        table.row("a depth unit", &["depth_scale"], || {
            depth::decode(DepthFormat::Png, &png, Path::new("a.png"), unit)
        });
    }
    table.row("depth in a .tiff", &["d.tiff: extension"], || depth::read(Path::new("d.tiff"), 1.0));
    let mut pfm = |defect: &str, words: &str, bytes: &[u8]| {
        table.row(defect, &["d.pfm: ", words], || {
            depth::decode(DepthFormat::Pfm, bytes, Path::new("d.pfm"), 1.0)
        });
    };
    pfm("empty", "magic", b"");
    pfm("a colour map", "magic", b"PF\n1 1\n-1\n\0\0\0\0\0\0\0\0\0\0\0\0");
    pfm("no size", "width", b"Pf\n");
    pfm("a size of 1e9", "size", b"Pf\n1000000000 1000000000\n-1\n");
    pfm("a size of NaN", "size", b"Pf\nnan 1\n-1\n\0\0\0\0");
    pfm("a scale of 0", "scale", b"Pf\n1 1\n0\n\0\0\0\0");
    pfm("rows cut off", "data: 3 bytes", b"Pf\n1 1\n-1\n\0\0\0");
    let mut npy = |defect: &str, words: &str, header: &str, data: &[u8]| {
        let mut bytes = b"\x93NUMPY\x01\0".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        table.row(defect, &["d.npy: ", words], || {
            depth::decode(DepthFormat::Npy, &bytes, Path::new("d.npy"), 1.0)
        });
    };
    npy("an empty header", "descr", "", b"");
    npy("objects", "descr", "{'descr': '|O', 'fortran_order': False, 'shape': (1, 1), }", &[0; 8]);
    npy("half floats", "descr", "{'descr': '<f2', 'fortran_order': False, 'shape': (1, 1), }", &[0; 2]);
    npy(
        "Fortran order",
        "fortran_order",
        "{'descr': '<f4', 'fortran_order': True, 'shape': (1, 1), }",
        &[0; 4],
    );
    npy("a vector", "shape", "{'descr': '<f4', 'fortran_order': False, 'shape': (4,), }", &[0; 16]);
    npy("a scalar", "shape", "{'descr': '<f4', 'fortran_order': False, 'shape': (), }", &[0; 4]);
    npy("an empty array", "size", "{'descr': '<f4', 'fortran_order': False, 'shape': (0, 4), }", &[]);
    npy("too few values", "data", "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }", &[0; 31]);
    table.row("a .npy of another magic", &["d.npy: header"], || {
        depth::decode(DepthFormat::Npy, b"PK\x03\x04", Path::new("d.npy"), 1.0)
    });
    table.row("a .npy header longer than the file", &["d.npy: header"], || {
        depth::decode(DepthFormat::Npy, b"\x93NUMPY\x02\0\xff\xff\xff\xff{", Path::new("d.npy"), 1.0)
    });
    table.row("text for an .exr", &["d.exr: "], || {
        depth::decode(DepthFormat::Exr, b"v/1\x01 no", Path::new("d.exr"), 1.0)
    });
    for (size, pixels) in [((0, 2), 0), ((2, 2), 3), ((9000, 1), 9000)] {
        table.row("pixels that do not fit the size", &["pixels"], || {
            image::write_rgb8(&dir.path().join("o.png"), size.0, size.1, &vec![[0; 3]; pixels])
        });
    }
    table.finish(35);
}

#[test]
fn scenes_on_disk() {
    let mut table = Table::default();
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    let open = |path: &Path| open_scene(path, &SceneOptions::default());
    table.row("a path to nothing", &["nothing"], || open(&root.join("nothing")));
    table.row("a folder without a scene", &["scene", "transforms.json", "COLMAP"], || open(root));
    fs::write(root.join("notes.md"), "# notes").unwrap();
    table.row("a file of another kind", &["notes.md: scene"], || open(&root.join("notes.md")));

    fs::create_dir(root.join("images")).unwrap();
    image::write_rgb8(&root.join("images/a.png"), 4, 2, &[[7; 3]; 8]).unwrap();
    let scene =
        |top: &str, frame: &str| fs::write(root.join("transforms.json"), document(top, frame)).unwrap();
    scene(r#""fl_x": 4, "w": 5, "h": 2,"#, "");
    table.row("a picture of another width", &["a.png: size: 4x2", "5x2"], || open(root));
    scene(r#""fl_x": 4,"#, r#""mask_path": "masks/none.png","#);
    table.row("a mask that is not there", &["masks/none.png"], || open(root));
    fs::create_dir(root.join("masks")).unwrap();
    image::write_mask(&root.join("masks/m.png"), &Mask::new(3, 2, vec![Label::Vehicle; 6]).unwrap()).unwrap();
    scene(r#""fl_x": 4,"#, r#""mask_path": "masks/m.png","#);
    table.row("a mask of another size", &["masks/m.png: size: 3x2"], || open(root));
    scene(r#""fl_x": 4,"#, r#""mask_path": "transforms.json","#);
    table.row("a mask that is no picture", &["transforms.json: format"], || open(root));
    scene(r#""fl_x": 4,"#, r#""depth_file_path": "images/a.png","#);
    table.row("depth of 8 bits", &["a.png: pixels"], || open(root));
    scene(r#""fl_x": 4,"#, r#""depth_file_path": "images/a.jpg","#);
    table.row("depth as JPEG", &["a.jpg: extension"], || open(root));
    image::write_depth16(&root.join("d.png"), 2, 2, &[1.0; 4]).unwrap();
    scene(r#""fl_x": 4,"#, r#""depth_file_path": "d.png","#);
    table.row("depth of another size", &["d.png: size: 2x2"], || open(root));
    scene(r#""fl_x": 4, "applied_scale": 0.5,"#, "");
    table.row("poses that were scaled", &["transforms.json: applied_scale"], || open(root));
    let frame = format!(r#"{{"file_path": "images/a.png", {POSE}}}"#);
    let twice = format!(r#"{{"fl_x": 4, "frames": [{frame}, {frame}]}}"#);
    fs::write(root.join("transforms.json"), twice).unwrap();
    table.row("one picture twice", &["frames[1].file_path"], || open(root));

    scene(r#""fl_x": 4,"#, "");
    let with = |options: SceneOptions| list_scene(root, &options);
    let views = |names: &[&str]| SceneOptions {
        views: Some(names.iter().map(|n| (*n).to_owned()).collect()),
        ..SceneOptions::default()
    };
    table.row("a view that is not there", &["views[1]: \"b\"", "a.png"], || with(views(&["a", "b"])));
    table.row("an empty name", &["views[0]: \"\""], || with(views(&[""])));
    table.row("no view", &["views: 0"], || open_scene(root, &views(&[])));
    for unit in [0.0, f64::NAN] {
        table.row("a depth unit", &["depth_scale"], || {
            with(SceneOptions { depth_scale: Some(unit), ..SceneOptions::default() })
        });
    }
    let frame = |path: &str| format!(r#"{{"file_path": "{path}", "w": 4, "h": 2, {POSE}}}"#);
    let both = format!(r#"{{"fl_x": 4, "frames": [{}, {}]}}"#, frame("left/a.png"), frame("right/a.png"));
    fs::write(root.join("transforms.json"), both).unwrap();
    table.row("a name of two views", &["views[0]", "left/a.png", "right/a.png"], || with(views(&["a"])));
    fs::remove_file(root.join("images/a.png")).unwrap();
    scene(r#""fl_x": 4,"#, "");
    table.row("no size and no picture", &["images/a.png"], || with(SceneOptions::default()));
    fs::remove_file(root.join("transforms.json")).unwrap();
    fs::write(root.join("cameras.txt"), "1 PINHOLE 4 2 4 4 2 1\n").unwrap();
    table.row("a model of half its files", &["scene"], || open(root));
    table.row("a model of half its files, by name", &["cameras, images: missing"], || {
        colmap::read_model(root)
    });
    fs::write(root.join("images.txt"), "1 1 0 0 0 0 0 3 1 a.png\n\n").unwrap();
    table.row("a model without a gauge", &["vehicle_from_world", "--vehicle-from-world"], || open(root));

    let v = |text: &str| vehicle_frame::parse_vehicle_from_world(text.as_bytes(), Path::new("v.json"));
    for (defect, text, words) in [
        ("no key", r#"{"matrix": []}"#, "vehicle_from_world: missing"),
        ("a number", "3", "not a 4x4 matrix"),
        ("three rows", "[[1,0,0,0],[0,1,0,0],[0,0,1,0]]", "not a 4x4 matrix"),
        ("short rows", "[[1,0,0],[0,1,0],[0,0,1],[0,0,0]]", "not a 4x4 matrix"),
        ("15 numbers", "[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0]", "not a 4x4 matrix"),
        ("a word", r#"["a",0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]"#, "not a 4x4 matrix"),
        ("column-major", "[1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]", "last row"),
        ("a mirror", "[1,0,0,0, 0,-1,0,0, 0,0,1,0, 0,0,0,1]", "det"),
        ("zero", "[0,0,0,0, 0,0,0,0, 0,0,0,0, 0,0,0,1]", "det"),
        ("two scales", "[1,0,0,0, 0,2,0,0, 0,0,1,0, 0,0,0,1]", "|R^T R - I|"),
        ("not JSON", "1 0 0 0", "v.json: "),
    ] {
        table.row(&format!("vehicle_from_world: {defect}"), &["v.json: ", words], || v(text));
    }
    table.row("centres of two numbers", &["k.json: a.png"], || {
        vehicle_frame::parse_known_centers(br#"{"a.png": [1, 2]}"#, Path::new("k.json"))
    });
    let known = [("a.png".to_owned(), DVec3::ZERO)];
    table.row("one centre", &["points: 1 in each list"], || {
        vehicle_frame::vehicle_from_known_centers(root, &known)
    });
    table.finish(35);
}

#[test]
fn arguments() {
    let mut table = Table::default();
    let g = |degree, rotation: [f32; 4], scale: [f32; 3], opacity: f32, sh: usize| {
        Gaussians::from_arrays(
            degree,
            vec![[0.0; 3]],
            vec![rotation],
            vec![scale],
            vec![opacity],
            vec![0.0; sh],
        )
    };
    let unit = [1.0, 0.0, 0.0, 0.0];
    table.row("SH degree 4", &["sh_degree: 4"], || g(4, unit, [1.0; 3], 1.0, 75));
    table.row("SH of another degree", &["sh: 3 entries"], || g(1, unit, [1.0; 3], 1.0, 3));
    table.row("a zero quaternion", &["rotations[0]"], || g(0, [0.0; 4], [1.0; 3], 1.0, 3));
    table.row("a NaN quaternion", &["rotations[0]"], || g(0, [f32::NAN; 4], [1.0; 3], 1.0, 3));
    table.row("a scale of 0", &["scales[0]"], || g(0, unit, [1.0, 0.0, 1.0], 1.0, 3));
    table.row("a negative scale", &["scales[0]"], || g(0, unit, [-1.0; 3], 1.0, 3));
    table.row("an opacity of 1.1", &["opacities[0]"], || g(0, unit, [1.0; 3], 1.1, 3));
    table.row("a NaN opacity", &["opacities[0]"], || g(0, unit, [1.0; 3], f32::NAN, 3));
    table.row("means without the rest", &["rotations"], || {
        Gaussians::from_arrays(0, vec![[0.0; 3]], vec![], vec![], vec![], vec![])
    });
    table.row("a NaN mean", &["means[0]"], || {
        Gaussians::from_arrays(0, vec![[f32::NAN; 3]], vec![unit], vec![[1.0; 3]], vec![1.0], vec![0.0; 3])
    });

    table.row("seven parameters", &["c.params: 7 numbers"], || {
        Camera::from_colmap("c", CameraModel::OpenCv, 4, 4, &[1.0; 7], Pose::IDENTITY)
    });
    let lens = |fx, cx| Intrinsics { fx, fy: 1.0, cx, cy: 0.0 };
    let pinhole = |w, h, i| Camera::pinhole(w, h, i, Pose::IDENTITY);
    table.row("a camera without rows", &["camera.size: 4x0"], || pinhole(4, 0, lens(1.0, 0.0)));
    table.row("a camera of 8193 columns", &["camera.size"], || pinhole(8193, 4, lens(1.0, 0.0)));
    table.row("a focal length of 0", &["camera.focal length"], || pinhole(4, 4, lens(0.0, 0.0)));
    table.row("a NaN focal length", &["camera.focal length"], || pinhole(4, 4, lens(f64::NAN, 0.0)));
    table.row("a NaN principal point", &["camera.principal point"], || pinhole(4, 4, lens(1.0, f64::NAN)));
    table.row("a NaN pose", &["camera.vehicle_from_camera"], || {
        let pose = Pose { translation: DVec3::NAN, ..Pose::IDENTITY };
        Camera::pinhole(4, 4, lens(1.0, 0.0), pose)
    });
    table.row("a pose that mirrors", &["p: |R^T R - I|"], || {
        Pose::new("p", DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0)), DVec3::ZERO)
    });
    table.row("a pose that scales", &["p: |R^T R - I|"], || {
        Pose::new("p", DMat3::IDENTITY * 1.01, DVec3::ZERO)
    });
    table.row("an infinite rotation", &["p: a NaN"], || {
        Pose::new("p", DMat3::IDENTITY * f64::INFINITY, DVec3::ZERO)
    });
    table.row("a quaternion of zeros", &["p: quaternion"], || Pose::from_wxyz("p", [0.0; 4], DVec3::ZERO));
    table.row("points on one line", &["points: all on one line"], || {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        Similarity::umeyama(&line, &line)
    });
    table.row("lists of two lengths", &["points: 3 to match 4"], || {
        Similarity::umeyama(&[DVec3::X, DVec3::Y, DVec3::Z], &[DVec3::ZERO; 4])
    });
    table.row("a NaN point", &["points: a NaN"], || {
        Similarity::umeyama(&[DVec3::X, DVec3::Y, DVec3::NAN], &[DVec3::X, DVec3::Y, DVec3::Z])
    });

    let options = RenderOptions::default;
    for (field, broken) in [
        ("blur", RenderOptions { blur: 0.0, ..options() }),
        ("blur", RenderOptions { blur: f32::NAN, ..options() }),
        ("near", RenderOptions { near: 0.0, ..options() }),
        ("near", RenderOptions { near: -1.0, ..options() }),
        ("far", RenderOptions { near: 2.0, far: 1.0, ..options() }),
        ("far", RenderOptions { far: f32::INFINITY, ..options() }),
        ("max_alpha", RenderOptions { max_alpha: 1.0, ..options() }),
        ("max_alpha", RenderOptions { max_alpha: 0.0, ..options() }),
        ("background", RenderOptions { background: Background::Color([0.0, 1.5, 0.0]), ..options() }),
        ("background", RenderOptions { background: Background::Color([f32::NAN; 3]), ..options() }),
    ] {
        table.row(field, &[&format!("options.{field}")], || broken.validate());
    }

    table.row("an image without pixels", &["image: 0 pixels"], || RgbImage::new(0, 4, vec![]));
    table.row("a stride below a row", &["i: 100 elements"], || {
        RgbImage::from_strided("i", &[0; 100], 5, 2, 14, PixelFormat::Rgb8)
    });
    table.row("a stride of 2^63", &["i: 100 elements"], || {
        RgbImage::from_strided("i", &[0; 100], 5, 3, 1 << 63, PixelFormat::Rgb8)
    });
    table.row("a mask of another length", &["mask: 3 pixels"], || Mask::new(2, 2, vec![Label::Vehicle; 3]));
    table.row("depth of another length", &["depth: 5 pixels"], || DepthMap::new(2, 2, vec![1.0; 5]));
    table.row("confidence of another length", &["confidence: 1 pixels"], || {
        DepthMap::new(2, 2, vec![1.0; 4])?.with_confidence(vec![1.0])
    });
    let view = || View {
        name: "v.png".into(),
        camera: pinhole(2, 2, lens(1.0, 0.0)).unwrap(),
        image: RgbImage::new(2, 2, vec![[0; 3]; 4]).unwrap(),
        mask: None,
        depth: None,
    };
    let scene = |view: View| Scene { views: vec![view], ..Scene::default() }.validate();
    scene(view()).unwrap();
    table.row("a scene without views", &["views: 0"], || Scene::default().validate());
    table.row("an image of another size", &["views[0] (v.png).image: 1x1"], || {
        scene(View { image: RgbImage::new(1, 1, vec![[0; 3]]).unwrap(), ..view() })
    });
    table.row("a mask of another size", &["views[0] (v.png).mask: 1x1"], || {
        scene(View { mask: Some(Mask::new(1, 1, vec![Label::Vehicle]).unwrap()), ..view() })
    });
    table.row("depth of another size", &["views[0] (v.png).depth: 1x1"], || {
        scene(View { depth: Some(DepthMap::new(1, 1, vec![1.0]).unwrap()), ..view() })
    });
    table.finish(40);
}
