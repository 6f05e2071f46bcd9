//! The fast renderers, including the GPU renderer where it is built, compared with the f64 reference and their own
//! symmetries, and on difficult input.

use glam::{DMat3, DVec3};
use vg_geometry::camera::Intrinsics;
use vg_geometry::{Camera, Distortion, Pose};
use vg_splat::Gaussians;
use vg_splat::render::{
    Background, CpuRenderer, DepthMode, Differentiable, PictureGradient, Reference, RenderOptions, Rendered,
    Renderer,
};
use vg_testing::renderers::renderers;
use vg_testing::scenes::{looking_at_origin, random};
use vg_testing::{Random, compare, gradients, is_finite};

const UNIT: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

fn options() -> RenderOptions {
    RenderOptions { background: Background::Color([0.1, 0.2, 0.3]), ..RenderOptions::default() }
}

/// One grey Gaussian of degree 0.
fn one(mean: [f32; 3], rotation: [f32; 4], scale: [f32; 3], opacity: f32) -> Gaussians {
    Gaussians::from_arrays(0, vec![mean], vec![rotation], vec![scale], vec![opacity], vec![0.3, 0.0, -0.3])
        .unwrap()
}

/// A camera at the origin that looks along +x of the vehicle, z up.
fn forward(width: u32, height: u32, focal: f64) -> Camera {
    let rotation = DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_Z, DVec3::X);
    let (cx, cy) = (0.5 * f64::from(width), 0.5 * f64::from(height));
    let intrinsics = Intrinsics { fx: focal, fy: focal, cx, cy };
    Camera::pinhole(width, height, intrinsics, Pose { rotation, translation: DVec3::ZERO }).unwrap()
}

/// Asserts that colour, alpha and depth agree to `mean` on average and `max` anywhere.
fn assert_close(name: &str, a: &Rendered, b: &Rendered, mean: f64, max: f64) {
    for (plane, d) in ["colour", "alpha", "depth"].into_iter().zip(compare(a, b)) {
        println!("{name:40} {plane:7} mean {:.1e}, 99.9 % {:.1e}, max {:.1e}", d.mean, d.p999, d.max);
        assert!(d.mean <= mean && d.max <= max, "{name}: {plane} {d:?}");
    }
}

/// Runs a test on every fast renderer; of the CPU's kernels, on the one that it would choose.
fn each(test: impl Fn(&dyn Differentiable)) {
    for (name, renderer) in renderers().into_iter().filter(|r| r.0 != "portable") {
        println!("{name}");
        test(&*renderer);
    }
}

/// `(name, Gaussians, camera)`; the reference draws each in a second.
fn scenes() -> Vec<(&'static str, Gaussians, Camera)> {
    let side = looking_at_origin(203, 117, DVec3::new(0.4, -1.0, 0.3), 7.0);
    let mut off_center = side;
    off_center.intrinsics.cx = 40.0;
    off_center.intrinsics.cy = 90.5;
    let near = looking_at_origin(160, 120, DVec3::new(1.0, 0.2, 0.1), 1.5);
    vec![
        ("surfels of 2 cm", random(1, 3000, 3, [0.005, 0.02]), side),
        ("blobs of 30 cm", random(2, 300, 2, [0.02, 0.3]), side),
        ("needles, axis ratio up to 1e6", random(3, 300, 1, [1e-6, 1.0]), side),
        ("principal point off centre", random(4, 1000, 3, [0.005, 0.1]), off_center),
        ("camera among the Gaussians", random(5, 1000, 3, [0.005, 0.1]), near),
        ("one pixel", random(6, 500, 3, [0.01, 0.1]), looking_at_origin(1, 1, DVec3::X, 7.0)),
        ("one column", random(7, 500, 3, [0.01, 0.1]), looking_at_origin(1, 300, DVec3::X, 7.0)),
        ("one row", random(7, 500, 3, [0.01, 0.1]), looking_at_origin(300, 1, DVec3::X, 7.0)),
        ("no Gaussians", Gaussians::default(), side),
    ]
}

