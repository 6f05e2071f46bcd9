//! Photographs in every memory layout that C accepts give the same bytes.

use std::ptr::null_mut;
use vg::scene::{Scene, View};
use vg_face::capi::*;

use vg_testing::vehicle::{right_side, without_depth};

/// The layout of a photograph in the caller's memory.
#[derive(Clone, Copy, Debug)]
struct Layout {
    format: vg_format,
    /// Bytes between rows.
    gap: usize,
    /// The content of alpha, if the format has it.
    alpha: Alpha,
    has_mask: bool,
}

#[derive(Clone, Copy, Debug)]
enum Alpha {
    Opaque,
    Mask,
}

fn pixels(view: &View, layout: Layout) -> Vec<u8> {
    let mask = view.mask.as_ref().unwrap();
    let mut bytes = Vec::new();
    for v in 0..view.camera.height {
        for u in 0..view.camera.width {
            let [r, g, b] = view.image.get(u, v);
            let a = match layout.alpha {
                Alpha::Mask if !mask.is_vehicle(u, v) => 0,
                _ => 255,
            };
            match layout.format {
                vg_format::Rgb8 => bytes.extend([r, g, b]),
                vg_format::Bgr8 => bytes.extend([b, g, r]),
                vg_format::Rgba8 => bytes.extend([r, g, b, a]),
                _ => bytes.extend([b, g, r, a]),
            }
        }
        bytes.extend(std::iter::repeat_n(0xa5, layout.gap));
    }
    bytes
}

/// The status, and the Gaussians' arrays concatenated.
fn made_of(scene: &Scene, layout: Layout) -> (vg_status, Vec<f32>) {
    let pixels: Vec<Vec<u8>> = scene.views.iter().map(|view| pixels(view, layout)).collect();
    let views: Vec<vg_view> =
        scene.views.iter().zip(&pixels).map(|(view, p)| lent(view, p, layout)).collect();
    let mut car = null_mut();
    let status = unsafe {
        vg_reconstruct(views.as_ptr(), views.len(), std::ptr::null(), &raw mut car, null_mut(), null_mut())
    };
    let mut arrays = Vec::new();
    unsafe {
        let count = vg_gaussians_count(car);
        let coefficients = (vg_gaussians_sh_degree(car) as usize + 1).pow(2) * 3;
        for (array, stride) in [
            (vg_gaussians_positions(car), 3),
            (vg_gaussians_scales(car), 3),
            (vg_gaussians_rotations(car), 4),
            (vg_gaussians_opacities(car), 1),
            (vg_gaussians_sh(car), coefficients),
        ] {
            if count > 0 {
                arrays.extend_from_slice(std::slice::from_raw_parts(array, count * stride));
            }
        }
        vg_gaussians_free(car);
    }
    (status, arrays)
}

fn lent(view: &View, pixels: &[u8], layout: Layout) -> vg_view {
    let mut out: vg_view = unsafe { std::mem::zeroed() };
    unsafe { vg_view_init(&raw mut out, size_of::<vg_view>()) };
    let camera = view.camera;
    let i = camera.intrinsics;
    out.camera.width = camera.width;
    out.camera.height = camera.height;
    out.camera.params[..4].copy_from_slice(&[i.fx, i.fy, i.cx, i.cy]);
    out.camera.vehicle_from_camera = camera.vehicle_from_camera.to_row_major();
    let image = |data: *const u8, row_stride: usize, format: vg_format| vg_image {
        data: data.cast(),
        row_stride,
        width: camera.width,
        height: camera.height,
        format: format as i32,
        flags: 0,
    };
    out.image = image(pixels.as_ptr(), pixels.len() / camera.height as usize, layout.format);
    if layout.has_mask {
        // A label is one byte: 255 is vehicle, all others are below 128.
        out.mask = image(view.mask.as_ref().unwrap().labels().as_ptr().cast(), 0, vg_format::Gray8);
    }
    out
}

#[test]
fn every_layout_of_the_same_photographs_makes_the_same_bytes() {
    let scene = without_depth(right_side(96, 72));
    let with_mask = |format, gap| Layout { format, gap, alpha: Alpha::Opaque, has_mask: true };
    let (status, expected) = made_of(&scene, with_mask(vg_format::Rgb8, 0));
    assert!(status == vg_status::Ok && expected.len() > 10_000);
    for layout in [
        with_mask(vg_format::Rgb8, 7),
        with_mask(vg_format::Bgr8, 0),
        with_mask(vg_format::Rgba8, 0),
        with_mask(vg_format::Bgra8, 12),
        Layout { format: vg_format::Rgba8, gap: 0, alpha: Alpha::Mask, has_mask: false },
        Layout { format: vg_format::Bgra8, gap: 3, alpha: Alpha::Mask, has_mask: false },
    ] {
        assert!(made_of(&scene, layout) == (vg_status::Ok, expected.clone()), "{layout:?}");
    }
}

#[test]
fn opaque_alpha_is_not_a_mask() {
    let scene = without_depth(right_side(48, 36));
    for (format, alpha) in [(vg_format::Rgb8, Alpha::Mask), (vg_format::Rgba8, Alpha::Opaque)] {
        let layout = Layout { format, gap: 0, alpha, has_mask: false };
        // Without masks there are no silhouettes.
        assert_eq!(made_of(&scene, layout).0, vg_status::Argument, "{layout:?}");
    }
}
