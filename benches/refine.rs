//! Time of a step of refinement, compared with OpenSplat's CPU renderer in the same run.
//!
//! ```text
//! cargo bench --bench refine                                              the library alone
//! cargo bench --bench refine -- --opensplat CHECKOUT --python PYTHON      both, in turns
//! ```
//!
//! CHECKOUT is a clone of OpenSplat's repository (AGPL; none of its code is here), PYTHON an interpreter with PyTorch,
//! NumPy and ninja. A C++ compiler is needed: the first run builds an extension, which takes minutes.
//!
//! Both have the same Gaussians, cameras, targets and loss (0.8 L1 + 0.2 (1 - SSIM) of colour on black, without the
//! five pixels at the border), the same Adam rates, and two threads. A step contains what both do: draw one view,
//! compute the gradient of every parameter, update every parameter by Adam. The library's own steps also have two more
//! loss terms and exposures; those of OpenSplat also keep gradients of splat centres, and update SH bands above 0 once
//! in 16 steps.

#[allow(dead_code, unused_imports)] // used by density control and its tests, which are not compiled here
#[path = "../crates/vehicle-gaussians/src/refine/adam.rs"]
mod adam; // the optimiser of the library

use adam::Adam;
use glam::DVec3;
use rayon::prelude::*;
use std::fs::{read, write};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};
use vg::refine::{Rates, RefineOptions};
use vg::render::loss::{self, Structure, Term};
use vg::render::{Background, CpuRenderer, Gradients, PictureGradient, RenderOptions, Rendered, Renderer};
use vg::{Camera, Error, Gaussians, Result, io};
use vg_testing::timing::cpu_time;
use vg_testing::{Random, scenes};

const GAUSSIANS: usize = 100_000;
const SIZE: [u32; 2] = [512, 384];
const THREADS: usize = 2;
const BLOCKS: usize = 3;
/// Rounds per block and kind of work; a round is one step for each view.
const ROUNDS: usize = 3;
/// Weight of 1 - SSIM against that of L1, as in OpenSplat.
const SSIM: f64 = 0.2;
/// Adam's epsilon.
const NOISE: f32 = 1e-9;
/// OpenSplat's loss leaves out the pixels whose SSIM window is cut.
const RIM: u32 = 5;

/// The work that is timed.
#[derive(Clone, Copy)]
enum Work {
    /// A picture, its loss, and all gradients.
    Gradients,
    /// `Gradients`, and a step; OpenSplat with its own optimiser.
    Step,
    /// `Step`, with the fastest optimiser of libtorch for OpenSplat.
    FusedStep,
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| w != "--bench").collect();
    let after = |name: &str| words.iter().position(|w| w == name).and_then(|i| words.get(i + 1));
    let mut library = Library::new()?;
    let folder = tempfile::tempdir().expect("a folder");
    let mut opensplat = match (after("--opensplat"), after("--python")) {
        (Some(checkout), Some(python)) => Some(OpenSplat::start(python, checkout, folder.path(), &library)?),
        _ => None,
    };
    println!(
        "{GAUSSIANS} Gaussians, SH degree 3, {} views of {}x{}, {THREADS} threads each, {}",
        library.cameras.len(),
        SIZE[0],
        SIZE[1],
        library.renderer.level()
    );
    if let Some(opensplat) = &mut opensplat {
        compare(&mut library, opensplat, folder.path())?;
    }

    println!(
        "ms for one view: median (least to most) of {BLOCKS} blocks of {ROUNDS} rounds in turns, each a step by every view\n"
    );
    println!("| | vg | CPU | OpenSplat | CPU | OpenSplat / vg | CPU |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let all = [
        ("picture, loss, gradients", Work::Gradients),
        ("a step, its optimiser", Work::Step),
        ("a step, libtorch's fused Adam", Work::FusedStep),
    ];
    // Blocks alternate, so that other load on the machine affects all of them.
    let mut times = vec![(Vec::new(), Vec::new()); all.len()];
    for _ in 0..BLOCKS {
        for ((_, work), (here, there)) in all.iter().zip(&mut times) {
            block(*work, &mut library, opensplat.as_mut(), here, there)?;
        }
    }
    for ((name, _), (here, there)) in all.iter().zip(&times) {
        if there.is_empty() {
            println!("| {name} | {} | {} | | | | |", shown(here, 0), middle(here, 1));
            continue;
        }
        let ratios: Vec<_> = here.iter().zip(there).map(|(a, b)| [b[0] / a[0], b[1] / a[1]]).collect();
        println!(
            "| {name} | {} | {} | {} | {} | {} | {} |",
            shown(here, 0),
            middle(here, 1),
            shown(there, 0),
            middle(there, 1),
            shown(&ratios, 0),
            middle(&ratios, 1)
        );
    }
    let share = |d: Duration| 1e3 * d.as_secs_f64() / f64::from(library.drawn);
    println!("\nvg's loss and its gradient take {:.1} ms of each", share(library.in_loss));
    Ok(())
}

