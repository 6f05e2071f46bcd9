//! Alignment through the C functions gives the bytes of the Rust library.

use glam::DVec3;
use std::ffi::CString;
use std::path::Path;
use std::ptr::{null, null_mut};
use vg::View;
use vg::align::{self, Heading};
use vg::geometry::{Pose, Similarity};
use vg::scene::Cloud;
use vg_face::capi::*;
use vg_testing::boxes::{gauge, hatchback, scan, sparse, views};

/// The source of a view's silhouette.
#[derive(Clone, Copy, Debug)]
enum Silhouette {
    /// A mask, and no photograph.
    Mask,
    /// A photograph's alpha, and no mask.
    Alpha,
    /// A photograph with full alpha, and no mask.
    Nothing,
}

/// Cameras and silhouettes in the caller's memory.
struct Lent {
    views: Vec<vg_view>,
    /// The memory that `views` points to.
    _memory: (Vec<CString>, Vec<Vec<u8>>),
}

fn lent(views: &[View], silhouette: impl Fn(usize) -> Silhouette) -> Lent {
    let names: Vec<CString> = views.iter().map(|view| CString::new(view.name.as_str()).unwrap()).collect();
    let pixels = |(i, view): (usize, &View)| {
        let mask = view.mask.as_ref().unwrap();
        let alpha = mask.labels().iter().map(|label| *label as u8);
        match silhouette(i) {
            Silhouette::Mask => alpha.collect(),
            Silhouette::Alpha => alpha.flat_map(|a| [9, 99, 199, a]).collect(),
            Silhouette::Nothing => alpha.flat_map(|_| [9, 99, 199]).collect(),
        }
    };
    let pixels: Vec<Vec<u8>> = views.iter().enumerate().map(pixels).collect();
    let view = |(i, view): (usize, &View)| {
        let mut out: vg_view = unsafe { std::mem::zeroed() };
        unsafe { vg_view_init(&raw mut out, size_of::<vg_view>()) };
        let (camera, intrinsics) = (&view.camera, view.camera.intrinsics);
        out.name = names[i].as_ptr();
        (out.camera.width, out.camera.height) = (camera.width, camera.height);
        out.camera.params[..4].copy_from_slice(&[intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy]);
        out.camera.vehicle_from_camera = camera.vehicle_from_camera.to_row_major();
        let image = |format: vg_format| vg_image {
            data: pixels[i].as_ptr().cast(),
            row_stride: 0,
            width: camera.width,
            height: camera.height,
            format: format as i32,
            flags: 0,
        };
        match silhouette(i) {
            Silhouette::Mask => out.mask = image(vg_format::Gray8),
            Silhouette::Alpha => out.image = image(vg_format::Rgba8),
            Silhouette::Nothing => out.image = image(vg_format::Rgb8),
        }
        out
    };
    Lent { views: views.iter().enumerate().map(view).collect(), _memory: (names, pixels) }
}

/// The views as C reads them: a pose passed as numbers is made a rotation exactly once.
fn as_read(views: &[View]) -> Vec<View> {
    let read = |view: &View| {
        let mut view = view.clone();
        let pose = view.camera.vehicle_from_camera.to_row_major();
        view.camera.vehicle_from_camera = Pose::from_row_major("pose", &pose).unwrap();
        view
    };
    views.iter().map(read).collect()
}

/// The result of C, or the status and message of its error; the output is then unchanged.
fn through_c(
    call: impl FnOnce(*mut vg_alignment, *mut *mut vg_error) -> vg_status,
) -> Result<vg_alignment, String> {
    unsafe {
        let mut found: vg_alignment = std::mem::zeroed();
        vg_alignment_init(&raw mut found, size_of::<vg_alignment>());
        let mut error = null_mut();
        if call(&raw mut found, &raw mut error) == vg_status::Ok {
            return Ok(found);
        }
        assert!(found.scale.is_nan() && found.vehicle_from_world.iter().all(|v| v.is_nan()));
        let words = std::ffi::CStr::from_ptr(vg_error_message(error)).to_str().unwrap().to_owned();
        vg_error_free(error);
        Err(words)
    }
}

