//! The GPU through the C functions: the bytes of Rust, several pictures per call, and the gradients.
#![allow(unsafe_code)]

use std::ffi::CStr;
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};
use vg::render::{Background, Differentiable, GpuRenderer, RenderOptions, Renderer, Rgba8};
use vg::{Camera, Gaussians};
use vg_face::capi::*;
use vg_testing::gpu::renderer;
use vg_testing::gradients::noise;
use vg_testing::scenes::{forward, random};

const WIDTH: u32 = 61;
const HEIGHT: u32 = 47;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// A struct after its `_init` function.
fn initial<T>(init: unsafe extern "C" fn(*mut T, usize) -> vg_status) -> T {
    let mut value = MaybeUninit::uninit();
    unsafe {
        assert_eq!(init(value.as_mut_ptr(), size_of::<T>()), vg_status::Ok);
        value.assume_init()
    }
}

fn c_camera(camera: &Camera) -> vg_camera {
    let pose = &camera.vehicle_from_camera;
    let mut out = initial(vg_camera_init);
    (out.width, out.height) = (camera.width, camera.height);
    let i = &camera.intrinsics;
    out.model = vg_camera_model::Pinhole as i32;
    out.params[..4].copy_from_slice(&[i.fx, i.fy, i.cx, i.cy]);
    for row in 0..3 {
        for column in 0..3 {
            out.vehicle_from_camera[4 * row + column] = pose.rotation.col(column)[row];
        }
        out.vehicle_from_camera[4 * row + 3] = pose.translation[row];
    }
    out
}

unsafe fn handle(g: &Gaussians) -> *mut vg_gaussians {
    let mut out = null_mut();
    unsafe {
        let mut arrays = initial(vg_gaussian_arrays_init);
        (arrays.count, arrays.sh_degree) = (g.len(), g.sh_degree().into());
        (arrays.positions, arrays.scales) = (g.means().as_ptr().cast(), g.scales().as_ptr().cast());
        (arrays.rotations, arrays.opacities) = (g.rotations().as_ptr().cast(), g.opacities().as_ptr());
        arrays.sh = g.sh().as_ptr();
        assert_eq!(vg_gaussians_from_arrays(&arrays, &mut out, null_mut()), vg_status::Ok);
    }
    out
}

/// The picture over the background of the test.
fn ready_bytes(gpu: &GpuRenderer, gaussians: &Gaussians, camera: &Camera) -> Vec<[u8; 4]> {
    let options =
        RenderOptions { background: Background::Color([0.2, 0.4, 0.6]), ..RenderOptions::default() };
    let mut bytes = Rgba8::default();
    gpu.render_asset_rgba8(&gpu.upload(gaussians).unwrap(), camera, &options, &mut bytes).unwrap();
    bytes.pixels
}

