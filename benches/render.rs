//! Time and error of the CPU renderer on a car-sized shell of 1 cm surfels: `cargo bench --bench render`.
//!
//! ```text
//! cargo bench --bench render                        200k, 1M and 4M Gaussians, 1 and 2 threads
//! cargo bench --bench render -- 200000 --stages     chosen sizes; wall time of each stage
//! cargo bench --bench render -- --portable          without AVX2
//! ```
//!
//! Wall time is what a user waits for; compare processor time on a busy machine. The error of the same code against the
//! f64 reference, on a scene small enough for brute force, is printed too.

use glam::DVec3;
use std::time::{Duration, Instant};
use vg::render::cpu::StageTimes;
use vg::render::{CpuRenderer, Reference, RenderOptions, Rendered, Renderer};
use vg::{Camera, Gaussians};
use vg_testing::scenes::surfel_car;
use vg_testing::timing::{cpu_time, median, ms};
use vg_testing::{compare, scenes};

/// Gaussians of the scene whose error is measured: 4e9 pixel-Gaussian pairs for the reference.
const ERROR_GAUSSIANS: usize = 20_000;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let mut sizes: Vec<usize> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    if sizes.is_empty() {
        sizes = vec![200_000, 1_000_000, 4_000_000];
    }
    let renderer = if has("--portable") { CpuRenderer::portable() } else { CpuRenderer::new() };
    let camera = scenes::looking_at_origin(512, 384, DVec3::new(0.75, -0.55, 0.36), 8.0);
    let options = RenderOptions::default();
    println!("512x384, SH degree 3, {}, warm", renderer.level());
    if !has("--no-error") {
        print_error(&renderer, &camera, &options);
    }
    println!(
        "{:>10} {:>7} {:>11} {:>8} {:>11} {:>8}",
        "Gaussians", "threads", "wall median", "min", "CPU median", "min"
    );
    for n in sizes {
        let gaussians = surfel_car(n);
        let pictures =
            [1, 2].map(|threads| time(&renderer, &gaussians, &camera, &options, threads, has("--stages")));
        assert!(same_bytes(&pictures[0], &pictures[1]), "1 and 2 threads draw different pictures");
    }
    println!("1 and 2 threads drew the same bytes");
}

/// Warm renders on `threads` threads; prints a row of the table.
fn time(
    renderer: &CpuRenderer,
    gaussians: &Gaussians,
    camera: &Camera,
    options: &RenderOptions,
    threads: usize,
    stages: bool,
) -> Rendered {
    let runs = (40_000_000 / gaussians.len()).clamp(10, 100);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut picture = renderer.render(gaussians, camera, options).unwrap();
        let mut walls = Vec::new();
        let mut cpus = Vec::new();
        let mut times = Vec::new();
        for _ in 0..runs {
            let (wall, cpu) = (Instant::now(), cpu_time());
            times.push(renderer.render_into(gaussians, camera, options, &mut picture).unwrap());
            walls.push(wall.elapsed());
            cpus.push(cpu_time() - cpu);
        }
        let row = [median(&mut walls), walls[0], median(&mut cpus), cpus[0]].map(ms);
        println!(
            "{:>10} {threads:>7} {:>8.2} ms {:>8.2} {:>8.2} ms {:>8.2}",
            gaussians.len(),
            row[0],
            row[1],
            row[2],
            row[3]
        );
        if stages {
            print_stages(&times);
        }
        picture
    })
}

fn print_stages(times: &[StageTimes]) {
    let stage = |f: fn(&StageTimes) -> Duration| times.iter().map(f).min().map_or(0.0, ms);
    println!(
        "{:18} project {:.2}, sort {:.2}, bin {:.2}, blend {:.2} ms, wall, min",
        "",
        stage(|t| t.project),
        stage(|t| t.sort),
        stage(|t| t.bin),
        stage(|t| t.blend)
    );
}

fn print_error(renderer: &CpuRenderer, camera: &Camera, options: &RenderOptions) {
    let gaussians = surfel_car(ERROR_GAUSSIANS);
    let exact = Reference.render(&gaussians, camera, options).unwrap();
    let start = Instant::now();
    let found = renderer.render(&gaussians, camera, options).unwrap();
    let wall = start.elapsed();
    let [color, alpha, depth] = compare(&found, &exact);
    println!("error against f64, {ERROR_GAUSSIANS} Gaussians (drawn in {:.2} ms, cold):", ms(wall));
    for (name, d) in [("colour", color), ("alpha", alpha), ("depth, m", depth)] {
        println!("  {name:9} mean {:.1e}  99.9 % {:.1e}  max {:.1e}", d.mean, d.p999, d.max);
    }
}

fn same_bytes(a: &Rendered, b: &Rendered) -> bool {
    let bits = |p: &Rendered| -> Vec<u32> {
        let color = p.color.as_flattened().iter();
        color.chain(&p.alpha).chain(&p.depth).map(|v| v.to_bits()).collect()
    };
    bits(a) == bits(b)
}
