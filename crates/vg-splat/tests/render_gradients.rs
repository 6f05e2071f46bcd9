//! Gradients of pictures, compared with gsplat's autograd and an f64 reference, and on difficult cases of backward
//! passes.

use glam::DVec3;
use vg_geometry::camera::Intrinsics;
use vg_geometry::{Camera, Distortion, Pose};
use vg_splat::Gaussians;
use vg_splat::gaussians::sh;
use vg_splat::render::reference::Parameters;
use vg_splat::render::{Background, CpuRenderer, DepthMode, Differentiable, Gradients, PictureGradient};
use vg_splat::render::{Reference, RenderOptions, Rendered, Renderer};
use vg_testing::Random;
use vg_testing::golden::{camera, gaussians, golden};
use vg_testing::gradients::{all_finite, difference, f64s, largest, largest_of, noise};
use vg_testing::gradients::{gradient_entry, loss_between, sampled, tensors};
use vg_testing::npz::Npz;
use vg_testing::renderers::renderers;
use vg_testing::scenes::{looking_at_origin, random};
use vg_testing::stiff::{Stiff, stiff};

/// |a - b| / |b| as vectors.
fn relative_l2(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let error = norm(&mut found.iter().zip(expected).map(|(a, b)| a - b));
    let size = norm(&mut expected.iter().copied());
    if size == 0.0 { error } else { error / size }
}

/// Every tensor of gsplat's gradients of `sum(plane * weights)`, and its relative error here.
fn against_golden(npz: &Npz, plane: &str, g: &Gradients) -> Vec<(String, f64)> {
    let stored = |name: &str| &npz.array(&format!("grad_{plane}_{name}")).values;
    // gsplat's gradients refer to quaternions before normalisation.
    let norms = npz
        .f32("quats_wxyz")
        .as_chunks::<4>()
        .0
        .iter()
        .map(|q| q.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>().sqrt())
        .collect::<Vec<f64>>();
    let rotations: Vec<f64> =
        g.rotations.iter().zip(&norms).flat_map(|(q, n)| q.map(|v| f64::from(v) / n)).collect();
    let mut out = vec![
        ("means".to_owned(), relative_l2(&f64s(g.means.as_flattened()), stored("means"))),
        ("quats".to_owned(), relative_l2(&rotations, stored("quats"))),
        ("scales".to_owned(), relative_l2(&f64s(g.scales.as_flattened()), stored("scales"))),
        ("opacities".to_owned(), relative_l2(&f64s(&g.opacities), stored("opacities"))),
        ("viewmat".to_owned(), relative_l2(g.pose.view_matrix.as_flattened(), stored("viewmat"))),
        ("background".to_owned(), relative_l2(&g.background, stored("background"))),
    ];
    match npz.scalar("sh_degree") as i32 {
        -1 => {
            // Plain colours are 0.5 + Y0 sh.
            let colors: Vec<f64> = g.sh.iter().map(|&v| f64::from(v) / f64::from(sh::Y0)).collect();
            out.push(("colors".to_owned(), relative_l2(&colors, stored("colors"))));
        }
        _ => out.push(("sh".to_owned(), relative_l2(&f64s(&g.sh), stored("sh")))),
    }
    out
}

fn golden_options(npz: &Npz) -> RenderOptions {
    RenderOptions {
        background: Background::Color(npz.f32("background").try_into().unwrap()),
        depth_mode: DepthMode::Accumulated,
        antialiased: npz.get("antialiased").is_some_and(|a| a.values[0] != 0.0),
        ..RenderOptions::default()
    }
}

fn golden_weights(npz: &Npz, camera: &Camera, plane: &str) -> PictureGradient {
    let weights = npz.f32(&format!("weights_{plane}"));
    let mut gradient =
        PictureGradient { width: camera.width, height: camera.height, ..PictureGradient::default() };
    match plane {
        "color" => gradient.color = weights.as_chunks::<3>().0.to_vec(),
        "alpha" => gradient.alpha = weights,
        _ => gradient.depth = weights,
    }
    gradient
}

