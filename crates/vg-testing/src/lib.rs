//! Code that tests and benches share: a seeded generator, scenes, vehicles, networks, golden files, and comparison of
//! pictures.
#![allow(missing_docs)] // for tests, whose names are the documentation

pub mod boxes;
pub mod golden;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod gradients;
pub mod networks;
pub mod npz;
pub mod renderers;
pub mod sample;
pub mod scenes;
pub mod stiff;
pub mod timing;
pub mod tools;
pub mod vehicle;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use vg::render::Rendered;

/// The repository.
pub fn root() -> &'static Path {
    static ROOT: LazyLock<PathBuf> = LazyLock::new(|| {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        here.ancestors().nth(2).expect("crates/vg-testing lies two folders deep").to_owned()
    });
    &ROOT
}

/// Prints a line past the output capture of the test harness: the reason why a test is skipped.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Uniform numbers from a 64-bit counter (splitmix64): the same on every machine.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A standard normal number (Box-Muller).
    pub fn normal(&mut self) -> f64 {
        let r = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        r * (std::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }
}

/// Mean, 99.9th percentile and maximum of absolute differences; NaN anywhere makes the maximum NaN.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    pub mean: f64,
    pub p999: f64,
    pub max: f64,
}

pub fn difference(pairs: impl Iterator<Item = (f64, f64)>) -> Difference {
    let mut d: Vec<f64> = pairs.map(|(a, b)| (a - b).abs()).collect();
    d.sort_by(f64::total_cmp);
    let n = d.len();
    Difference {
        mean: d.iter().sum::<f64>() / n as f64,
        p999: d[((n as f64 * 0.999) as usize).min(n - 1)],
        max: d[n - 1],
    }
}

/// Differences of colour, alpha and depth of two pictures.
pub fn compare(a: &Rendered, b: &Rendered) -> [Difference; 3] {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let plane = |a: &[f32], b: &[f32]| difference(a.iter().zip(b).map(|(&a, &b)| (a.into(), b.into())));
    [
        plane(a.color.as_flattened(), b.color.as_flattened()),
        plane(&a.alpha, &b.alpha),
        plane(&a.depth, &b.depth),
    ]
}

pub fn is_finite(picture: &Rendered) -> bool {
    picture.color.as_flattened().iter().chain(&picture.alpha).chain(&picture.depth).all(|v| v.is_finite())
}
