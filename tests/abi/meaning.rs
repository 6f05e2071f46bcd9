//! The meaning of numbers that the C functions return: pixels in every format, the measures, the lines of the log. Each
//! is compared with Rust, or with the results of other programs. `src/capi/tests/meaning.rs` tests the arguments.

use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{null, null_mut};
use vg::metrics::{SurfaceErrors, SurfaceOptions, ViewErrors, on_white, psnr, ssim};
use vg::render::{Background, CpuRenderer, DepthMode, RenderOptions, Rendered, Renderer};
use vg::{Camera, Gaussians, View};
use vg_face::capi::*;
use vg_testing::root;
use vg_testing::scenes::surfel_car;
use vg_testing::tools::golden;
use vg_testing::vehicle::{camera, right_side, view};

/// A struct after its `_init` function.
macro_rules! initial {
    ($name:ident, $init:ident) => {{
        let mut value: $name = unsafe { std::mem::zeroed() };
        assert_eq!(unsafe { $init(&raw mut value, size_of::<$name>()) }, vg_status::Ok);
        value
    }};
}

/// Enumerators whose effect is tested here and not in `src/capi/tests/meaning.rs`.
const SEEN_HERE: [(&str, usize); 2] = [("VG_FORMAT_", 7), ("VG_LOG_LEVEL_", 3)];

#[test]
fn no_format_and_no_log_level_is_left_out() {
    let layout = std::fs::read_to_string(golden().join("layout_x86_64.txt")).unwrap();
    for (prefix, seen) in SEEN_HERE {
        let there = layout.lines().filter(|line| line.starts_with(prefix)).count();
        assert_eq!(there, seen, "{prefix}*: add a test of the new enumerator in {}, then count it", file!());
    }
}

// ---- Pictures

/// The model, in Rust and in C.
struct Car {
    rust: Gaussians,
    c: *mut vg_gaussians,
}

impl Car {
    fn new() -> Self {
        let rust = surfel_car(3_000);
        let mut arrays = initial!(vg_gaussian_arrays, vg_gaussian_arrays_init);
        (arrays.count, arrays.sh_degree) = (rust.len(), rust.sh_degree().into());
        arrays.positions = rust.means().as_ptr().cast();
        arrays.scales = rust.scales().as_ptr().cast();
        arrays.rotations = rust.rotations().as_ptr().cast();
        arrays.opacities = rust.opacities().as_ptr();
        arrays.sh = rust.sh().as_ptr();
        let mut c = null_mut();
        let made = unsafe { vg_gaussians_from_arrays(&raw const arrays, &raw mut c, null_mut()) };
        assert_eq!(made, vg_status::Ok);
        Self { rust, c }
    }
}

impl Drop for Car {
    fn drop(&mut self) {
        unsafe { vg_gaussians_free(self.c) };
    }
}

fn camera_in_c(camera: &Camera) -> vg_camera {
    let mut out = initial!(vg_camera, vg_camera_init);
    let i = camera.intrinsics;
    (out.width, out.height) = (camera.width, camera.height);
    out.params[..4].copy_from_slice(&[i.fx, i.fy, i.cx, i.cy]);
    out.vehicle_from_camera = camera.vehicle_from_camera.to_row_major();
    out
}

/// The bytes of a picture in a format, and depth and alpha if requested.
fn drawn(
    car: &Car,
    camera: &Camera,
    options: &vg_render_options,
    format: vg_format,
    planes: Option<(&mut [f32], &mut [f32])>,
) -> Vec<u8> {
    let bytes = match format {
        vg_format::Rgb8 | vg_format::Bgr8 => 3,
        vg_format::Rgba32f => 16,
        _ => 4,
    };
    let mut color = vec![0; (camera.width * camera.height) as usize * bytes];
    let mut target = initial!(vg_image_target, vg_image_target_init);
    (target.width, target.height) = (camera.width, camera.height);
    (target.color, target.color_format) = (color.as_mut_ptr().cast(), format as i32);
    if let Some((depth, alpha)) = planes {
        (target.depth, target.alpha) = (depth.as_mut_ptr().cast(), alpha.as_mut_ptr().cast());
    }
    let seen = camera_in_c(camera);
    let status = unsafe { vg_render(car.c, &raw const seen, options, &raw const target, null_mut()) };
    assert_eq!(status, vg_status::Ok, "{format:?}");
    color
}

fn floats(bytes: &[u8]) -> Vec<[f32; 4]> {
    let floats: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap())).collect();
    floats.as_chunks::<4>().0.to_vec()
}