/// Runs rounds in turns, after one of each that is not timed; adds wall and processor ms of one view.
fn block(
    work: Work,
    library: &mut Library,
    mut opensplat: Option<&mut OpenSplat>,
    here: &mut Vec<[f64; 2]>,
    there: &mut Vec<[f64; 2]>,
) -> Result<()> {
    /// Time to wait so that a thread that spins before it sleeps takes no time from the other program.
    const PAUSE: Duration = Duration::from_millis(50);
    library.reset();
    if let Some(opensplat) = &mut opensplat {
        opensplat.ask("reset")?;
    }
    let per_view = 1e3 / library.cameras.len() as f64;
    for round in 0..=ROUNDS {
        std::thread::sleep(PAUSE);
        let row = library.round(work)?;
        if round > 0 {
            here.push(row.map(|s| s * per_view));
        }
        std::thread::sleep(PAUSE);
        let Some(opensplat) = &mut opensplat else { continue };
        let row = opensplat.ask(match work {
            Work::Gradients => "gradients",
            Work::Step => "step",
            Work::FusedStep => "fused_step",
        })?;
        if round > 0 {
            there.push(row.map(|s| s * per_view));
        }
    }
    Ok(())
}

/// Prints the differences of the two pictures of the first view and of their gradients of means.
fn compare(library: &mut Library, opensplat: &mut OpenSplat, folder: &Path) -> Result<()> {
    let [loss, _] = opensplat.ask("look")?;
    let numbers = |name: &str| -> Vec<f32> {
        let bytes = read(folder.join(name)).expect("what was written");
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four"))).collect()
    };
    let here = library.descend(0)?;
    let picture = numbers("picture.f32");
    let colors = library.picture.color.as_flattened().iter().zip(&picture);
    let off = vg_testing::difference(colors.map(|(a, b)| (a.min(1.0).into(), (*b).into())));
    println!("loss {here:.6} and {loss:.6}; pictures differ by {:.1e}, at most {:.1e}", off.mean, off.max);
    let apart = |name: &str| {
        let there = numbers(name);
        let pairs = library.gradients.means.as_flattened().iter().zip(&there);
        let off: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
        (off / there.iter().map(|b| f64::from(*b).powi(2)).sum::<f64>()).sqrt()
    };
    println!(
        "gradients of means differ by {:.1e} of their norm; by {:.1e} if OpenSplat's colour depends on its centre\n",
        apart("means.f32"),
        apart("means_turning.f32")
    );
    Ok(())
}

/// The library's side.
struct Library {
    pool: rayon::ThreadPool,
    renderer: CpuRenderer,
    options: RenderOptions,
    rates: Rates,
    cameras: Vec<Camera>,
    /// `[view][height * width]`
    targets: Vec<Vec<[f32; 3]>>,
    /// Data of the target for SSIM, per view.
    structures: Vec<Structure>,
    /// 1 inside, 0 at the border that the loss ignores. `[height * width]`
    inside: Vec<f32>,
    start: Gaussians,
    // Written by the steps.
    gaussians: Gaussians,
    parameters: Parameters,
    picture: Rendered,
    of_picture: PictureGradient,
    gradients: Gradients,
    in_loss: Duration,
    drawn: u32,
}

