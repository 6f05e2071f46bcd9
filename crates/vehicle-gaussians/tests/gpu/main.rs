//! The GPU renderer: its own behaviour, in addition to the tests of pictures and gradients of every renderer in
//! `render_golden`, `render_numerics` and `render_gradients`, and faults of a device.

mod batch;

use glam::DVec3;
use std::ops::ControlFlow;
use std::process::Command;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use vg::geometry::Distortion;
use vg::pipeline::{Options, PriorChoice, reconstruct};
use vg::refine::{Amount, RefineOptions};
use vg::render::gpu::Bounds;
use vg::render::{
    Adapter, AssetRenderer, Backend, Background, CpuRenderer, Differentiable, GpuRenderer, Gradients,
    Reference, RenderOptions, Rendered, Renderer, Rgba8,
};
use vg::{Camera, Gaussians};
use vg_testing::compare;
use vg_testing::gpu::renderer;
use vg_testing::gradients::noise;
use vg_testing::scenes::{forward, looking_at_origin, random, surfel_car};
use vg_testing::vehicle::right_side;

/// Lock for tests of the device that the process shares, because one of them loses the device.
fn alone() -> MutexGuard<'static, ()> {
    static SHARED: Mutex<()> = Mutex::new(());
    SHARED.lock().unwrap_or_else(PoisonError::into_inner)
}

const UNIT: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

fn options() -> RenderOptions {
    RenderOptions { background: Background::Color([0.1, 0.2, 0.3]), ..RenderOptions::default() }
}

/// `n` walls in front of the camera, a millimetre apart.
fn walls(n: usize, opacity: f32, size: f32) -> Gaussians {
    let means = (0..n).map(|i| [5.0 + i as f32 * 1e-3, 0.0, 0.0]).collect();
    let sh = vec![0.5; 3 * n];
    Gaussians::from_arrays(0, means, vec![UNIT; n], vec![[size; 3]; n], vec![opacity; n], sh).unwrap()
}

fn assert_close(name: &str, a: &Rendered, b: &Rendered, mean: f64, max: f64) {
    for (plane, d) in ["colour", "alpha", "depth"].into_iter().zip(compare(a, b)) {
        println!("{name:40} {plane:7} mean {:.1e}, 99.9 % {:.1e}, max {:.1e}", d.mean, d.p999, d.max);
        assert!(d.mean <= mean && d.max <= max, "{name}: {plane} {d:?}");
    }
}

#[test]
fn through_a_lens_it_draws_the_picture_of_the_cpu() {
    let Some(gpu) = renderer() else { return };
    let gaussians = random(9, 2000, 2, [0.01, 0.1]);
    let distortion = Distortion::Brown { k: [-0.1, 0.03, 0.0, 0.0, 0.0, 0.0], p: [0.01, -0.02] };
    let camera = Camera { distortion, ..looking_at_origin(160, 120, DVec3::new(0.3, -1.0, 0.2), 6.0) };
    let asset = gpu.upload(&gaussians).unwrap();
    let expected = CpuRenderer::new().render(&gaussians, &camera, &options()).unwrap();
    for _ in 0..2 {
        let found = gpu.render_asset(&asset, &camera, &options()).unwrap();
        let [color, alpha, depth] = compare(&found, &expected);
        assert!(color.mean < 1e-6 && color.max < 1e-4, "{color:?}");
        assert!(alpha.max < 1e-4 && depth.mean < 1e-4, "{alpha:?} {depth:?}");
    }
}

#[test]
fn depths_of_150_000_are_sorted_and_equal_ones_keep_the_order_of_storage() {
    let Some(gpu) = renderer() else { return };
    // More than one block of the sort and one level of the sums; a third of the depths are equal, and they are not
    // sorted.
    let car = surfel_car(150_000);
    let camera = looking_at_origin(256, 192, DVec3::new(0.4, -1.0, 0.3), 7.0);
    let expected = CpuRenderer::new().render(&car, &camera, &options()).unwrap();
    let found = gpu.render(&car, &camera, &options()).unwrap();
    let [color, alpha, depth] = compare(&found, &expected);
    println!("{color:?} {alpha:?} {depth:?}");
    assert!(color.mean < 1e-6 && color.p999 < 1e-5 && color.max < 4e-3, "{color:?}");
    assert!(alpha.max < 4e-3 && depth.mean < 1e-5, "{alpha:?} {depth:?}");

    let n = 5000;
    let mut sh = vec![0.0; 3 * n];
    sh[0] = 1.0;
    let means = vec![[3.0, 0.0, 0.0]; n];
    let g = Gaussians::from_arrays(0, means, vec![UNIT; n], vec![[0.05; 3]; n], vec![0.9; n], sh).unwrap();
    let camera = forward(33, 33, 40.0);
    let expected = Reference.render(&g, &camera, &options()).unwrap();
    assert_close("equal depths", &gpu.render(&g, &camera, &options()).unwrap(), &expected, 1e-5, 1e-4);
}

