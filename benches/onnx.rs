//! Cost of a network, compared in one run with the same file in Python's ONNX Runtime: the first call, warm calls, and
//! memory over fifty vehicles.
//!
//! `cargo bench --features onnx --bench onnx -- HEAD.onnx PYTHON`: a Gaussian head (`training/head/export.py` makes
//! one), and a Python with NumPy and onnxruntime, whose library is used here too. Two threads, the bundled sample's
//! four views.

use std::io::{BufRead, BufReader, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;
use vg::onnx::{Input, Model, ModelOptions};
use vg::pipeline::{Options, reconstruct_on};
use vg::progress::Threads;
use vg::{Error, Result};
use vg_testing::sample::{self, INPUTS, median};

const THREADS: usize = 2;
const ROUNDS: usize = 9;
const VEHICLES: usize = 50;

/// Script that answers each line on standard input with the seconds of one run.
const PYTHON: &str = r#"
import sys, time, numpy as np, onnxruntime as ort
options = ort.SessionOptions()
options.intra_op_num_threads, options.inter_op_num_threads = 2, 1
options.enable_cpu_mem_arena = options.enable_mem_pattern = False
options.use_deterministic_compute = True
for key in "intra", "inter":
    options.add_session_config_entry(f"session.{key}_op.allow_spinning", "0")
session = ort.InferenceSession(sys.argv[1], options, providers=["CPUExecutionProvider"])
inputs = {
    "images": np.full((1, 3, 384, 512), 0.4, np.float32),
    "depth": np.full((1, 384, 512), 6, np.float32),
    "intrinsics": np.array([[[500, 0, 256], [0, 500, 192], [0, 0, 1]]], np.float32),
}
for _ in sys.stdin:
    start = time.perf_counter()
    for view in range(4):
        session.run(["attributes"], inputs)
    print(time.perf_counter() - start, flush=True)
"#;

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| w != "--bench").collect();
    let [head, python] = words.as_slice() else {
        println!("nothing to measure: give HEAD.onnx PYTHON");
        return Ok(());
    };
    let failed =
        |e: std::io::Error| Error::argument("PYTHON", e.to_string(), "one with numpy and onnxruntime");
    let where_is =
        "import onnxruntime, os; print(os.path.join(os.path.dirname(onnxruntime.__file__), 'capi'))";
    let found = Command::new(python).args(["-c", where_is]).output().map_err(failed)?;
    let runtime = String::from_utf8_lossy(&found.stdout).trim().to_owned();

    let start = Instant::now();
    let opening = ModelOptions { runtime: Some(runtime.into()), threads: THREADS, ..ModelOptions::default() };
    let model = Model::open(Path::new(head), &opening)?;
    println!("opened in {:.2} s", start.elapsed().as_secs_f64());

    let mut child = Command::new(python)
        .args(["-c", PYTHON, head])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let mut ask = child.stdin.take().expect("a pipe");
    let mut answers = BufReader::new(child.stdout.take().expect("a pipe"));
    let mut theirs = || -> Result<f64> {
        let mut line = String::new();
        writeln!(ask, "go").and_then(|()| answers.read_line(&mut line)).map_err(failed)?;
        line.trim().parse().map_err(|_| Error::argument("PYTHON", line.clone(), "seconds"))
    };
    let (first, first_theirs) = (ours(&model)?, theirs()?);
    let (mut here, mut there) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        here.push(ours(&model)?);
        there.push(theirs()?);
    }
    let ratio = median(here.iter().zip(&there).map(|(a, b)| a / b));
    let (here, there) = (median(here.into_iter()), median(there.into_iter()));
    println!("4 views of 512x384, {THREADS} threads, medians of {ROUNDS} rounds in turns:");
    println!(
        "  here {here:.3} s (first {first:.3}), Python {there:.3} s (first {first_theirs:.3}), ratio {ratio:.3}"
    );
    drop(ask);
    let _ = child.wait();

    let scene = sample::open(&INPUTS, true)?;
    let threads = Threads::new(THREADS)?;
    let with = |model| Options { head_model: Some(model), check: false, ..Options::default() };
    let start = Instant::now();
    let options = with(Model::open(Path::new(head), &opening)?);
    reconstruct_on(&threads, &scene, &options, &mut |_| ControlFlow::Continue(()))?;
    let cold = start.elapsed().as_secs_f64();
    let start = Instant::now();
    reconstruct_on(&threads, &scene, &options, &mut |_| ControlFlow::Continue(()))?;
    println!("opened, and the first vehicle: {cold:.2} s; the next: {:.2} s", start.elapsed().as_secs_f64());
    let options = with(model);
    for vehicle in 1..=VEHICLES {
        let start = Instant::now();
        let made = reconstruct_on(&threads, &scene, &options, &mut |_| ControlFlow::Continue(()))?;
        if vehicle == 1 || vehicle % 10 == 0 {
            let (seconds, n) = (start.elapsed().as_secs_f64(), made.gaussians.len());
            println!("vehicle {vehicle}: {seconds:.2} s, {n} Gaussians, {}", resident());
        }
    }
    Ok(())
}

/// Seconds of four runs, one view each.
fn ours(model: &Model) -> Result<f64> {
    let (images, depth) = (vec![0.4f32; 3 * 384 * 512], vec![6.0f32; 384 * 512]);
    let k = [500.0, 0.0, 256.0, 0.0, 500.0, 192.0, 0.0, 0.0, 1.0];
    let start = Instant::now();
    for _ in 0..4 {
        model.run(&[
            Input { name: "images", shape: &[1, 3, 384, 512], data: &images },
            Input { name: "depth", shape: &[1, 384, 512], data: &depth },
            Input { name: "intrinsics", shape: &[1, 3, 3], data: &k },
        ])?;
    }
    Ok(start.elapsed().as_secs_f64())
}

/// Current and peak memory, from /proc on Linux.
fn resident() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = |name: &str| {
        let line = status.lines().find_map(|l| l.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()
    };
    let mib = |name: &str| kib(name).map_or("?".into(), |k| format!("{:.0}", k / 1024.0));
    format!("{} MiB now, {} MiB at most", mib("VmRSS:"), mib("VmHWM:"))
}
