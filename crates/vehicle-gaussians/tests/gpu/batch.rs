//! Pictures of many cameras in one call equal those of single calls, in order, whatever is drawn meanwhile.

use crate::{alone, options};
use glam::DVec3;
use std::sync::Arc;
use vg::error::Error;
use vg::geometry::Distortion;
use vg::render::gpu::Bounds;
use vg::render::{AssetRenderer, Backend, Differentiable, GpuRenderer, Rendered, Rgba8};
use vg::{Camera, Gaussians};
use vg_testing::gpu::renderer;
use vg_testing::gradients::noise;
use vg_testing::scenes::{looking_at_origin, random};

/// Cameras with small and large pictures, near enough that pairs do not fit at first, and one with a lens.
fn cameras() -> Vec<Camera> {
    let from = DVec3::new(0.4, -1.0, 0.3);
    let distortion = Distortion::Brown { k: [-0.1, 0.03, 0.0, 0.0, 0.0, 0.0], p: [0.01, -0.02] };
    let wide = looking_at_origin(200, 150, from, 5.0);
    vec![
        wide,
        looking_at_origin(61, 47, -from, 6.0),
        looking_at_origin(640, 480, from, 1.5),
        Camera { distortion, ..wide },
        looking_at_origin(201, 150, -from, 4.0),
        wide,
    ]
}

fn gaussians() -> Gaussians {
    let mut gaussians = random(10, 4000, 3, [0.005, 0.2]);
    gaussians.append(&random(11, 60, 3, [1.0, 3.0]));
    gaussians
}

#[test]
fn each_picture_equals_that_of_a_single_call_whatever_is_drawn_meanwhile() {
    if renderer().is_none() {
        return;
    }
    let (gaussians, cameras) = (gaussians(), cameras());
    let other = random(4, 300, 0, [0.1, 0.2]);
    let bounded = |change: fn(&mut Bounds)| renderer().unwrap().bounded(change);
    let renderers = [
        ("whole", renderer().unwrap()),
        ("bands", bounded(|b| b.pixels = 200 * 40)),
        ("slices", bounded(|b| b.pairs = 1000)),
        ("chunks", bounded(|b| b.binding = 1 << 18)),
    ];
    let single = renderer().unwrap();
    let asset = single.upload(&gaussians).unwrap();
    let expected: Vec<Rendered> =
        cameras.iter().map(|c| single.render_asset(&asset, c, &options()).unwrap()).collect();
    for (name, gpu) in renderers {
        let asset = gpu.upload(&gaussians).unwrap();
        let small = gpu.upload(&other).unwrap();
        let mut seen = 0;
        let mut picture = Rendered::default();
        gpu.render_each(&asset, &cameras, &options(), &mut picture, |i, picture: &Rendered| {
            assert!((i, picture) == (seen, &expected[i]), "{name}: picture {i}");
            seen += 1;
            if i % 2 == 1 {
                gpu.render_asset(&small, &cameras[0], &options())?;
            } else if i == 2 {
                gpu.backward(&other, &cameras[1], &options(), &noise(3, &cameras[1]))?;
            }
            Ok(())
        })
        .unwrap();
        assert_eq!(seen, cameras.len());

        let mut bytes = Rgba8::default();
        gpu.render_each(&asset, &cameras, &options(), &mut bytes, |i, bytes: &Rgba8| {
            let rgb: Vec<[u8; 3]> = bytes.pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            assert!(rgb == expected[i].to_rgb8(), "{name}: bytes of picture {i}");
            Ok(())
        })
        .unwrap();
    }
}

