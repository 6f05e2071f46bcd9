//! Networks through the C functions: the bytes of Rust, one model for many threads, and no memory left by a freed one.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;
use std::ptr::{null, null_mut};
use std::time::Instant;
use vg::onnx::{Model, ModelOptions};
use vg::pipeline::{Options, PriorChoice, Reconstruction, reconstruct};
use vg::scene::Segmenter;
use vg::{Scene, View};
use vg_face::capi::*;
use vg_testing::networks::constant;
use vg_testing::networks::file;
use vg_testing::networks::oracle::{Manner, ellipsoid};
use vg_testing::networks::{black_and_white, brightness};
use vg_testing::say;
use vg_testing::vehicle::{right_side, without_depth};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;

/// Threads of the runtime, in Rust and in C.
const THREADS: u32 = 2;

/// The status and message that C gets.
type Refusal = (vg_status, String);

/// A model handle of C.
struct Handle(*mut vg_model);

// SAFETY: the header promises this of a `vg_model`, and these tests check it.
unsafe impl Send for Handle {}
unsafe impl Sync for Handle {}

impl Drop for Handle {
    fn drop(&mut self) {
        unsafe { vg_model_free(self.0) }
    }
}

/// Returns the message of an error and frees it.
unsafe fn refusal(status: vg_status, error: *mut vg_error) -> Refusal {
    unsafe {
        let words = CStr::from_ptr(vg_error_message(error)).to_str().unwrap().to_owned();
        vg_error_free(error);
        (status, words)
    }
}

fn model_options(threads: u32) -> vg_model_options {
    let mut options = std::mem::MaybeUninit::uninit();
    unsafe {
        assert_eq!(vg_model_options_init(options.as_mut_ptr(), size_of::<vg_model_options>()), vg_status::Ok);
        vg_model_options { threads, ..options.assume_init() }
    }
}

fn opened_with(path: &Path, options: &vg_model_options) -> Result<Handle, Refusal> {
    let path = CString::new(path.to_str().unwrap()).unwrap();
    let (mut model, mut error) = (null_mut(), null_mut());
    unsafe {
        match vg_model_open(path.as_ptr(), options, &raw mut model, &raw mut error) {
            vg_status::Ok => Ok(Handle(model)),
            status => {
                assert!(model.is_null());
                Err(refusal(status, error))
            }
        }
    }
}

/// Opens a model as a C program would; `None` if there is no runtime.
fn opened(path: &Path) -> Option<Handle> {
    match opened_with(path, &model_options(THREADS)) {
        Ok(model) => Some(model),
        Err((vg_status::Missing, words)) => {
            assert!(std::env::var_os("VG_NO_SKIP").is_none(), "skipped: {words}");
            say(&format!("skipped: {words}"));
            None
        }
        Err(other) => panic!("{other:?}"),
    }
}

/// The view in C, pointing into that of Rust.
fn lent(view: &View) -> vg_view {
    let mut lent = std::mem::MaybeUninit::uninit();
    let mut lent: vg_view = unsafe {
        assert_eq!(vg_view_init(lent.as_mut_ptr(), size_of::<vg_view>()), vg_status::Ok);
        lent.assume_init()
    };
    let (width, height) = (view.camera.width, view.camera.height);
    let i = view.camera.intrinsics;
    lent.camera.params[..4].copy_from_slice(&[i.fx, i.fy, i.cx, i.cy]);
    lent.camera.vehicle_from_camera = view.camera.vehicle_from_camera.to_row_major();
    (lent.camera.width, lent.camera.height) = (width, height);
    let image = |data: *const std::ffi::c_void, format: vg_format| vg_image {
        data,
        row_stride: 0,
        width,
        height,
        format: format as i32,
        flags: 0,
    };
    lent.image = image(view.image.pixels().as_ptr().cast(), vg_format::Rgb8);
    lent.mask = image(view.mask.as_ref().unwrap().labels().as_ptr().cast(), vg_format::Gray8);
    if let Some(depth) = &view.depth {
        lent.depth = image(depth.depth().as_ptr().cast(), vg_format::Depth32f);
    }
    lent
}

fn options(prior: Option<&Handle>, head: Option<&Handle>) -> vg_options {
    let mut options = std::mem::MaybeUninit::uninit();
    let mut options: vg_options = unsafe {
        assert_eq!(vg_options_init(options.as_mut_ptr(), size_of::<vg_options>()), vg_status::Ok);
        options.assume_init()
    };
    options.calibrate = vg_calibrate::Off as i32;
    options.prior = if prior.is_some() { vg_prior::Onnx as i32 } else { vg_prior::Given as i32 };
    options.prior_model = prior.map_or(null(), |model| model.0.cast_const());
    options.head_model = head.map_or(null(), |model| model.0.cast_const());
    options
}

