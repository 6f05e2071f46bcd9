//! One factor per channel for each view: photographs of one drive differ in exposure and white balance.
//!
//! Stored colours are about the 1/2.2th power of light, so that a factor on light is a factor on stored colours. The
//! factors' geometric mean over the views is 1; otherwise the model's own brightness would be undetermined.

use super::adam::Adam;

/// Largest factor either way, as a logarithm.
const MOST: f32 = 0.7;

/// The logarithms of the factors. `[view][3]`
#[derive(Clone, Debug)]
pub(super) struct Exposure {
    logs: Vec<[f32; 3]>,
    adam: Adam,
    gradient: Vec<[f32; 3]>,
}

impl Exposure {
    pub(super) fn new(views: usize) -> Self {
        let logs = vec![[0.0; 3]; views];
        Self { adam: Adam::new(3 * views, 1e-8), gradient: logs.clone(), logs }
    }

    /// Factors of a view, RGB.
    pub(super) fn factor(&self, view: usize) -> [f32; 3] {
        self.logs[view].map(f32::exp)
    }

    /// Makes one step by the gradient of one view's factors.
    pub(super) fn step(&mut self, view: usize, of_factor: [f32; 3], rate: f32) {
        let factor = self.factor(view);
        self.gradient.fill([0.0; 3]);
        self.gradient[view] = std::array::from_fn(|c| factor[c] * of_factor[c]);
        self.adam.step(self.logs.as_flattened_mut(), self.gradient.as_flattened(), &[rate]);
        for c in 0..3 {
            let mean = self.logs.iter().map(|l| l[c]).sum::<f32>() / self.logs.len() as f32;
            self.logs.iter_mut().for_each(|l| l[c] = (l[c] - mean).clamp(-MOST, MOST));
        }
    }
}