#[test]
fn batches_single_pictures_and_gradients_of_several_threads_do_not_mix() {
    let Some(gpu) = renderer() else { return };
    let gaussians = [gaussians(), random(5, 700, 1, [0.02, 0.1])];
    let assets = gaussians.each_ref().map(|g| gpu.upload(g).unwrap());
    let cameras = cameras();
    let expected = assets
        .each_ref()
        .map(|a| cameras.iter().map(|c| gpu.render_asset(a, c, &options()).unwrap()).collect::<Vec<_>>());
    let gradient = noise(3, &cameras[0]);
    let back = gpu.backward(&gaussians[0], &cameras[0], &options(), &gradient).unwrap();
    std::thread::scope(|scope| {
        for (asset, expected) in assets.iter().zip(&expected) {
            let (gpu, cameras) = (&gpu, &cameras);
            scope.spawn(move || {
                for _ in 0..2 {
                    let mut picture = Rendered::default();
                    gpu.render_each(asset, cameras, &options(), &mut picture, |i, picture| {
                        assert!(*picture == expected[i], "picture {i}");
                        Ok(())
                    })
                    .unwrap();
                }
            });
        }
        for _ in 0..4 {
            assert!(gpu.render_asset(&assets[1], &cameras[4], &options()).unwrap() == expected[1][4]);
            assert!(gpu.backward(&gaussians[0], &cameras[0], &options(), &gradient).unwrap() == back);
        }
    });
}

#[test]
fn errors_are_returned_after_the_preceding_pictures() {
    let Some(gpu) = renderer() else { return };
    let asset = gpu.upload(&random(5, 700, 1, [0.02, 0.1])).unwrap();
    let mut cameras = cameras();
    let run = |gpu: &GpuRenderer, cameras: &[Camera], fails_at: usize| {
        let mut taken = Vec::new();
        let result = gpu.render_each(&asset, cameras, &options(), &mut Rgba8::default(), |i, _| {
            taken.push(i);
            match i == fails_at {
                true => Err(Error::Cancelled { stage: "take" }),
                false => Ok(()),
            }
        });
        (taken, result.map_err(|e| e.to_string()))
    };
    assert_eq!(run(&gpu, &[], 9), (vec![], Ok(())));
    assert_eq!(run(&gpu, &cameras, 1), (vec![0, 1], Err(Error::Cancelled { stage: "take" }.to_string())));
    cameras[4].intrinsics.fx = f64::NAN;
    let (taken, result) = run(&gpu, &cameras, 9);
    assert!(
        taken == [0, 1, 2, 3] && result.clone().unwrap_err().starts_with("camera"),
        "{taken:?} {result:?}"
    );
    assert_eq!(run(&gpu, &cameras[..4], 9), (vec![0, 1, 2, 3], Ok(())), "the renderer still works");
}

#[test]
fn the_cpu_draws_the_remaining_pictures_if_the_device_is_lost_between_two() {
    if renderer().is_none() {
        return;
    }
    let _alone = alone();
    let gaussians = Arc::new(random(14, 300, 1, [0.01, 0.1]));
    let cameras = cameras();
    let cpu = AssetRenderer::new(Arc::clone(&gaussians), Backend::Cpu).unwrap();
    for lenient in [false, true] {
        let ready = AssetRenderer::new(Arc::clone(&gaussians), Backend::Gpu).unwrap();
        let ready = if lenient { ready.falling_back() } else { ready };
        let device = ready.gpu().unwrap();
        let mut taken = Vec::new();
        let result = ready.render_each(&cameras, &options(), &mut Rendered::default(), |i, picture| {
            taken.push(i);
            if i == 2 {
                device.lose_device();
            }
            let by_cpu = cpu.render(&cameras[i], &options())?;
            assert!(i < 3 || *picture == by_cpu, "picture {i}");
            Ok(())
        });
        if lenient {
            assert!(result.is_ok() && ready.choice().backend == Backend::Cpu, "{result:?}");
            assert_eq!(taken, [0, 1, 2, 3, 4, 5]);
        } else {
            assert!(result.unwrap_err().to_string().contains("was lost"));
            assert_eq!(taken, [0, 1, 2]);
        }
    }
}