#[test]
fn c_gets_the_devices_pictures_and_gradients() {
    let Some(gpu) = renderer() else { return };
    let g = random(16, 800, 2, [0.01, 0.2]);
    let turned =
        (0..800).map(|i| if i % 2 == 0 { [1.0, 0.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0, 0.0] }).collect();
    let (means, scales, opacities) = (g.means().to_vec(), g.scales().to_vec(), g.opacities().to_vec());
    let gaussians = Gaussians::from_arrays(2, means, turned, scales, opacities, g.sh().to_vec()).unwrap();
    // Rotated by right angles, whose entries are exact in Rust and in C.
    let cameras = [0.0, 0.7].map(|y| {
        let mut camera = forward(WIDTH, HEIGHT, 60.0);
        camera.vehicle_from_camera.translation = glam::DVec3::new(-6.0, y, 0.0);
        camera
    });
    let settings = RenderOptions { background: Background::Transparent, ..RenderOptions::default() };
    let c_cameras = cameras.map(|c| c_camera(&c));
    unsafe {
        let model = handle(&gaussians);
        let mut options = initial(vg_renderer_options_init);
        options.backend = vg_backend::Gpu as i32;
        let mut ready = null_mut();
        assert_eq!(vg_renderer_new(model, &options, &mut ready, null_mut()), vg_status::Ok);
        assert_eq!(vg_renderer_backend(ready), vg_backend::Gpu as i32);
        let choice = CStr::from_ptr(vg_renderer_choice(ready)).to_str().unwrap();
        assert!(choice.contains(gpu.name()) && choice.ends_with("asked for"), "{choice}");

        let mut how = initial(vg_render_options_init);
        how.background = vg_background::Transparent as i32;
        how.alpha = vg_alpha::Premultiplied as i32;
        how.backend = vg_backend::Gpu as i32;
        let mut colors = vec![[[0f32; 4]; PIXELS]; 3];
        let mut depths = vec![[0f32; PIXELS]; 3];
        let mut targets = [0, 1, 2].map(|i| {
            let mut target = initial(vg_image_target_init);
            (target.width, target.height) = (WIDTH, HEIGHT);
            target.color = colors[i].as_mut_ptr().cast();
            target.color_format = vg_format::Rgba32f as i32;
            target.depth = depths[i].as_mut_ptr().cast();
            target
        });
        let status = vg_renderer_render(ready, c_cameras.as_ptr(), 2, &how, targets.as_ptr(), null_mut());
        assert_eq!(status, vg_status::Ok);
        // Without a renderer handle, the first picture again.
        let status = vg_render(model, &c_cameras[0], &how, &targets[2], null_mut());
        assert_eq!(status, vg_status::Ok);
        for (i, camera) in [(0, 0), (1, 1), (2, 0)] {
            let expected = gpu.render(&gaussians, &cameras[camera], &settings).unwrap();
            assert!(expected.alpha.iter().any(|a| *a > 0.5));
            for p in 0..PIXELS {
                let [r, g, b] = expected.color[p];
                assert!(colors[i][p] == [r, g, b, expected.alpha[p]] && depths[i][p] == expected.depth[p]);
            }
        }

        // Bytes, in each order.
        let whole = ready_bytes(&gpu, &gaussians, &cameras[0]);
        how.alpha = vg_alpha::Straight as i32;
        for (format, size, order) in [
            (vg_format::Rgba8, 4, [0, 1, 2, 3]),
            (vg_format::Bgra8, 4, [2, 1, 0, 3]),
            (vg_format::Rgb8, 3, [0, 1, 2, 3]),
            (vg_format::Bgr8, 3, [2, 1, 0, 3]),
        ] {
            how.background = vg_background::Color as i32;
            how.background_color = [0.2, 0.4, 0.6];
            let stride = WIDTH as usize * size + 5;
            let mut bytes = vec![77u8; stride * HEIGHT as usize];
            let mut target = initial(vg_image_target_init);
            (target.width, target.height) = (WIDTH, HEIGHT);
            (target.color, target.color_row_stride) = (bytes.as_mut_ptr().cast(), stride);
            target.color_format = format as i32;
            let status = vg_renderer_render(ready, c_cameras.as_ptr(), 1, &how, &target, null_mut());
            assert_eq!(status, vg_status::Ok);
            for (v, row) in bytes.chunks_exact(stride).enumerate() {
                let (pixels, gap) = row.split_at(WIDTH as usize * size);
                assert!(gap == [77; 5]);
                for (u, found) in pixels.chunks_exact(size).enumerate() {
                    let pixel = whole[v * WIDTH as usize + u];
                    assert!(found.iter().zip(order).all(|(byte, c)| *byte == pixel[c]), "{format:?}");
                }
            }
        }

        how.background = vg_background::Transparent as i32;
        how.alpha = vg_alpha::Premultiplied as i32;
        let gradient = noise(5, &cameras[0]);
        let expected = gpu.backward(&gaussians, &cameras[0], &settings, &gradient).unwrap();
        let mut planes = initial(vg_image_gradient_init);
        (planes.width, planes.height) = (WIDTH, HEIGHT);
        planes.color = gradient.color.as_ptr().cast();
        planes.alpha = gradient.alpha.as_ptr().cast();
        planes.depth = gradient.depth.as_ptr().cast();
        let mut means = vec![[0f32; 3]; gaussians.len()];
        let mut out = initial(vg_gradients_init);
        (out.count, out.sh_degree) = (gaussians.len(), 2);
        out.positions = means.as_mut_ptr().cast();
        // With the picture, which is drawn into the target, and without.
        for target in [null(), &raw const targets[2]] {
            means.fill([0.0; 3]);
            let status = vg_render_backward(model, &c_cameras[0], &how, target, &planes, &out, null_mut());
            assert_eq!(status, vg_status::Ok);
            assert!(means == expected.means);
        }
        targets[2].width = 1;
        let status =
            vg_renderer_render(ready, c_cameras.as_ptr(), 2, &how, targets[1..].as_ptr(), null_mut());
        assert_eq!(status, vg_status::Argument);
        vg_gaussians_free(model);
        vg_renderer_free(ready);
    }
}
