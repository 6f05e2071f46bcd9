//! Counter-based pseudo-random numbers that depend on a key alone: the same in every run, on any thread.

/// Generator with an independent sequence for each key.
pub(super) struct Rng {
    key: u64,
    drawn: u64,
}

impl Rng {
    /// The generator of a key, for example (seed, step, index).
    pub(super) fn new(key: [u64; 3]) -> Self {
        Self { key: key.into_iter().fold(0, |hash, part| scrambled(hash ^ scrambled(part))), drawn: 0 }
    }

    fn bits(&mut self) -> u64 {
        self.drawn += 1;
        scrambled(self.key.wrapping_add(self.drawn))
    }

    /// Uniform sample of [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        // The 53 bits of a double's significand.
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal sample of mean 0 and variance 1 (Box and Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        let (radius, turn) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * turn).cos()
    }
}

/// The numbers 0 to `n` - 1 in a random order that depends on `seed` and `round`.
pub(super) fn shuffled(n: usize, seed: u64, round: u64) -> Vec<usize> {
    let mut shuffled: Vec<usize> = (0..n).collect();
    shuffled.sort_by_key(|&i| Rng::new([seed, round, i as u64]).bits());
    shuffled
}

/// One step and the finaliser of SplitMix64.
fn scrambled(i: u64) -> u64 {
    let mut z = i.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_keys_give_equal_numbers_and_other_keys_others() {
        let first = |key| Rng::new(key).uniform();
        assert_eq!(first([1, 2, 3]), first([1, 2, 3]));
        for other in [[2, 2, 3], [1, 3, 3], [1, 2, 4], [3, 2, 1], [0, 0, 0]] {
            assert_ne!(first([1, 2, 3]), first(other));
        }
    }

    #[test]
    fn samples_have_the_mean_and_variance_of_their_distribution() {
        const N: u64 = 20_000;
        let mean = |sample: &dyn Fn(&mut Rng) -> f64| {
            (0..N).map(|i| sample(&mut Rng::new([7, 0, i]))).sum::<f64>() / N as f64
        };
        // Four standard errors of each mean.
        assert!((mean(&Rng::uniform) - 0.5).abs() < 0.0082);
        assert!(mean(&Rng::normal).abs() < 0.0283);
        assert!((mean(&|c| c.normal().powi(2)) - 1.0).abs() < 0.04);
    }

    #[test]
    fn a_round_has_every_number_once_and_rounds_differ() {
        let round = |round| shuffled(9, 1, round);
        let mut sorted = round(0);
        sorted.sort_unstable();
        assert!(sorted == (0..9).collect::<Vec<_>>() && round(0) != round(1) && round(1) == round(1));
    }
}
