//! Properties of every scene, tested on random ones. Seeds are fixed, so that every machine tests the same scenes;
//! `PROPTEST_RNG_SEED` and `PROPTEST_CASES` choose others and more.

use glam::{DMat3, DQuat, DVec3};
use proptest::array::{uniform3, uniform4};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use vg::geometry::Similarity;
use vg::geometry::camera::Intrinsics;
use vg::render::{Background, CpuRenderer, Differentiable, Reference, RenderOptions, Rendered, Renderer};
use vg::scene::DepthMap;
use vg::{Camera, Gaussians, Pose};
use vg_testing::gradients::{all_finite, noise};
use vg_testing::is_finite;

/// A promise, its tolerance, and the reason for the tolerance.
pub struct Property {
    pub claim: &'static str,
    /// Bound of colour (relative to the largest, at least 1) and alpha, away from the cuts; `None`: bit for bit, or no
    /// number.
    pub tolerance: Option<f64>,
    pub why: &'static str,
}

pub const AGREES: Property = Property {
    claim: "the f32 picture equals the f64 picture",
    tolerance: Some(2e-6),
    why: "f32 sums of up to 24 layers, centres to 2^-25 px",
};
pub const TWICE: Property =
    Property { claim: "mirroring twice returns the same bytes", tolerance: None, why: "only signs change" };
pub const FLIPPED: Property = Property {
    claim: "the mirrored scene from the mirrored camera gives the flipped picture",
    tolerance: Some(2e-6),
    why: "u and width - u are rounded differently",
};
pub const MOVED: Property = Property {
    claim: "scene and camera moved together give the same picture",
    tolerance: Some(1e-4),
    why: "means stored in f32 move by up to 1e-6 m at 16 m, quaternions by 6e-8: 1e-4 px on needles of 2 m",
};
pub const PERMUTED: Property = Property {
    claim: "the order of storage does not change the picture, except at equal depths",
    tolerance: None,
    why: "depths are sorted, and every sum is in that order",
};
pub(crate) const FINITE: Property = Property {
    claim: "finite input of any size gives finite pictures and gradients",
    tolerance: None,
    why: "an overflow saturates, or an error names the argument",
};
pub const REFUSED: Property = Property {
    claim: "a number that is not finite gives an error that names it; in a depth map it means no measurement",
    tolerance: None,
    why: "every entry is checked",
};

/// In the order of the document.
pub(crate) const ALL: [&Property; 7] = [&AGREES, &TWICE, &FLIPPED, &MOVED, &PERMUTED, &FINITE, &REFUSED];

/// A pixel on a cut may fall to either side: alpha of 1/255 drawn or not, or a last layer of at most T = 1e-4 / (1 -
/// 0.99).
const FLIP: f64 = 1e-2;
/// Share of pixels that may: cuts are lines in the picture, and f32 differs from f64 on a strip of 1e-6 of a pixel
/// along them.
const FLIPS: f64 = 2e-3;

fn config(cases: u32) -> ProptestConfig {
    let usual = ProptestConfig::default();
    ProptestConfig {
        cases: if std::env::var_os("PROPTEST_CASES").is_some() { usual.cases } else { cases },
        rng_seed: if std::env::var_os("PROPTEST_RNG_SEED").is_some() {
            usual.rng_seed
        } else {
            RngSeed::Fixed(1)
        },
        // Nothing is written into the source tree.
        failure_persistence: None,
        ..usual
    }
}

fn options() -> RenderOptions {
    RenderOptions { background: Background::Color([0.1, 0.2, 0.3]), ..RenderOptions::default() }
}

/// Mean, rotation, scale, opacity, colour of degree 2.
type One = ([f32; 3], [f32; 4], [f32; 3], f32, Vec<f32>);

