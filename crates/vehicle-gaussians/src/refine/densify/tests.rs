//! Each rule of density control on a few Gaussians.

use super::*;

/// Gaussians in a row with these standard deviations, opacities and measured gradients.
fn row(of: &[(f32, f32, f32)]) -> (Parameters, Seen) {
    let logit = |o: f32| (o / (1.0 - o)).ln();
    let parameters = Parameters {
        sh_degree: 0,
        means: (0..of.len()).map(|i| [i as f32, 0.5, -0.5]).collect(),
        rotations: vec![[0.6, 0.0, 0.8, 0.0]; of.len()],
        log_scales: of.iter().map(|(s, ..)| [s.ln(), (0.5 * s).ln(), (0.1 * s).ln()]).collect(),
        logits: of.iter().map(|(_, o, _)| logit(*o)).collect(),
        sh: (0..3 * of.len()).map(|k| k as f32).collect(),
    };
    let seen = Seen::with(of.iter().map(|(.., g)| *g).collect(), vec![0.0; of.len()]);
    (parameters, seen)
}

/// An extent of 1 m: sizes in metres are shares of it.
fn growth(
    of: &(Parameters, Seen),
    clones: &[MirrorClone],
    rules: Densify,
    prunes_large: bool,
) -> Option<Growth> {
    Growth::new(&of.0, clones, &of.1, &rules, 1.0, prunes_large)
}

/// A gradient above the default threshold.
const ABOVE: f32 = 3e-4;

#[test]
fn above_the_gradient_small_ones_are_cloned_and_large_ones_split() {
    let of = row(&[(0.005, 0.5, ABOVE), (0.02, 0.5, ABOVE), (0.005, 0.5, 1e-4), (0.02, 0.5, 0.0)]);
    let found = growth(&of, &[], Densify::default(), false).unwrap();
    assert_eq!((found.sources.as_slice(), found.survivors), ([0, 2, 3, 0, 1, 1].as_slice(), 3));
    let done = Densified { cloned: 1, split: 1, ..Densified::default() };
    assert_eq!(found.done, done);

    let grown = found.grown(&of.0, [1, 2]);
    let same =
        |a: usize, b: usize| grown.means[a] == of.0.means[b] && grown.log_scales[a] == of.0.log_scales[b];
    assert!(same(0, 0) && same(1, 2) && same(2, 3) && same(3, 0));
    for half in [4, 5] {
        assert!(!same(half, 1));
        for k in 0..3 {
            assert!((grown.log_scales[half][k] - of.0.log_scales[1][k] + 1.6f32.ln()).abs() < 1e-6);
        }
        assert!((grown.logits[half] - of.0.logits[1]).abs() < 1e-6);
        assert_eq!(grown.sh[3 * half..3 * half + 3], of.0.sh[3..6]);
    }
    assert_ne!(grown.means[4], grown.means[5]);
}

#[test]
fn halves_are_drawn_from_the_gaussian_that_was_split() {
    let of = row(&vec![(0.02, 0.5, ABOVE); 4_000]);
    let grown = growth(&of, &[], Densify::default(), false).unwrap().grown(&of.0, [0, 9]);
    assert_eq!(grown.len(), 8_000);
    // Along the longest axis, which the rotation turns towards -z, the deviation is 0.02; along the second 0.01.
    let turned = Quat::from_xyzw(0.0, 0.8, 0.0, 0.6);
    let mut squares = [0.0f64; 3];
    for (i, mean) in grown.means.iter().enumerate() {
        let off = Vec3::from_array(*mean) - Vec3::from_array(of.0.means[i / 2]);
        let own = turned.inverse() * off;
        (0..3).for_each(|k| squares[k] += f64::from(own[k]).powi(2) / grown.len() as f64);
    }
    // Means lie at up to 4000 m, where f32 has a step of 0.24 mm.
    for (k, deviation) in [0.02, 0.01, 0.002].into_iter().enumerate() {
        assert!((squares[k].sqrt() / deviation - 1.0).abs() < 0.05, "{k}: {}", squares[k].sqrt());
    }
}

#[test]
fn draws_depend_on_seed_and_step_alone() {
    let of = row(&[(0.02, 0.5, ABOVE), (0.02, 0.5, ABOVE)]);
    let grown = |key| growth(&of, &[], Densify::default(), false).unwrap().grown(&of.0, key).means;
    assert_eq!(grown([1, 2]), grown([1, 2]));
    assert!(grown([1, 2]) != grown([1, 3]) && grown([1, 2]) != grown([2, 2]));
}

#[test]
fn transparent_ones_are_pruned_and_large_ones_after_the_first_reset() {
    let mut of = row(&[
        (0.005, 0.004, ABOVE),
        (0.2, 0.5, 0.0),
        (0.15, 0.5, ABOVE),
        (0.3, 0.5, ABOVE),
        (0.01, 0.5, 0.0),
    ]);
    let sources = |of: &_, prunes| growth(of, &[], Densify::default(), prunes).unwrap().sources;
    assert_eq!(sources(&of, false), [1, 4, 2, 2, 3, 3]);
    // 0.15 / 1.6 is small enough, 0.3 / 1.6 is not.
    assert_eq!(sources(&of, true), [4, 2, 2]);
    of.1 = Seen::with(vec![0.0; 5], vec![1.0, 1.0, 1.0, 1.0, 21.0]);
    assert_eq!(sources(&of, false), [1, 2, 3, 4]);
    assert_eq!(growth(&of, &[], Densify::default(), true), None, "no Gaussian would be left");
}

#[test]
fn at_the_limit_the_largest_gradients_grow_first() {
    let of = row(&[(0.005, 0.5, 3e-4), (0.02, 0.5, 5e-4), (0.005, 0.5, 4e-4), (0.005, 0.001, 1.0)]);
    let of_most = |most: usize, clones: &[MirrorClone]| {
        let found = growth(&of, clones, Densify { most, ..Densify::default() }, false).unwrap();
        (found.sources, found.done.full)
    };
    assert_eq!(of_most(6, &[]), (vec![0, 2, 0, 2, 1, 1], false));
    assert_eq!(of_most(5, &[]), (vec![0, 2, 2, 1, 1], true));
    assert_eq!(of_most(3, &[]), (vec![0, 1, 2], true));
    assert_eq!(of_most(1, &[]), (vec![0, 1, 2], true));
    // With a mirror image each of them is two.
    let tied = [MirrorClone { of: 1, gain: [1.0; 3] }];
    assert_eq!(of_most(6, &tied), (vec![0, 2, 1, 1], true));
}

#[test]
fn a_reset_lowers_opacities_and_raises_none() {
    let (mut parameters, _) = row(&[(0.1, 0.9, 0.0), (0.1, 0.006, 0.0)]);
    reset_opacities(&mut parameters);
    assert!((sigmoid(parameters.logits[0]) - 0.01).abs() < 1e-6);
    assert!((sigmoid(parameters.logits[1]) - 0.006).abs() < 1e-6);
}

#[test]
fn without_a_gradient_nothing_grows_whatever_the_threshold() {
    let of = row(&[(0.005, 0.5, 0.0), (0.005, 0.5, f32::INFINITY)]);
    let found = growth(&of, &[], Densify { gradient: 0.0, ..Densify::default() }, false).unwrap();
    assert_eq!(found.sources, [0, 1, 1]);
}