/// A vehicle and its report, freed with it.
struct Made {
    gaussians: *mut vg_gaussians,
    report: *mut vg_report,
}

impl Drop for Made {
    fn drop(&mut self) {
        unsafe {
            vg_gaussians_free(self.gaussians);
            vg_report_free(self.report);
        }
    }
}

fn made(scene: &Scene, options: &vg_options) -> Result<Made, Refusal> {
    let views: Vec<vg_view> = scene.views.iter().map(lent).collect();
    let (mut gaussians, mut report, mut error) = (null_mut(), null_mut(), null_mut());
    unsafe {
        let made = (&raw mut gaussians, &raw mut report, &raw mut error);
        match vg_reconstruct(views.as_ptr(), views.len(), options, made.0, made.1, made.2) {
            vg_status::Ok => Ok(Made { gaussians, report }),
            status => Err(refusal(status, error)),
        }
    }
}

impl Made {
    fn json(&self) -> serde_json::Value {
        serde_json::from_slice(unsafe { CStr::from_ptr(vg_report_json(self.report)) }.to_bytes()).unwrap()
    }

    fn figures(&self) -> vg_report_figures {
        let mut figures = std::mem::MaybeUninit::uninit();
        unsafe {
            vg_report_figures_init(figures.as_mut_ptr(), size_of::<vg_report_figures>());
            let status = vg_report_get_figures(self.report, figures.as_mut_ptr(), null_mut());
            assert_eq!(status, vg_status::Ok);
            figures.assume_init()
        }
    }

    /// All arrays, concatenated.
    fn bits(&self) -> Vec<u32> {
        unsafe {
            let (g, n) = (self.gaussians.cast_const(), vg_gaussians_count(self.gaussians));
            let coefficients = (vg_gaussians_sh_degree(g) as usize + 1).pow(2) * 3;
            let arrays = [
                (vg_gaussians_positions(g), 3),
                (vg_gaussians_scales(g), 3),
                (vg_gaussians_rotations(g), 4),
                (vg_gaussians_opacities(g), 1),
                (vg_gaussians_sh(g), coefficients),
            ];
            let array = |(pointer, each): (*const f32, usize)| std::slice::from_raw_parts(pointer, n * each);
            arrays.into_iter().flat_map(array).map(|v| v.to_bits()).collect()
        }
    }
}

fn bits_of_rust(made: &Reconstruction) -> Vec<u32> {
    let g = &made.gaussians;
    let arrays = [
        g.means().as_flattened(),
        g.scales().as_flattened(),
        g.rotations().as_flattened(),
        g.opacities(),
        g.sh(),
    ];
    arrays.into_iter().flatten().map(|v| v.to_bits()).collect()
}

/// Writes a prior with the exact vehicle and a head that makes equal Gaussians.
fn written(name: &str, scene: &Scene) -> [std::path::PathBuf; 2] {
    let [prior, head] = ["prior", "head"].map(|kind| file(&format!("{name}-{kind}")));
    ellipsoid(&scene.views[0].camera, WIDTH.into(), HEIGHT.into(), Manner::PLAIN).write(&prior);
    constant("32", -5.0).write(&head);
    [prior, head]
}

#[test]
fn c_gets_the_bytes_of_rust() {
    let scene = right_side(WIDTH, HEIGHT);
    let [prior_path, head_path] = written("same", &scene);
    let Some(prior) = opened(&prior_path) else { return };
    let head = opened(&head_path).unwrap();
    let in_rust = |path: &Path| {
        let options = ModelOptions { threads: THREADS as usize, ..ModelOptions::default() };
        Model::open(path, &options).unwrap()
    };
    let (rust_prior, rust_head) = (in_rust(&prior_path), in_rust(&head_path));
    let bare = without_depth(scene.clone());
    for (scene, with_prior, with_head) in
        [(&bare, true, false), (&scene, false, true), (&bare, true, true), (&scene, false, false)]
    {
        let options = options(with_prior.then_some(&prior), with_head.then_some(&head));
        let ours = made(scene, &options).unwrap();
        let settings = Options {
            prior: if with_prior { PriorChoice::Onnx } else { PriorChoice::Given },
            prior_model: with_prior.then(|| rust_prior.clone()),
            head_model: with_head.then(|| rust_head.clone()),
            calibrate: vg::pipeline::Calibrate::Off,
            ..Options::default()
        };
        let theirs = reconstruct(scene, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        let what = format!("prior {with_prior}, head {with_head}");
        assert!(ours.bits() == bits_of_rust(&theirs) && !ours.bits().is_empty(), "{what}");
        let (figures, json) = (ours.figures(), ours.json());
        let used = if with_prior { vg_prior::Onnx } else { vg_prior::Given };
        assert_eq!(figures.prior, used as i32, "{what}");
        assert_eq!(json["head"], if with_head { "network" } else { "surfel" }, "{what}");
        for (field, path, is_there) in
            [("prior_model", &prior_path, with_prior), ("head_model", &head_path, with_head)]
        {
            let expected = if is_there { path.to_str().into() } else { serde_json::Value::Null };
            assert_eq!(json["settings"][field], expected, "{what}");
        }
    }
}

#[test]
fn many_threads_share_one_model_each_with_a_context_of_its_own() {
    let scene = without_depth(right_side(WIDTH, HEIGHT));
    let [prior_path, head_path] = written("shared", &scene);
    let Some(prior) = opened(&prior_path) else { return };
    let head = opened(&head_path).unwrap();
    let expected = made(&scene, &options(Some(&prior), Some(&head))).unwrap().bits();
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let mut context = null_mut();
                assert_eq!(unsafe { vg_context_new(null(), &raw mut context, null_mut()) }, vg_status::Ok);
                for _ in 0..2 {
                    let options = vg_options { context, ..options(Some(&prior), Some(&head)) };
                    assert!(made(&scene, &options).unwrap().bits() == expected);
                }
                unsafe { vg_context_free(context) };
            });
        }
    });
}