/// A Gaussian of a vehicle: standard deviations of 1e-6 to 2 m, log-uniform.
fn one() -> impl Strategy<Value = One> {
    let mean = (-2.0f32..2.0, -0.9f32..0.9, -0.7f32..0.7).prop_map(|(x, y, z)| [x, y, z]);
    let rotation = uniform4(-1.0f32..1.0).prop_filter("too short", |q| q.iter().any(|v| v.abs() > 0.1));
    let scale = uniform3((1e-6f32.ln()..2f32.ln()).prop_map(f32::exp));
    (mean, rotation, scale, 0.0f32..=1.0, vec(-1.0f32..1.0, 27))
}

fn gathered(ones: &[One]) -> Gaussians {
    Gaussians::from_arrays(
        2,
        ones.iter().map(|o| o.0).collect(),
        ones.iter().map(|o| o.1).collect(),
        ones.iter().map(|o| o.2).collect(),
        ones.iter().map(|o| o.3).collect(),
        ones.iter().flat_map(|o| o.4.clone()).collect(),
    )
    .unwrap()
}

fn scene() -> impl Strategy<Value = Gaussians> {
    vec(one(), 1..24).prop_map(|ones| gathered(&ones))
}

/// A camera that looks past the origin from 3 to 9 m, with a picture of up to 40x30.
fn camera() -> impl Strategy<Value = Camera> {
    let direction = uniform3(-1.0f64..1.0).prop_filter("no direction", |d| d[0].abs() > 0.1);
    let size = (1u32..40, 1u32..30);
    (direction, 3.0f64..9.0, uniform3(-0.5f64..0.5), size, 0.5f64..3.0, 0.2f64..0.8).prop_map(
        |(direction, distance, beside, (width, height), focal, principal)| {
            let eye = DVec3::from(direction).normalize() * distance;
            let z = (DVec3::from(beside) - eye).normalize();
            let x = z.cross(DVec3::new(0.1, 0.2, 0.97)).normalize();
            let rotation = DMat3::from_cols(x, z.cross(x), z);
            let f = focal * f64::from(width.max(height));
            let intrinsics = Intrinsics {
                fx: f,
                fy: 1.1 * f,
                cx: principal * f64::from(width),
                cy: (1.0 - principal) * f64::from(height),
            };
            Camera::pinhole(width, height, intrinsics, Pose { rotation, translation: eye }).unwrap()
        },
    )
}

fn draw(gaussians: &Gaussians, camera: &Camera) -> Rendered {
    CpuRenderer::new().render(gaussians, camera, &options()).unwrap()
}

/// Colour and alpha within the property's tolerance; few pixels, on a cut, within [`FLIP`].
fn assert_kept(property: &Property, a: &Rendered, b: &Rendered) -> Result<(), TestCaseError> {
    let tolerance = property.tolerance.unwrap_or_default();
    let scale = b.color.as_flattened().iter().fold(1.0f64, |m, v| m.max(v.abs().into()));
    let (mut flips, mut worst) = (0, 0.0f64);
    for i in 0..a.alpha.len() {
        let of_color =
            (0..3).map(|c| f64::from((a.color[i][c] - b.color[i][c]).abs()) / scale).fold(0.0, f64::max);
        let error = of_color.max(f64::from((a.alpha[i] - b.alpha[i]).abs()));
        flips += usize::from(error > tolerance);
        worst = worst.max(error);
    }
    let allowed = 1usize.max((FLIPS * a.alpha.len() as f64) as usize);
    prop_assert!(
        flips <= allowed && worst <= FLIP,
        "{}: {flips} pixels beyond {tolerance:e}, the worst by {worst:e}",
        property.claim
    );
    Ok(())
}

/// Any bit pattern that is a finite number.
fn any_finite() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("not finite", |v| v.is_finite())
}

/// A number that is not finite.
fn not_finite() -> impl Strategy<Value = f32> {
    prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY)]
}

