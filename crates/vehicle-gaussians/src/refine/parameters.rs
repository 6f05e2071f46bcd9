//! The optimised parameters: unbounded numbers from which the Gaussians are computed.
//!
//! As in 3DGS, scales are exp(s), opacities sigmoid(o) and rotations normalised; centres and colours are used directly.

use super::adam::Adam;
use rayon::prelude::*;
use vg_splat::Gaussians;
use vg_splat::gaussians::sh;
use vg_splat::render::Gradients;

/// Bounds of ln(standard deviation in metres): 0.1 micrometres, which no camera distinguishes from less, to 3 m, the
/// largest that a head predicts.
const LOG_SCALE: [f32; 2] = [-16.1, 1.098_612_3];

/// Bound of |logit(opacity)|: opacities 6e-6 from 0 and 1.
const MOST_LOGIT: f32 = 12.0;

/// Parameters of n Gaussians.
#[derive(Clone, Debug, Default)]
pub(super) struct Parameters {
    pub(super) sh_degree: u8,
    /// Centres, metres. `[n][3]`
    pub(super) means: Vec<[f32; 3]>,
    /// Quaternions of any length but 0. `[n][4]`
    pub(super) rotations: Vec<[f32; 4]>,
    /// Logarithms of standard deviations in metres. `[n][3]`
    pub(super) log_scales: Vec<[f32; 3]>,
    /// Logits of opacities. `[n]`
    pub(super) logits: Vec<f32>,
    /// SH coefficients of colours. `[n][(degree + 1)^2][3]`
    pub(super) sh: Vec<f32>,
}

/// Step sizes of each kind of parameter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Rates {
    /// Step size of centres, as a share of the scene's radius.
    pub means: f32,
    /// Step size of quaternions.
    pub rotations: f32,
    /// Step size of ln(scale).
    pub scales: f32,
    /// Step size of logit(opacity).
    pub opacities: f32,
    /// Step size of the colour's mean over directions, in SH coefficients.
    pub colors: f32,
    /// Step size of SH bands 1 and above.
    pub view_dependence: f32,
    /// Step size of the logarithm of a view's exposure.
    pub exposure: f32,
}

impl Rates {
    pub(super) fn named(&self) -> [(&'static str, f32); 7] {
        let Self { means, rotations, scales, opacities, colors, view_dependence, exposure } = *self;
        [
            ("means", means),
            ("rotations", rotations),
            ("scales", scales),
            ("opacities", opacities),
            ("colors", colors),
            ("view_dependence", view_dependence),
            ("exposure", exposure),
        ]
    }

    /// All step sizes times `factor`.
    pub(super) fn times(&self, factor: f32) -> Self {
        let Self { means, rotations, scales, opacities, colors, view_dependence, exposure } = *self;
        Self {
            means: means * factor,
            rotations: rotations * factor,
            scales: scales * factor,
            opacities: opacities * factor,
            colors: colors * factor,
            view_dependence: view_dependence * factor,
            exposure: exposure * factor,
        }
    }
}

impl Parameters {
    pub(super) fn from_gaussians(gaussians: &Gaussians) -> Self {
        let logit = |o: f32| (o / (1.0 - o)).ln().clamp(-MOST_LOGIT, MOST_LOGIT);
        Self {
            sh_degree: gaussians.sh_degree(),
            means: gaussians.means().to_vec(),
            rotations: gaussians.rotations().to_vec(),
            log_scales: gaussians
                .scales()
                .iter()
                .map(|s| s.map(|s| s.ln().clamp(LOG_SCALE[0], LOG_SCALE[1])))
                .collect(),
            logits: gaussians.opacities().iter().map(|&o| logit(o)).collect(),
            sh: gaussians.sh().to_vec(),
        }
    }