#[test]
fn the_fast_renderer_agrees_with_the_reference_on_random_and_stiff_scenes() {
    each(|renderer| {
        // f32 in the blend, on colours of about 1 and depths of about 7 m. A pixel on the 1/255 cut or on the stop at
        // 1e-4 may flip; these scenes have none.
        for (name, gaussians, camera) in scenes() {
            for antialiased in [false, true] {
                let options = RenderOptions { antialiased, depth_mode: DepthMode::Accumulated, ..options() };
                let found = renderer.render(&gaussians, &camera, &options).unwrap();
                let exact = Reference.render(&gaussians, &camera, &options).unwrap();
                assert_close(name, &found, &exact, 2e-6, 5e-5);
            }
        }
    });
}

#[test]
fn every_sh_degree_cap_and_option_agrees_with_the_reference() {
    each(|renderer| {
        let gaussians = random(8, 1500, 3, [0.005, 0.1]);
        let camera = looking_at_origin(120, 90, DVec3::new(-1.0, 0.7, 0.4), 6.0);
        let variants = [
            RenderOptions { sh_degree: 0, ..options() },
            RenderOptions { sh_degree: 1, ..options() },
            RenderOptions { sh_degree: 2, ..options() },
            RenderOptions { sh_degree: 9, ..options() },
            RenderOptions { blur: 0.1, max_alpha: 0.999, ..options() },
            RenderOptions { background: Background::Transparent, ..options() },
            RenderOptions { near: 5.5, far: 6.5, ..options() },
        ];
        for options in variants {
            let found = renderer.render(&gaussians, &camera, &options).unwrap();
            let exact = Reference.render(&gaussians, &camera, &options).unwrap();
            // Expected depth is a mean of depths, whatever the rounding.
            assert_close(&format!("{options:?}")[..40], &found, &exact, 1e-5, 5e-5);
        }
    });
}

#[test]
fn one_two_and_five_threads_draw_the_same_bytes() {
    let gaussians = random(9, 20_000, 3, [0.005, 0.05]);
    let camera = looking_at_origin(333, 217, DVec3::new(1.0, 1.0, 0.5), 7.0);
    let renderer = CpuRenderer::new();
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| renderer.render(&gaussians, &camera, &options()).unwrap())
    };
    let expected = draw(1);
    for threads in [2, 5] {
        assert!(draw(threads) == expected, "{threads} threads");
    }
}

#[test]
fn a_reused_renderer_draws_the_picture_of_a_new_one() {
    let reused = CpuRenderer::new();
    for (name, gaussians, camera) in scenes() {
        let found = reused.render(&gaussians, &camera, &options()).unwrap();
        assert!(found == CpuRenderer::new().render(&gaussians, &camera, &options()).unwrap(), "{name}");
    }
}

#[test]
fn threads_may_share_a_renderer() {
    let renderer = &CpuRenderer::new();
    let scenes = scenes();
    std::thread::scope(|scope| {
        for (name, gaussians, camera) in &scenes {
            scope.spawn(move || {
                let found = renderer.render(gaussians, camera, &options()).unwrap();
                let expected = CpuRenderer::new().render(gaussians, camera, &options()).unwrap();
                assert!(found == expected, "{name}");
            });
        }
    });
}

#[test]
fn portable_code_draws_the_picture_of_vector_code() {
    for (name, gaussians, camera) in scenes() {
        let vector = CpuRenderer::new().render(&gaussians, &camera, &options()).unwrap();
        let portable = CpuRenderer::portable().render(&gaussians, &camera, &options()).unwrap();
        // Without fused multiply-add; a pixel on a threshold may flip by 1/255.
        assert_close(name, &portable, &vector, 1e-5, 3e-2);
    }
}

#[test]
fn the_mirrored_vehicle_from_the_mirrored_camera_gives_the_flipped_picture() {
    each(|renderer| {
        let gaussians = random(10, 5000, 3, [0.005, 0.08]);
        let mut camera = looking_at_origin(150, 100, DVec3::new(0.6, -1.0, 0.4), 6.0);
        camera.intrinsics.cx = 70.0;
        let mut mirrored = camera;
        mirrored.vehicle_from_camera = camera.vehicle_from_camera.mirrored();
        mirrored.intrinsics.cx = 150.0 - 70.0;
        let picture = renderer.render(&gaussians, &camera, &options()).unwrap();
        let mut flipped = renderer.render(&gaussians.mirrored(), &mirrored, &options()).unwrap();
        for row in 0..100 {
            let range = row * 150..(row + 1) * 150;
            flipped.color[range.clone()].reverse();
            flipped.alpha[range.clone()].reverse();
            flipped.depth[range].reverse();
        }
        let [color, alpha, depth] = compare(&flipped, &picture);
        assert!(color.max <= 1e-5 && alpha.max <= 1e-5 && depth.max <= 1e-4, "{color:?} {alpha:?} {depth:?}");
    });
}

