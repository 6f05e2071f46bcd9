//! Options of a refinement.

use super::densify::Densify;
use super::parameters::Rates;
use serde::Serialize;
use vg_geometry::{Error, Result};
use vg_splat::render::Backend;
use vg_splat::render::backend::{is_built, not_built};

/// Amount of refinement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Amount {
    /// The number of steps.
    Iterations(u32),
    /// The approximate duration in seconds: the number of steps is found by timing the first ones. The report contains
    /// it, and the same number gives the same bytes.
    Seconds(f64),
}

/// Options of a refinement; all measurements use `RefineOptions::default()`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RefineOptions {
    /// Amount of refinement.
    pub amount: Amount,
    /// Step sizes.
    pub rates: Rates,
    /// Weight of 1 - SSIM; the weight of the mean absolute difference of colours is 1 minus this.
    pub ssim: f32,
    /// Weight of the mean square difference of alpha and mask.
    pub silhouette: f32,
    /// Weight, per metre, of the mean absolute difference of depth from the initial surface, which holds the surface
    /// where the pictures do not determine it.
    pub depth: f32,
    /// Whether each view's own exposure is estimated.
    pub exposure: bool,
    /// Whether one of three or more views is held out to decide when to stop.
    pub hold_out: bool,
    /// Density control; `None`, the default, for a fixed set of Gaussians.
    pub densify: Option<Densify>,
    /// Backend that renders and differentiates; see [`trainer`](vg_splat::render::backend::trainer) for `Auto`.
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
    /// Checks that each field is in its range.
    pub fn validate(&self) -> Result<()> {
        self.validate_as("options.refine")
    }

    /// [`RefineOptions::validate`] with the name `argument` for these options in errors.
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

/// Maximum of steps; 3DGS uses 30,000.
const MOST_ITERATIONS: u32 = 1_000_000;
