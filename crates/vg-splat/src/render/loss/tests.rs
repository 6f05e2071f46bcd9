//! Every term's gradient against central differences of its value, and its contract.

use super::*;
use crate::render::PictureGradient;

type Loss<'a> = &'a dyn Fn(&Rendered, Term, &mut PictureGradient) -> Result<f64>;

const W: usize = 17;
const H: usize = 14;

/// Pseudorandom numbers in [low, high), equal on every machine.
fn noise(n: usize, seed: usize, low: f32, high: f32) -> Vec<f32> {
    let at = |i: usize| ((i * 7919 + seed * 104_729 + (i * i) % 613 * 31) % 10_007) as f32 / 10_007.0;
    (0..n).map(|i| low + (high - low) * at(i)).collect()
}

fn rgb(seed: usize, low: f32, high: f32) -> Vec<[f32; 3]> {
    noise(3 * W * H, seed, low, high).as_chunks::<3>().0.to_vec()
}

fn picture() -> Rendered {
    let n = W * H;
    let mut color = rgb(1, -0.1, 1.2);
    // Away from 0 and 1, where a clamped colour has kinks.
    for v in color.as_flattened_mut() {
        if v.abs() < 0.01 || (*v - 1.0).abs() < 0.01 {
            *v += 0.03;
        }
    }
    Rendered {
        width: W as u32,
        height: H as u32,
        color,
        alpha: noise(n, 2, 0.0, 1.0),
        depth: noise(n, 3, 2.0, 6.0),
    }
}

fn zeros() -> PictureGradient {
    let mut g = PictureGradient::default();
    g.reset(&picture());
    g
}

/// Compares the gradient of `loss` with fourth-order differences of its value at every number of the planes that it
/// uses.
fn check(name: &str, loss: Loss, planes: [bool; 3], mask: Option<&[f32]>) {
    let term = Term { weight: 0.7, mask };
    let mut gradient = zeros();
    let value = loss(&picture(), term, &mut gradient).unwrap();
    assert!(value > 0.0, "{name}");
    let lens = [gradient.color.len(), gradient.alpha.len(), gradient.depth.len()];
    assert_eq!(lens.map(|n| n > 0), planes, "{name}");
    // 2^-10: f32 colours and depths change by it with negligible rounding.
    let h = 1.0 / 1024.0;
    let at = |plane: usize, i: usize, step: f32| {
        let mut p = picture();
        let v = match plane {
            0 => &mut p.color.as_flattened_mut()[i],
            1 => &mut p.alpha[i],
            _ => &mut p.depth[i],
        };
        *v += step;
        let moved = f64::from(*v);
        (moved, loss(&p, term, &mut zeros()).unwrap())
    };
    let slope = |plane: usize, i: usize, h: f32| {
        let ((x1, y1), (x0, y0)) = (at(plane, i, h), at(plane, i, -h));
        (y1 - y0) / (x1 - x0)
    };
    let found = [gradient.color.as_flattened(), &gradient.alpha, &gradient.depth];
    for (plane, found) in found.into_iter().enumerate() {
        let largest = found.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        for (i, &found) in found.iter().enumerate() {
            let expected = (4.0 * slope(plane, i, h) - slope(plane, i, 2.0 * h)) / 3.0;
            let error = (f64::from(found) - expected).abs();
            assert!(error <= 1e-4 * f64::from(largest), "{name} plane {plane} [{i}]: {found} and {expected}");
        }
    }
}

#[test]
fn every_terms_gradient_is_its_central_difference_with_a_mask_and_without() {
    let target = rgb(5, 0.0, 1.0);
    let mask: Vec<f32> = noise(W * H, 7, 0.0, 2.0).iter().map(|&v| if v < 0.7 { 0.0 } else { v }).collect();
    let measured: Vec<f32> =
        noise(W * H, 8, 1.0, 7.0).iter().map(|&v| if v < 3.0 { 0.0 } else { v }).collect();
    let silhouette_of: Vec<f32> = noise(W * H, 9, 0.0, 1.0).iter().map(|v| v.round()).collect();
    for mask in [None, Some(mask.as_slice())] {
        check("mse", &|p, t, g| mse(p, &target, t, g), [true, false, false], mask);
        check("silhouette", &|p, t, g| silhouette(p, &silhouette_of, t, g), [false, true, false], mask);
        check(
            "depth",
            &|p, t, g| depth_l1(p, &away(&measured, &picture().depth), t, g),
            [false, false, true],
            mask,
        );
        let target: Vec<[f32; 3]> =
            away(target.as_flattened(), picture().color.as_flattened()).as_chunks::<3>().0.to_vec();
        check("l1", &|p, t, g| l1(p, &target, t, g), [true, false, false], mask);
    }
}