#[test]
fn a_camera_a_million_metres_away_gives_the_picture_of_a_near_one() {
    each(|renderer| {
        // 1 m is a whole number of f32 steps at 2^20 m, so the moved Gaussians are the same ones.
        let mut gaussians = random(11, 300, 0, [0.01, 0.1]);
        let offset = DVec3::new(1_048_576.0, -1_048_576.0, 0.0);
        let snapped = |v: f32| (v * 8.0).round() / 8.0;
        let build = |means: Vec<[f32; 3]>, g: &Gaussians| {
            let (r, s) = (g.rotations().to_vec(), g.scales().to_vec());
            Gaussians::from_arrays(0, means, r, s, g.opacities().to_vec(), g.sh().to_vec()).unwrap()
        };
        let means: Vec<[f32; 3]> = gaussians.means().iter().map(|m| m.map(snapped)).collect();
        gaussians = build(means.clone(), &gaussians);
        let moved = means.iter().map(|m| [m[0] + offset.x as f32, m[1] + offset.y as f32, m[2]]).collect();
        let moved = build(moved, &gaussians);
        let camera = looking_at_origin(200, 150, DVec3::new(0.3, 1.0, 0.2), 7.0);
        let mut far = camera;
        far.vehicle_from_camera.translation += offset;
        let expected = renderer.render(&gaussians, &camera, &options()).unwrap();
        assert_close("1e6 m", &renderer.render(&moved, &far, &options()).unwrap(), &expected, 1e-7, 1e-5);

        // From 1e6 m through a telescope, nothing of the size of the vehicle is lost to f32.
        let telescope = looking_at_origin(100, 100, DVec3::new(0.3, 1.0, 0.2), 1e6);
        let telescope =
            Camera { intrinsics: Intrinsics { fx: 1.5e7, fy: 1.5e7, ..telescope.intrinsics }, ..telescope };
        let options = RenderOptions { depth_mode: DepthMode::Accumulated, ..options() };
        let found = renderer.render(&gaussians, &telescope, &options).unwrap();
        let exact = Reference.render(&gaussians, &telescope, &options).unwrap();
        let [color, alpha, _] = compare(&found, &exact);
        assert!(
            exact.alpha.iter().any(|&a| a > 0.5) && color.max < 1e-4 && alpha.max < 1e-4,
            "{color:?} {alpha:?}"
        );
    });
}

#[test]
fn a_needle_of_ten_thousand_pixels_keeps_its_edge() {
    each(|renderer| {
        // Half a pixel thick, 1e4 pixels long, at every angle, its centre in and out of the picture.
        let camera = forward(512, 384, 1000.0);
        let options = RenderOptions { depth_mode: DepthMode::Accumulated, ..options() };
        let mut worst = 0.0f64;
        for i in 0..24 {
            let angle = 0.13 + f64::from(i) * 0.131;
            let rotation = [(angle / 2.0).cos() as f32, (angle / 2.0).sin() as f32, 0.0, 0.0];
            for center in [[5.0, 0.3, 0.2], [5.0, 4.0, -3.0]] {
                let needle = one(center, rotation, [1e-4, 15.0, 1e-4], 0.9);
                let found = renderer.render(&needle, &camera, &options).unwrap();
                let exact = Reference.render(&needle, &camera, &options).unwrap();
                let [_, alpha, _] = compare(&found, &exact);
                // A pixel may lie on the 1/255 cut; otherwise 1e-4 pixels across the edge.
                assert!(alpha.p999 < 1e-4 && alpha.max < 5e-3, "angle {angle}: {alpha:?}");
                worst = worst.max(alpha.max);
            }
        }
        println!("largest error of alpha: {worst:.1e}");
    });
}

