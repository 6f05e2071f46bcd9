//! The speed of this machine, measured by a few milliseconds of work like that of a reconstruction, once per process
//! and number of threads.

use crate::prior::volume::Silhouette;
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::hint::black_box;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use vg_geometry::progress::Context;
use vg_geometry::{Camera, Intrinsics, Pose};
use vg_scene::mask::Label;
use vg_scene::{Mask, RgbImage, View};

/// Pieces of work per second on one thread of the reference machine, which the cost model was measured on.
const REFERENCE_RATE: f64 = 64_000.0;

/// Pieces per thread and measurement. The fastest measurement counts: other load on the machine slows the rest down,
/// and that load will have changed when the work is done.
const PIECES: usize = 8;

/// Duration of the measurement of one thread, and of all: new threads may share a core until the system moves them.
const ALONE: Duration = Duration::from_millis(3);
const TOGETHER: Duration = Duration::from_millis(25);

/// Speed relative to one thread of the reference machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Machine {
    /// Speed of one thread.
    pub serial: f64,
    /// Speed of all threads of the call together.
    pub parallel: f64,
}

impl Machine {
    /// Measured at the first call with this number of threads, and stored for later calls.
    pub(super) fn measured(context: &Context) -> Self {
        static KNOWN: Mutex<BTreeMap<usize, Machine>> = Mutex::new(BTreeMap::new());
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        *known.entry(context.threads()).or_insert_with(|| Self::measure(context))
    }

    fn measure(context: &Context) -> Self {
        let Some(probe) = Probe::new() else { return Self { serial: 1.0, parallel: 1.0 } };
        let threads = context.threads();
        let fastest = |pieces: usize, long: Duration, work: &(dyn Fn() + Sync)| {
            let (begin, mut least) = (Instant::now(), f64::INFINITY);
            while begin.elapsed() < long {
                let start = Instant::now();
                context.parallel(work);
                least = least.min(start.elapsed().as_secs_f64()).max(1e-9);
            }
            pieces as f64 / least / REFERENCE_RATE
        };
        let serial = fastest(PIECES, ALONE, &|| (0..PIECES).for_each(|k| probe.piece(k)));
        let all = PIECES * threads;
        let parallel = fastest(all, TOGETHER, &|| (0..all).into_par_iter().for_each(|k| probe.piece(k)));
        // Threads that share a core are together at least as fast as one alone.
        Self { serial, parallel: parallel.max(serial) }
    }
}

/// The work that is timed.
struct Probe {
    silhouette: Silhouette,
    picture: Vec<f32>,
}

const WIDTH: usize = 96;
const HEIGHT: usize = 64;

impl Probe {
    fn new() -> Option<Self> {
        let (width, height) = (WIDTH as u32, HEIGHT as u32);
        let intrinsics = Intrinsics { fx: 96.0, fy: 96.0, cx: 48.0, cy: 32.0 };
        let inside = |i: usize| (i % WIDTH).abs_diff(48).pow(2) + (i / WIDTH).abs_diff(32).pow(2) < 400;
        let label = |i: usize| if inside(i) { Label::Vehicle } else { Label::Background };
        let view = View {
            name: String::new(),
            camera: Camera::pinhole(width, height, intrinsics, Pose::IDENTITY).ok()?,
            image: RgbImage::new(width, height, vec![[0; 3]; WIDTH * HEIGHT]).ok()?,
            mask: Some(Mask::new(width, height, (0..WIDTH * HEIGHT).map(label).collect()).ok()?),
            depth: None,
        };
        let picture = (0..WIDTH * HEIGHT).map(|i| (i % 17) as f32).collect();
        Some(Self { silhouette: Silhouette::new(&view), picture })
    }

    /// One piece: look-ups in a silhouette's cone, and some rows of a 3 x 3 convolution.
    fn piece(&self, k: usize) {
        let mut sum = 0.0f32;
        for i in 0..1024usize {
            let (x, y) = ((i % 32) as f32 / 32.0 - 0.5, (i / 32) as f32 / 32.0 - 0.5);
            sum += self.silhouette.inside(Vec3::new(x, y, 2.0 + 0.01 * (k % 8) as f32));
        }
        black_box(sum + self.convolved());
    }

    /// Not inlined and by rows, so that the optimiser compiles it alike for all callers.
    #[inline(never)]
    fn convolved(&self) -> f32 {
        let mut sum = [0.0f32; WIDTH - 2];
        for v in 0..HEIGHT / 4 {
            for (dv, row) in self.picture[v * WIDTH..(v + 3) * WIDTH].chunks_exact(WIDTH).enumerate() {
                for du in 0..3 {
                    let weight = black_box((dv + 2 * du) as f32);
                    sum.iter_mut().zip(&row[du..]).for_each(|(sum, x)| *sum += weight * x);
                }
            }
        }
        sum.iter().sum()
    }
}
