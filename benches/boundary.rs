//! Cost of the C boundary: `vg_reconstruct` and `vg_render` against the Rust calls behind them, in turns.
//!
//!     cargo bench --bench boundary [-- ROUNDS]

// The benchmark calls C functions.
#![allow(unsafe_code)]

use std::ffi::c_void;
use std::ops::ControlFlow;
use std::ptr::{null, null_mut};
use std::time::Instant;
use vg::pipeline::{Options, reconstruct_on};
use vg::progress::Threads;
use vg::render::{CpuRenderer, RenderOptions, Rendered};
use vg::scene::PixelFormat;
use vg::scene::mask::VEHICLE_THRESHOLD;
use vg_face::capi::*;
use vg_testing::sample::{self, INPUTS};

const THREADS: u32 = 2;

/// A view in a caller's memory: pixels as from OpenCV or PIL, mask bytes, float depth.
struct Lent {
    pixels: Vec<u8>,
    format: PixelFormat,
    mask: Vec<u8>,
}

fn main() -> vg::Result<()> {
    let rounds = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(31);
    println!("{rounds} rounds in turns, {THREADS} threads, the bundled sample, medians\n");
    println!("| depth from | pixels | Rust ms | C ms | C / Rust (median of pairs) |");
    println!("| --- | --- | --- | --- | --- |");
    for with_depth in [true, false] {
        for format in [PixelFormat::Rgb8, PixelFormat::Bgr8] {
            reconstruct(with_depth, format, rounds)?;
        }
    }
    println!("\n| picture | Rust ms | C ms | C / Rust |");
    println!("| --- | --- | --- | --- |");
    render(rounds)
}

fn reconstruct(with_depth: bool, format: PixelFormat, rounds: usize) -> vg::Result<()> {
    let scene = sample::open(&INPUTS, with_depth)?;
    let lent: Vec<Lent> = scene
        .views
        .iter()
        .map(|view| {
            let rgb = view.image.pixels();
            let pixels = match format {
                PixelFormat::Rgb8 => rgb.concat(),
                _ => rgb.iter().flat_map(|&[r, g, b]| [b, g, r]).collect(),
            };
            let labels = view.mask.as_ref().expect("the sample has masks").labels();
            let mask = labels.iter().map(|&l| if l as u8 >= VEHICLE_THRESHOLD { 255 } else { 0 }).collect();
            Lent { pixels, format, mask }
        })
        .collect();
    let views: Vec<vg_view> = scene.views.iter().zip(&lent).map(|(v, l)| c_view(v, l)).collect();

    let threads = Threads::new(THREADS as usize)?;
    let context = context();
    let mut options: vg_options = unsafe { std::mem::zeroed() };
    unsafe { vg_options_init(&raw mut options, size_of::<vg_options>()) };
    options.context = context;
    let times = in_turns(
        rounds,
        || {
            let made =
                reconstruct_on(&threads, &scene, &Options::default(), &mut |_| ControlFlow::Continue(()));
            drop(made.expect("the sample can be reconstructed"));
        },
        || unsafe {
            let (mut car, mut report) = (null_mut(), null_mut());
            let status = vg_reconstruct(
                views.as_ptr(),
                views.len(),
                &raw const options,
                &raw mut car,
                &raw mut report,
                null_mut(),
            );
            assert_eq!(status, vg_status::Ok);
            vg_gaussians_free(car);
            vg_report_free(report);
        },
    );
    unsafe { vg_context_free(context) };
    let from = if with_depth { "given" } else { "hull" };
    println!("| {from} | {format:?} | {:.1} | {:.1} | {:.4} |", times.rust, times.c, times.ratio);
    Ok(())
}