#[test]
fn expected_depth_is_the_depth_and_accumulated_depth_is_depth_times_alpha() {
    each(|renderer| {
        let g = one([4.0, 0.0, 0.0], UNIT, [0.2; 3], 0.8);
        let camera = forward(64, 48, 60.0);
        let draw = |depth_mode, background| {
            renderer.render(&g, &camera, &RenderOptions { depth_mode, background, ..options() }).unwrap()
        };
        let color = Background::Color([1.0, 0.5, 0.0]);
        let expected = draw(DepthMode::Expected, color);
        let accumulated = draw(DepthMode::Accumulated, color);
        let transparent = draw(DepthMode::Expected, Background::Transparent);
        for i in 0..expected.alpha.len() {
            let alpha = expected.alpha[i];
            if alpha > 0.0 {
                assert!((expected.depth[i] - 4.0).abs() < 1e-4, "{}", expected.depth[i]);
            } else {
                assert_eq!(expected.depth[i], 0.0);
                assert_eq!(expected.color[i], [1.0, 0.5, 0.0]);
                assert_eq!(transparent.color[i], [0.0; 3]);
            }
            assert!((accumulated.depth[i] - expected.depth[i] * alpha).abs() < 1e-5);
            for (c, behind) in [1.0, 0.5, 0.0].into_iter().enumerate() {
                let composited = transparent.color[i][c] + (1.0 - transparent.alpha[i]) * behind;
                assert!((composited - expected.color[i][c]).abs() < 1e-6);
            }
        }
        assert!(expected.alpha.iter().any(|&a| a > 0.7));
    });
}

#[test]
fn only_centres_strictly_between_near_and_far_are_drawn() {
    each(|renderer| {
        let camera = forward(32, 32, 30.0);
        let options = RenderOptions { near: 1.0, far: 3.0, ..options() };
        for (x, drawn) in
            [(-2.0, false), (0.0, false), (1.0, false), (1.001, true), (2.999, true), (3.0, false)]
        {
            let g = one([x, 0.0, 0.0], UNIT, [0.3; 3], 0.9);
            let picture = renderer.render(&g, &camera, &options).unwrap();
            assert_eq!(picture.alpha.iter().any(|&a| a > 0.0), drawn, "centre at {x} m");
        }
    });
}

#[test]
fn equal_depths_are_drawn_in_the_order_of_storage() {
    each(|renderer| {
        // A million on one ray, the first red and opaque: the picture shows the first until it is finished.
        let n = 1_000_000;
        let mut sh = vec![0.0; 3 * n];
        sh[0] = 1.0;
        let g = Gaussians::from_arrays(
            0,
            vec![[3.0, 0.0, 0.0]; n],
            vec![UNIT; n],
            vec![[0.05; 3]; n],
            vec![0.9; n],
            sh,
        );
        let g = g.unwrap();
        let camera = forward(33, 33, 40.0);
        let picture = renderer.render(&g, &camera, &options()).unwrap();
        let center = 16 * 33 + 16;
        // 0.9 + 0.1 * 0.9 + 0.01 * 0.9, then 1e-3 * 0.1 <= 1e-4 stops without the fourth: T = 1e-3.
        let red = 0.5 + vg_splat::gaussians::sh::Y0;
        let expected = 0.9 * red + 0.099 * 0.5 + 1e-3 * 0.1;
        assert!(
            (picture.color[center][0] - expected).abs() < 2e-3,
            "{} {expected}",
            picture.color[center][0]
        );
        assert!(is_finite(&picture));
    });
}

