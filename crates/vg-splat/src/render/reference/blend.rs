//! Blending, every pixel against every Gaussian, and pictures whose cuts are those of another one.

use super::project::Projected;
use super::{Parameters, ReferencePicture};
use crate::render::options::TRANSMITTANCE_THRESHOLD;
use crate::render::{Background, DepthMode, RenderOptions};
use rayon::prelude::*;

/// A Gaussian in one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    pub(super) gaussian: usize,
    /// `opacity e^-sigma` is above `max_alpha`.
    pub(super) clamped: bool,
}

/// What is drawn in each pixel, nearest first.
#[derive(Clone, Debug)]
pub struct Cuts {
    /// `[height * width]`
    pub(super) layers: Vec<Vec<Layer>>,
}

/// Indices of what is drawn, nearest first.
fn in_order(splats: &[Option<Projected<f64>>]) -> Vec<usize> {
    let depth = |i: usize| splats[i].map_or(0.0, |s| s.depth as f32);
    let mut order: Vec<usize> = (0..splats.len()).filter(|&i| splats[i].is_some()).collect();
    // Stable, by depth rounded to f32: ties are drawn in the order of storage.
    order.sort_by(|&a, &b| depth(a).total_cmp(&depth(b)));
    order
}

/// Offset of pixel `i` from the centre, and e^-sigma there.
pub(super) fn falloff(s: &Projected<f64>, i: usize, width: u32) -> ([f64; 2], f64) {
    let (u, v) = ((i % width as usize) as f64 + 0.5, (i / width as usize) as f64 + 0.5);
    let [dx, dy] = [u - s.center[0], v - s.center[1]];
    let sigma = 0.5 * (s.conic[0] * dx * dx + 2.0 * s.conic[1] * dx * dy + s.conic[2] * dy * dy);
    // e^-6 is below 1/255: what follows could not be drawn.
    if (0.0..=6.0).contains(&sigma) { ([dx, dy], (-sigma).exp()) } else { ([dx, dy], 0.0) }
}

/// Calls `layer(gaussian, opacity e^-sigma, alpha)` for all that is drawn in pixel `i`, nearest first.
fn for_each_layer(
    splats: &[Option<Projected<f64>>],
    order: &[usize],
    i: usize,
    width: u32,
    max_alpha: f64,
    mut layer: impl FnMut(usize, f64, f64),
) {
    let mut transmittance = 1.0;
    for &k in order {
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

    fn finish(mut self, of: &Parameters, options: &RenderOptions) -> ([f64; 3], f64, f64) {
        if options.background != Background::Transparent {
            for c in 0..3 {
                self.color[c] += (1.0 - self.covered) * of.background[c];
            }
        }
        if options.depth_mode == DepthMode::Expected {
            self.depth = if self.covered > 0.0 { self.depth / self.covered } else { 0.0 };
        }
        (self.color, self.covered, self.depth)
    }
}

fn assemble(
    of: &Parameters,
    pixel: impl Fn(usize) -> ([f64; 3], f64, f64) + Sync + Send,
) -> ReferencePicture {
    let (width, height) = (of.width as usize, of.height as usize);
    let pixels: Vec<([f64; 3], f64, f64)> =
        (0..width * height).into_par_iter().with_min_len(width.min(64)).map(pixel).collect();
    ReferencePicture {
        width: of.width,
        height: of.height,
        color: pixels.iter().map(|p| p.0).collect(),
        alpha: pixels.iter().map(|p| p.1).collect(),
        depth: pixels.iter().map(|p| p.2).collect(),
    }
}

/// The picture.
pub(super) fn picture(of: &Parameters, options: &RenderOptions) -> ReferencePicture {
    let splats = of.project(options);
    let order = in_order(&splats);
    assemble(of, |i| {
        let mut sums = Sums::default();
        for_each_layer(&splats, &order, i, of.width, options.max_alpha.into(), |k, _, alpha| {
            if let Some(splat) = &splats[k] {
                sums.add(splat, alpha);
            }
        });
        sums.finish(of, options)
    })
}

impl Cuts {
    pub(super) fn new(of: &Parameters, options: &RenderOptions) -> Self {
        let splats = of.project(options);
        let order = in_order(&splats);
        let pixel = |i: usize| {
            let mut layers = Vec::new();
            for_each_layer(&splats, &order, i, of.width, options.max_alpha.into(), |gaussian, raw, alpha| {
                layers.push(Layer { gaussian, clamped: raw > alpha });
            });
            layers
        };
        let pixels = of.width as usize * of.height as usize;
        Self { layers: (0..pixels).into_par_iter().map(pixel).collect() }
    }

    /// Layers drawn in each pixel.
    pub fn depth_complexity(&self) -> impl Iterator<Item = usize> + '_ {
        self.layers.iter().map(Vec::len)
    }

    pub(super) fn picture(&self, of: &Parameters, options: &RenderOptions) -> ReferencePicture {
        let splats = of.project(options);
        assemble(of, |i| {
            let mut sums = Sums::default();
            for layer in &self.layers[i] {
                let Some(splat) = &splats[layer.gaussian] else { continue };
                let alpha = if layer.clamped {
                    options.max_alpha.into()
                } else {
                    splat.opacity * falloff(splat, i, of.width).1
                };
                sums.add(splat, alpha);
            }
            sums.finish(of, options)
        })
    }
}
