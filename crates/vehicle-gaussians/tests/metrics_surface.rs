//! Surface errors of shapes with known answers: a box of flat Gaussians against points scanned on it.

use glam::{DQuat, DVec3};
use vg::Gaussians;
use vg::gaussians::buffer::Gaussian;
use vg::metrics::{SurfaceErrors, SurfaceOptions, visible_surface};
use vg_testing::Random;

/// The box's size, metres.
const SIZE: DVec3 = DVec3::new(4.0, 1.8, 1.4);

/// Spacing of the Gaussians of the shell, metres; the shell extends over its edges by about half of that.
const STEP: f64 = 0.01;

/// The sides that a scanner sees (all but the bottom): their axis, and their position along it.
const SIDES: [(usize, f64); 5] = [(0, -0.5), (0, 0.5), (1, -0.5), (1, 0.5), (2, 0.5)];

/// Flat Gaussians on the shell where `keep` is true, including the bottom.
fn shell(keep: impl Fn(DVec3) -> bool) -> Gaussians {
    let mut gaussians = Gaussians::with_capacity(0, 0);
    for (axis, at) in SIDES.into_iter().chain([(2, -0.5)]) {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let count = |k: usize| (SIZE[k] / STEP).round() as u32;
        for i in 0..count(a) {
            for j in 0..count(b) {
                let mut p = DVec3::ZERO;
                p[axis] = at * SIZE[axis];
                p[a] = (f64::from(i) + 0.5) * STEP - 0.5 * SIZE[a];
                p[b] = (f64::from(j) + 0.5) * STEP - 0.5 * SIZE[b];
                if keep(p) {
                    gaussians.push(&surfel(p, axis));
                }
            }
        }
    }
    gaussians
}

fn surfel(p: DVec3, axis: usize) -> Gaussian {
    let mut normal = DVec3::ZERO;
    normal[axis] = 1.0;
    let turn = DQuat::from_rotation_arc(DVec3::Z, normal);
    let flat = 0.6 * STEP as f32;
    Gaussian {
        mean: p.as_vec3().to_array(),
        rotation: [turn.w, turn.x, turn.y, turn.z].map(|v| v as f32),
        scale: [flat, flat, 1e-4],
        opacity: 0.95,
        sh0: [0.0; 3],
    }
}

/// Points spread evenly over the box's outside, with noise of this standard deviation in metres.
fn scan(count: usize, noise: f64) -> Vec<[f32; 3]> {
    let mut random = Random::new(3);
    let area = |axis: usize| SIZE[(axis + 1) % 3] * SIZE[(axis + 2) % 3];
    let all: f64 = SIDES.iter().map(|s| area(s.0)).sum();
    let mut points = Vec::new();
    for (axis, at) in SIDES {
        for _ in 0..(count as f64 * area(axis) / all).round() as usize {
            let mut p = DVec3::from_array([(); 3].map(|()| random.uniform(-0.5, 0.5))) * SIZE;
            p[axis] = at * SIZE[axis];
            // The sum of twelve is nearly normal, of variance 1.
            let normal = |random: &mut Random| (0..12).map(|_| random.uniform(-0.5, 0.5)).sum::<f64>();
            let off = DVec3::from_array([(); 3].map(|()| noise * normal(&mut random)));
            points.push((p + off).as_vec3().to_array());
        }
    }
    points
}

fn moved(points: &[[f32; 3]], by: impl Fn(DVec3) -> DVec3) -> Vec<[f32; 3]> {
    points.iter().map(|p| by(DVec3::from_array(p.map(f64::from))).as_vec3().to_array()).collect()
}

fn sizes(e: &SurfaceErrors) -> [f64; 3] {
    [e.length_error_percent, e.width_error_percent, e.height_error_percent]
}