#[test]
fn finite_input_of_any_size_gives_a_finite_picture() {
    each(|renderer| {
        let values = [1.2e-38f32, 1e-20, 1e-8, 1e-3, 1.0, 1e4, 1e9];
        let mut g = [Vec::new(), Vec::new()];
        let (mut rotations, mut opacities, mut sh) = (Vec::new(), Vec::new(), Vec::new());
        let mut i = 0u32;
        for a in values {
            for b in values {
                for (c, x) in
                    [(a, 0.0), (b, 1e-6), (1e-3, 0.011), (1e9, 1.0), (1.2e-38, 1e3), (1.0, 1e9), (1.0, 3e38)]
                {
                    i += 1;
                    let t = i as f32;
                    g[0].push([x, x * t.sin(), x * t.cos()]);
                    g[1].push([a, b, c]);
                    rotations.push([t.sin(), (2.0 * t).cos(), (3.0 * t).sin(), 0.3]);
                    opacities.push([0.0, 1.0, 0.0039, 0.5, 1e-30][i as usize % 5]);
                    sh.extend((0..48).map(|k| [1e6, -1e6, 1e-30, 0.3, f32::MAX][(i as usize + k) % 5]));
                }
            }
        }
        let [means, scales] = g;
        let all = Gaussians::from_arrays(3, means, rotations, scales, opacities, sh).unwrap();
        let sizes = [(1, 1), (70, 50), (8192, 1), (1, 8192)];
        for (width, height) in sizes {
            for focal in [1e-3, 1.0, 50.0, 1e6, 1e9] {
                for (cx, antialiased) in [(0.0, false), (0.5, true), (1e9, false), (-1e9, true)] {
                    let mut camera = forward(width, height, focal);
                    camera.intrinsics.cx = f64::from(width) * cx;
                    camera.intrinsics.cx = camera.intrinsics.cx.clamp(-1e9, 1e9);
                    let options = RenderOptions { near: 1e-6, antialiased, max_alpha: 0.9999, ..options() };
                    let picture = renderer.render(&all, &camera, &options).unwrap();
                    assert!(is_finite(&picture), "{width}x{height}, focal length {focal}, cx {cx}");
                }
            }
        }
        // One at a time, because a Gaussian behind an opaque one would not be drawn.
        let camera = forward(40, 30, 30.0);
        for k in 0..all.len() {
            let one = all.filtered(&(0..all.len()).map(|i| i == k).collect::<Vec<bool>>());
            let picture = renderer.render(&one, &camera, &options()).unwrap();
            assert!(is_finite(&picture), "{one:?}");
        }
    });
}

#[test]
fn gaussians_that_cover_a_large_picture_give_an_even_picture() {
    each(|renderer| {
        // 100 splats on 64 x 128 tiles: 0.8 M pairs.
        let n = 100;
        let means = (0..n).map(|i| [5.0 + i as f32, 0.0, 0.0]).collect();
        let g = Gaussians::from_arrays(
            0,
            means,
            vec![UNIT; n],
            vec![[1e4; 3]; n],
            vec![0.05; n],
            vec![0.5; 3 * n],
        );
        let picture = renderer.render(&g.unwrap(), &forward(4096, 2048, 2000.0), &options()).unwrap();
        let expected = 1.0 - 0.95f32.powi(n as i32);
        assert!(picture.alpha.iter().all(|a| (a - expected).abs() < 1e-4));
    });
}

#[test]
fn a_hundred_thousand_walls_cost_as_much_as_the_first_few() {
    each(|renderer| {
        // 100,000 splats on 64 x 256 tiles would be 1.6e9 pairs; the first slice finishes every pixel.
        let n = 100_000;
        let means = (0..n).map(|i| [5.0 + i as f32 * 1e-3, 0.0, 0.0]).collect();
        let g = Gaussians::from_arrays(
            0,
            means,
            vec![UNIT; n],
            vec![[1e5; 3]; n],
            vec![0.9; n],
            vec![0.0; 3 * n],
        );
        let picture = renderer.render(&g.unwrap(), &forward(4096, 4096, 4000.0), &options()).unwrap();
        assert!(picture.alpha.iter().all(|a| *a > 0.99));
    });
}

/// Windows of the largest picture: [left, top] of 64x48 pixels.
const WINDOWS: [[u32; 2]; 3] = [[0, 0], [4064, 4072], [8128, 8144]];

/// Gaussians of about four pixels in each of these windows, for a camera at the origin with this focal length.
fn in_windows(focal: f64) -> Gaussians {
    let mut r = Random::new(12);
    let n = 120;
    let mean = |i: usize| {
        let [left, top] = WINDOWS[i % 3].map(f64::from);
        let (u, v, d) = (left + r.uniform(2.0, 62.0), top + r.uniform(2.0, 46.0), r.uniform(3.0, 5.0));
        [d, (4096.0 - u) / focal * d, (4096.0 - v) / focal * d].map(|v| v as f32)
    };
    let means = (0..n).map(mean).collect();
    let rotations = (0..n).map(|_| [0; 4].map(|_| r.normal() as f32)).collect();
    let scales = (0..n).map(|_| [0; 3].map(|_| (4.0 / focal * r.uniform(1.0, 8.0)) as f32)).collect();
    let opacities = (0..n).map(|_| r.uniform(0.1, 1.0) as f32).collect();
    let sh = (0..3 * n).map(|_| r.normal() as f32).collect();
    Gaussians::from_arrays(0, means, rotations, scales, opacities, sh).unwrap()
}