#[test]
fn bands_slices_chunks_and_repetition_change_no_byte() {
    let Some(gpu) = renderer() else { return };
    let mut gaussians = random(10, 4000, 3, [0.005, 0.2]);
    gaussians.append(&random(11, 60, 3, [1.0, 3.0]));
    let camera = looking_at_origin(200, 150, DVec3::new(0.4, -1.0, 0.3), 5.0);
    let asset = gpu.upload(&gaussians).unwrap();
    let expected = gpu.render_asset(&asset, &camera, &options()).unwrap();
    assert!(expected.alpha.iter().any(|a| *a > 0.9));
    assert_eq!(gpu.render_asset(&asset, &camera, &options()).unwrap(), expected, "a second time");
    assert_eq!(gpu.render(&gaussians, &camera, &options()).unwrap(), expected, "uploaded again");
    let bounded = |change: fn(&mut Bounds)| renderer().unwrap().bounded(change);
    let altered = [
        ("bands", bounded(|b| b.pixels = 200 * 40)),
        ("slices", bounded(|b| b.pairs = 1000)),
        ("chunks", bounded(|b| b.binding = 1 << 18)),
    ];
    for (name, gpu) in altered {
        let found = gpu.render(&gaussians, &camera, &options()).unwrap();
        assert!(found == expected, "{name}");
    }
}

#[test]
fn more_pairs_than_one_command_has_threads_change_no_byte() {
    let Some(gpu) = renderer() else { return };
    // In 65,536 tiles: 19.7 M pairs. A command has 16.7 M threads in groups of 256.
    let gaussians = walls(300, 0.5, 100.0);
    let camera = forward(2048, 2048, 1000.0);
    let expected = CpuRenderer::new().render(&gaussians, &camera, &options()).unwrap();
    let found = gpu.render(&gaussians, &camera, &options()).unwrap();
    assert_close("many pairs", &found, &expected, 1e-6, 2e-5);
    let slices = renderer().unwrap().bounded(|b| b.pairs = 1 << 20);
    assert!(slices.render(&gaussians, &camera, &options()).unwrap() == found);
    let held = [&gpu, &slices].map(GpuRenderer::working_bytes);
    assert!(held[0] > held[1] + (500 << 20), "not in one slice: {held:?} bytes");
}

