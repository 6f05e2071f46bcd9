//! The backward pass through the C functions gives the bytes of the Rust library.

use std::ptr::null_mut;
use vg::gaussians::Gaussians;
use vg::geometry::{CameraModel, Pose};
use vg::render::{
    Background, CpuRenderer, DepthMode, Differentiable, Gradients, PictureGradient, RenderOptions, Renderer,
};
use vg_face::capi::*;

const SIZE: [u32; 2] = [40, 30];
const COUNT: usize = 60;

/// Pseudo-random numbers from 0 to 1.
fn numbers(n: usize, seed: usize) -> impl Iterator<Item = f32> {
    (0..n).map(move |i| ((i * 7919 + seed * 104_729) % 10_007) as f32 / 10_007.0)
}

fn rows<const N: usize>(seed: usize, of: impl Fn(f32) -> f32) -> Vec<[f32; N]> {
    let values: Vec<f32> = numbers(COUNT * N, seed).map(of).collect();
    values.as_chunks::<N>().0.to_vec()
}

struct Arrays {
    means: Vec<[f32; 3]>,
    scales: Vec<[f32; 3]>,
    /// Quaternions of any norm.
    rotations: Vec<[f32; 4]>,
    opacities: Vec<f32>,
    sh: Vec<f32>,
}

/// Results from C: arrays, then the planes of the picture.
struct Found {
    gradients: Gradients,
    view_matrix: [[f64; 4]; 4],
    pose: [f64; 6],
    alpha: Vec<f32>,
    depth: Vec<f32>,
}

/// A camera 3 metres behind the Gaussians.
fn camera(model: CameraModel) -> vg::Camera {
    let mut params = vec![40.0, 41.0, 19.0, 16.0];
    if model == CameraModel::OpenCv {
        params.extend([-0.1, 0.02, 1e-3, -2e-3]);
    }
    let pose = Pose::from_row_major("pose", &[1.0, 0.0, 0.0, 0.1, 0.0, 1.0, 0.0, -0.1, 0.0, 0.0, 1.0, -3.0]);
    vg::Camera::from_colmap("camera", model, SIZE[0], SIZE[1], &params, pose.unwrap()).unwrap()
}

fn c_camera(camera: &vg::Camera, model: CameraModel) -> vg_camera {
    let mut made: vg_camera = unsafe { std::mem::zeroed() };
    unsafe { vg_camera_init(&raw mut made, size_of::<vg_camera>()) };
    let i = camera.intrinsics;
    (made.width, made.height, made.model) = (camera.width, camera.height, model as i32);
    made.params[..4].copy_from_slice(&[i.fx, i.fy, i.cx, i.cy]);
    if model == CameraModel::OpenCv {
        made.params[4..8].copy_from_slice(&[-0.1, 0.02, 1e-3, -2e-3]);
    }
    made.vehicle_from_camera = camera.vehicle_from_camera.to_row_major();
    made
}

unsafe fn through_c(
    arrays: &Arrays,
    camera: &vg_camera,
    options: &vg_render_options,
    gradient: &PictureGradient,
    has_picture: bool,
) -> Found {
    let mut found = Found {
        gradients: Gradients {
            means: vec![[0.0; 3]; COUNT],
            scales: vec![[0.0; 3]; COUNT],
            rotations: vec![[0.0; 4]; COUNT],
            opacities: vec![0.0; COUNT],
            sh: vec![0.0; COUNT * 27],
            ..Gradients::default()
        },
        view_matrix: [[0.0; 4]; 4],
        pose: [0.0; 6],
        alpha: vec![0.0; gradient.alpha.len()],
        depth: vec![0.0; gradient.depth.len()],
    };
    unsafe {
        let mut lent: vg_gaussian_arrays = std::mem::zeroed();
        vg_gaussian_arrays_init(&raw mut lent, size_of_val(&lent));
        (lent.count, lent.sh_degree) = (COUNT, 2);
        lent.positions = arrays.means.as_ptr().cast();
        lent.scales = arrays.scales.as_ptr().cast();
        lent.rotations = arrays.rotations.as_ptr().cast();
        lent.opacities = arrays.opacities.as_ptr();
        lent.sh = arrays.sh.as_ptr();
        let mut car = null_mut();
        assert_eq!(vg_gaussians_from_arrays(&raw const lent, &raw mut car, null_mut()), vg_status::Ok);

        let mut planes: vg_image_gradient = std::mem::zeroed();
        vg_image_gradient_init(&raw mut planes, size_of_val(&planes));
        [planes.width, planes.height] = SIZE;
        planes.color = gradient.color.as_ptr().cast();
        planes.alpha = gradient.alpha.as_ptr().cast();
        planes.depth = gradient.depth.as_ptr().cast();

        let mut out: vg_gradients = std::mem::zeroed();
        vg_gradients_init(&raw mut out, size_of_val(&out));
        let g = &mut found.gradients;
        (out.count, out.sh_degree) = (COUNT, 2);
        out.positions = g.means.as_mut_ptr().cast();
        out.scales = g.scales.as_mut_ptr().cast();
        out.rotations = g.rotations.as_mut_ptr().cast();
        out.opacities = g.opacities.as_mut_ptr();
        out.sh = g.sh.as_mut_ptr();
        out.background = g.background.as_mut_ptr();
        out.pose = found.pose.as_mut_ptr();
        out.view_matrix = found.view_matrix.as_mut_ptr().cast();

        let mut target: vg_image_target = std::mem::zeroed();
        vg_image_target_init(&raw mut target, size_of_val(&target));
        [target.width, target.height] = SIZE;
        target.alpha = found.alpha.as_mut_ptr().cast();
        target.depth = found.depth.as_mut_ptr().cast();
        let target = if has_picture { &raw const target } else { std::ptr::null() };
        let done =
            vg_render_backward(car, camera, options, target, &raw const planes, &raw const out, null_mut());
        assert_eq!(done, vg_status::Ok);
        vg_gaussians_free(car);
    }
    found
}