#[test]
fn the_largest_picture_and_its_gradients_equal_those_of_its_windows() {
    each(|renderer| {
        const SIDE: usize = 8192;
        let focal = 6000.0;
        let camera = forward(SIDE as u32, SIDE as u32, focal);
        let g = in_windows(focal);
        let window = |[left, top]: [u32; 2]| {
            let mut window = forward(64, 48, focal);
            (window.intrinsics.cx, window.intrinsics.cy) =
                (4096.0 - f64::from(left), 4096.0 - f64::from(top));
            window
        };
        let pixel = |[left, top]: [u32; 2], i: usize| (top as usize + i / 64) * SIDE + left as usize + i % 64;
        let weights: Vec<Vec<[f32; 3]>> =
            (0..3).map(|seed| gradients::noise(seed, &window([0, 0])).color).collect();

        let (mut picture, mut of_picture, mut found) = Default::default();
        let mut loss = |_: &Rendered, gradient: &mut PictureGradient| {
            let of_color = gradient.color_mut();
            for (at, weights) in WINDOWS.into_iter().zip(&weights) {
                weights.iter().enumerate().for_each(|(i, w)| of_color[pixel(at, i)] = *w);
            }
            Ok(())
        };
        let targets = (&mut picture, &mut of_picture, &mut found);
        renderer.forward_backward(&g, &camera, &options(), targets, &mut loss).unwrap();
        drop(of_picture);
        let mut expected: Option<Vec<Vec<f64>>> = None;
        for (at, weights) in WINDOWS.into_iter().zip(weights) {
            let camera = window(at);
            let alone = Reference.render(&g, &camera, &options()).unwrap();
            let cut = |i: usize| {
                let i = pixel(at, i);
                (picture.color[i], picture.alpha[i], picture.depth[i])
            };
            let cut: Vec<_> = (0..64 * 48).map(cut).collect();
            let cut = Rendered {
                width: 64,
                height: 48,
                color: cut.iter().map(|c| c.0).collect(),
                alpha: cut.iter().map(|c| c.1).collect(),
                depth: cut.iter().map(|c| c.2).collect(),
            };
            assert!(cut.alpha.iter().filter(|a| **a > 0.5).count() > 500, "{at:?}");
            assert_close(&format!("window at {at:?}"), &cut, &alone, 1e-6, 2e-5);
            let gradient =
                PictureGradient { width: 64, height: 48, color: weights, ..PictureGradient::default() };
            let part = Reference.backward_f64(&g, &camera, &options(), &gradient).unwrap();
            let part: Vec<Vec<f64>> =
                gradients::tensors(&found, &part, &camera).into_iter().take(5).map(|t| t.2).collect();
            let sum = expected.get_or_insert_with(|| part.iter().map(|t| vec![0.0; t.len()]).collect());
            for (sum, part) in sum.iter_mut().flatten().zip(part.into_iter().flatten()) {
                *sum += part;
            }
        }
        let arrays =
            [found.means.as_flattened(), found.rotations.as_flattened(), found.scales.as_flattened()];
        for (found, expected) in
            arrays.into_iter().chain([&*found.opacities, &found.sh]).zip(expected.unwrap())
        {
            let largest = gradients::largest(&expected);
            let error =
                found.iter().zip(&expected).map(|(f, e)| (f64::from(*f) - e).abs()).fold(0.0, f64::max);
            println!("gradient: {:.1e} of the largest, {largest:.1e}", error / largest);
            assert!(error <= 1e-4 * largest, "{error} of {largest}");
        }
    });
}

/// One lens of every model, strong enough to shift pixels by several.
fn lenses() -> Vec<(&'static str, Distortion)> {
    let brown = |k: [f64; 6], p: [f64; 2]| Distortion::Brown { k, p };
    vec![
        ("SIMPLE_RADIAL", brown([-0.15, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2])),
        ("RADIAL", brown([0.1, 0.05, 0.0, 0.0, 0.0, 0.0], [0.0; 2])),
        ("OPENCV", brown([-0.1, 0.03, 0.0, 0.0, 0.0, 0.0], [0.01, -0.02])),
        ("OPENCV_FISHEYE", Distortion::Fisheye { k: [0.05, -0.01, 0.002, 0.0] }),
        ("FULL_OPENCV", brown([0.2, 0.05, 0.01, 0.3, 0.02, 0.0], [0.002, 0.001])),
    ]
}