/// `target`, moved away from `values`, where an absolute difference has its kink; zeros stay.
fn away(target: &[f32], values: &[f32]) -> Vec<f32> {
    let clear = |(t, v): (&f32, &f32)| if *t != 0.0 && (t - v).abs() < 0.01 { t + 0.02 } else { *t };
    target.iter().zip(values).map(clear).collect()
}

#[test]
fn dissimilaritys_gradient_is_its_central_difference_with_a_mask_and_without() {
    let target = rgb(5, 0.0, 1.0);
    let mask: Vec<f32> = noise(W * H, 7, 0.0, 2.0).iter().map(|&v| if v < 0.7 { 0.0 } else { v }).collect();
    for mask in [None, Some(mask.as_slice())] {
        check("ssim", &|p, t, g| dissimilarity(p, &target, t, g), [true, false, false], mask);
    }
}

#[test]
fn dissimilarity_without_a_mask_is_one_minus_the_metric() {
    let (picture, target) = (picture(), rgb(5, 0.0, 1.0));
    let found = dissimilarity(&picture, &target, Term::weighing(1.0), &mut zeros()).unwrap();
    let expected = 1.0 - crate::quality::ssim(&picture.color, &target, W as u32, H as u32).unwrap();
    assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    let same: Vec<[f32; 3]> = picture.color.clone();
    let mut gradient = zeros();
    let none = dissimilarity(&picture, &same, Term::weighing(1.0), &mut gradient).unwrap();
    assert!(none.abs() < 1e-12 && gradient.color.as_flattened().iter().all(|g| g.abs() < 1e-9));
}

#[test]
fn terms_add_up_and_a_mask_of_zeros_makes_a_term_zero() {
    let (picture, target) = (picture(), rgb(5, 0.0, 1.0));
    let nothing = vec![0.0; W * H];
    let mut gradient = zeros();
    for loss in [l1, mse, dissimilarity] {
        assert_eq!(loss(&picture, &target, Term::weighing(1.0).on(&nothing), &mut gradient).unwrap(), 0.0);
    }
    assert!(gradient.color.as_flattened().iter().all(|&g| g == 0.0));
    let (mut once, mut twice) = (zeros(), zeros());
    mse(&picture, &target, Term::weighing(2.0), &mut once).unwrap();
    mse(&picture, &target, Term::weighing(1.0), &mut twice).unwrap();
    mse(&picture, &target, Term::weighing(1.0), &mut twice).unwrap();
    assert_eq!(once, twice);
}

#[test]
fn arguments_of_another_size_or_not_finite_are_refused_by_name() {
    let (picture, target) = (picture(), rgb(5, 0.0, 1.0));
    let mut bad = target.clone();
    bad[3][2] = f32::NAN;
    let negative: Vec<f32> = vec![-1.0; W * H];
    let term = Term::weighing(1.0);
    let cases = [
        (l1(&picture, &target[1..], term, &mut zeros()), "target: 237 pixels"),
        (mse(&picture, &bad, term, &mut zeros()), "target[3]: NaN"),
        (l1(&picture, &target, term.on(&negative), &mut zeros()), "term.mask[0]: -1"),
        (silhouette(&picture, &[0.0; 9], term, &mut zeros()), "target: 9 pixels"),
        (depth_l1(&picture, &negative[..5], term, &mut zeros()), "target: 5 pixels"),
        (l1(&picture, &target, Term::weighing(f64::NAN), &mut zeros()), "term.weight: NaN"),
    ];
    for (result, expected) in cases {
        let error = result.unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    let small = Rendered { width: 10, height: 1, color: vec![[0.0; 3]; 10], ..Rendered::default() };
    let error = dissimilarity(&small, &[[0.0; 3]; 10], term, &mut zeros()).unwrap_err().to_string();
    assert!(error.starts_with("picture.size: 10x1"), "{error}");
}