impl Library {
    fn new() -> Result<Self> {
        let start = scenes::surfel_car(GAUSSIANS);
        // OpenSplat's constants.
        let options = RenderOptions {
            background: Background::Color([0.0; 3]),
            max_alpha: 0.999,
            ..RenderOptions::default()
        };
        let around = [[0.75, -0.55], [-0.6, -0.7], [-0.75, 0.55], [0.6, 0.7]];
        let [width, height] = SIZE;
        let camera = |[x, y]: [f64; 2]| scenes::looking_at_origin(width, height, DVec3::new(x, y, 0.36), 8.0);
        let cameras = around.map(camera).to_vec();
        let (renderer, shown) = (CpuRenderer::new(), perturbed(&start));
        let target = |camera| {
            let color = renderer.render(&shown, camera, &options)?.color;
            Ok(color.into_iter().map(|c| c.map(|v| v.min(1.0))).collect())
        };
        let targets: Vec<Vec<[f32; 3]>> = cameras.iter().map(target).collect::<Result<_>>()?;
        let inner = |i: u32, size: u32| i >= RIM && i + RIM < size;
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| (u, v)));
        let inside: Vec<f32> =
            pixels.map(|(u, v)| f32::from(u8::from(inner(u, width) && inner(v, height)))).collect();
        let structures = targets.iter().map(|target| Structure::new(target, SIZE, Some(inside.clone())));
        let rates = RefineOptions::default().rates;
        Ok(Self {
            pool: rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().expect("threads"),
            renderer,
            options,
            // The rate of centres is in metres.
            rates: Rates { means: rates.means * radius_m(&start), ..rates },
            cameras,
            structures: structures.collect::<Result<_>>()?,
            targets,
            inside,
            gaussians: start.clone(),
            parameters: Parameters::new(&start),
            start,
            picture: Rendered::default(),
            of_picture: PictureGradient::default(),
            gradients: Gradients::default(),
            in_loss: Duration::ZERO,
            drawn: 0,
        })
    }

    fn reset(&mut self) {
        self.gaussians = self.start.clone();
        self.parameters = Parameters::new(&self.start);
    }

    /// Wall and processor seconds of one step by each view.
    fn round(&mut self, work: Work) -> Result<[f64; 2]> {
        let (wall, cpu) = (Instant::now(), cpu_time());
        for view in 0..self.cameras.len() {
            self.descend(view)?;
            if let Work::Step | Work::FusedStep = work {
                let Self { pool, parameters, gradients, rates, .. } = self;
                self.gaussians = pool.install(|| {
                    parameters.step(gradients, rates);
                    parameters.made()
                })?;
            }
        }
        Ok([wall.elapsed().as_secs_f64(), (cpu_time() - cpu).as_secs_f64()])
    }

    /// Draws a picture and computes the gradients of its loss. Returns the loss.
    fn descend(&mut self, view: usize) -> Result<f64> {
        let Self { pool, renderer, gaussians, options, cameras, targets, structures, inside, .. } = self;
        let results = (&mut self.picture, &mut self.of_picture, &mut self.gradients);
        let mut value = 0.0;
        let of_loss = |picture: &Rendered, gradient: &mut PictureGradient| {
            value += loss::l1(picture, &targets[view], Term::weighing(1.0 - SSIM).on(inside), gradient)?;
            value += structures[view].dissimilarity(picture, SSIM, gradient)?;
            Ok(())
        };
        let times = pool.install(|| {
            renderer.render_with_gradients_into(gaussians, &cameras[view], options, results, of_loss)
        })?;
        self.in_loss += times.loss;
        self.drawn += 1;
        Ok(value)
    }
}