#[test]
fn gradients_are_the_same_bytes_in_bands_windows_and_repeated_walks() {
    let Some(gpu) = renderer() else { return };
    let mut gaussians = random(10, 2000, 2, [0.005, 0.2]);
    gaussians.append(&random(11, 60, 2, [1.0, 3.0]));
    let camera = looking_at_origin(200, 150, DVec3::new(0.4, -1.0, 0.3), 5.0);
    let gradient = noise(3, &camera);
    let expected = gpu.backward(&gaussians, &camera, &options(), &gradient).unwrap();
    assert!(expected.means.iter().filter(|m| **m != [0.0; 3]).count() > 300);
    assert!(gpu.backward(&gaussians, &camera, &options(), &gradient).unwrap() == expected, "a second time");

    // With its picture, and reusing memory after the picture; the loss may draw meanwhile.
    let asset = gpu.upload(&random(4, 300, 0, [0.1, 0.2])).unwrap();
    for meanwhile in [false, true] {
        let (mut picture, mut of_picture, mut found) = Default::default();
        let targets = (&mut picture, &mut of_picture, &mut found);
        gpu.render_with_gradients_into(&gaussians, &camera, &options(), targets, |picture, g| {
            assert!((picture.width, picture.height) == (200, 150));
            g.clone_from(&gradient);
            if meanwhile {
                gpu.render_asset(&asset, &camera, &options())?;
            }
            Ok(())
        })
        .unwrap();
        assert!(found == expected, "with the picture, {meanwhile}");
        assert!(picture == gpu.render(&gaussians, &camera, &options()).unwrap());
    }

    let bounded = |change: fn(&mut Bounds)| renderer().unwrap().bounded(change);
    let same = [
        ("bands", bounded(|b| b.pixels = 200 * 40)),
        ("windows of rows", bounded(|b| b.pairs = 1 << 14)),
        ("repeated walks", bounded(|b| b.shares = 1000)),
        ("chunks", bounded(|b| b.binding = 70_000)),
    ];
    for (name, gpu) in same {
        let found = gpu.backward(&gaussians, &camera, &options(), &gradient).unwrap();
        // The tiles' sums of the background are rounded once, and added up in f64.
        for c in 0..3 {
            assert!((found.background[c] - expected.background[c]).abs() < 1e-12, "{name}");
        }
        let found = Gradients { background: expected.background, ..found };
        assert!(found == expected, "{name}");
    }
    // Windows of columns have another order than rows: sums differ in rounding.
    let found = bounded(|b| b.pairs = 1).backward(&gaussians, &camera, &options(), &gradient).unwrap();
    let largest = |v: &[f32]| v.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    for (a, b) in [
        (found.means.as_flattened(), expected.means.as_flattened()),
        (found.scales.as_flattened(), expected.scales.as_flattened()),
        (&found.opacities, &expected.opacities),
        (&found.sh, &expected.sh),
    ] {
        let difference: Vec<f32> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        assert!(largest(&difference) <= 1e-5 * largest(b), "{:e}", largest(&difference));
    }
}

#[test]
fn byte_pictures_equal_the_rounded_planes() {
    let Some(gpu) = renderer() else { return };
    let gaussians = random(17, 3000, 2, [0.005, 0.2]);
    let camera = looking_at_origin(200, 150, DVec3::new(0.4, -1.0, 0.3), 5.0);
    let distortion = Distortion::Brown { k: [-0.1, 0.03, 0.0, 0.0, 0.0, 0.0], p: [0.01, -0.02] };
    let slices = renderer().unwrap().bounded(|b| (b.pairs, b.pixels) = (1000, 200 * 40));
    for gpu in [gpu, slices] {
        let asset = gpu.upload(&gaussians).unwrap();
        for camera in [camera, Camera { distortion, ..camera }] {
            for background in [Background::Transparent, Background::Color([0.1, 0.2, 0.3])] {
                let options = RenderOptions { background, ..RenderOptions::default() };
                let planes = gpu.render_asset(&asset, &camera, &options).unwrap();
                let mut bytes = Rgba8::default();
                gpu.render_asset_rgba8(&asset, &camera, &options, &mut bytes).unwrap();
                match background {
                    Background::Color(_) => {
                        let expected = planes.to_rgb8().into_iter().map(|[r, g, b]| [r, g, b, 255]);
                        assert!(bytes.pixels == expected.collect::<Vec<_>>());
                    }
                    Background::Transparent => {
                        // The device divides by alpha less exactly: one level at ties.
                        let expected = planes.to_rgba8();
                        let pairs = bytes.pixels.as_flattened().iter().zip(expected.as_flattened());
                        let off = pairs.clone().filter(|(a, b)| a != b).count();
                        assert!(off < 20 && pairs.into_iter().all(|(a, b)| a.abs_diff(*b) <= 1), "{off}");
                    }
                }
            }
        }
    }
}

