//! Adam (Kingma and Ba 2015) on arrays of parameters.

use rayon::prelude::*;

/// Decay of the means of gradients and of their squares.
const BETA: [f32; 2] = [0.9, 0.999];

/// Minimum of parameters per task.
const CHUNK: usize = 1 << 14;
/// Minimum of parameters in a row, which is processed with the widest vectors; their width does not change the results.
const ROW: usize = 256;
/// Limit to which gradients are clamped; its square is well inside the range of f32.
const LARGEST: f32 = 1e18;

/// The state of one array.
#[derive(Clone, Debug)]
pub(super) struct Adam {
    /// Means of the gradients and of their squares.
    first: Vec<f32>,
    second: Vec<f32>,
    steps: i32,
    /// Gradients of this size and below are noise and move a parameter by less than the rate.
    noise: f32,
}

impl Adam {
    pub(super) fn new(len: usize, noise: f32) -> Self {
        Self { first: vec![0.0; len], second: vec![0.0; len], steps: 0, noise }
    }

    /// Continues with other parameters, `width` numbers each, made from those in `sources`: the first `survivors` of
    /// them keep their state, the others start at zero.
    pub(super) fn follow(&mut self, sources: &[u32], survivors: usize, width: usize) {
        for state in [&mut self.first, &mut self.second] {
            let own = |&i: &u32| &state[i as usize * width..(i as usize + 1) * width];
            let mut followed: Vec<f32> = Vec::with_capacity(sources.len() * width);
            sources[..survivors].iter().for_each(|i| followed.extend_from_slice(own(i)));
            followed.resize(sources.len() * width, 0.0);
            *state = followed;
        }
    }

    /// Resets the means of all gradients.
    pub(super) fn forget(&mut self) {
        self.first.fill(0.0);
        self.second.fill(0.0);
    }

    /// Makes one step down the gradient; parameter i moves by about `rates[i % rates.len()]` at most. Gradients whose
    /// square would overflow f32 are clamped.
    pub(super) fn step(&mut self, parameters: &mut [f32], gradient: &[f32], rates: &[f32]) {
        self.steps += 1;
        let correction = BETA.map(|beta| 1.0 / (1.0 - beta.powi(self.steps)));
        let noise = self.noise;
        // Repeat the pattern until the inner loop over a row is long.
        let row = rates.repeat(ROW.div_ceil(rates.len()));
        let chunk = row.len() * CHUNK.div_ceil(row.len());
        let state = self.first.par_chunks_mut(chunk).zip(self.second.par_chunks_mut(chunk));
        let all = state.zip(parameters.par_chunks_mut(chunk).zip(gradient.par_chunks(chunk)));
        all.for_each(|((first, second), (parameters, gradient))| {
            pulp::Arch::new().dispatch(
                #[inline(always)]
                || {
                    let state = first.chunks_mut(row.len()).zip(second.chunks_mut(row.len()));
                    let numbers = parameters.chunks_mut(row.len()).zip(gradient.chunks(row.len()));
                    for ((m, v), (p, g)) in state.zip(numbers) {
                        for ((m, v), ((p, g), rate)) in m.iter_mut().zip(v).zip(p.iter_mut().zip(g).zip(&row))
                        {
                            let g = g.clamp(-LARGEST, LARGEST);
                            *m = BETA[0] * *m + (1.0 - BETA[0]) * g;
                            *v = BETA[1] * *v + (1.0 - BETA[1]) * g * g;
                            *p -= rate * (*m * correction[0]) / ((*v * correction[1]).sqrt() + noise);
                        }
                    }
                },
            );
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adam_minimises_a_quadratic_and_survives_the_largest_gradients() {
        let mut x = vec![3.0f32, -2.0];
        let mut adam = Adam::new(2, 1e-15);
        for _ in 0..2000 {
            let gradient = [2.0 * x[0], 200.0 * (x[1] + 1.0)];
            adam.step(&mut x, &gradient, &[0.01]);
        }
        assert!(x[0].abs() < 0.02 && (x[1] + 1.0).abs() < 0.02, "{x:?}");
        for _ in 0..10 {
            adam.step(&mut x, &[f32::MAX, f32::MIN], &[0.01]);
        }
        assert!(x.iter().all(|x| x.abs() < 1.2), "{x:?}");
    }

    #[test]
    fn survivors_keep_their_state_and_others_start_at_zero() {
        let step = |adam: &mut Adam, x: &mut [f32], g: &[f32]| {
            let before = x.to_vec();
            adam.step(x, g, &[0.1]);
            x.iter().zip(before).map(|(a, b)| a - b).collect::<Vec<_>>()
        };
        let mut whole = Adam::new(4, 1e-8);
        step(&mut whole, &mut [0.0; 4], &[1.0, 2.0, -3.0, 4.0]);
        let mut followed = whole.clone();
        followed.follow(&[1, 0, 0], 1, 2);
        let moved = step(&mut whole, &mut [0.0; 4], &[0.0; 4]);
        assert_eq!(step(&mut followed, &mut [0.0; 6], &[0.0; 6]), [moved[2], moved[3], 0.0, 0.0, 0.0, 0.0]);
        followed.forget();
        assert_eq!(step(&mut followed, &mut [0.0; 6], &[0.0; 6]), [0.0; 6]);
    }

    #[test]
    fn steps_follow_the_papers_equations() {
        let mut x = vec![0.0f32];
        let mut adam = Adam::new(1, 1e-8);
        adam.step(&mut x, &[0.5], &[0.1]);
        // The first step has the length of the rate.
        assert!((x[0] + 0.1).abs() < 1e-6);
        adam.step(&mut x, &[-0.5], &[0.1]);
        let (m, v): (f64, f64) = (0.9 * 0.05 - 0.05, 0.999 * 0.00025 + 0.00025);
        let second = 0.1 * (m / (1.0 - 0.81)) / (v / (1.0 - 0.998_001)).sqrt();
        assert!((f64::from(x[0]) + 0.1 + second).abs() < 1e-6);
    }
}
