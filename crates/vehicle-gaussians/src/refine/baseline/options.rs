//! Settings of the baseline.

use super::super::densify::{Densify, MOST};
use super::super::{Amount, Rates, RefineOptions};
use serde::Serialize;
use vg_geometry::{Error, Result};
use vg_splat::gaussians::sh;
use vg_splat::render::Backend;

/// Settings of 3D Gaussian splatting as a baseline; the defaults are the original's except for the length, whose
/// reason is in docs/BASELINE.md.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BaselineOptions {
    /// Length of the run. A number of seconds is converted to steps by the time of the first ones; later steps take
    /// longer where Gaussians multiply.
    pub amount: Amount,
    /// Number of random first Gaussians; with a cloud, the largest number of its points.
    pub points: usize,
    /// Highest SH degree of the colour, 0 to 3: the run begins with 0 and raises it one by one.
    pub sh_degree: u8,
    /// Step sizes at the beginning, those of centres as a share of the cameras' extent.
    pub rates: Rates,
    /// Step size of centres at the end, as a share of that at the beginning.
    pub last_means_rate: f32,
    /// Weight of 1 - SSIM; the mean absolute difference of colours has the rest to 1.
    pub ssim: f32,
    /// Density control; `None` for no control.
    pub densify: Option<Densify>,
    /// Seed of all random draws.
    pub seed: u64,
}

impl Default for BaselineOptions {
    fn default() -> Self {
        Self {
            amount: Amount::Iterations(2_000),
            points: 100_000,
            sh_degree: 3,
            rates: Rates {
                means: 1.6e-4,
                rotations: 1e-3,
                scales: 5e-3,
                opacities: 5e-2,
                colors: 2.5e-3,
                view_dependence: 1.25e-4,
                exposure: 0.0,
            },
            last_means_rate: 0.01,
            ssim: 0.2,
            densify: Some(Densify::default()),
            seed: 0,
        }
    }
}

impl BaselineOptions {
    /// Checks that each field is in its range.
    ///
    /// # Errors
    /// [`Error::Argument`] with the field's name.
    pub fn validate(&self) -> Result<()> {
        self.settings().validate_as("options.baseline")?;
        let refuse = |field: &str, found: String, allowed: &str| {
            Err(Error::argument(format!("options.baseline.{field}"), found, allowed))
        };
        let most = self.densify.map_or(MOST, |densify| densify.most);
        if !(1..=most).contains(&self.points) {
            return refuse("points", self.points.to_string(), &format!("1 to {most}, the most Gaussians"));
        }
        if self.sh_degree > sh::MAX_DEGREE {
            return refuse("sh_degree", self.sh_degree.to_string(), "0 to 3");
        }
        if !(self.last_means_rate > 0.0 && self.last_means_rate <= 1.0) {
            return refuse("last_means_rate", self.last_means_rate.to_string(), "above 0, at most 1");
        }
        Ok(())
    }

    /// The optimisation's settings, with a loss of colours only.
    pub(super) fn settings(&self) -> RefineOptions {
        RefineOptions {
            amount: self.amount,
            rates: self.rates,
            ssim: self.ssim,
            silhouette: 0.0,
            depth: 0.0,
            exposure: false,
            hold_out: false,
            densify: self.densify,
            backend: Backend::Auto,
        }
    }

    /// Step sizes after the fraction `part` of the run, 0 to 1.
    pub(super) fn rates_at(&self, part: f32) -> Rates {
        Rates { means: self.rates.means * self.last_means_rate.powf(part), ..self.rates }
    }
}
