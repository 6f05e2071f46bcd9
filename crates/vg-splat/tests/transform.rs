//! Moving a model into another frame preserves its pictures.

use glam::{DMat3, DQuat, DVec3};
use vg_geometry::{Camera, Similarity};
use vg_splat::Gaussians;
use vg_splat::gaussians::sh;
use vg_splat::render::{CpuRenderer, RenderOptions, Renderer};
use vg_testing::{Random, compare, scenes};

fn rotation(r: &mut Random) -> DMat3 {
    DMat3::from_quat(DQuat::from_xyzw(r.normal(), r.normal(), r.normal(), r.normal()).normalize())
}

fn direction(r: &mut Random) -> DVec3 {
    DVec3::new(r.normal(), r.normal(), r.normal()).normalize()
}

fn similarity(r: &mut Random) -> Similarity {
    let translation = DVec3::new(r.normal(), r.normal(), r.normal()) * 3.0;
    Similarity { scale: r.uniform(0.1, 10.0), rotation: rotation(r), translation }
}

/// Colour of one channel before the offset of 0.5 and the clamp, both of which would hide errors.
fn unclamped(coefficients: &[f32], channel: usize, direction: DVec3) -> f64 {
    let basis = sh::basis(direction.to_array(), sh::MAX_DEGREE);
    coefficients.chunks_exact(3).zip(basis).map(|(rgb, b)| f64::from(rgb[channel]) * b).sum()
}

fn length(coefficients: &[f32]) -> f64 {
    coefficients.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt()
}

fn covariance(q: [f32; 4], s: [f32; 3]) -> DMat3 {
    let [w, x, y, z] = q.map(f64::from);
    let m = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
        * DMat3::from_diagonal(DVec3::from_array(s.map(f64::from)));
    m * m.transpose()
}

#[test]
fn the_colour_along_the_rotated_direction_is_unchanged() {
    let mut r = Random::new(1);
    for degree in 0..=3 {
        for _ in 0..20 {
            let given = scenes::random(r.bits(), 10, degree, [0.01, 0.1]);
            let to_from = similarity(&mut r);
            let moved = given.transformed(&to_from).unwrap();
            let stride = given.sh_stride();
            for (before, after) in given.sh().chunks_exact(stride).zip(moved.sh().chunks_exact(stride)) {
                for _ in 0..20 {
                    let d = direction(&mut r);
                    for c in 0..3 {
                        let expected = unclamped(before, c, d);
                        let found = unclamped(after, c, to_from.rotation * d);
                        // An f32 rounds each coefficient by up to 6e-8 of itself.
                        let error = (found - expected).abs() / length(before);
                        assert!(error <= 1e-6, "degree {degree}: {error}");
                    }
                }
            }
        }
    }
}

#[test]
fn means_and_covariances_move_as_the_similarity_moves_points() {
    let mut r = Random::new(2);
    let given = scenes::random(3, 200, 1, [1e-3, 1.0]);
    for _ in 0..10 {
        let to_from = similarity(&mut r);
        let moved = given.transformed(&to_from).unwrap();
        let linear = to_from.rotation * to_from.scale;
        for i in 0..given.len() {
            let mean = DVec3::from_array(given.means()[i].map(f64::from));
            assert_eq!(moved.means()[i], to_from.transform_point(mean).as_vec3().to_array());
            let expected = linear * covariance(given.rotations()[i], given.scales()[i]) * linear.transpose();
            let found = covariance(moved.rotations()[i], moved.scales()[i]);
            let size = expected.to_cols_array().iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let worst = (found - expected).to_cols_array().iter().fold(0.0f64, |m, v| m.max(v.abs()));
            // Quaternion and scales are f32: a few steps of 6e-8, twice, as a covariance is a square.
            assert!(worst <= 1e-6 * size, "{worst} of {size}");
            let norm: f64 = moved.rotations()[i].iter().map(|&v| f64::from(v).powi(2)).sum();
            assert!((norm - 1.0).abs() < 3e-7, "a quaternion of f32 numbers is that near to unit length");
        }
        assert_eq!(moved.opacities(), given.opacities());
    }
}

#[test]
fn a_moved_model_from_the_moved_camera_gives_the_same_picture() {
    let mut r = Random::new(4);
    let given = scenes::random(5, 500, 3, [0.02, 0.2]);
    let camera = scenes::looking_at_origin(96, 64, DVec3::new(1.0, 2.0, 0.5), 6.0);
    // Scale 1: the near plane stays where it is.
    let to_from = Similarity { scale: 1.0, ..similarity(&mut r) };
    let moved = given.transformed(&to_from).unwrap();
    let moved_camera =
        Camera { vehicle_from_camera: to_from.transform_pose(&camera.vehicle_from_camera), ..camera };
    let picture = |model: &Gaussians, camera: &Camera| {
        CpuRenderer::default().render(model, camera, &RenderOptions::default()).unwrap()
    };
    let [color, alpha, _] = compare(&picture(&given, &camera), &picture(&moved, &moved_camera));
    // Means are rounded again; a Gaussian within rounding of 1/255 may be skipped in only one of the two.
    for d in [color, alpha] {
        assert!(d.mean < 1e-5 && d.max < 1.5 / 255.0, "{d:?}");
    }
}