fn byte(value: f32) -> u8 {
    (value * 255.0).round() as u8
}

#[test]
fn a_pixel_has_the_channel_order_of_its_format_and_the_requested_background() {
    let (car, camera) = (Car::new(), camera(-60.0, 6.5, 48, 36));
    let background = [0.2, 0.4, 0.8];
    let mut options = initial!(vg_render_options, vg_render_options_init);
    options.background_color = background;
    let in_rust = RenderOptions { background: Background::Color(background), ..RenderOptions::default() };
    let expected = CpuRenderer::new().render(&car.rust, &camera, &in_rust).unwrap();
    assert_eq!(expected.color[0], background, "the corner is empty");
    assert!(expected.alpha.iter().any(|a| *a > 0.9), "the vehicle is drawn");

    let rgb: Vec<[u8; 3]> = expected.color.iter().map(|c| c.map(byte)).collect();
    let of = |format| drawn(&car, &camera, &options, format, None);
    assert!(of(vg_format::Rgb8) == rgb.as_flattened());
    assert!(of(vg_format::Bgr8) == rgb.iter().flat_map(|&[r, g, b]| [b, g, r]).collect::<Vec<_>>());
    assert!(of(vg_format::Rgba8) == rgb.iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect::<Vec<_>>());
    assert!(of(vg_format::Bgra8) == rgb.iter().flat_map(|&[r, g, b]| [b, g, r, 255]).collect::<Vec<_>>());
    let whole: Vec<[f32; 4]> = expected.color.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    assert!(floats(&of(vg_format::Rgba32f)) == whole);
}

#[test]
fn transparent_pictures_have_the_requested_alpha_and_depth() {
    let (car, camera) = (Car::new(), camera(-60.0, 6.5, 48, 36));
    let pixels = (camera.width * camera.height) as usize;
    let mut options = initial!(vg_render_options, vg_render_options_init);
    options.background = vg_background::Transparent as i32;
    for (mode, in_rust) in
        [(vg_depth_mode::Expected, DepthMode::Expected), (vg_depth_mode::Accumulated, DepthMode::Accumulated)]
    {
        options.depth_mode = mode as i32;
        let in_rust = RenderOptions {
            background: Background::Transparent,
            depth_mode: in_rust,
            ..RenderOptions::default()
        };
        let Rendered { color, alpha, depth, .. } =
            CpuRenderer::new().render(&car.rust, &camera, &in_rust).unwrap();
        let partly = (0..pixels).filter(|&i| (0.05..0.95).contains(&alpha[i])).count();
        assert!(partly > 20, "{partly} pixels on the edge");

        let (mut z, mut a) = (vec![-1.0; pixels], vec![-1.0; pixels]);
        options.alpha = vg_alpha::Premultiplied as i32;
        let found = drawn(&car, &camera, &options, vg_format::Rgba32f, Some((&mut z, &mut a)));
        let premultiplied: Vec<[f32; 4]> =
            color.iter().zip(&alpha).map(|(&[r, g, b], &a)| [r, g, b, a]).collect();
        assert!(floats(&found) == premultiplied && z == depth && a == alpha, "{mode:?}");

        options.alpha = vg_alpha::Straight as i32;
        let found = floats(&drawn(&car, &camera, &options, vg_format::Rgba32f, None));
        for (straight, [r, g, b, a]) in found.iter().zip(premultiplied) {
            let scale = if a > 0.0 { 1.0 / a } else { 0.0 };
            assert_eq!(*straight, [r * scale, g * scale, b * scale, a]);
        }
    }
}

