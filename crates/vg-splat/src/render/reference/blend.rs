//! Blending of every pixel with every Gaussian, and pictures with the discrete decisions (cuts) of another one.

use super::project::Projected;
use super::{Parameters, ReferencePicture};
use crate::render::options::TRANSMITTANCE_THRESHOLD;
use crate::render::{Background, DepthMode, RenderOptions};
use rayon::prelude::*;

/// A Gaussian in one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    pub(super) gaussian: usize,
    /// Whether `opacity e^-sigma` is above `max_alpha`.
    pub(super) clamped: bool,
}

/// The discrete decisions of a picture: the layers drawn in each pixel, nearest first.
#[derive(Clone, Debug)]
pub struct Cuts {
    /// Layers of each pixel. `[height * width]`
    pub(super) layers: Vec<Vec<Layer>>,
}

/// Indices of the drawn Gaussians, nearest first.
fn depth_order(splats: &[Option<Projected<f64>>]) -> Vec<usize> {
    let depth = |i: usize| splats[i].map_or(0.0, |s| s.depth as f32);
    let mut gaussian_from_rank: Vec<usize> = (0..splats.len()).filter(|&i| splats[i].is_some()).collect();
    // Stable sort by depth rounded to f32: ties are drawn in the order of storage.
    gaussian_from_rank.sort_by(|&a, &b| depth(a).total_cmp(&depth(b)));
    gaussian_from_rank
}

/// Offset of pixel `i` from the centre, and e^-sigma there.
pub(super) fn falloff(s: &Projected<f64>, i: usize, width: u32) -> ([f64; 2], f64) {
    let (u, v) = ((i % width as usize) as f64 + 0.5, (i / width as usize) as f64 + 0.5);
    let [dx, dy] = [u - s.center[0], v - s.center[1]];
    let sigma = 0.5 * (s.conic[0] * dx * dx + 2.0 * s.conic[1] * dx * dy + s.conic[2] * dy * dy);
    // e^-6 is below 1/255, so larger exponents are not drawn.
    if (0.0..=6.0).contains(&sigma) { ([dx, dy], (-sigma).exp()) } else { ([dx, dy], 0.0) }
}

/// Calls `layer(gaussian, opacity e^-sigma, alpha)` for every Gaussian drawn in pixel `i`, nearest first.
fn for_each_layer(
    splats: &[Option<Projected<f64>>],
    gaussian_from_rank: &[usize],
    i: usize,
    width: u32,
    max_alpha: f64,
    mut layer: impl FnMut(usize, f64, f64),
) {
    let mut transmittance = 1.0;
    for &k in gaussian_from_rank {
        let Some(splat) = &splats[k] else { continue };
        let raw = splat.opacity * falloff(splat, i, width).1;
        let alpha = raw.min(max_alpha);
        if alpha < 1.0 / 255.0 {
            continue;
        }
        let next = transmittance * (1.0 - alpha);
        if next <= f64::from(TRANSMITTANCE_THRESHOLD) {
            break;
        }
        layer(k, raw, alpha);
        transmittance = next;
    }
}

/// Sums over one pixel's layers.
#[derive(Default)]
struct Sums {
    color: [f64; 3],
    depth: f64,
    /// 1 - transmittance.
    covered: f64,
}

impl Sums {
    fn add(&mut self, splat: &Projected<f64>, alpha: f64) {
        let weight = (1.0 - self.covered) * alpha;
        for c in 0..3 {
            self.color[c] += weight * splat.color[c];
        }
        self.depth += weight * splat.depth;
        self.covered = 1.0 - (1.0 - self.covered) * (1.0 - alpha);
    }

    fn finish(mut self, parameters: &Parameters, options: &RenderOptions) -> ([f64; 3], f64, f64) {
        if options.background != Background::Transparent {
            for c in 0..3 {
                self.color[c] += (1.0 - self.covered) * parameters.background[c];
            }
        }
        if options.depth_mode == DepthMode::Expected {
            self.depth = if self.covered > 0.0 { self.depth / self.covered } else { 0.0 };
        }
        (self.color, self.covered, self.depth)
    }
}

fn assemble(
    parameters: &Parameters,
    pixel: impl Fn(usize) -> ([f64; 3], f64, f64) + Sync + Send,
) -> ReferencePicture {
    let (width, height) = (parameters.width as usize, parameters.height as usize);
    let pixels: Vec<([f64; 3], f64, f64)> =
        (0..width * height).into_par_iter().with_min_len(width.min(64)).map(pixel).collect();
    ReferencePicture {
        width: parameters.width,
        height: parameters.height,
        color: pixels.iter().map(|p| p.0).collect(),
        alpha: pixels.iter().map(|p| p.1).collect(),
        depth: pixels.iter().map(|p| p.2).collect(),
    }
}

/// Renders the picture.
pub(super) fn picture(parameters: &Parameters, options: &RenderOptions) -> ReferencePicture {
    let splats = parameters.project(options);
    let gaussian_from_rank = depth_order(&splats);
    assemble(parameters, |i| {
        let mut sums = Sums::default();
        for_each_layer(
            &splats,
            &gaussian_from_rank,
            i,
            parameters.width,
            options.max_alpha.into(),
            |k, _, alpha| {
                if let Some(splat) = &splats[k] {
                    sums.add(splat, alpha);
                }
            },
        );
        sums.finish(parameters, options)
    })
}

impl Cuts {
    pub(super) fn new(parameters: &Parameters, options: &RenderOptions) -> Self {
        let splats = parameters.project(options);
        let gaussian_from_rank = depth_order(&splats);
        let pixel = |i: usize| {
            let mut layers = Vec::new();
            for_each_layer(
                &splats,
                &gaussian_from_rank,
                i,
                parameters.width,
                options.max_alpha.into(),
                |gaussian, raw, alpha| {
                    layers.push(Layer { gaussian, clamped: raw > alpha });
                },
            );
            layers
        };
        let pixels = parameters.width as usize * parameters.height as usize;
        Self { layers: (0..pixels).into_par_iter().map(pixel).collect() }
    }

    /// The number of layers drawn in each pixel.
    pub fn depth_complexity(&self) -> impl Iterator<Item = usize> + '_ {
        self.layers.iter().map(Vec::len)
    }

    pub(super) fn picture(&self, parameters: &Parameters, options: &RenderOptions) -> ReferencePicture {
        let splats = parameters.project(options);
        assemble(parameters, |i| {
            let mut sums = Sums::default();
            for layer in &self.layers[i] {
                let Some(splat) = &splats[layer.gaussian] else { continue };
                let alpha = if layer.clamped {
                    options.max_alpha.into()
                } else {
                    splat.opacity * falloff(splat, i, parameters.width).1
                };
                sums.add(splat, alpha);
            }
            sums.finish(parameters, options)
        })
    }
}
