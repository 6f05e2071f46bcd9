//! Render options; the defaults are those of INRIA and gsplat.

use vg_geometry::{Error, Result, choices};

/// The background behind the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// A colour, RGB in [0, 1]; the picture is opaque.
    Color([f32; 3]),
    /// No background: colour is premultiplied by the picture's own alpha.
    Transparent,
}

choices! {
    /// What a depth pixel means.
    pub enum DepthMode as "depth_mode" {
        /// Expected planar depth along the optical axis in metres; 0 where alpha is 0.
        Expected = 0 "expected",
        /// The same times alpha: the plain sum over the Gaussians.
        Accumulated = 1 "accumulated",
    }
}

/// Render options; `RenderOptions::default()` is used for all measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// The background behind the vehicle.
    pub background: Background,
    /// Variance added to each projected Gaussian, pixels^2.
    pub blur: f32,
    /// Compensate the opacity for the added variance (Mip-splatting's screen-space filter).
    pub antialiased: bool,
    /// Gaussians whose centre has a z below this, metres, are not drawn.
    pub near: f32,
    /// Gaussians whose centre has a z above this, metres, are not drawn.
    pub far: f32,
    /// Largest alpha of one Gaussian in one pixel.
    pub max_alpha: f32,
    /// Highest SH band used; values above the Gaussians' own degree change nothing.
    pub sh_degree: u8,
    /// The meaning of `Rendered::depth`.
    pub depth_mode: DepthMode,
}

/// Smallest alpha that is drawn.
pub const ALPHA_THRESHOLD: f32 = 1.0 / 255.0;

/// A pixel is finished, without the current Gaussian, where its transmittance would fall to this.
pub const TRANSMITTANCE_THRESHOLD: f32 = 1e-4;

/// Floor of the antialiased opacity compensation.
pub const MIN_COMPENSATION: f32 = 0.005;

/// x/z and y/z are clamped to the image plus this fraction of its size before the Jacobian is taken.
pub const PROJECTION_MARGIN: f32 = 0.15;

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            background: Background::Color([1.0; 3]),
            blur: 0.3,
            antialiased: false,
            near: 0.01,
            far: 1e10,
            max_alpha: 0.99,
            sh_degree: 3,
            depth_mode: DepthMode::Expected,
        }
    }
}

impl RenderOptions {
    /// Checks that each field is in its range.
    pub fn validate(&self) -> Result<()> {
        let check = |name: &str, value: f32, range: std::ops::RangeInclusive<f32>| {
            if range.contains(&value) {
                return Ok(());
            }
            Err(Error::argument(
                format!("options.{name}"),
                value.to_string(),
                format!("{} to {}", range.start(), range.end()),
            ))
        };
        if let Background::Color(rgb) = self.background {
            for value in rgb {
                check("background", value, 0.0..=1.0)?;
            }
        }
        // Below 1e-4 px^2 a distant Gaussian could fall between pixel centres and vanish.
        check("blur", self.blur, 1e-4..=100.0)?;
        check("near", self.near, 1e-6..=1e10)?;
        check("far", self.far, self.near..=1e10)?;
        check("max_alpha", self.max_alpha, 0.01..=0.9999)
    }
}