/// One grey ramp in every input format.
#[test]
fn input_pictures_of_every_format_are_read_as_the_same_picture() {
    const SIDE: u32 = 16;
    let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE).map(|i| [i as u8, (i / 2) as u8, 200]).collect();
    let grey: Vec<u8> = (0..SIDE * SIDE).map(|i| i as u8).collect();
    let image = |bytes: &[u8], format: vg_format| vg_image {
        data: bytes.as_ptr().cast(),
        row_stride: 0,
        width: SIDE,
        height: SIDE,
        format: format as i32,
        flags: 0,
    };
    let difference = |a: (&[u8], vg_format), b: (&[u8], vg_format)| {
        let mut errors = initial!(vg_picture_errors, vg_picture_errors_init);
        let (a, b) = (image(a.0, a.1), image(b.0, b.1));
        let status =
            unsafe { vg_metrics_pictures(&raw const a, &raw const b, null(), &raw mut errors, null_mut()) };
        assert_eq!(status, vg_status::Ok);
        errors.psnr_db
    };
    let rgb = (pixels.as_flattened(), vg_format::Rgb8);
    let with = |of: fn([u8; 3]) -> [u8; 4]| -> Vec<u8> { pixels.iter().flat_map(|p| of(*p)).collect() };
    let bgr: Vec<u8> = pixels.iter().flat_map(|&[r, g, b]| [b, g, r]).collect();
    let (rgba, bgra) = (with(|[r, g, b]| [r, g, b, 255]), with(|[r, g, b]| [b, g, r, 255]));
    let float: Vec<u8> = pixels
        .iter()
        .flat_map(|p| [p[0], p[1], p[2], 255])
        .flat_map(|v| (f32::from(v) / 255.0).to_ne_bytes())
        .collect();
    for (bytes, format) in [
        (&bgr, vg_format::Bgr8),
        (&rgba, vg_format::Rgba8),
        (&bgra, vg_format::Bgra8),
        (&float, vg_format::Rgba32f),
    ] {
        assert_eq!(difference(rgb, (bytes, format)), f64::INFINITY, "{format:?}");
    }
    assert!(difference(rgb, (&bgr, vg_format::Rgb8)) < 20.0, "the test notices exchanged channels");
    let grey_as_rgb: Vec<u8> = grey.iter().flat_map(|&v| [v; 3]).collect();
    assert_eq!(difference((&grey, vg_format::Gray8), (&grey_as_rgb, vg_format::Rgb8)), f64::INFINITY);
}

// ---- Cameras

#[test]
fn each_camera_model_projects_as_colmap_does() {
    let path = root().join("tests/golden/cameras_pycolmap.json");
    let cases: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let mut models = std::collections::BTreeSet::new();
    for case in cases["cases"].as_array().unwrap() {
        let (params, size) = (numbers(&case["params"]), |key: &str| case[key].as_u64().unwrap() as u32);
        let id = case["model_id"].as_i64().unwrap() as i32;
        models.insert(id);
        let mut camera = initial!(vg_camera, vg_camera_init);
        let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let status = unsafe {
            vg_camera_from_colmap_model(
                id,
                params.as_ptr(),
                params.len(),
                size("width"),
                size("height"),
                identity.as_ptr(),
                &raw mut camera,
                null_mut(),
            )
        };
        assert_eq!((status, camera.model), (vg_status::Ok, id), "{case}");
        for (point, pixel) in
            case["points"].as_array().unwrap().iter().zip(case["pixels"].as_array().unwrap())
        {
            let (point, pixel, mut found) = (numbers(point), numbers(pixel), [f64::NAN; 2]);
            let status = unsafe {
                vg_camera_project(&raw const camera, point.as_ptr(), found.as_mut_ptr(), null_mut())
            };
            // Beyond the fold of a lens, COLMAP projects points to pixels of other points.
            if status == vg_status::Argument {
                let mut seen = [f64::NAN; 3];
                let status = unsafe {
                    vg_camera_unproject(
                        &raw const camera,
                        pixel.as_ptr(),
                        point[2],
                        seen.as_mut_ptr(),
                        null_mut(),
                    )
                };
                let is_elsewhere = (seen[0] - point[0]).abs().max((seen[1] - point[1]).abs()) > 1e-3;
                assert!(status != vg_status::Ok || is_elsewhere, "{case}: {point:?}");
                continue;
            }
            assert_eq!(status, vg_status::Ok);
            let off = (found[0] - pixel[0]).abs().max((found[1] - pixel[1]).abs());
            assert!(off < 1e-9, "{}: {found:?} {pixel:?}", case["model"]);
        }
    }
    assert_eq!(models.into_iter().collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6], "every vg_camera_model");
}

// ---- Measures

/// Fields of a struct of doubles by name, from the golden layout.
fn doubles<T>(of: &str, value: &T) -> BTreeMap<String, f64> {
    let layout = std::fs::read_to_string(golden().join("layout_x86_64.txt")).unwrap();
    let prefix = format!("{of}.");
    let mut fields = BTreeMap::new();
    for line in layout.lines().filter_map(|line| line.strip_prefix(&prefix)) {
        let words: Vec<&str> = line.split(' ').collect();
        if words[0] == "struct_size" {
            continue;
        }
        let [name, "at", at, "size", "8"] = words[..] else { panic!("{of}.{line} is no double") };
        let at: usize = at.parse().unwrap();
        assert!(at + 8 <= size_of::<T>());
        let bytes = unsafe { std::ptr::from_ref(value).cast::<[u8; 8]>().byte_add(at).read() };
        fields.insert(name.to_owned(), f64::from_ne_bytes(bytes));
    }
    fields
}