#[test]
fn incompatible_options_are_refused_by_the_names_of_the_header() {
    let scene = right_side(WIDTH, HEIGHT);
    let [prior_path, head_path] = written("refused", &scene);
    let Some(prior) = opened(&prior_path) else { return };
    let head = opened(&head_path).unwrap();
    let refused = |options: &vg_options| made(&scene, options).err().expect("a refusal");

    let without = vg_options { prior: vg_prior::Onnx as i32, ..options(None, None) };
    let (status, words) = refused(&without);
    assert_eq!(status, vg_status::Argument);
    assert!(words.starts_with("options.prior_model: none; allowed: an open model"), "{words}");
    for other in [vg_prior::Auto, vg_prior::Given, vg_prior::Hull, vg_prior::Shape] {
        let (status, words) = refused(&vg_options { prior: other as i32, ..options(Some(&prior), None) });
        assert_eq!(status, vg_status::Argument);
        assert!(words.starts_with("options.prior_model: ") && words.contains("the prior onnx"), "{words}");
    }
    // Each model in the place of the other.
    let (status, words) = refused(&options(Some(&head), None));
    assert!(status == vg_status::Format && words.contains("refused-head.onnx: metadata vg."), "{words}");
    let (status, words) = refused(&options(None, Some(&prior)));
    assert!(status == vg_status::Format && words.contains("refused-prior.onnx: metadata vg."), "{words}");

    let nowhere = vg_model_options { runtime: c"/nowhere/libonnxruntime.so".as_ptr(), ..model_options(1) };
    let (status, words) = opened_with(&prior_path, &nowhere).err().unwrap();
    assert!(status == vg_status::Missing && words.contains("/nowhere/libonnxruntime.so"), "{words}");
    let manifest = CString::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).unwrap();
    let (status, words) =
        opened_with(&prior_path, &vg_model_options { runtime: manifest.as_ptr(), ..nowhere }).err().unwrap();
    assert!(status == vg_status::Argument && words.starts_with("options.runtime: "), "{words}");
    let (status, words) = opened_with(Path::new("/"), &model_options(1)).err().unwrap();
    assert!(status == vg_status::Argument && words.starts_with("path: /, not a file"), "{words}");
    let (status, words) = opened_with(Path::new("/nowhere/m.onnx"), &model_options(1)).err().unwrap();
    assert!(status == vg_status::Io && words.starts_with("/nowhere/m.onnx: "), "{words}");
    let manifest = vg_testing::root().join("Cargo.toml");
    let (status, words) = opened_with(&manifest, &model_options(1)).err().unwrap();
    assert!(status == vg_status::Format && words.contains("Cargo.toml: model: "), "{words}");
}