/// 40,000 points on 23 m^2 lie 12 mm from a random place of the surface, and the shell's 20 mm cells 8 mm from a point.
#[test]
fn the_distance_of_a_shell_from_its_scan_is_the_point_spacing() {
    let model = shell(|_| true);
    for (noise, most) in [(0.0, 0.014), (0.005, 0.017)] {
        let errors = SurfaceErrors::of(&model, &scan(40_000, noise)).unwrap();
        println!("noise {noise}: {errors:?}");
        assert!(errors.chamfer_m < most, "{errors:?}");
        assert!(errors.f_score > 0.999, "{errors:?}");
        // A centimetre at each end: the extension of the shell over its edges, and noise on flat sides.
        for (error, side) in sizes(&errors).into_iter().zip(SIZE.to_array()) {
            assert!(error.abs() < 2.5 / side, "{errors:?}");
        }
    }
}

#[test]
fn only_parts_visible_from_outside_and_above_are_the_surface() {
    let mut model = shell(|_| true);
    let outside = visible_surface(&model, 0.02).unwrap();
    // The bottom is not part of the surface, and its absence from the scan does not count.
    let below = -0.5 * SIZE.z as f32 + 0.01;
    assert!(outside.iter().filter(|p| p[2] < below).all(|p| {
        let edge = |k: usize| (f64::from(p[k]).abs() - 0.5 * SIZE[k]).abs() < 0.03;
        edge(0) || edge(1)
    }));
    // Gaussians inside are not seen.
    let mut random = Random::new(1);
    for _ in 0..2_000 {
        let p = DVec3::from_array([(); 3].map(|()| random.uniform(-0.4, 0.4))) * SIZE;
        model.push(&surfel(p, 0));
    }
    let with = SurfaceErrors::of(&model, &scan(40_000, 0.005)).unwrap();
    let without = SurfaceErrors::of(&shell(|_| true), &scan(40_000, 0.005)).unwrap();
    assert!((with.chamfer_m - without.chamfer_m).abs() < 1e-3, "{with:?} {without:?}");
}

#[test]
fn a_scaled_model_has_the_scale_as_size_error() {
    let model = shell(|_| true);
    let points = scan(40_000, 0.005);
    let plain = SurfaceErrors::of(&model, &points).unwrap();
    let smaller = moved(&points, |p| p / DVec3::new(1.03, 1.02, 0.98));
    let errors = SurfaceErrors::of(&model, &smaller).unwrap();
    for ((found, before), expected) in sizes(&errors).into_iter().zip(sizes(&plain)).zip([3.0, 2.0, -2.0]) {
        let found = 100.0 * ((100.0 + found) / (100.0 + before) - 1.0);
        assert!((found - expected).abs() < 0.3, "{errors:?} {plain:?}");
    }
}

/// After a shift of 8 cm across a side, that side is 8 cm off and the sides along the shift are not; the share of the
/// sides across in the surface is known.
#[test]
fn the_distance_of_a_shifted_scan_is_the_shift() {
    let model = shell(|_| true);
    let at = scan(40_000, 0.005);
    let errors = |shift: f64| SurfaceErrors::of(&model, &moved(&at, |p| p + shift * DVec3::Z)).unwrap();
    let (there, up) = (errors(0.0), errors(0.08));
    // The share of the roof; and a strip of 8 cm below or above the sides, 4 cm away on average.
    let roof = SIZE.x * SIZE.y;
    let walls = 2.0 * (SIZE.x + SIZE.y) * SIZE.z;
    let expected = (0.08 * roof + 0.04 * walls * 0.08 / SIZE.z) / (roof + walls);
    let found = up.chamfer_m - there.chamfer_m;
    // A point 12 mm away sideways is less than 12 mm farther away if it is also 80 mm above.
    assert!((0.6 * expected..expected).contains(&found), "{found} {expected}");
    assert!((up.precision - walls / (roof + walls)).abs() < 0.05, "{up:?}");
    assert!(up.f_score < there.f_score - 0.2);
}

