//! Numbers that look random and depend on nothing but what they are for: the same in every run, on any thread.

/// A sequence of its own for each key.
pub(super) struct Chance {
    key: u64,
    drawn: u64,
}

impl Chance {
    /// The sequence of a key, for example (seed, step, index).
    pub(super) fn of(key: [u64; 3]) -> Self {
        Self { key: key.into_iter().fold(0, |hash, part| scrambled(hash ^ scrambled(part))), drawn: 0 }
    }

    fn bits(&mut self) -> u64 {
        self.drawn += 1;
        scrambled(self.key.wrapping_add(self.drawn))
    }

    /// Evenly spread over [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        // As many bits as a double has.
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Of mean 0 and variance 1 (Box and Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        let (radius, turn) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * turn).cos()
    }
}

/// 0 to `n` - 1 in the order of a round.
pub(super) fn shuffled(n: usize, seed: u64, round: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|&i| Chance::of([seed, round, i as u64]).bits());
    order
}

/// A step and the finaliser of SplitMix64.
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
    fn a_key_tells_its_numbers_and_no_other_key_does() {
        let first = |key| Chance::of(key).uniform();
        assert_eq!(first([1, 2, 3]), first([1, 2, 3]));
        for other in [[2, 2, 3], [1, 3, 3], [1, 2, 4], [3, 2, 1], [0, 0, 0]] {
            assert_ne!(first([1, 2, 3]), first(other));
        }
    }

    #[test]
    fn numbers_are_spread_as_promised() {
        const N: u64 = 20_000;
        let mean = |of: &dyn Fn(&mut Chance) -> f64| {
            (0..N).map(|i| of(&mut Chance::of([7, 0, i]))).sum::<f64>() / N as f64
        };
        // Four standard errors of each mean.
        assert!((mean(&Chance::uniform) - 0.5).abs() < 0.0082);
        assert!(mean(&Chance::normal).abs() < 0.0283);
        assert!((mean(&|c| c.normal().powi(2)) - 1.0).abs() < 0.04);
    }

    #[test]
    fn a_round_has_every_number_once_and_rounds_differ() {
        let of = |round| shuffled(9, 1, round);
        let mut sorted = of(0);
        sorted.sort_unstable();
        assert!(sorted == (0..9).collect::<Vec<_>>() && of(0) != of(1) && of(1) == of(1));
    }
}