/// Asserts that each field has the value of its namesake in Rust, NAN for none; a field without an entry fails by name.
#[track_caller]
fn assert_measures<T>(of: &str, value: &T, expected: &[(&str, Option<f64>)]) {
    let mut found = doubles(of, value);
    for (name, expected) in expected {
        let found = found.remove(*name).unwrap_or_else(|| panic!("{of} has no field {name}"));
        let expected = expected.unwrap_or(f64::NAN);
        // Normalising a quaternion once more in C changes the last bits.
        let same = found == expected || (found - expected).abs() <= 1e-5 * expected.abs();
        assert!(same || found.is_nan() && expected.is_nan(), "{of}.{name}: {found}, {expected} in Rust");
    }
    assert!(found.is_empty(), "{of}: no entry in {} for {:?}", file!(), found.keys());
}

#[test]
fn each_measure_of_a_surface_equals_its_namesake_in_rust() {
    let car = Car::new();
    // The model without its front end, and higher, so that no two measures are equal.
    let scan: Vec<[f32; 3]> =
        car.rust.means().iter().filter(|p| p[0] < 1.0).map(|p| [p[0], p[1], 1.1 * p[2]]).collect();
    for f_score_m in [0.05, 0.1] {
        let mut options = initial!(vg_metrics_options, vg_metrics_options_init);
        options.f_score_m = f_score_m;
        let mut out = initial!(vg_surface_errors, vg_surface_errors_init);
        let status = unsafe {
            let points = scan.as_ptr().cast();
            vg_metrics_surface(car.c, points, scan.len(), &raw const options, &raw mut out, null_mut())
        };
        assert_eq!(status, vg_status::Ok);
        let how = SurfaceOptions { f_score_m, ..SurfaceOptions::default() };
        let expected = SurfaceErrors::with(&car.rust, &scan, &how).unwrap();
        assert_measures(
            "vg_surface_errors",
            &out,
            &[
                ("accuracy_m", Some(expected.accuracy_m)),
                ("completeness_m", Some(expected.completeness_m)),
                ("chamfer_m", Some(expected.chamfer_m)),
                ("precision", Some(expected.precision)),
                ("recall", Some(expected.recall)),
                ("f_score", Some(expected.f_score)),
                ("length_error_percent", Some(expected.length_error_percent)),
                ("width_error_percent", Some(expected.width_error_percent)),
                ("height_error_percent", Some(expected.height_error_percent)),
            ],
        );
        assert_all_different(&doubles("vg_surface_errors", &out));
        assert!(out.length_error_percent > 5.0 && out.height_error_percent < -2.0, "{out:?}");
    }
}

/// Asserts that all measures differ, so that exchanged ones would be noticed.
#[track_caller]
fn assert_all_different(measures: &BTreeMap<String, f64>) {
    let mut values: Vec<f64> = measures.values().copied().filter(|v| !v.is_nan()).collect();
    values.sort_by(f64::total_cmp);
    assert!(values.windows(2).all(|pair| pair[1] - pair[0] > 1e-4), "{measures:?}");
}

/// A view in C that points into one of Rust.
fn view_in_c(view: &View, name: &CStr) -> vg_view {
    let mut out = initial!(vg_view, vg_view_init);
    let (width, height) = (view.camera.width, view.camera.height);
    let image = |data: *const c_void, format: vg_format| vg_image {
        data,
        row_stride: 0,
        width,
        height,
        format: format as i32,
        flags: 0,
    };
    (out.name, out.camera) = (name.as_ptr(), camera_in_c(&view.camera));
    out.image = image(view.image.pixels().as_ptr().cast(), vg_format::Rgb8);
    // A label is one byte: 255 is vehicle, all others are below 128.
    out.mask = image(view.mask.as_ref().unwrap().labels().as_ptr().cast(), vg_format::Gray8);
    out.depth = image(view.depth.as_ref().unwrap().depth().as_ptr().cast(), vg_format::Depth32f);
    out
}

