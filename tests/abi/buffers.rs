//! Results of a fixed scene: the Gaussians and a picture of the bundled sample, through the C functions.
//!
//! The golden file holds every 499th Gaussian and the whole picture. They are compared within tolerances, so that the
//! size of a deliberate change of the method is visible. The exact bytes are compared by a hash, together with the name
//! of the processor path that made it.

use std::ffi::CString;
use std::ptr::null_mut;
use vg::render::CpuRenderer;
use vg_face::capi::*;
use vg_testing::tools::golden;
use vg_testing::{root, say};

const EVERY: usize = 499;

/// Columns and rows of the picture.
const SIZE: [u32; 2] = [96, 72];

struct Buffers {
    count: usize,
    /// positions, scales, rotations, opacities, sh
    arrays: [(Vec<f32>, usize); 5],
    picture: Vec<f32>,
    depth: Vec<f32>,
}

/// The processor path that exact bytes depend on.
pub(crate) fn processor() -> String {
    format!("{} {}", std::env::consts::ARCH, CpuRenderer::new().level())
}

/// FNV-1a.
fn hash(values: &[f32]) -> u64 {
    let bytes = values.iter().flat_map(|v| v.to_le_bytes());
    bytes.fold(14_695_981_039_346_656_037, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(1_099_511_628_211)
    })
}

unsafe fn made_of_the_sample() -> Buffers {
    let names: Vec<CString> = ["000", "001", "002", "003"].map(|n| CString::new(n).unwrap()).into();
    let names: Vec<_> = names.iter().map(|n| n.as_ptr()).collect();
    let path = CString::new(root().join("tests/data/sedan").to_str().unwrap()).unwrap();
    unsafe {
        let mut settings: vg_scene_options = std::mem::zeroed();
        assert_eq!(vg_scene_options_init(&raw mut settings, size_of_val(&settings)), vg_status::Ok);
        (settings.names, settings.name_count) = (names.as_ptr(), names.len());
        let mut scene = null_mut();
        assert_eq!(
            vg_transforms_open(path.as_ptr(), &raw const settings, &raw mut scene, null_mut()),
            vg_status::Ok
        );
        let views: Vec<vg_view> = (0..4)
            .map(|i| {
                let mut view: vg_view = std::mem::zeroed();
                assert_eq!(vg_view_init(&raw mut view, size_of::<vg_view>()), vg_status::Ok);
                assert_eq!(vg_scene_get_view(scene, i, &raw mut view, null_mut()), vg_status::Ok);
                view
            })
            .collect();
        let mut options: vg_options = std::mem::zeroed();
        assert_eq!(vg_options_init(&raw mut options, size_of_val(&options)), vg_status::Ok);
        options.check = 0;
        let mut car = null_mut();
        let made =
            vg_reconstruct(views.as_ptr(), 4, &raw const options, &raw mut car, null_mut(), null_mut());
        assert_eq!(made, vg_status::Ok);

        let count = vg_gaussians_count(car);
        let coefficients = (vg_gaussians_sh_degree(car) as usize + 1).pow(2) * 3;
        let array = |pointer: *const f32, stride: usize| {
            (std::slice::from_raw_parts(pointer, count * stride).to_vec(), stride)
        };
        let arrays = [
            array(vg_gaussians_positions(car), 3),
            array(vg_gaussians_scales(car), 3),
            array(vg_gaussians_rotations(car), 4),
            array(vg_gaussians_opacities(car), 1),
            array(vg_gaussians_sh(car), coefficients),
        ];

        let pixels = (SIZE[0] * SIZE[1]) as usize;
        let (mut picture, mut depth) = (vec![0.0f32; pixels * 4], vec![0.0f32; pixels]);
        // The unseen side, from the mirrored position of the first camera.
        let mut camera = views[0].camera;
        assert_eq!(
            vg_camera_scale(&raw const camera, SIZE[0], SIZE[1], &raw mut camera, null_mut()),
            vg_status::Ok
        );
        for (i, v) in camera.vehicle_from_camera.iter_mut().enumerate() {
            // M R diag(-1, 1, 1), M t.
            if (4..8).contains(&i) != (i % 4 == 0) {
                *v = -*v;
            }
        }
        let mut target: vg_image_target = std::mem::zeroed();
        assert_eq!(vg_image_target_init(&raw mut target, size_of_val(&target)), vg_status::Ok);
        [target.width, target.height] = SIZE;
        target.color = picture.as_mut_ptr().cast();
        target.color_format = vg_format::Rgba32f as i32;
        target.depth = depth.as_mut_ptr().cast();
        let mut drawing: vg_render_options = std::mem::zeroed();
        assert_eq!(vg_render_options_init(&raw mut drawing, size_of_val(&drawing)), vg_status::Ok);
        drawing.background = vg_background::Transparent as i32;
        drawing.alpha = vg_alpha::Premultiplied as i32;
        let drawn = vg_render(car, &raw const camera, &raw const drawing, &raw const target, null_mut());
        assert_eq!(drawn, vg_status::Ok);

        vg_scene_free(scene);
        vg_gaussians_free(car);
        Buffers { count, arrays, picture, depth }
    }
}

