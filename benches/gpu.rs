//! Time, memory and error of the GPU renderer beside the CPU's, on a car-sized shell of 1 cm surfels:
//! `cargo bench --no-default-features --features gpu --bench gpu`.
//!
//! ```text
//! cargo bench ... --bench gpu                      20k, 200k, 1M and 4M Gaussians at 512x384 and 1920x1080
//! cargo bench ... --bench gpu -- 200000            chosen sizes
//! ```
//!
//! Both draw the same picture in turns in one run. `WGPU_ADAPTER_NAME` chooses among several adapters.

#[path = "../tests/common/mod.rs"]
mod common;

use common::scenes::{looking_at_origin, surfel_car};
use common::timing::{median, ms};
use common::{compare, scenes};
use glam::DVec3;
use std::time::{Duration, Instant};
use vg::Gaussians;
use vg::render::{Adapter, CpuRenderer, GpuRenderer, Reference, RenderOptions, Rendered, Renderer};

/// Gaussians of the scene whose error is measured: 4e9 pixel-Gaussian pairs for the reference.
const ERROR_GAUSSIANS: usize = 20_000;

/// Seconds that the pictures of one row may take.
const BUDGET: Duration = Duration::from_secs(6);

fn main() {
    let mut sizes: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
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
    println!("SH degree 3, {} threads beside it", rayon::current_num_threads());
    let cpu = CpuRenderer::new();
    print_error(&gpu);
    println!(
        "{:>10} {:>10} {:>10} {:>10} {:>9} {:>7} {:>11} {:>10} {:>10}",
        "Gaussians", "pixels", "first", "gpu", "cpu", "ratio", "asset", "working", "uploaded"
    );
    for n in sizes {
        let gaussians = surfel_car(n);
        for (width, height) in [(512, 384), (1920, 1080)] {
            row(&gpu, &cpu, &gaussians, width, height);
        }
    }
}

fn row(gpu: &GpuRenderer, cpu: &CpuRenderer, gaussians: &Gaussians, width: u32, height: u32) {
    let camera = looking_at_origin(width, height, DVec3::new(0.75, -0.55, 0.36), 8.0);
    let options = RenderOptions::default();
    let start = Instant::now();
    let asset = gpu.upload(gaussians).unwrap_or_else(|e| panic!("{e}"));
    let uploaded = start.elapsed();
    let (mut by_gpu, mut by_cpu) = (Rendered::default(), Rendered::default());
    let time = |work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        start.elapsed()
    };
    let mut draw = || gpu.render_asset_into(&asset, &camera, &options, &mut by_gpu).unwrap();
    let first = time(&mut draw);
    let (mut gpus, mut cpus) = (Vec::new(), Vec::new());
    let begin = Instant::now();
    while gpus.len() < 3 || (begin.elapsed() < BUDGET && gpus.len() < 50) {
        gpus.push(time(&mut draw));
        cpus.push(time(&mut || drop(cpu.render_into(gaussians, &camera, &options, &mut by_cpu))));
    }
    let [color, ..] = compare(&by_gpu, &by_cpu);
    let (gpu_time, cpu_time) = (median(&mut gpus), median(&mut cpus));
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "{:>10} {:>10} {:>7.1} ms {:>7.1} ms {:>6.1} ms {:>7.2} {:>7.0} MiB {:>6.0} MiB {:>7.1} ms   {:.1e} {:.1e}",
        gaussians.len(),
        format!("{width}x{height}"),
        ms(first),
        ms(gpu_time),
        ms(cpu_time),
        gpu_time.as_secs_f64() / cpu_time.as_secs_f64(),
        mib(asset.bytes()),
        mib(gpu.working_bytes()),
        ms(uploaded),
        color.mean,
        color.max,
    );
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
}
