//! Time, memory and error of the GPU renderer against the CPU renderer, on a car-sized shell of 1 cm surfels:
//! `cargo bench --features gpu --bench gpu`.
//!
//! ```text
//! cargo bench ... --bench gpu                      20k, 200k, 1M and 4M Gaussians at 512x384 and 1920x1080
//! cargo bench ... --bench gpu -- 200000            chosen sizes
//! ```
//!
//! `benches/gpu_vs_gsplat` runs it together with gsplat's CUDA kernels on a machine with an NVIDIA GPU. Both draw the
//! same picture in turns in one run. `WGPU_ADAPTER_NAME` chooses among several adapters.

use glam::DVec3;
use std::process::Command;
use std::time::{Duration, Instant};
use vg::render::{
    Adapter, CpuRenderer, Differentiable, GpuRenderer, Gradients, PictureGradient, Reference, RenderOptions,
    Rendered, Renderer, Rgba8,
};
use vg::{Camera, Gaussians};
use vg_testing::gradients::{largest, noise, tensors};
use vg_testing::scenes::{looking_at_origin, surfel_car};
use vg_testing::timing::{median, ms};
use vg_testing::{compare, scenes};

/// Gaussians of the scene whose error is measured: 4e9 pixel-Gaussian pairs for the reference.
const ERROR_GAUSSIANS: usize = 20_000;

/// Largest number of Gaussians whose gradients are timed: larger models are not refined.
const MOST_WITH_GRADIENTS: usize = 1_000_000;

/// Seconds that the pictures of one row may take.
const BUDGET: Duration = Duration::from_secs(6);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut sizes: Vec<usize> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    let gsplat = arguments.iter().position(|a| a == "--gsplat").map(|i| arguments[i + 1].clone());
    if sizes.is_empty() {
        sizes = vec![20_000, 200_000, 1_000_000, 4_000_000];
    }
    let start = Instant::now();
    let gpu = GpuRenderer::new(Adapter::Any).unwrap_or_else(|e| panic!("{e}"));
    let cold = start.elapsed();
    let start = Instant::now();
    drop(GpuRenderer::new(Adapter::Any).unwrap());
    let kind = if gpu.is_software() { "a driver that draws on the CPU" } else { "hardware" };
    println!("{}, {kind}; opened in {:.0} ms, again in {:.0} ms", gpu.name(), ms(cold), ms(start.elapsed()));
    println!("SH degree 3, the CPU with {} threads", rayon::current_num_threads());
    let cpu = CpuRenderer::new();
    print_error(&gpu);
    println!("milliseconds; MiB; mean and largest difference of colour from the CPU's");
    println!(
        "{:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>6} {:>8} {:>8} {:>6} {:>6} {:>7} {:>8}",
        "Gaussians",
        "pixels",
        "first",
        "planes",
        "bytes",
        "of many",
        "cpu",
        "ratio",
        "both",
        "cpu",
        "ratio",
        "asset",
        "working",
        "upload"
    );
    for n in sizes {
        let gaussians = surfel_car(n);
        for (width, height) in [(512, 384), (1920, 1080)] {
            let cameras = row(&gpu, &cpu, &gaussians, width, height);
            if let Some(python) = &gsplat {
                println!("{:>19} {}", "gsplat:", by_gsplat(python, &gaussians, &cameras));
            }
        }
    }
}

/// Prints one row: a picture as planes, one as bytes, several in one call, and one with its gradients, by device and
/// CPU in turns.
fn row(gpu: &GpuRenderer, cpu: &CpuRenderer, gaussians: &Gaussians, width: u32, height: u32) -> [Camera; 2] {
    // Views alternate, because the device keeps the depth order of the view it drew last.
    let cameras = [0.75, -0.75].map(|x| looking_at_origin(width, height, DVec3::new(x, -0.55, 0.36), 8.0));
    let options = RenderOptions::default();
    let (asset, uploaded) = timed(|| gpu.upload(gaussians).unwrap_or_else(|e| panic!("{e}")));
    let (mut by_gpu, mut by_cpu, mut bytes) = (Rendered::default(), Rendered::default(), Rgba8::default());
    let (_, first) = timed(|| gpu.render_asset_into(&asset, &cameras[1], &options, &mut by_gpu).unwrap());
    let several = [cameras[0], cameras[1], cameras[0], cameras[1]];
    let mut copy = Vec::new();
    let mut times: [Vec<Duration>; 6] = Default::default();
    let (mut of_picture, mut gradients) = (PictureGradient::default(), Gradients::default());
    let begin = Instant::now();
    for i in 0.. {
        if i >= 3 && (begin.elapsed() > BUDGET || i >= 50) {
            break;
        }
        let camera = &cameras[i % 2];
        let other = &cameras[(i + 1) % 2];
        times[0].push(timed(|| gpu.render_asset_into(&asset, camera, &options, &mut by_gpu).unwrap()).1);
        times[1].push(timed(|| gpu.render_asset_rgba8(&asset, other, &options, &mut bytes).unwrap()).1);
        times[2].push(timed(|| cpu.render_into(gaussians, camera, &options, &mut by_cpu).unwrap()).1);
        let take = |_: usize, picture: &Rgba8| {
            copy.clone_from(&picture.pixels);
            Ok(())
        };
        let all = || gpu.render_each(&asset, &several, &options, &mut bytes, take).unwrap();
        times[3].push(timed(all).1 / several.len() as u32);
        if gaussians.len() > MOST_WITH_GRADIENTS {
            continue;
        }
        let renderers = [gpu as &dyn Differentiable, cpu];
        for (renderer, times) in renderers.into_iter().zip(&mut times[4..]) {
            let mut picture = Rendered::default();
            let targets = (&mut picture, &mut of_picture, &mut gradients);
            let way =
                || renderer.forward_backward(gaussians, camera, &options, targets, &mut mean_square).unwrap();
            times.push(timed(way).1);
        }
    }
    let [color, ..] = compare(&by_gpu, &by_cpu);
    let [planes, bytes, by_cpu, of_many, back, cpu_back] =
        times.map(|mut t| if t.is_empty() { f64::NAN } else { ms(median(&mut t)) });
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "{:>9} {:>9} {:>8.1} {:>8.1} {:>8.1} {:>8.1} {:>8.1} {:>6.2} {:>8.1} {:>8.1} {:>6.2} {:>6.0} {:>7.0} {:>8.1}  {:.1e} {:.1e}",
        gaussians.len(),
        format!("{width}x{height}"),
        ms(first),
        planes,
        bytes,
        of_many,
        by_cpu,
        planes / by_cpu,
        back,
        cpu_back,
        back / cpu_back,
        mib(asset.bytes()),
        mib(gpu.working_bytes()),
        ms(uploaded),
        color.mean,
        color.max,
    );
    cameras
}

