//! What a caller may choose of a refinement.

use super::densify::Densify;
use super::parameters::Rates;
use serde::Serialize;
use vg_geometry::{Error, Result};
use vg_splat::render::Backend;
use vg_splat::render::backend::{is_built, not_built};

/// How long to refine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Amount {
    /// So many steps.
    Iterations(u32),
    /// About so many seconds: a number of steps that is found by timing the first ones. The report tells it, and the
    /// same number gives the same bytes.
    Seconds(f64),
}

/// Settings of a refinement; `RefineOptions::default()` is what everything is measured with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RefineOptions {
    /// How long.
    pub amount: Amount,
    /// Step sizes.
    pub rates: Rates,
    /// Weight of 1 - SSIM beside that of the mean absolute difference of colours, which is the rest to 1.
    pub ssim: f32,
    /// Weight of the mean square difference of alpha and mask.
    pub silhouette: f32,
    /// Weight, per metre, of the mean absolute difference of depth to where the surface was at the beginning: what
    /// pictures do not tell stays where it was measured.
    pub depth: f32,
    /// Whether each view has an exposure of its own.
    pub exposure: bool,
    /// Whether one of three or more views takes no part and tells when to stop.
    pub hold_out: bool,
    /// Whether Gaussians divide and go on the way; `None`, the default: they do not.
    pub densify: Option<Densify>,
    /// Who draws and goes back; [`trainer`](vg_splat::render::backend::trainer) says what `Auto` is.
    pub backend: Backend,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            amount: Amount::Iterations(300),
            rates: Rates {
                means: 6e-4,
                rotations: 1e-3,
                scales: 5e-3,
                opacities: 2.5e-2,
                colors: 2.5e-3,
                view_dependence: 1.25e-4,
                exposure: 5e-3,
            },
            ssim: 0.2,
            silhouette: 0.5,
            depth: 0.2,
            exposure: true,
            hold_out: false,
            densify: None,
            backend: Backend::Auto,
        }
    }
}

impl RefineOptions {
    /// Each field in its range.
    pub fn validate(&self) -> Result<()> {
        self.validate_as("options.refine")
    }

    /// The same where this is called `argument`.
    pub(super) fn validate_as(&self, argument: &str) -> Result<()> {
        let refuse = |field: &str, found: String, allowed: &str| {
            Err(Error::argument(format!("{argument}.{field}"), found, allowed))
        };
        if self.backend == Backend::Gpu && !is_built() {
            return Err(not_built(&format!("{argument}.backend")));
        }
        match self.amount {
            Amount::Iterations(n) if n > MOST_ITERATIONS => {
                return refuse("iterations", n.to_string(), "at most 1000000");
            }
            Amount::Seconds(s) if !(s > 0.0 && s <= 86400.0) => {
                return refuse("seconds", s.to_string(), "above 0, at most 86400");
            }
            _ => {}
        }
        for (name, weight) in [("ssim", self.ssim), ("silhouette", self.silhouette), ("depth", self.depth)] {
            if !(0.0..=1.0).contains(&weight) {
                return refuse(name, weight.to_string(), "0 to 1");
            }
        }
        for (name, rate) in self.rates.named() {
            if !(0.0..=10.0).contains(&rate) {
                return refuse(&format!("rates.{name}"), rate.to_string(), "0 to 10");
            }
        }
        self.densify.map_or(Ok(()), |densify| densify.validate(&format!("{argument}.densify")))
    }
}

/// More steps are a mistake: 3DGS takes 30,000.
const MOST_ITERATIONS: u32 = 1_000_000;