/// Half the diagonal of the box around all centres, metres.
fn radius_m(gaussians: &Gaussians) -> f32 {
    let (low, high) = gaussians.bounds().expect("some");
    0.5 * (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f32>().sqrt()
}

/// The vehicle with small changes everywhere, as the target of the photographs.
fn perturbed(g: &Gaussians) -> Gaussians {
    let mut r = Random::new(5);
    let mut by = |v: f32, sigma: f64| v + (sigma * r.normal()) as f32;
    Gaussians::from_arrays(
        g.sh_degree(),
        g.means().iter().map(|m| m.map(|v| by(v, 0.004))).collect(),
        g.rotations().to_vec(),
        g.scales().iter().map(|s| s.map(|v| v * by(0.0, 0.1).exp())).collect(),
        g.opacities().iter().map(|&o| by(o, 0.05).clamp(0.05, 0.99)).collect(),
        g.sh().iter().map(|&v| by(v, 0.03)).collect(),
    )
    .expect("storable")
}

/// Parameters of Adam, each in a space without bounds.
struct Parameters {
    sh_degree: u8,
    means: Vec<[f32; 3]>,
    rotations: Vec<[f32; 4]>,
    log_scales: Vec<[f32; 3]>,
    logits: Vec<f32>,
    sh: Vec<f32>,
    /// Moments for means, rotations, scales, opacities and colours.
    adams: [Adam; 5],
    gradient: Vec<f32>,
}

impl Parameters {
    fn new(g: &Gaussians) -> Self {
        let n = g.len();
        Self {
            sh_degree: g.sh_degree(),
            means: g.means().to_vec(),
            rotations: g.rotations().to_vec(),
            log_scales: g.scales().iter().map(|s| s.map(f32::ln)).collect(),
            logits: g.opacities().iter().map(|o| (o / (1.0 - o)).ln()).collect(),
            sh: g.sh().to_vec(),
            adams: [3 * n, 4 * n, 3 * n, n, g.sh().len()].map(|len| Adam::new(len, NOISE)),
            gradient: Vec::new(),
        }
    }

    fn step(&mut self, gradients: &Gradients, rates: &Rates) {
        let [means, rotations, scales, opacities, sh] = &mut self.adams;
        means.step(self.means.as_flattened_mut(), gradients.means.as_flattened(), &[rates.means]);
        rotations.step(
            self.rotations.as_flattened_mut(),
            gradients.rotations.as_flattened(),
            &[rates.rotations],
        );
        let log_scales = self.log_scales.as_flattened_mut();
        let in_log = |(s, g): (&f32, &f32)| s.exp() * g;
        self.gradient.clear();
        self.gradient.par_extend(log_scales.par_iter().zip(gradients.scales.as_flattened()).map(in_log));
        scales.step(log_scales, &self.gradient, &[rates.scales]);
        let in_logit = |(x, g): (&f32, &f32)| sigmoid(*x) * sigmoid(-x) * g;
        self.gradient.clear();
        self.gradient.par_extend(self.logits.par_iter().zip(&gradients.opacities).map(in_logit));
        opacities.step(&mut self.logits, &self.gradient, &[rates.opacities]);
        let stride = self.sh.len() / self.logits.len();
        let rate = |k: usize| if k < 3 { rates.colors } else { rates.view_dependence };
        sh.step(&mut self.sh, &gradients.sh, &(0..stride).map(rate).collect::<Vec<f32>>());
    }

    /// Makes Gaussians through the constructor that checks every number; the library's own refinement overwrites the
    /// Gaussians of the previous step instead.
    fn made(&self) -> Result<Gaussians> {
        Gaussians::from_arrays(
            self.sh_degree,
            self.means.clone(),
            self.rotations.clone(),
            self.log_scales.par_iter().map(|s| s.map(f32::exp)).collect(),
            self.logits.par_iter().map(|x| sigmoid(*x)).collect(),
            self.sh.clone(),
        )
    }
}

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

/// The process of OpenSplat, which answers each line with a line.
struct OpenSplat {
    child: Child,
    ask: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl OpenSplat {
    fn start(python: &str, checkout: &str, folder: &Path, library: &Library) -> Result<Self> {
        let camera_from_vehicle = |camera: &Camera| {
            let m = camera.vehicle_from_camera.inverse().to_row_major();
            [&m[..4], &m[4..8], &m[8..], &[0.0, 0.0, 0.0, 1.0]].map(<[f64]>::to_vec)
        };
        let intrinsics = |camera: &Camera| {
            let k = camera.intrinsics;
            [k.fx, k.fy, k.cx, k.cy]
        };
        let Rates { means, rotations, scales, opacities, colors, view_dependence, .. } = library.rates;
        let job = serde_json::json!({
            "size": SIZE,
            "cameras": library.cameras.iter().map(camera_from_vehicle).collect::<Vec<_>>(),
            "intrinsics": library.cameras.iter().map(intrinsics).collect::<Vec<_>>(),
            "rates": [means, scales, rotations, opacities, colors, view_dependence],
            "noise": NOISE,
        });
        let targets: Vec<u8> =
            library.targets.iter().flat_map(|t| t.as_flattened()).flat_map(|v| v.to_le_bytes()).collect();
        io::ply::write(&folder.join("start.ply"), &library.start)?;
        write(folder.join("job.json"), job.to_string()).expect("a file");
        write(folder.join("targets.f32"), targets).expect("a file");
        let program = vg_testing::root().join("benches/peers/opensplat.py");
        let mut child = Command::new(python)
            .arg(program)
            .arg(checkout)
            .arg(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| failed(&e))?;
        let ask = child.stdin.take();
        let answers = BufReader::new(child.stdout.take().expect("a pipe"));
        Ok(Self { child, ask, answers })
    }

    /// Returns the two numbers of its answer.
    fn ask(&mut self, word: &str) -> Result<[f64; 2]> {
        let mut line = String::new();
        let ask = self.ask.as_mut().expect("a pipe");
        writeln!(ask, "{word}").and_then(|()| self.answers.read_line(&mut line)).map_err(|e| failed(&e))?;
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
        numbers.try_into().map_err(|_| Error::argument("PYTHON", format!("{line:?}"), "two numbers"))
    }
}

impl Drop for OpenSplat {
    fn drop(&mut self) {
        // Closing its input ends it.
        self.ask = None;
        let _ = self.child.wait();
    }
}

fn failed(e: &std::io::Error) -> Error {
    Error::argument("PYTHON", e.to_string(), "one with torch, numpy and ninja")
}

fn sorted(rows: &[[f64; 2]], column: usize) -> Vec<f64> {
    let mut values: Vec<f64> = rows.iter().map(|row| row[column]).collect();
    values.sort_by(f64::total_cmp);
    values
}

fn middle(rows: &[[f64; 2]], column: usize) -> String {
    format!("{:.1}", sorted(rows, column)[rows.len() / 2])
}

fn shown(rows: &[[f64; 2]], column: usize) -> String {
    let values = sorted(rows, column);
    format!("{} ({:.1} to {:.1})", middle(rows, column), values[0], values[values.len() - 1])
}