fn check_golden(name: &str, renderer: &dyn Differentiable, tolerance: f64) {
    let Some(folder) = golden() else { return };
    let mut failures = Vec::new();
    for file in ["grad_colors_300", "grad_sh_300", "grad_antialiased_200"] {
        let npz = Npz::open(&folder.join(format!("{file}.npz")));
        let (camera, gaussians, options) = (camera(&npz), gaussians(&npz), golden_options(&npz));
        for plane in ["color", "alpha", "depth"] {
            let weights = golden_weights(&npz, &camera, plane);
            let g = renderer.backward(&gaussians, &camera, &options, &weights).unwrap();
            let errors = against_golden(&npz, plane, &g);
            print!("{name} {file:22} {plane:6}");
            for (tensor, error) in &errors {
                print!(" {tensor} {error:.1e}");
                if error.is_nan() || *error > tolerance {
                    failures.push(format!("{name} {file} {plane} {tensor}: {error:e}"));
                }
            }
            println!();
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn the_gradients_agree_with_gsplats_autograd_to_1e_4_of_each_tensor() {
    for (name, renderer) in renderers() {
        check_golden(name, &*renderer, 1e-4);
    }
}

#[test]
fn the_reference_agrees_with_gsplats_autograd_to_1e_5() {
    check_golden("f64", &Reference, 1e-5);
}

/// Number of random scenes.
const SCENES: u64 = 200;

#[test]
fn gradients_of_200_stiff_scenes_agree_with_the_reference_to_1e_4_of_each_tensors_largest() {
    let mut worst: Vec<(f64, String)> = Vec::new();
    for (level, renderer) in renderers() {
        for seed in 0..SCENES {
            let Stiff { gaussians, camera, options, gradient } = stiff(seed);
            let found = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
            let exact = Reference.backward_f64(&gaussians, &camera, &options, &gradient).unwrap();
            for (name, found, exact) in tensors(&found, &exact, &camera) {
                let error: Vec<f64> = found.iter().zip(&exact).map(|(a, b)| a - b).collect();
                let (error, scale) = (largest(&error), largest(&exact));
                let relative = if scale == 0.0 { error } else { error / scale };
                worst.push((relative, format!("{level} scene {seed} {name}: {error:e} of {scale:e}")));
                assert!(found.iter().all(|v| v.is_finite()), "{level} scene {seed} {name}");
            }
        }
    }
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (relative, what) in &worst[..12] {
        println!("{relative:.1e} {what}");
    }
    println!("median {:.1e}", worst[worst.len() / 2].0);
    assert!(worst[0].0 <= 1e-4, "{:?}", worst[0]);
}

#[test]
fn the_references_gradients_equal_its_central_differences_with_cuts_held() {
    let mut worst = Vec::new();
    let mut compared = 0;
    for seed in 0..SCENES {
        let Stiff { gaussians, camera, options, gradient } = stiff(seed);
        let g = Reference.backward_f64(&gaussians, &camera, &options, &gradient).unwrap();
        let p = Parameters::new(&gaussians, &camera, &options).unwrap();
        let cuts = Reference.cuts(&p, &options);
        let mut r = Random::new(seed);
        for (tensor, v) in sampled(&mut r, &gaussians) {
            let scale = largest_of(&g, tensor);
            let found = difference(&p, v, &options, &cuts, &gradient, 1e-6);
            let expected = gradient_entry(&g, v);
            compared += usize::from(expected != 0.0);
            let relative = if scale == 0.0 { found.abs() } else { (found - expected).abs() / scale };
            worst.push((
                relative,
                format!("scene {seed} {v:?}: {found:e}, gradient {expected:e}, of {scale:e}"),
            ));
        }
    }
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (relative, what) in &worst[..8] {
        println!("{relative:.1e} {what}");
    }
    println!("{compared} of {} gradients are not zero", worst.len());
    assert!(compared > 1000 && worst[0].0 <= 1e-5, "{:?}", worst[0]);
}

/// All results, as bits.
fn bits(g: &Gradients) -> Vec<u64> {
    let narrow =
        [g.means.as_flattened(), g.rotations.as_flattened(), g.scales.as_flattened(), &g.opacities, &g.sh];
    let pose = [g.pose.rotation.to_array(), g.pose.translation.to_array(), g.background];
    let wide = pose.as_flattened().iter().chain(g.pose.view_matrix.as_flattened());
    narrow
        .iter()
        .flat_map(|v| v.iter().map(|v| u64::from(v.to_bits())))
        .chain(wide.map(|v| v.to_bits()))
        .collect()
}

#[test]
fn one_two_and_five_threads_give_the_same_bytes() {
    let gaussians = random(9, 20_000, 3, [0.005, 0.2]);
    let camera = looking_at_origin(333, 217, DVec3::new(1.0, 1.0, 0.5), 7.0);
    let gradient = noise(1, &camera);
    let renderer = CpuRenderer::new();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = RenderOptions::default();
            let (picture, g) = renderer
                .render_with_gradients(&gaussians, &camera, &options, |_| Ok(gradient.clone()))
                .unwrap();
            let alone = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
            assert!(bits(&alone) == bits(&g), "with the picture and without it");
            assert!(picture == renderer.render(&gaussians, &camera, &options).unwrap());
            bits(&g)
        })
    };
    let expected = run(1);
    for threads in [2, 5] {
        assert!(run(threads) == expected, "{threads} threads");
    }
}