#[test]
fn a_mask_from_c_equals_that_of_rust() {
    let view = &right_side(WIDTH, HEIGHT).views[1];
    let (graph, path) = (brightness(Some((64, 64))), file("c-mask"));
    graph.write(&path);
    let Some(model) = opened(&path) else { return };
    let picture = black_and_white(view, true);
    let shown = View { image: picture.clone(), ..view.clone() };
    let rust = Segmenter::new(vg_testing::networks::open("rust-mask", &graph).unwrap()).unwrap();
    let expected = rust.mask(&picture, &view.camera).unwrap();
    assert!(expected.vehicle_pixels() > 500);

    let lent = lent(&shown);
    let (width, stride) = (WIDTH as usize, WIDTH as usize + 7);
    let segment = |picture: &vg_image, mask: &mut [u8]| unsafe {
        let mut error = null_mut();
        let (to, camera) = (mask.as_mut_ptr(), &raw const lent.camera);
        match vg_segment(model.0, picture, camera, null(), to, stride, &raw mut error) {
            vg_status::Ok => Ok(()),
            status => Err(refusal(status, error)),
        }
    };
    // Rows with gaps, the last without a gap after it.
    let mut mask = vec![77u8; stride * (HEIGHT as usize - 1) + width];
    segment(&lent.image, &mut mask).unwrap();
    for (v, row) in mask.chunks(stride).enumerate() {
        for (u, byte) in row.iter().enumerate() {
            let wanted = match u < width {
                true if expected.is_vehicle(u as u32, v as u32) => 255,
                true => 0,
                false => 77,
            };
            assert_eq!(*byte, wanted, "column {u}, row {v}");
        }
    }

    let mut untouched = vec![77u8; mask.len()];
    let half = vg_image { height: HEIGHT / 2, ..lent.image };
    let (status, words) = segment(&half, &mut untouched).unwrap_err();
    assert_eq!(status, vg_status::Argument);
    assert!(words.starts_with("image: 96x36; allowed: the camera's size, 96x72"), "{words}");
    let [prior, _] = written("no-mask", &right_side(WIDTH, HEIGHT));
    let prior = opened(&prior).unwrap();
    let mut error = null_mut();
    let (status, words) = unsafe {
        let (camera, to) = (&raw const lent.camera, untouched.as_mut_ptr());
        let status = vg_segment(prior.0, &raw const lent.image, camera, null(), to, stride, &raw mut error);
        refusal(status, error)
    };
    assert!(
        status == vg_status::Format && words.contains("a geometry prior, not a segmentation network"),
        "{words}"
    );
    assert!(untouched.iter().all(|&byte| byte == 77));
}

/// Threads of this process.
#[cfg(target_os = "linux")]
fn threads_of_the_process() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

/// Run alone, in a process of its own, by the test below.
#[test]
#[ignore = "counts the threads of its process"]
#[cfg(target_os = "linux")]
fn alone_twenty_vehicles_leave_no_thread_of_their_model() {
    const MODEL_THREADS: u32 = 5;
    let scene = without_depth(right_side(WIDTH, HEIGHT));
    let [prior_path, head_path] = written("twenty", &scene);
    // The runtime itself starts no thread that ends before the process does.
    let Some(first) = opened(&head_path) else { return };
    drop(first);
    let before = threads_of_the_process();

    let start = Instant::now();
    let prior = opened_with(&prior_path, &model_options(MODEL_THREADS)).ok().unwrap();
    let head = opened_with(&head_path, &model_options(MODEL_THREADS)).ok().unwrap();
    let opened_in = start.elapsed().as_secs_f64();
    // The calling thread is one of the model's threads.
    assert!(threads_of_the_process() >= before + 2 * (MODEL_THREADS as usize - 1));
    let mut context = null_mut();
    assert_eq!(unsafe { vg_context_new(null(), &raw mut context, null_mut()) }, vg_status::Ok);
    let options = vg_options { context, ..options(Some(&prior), Some(&head)) };
    let mut vehicles = vec![made(&scene, &options).unwrap()];
    let first = start.elapsed().as_secs_f64();
    let mut warm = Vec::new();
    while vehicles.len() < 20 {
        let start = Instant::now();
        vehicles.push(made(&scene, &options).unwrap());
        warm.push(start.elapsed().as_secs_f64());
        assert!(vehicles.last().unwrap().bits() == vehicles[0].bits());
    }
    warm.sort_by(f64::total_cmp);
    say(&format!(
        "prior and head, 4 views of {WIDTH}x{HEIGHT}: opened in {:.1} ms, first vehicle after {:.1} ms, warm {:.1} ms",
        1e3 * opened_in,
        1e3 * first,
        1e3 * warm[warm.len() / 2]
    ));
    unsafe { vg_context_free(context) };
    // Vehicles and reports remain; the networks' threads do not.
    drop((prior, head));
    for _ in 0..1000 {
        if threads_of_the_process() == before {
            break;
        }
        // A joined thread is listed until the kernel has removed it.
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert_eq!(threads_of_the_process(), before);
    assert!(vehicles.iter().all(|v| v.json()["network"]["prior"] == "oracle"));
}

#[test]
#[cfg(target_os = "linux")]
fn twenty_vehicles_leave_no_thread_of_their_model() {
    let mut child = Command::new(std::env::current_exe().unwrap());
    let name = "alone_twenty_vehicles_leave_no_thread_of_their_model";
    let output = child.args(["--exact", name, "--ignored", "--nocapture"]).output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && out.contains("1 passed"), "{out}{err}");
    err.lines()
        .filter(|line| line.starts_with("prior and head") || line.starts_with("skipped"))
        .for_each(say);
}