fn render(rounds: usize) -> vg::Result<()> {
    let scene = sample::open(&INPUTS, true)?;
    let made = sample::run(&scene, &Options::default())?;
    let camera = scene.views[0].camera;
    let (threads, renderer, options) =
        (Threads::new(THREADS as usize)?, CpuRenderer::new(), RenderOptions::default());
    let mut picture = Rendered::default();
    let context = context();

    let g = &made.gaussians;
    let arrays = vg_gaussian_arrays {
        struct_size: size_of::<vg_gaussian_arrays>(),
        count: g.len(),
        positions: g.means().as_ptr().cast(),
        scales: g.scales().as_ptr().cast(),
        rotations: g.rotations().as_ptr().cast(),
        opacities: g.opacities().as_ptr(),
        sh: g.sh().as_ptr(),
        sh_degree: g.sh_degree().into(),
        flags: 0,
    };
    let mut car = null_mut();
    assert_eq!(
        unsafe { vg_gaussians_from_arrays(&raw const arrays, &raw mut car, null_mut()) },
        vg_status::Ok
    );
    let mut drawing: vg_render_options = unsafe { std::mem::zeroed() };
    unsafe { vg_render_options_init(&raw mut drawing, size_of::<vg_render_options>()) };
    drawing.context = context;
    let mut pixels = vec![0u8; camera.width as usize * camera.height as usize * 4];
    let target = vg_image_target {
        struct_size: size_of::<vg_image_target>(),
        width: camera.width,
        height: camera.height,
        color: pixels.as_mut_ptr().cast(),
        color_row_stride: 0,
        depth: null_mut(),
        depth_row_stride: 0,
        color_format: vg_format::Rgba8 as i32,
        flags: 0,
        alpha: null_mut(),
        alpha_row_stride: 0,
    };
    let from_c = c_camera(&camera);
    let times = in_turns(
        rounds * 5,
        || {
            let times = threads.run(|| renderer.render_into(g, &camera, &options, &mut picture));
            times.expect("the sample can be drawn");
            std::hint::black_box(picture.to_rgba8());
        },
        || {
            let status = unsafe {
                vg_render(car, &raw const from_c, &raw const drawing, &raw const target, null_mut())
            };
            assert_eq!(status, vg_status::Ok);
        },
    );
    let size = format!("{} x {} RGBA8", camera.width, camera.height);
    println!("| {size} | {:.2} | {:.2} | {:.4} |", times.rust, times.c, times.ratio);

    println!("\n| context of that picture | ms | ratio to no context |");
    println!("| --- | --- | --- |");
    let draw_in = |context: *mut vg_context| {
        let drawing = vg_render_options { context, ..drawing };
        let status =
            unsafe { vg_render(car, &raw const from_c, &raw const drawing, &raw const target, null_mut()) };
        assert_eq!(status, vg_status::Ok);
    };
    let calling = new_context(1);
    let anew = |threads: u32| {
        let context = new_context(threads);
        draw_in(context);
        unsafe { vg_context_free(context) };
    };
    let ways: [(&str, &dyn Fn()); 4] = [
        ("two threads, reused", &|| draw_in(context)),
        ("the calling thread, reused", &|| draw_in(calling)),
        ("two threads, made for the call", &|| anew(THREADS)),
        ("the calling thread, made for the call", &|| anew(1)),
    ];
    for (what, way) in ways {
        let times = in_turns(rounds * 5, || draw_in(null_mut()), way);
        println!("| {what} | {:.2} | {:.3} |", times.c, times.ratio);
    }
    unsafe {
        vg_context_free(calling);
        vg_context_free(context);
        vg_default_context_free();
        vg_gaussians_free(car);
    }
    Ok(())
}

fn context() -> *mut vg_context {
    new_context(THREADS)
}

fn new_context(threads: u32) -> *mut vg_context {
    let settings = vg_context_options { struct_size: size_of::<vg_context_options>(), threads, flags: 0 };
    let mut context = null_mut();
    assert_eq!(unsafe { vg_context_new(&raw const settings, &raw mut context, null_mut()) }, vg_status::Ok);
    context
}

fn c_camera(camera: &vg::Camera) -> vg_camera {
    let i = camera.intrinsics;
    let (params, pose) = ([i.fx, i.fy, i.cx, i.cy], camera.vehicle_from_camera.to_row_major());
    let mut out: vg_camera = unsafe { std::mem::zeroed() };
    let status = unsafe {
        let model = vg_camera_model::Pinhole as i32;
        let (width, height) = (camera.width, camera.height);
        vg_camera_from_colmap_model(
            model,
            params.as_ptr(),
            4,
            width,
            height,
            pose.as_ptr(),
            &raw mut out,
            null_mut(),
        )
    };
    assert_eq!(status, vg_status::Ok);
    out
}

fn c_view(view: &vg::View, lent: &Lent) -> vg_view {
    let image = |data: *const c_void, format: vg_format| vg_image {
        data,
        row_stride: 0,
        width: view.camera.width,
        height: view.camera.height,
        format: format as i32,
        flags: 0,
    };
    let format = if lent.format == PixelFormat::Rgb8 { vg_format::Rgb8 } else { vg_format::Bgr8 };
    let depth = view.depth.as_ref().map_or(null(), |d| d.depth().as_ptr().cast());
    vg_view {
        struct_size: size_of::<vg_view>(),
        name: null(),
        camera: c_camera(&view.camera),
        image: image(lent.pixels.as_ptr().cast(), format),
        mask: image(lent.mask.as_ptr().cast(), vg_format::Gray8),
        depth: image(depth, vg_format::Depth32f),
    }
}

struct Times {
    rust: f64,
    c: f64,
    ratio: f64,
}

/// Median times, in milliseconds, of two jobs that take turns, and the median of the ratios of consecutive runs.
fn in_turns(rounds: usize, mut rust: impl FnMut(), mut c: impl FnMut()) -> Times {
    let timed = |job: &mut dyn FnMut()| {
        let start = Instant::now();
        job();
        start.elapsed().as_secs_f64() * 1e3
    };
    // The first run of each also allocates memory.
    rust();
    c();
    let pairs: Vec<(f64, f64)> = (0..rounds)
        .map(|round| match round % 2 {
            0 => (timed(&mut rust), timed(&mut c)),
            _ => {
                let c = timed(&mut c);
                (timed(&mut rust), c)
            }
        })
        .collect();
    Times {
        rust: sample::median(pairs.iter().map(|p| p.0)),
        c: sample::median(pairs.iter().map(|p| p.1)),
        ratio: sample::median(pairs.iter().map(|p| p.1 / p.0)),
    }
}