#[test]
fn reused_memory_gives_the_bytes_of_new_memory() {
    let (mut picture, mut of_picture) = (Rendered::default(), PictureGradient::default());
    let mut gradients = Gradients::default();
    let reused = CpuRenderer::new();
    // From large to small and back, with and without each plane.
    for seed in [3, 5, 8, 3, 60, 5] {
        let Stiff { gaussians, camera, options, gradient } = stiff(seed);
        let targets = (&mut picture, &mut of_picture, &mut gradients);
        reused
            .render_with_gradients_into(&gaussians, &camera, &options, targets, |_, g| {
                g.color.extend(&gradient.color);
                g.alpha.extend(&gradient.alpha);
                g.depth.extend(&gradient.depth);
                Ok(())
            })
            .unwrap();
        let fresh = CpuRenderer::new().backward(&gaussians, &camera, &options, &gradient).unwrap();
        assert!(bits(&gradients) == bits(&fresh), "scene {seed}");
    }
}

#[test]
fn a_constant_loss_and_an_empty_scene_have_zero_gradients() {
    let camera = looking_at_origin(50, 40, DVec3::X, 5.0);
    let options = RenderOptions::default();
    let gaussians = random(2, 100, 2, [0.02, 0.2]);
    let absent = PictureGradient { width: 50, height: 40, ..PictureGradient::default() };
    for (_, renderer) in renderers() {
        for flat in [PictureGradient::zeros(50, 40), absent.clone()] {
            let g = renderer.backward(&gaussians, &camera, &options, &flat).unwrap();
            assert_eq!(g.means, vec![[0.0; 3]; 100]);
            assert!(g.sh.len() == 2700 && g.sh.iter().all(|&v| v == 0.0));
            assert_eq!((g.background, g.pose), ([0.0; 3], vg_splat::render::PoseGradient::default()));
        }
        let mut ones = PictureGradient::zeros(50, 40);
        ones.color_mut().fill([1.0, 2.0, 3.0]);
        let g = renderer.backward(&Gaussians::default(), &camera, &options, &ones).unwrap();
        assert_eq!((g.means.len(), g.background), (0, [2000.0, 4000.0, 6000.0]));
        let transparent = RenderOptions { background: Background::Transparent, ..options };
        let g = renderer.backward(&Gaussians::default(), &camera, &transparent, &ones).unwrap();
        assert_eq!(g.background, [0.0; 3]);
    }
}

#[test]
fn gradients_that_do_not_fit_the_picture_are_refused_by_name() {
    let camera = looking_at_origin(10, 8, DVec3::X, 5.0);
    let (options, gaussians) = (RenderOptions::default(), random(2, 3, 0, [0.1, 0.2]));
    let zeros = PictureGradient::zeros(10, 8);
    let mut cases = Vec::new();
    for (plane, value) in [("color", f32::NAN), ("alpha", f32::INFINITY), ("depth", f32::NEG_INFINITY)] {
        let mut gradient = zeros.clone();
        match plane {
            "color" => gradient.color[7][1] = value,
            "alpha" => gradient.alpha[7] = value,
            _ => gradient.depth[7] = value,
        }
        cases.push((gradient, format!("gradient.{plane}[7]: {value}")));
    }
    cases.push((PictureGradient::zeros(8, 10), "gradient.size: 8x10".to_owned()));
    cases.push((PictureGradient { alpha: vec![0.0; 79], ..zeros }, "gradient.alpha: 79 entries".to_owned()));
    for (gradient, expected) in cases {
        for renderer in renderers().iter().map(|r| &*r.1).chain([&Reference as &dyn Differentiable]) {
            let error = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap_err().to_string();
            assert!(error.starts_with(&expected), "{error}");
        }
        let error = CpuRenderer::new()
            .render_with_gradients(&gaussians, &camera, &options, |_| Ok(gradient))
            .unwrap_err();
        assert!(error.to_string().starts_with(&expected), "{error}");
    }
}