#[test]
fn gradients_through_c_equal_those_of_rust_byte_for_byte() {
    let arrays = Arrays {
        means: rows(1, |v| 2.0 * v - 1.0),
        scales: rows(2, |v| 0.02 + 0.3 * v),
        rotations: rows(3, |v| 6.0 * v - 2.9),
        opacities: numbers(COUNT, 4).collect(),
        sh: numbers(COUNT * 27, 5).map(|v| 0.6 * v - 0.3).collect(),
    };
    let gaussians = Gaussians::from_arrays(
        2,
        arrays.means.clone(),
        arrays.rotations.clone(),
        arrays.scales.clone(),
        arrays.opacities.clone(),
        arrays.sh.clone(),
    )
    .unwrap();
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let plane = |seed| numbers(pixels, seed).map(|v| v - 0.5).collect::<Vec<f32>>();
    let color: Vec<f32> = numbers(3 * pixels, 6).map(|v| v - 0.5).collect();
    let gradient = PictureGradient {
        width: SIZE[0],
        height: SIZE[1],
        color: color.as_chunks::<3>().0.to_vec(),
        alpha: plane(7),
        depth: plane(8),
    };
    let renderer = CpuRenderer::new();
    for model in [CameraModel::Pinhole, CameraModel::OpenCv] {
        for (transparent, accumulated) in [(false, false), (true, true)] {
            let settings = RenderOptions {
                background: if transparent {
                    Background::Transparent
                } else {
                    Background::Color([0.2, 0.4, 0.9])
                },
                depth_mode: if accumulated { DepthMode::Accumulated } else { DepthMode::Expected },
                antialiased: accumulated,
                ..RenderOptions::default()
            };
            let mut options: vg_render_options = unsafe { std::mem::zeroed() };
            unsafe { vg_render_options_init(&raw mut options, size_of_val(&options)) };
            options.background = i32::from(transparent);
            options.background_color = [0.2, 0.4, 0.9];
            options.alpha = vg_alpha::Premultiplied as i32;
            options.depth_mode = i32::from(accumulated);
            options.antialiased = i32::from(accumulated);

            let camera = camera(model);
            let expected = renderer.backward(&gaussians, &camera, &settings, &gradient).unwrap();
            let picture = renderer.render(&gaussians, &camera, &settings).unwrap();
            let pose = [expected.pose.rotation, expected.pose.translation].map(|v| v.to_array());
            assert!(
                expected.means.iter().flatten().filter(|v| **v != 0.0).count() > COUNT,
                "the picture is not empty"
            );
            let posed = c_camera(&camera, model);
            for has_picture in [false, true] {
                let found = unsafe { through_c(&arrays, &posed, &options, &gradient, has_picture) };
                let g = &found.gradients;
                assert!(g.means == expected.means && g.scales == expected.scales);
                assert!(g.rotations == expected.rotations && g.opacities == expected.opacities);
                assert!(g.sh == expected.sh);
                assert_eq!(g.background, expected.background);
                assert_eq!(g.background == [0.0; 3], transparent);
                assert_eq!(found.pose, pose.as_flattened());
                assert_eq!(found.view_matrix, expected.pose.view_matrix);
                if has_picture {
                    assert!(found.alpha == picture.alpha && found.depth == picture.depth);
                }
            }
        }
    }
}