#[test]
fn the_identity_returns_the_same_bytes_and_a_translation_keeps_rotations_and_colours() {
    let unit_but_for_rounding = [0.182_574_19, 0.365_148_37, 0.547_722_6, 0.730_296_7];
    let sh = (0..48).map(|k| if k % 5 == 0 { -0.0 } else { k as f32 * 0.1 }).collect();
    let means = vec![[-0.0, 3e7, 1e-42]];
    let far =
        Gaussians::from_arrays(3, means, vec![unit_but_for_rounding], vec![[0.1; 3]], vec![0.5], sh).unwrap();
    let same = far.transformed(&Similarity::IDENTITY).unwrap();
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(same.means().as_flattened()), bits(far.means().as_flattened()));
    assert_eq!(bits(same.rotations().as_flattened()), bits(far.rotations().as_flattened()));
    assert_eq!(bits(same.scales().as_flattened()), bits(far.scales().as_flattened()));
    assert_eq!(bits(same.sh()), bits(far.sh()));

    let given = scenes::random(6, 50, 3, [0.01, 0.1]);
    let shift = Similarity { translation: DVec3::new(1.0, 2.0, 3.0), ..Similarity::IDENTITY };
    let moved = given.transformed(&shift).unwrap();
    assert_eq!(moved.rotations(), given.rotations());
    assert_eq!(moved.scales(), given.scales());
    assert_eq!(bits(moved.sh()), bits(given.sh()));
}

#[test]
fn moving_there_and_back_returns_the_model_to_the_rounding_of_f32() {
    let given = scenes::random(7, 100, 3, [0.01, 0.1]);
    let there = similarity(&mut Random::new(8));
    let from_to = there.rotation.transpose();
    let back = Similarity {
        scale: there.scale.recip(),
        rotation: from_to,
        translation: from_to * there.translation / -there.scale,
    };
    let returned = given.transformed(&there).unwrap().transformed(&back).unwrap();
    let close = |a: &[f32], b: &[f32], tolerance: f32| {
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst <= tolerance, "{worst} above {tolerance}");
    };
    // Means lie within 2.2 m and were up to 30 m from the other origin, where a step is 2e-6 m; the way back scales.
    close(returned.means().as_flattened(), given.means().as_flattened(), 2e-6 / there.scale as f32 + 1e-6);
    close(returned.scales().as_flattened(), given.scales().as_flattened(), 2e-8);
    close(returned.sh(), given.sh(), 2e-6);
}

#[test]
fn one_and_two_threads_give_the_same_moved_model() {
    let given = scenes::random(9, 20_000, 2, [0.01, 0.1]);
    let to_from = similarity(&mut Random::new(10));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| given.transformed(&to_from).unwrap())
    };
    assert_eq!(with(1), with(2));
}

fn one(mean: [f32; 3], scale: f32, sh: f32) -> Gaussians {
    let unit = vec![[1.0, 0.0, 0.0, 0.0]];
    Gaussians::from_arrays(1, vec![mean], unit, vec![[scale; 3]], vec![0.5], vec![sh; 12]).unwrap()
}

#[track_caller]
fn refused(model: &Gaussians, to_from: &Similarity, words: &str) {
    let error = model.transformed(to_from).unwrap_err().to_string();
    assert!(error.starts_with("to_from_vehicle") && error.contains(words), "{error}");
}

#[test]
fn a_mean_where_an_f32_step_exceeds_a_millimetre_is_refused() {
    let shift = |x: f64| Similarity { translation: DVec3::new(x, 0.0, 0.0), ..Similarity::IDENTITY };
    let model = one([0.25, 0.0, 0.0], 0.1, 0.0);
    assert_eq!(model.transformed(&shift(16_383.0)).unwrap().means()[0], [16_383.25, 0.0, 0.0]);
    assert!(model.transformed(&shift(-16_384.0)).is_ok());
    // The limit itself, and numbers that round to it.
    for x in [16_383.75, 16_383.749_9, -16_384.25, 4e6, 1e300] {
        refused(&model, &shift(x), "means[0]");
    }
}

#[test]
fn scales_and_colours_that_f32_cannot_hold_are_refused() {
    let grow = |scale| Similarity { scale, ..Similarity::IDENTITY };
    refused(&one([0.0; 3], 1e3, 0.0), &grow(1e7), "scales[0]");
    refused(&one([0.0; 3], 1e-30, 0.0), &grow(1e-20), "scales[0]");
    // Three equal coefficients turned into one are 1.7 times as long.
    let onto_z =
        DMat3::from_quat(DQuat::from_rotation_arc(DVec3::new(-1.0, -1.0, 1.0).normalize(), DVec3::Z));
    let turn = Similarity { rotation: onto_z, ..Similarity::IDENTITY };
    refused(&one([0.0; 3], 1.0, f32::MAX), &turn, "sh[0]");
}

#[test]
fn matrices_that_are_not_similarities_are_refused() {
    let model = one([0.0; 3], 1.0, 0.0);
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused(&model, &Similarity { scale, ..Similarity::IDENTITY }, "scale");
    }
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    for rotation in [mirror, DMat3::ZERO, DMat3::IDENTITY * 2.0, DMat3::NAN] {
        refused(&model, &Similarity { rotation, ..Similarity::IDENTITY }, "allowed");
    }
    refused(&model, &Similarity { translation: DVec3::NAN, ..Similarity::IDENTITY }, "finite");
}
