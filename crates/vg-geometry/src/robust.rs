//! Robust similarity between two lists of points with outliers: the least median of residuals over triples (Rousseeuw
//! 1984), then least squares on the inliers.

use super::align::Similarity;
use crate::error::Result;
use glam::DVec3;

/// Smallest number of pairs of which any are rejected; with fewer, three may agree by chance, so all are used.
pub const FEWEST_TO_REJECT: usize = 6;

/// Largest residual of a kept pair, in medians of all residuals. For normal errors this is 4.6 standard deviations of
/// an axis, so one good pair in ten thousand is rejected.
pub const KEPT_MEDIANS: f64 = 3.0;

/// Number of triples tried; all of them where there are fewer. With half of the pairs wrong, one triple in eight is
/// right.
const TRIALS: usize = 1000;

/// Maximum number of rounds of fitting and selecting inliers.
const ROUNDS: usize = 20;

/// Residuals below this fraction of the targets' extent are rounding.
const ROUNDING: f64 = 1e-9;

/// A similarity, with the residuals and inliers of its fit.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustFit {
    /// The least-squares similarity of the pairs kept.
    pub similarity: Similarity,
    /// Distance of each mapped point from its target.
    pub residuals: Vec<f64>,
    /// Whether each pair was kept as an inlier.
    pub kept: Vec<bool>,
}

impl RobustFit {
    /// Root mean square residual of the pairs kept.
    pub fn residual(&self) -> f64 {
        let kept: Vec<f64> =
            self.residuals.iter().zip(&self.kept).filter(|(_, kept)| **kept).map(|(r, _)| *r).collect();
        let squares = kept.iter().map(|r| r * r).sum::<f64>();
        (squares / kept.len().max(1) as f64).sqrt()
    }

    /// The fraction of pairs kept, not counting the three that a similarity can always fit: 0 for three pairs, which
    /// leave nothing to check.
    pub fn confidence(&self) -> f64 {
        let spare = |n: usize| n.saturating_sub(3) as f64;
        spare(self.kept.iter().filter(|kept| **kept).count()) / spare(self.kept.len()).max(1.0)
    }
}

impl Similarity {
    /// The similarity that takes `from[i]` to `to[i]` for more than half of the pairs. Deterministic.
    ///
    /// A pair is left out if its residual is above [`KEPT_MEDIANS`] medians of all residuals, and never with fewer than
    /// [`FEWEST_TO_REJECT`] pairs.
    ///
    /// # Errors
    /// As [`Similarity::umeyama`]; also where the pairs that agree are on one line.
    pub fn umeyama_robust(from: &[DVec3], to: &[DVec3]) -> Result<RobustFit> {
        let all = Self::umeyama(from, to)?;
        if from.len() < FEWEST_TO_REJECT {
            let residuals = residuals(&all, from, to);
            return Ok(RobustFit { similarity: all, residuals, kept: vec![true; from.len()] });
        }
        let fit = |indices: &[usize]| {
            let pick = |points: &[DVec3]| indices.iter().map(|&i| points[i]).collect::<Vec<_>>();
            Self::umeyama(&pick(from), &pick(to))
        };
        let candidates = triples(from.len()).into_iter().filter_map(|t| fit(&t).ok()).chain([all]);
        let by_median = candidates.map(|s| (median(&residuals(&s, from, to)), s));
        let mut similarity = by_median.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(all, |best| best.1);
        let floor = ROUNDING * extent(to);
        let mut kept = Vec::new();
        for _ in 0..ROUNDS {
            let residuals = residuals(&similarity, from, to);
            let limit = (KEPT_MEDIANS * median(&residuals)).max(floor);
            let agree: Vec<usize> = (0..from.len()).filter(|&i| residuals[i] <= limit).collect();
            if agree == kept {
                break;
            }
            similarity = fit(&agree)?;
            kept = agree;
        }
        let residuals = residuals(&similarity, from, to);
        let kept = (0..from.len()).map(|i| kept.binary_search(&i).is_ok()).collect();
        Ok(RobustFit { similarity, residuals, kept })
    }
}

fn residuals(s: &Similarity, from: &[DVec3], to: &[DVec3]) -> Vec<f64> {
    from.iter().zip(to).map(|(f, t)| s.transform_point(*f).distance(*t)).collect()
}

fn extent(points: &[DVec3]) -> f64 {
    let low = points.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
    (high - low).length()
}

/// The upper median: more than half of the values are at most this.
fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn triples(n: usize) -> Vec<[usize; 3]> {
    if n * (n - 1) * (n - 2) / 6 <= TRIALS {
        let from = |a: usize| (a + 1..n).flat_map(move |b| (b + 1..n).map(move |c| [a, b, c]));
        return (0..n).flat_map(from).collect();
    }
    let pick = |k: usize| (scramble(k as u64) % n as u64) as usize;
    (0..TRIALS).map(|t| [pick(3 * t), pick(3 * t + 1), pick(3 * t + 2)]).collect()
}

/// The `i`th pseudorandom number (splitmix64), equal on every machine.
pub fn scramble(i: u64) -> u64 {
    let z = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    /// Points, their images under a similarity with added `noise`, and the similarity.
    fn pairs(n: u64, noise: f64) -> (Vec<DVec3>, Vec<DVec3>, Similarity) {
        let number = |i: u64| (scramble(i) >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        let vector = |i: u64| DVec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2));
        let truth = Similarity {
            scale: 3.0,
            rotation: DMat3::from_rotation_z(1.0) * DMat3::from_rotation_x(0.4),
            translation: DVec3::new(1.0, -2.0, 0.5),
        };
        let from: Vec<DVec3> = (0..n).map(|i| 4.0 * vector(i)).collect();
        let moved = from.iter().zip(0..).map(|(p, i)| truth.transform_point(*p) + noise * vector(1000 + i));
        let to = moved.collect();
        (from, to, truth)
    }

    #[test]
    fn four_wrong_points_of_ten_are_rejected_and_do_not_change_the_fit() {
        let (from, mut to, truth) = pairs(10, 0.02);
        let wrong = [1, 4, 5, 9];
        wrong.iter().for_each(|&i| to[i] += DVec3::new(2.0, -1.0, i as f64));
        let fit = Similarity::umeyama_robust(&from, &to).unwrap();
        let left_out: Vec<usize> = (0..10).filter(|&i| !fit.kept[i]).collect();
        assert_eq!(left_out, wrong);
        assert!((fit.similarity.scale / truth.scale - 1.0).abs() < 0.005, "{fit:?}");
        assert!(fit.residuals[1] > 2.0 && fit.residuals[0] < 0.05, "{fit:?}");
        assert_eq!(fit, Similarity::umeyama_robust(&from, &to).unwrap());
    }

    #[test]
    fn right_points_are_all_kept_and_give_the_least_squares_similarity() {
        for n in [3, 5, 6, 40] {
            let (from, to, _) = pairs(n, 0.0);
            let fit = Similarity::umeyama_robust(&from, &to).unwrap();
            assert!(fit.kept.iter().all(|k| *k), "{n}");
            let plain = Similarity::umeyama(&from, &to).unwrap();
            assert!((fit.similarity.scale - plain.scale).abs() < 1e-12);
        }
    }

    #[test]
    fn points_on_a_line_are_refused() {
        let line: Vec<DVec3> = (0..8).map(|i| f64::from(i) * DVec3::ONE).collect();
        assert!(Similarity::umeyama_robust(&line, &line).is_err());
    }
}