fn options(context: *mut vg_context, heading: vg_heading) -> vg_align_options {
    let mut options: vg_align_options = unsafe { std::mem::zeroed() };
    unsafe { vg_align_options_init(&raw mut options, size_of::<vg_align_options>()) };
    (options.context, options.heading) = (context, heading as i32);
    options
}

/// `measures`: residual, confidence, pixels, pixels the other way round; NAN equals NAN.
fn assert_same(found: &vg_alignment, similarity: &Similarity, measures: [f64; 4], used: usize) {
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&found.vehicle_from_world), bits(&similarity.to_row_major()));
    assert_eq!(bits(&[found.scale]), bits(&[similarity.scale]));
    let in_c = [found.residual_m, found.confidence, found.residual_px, found.other_px];
    assert_eq!(bits(&in_c), bits(&measures), "{in_c:?} {measures:?}");
    assert_eq!(found.used_count, used);
}

/// A context of two threads, which must make no difference.
fn context() -> *mut vg_context {
    let mut context = null_mut();
    unsafe {
        let mut options: vg_context_options = std::mem::zeroed();
        vg_context_options_init(&raw mut options, size_of::<vg_context_options>());
        options.threads = 2;
        assert_eq!(vg_context_new(&raw const options, &raw mut context, null_mut()), vg_status::Ok);
    }
    context
}

fn rows(points: &[DVec3]) -> Vec<[f64; 3]> {
    points.iter().map(DVec3::to_array).collect()
}

#[test]
fn masks_and_alpha_give_the_alignment_of_rust_to_the_byte() {
    let (shape, truth) = (hatchback(), gauge(6));
    let lent_views = views(&shape, 8, &truth);
    let views = as_read(&lent_views);
    let ground = sparse(&shape, &truth, 6);
    let points: Vec<[f32; 3]> = scan(&shape, 8_000, 6).iter().map(|p| p.as_vec3().to_array()).collect();
    let (world, size) = (rows(&ground), [4.2, 1.8, 1.5]);
    let context = context();

    let by_scan = |silhouette: &dyn Fn(usize) -> Silhouette, options: *const vg_align_options| {
        let lent = lent(&lent_views, silhouette);
        let (first, n) = (lent.views.as_ptr(), lent.views.len());
        through_c(|out, error| unsafe {
            let (world, scan) = (world.as_ptr().cast(), points.as_ptr().cast());
            vg_align_scan(first, n, world, ground.len(), scan, points.len(), options, out, error)
        })
    };
    let expected =
        align::to_scan(&views, &ground, &Cloud::new(points.clone()).unwrap(), Heading::Auto).unwrap();
    let measures = [expected.residual_m, expected.confidence, expected.residual_px, expected.other_px];
    assert!((expected.vehicle_from_world.scale / truth.scale - 1.0).abs() < 0.01, "{expected:?}");
    let auto = options(context, vg_heading::Auto);
    for silhouette in [Silhouette::Mask, Silhouette::Alpha] {
        for options in [null(), &raw const auto] {
            let found = by_scan(&|_| silhouette, options).unwrap();
            assert_same(&found, &expected.vehicle_from_world, measures, 8);
        }
    }
    // Views without a silhouette are left out, as long as enough remain.
    let some = |i: usize| if i < 5 { Silhouette::Nothing } else { Silhouette::Mask };
    let expected =
        align::to_scan(&views[5..], &ground, &Cloud::new(points.clone()).unwrap(), Heading::Auto).unwrap();
    let measures = [expected.residual_m, expected.confidence, expected.residual_px, expected.other_px];
    assert_same(&by_scan(&some, null()).unwrap(), &expected.vehicle_from_world, measures, 3);
    let refused = by_scan(&|_| Silhouette::Nothing, null()).unwrap_err();
    assert!(refused.starts_with("views: 0 of 8 have a mask"), "{refused}");

    let lent = lent(&lent_views, |_| Silhouette::Mask);
    let by_box = |heading| {
        let options = options(context, heading);
        through_c(|out, error| unsafe {
            let (world, size) = (world.as_ptr().cast(), size.as_ptr());
            vg_align_box(lent.views.as_ptr(), 8, world, ground.len(), size, &raw const options, out, error)
        })
    };
    for (heading, in_rust) in
        [(vg_heading::Forward, Heading::Forward), (vg_heading::Backward, Heading::Backward)]
    {
        let expected = align::to_box(&views, &ground, size, in_rust).unwrap();
        let measures = [expected.residual_m, expected.confidence, f64::NAN, f64::NAN];
        assert_same(&by_box(heading).unwrap(), &expected.vehicle_from_world, measures, 8);
    }
    let refused = by_box(vg_heading::Auto).unwrap_err();
    assert!(refused.starts_with("options.heading: auto, but a box is the same"), "{refused}");
    unsafe { vg_context_free(context) };
}