#[test]
fn each_measure_of_a_view_and_of_two_pictures_equals_its_namesake_in_rust() {
    let car = Car::new();
    let view = view("a", camera(-60.0, 6.5, 48, 36));
    let in_c = view_in_c(&view, c"a");
    let mut out = initial!(vg_view_errors, vg_view_errors_init);
    let status = unsafe { vg_metrics_view(car.c, &raw const in_c, null(), &raw mut out, null_mut()) };
    assert_eq!(status, vg_status::Ok);
    let drawn = CpuRenderer::new().render(&car.rust, &view.camera, &RenderOptions::default()).unwrap();
    let expected = ViewErrors::of(&drawn, &view);
    let measures = ViewErrors::MEASURES.iter().map(|measure| measure.name).zip(expected.values());
    // Without a network.
    let measures: Vec<_> = measures.chain([("lpips", None)]).collect();
    assert_measures("vg_view_errors", &out, &measures);
    assert_all_different(&doubles("vg_view_errors", &out));

    let (width, height) = (view.camera.width, view.camera.height);
    let bytes: Vec<[u8; 3]> = drawn.to_rgb8();
    let picture = vg_image { data: bytes.as_ptr().cast(), ..in_c.image };
    let mut out = initial!(vg_picture_errors, vg_picture_errors_init);
    let status = unsafe {
        vg_metrics_pictures(&raw const picture, &raw const in_c.image, null(), &raw mut out, null_mut())
    };
    assert_eq!(status, vg_status::Ok);
    let unmasked = on_white(&View { mask: None, ..view });
    let a: Vec<[f32; 3]> = bytes.iter().map(|p| p.map(|c| f32::from(c) / 255.0)).collect();
    assert_measures(
        "vg_picture_errors",
        &out,
        &[
            ("psnr_db", Some(psnr(&a, &unmasked))),
            ("ssim", ssim(&a, &unmasked, width, height)),
            // Without a network.
            ("lpips", None),
        ],
    );
    assert_all_different(&doubles("vg_picture_errors", &out));
}

// ---- The log

/// Level and text of each line.
type Lines = Vec<(i32, String)>;

unsafe extern "C" fn keep(level: i32, message: *const c_char, lines: *mut c_void) {
    let line = unsafe { CStr::from_ptr(message) }.to_str().unwrap().to_owned();
    unsafe { &mut *lines.cast::<Lines>() }.push((level, line));
}

#[test]
fn each_line_of_the_log_has_the_level_of_its_content() {
    let scene = right_side(48, 36);
    // A view with the same camera is left out.
    let views: Vec<&View> = scene.views.iter().chain([&scene.views[0]]).collect();
    let names: Vec<CString> = (0..views.len()).map(|i| CString::new(format!("{i}")).unwrap()).collect();
    let views: Vec<vg_view> = views.iter().zip(&names).map(|(view, name)| view_in_c(view, name)).collect();
    let mut lines = Lines::new();
    let mut options = initial!(vg_options, vg_options_init);
    options.log = Some(keep);
    options.log_user = (&raw mut lines).cast();
    let mut car = null_mut();
    let status = unsafe {
        let first = views.as_ptr();
        vg_reconstruct(first, views.len(), &raw const options, &raw mut car, null_mut(), null_mut())
    };
    assert_eq!(status, vg_status::Ok);
    unsafe { vg_gaussians_free(car) };
    let level_of = |words: &str| -> Vec<i32> {
        lines.iter().filter(|(_, line)| line.contains(words)).map(|(level, _)| *level).collect()
    };
    let (info, debug) = (vg_log_level::Info as i32, vg_log_level::Debug as i32);
    assert_eq!(level_of("Gaussians from depth prior given"), [info], "{lines:?}");
    let left_out = level_of("left out ");
    assert!(!left_out.is_empty() && left_out.iter().all(|level| *level == info), "{lines:?}");
    for stage in ["plan: ", "prior: ", "head: ", "symmetry: "] {
        assert_eq!(level_of(stage), [debug], "{stage}{lines:?}");
    }

    // A unit that gives a vehicle of toy size is legal, but probably a mistake.
    let mut lines = Lines::new();
    let mut options = initial!(vg_scene_options, vg_scene_options_init);
    let wanted = [c"000".as_ptr()];
    (options.names, options.name_count, options.depth_scale) = (wanted.as_ptr(), 1, 1e-6);
    options.log = Some(keep);
    options.log_user = (&raw mut lines).cast();
    let folder = CString::new(root().join("tests/data/sedan").to_str().unwrap()).unwrap();
    let mut scene = null_mut();
    let status =
        unsafe { vg_transforms_open(folder.as_ptr(), &raw const options, &raw mut scene, null_mut()) };
    assert_eq!(status, vg_status::Ok);
    unsafe { vg_scene_free(scene) };
    let warning = vg_log_level::Warning as i32;
    assert!(
        lines.len() == 1 && lines[0].0 == warning && lines[0].1.contains("is the unit right?"),
        "{lines:?}"
    );
}