proptest! {
    #![proptest_config(config(96))]

    #[test]
    fn the_f32_picture_equals_the_f64_picture(g in scene(), camera in camera()) {
        let exact = Reference.render(&g, &camera, &options()).unwrap();
        for renderer in [CpuRenderer::new(), CpuRenderer::portable()] {
            assert_kept(&AGREES, &renderer.render(&g, &camera, &options()).unwrap(), &exact)?;
        }
    }

    #[test]
    fn the_mirrored_scene_from_the_mirrored_camera_gives_the_flipped_picture(g in scene(), camera in camera()) {
        let mut mirrored = camera;
        mirrored.vehicle_from_camera = camera.vehicle_from_camera.mirrored();
        mirrored.intrinsics.cx = f64::from(camera.width) - camera.intrinsics.cx;
        let mut flipped = draw(&g.mirrored(), &mirrored);
        for row in 0..camera.height as usize {
            let range = row * camera.width as usize..(row + 1) * camera.width as usize;
            flipped.color[range.clone()].reverse();
            flipped.alpha[range].reverse();
        }
        assert_kept(&FLIPPED, &flipped, &draw(&g, &camera))?;
    }

    #[test]
    fn scene_and_camera_moved_together_give_the_same_picture(
        g in scene(),
        camera in camera(),
        turn in uniform4(-1.0f64..1.0).prop_filter("too short", |q| q.iter().any(|v| v.abs() > 0.1)),
        translation in uniform3(-10.0f64..10.0),
    ) {
        let q = DQuat::from_array(turn).normalize();
        let similarity =
            Similarity { scale: 1.0, rotation: DMat3::from_quat(q), translation: translation.into() };
        let moved = Camera { vehicle_from_camera: similarity.transform_pose(&camera.vehicle_from_camera), ..camera };
        assert_kept(&MOVED, &draw(&g.transformed(&similarity).unwrap(), &moved), &draw(&g, &camera))?;
    }

    #[test]
    fn the_order_of_storage_does_not_change_the_picture(
        ones in vec(one(), 1..24),
        order in any::<[u8; 24]>(),
        jitter in vec(0.0f32..0.05, 24),
    ) {
        // 0.1 m apart along the optical axis, so that no two depths are equal.
        let mut ones = ones;
        for (i, one) in ones.iter_mut().enumerate() {
            one.0[0] = 2.0 + 0.1 * i as f32 + jitter[i];
        }
        let camera = crate::cases::forward(33, 21, 30.0);
        let expected = draw(&gathered(&ones), &camera);
        let mut shuffled: Vec<(u8, One)> = order.into_iter().zip(ones).collect();
        shuffled.sort_by_key(|(key, _)| *key);
        let shuffled: Vec<One> = shuffled.into_iter().map(|(_, one)| one).collect();
        prop_assert!(draw(&gathered(&shuffled), &camera) == expected);
    }

    #[test]
    fn mirroring_twice_returns_the_same_bytes(
        means in vec(uniform3(any_finite()), 1..8),
        rotations in vec(uniform4(any_finite()), 8),
        sh in vec(any_finite(), 8 * 48),
        degree in 0u8..=3,
    ) {
        let n = means.len();
        let stride = 3 * (usize::from(degree) + 1).pow(2);
        let whole: Vec<[f32; 4]> = rotations[..n].iter().map(|q| if q.iter().all(|v| *v == 0.0) { [1.0; 4] } else { *q }).collect();
        let g = Gaussians::from_arrays(degree, means, whole, vec![[0.1; 3]; n], vec![0.5; n], sh[..n * stride].to_vec()).unwrap();
        let twice = g.mirrored().mirrored();
        // Compared as bits, because 0 and -0 differ.
        let bits = |g: &Gaussians| -> Vec<u32> {
            let arrays = [g.means().as_flattened(), g.rotations().as_flattened(), g.scales().as_flattened(), g.opacities(), g.sh()];
            arrays.concat().iter().map(|v| v.to_bits()).collect()
        };
        prop_assert_eq!(bits(&twice), bits(&g));
    }
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn finite_input_of_any_size_gives_finite_pictures_and_gradients(
        means in vec(uniform3(any_finite()), 6),
        near_means in vec(uniform3(-3.0f32..3.0), 6),
        is_near in any::<[bool; 6]>(),
        rotations in vec(uniform4(any_finite()), 6),
        scales in vec(uniform3((-87.0f32..20.7).prop_map(f32::exp)), 6),
        opacities in vec(0.0f32..=1.0, 6),
        sh in vec(any_finite(), 6 * 27),
        focal in (-6.9f64..20.7).prop_map(f64::exp),
        center in (-1e9f64..1e9, any::<bool>()),
        translation in (uniform3(-1e12f64..1e12), any::<bool>()),
        (width, height) in (1u32..80, 1u32..24),
        (antialiased, degree) in (any::<bool>(), 0u8..=3),
    ) {
        // About half of them in view.
        let means = means.iter().zip(&near_means).zip(is_near).map(|((far, near), is)| if is { *near } else { *far }).collect();
        let Ok(g) = Gaussians::from_arrays(2, means, rotations, scales, opacities, sh) else {
            // A quaternion of zeros is the only finite input that is refused.
            return Ok(());
        };
        let mut camera = crate::cases::forward(width, height, focal.clamp(1e-3, 1e9));
        if center.1 {
            camera.intrinsics.cx = center.0;
        }
        if translation.1 {
            camera.vehicle_from_camera.translation = translation.0.into();
        }
        let options = RenderOptions { near: 1e-6, max_alpha: 0.9999, antialiased, sh_degree: degree, ..options() };
        for renderer in [CpuRenderer::new(), CpuRenderer::portable()] {
            let picture = renderer.render(&g, &camera, &options).unwrap();
            prop_assert!(is_finite(&picture), "{g:?}");
            let gradients = renderer.backward(&g, &camera, &options, &noise(1, &camera)).unwrap();
            prop_assert!(all_finite(&gradients), "{g:?}");
        }
    }

    #[test]
    fn a_number_that_is_not_finite_gives_an_error_that_names_it(
        bad in not_finite(),
        (i, k) in (0usize..5, 0usize..27),
        which in 0usize..13,
    ) {
        let n = 5;
        let (mut means, mut rotations, mut scales) = (vec![[4.0f32, 0.0, 0.0]; n], vec![[1.0f32, 0.0, 0.0, 0.0]; n], vec![[0.1f32; 3]; n]);
        let (mut opacities, mut sh) = (vec![0.5f32; n], vec![0.1f32; 27 * n]);
        let mut camera = crate::cases::forward(4, 3, 5.0);
        let mut options = options();
        let mut gradient = noise(1, &camera);
        let wide = f64::from(bad);
        let name = match which {
            0 => { means[i][k % 3] = bad; format!("means[{i}]") }
            1 => { rotations[i][k % 4] = bad; format!("rotations[{i}]") }
            2 => { scales[i][k % 3] = bad; format!("scales[{i}]") }
            3 => { opacities[i] = bad; format!("opacities[{i}]") }
            4 => { sh[27 * i + k] = bad; format!("sh[{i}]") }
            5 => { camera.intrinsics.fx = wide; "camera.focal length".into() }
            6 => { camera.intrinsics.cy = wide; "camera.principal point".into() }
            7 => { camera.vehicle_from_camera.translation[k % 3] = wide; "camera.vehicle_from_camera".into() }
            8 => { camera.vehicle_from_camera.rotation.col_mut(k % 3)[i % 3] = wide; "camera.vehicle_from_camera".into() }
            9 => { options.blur = bad; "options.blur".into() }
            10 => { options.near = bad; "options.near".into() }
            11 => { gradient.color[i][k % 3] = bad; format!("gradient.color[{i}]") }
            _ => { gradient.depth[i] = bad; format!("gradient.depth[{i}]") }
        };
        let answer = Gaussians::from_arrays(2, means, rotations, scales, opacities, sh)
            .and_then(|g| CpuRenderer::new().backward(&g, &camera, &options, &gradient));
        let error = answer.expect_err("refused").to_string();
        prop_assert!(error.starts_with(&name), "{error}, not {name}");
        // In a depth map it means no measurement.
        let map = DepthMap::new(2, 1, vec![bad, 1.5]).unwrap();
        prop_assert_eq!(map.depth(), [0.0, 1.5]);
    }
}