/// Distances of 50 cm and more count as missing, whatever they are.
#[test]
fn half_a_model_is_accurate_but_not_complete() {
    // Without the side below, which is seen from above where the rest is open.
    let half = shell(|p| p.y <= 0.0 && p.z > -0.5 * SIZE.z);
    let errors = SurfaceErrors::of(&half, &scan(40_000, 0.005)).unwrap();
    assert!(errors.accuracy_m < 0.016, "{errors:?}");
    assert!(errors.precision > 0.99, "{errors:?}");
    // The far side of the missing half is at least 50 cm away, its roof and ends 45 cm on average or less.
    let side = SIZE.x * SIZE.z;
    let rest = SIZE.y * SIZE.x / 2.0 + SIZE.y * SIZE.z;
    let capped_mean = (0.5 * 0.25 + 0.4 * 0.5) / 0.9;
    let expected = (0.5 * side + capped_mean * rest) / (2.0 * (side + rest));
    assert!((errors.completeness_m - expected - 0.005).abs() < 0.01, "{errors:?} {expected}");
    assert!((errors.recall - 0.5).abs() < 0.03, "{errors:?}");
    assert!((errors.width_error_percent + 50.0).abs() < 2.0, "{errors:?}");
}

#[test]
fn strays_and_the_density_of_the_scan_do_not_count() {
    let model = shell(|_| true);
    let clean = scan(40_000, 0.005);
    let mut random = Random::new(9);
    let mut dirty = clean.clone();
    for _ in 0..400 {
        let p = DVec3::from_array([(); 3].map(|()| random.uniform(-0.65, 0.65))) * SIZE;
        dirty.push(p.as_vec3().to_array());
    }
    // One side three times as densely.
    let side: Vec<_> = clean.iter().copied().filter(|p| p[1] > 0.89).collect();
    dirty.extend(moved(&side, |p| p + DVec3::new(0.007, 0.0, 0.007)));
    dirty.extend(moved(&side, |p| p - DVec3::new(0.007, 0.0, 0.007)));
    let [a, b] = [clean, dirty].map(|scan| SurfaceErrors::of(&model, &scan).unwrap());
    assert!((a.chamfer_m - b.chamfer_m).abs() < 2e-3, "{a:?} {b:?}");
    assert!((a.f_score - b.f_score).abs() < 5e-3, "{a:?} {b:?}");
    for (a, b) in sizes(&a).into_iter().zip(sizes(&b)) {
        assert!((a - b).abs() < 0.5, "{a} {b}");
    }
}

#[test]
fn numbers_do_not_depend_on_the_number_of_threads() {
    let (model, scan) = (shell(|_| true), scan(5_000, 0.005));
    let with = |threads: usize| {
        let threads = vg::progress::Threads::new(threads).unwrap();
        threads.run(|| SurfaceErrors::of(&model, &scan)).unwrap()
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn input_that_cannot_be_compared_is_named() {
    let error =
        |model: &Gaussians, scan: &[[f32; 3]]| SurfaceErrors::of(model, scan).unwrap_err().to_string();
    let model = shell(|p| p.x > 1.9);
    assert!(error(&model, &[]).starts_with("scan: 0 points"));
    assert!(error(&model, &[[0.0; 3], [0.0, f32::NAN, 0.0]]).starts_with("scan[1]"));
    assert!(error(&Gaussians::default(), &[[0.0; 3]]).starts_with("gaussians: none"));
    let mut faint = Gaussians::with_capacity(0, 1);
    faint.push(&Gaussian { opacity: 0.1, ..surfel(DVec3::ZERO, 0) });
    assert!(error(&faint, &[[0.0; 3]]).contains("alpha"));
    let options = SurfaceOptions { cell_m: f64::NAN, ..SurfaceOptions::default() };
    let error = SurfaceErrors::with(&model, &[[0.0; 3]], &options).unwrap_err().to_string();
    assert!(error.starts_with("options.cell_m: NaN"), "{error}");
    // A single point is a scan without a size.
    let one = SurfaceErrors::of(&model, &[[2.0, 0.0, 0.0]]).unwrap();
    assert_eq!(sizes(&one), [0.0; 3]);
}