#[test]
fn through_every_lens_a_small_gaussian_is_drawn_where_the_camera_projects_it() {
    each(|renderer| {
        for (name, distortion) in lenses() {
            let camera = Camera { distortion, ..forward(320, 240, 200.0) };
            for (y, z) in [(0.0, 0.0), (1.2, 0.7), (-1.7, -1.1), (2.0, -0.9)] {
                let g = one([3.0, y, z], UNIT, [0.01; 3], 0.95);
                let transparent = RenderOptions { background: Background::Transparent, ..options() };
                let picture = renderer.render(&g, &camera, &transparent).unwrap();
                let point =
                    camera.vehicle_from_camera.inverse().transform_point(DVec3::new(3.0, y.into(), z.into()));
                let expected = camera.project(point).unwrap();
                let (mut sum, mut centroid) = (0.0, [0.0; 2]);
                for (i, &alpha) in picture.alpha.iter().enumerate() {
                    let a = f64::from(alpha);
                    sum += a;
                    centroid[0] += a * ((i % 320) as f64 + 0.5);
                    centroid[1] += a * ((i / 320) as f64 + 0.5);
                    if alpha > 0.0 {
                        assert!((picture.depth[i] - 3.0).abs() < 1e-3, "{name}: depth {}", picture.depth[i]);
                    }
                }
                let error = [centroid[0] / sum - expected[0], centroid[1] / sum - expected[1]];
                assert!(
                    sum > 1.0 && error[0].hypot(error[1]) < 0.1,
                    "{name} ({y}, {z}): {error:?} px, sum {sum}"
                );
            }
        }
    });
}

#[test]
fn a_lens_without_distortion_draws_the_pinhole_picture_up_to_interpolation() {
    each(|renderer| {
        let gaussians = random(13, 2000, 1, [0.02, 0.1]);
        let pinhole = looking_at_origin(200, 150, DVec3::new(0.4, -1.0, 0.3), 7.0);
        // A coefficient of 1e-9 distorts nothing but is treated as a lens.
        let distortion = Distortion::Brown { k: [1e-9, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
        let lens = Camera { distortion, ..pinhole };
        let expected = renderer.render(&gaussians, &pinhole, &options()).unwrap();
        let found = renderer.render(&gaussians, &lens, &options()).unwrap();
        let [color, alpha, _] = compare(&found, &expected);
        assert!(color.mean < 5e-3 && alpha.mean < 2e-3, "{color:?} {alpha:?}");
        let by_reference = Reference.render(&gaussians, &lens, &options()).unwrap();
        let [color, alpha, _] = compare(&found, &by_reference);
        assert!(color.mean < 1e-6 && alpha.mean < 1e-6, "{color:?} {alpha:?}");
    });
}

#[test]
fn pixels_without_a_ray_show_the_background() {
    each(|renderer| {
        // An equidistant fisheye whose corners lie beyond 90 degrees.
        let camera = Camera { distortion: Distortion::Fisheye { k: [0.0; 4] }, ..forward(200, 200, 60.0) };
        let g = one([1.0, 0.0, 0.0], UNIT, [100.0; 3], 0.9);
        let picture = renderer.render(&g, &camera, &options()).unwrap();
        assert!(is_finite(&picture));
        assert_eq!(picture.color[0], [0.1, 0.2, 0.3]);
        assert_eq!(picture.alpha[0], 0.0);
        assert!(picture.alpha[100 * 200 + 100] > 0.8);
    });
}

#[test]
fn invalid_cameras_and_options_are_refused_by_name() {
    let g = Gaussians::default();
    let mut camera = forward(10, 10, 10.0);
    camera.width = 0;
    for renderer in [&CpuRenderer::new() as &dyn Renderer, &Reference] {
        let error = renderer.render(&g, &camera, &options()).unwrap_err().to_string();
        assert!(error.starts_with("camera.size"), "{error}");
        let options = RenderOptions { near: f32::NAN, ..options() };
        let error = renderer.render(&g, &forward(10, 10, 10.0), &options).unwrap_err().to_string();
        assert!(error.starts_with("options.near"), "{error}");
    }
}