/// Returns the output of `peers/gsplat.py`.
fn by_gsplat(python: &str, gaussians: &Gaussians, cameras: &[Camera]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.ply");
    vg::io::ply::write(&model, gaussians).unwrap();
    let i = &cameras[0].intrinsics;
    let (width, height) = (cameras[0].width.to_string(), cameras[0].height.to_string());
    let mut command = Command::new(python);
    command.arg("benches/peers/gsplat.py").arg(&model).args([width, height]);
    command.arg(format!("{},{},{},{}", i.fx, i.fy, i.cx, i.cy));
    for camera in cameras {
        let pose = camera.vehicle_from_camera.inverse();
        let numbers = glam::DMat4::from_mat3_translation(pose.rotation, pose.translation).transpose();
        command.arg(numbers.to_cols_array().map(|v| v.to_string()).join(","));
    }
    let out = command.output().unwrap_or_else(|e| panic!("{python}: {e}"));
    match out.status.success() {
        true => String::from_utf8_lossy(&out.stdout).trim().to_owned(),
        false => String::from_utf8_lossy(&out.stderr).lines().last().unwrap_or("failed").to_owned(),
    }
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let made = work();
    (made, start.elapsed())
}

/// Half the mean square of all planes of a picture.
fn mean_square(p: &Rendered, g: &mut PictureGradient) -> vg::Result<()> {
    let scale = 1.0 / p.alpha.len() as f32;
    g.color.extend(p.color.iter().map(|c| c.map(|v| scale * v)));
    g.alpha.extend(p.alpha.iter().map(|v| scale * v));
    g.depth.extend(p.depth.iter().map(|v| scale * v));
    Ok(())
}

fn print_error(gpu: &GpuRenderer) {
    let camera = scenes::looking_at_origin(512, 384, DVec3::new(0.75, -0.55, 0.36), 8.0);
    let (gaussians, options) = (surfel_car(ERROR_GAUSSIANS), RenderOptions::default());
    let exact = Reference.render(&gaussians, &camera, &options).unwrap();
    let found = gpu.render(&gaussians, &camera, &options).unwrap();
    let [color, alpha, depth] = compare(&found, &exact);
    println!(
        "{ERROR_GAUSSIANS} Gaussians, 512x384, against the f64 reference: mean and maximum of colour {:.1e} {:.1e}, alpha {:.1e} \
         {:.1e}, depth {:.1e} {:.1e} m",
        color.mean, color.max, alpha.mean, alpha.max, depth.mean, depth.max
    );

    let camera = scenes::looking_at_origin(256, 192, DVec3::new(0.75, -0.55, 0.36), 8.0);
    let (gaussians, gradient) = (surfel_car(ERROR_GAUSSIANS / 10), noise(1, &camera));
    let exact = Reference.backward_f64(&gaussians, &camera, &options, &gradient).unwrap();
    print!("{} Gaussians, 256x192, gradients against the f64 reference:", gaussians.len());
    for (name, renderer) in [("device", gpu as &dyn Differentiable), ("CPU", &CpuRenderer::new())] {
        let found = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
        let of_tensor = |(name, found, exact): (&str, Vec<f64>, Vec<f64>)| {
            let error: Vec<f64> = found.iter().zip(&exact).map(|(a, b)| a - b).collect();
            (largest(&error) / largest(&exact), name.to_owned())
        };
        let worst =
            tensors(&found, &exact, &camera).into_iter().map(of_tensor).max_by(|a, b| a.0.total_cmp(&b.0));
        let (error, tensor) = worst.unwrap();
        print!(" {name} {error:.1e} of the largest ({tensor}).");
    }
    println!();
}