#[test]
fn the_largest_an_empty_and_a_fully_culled_picture_are_drawn() {
    let Some(gpu) = renderer() else { return };
    let n = 30;
    let means = (0..n).map(|i| [5.0, 3.4 - 0.23 * i as f32, 3.4 - 0.23 * i as f32]).collect();
    let g =
        Gaussians::from_arrays(0, means, vec![UNIT; n], vec![[0.002; 3]; n], vec![0.8; n], vec![0.3; 3 * n]);
    let g = g.unwrap();
    let camera = forward(8192, 8192, 6000.0);
    let expected = CpuRenderer::new().render(&g, &camera, &options()).unwrap();
    let found = gpu.render(&g, &camera, &options()).unwrap();
    // Comparing by sorting 200 million numbers takes longer than drawing them.
    let off = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off(found.color.as_flattened(), expected.color.as_flattened()) < 2e-5);
    assert!(off(&found.alpha, &expected.alpha) < 2e-5 && off(&found.depth, &expected.depth) < 1e-3);
    assert!(found.alpha.iter().filter(|a| **a > 0.5).count() > 100);
    drop((expected, found));

    let camera = forward(300, 200, 200.0);
    for g in [Gaussians::default(), walls(10, 0.9, 1.0).transformed_behind()] {
        let picture = gpu.render(&g, &camera, &options()).unwrap();
        assert!(picture.color.iter().all(|c| *c == [0.1, 0.2, 0.3]));
        assert!(picture.alpha.iter().chain(&picture.depth).all(|v| *v == 0.0));
    }
}

/// Moves the Gaussians behind the camera of [`forward`].
trait Behind {
    fn transformed_behind(self) -> Self;
}

impl Behind for Gaussians {
    fn transformed_behind(self) -> Self {
        let means = self.means().iter().map(|m| [-m[0], m[1], m[2]]).collect();
        let arrays = (self.rotations().to_vec(), self.scales().to_vec(), self.opacities().to_vec());
        Self::from_arrays(0, means, arrays.0, arrays.1, arrays.2, self.sh().to_vec()).unwrap()
    }
}

/// Mesa's driver for the CPU limits a thread to 65,535 iterations of its loops and then continues as if they had ended.
#[test]
fn lists_beyond_the_loop_limit_of_a_driver_give_slices_or_errors_and_no_wrong_pictures() {
    let Some(gpu) = renderer() else { return };
    // All in one corner of a tile, whose other pixels iterate over them too.
    let corner = |n: usize| {
        let means = (0..n).map(|i| [5.0 + i as f32 * 1e-5, -0.2, -0.2]).collect();
        let (scales, sh) = (vec![[1e-4; 3]; n], vec![0.5; 3 * n]);
        Gaussians::from_arrays(0, means, vec![UNIT; n], scales, vec![0.05; n], sh).unwrap()
    };
    let camera = forward(32, 32, 100.0);
    let (picture_of, gradient_of) = (corner(70_000), corner(40_000));
    let gradient = noise(2, &camera);
    let cpu = CpuRenderer::new();
    // A picture is drawn again in slices.
    let expected = cpu.render(&picture_of, &camera, &options()).unwrap();
    assert_close("corner", &gpu.render(&picture_of, &camera, &options()).unwrap(), &expected, 1e-6, 2e-5);
    match gpu.backward(&gradient_of, &camera, &options(), &gradient) {
        Ok(found) => {
            let expected = cpu.backward(&gradient_of, &camera, &options(), &gradient).unwrap();
            assert!((found.background[0] - expected.background[0]).abs() < 1e-4);
        }
        Err(e) => {
            assert!(gpu.is_software() && e.to_string().contains("ends long loops early"), "{e}");
        }
    }
    // Lists below the limit are still drawn.
    let few = corner(5000);
    let expected = cpu.render(&few, &camera, &options()).unwrap();
    assert!(expected.alpha.iter().any(|a| *a > 0.9));
    assert_close("few", &gpu.render(&few, &camera, &options()).unwrap(), &expected, 1e-6, 2e-5);
}

#[test]
fn a_lost_device_and_too_large_input_are_errors_that_name_the_cause() {
    let Some(gpu) = renderer() else { return };
    let g = random(12, 100, 0, [0.01, 0.1]);
    let camera = looking_at_origin(64, 48, DVec3::X, 7.0);
    let asset = gpu.upload(&g).unwrap();
    assert!(gpu.working_bytes() == 0 && asset.bytes() == 100 * 4 * 14);
    gpu.render_asset(&asset, &camera, &options()).unwrap();
    assert!(gpu.working_bytes() > 100 * 100);
    gpu.lose_device();
    for error in [
        gpu.render_asset(&asset, &camera, &options()).unwrap_err(),
        gpu.render(&g, &camera, &options()).unwrap_err(),
        gpu.upload(&g).unwrap_err(),
        gpu.backward(&g, &camera, &options(), &noise(1, &camera)).unwrap_err(),
    ] {
        let text = error.to_string();
        assert!(text.starts_with("graphics processor: ") && text.contains("was lost"), "{text}");
    }

    let small = renderer().unwrap().bounded(|b| b.binding = 32 * 99);
    let text = small.upload(&g).unwrap_err().to_string();
    assert!(text.starts_with("gaussians: 100 Gaussians; allowed: 0 to 99"), "{text}");

    let mut camera = camera;
    camera.width = 0;
    let text = small.render(&g, &camera, &options()).unwrap_err().to_string();
    assert!(text.starts_with("camera.size"), "{text}");
}