/// count, then every 499th Gaussian, array by array, then picture and depth; little-endian.
fn packed(buffers: &Buffers) -> Vec<u8> {
    let mut bytes = (buffers.count as u64).to_le_bytes().to_vec();
    let mut push = |values: &[f32]| bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    for (values, stride) in &buffers.arrays {
        values.chunks(*stride).step_by(EVERY).for_each(&mut push);
    }
    push(&buffers.picture);
    push(&buffers.depth);
    bytes
}

fn hashes(buffers: &Buffers) -> String {
    let names = ["positions", "scales", "rotations", "opacities", "sh", "picture", "depth"];
    let arrays = buffers.arrays.iter().map(|(values, _)| values);
    let values = arrays.chain([&buffers.picture, &buffers.depth]);
    let lines = names.iter().zip(values).map(|(name, values)| format!("{name} {:016x}\n", hash(values)));
    processor() + "\n" + &lines.collect::<String>()
}

fn numbers(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn the_sample_gives_the_golden_buffers() {
    let buffers = unsafe { made_of_the_sample() };
    let found = packed(&buffers);
    let path = golden().join("sedan.bin");
    let hashes = hashes(&buffers);
    if std::env::var_os("VG_BLESS").is_some() {
        std::fs::write(&path, &found).unwrap();
        std::fs::write(golden().join("sedan.hash"), &hashes).unwrap();
        return;
    }

    let expected = std::fs::read(&path).unwrap();
    assert_eq!(u64::from_le_bytes(expected[..8].try_into().unwrap()), buffers.count as u64, "Gaussians");
    let (expected, found) = (numbers(&expected[8..]), numbers(&found[8..]));
    assert_eq!(expected.len(), found.len());
    // Two processors round sums of some hundred terms differently: 1e-4 of metres, colours and alpha is more than that
    // and less than a visible difference. A threshold may fall differently in a few pixels.
    let off: Vec<usize> = (0..found.len())
        .filter(|&i| (expected[i] - found[i]).abs() > 1e-4 * expected[i].abs().max(1.0))
        .collect();
    assert!(
        off.len() <= found.len() / 10_000,
        "{} of {} numbers differ, the first from {} to {}",
        off.len(),
        found.len(),
        expected[off[0]],
        found[off[0]]
    );

    let golden_hashes = std::fs::read_to_string(golden().join("sedan.hash")).unwrap();
    if golden_hashes.lines().next() == hashes.lines().next() {
        assert_eq!(golden_hashes, hashes, "the exact bytes");
    } else {
        let of = golden_hashes.lines().next().unwrap_or_default();
        say(&format!("skipped: the exact bytes: the hashes are of {of}"));
    }
}