    /// Copies of the parameters of `sources`, in this order.
    pub(super) fn gathered(&self, sources: &[u32]) -> Self {
        fn gather<T: Copy>(all: &[T], sources: &[u32]) -> Vec<T> {
            sources.iter().map(|&i| all[i as usize]).collect()
        }
        let stride = self.stride();
        let color = |&i: &u32| &self.sh[i as usize * stride..(i as usize + 1) * stride];
        Self {
            sh_degree: self.sh_degree,
            means: gather(&self.means, sources),
            rotations: gather(&self.rotations, sources),
            log_scales: gather(&self.log_scales, sources),
            logits: gather(&self.logits, sources),
            sh: sources.iter().flat_map(color).copied().collect(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.logits.len()
    }

    /// The number of coefficients of one colour.
    pub(super) fn stride(&self) -> usize {
        3 * sh::coefficients(self.sh_degree)
    }

    pub(super) fn scales(&self, i: usize) -> [f32; 3] {
        self.log_scales[i].map(f32::exp)
    }

    /// Clamps the parameters to their bounds after a step.
    pub(super) fn bound(&mut self) {
        let Self { log_scales, logits, rotations, .. } = self;
        let rotations = rotations.par_iter_mut().zip(log_scales).zip(logits);
        rotations.with_min_len(1 << 12).for_each(|((q, s), o)| {
            *s = s.map(|s| s.clamp(LOG_SCALE[0], LOG_SCALE[1]));
            *o = o.clamp(-MOST_LOGIT, MOST_LOGIT);
            *q = vg_splat::gaussians::buffer::normalize_quaternion(*q).unwrap_or([1.0, 0.0, 0.0, 0.0]);
        });
    }
}

pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

/// One [`Adam`] for each kind of parameter.
#[derive(Clone, Debug)]
pub(super) struct Optimizer {
    means: Adam,
    rotations: Adam,
    scales: Adam,
    opacities: Adam,
    sh: Adam,
    /// Buffer for the gradient of one kind of parameter.
    gradient: Vec<f32>,
}

impl Optimizer {
    pub(super) fn new(n: usize, sh_degree: u8, noise: f32) -> Self {
        Self {
            means: Adam::new(3 * n, noise),
            rotations: Adam::new(4 * n, noise),
            scales: Adam::new(3 * n, noise),
            opacities: Adam::new(n, noise),
            sh: Adam::new(3 * n * sh::coefficients(sh_degree), noise),
            gradient: Vec::new(),
        }
    }

    /// Continues with parameters made from those in `sources`, of which the first `survivors` keep their state.
    pub(super) fn follow(&mut self, sources: &[u32], survivors: usize, sh_degree: u8) {
        let Self { means, rotations, scales, opacities, sh, .. } = self;
        let stride = 3 * sh::coefficients(sh_degree);
        for (adam, width) in [(means, 3), (rotations, 4), (scales, 3), (opacities, 1), (sh, stride)] {
            adam.follow(sources, survivors, width);
        }
    }

    /// Resets the optimizer's state of the opacities.
    pub(super) fn forget_opacities(&mut self) {
        self.opacities.forget();
    }

    /// Makes one step down `gradients`, those of the Gaussians with these parameters; `radius_m` is the scene's radius.
    pub(super) fn step(
        &mut self,
        parameters: &mut Parameters,
        gradients: &Gradients,
        rates: &Rates,
        radius_m: f32,
    ) {
        let means = parameters.means.as_flattened_mut();
        self.means.step(means, gradients.means.as_flattened(), &[rates.means * radius_m]);
        let rotations = parameters.rotations.as_flattened_mut();
        self.rotations.step(rotations, gradients.rotations.as_flattened(), &[rates.rotations]);
        // ds/d(ln s) = s
        let log_scales = parameters.log_scales.as_flattened_mut();
        let of_log = |(s, g): (&f32, &f32)| s.exp() * g;
        self.gradient.clear();
        let scales = log_scales.par_iter().zip(gradients.scales.as_flattened()).map(of_log);
        self.gradient.par_extend(scales);
        self.scales.step(log_scales, &self.gradient, &[rates.scales]);
        // do/d(logit) = o (1 - o)
        let of_logit = |(x, g): (&f32, &f32)| sigmoid(*x) * sigmoid(-x) * g;
        self.gradient.clear();
        let opacities = parameters.logits.par_iter().zip(&gradients.opacities).map(of_logit);
        self.gradient.par_extend(opacities);
        self.opacities.step(&mut parameters.logits, &self.gradient, &[rates.opacities]);
        let rate = |k: usize| if k < 3 { rates.colors } else { rates.view_dependence };
        let of_color: Vec<f32> = (0..parameters.stride()).map(rate).collect();
        self.sh.step(&mut parameters.sh, &gradients.sh, &of_color);
        parameters.bound();
    }
}