#[test]
fn eight_threads_share_one_renderer() {
    let Some(gpu) = renderer() else { return };
    let asset = gpu.upload(&random(13, 500, 1, [0.01, 0.1])).unwrap();
    let camera = |i: u32| looking_at_origin(40 + i, 30, DVec3::new(0.3, -1.0, 0.2), 6.0);
    let alone: Vec<Rendered> =
        (0..8).map(|i| gpu.render_asset(&asset, &camera(i), &options()).unwrap()).collect();
    std::thread::scope(|scope| {
        for (i, expected) in alone.iter().enumerate() {
            let (gpu, asset) = (&gpu, &asset);
            scope.spawn(move || {
                for _ in 0..3 {
                    assert!(gpu.render_asset(asset, &camera(i as u32), &options()).unwrap() == *expected);
                }
            });
        }
    });
}

#[test]
fn an_asset_is_drawn_by_the_chosen_backend_and_by_the_cpu_if_the_device_is_lost() {
    if renderer().is_none() {
        return;
    }
    let _alone = alone();
    let gaussians = Arc::new(random(14, 300, 1, [0.01, 0.1]));
    let camera = looking_at_origin(64, 48, DVec3::new(0.3, -1.0, 0.2), 6.0);
    let cpu = AssetRenderer::new(Arc::clone(&gaussians), Backend::Cpu).unwrap();
    let expected = cpu.render(&camera, &options()).unwrap();
    let [stern, lenient] = [false, true].map(|lenient| {
        let ready = AssetRenderer::new(Arc::clone(&gaussians), Backend::Gpu).unwrap();
        if lenient { ready.falling_back() } else { ready }
    });
    for ready in [&stern, &lenient] {
        assert_eq!(ready.choice().backend, Backend::Gpu);
        assert_close("asset", &ready.render(&camera, &options()).unwrap(), &expected, 1e-6, 2e-5);
    }
    let device = stern.gpu().unwrap();
    assert!(Arc::ptr_eq(&device, &lenient.gpu().unwrap()), "one device for both");
    device.lose_device();
    let error = stern.render(&camera, &options()).unwrap_err().to_string();
    assert!(error.contains("was lost"), "{error}");
    assert_eq!(lenient.render(&camera, &options()).unwrap(), expected);
    let choice = lenient.choice();
    assert!(choice.backend == Backend::Cpu && choice.why.contains("was lost"), "{choice}");
    // The next caller gets a new device.
    let next = AssetRenderer::new(gaussians, Backend::Gpu).unwrap();
    assert_close("next", &next.render(&camera, &options()).unwrap(), &expected, 1e-6, 2e-5);
}

#[test]
fn a_refinement_on_the_device_is_as_good_and_reproducible() {
    if renderer().is_none() {
        return;
    }
    let _alone = alone();
    let scene = right_side(64, 48);
    let run = |backend: Backend| {
        let amount = Amount::Iterations(30);
        let refine = Some(RefineOptions { amount, backend, ..RefineOptions::default() });
        let options = Options { prior: PriorChoice::Given, refine, threads: 2, ..Options::default() };
        reconstruct(&scene, &options, &mut |_| ControlFlow::Continue(())).unwrap()
    };
    let of = |backend: Backend| run(backend).report.refinement.unwrap();
    let (cpu, gpu) = (of(Backend::Cpu), of(Backend::Gpu));
    assert!(cpu.drawn_by.starts_with("cpu (") && gpu.drawn_by.starts_with("gpu ("), "{}", gpu.drawn_by);
    println!("{:?} and {:?} dB", cpu.psnr_db, gpu.psnr_db);
    assert!(gpu.psnr_db[1] > gpu.psnr_db[0] + 0.5, "{:?}", gpu.psnr_db);
    assert!((gpu.psnr_db[1] - cpu.psnr_db[1]).abs() < 0.1, "{:?} {:?}", gpu.psnr_db, cpu.psnr_db);
    assert!(run(Backend::Gpu).gaussians == run(Backend::Gpu).gaussians);
}