#[test]
fn an_error_of_the_loss_is_returned_and_the_renderer_still_works() {
    let camera = looking_at_origin(10, 8, DVec3::X, 5.0);
    let (options, gaussians) = (RenderOptions::default(), random(2, 3, 0, [0.1, 0.2]));
    let renderer = CpuRenderer::new();
    let refused = renderer.render_with_gradients(&gaussians, &camera, &options, |_| {
        Err(vg_geometry::Error::argument("target", "9x8", "10x8"))
    });
    assert!(refused.unwrap_err().to_string().starts_with("target: 9x8"));
    let gradient = noise(1, &camera);
    assert!(renderer.backward(&gaussians, &camera, &options, &gradient).is_ok());
}

#[test]
fn a_hundred_thousand_nearly_transparent_layers_agree_with_the_reference() {
    // Just above 1/255 each, so that every pixel is finished after 2,300 of them, in several tiles.
    let n = 100_000;
    let mut r = Random::new(4);
    let means = (0..n).map(|i| [0.01 * r.normal() as f32, 0.01 * r.normal() as f32, 5.0 + i as f32 * 1e-4]);
    let sh = (0..3 * n).map(|i| ((i * 7919) % 1000) as f32 / 500.0 - 1.0).collect();
    let opacities = (0..n).map(|i| (1.002 + (i % 10) as f32 * 1e-3) / 255.0).collect();
    let unit = [1.0, 0.0, 0.0, 0.0];
    let gaussians =
        Gaussians::from_arrays(0, means.collect(), vec![unit; n], vec![[90.0; 3]; n], opacities, sh).unwrap();
    let intrinsics = Intrinsics { fx: 40.0, fy: 40.0, cx: 35.0, cy: 9.0 };
    let camera = Camera::pinhole(70, 18, intrinsics, Pose::IDENTITY).unwrap();
    let options = RenderOptions::default();
    let gradient = noise(6, &camera);
    let p = Parameters::new(&gaussians, &camera, &options).unwrap();
    let deepest = Reference.cuts(&p, &options).depth_complexity().max().unwrap();
    assert!((2_000..2_345).contains(&deepest), "{deepest} layers");
    let exact = Reference.backward_f64(&gaussians, &camera, &options, &gradient).unwrap();
    for (level, renderer) in renderers() {
        let found = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
        for (name, found, exact) in tensors(&found, &exact, &camera) {
            let error = largest(&found.iter().zip(&exact).map(|(a, b)| a - b).collect::<Vec<f64>>());
            println!("{level:8} {name:12} {error:.1e} of {:.1e}", largest(&exact));
            assert!(error <= 1e-3 * largest(&exact), "{level} {name}: {error:e} of {:e}", largest(&exact));
        }
    }
}

#[test]
fn extreme_numbers_give_finite_gradients() {
    let camera = looking_at_origin(30, 20, DVec3::X, 5.0);
    let mut r = Random::new(3);
    let (mut means, mut scales, mut opacities, mut sh) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for i in 0..400 {
        let spread = [0.5, 1e6, 1e20, f32::MAX][i % 4];
        means.push([0; 3].map(|_| spread * r.uniform(-1.0, 1.0) as f32));
        scales.push([0; 3].map(|_| [f32::MIN_POSITIVE, 1e-10, 1e-3, 1.0, 1e9][r.uniform(0.0, 5.0) as usize]));
        opacities.push([0.0, 1.0 / 255.0, 0.5, 1.0][r.uniform(0.0, 4.0) as usize]);
        // The largest values are clamped at 1e30, where they have no gradient.
        let bright = [1.0, 1e6, 1e29, f32::MAX][i / 4 % 4];
        sh.extend((0..48).map(|_| bright * r.uniform(-0.5, 1.0) as f32));
    }
    let rotations = (0..400).map(|_| [0; 4].map(|_| r.normal() as f32)).collect();
    let gaussians = Gaussians::from_arrays(3, means, rotations, scales, opacities, sh).unwrap();
    let mut narrow = camera;
    narrow.intrinsics.fx = 1e9;
    let renderers = renderers();
    for camera in [camera, narrow] {
        for magnitude in [1e-38, 1.0, f32::MAX] {
            for antialiased in [false, true] {
                let options = RenderOptions { antialiased, ..RenderOptions::default() };
                let mut gradient = noise(8, &camera);
                for plane in [gradient.color.as_flattened_mut(), &mut gradient.alpha, &mut gradient.depth] {
                    plane.iter_mut().for_each(|v| *v = v.signum() * magnitude);
                }
                for (level, renderer) in &renderers {
                    let g = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
                    assert!(all_finite(&g), "{level}: {magnitude:e}, antialiased {antialiased}");
                    assert!(g.sh.iter().any(|&v| v != 0.0), "{level}: {magnitude:e}");
                }
            }
        }
    }
}