#[test]
fn points_known_in_both_frames_give_the_alignment_of_rust_to_the_byte() {
    let truth = gauge(8);
    let mut world = sparse(&hatchback(), &truth, 8);
    world.truncate(40);
    let vehicle: Vec<DVec3> = world.iter().map(|p| truth.transform_point(*p)).collect();
    world[7] += DVec3::splat(3.0);
    let expected = Similarity::umeyama_robust(&world, &vehicle).unwrap();
    let (mut kept, mut residuals) = (vec![2u8; 40], vec![f64::NAN; 40]);
    let found = through_c(|out, error| unsafe {
        let (kept, residuals) = (kept.as_mut_ptr(), residuals.as_mut_ptr());
        let (world, vehicle) = (rows(&world), rows(&vehicle));
        vg_align_points(world.as_ptr().cast(), vehicle.as_ptr().cast(), 40, out, kept, residuals, error)
    });
    let measures = [expected.residual(), expected.confidence(), f64::NAN, f64::NAN];
    assert_same(&found.unwrap(), &expected.similarity, measures, 39);
    assert_eq!(kept, expected.kept.iter().map(|kept| u8::from(*kept)).collect::<Vec<_>>());
    assert!(kept[7] == 0 && residuals == expected.residuals);
}

#[test]
fn a_folder_gives_the_alignment_of_rust_to_the_byte() {
    let sample = vg_testing::root().join("tests/data/sedan");
    let scratch = vg_testing::tools::scratch();
    let file = scratch.path().join("scan.ply");
    write_scan(&sample, &file);
    let text = |path: &Path| CString::new(path.to_str().unwrap()).unwrap();
    let (folder, scan) = (text(&sample), text(&file));
    let found = through_c(|out, error| unsafe {
        vg_align_folder(folder.as_ptr(), scan.as_ptr(), null(), out, error)
    });
    let (_, expected) = align::folder_to_scan(&sample, Some(&file), Heading::Auto).unwrap();
    let measures = [expected.residual_m, expected.confidence, expected.residual_px, expected.other_px];
    assert_same(&found.unwrap(), &expected.vehicle_from_world, measures, 8);
}

/// Writes the points of the sample's depth maps of the right side, and their mirror image.
fn write_scan(sample: &Path, file: &Path) {
    let scene = vg::io::open_scene(sample, &vg::io::SceneOptions::default()).unwrap().scene;
    let mut points = Vec::new();
    for view in &scene.views {
        let Some(depth) = &view.depth else { continue };
        for (i, z) in depth.depth().iter().enumerate().filter(|(i, z)| i % 7 == 0 && **z > 0.0) {
            let p = view.lift(i as u32 % view.camera.width, i as u32 / view.camera.width, *z);
            points.extend([p.to_array(), [p.x, -p.y, p.z]]);
        }
    }
    vg::io::ply::write_points(file, &points, &vec![[128; 3]; points.len()]).unwrap();
}