/// Prints, in a process of its own for the test below, the result with the present device or without one.
#[test]
fn alone_print_the_device_and_the_choice() {
    if std::env::var_os(ASKED).is_none() {
        return;
    }
    let many = Arc::new(random(15, 20_000, 0, [0.01, 0.1]));
    let camera = looking_at_origin(32, 24, DVec3::X, 7.0);
    match GpuRenderer::new(Adapter::Any) {
        Ok(gpu) => println!("\n> device: {}", gpu.render(&many, &camera, &options()).unwrap().alpha.len()),
        Err(e) => println!("\n> error: {e}"),
    }
    let auto = AssetRenderer::new(many, Backend::Auto).unwrap();
    assert_eq!(auto.render(&camera, &options()).unwrap().alpha.len(), 32 * 24);
    println!("> auto: {}", auto.choice());
}

const ASKED: &str = "VG_TEST_WHAT_THERE_IS";

#[test]
fn missing_and_broken_drivers_are_errors_or_the_cpu_with_a_reason_and_print_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let manifest = |library: &str| {
        let icd = format!(r#"{{"library_path": "{library}", "api_version": "1.3.0"}}"#);
        format!(r#"{{"file_format_version": "1.0.0", "ICD": {icd}}}"#)
    };
    let none = folder.path().join("none.json").to_str().unwrap().to_owned();
    let cases = [
        ("no driver", none),
        ("no manifest", file("text.json", "not JSON")),
        ("no library", file("gone.json", &manifest("/nowhere/libvulkan_gone.so"))),
        ("another library", file("other.json", &manifest("libc.so.6"))),
    ];
    let ask = |variables: &[(&str, &str)]| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["alone_print_the_device_and_the_choice", "--exact", "--nocapture"]).env(ASKED, "1");
        // Mesa's layer that looks for display servers prints a line if there is none: docs/GPU.md.
        command.env("NODEVICE_SELECT", "1");
        let out = command.envs(variables.iter().copied()).output().unwrap();
        let printed = String::from_utf8(out.stdout).unwrap();
        assert!(out.status.success(), "{variables:?}: {printed}{}", String::from_utf8_lossy(&out.stderr));
        assert_eq!(String::from_utf8(out.stderr).unwrap(), "", "{variables:?}");
        let lines = printed.lines().filter_map(|line| line.strip_prefix("> ")).map(str::to_owned);
        let [device, auto] = lines.collect::<Vec<_>>().try_into().unwrap();
        println!("{variables:?}: {device}; {auto}");
        (device, auto)
    };
    for (name, driver) in &cases {
        let (device, auto) = ask(&[("VK_DRIVER_FILES", driver), ("VK_ICD_FILENAMES", driver)]);
        assert!(device.starts_with("error: graphics processor: no Vulkan driver;"), "{name}: {device}");
        assert!(auto.starts_with("auto: cpu (") && auto.contains("no Vulkan driver"), "{name}: {auto}");
    }
    let Some(gpu) = renderer() else { return };
    let (device, _) = ask(&[("WGPU_ADAPTER_NAME", "nobody's")]);
    let expected = format!("no adapter matches WGPU_ADAPTER_NAME \"nobody's\" among {}", gpu.name());
    assert!(device.contains(&expected), "{device}");
    let (device, auto) = ask(&[]);
    assert_eq!(device, "device: 768");
    match gpu.is_software() {
        true => assert!(auto.starts_with("auto: cpu (") && auto.contains("draw on the CPU"), "{auto}"),
        false => assert!(auto.starts_with("auto: gpu ("), "{auto}"),
    }
}

#[test]
fn a_hardware_adapter_is_not_a_software_driver() {
    match GpuRenderer::new(Adapter::Hardware) {
        Ok(gpu) => assert!(!gpu.is_software(), "{}", gpu.name()),
        Err(e) => assert!(e.to_string().starts_with("graphics processor: n"), "{e}"),
    }
}