/// Compares the fast renderer's gradients through a lens with differences of its own pictures.
#[test]
fn gradients_through_a_lens_equal_central_differences_of_the_pictures() {
    let mut camera = looking_at_origin(60, 44, DVec3::new(0.4, -1.0, 0.3), 6.0);
    camera.distortion = Distortion::Brown { k: [-0.1, 0.03, 0.0, 0.0, 0.0, 0.0], p: [0.01, -0.02] };
    // One Gaussian, smooth enough for f32 differences: only its faint rim is cut.
    let at = |z: f32| {
        let sh = vec![0.4, -0.2, 0.9];
        let unit = vec![[0.9, 0.1, 0.4, 0.2]];
        Gaussians::from_arrays(0, vec![[0.2, 0.1, z]], unit, vec![[0.3, 0.5, 0.4]], vec![0.8], sh).unwrap()
    };
    for depth_mode in [DepthMode::Accumulated, DepthMode::Expected] {
        let options = RenderOptions { depth_mode, ..RenderOptions::default() };
        for (level, renderer) in renderers() {
            // Smooth weights that are zero at the rim.
            let weigh = |p: &Rendered| {
                let mut g = PictureGradient::zeros(p.width, p.height);
                for (i, &a) in p.alpha.iter().enumerate() {
                    let w = if a > 0.1 { ((i % 60) as f32 * 0.2).sin() } else { 0.0 };
                    (g.color[i], g.alpha[i], g.depth[i]) = ([w, 0.5 * w, -w], w, 0.3 * w);
                }
                g
            };
            let weights = weigh(&renderer.render(&at(0.1), &camera, &options).unwrap());
            let loss = |z: f32| {
                let p = renderer.render(&at(z), &camera, &options).unwrap();
                let dot = |a: &[f32], b: &[f32]| {
                    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>()
                };
                dot(p.color.as_flattened(), weights.color.as_flattened())
                    + dot(&p.alpha, &weights.alpha)
                    + dot(&p.depth, &weights.depth)
            };
            let h = 0.004;
            let difference = (loss(0.1 + h) - loss(0.1 - h)) / f64::from((0.1 + h) - (0.1 - h));
            let g = renderer.backward(&at(0.1), &camera, &options, &weights).unwrap();
            let found = f64::from(g.means[0][2]);
            println!("{level} {depth_mode:?}: {found} against {difference}");
            assert!((found - difference).abs() < 2e-3 * difference.abs().max(1.0), "{found} {difference}");
            let by_reference = Reference.backward(&at(0.1), &camera, &options, &weights).unwrap();
            assert!((g.means[0][2] - by_reference.means[0][2]).abs() < 1e-3 * by_reference.means[0][2].abs());
        }
    }
}

#[test]
fn the_pose_gradient_is_the_slope_along_its_motion() {
    let Stiff { gaussians, camera, options, gradient } = stiff(12);
    let g = CpuRenderer::new().backward(&gaussians, &camera, &options, &gradient).unwrap();
    let p = |camera: &Camera| Reference.render_f64(&gaussians, camera, &options).unwrap();
    let h = 1e-6;
    for axis in 0..6 {
        let step = |sign: f64| {
            let mut six = [0.0; 6];
            six[axis] = sign * h;
            let (turn, shift) = (DVec3::from_slice(&six[..3]), DVec3::from_slice(&six[3..]));
            let pose = vg_splat::render::PoseGradient::moved(&camera.vehicle_from_camera, turn, shift);
            p(&Camera { vehicle_from_camera: pose, ..camera })
        };
        let slope = loss_between(&step(1.0), &step(-1.0), &gradient) / (2.0 * h);
        let found = [g.pose.rotation.to_array(), g.pose.translation.to_array()].concat()[axis];
        assert!((found - slope).abs() < 1e-3 * slope.abs().max(10.0), "axis {axis}: {found} and {slope}");
    }
}
