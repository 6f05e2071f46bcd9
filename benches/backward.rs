//! Time of a picture with its gradients: `cargo bench --bench backward`.
//!
//! ```text
//! cargo bench --bench backward                      the car of `benches/render.rs`, and a denser scene
//! cargo bench --bench backward -- --stages          wall time of each stage
//! cargo bench --bench backward -- --portable        without AVX2
//! ```
//!
//! The loss is the mean square of colour, alpha and depth, whose gradient takes part of a millisecond. The forward pass
//! alone is printed for comparison. Compare processor time on a busy machine.

use glam::DVec3;
use std::time::{Duration, Instant};
use vg::render::cpu::GradientTimes;
use vg::render::loss::{self, Structure, Term};
use vg::render::{CpuRenderer, Gradients, PictureGradient, RenderOptions, Rendered, Renderer};
use vg::{Camera, Gaussians};
use vg_testing::timing::{cpu_time, median, ms};
use vg_testing::{Random, scenes};

const RUNS: usize = 40;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let renderer = if has("--portable") { CpuRenderer::portable() } else { CpuRenderer::new() };
    let camera = scenes::looking_at_origin(512, 384, DVec3::new(0.75, -0.55, 0.36), 8.0);
    println!("512x384, SH degree 3, {}, warm, {RUNS} runs", renderer.level());
    println!(
        "{:18} {:>7} {:>8} {:>11} {:>8} {:>11} {:>8}",
        "scene", "threads", "", "wall median", "min", "CPU median", "min"
    );
    for (name, gaussians) in [("car, 200,000", scenes::surfel_car(200_000)), ("dense, 30,000", dense(30_000))]
    {
        let gradients =
            [1, 2].map(|threads| time(name, &renderer, &gaussians, &camera, threads, has("--stages")));
        assert!(gradients[0] == gradients[1], "1 and 2 threads give different gradients");
    }
    println!("1 and 2 threads gave the same bytes");
    time_losses(&renderer.render(&scenes::surfel_car(20_000), &camera, &RenderOptions::default()).unwrap());
}

/// Times each loss term on its own, in a pool of all processors.
fn time_losses(picture: &Rendered) {
    let target: Vec<[f32; 3]> = picture.color.iter().map(|c| c.map(|v| 0.9 * v + 0.05)).collect();
    let term = Term::weighing(1.0);
    let mut gradient = PictureGradient::default();
    let structure = Structure::new(&target, [picture.width, picture.height], None).unwrap();
    let terms: [(&str, Loss); 5] = [
        ("l1", &|g| loss::l1(picture, &target, term, g)),
        ("dissimilarity", &|g| loss::dissimilarity(picture, &target, term, g)),
        ("with a structure", &|g| structure.dissimilarity(picture, 1.0, g)),
        ("silhouette", &|g| loss::silhouette(picture, &picture.depth, term, g)),
        ("depth_l1", &|g| loss::depth_l1(picture, &picture.alpha, term, g)),
    ];
    for (name, term) in terms {
        let row = clock(|| {
            gradient.reset(picture);
            term(&mut gradient).unwrap();
        });
        println!(
            "{name:18} wall {:.2} ms, min {:.2}; CPU {:.2} ms, min {:.2}",
            row[0], row[1], row[2], row[3]
        );
    }
}

/// A term of the loss of one picture, added to a gradient.
type Loss<'a> = &'a dyn Fn(&mut PictureGradient) -> vg::Result<f64>;

/// Gaussians of 1 to 10 cm throughout the box of a car: many layers per pixel, none of them opaque.
fn dense(n: usize) -> Gaussians {
    let g = scenes::random(17, n, 3, [0.01, 0.1]);
    let mut r = Random::new(18);
    let opacities = (0..n).map(|_| r.uniform(0.02, 0.3) as f32).collect();
    Gaussians::from_arrays(
        3,
        g.means().to_vec(),
        g.rotations().to_vec(),
        g.scales().to_vec(),
        opacities,
        g.sh().to_vec(),
    )
    .unwrap()
}

fn time(
    name: &str,
    renderer: &CpuRenderer,
    gaussians: &Gaussians,
    camera: &Camera,
    threads: usize,
    stages: bool,
) -> Gradients {
    let options = RenderOptions::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let (mut picture, mut of_picture) = (Rendered::default(), PictureGradient::default());
        let mut gradients = Gradients::default();
        let mut times = Vec::new();
        let row = clock(|| {
            renderer.render_into(gaussians, camera, &options, &mut picture).unwrap();
        });
        print_row(name, threads, "forward", row);
        let row = clock(|| {
            let targets = (&mut picture, &mut of_picture, &mut gradients);
            let t = renderer.render_with_gradients_into(gaussians, camera, &options, targets, |p, g| {
                mean_square(p, g);
                Ok(())
            });
            times.push(t.unwrap());
        });
        print_row(name, threads, "both", row);
        if stages {
            print_stages(&times);
        }
        gradients
    })
}

fn mean_square(p: &Rendered, g: &mut PictureGradient) {
    let scale = 1.0 / p.alpha.len() as f32;
    g.color.extend(p.color.iter().map(|c| c.map(|v| scale * v)));
    g.alpha.extend(p.alpha.iter().map(|v| scale * v));
    g.depth.extend(p.depth.iter().map(|v| 0.1 * scale * v));
}

/// Median and minimum of wall time, then of processor time, ms.
fn clock(mut run: impl FnMut()) -> [f64; 4] {
    run();
    let (mut walls, mut cpus) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        let (wall, cpu) = (Instant::now(), cpu_time());
        run();
        walls.push(wall.elapsed());
        cpus.push(cpu_time() - cpu);
    }
    [median(&mut walls), walls[0], median(&mut cpus), cpus[0]].map(ms)
}

fn print_row(name: &str, threads: usize, what: &str, row: [f64; 4]) {
    println!(
        "{name:18} {threads:>7} {what:>8} {:>8.2} ms {:>8.2} {:>8.2} ms {:>8.2}",
        row[0], row[1], row[2], row[3]
    );
}

fn print_stages(times: &[GradientTimes]) {
    let stage = |f: fn(&GradientTimes) -> Duration| times.iter().map(f).min().map_or(0.0, ms);
    println!(
        "{:18} project {:.2}, sort {:.2}, bin {:.2}, blend {:.2}; loss {:.2}; back: blend {:.2}, sum {:.2}, project {:.2} ms, wall, min",
        "",
        stage(|t| t.forward.project),
        stage(|t| t.forward.sort),
        stage(|t| t.forward.bin),
        stage(|t| t.forward.blend),
        stage(|t| t.loss),
        stage(|t| t.backward.blend),
        stage(|t| t.backward.sum),
        stage(|t| t.backward.project)
    );
}
