//! Cameras, poses, similarities and spherical harmonics compared with results of other projects (scripts/golden), and
//! the undistortion of pictures, masks and depth compared with the lens formulas.

use glam::{DMat3, DVec3};
use serde_json::Value;
use vg_geometry::frame::{opengl_from_pose, pose_from_colmap, pose_from_opengl};
use vg_geometry::resample::pinhole_for;
use vg_geometry::{Camera, CameraModel, Distortion, Intrinsics, Pose, Similarity};
use vg_scene::mask::{Label, Mask};
use vg_scene::undistort::undistorted;
use vg_scene::{DepthMap, RgbImage, View};
use vg_splat::gaussians::sh;

fn golden(name: &str) -> Value {
    let path = vg_testing::root().join("tests/golden").join(name);
    serde_json::from_slice(&std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
        .unwrap()
}

fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap_or_else(|| panic!("no list {key}"))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().unwrap())
}

fn point(value: &Value) -> DVec3 {
    DVec3::from_array(numbers(value))
}

/// The rows of a matrix, concatenated.
fn rows<const N: usize>(value: &Value) -> [f64; N] {
    let all: Vec<f64> =
        value.as_array().unwrap().iter().flat_map(|row| numbers::<4>(row).into_iter()).collect();
    std::array::from_fn(|i| all[i])
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The golden cameras, at the origin.
fn cameras() -> Vec<(Camera, Value)> {
    let read = |case: &Value| {
        let model = CameraModel::from_name(case["model"].as_str().unwrap()).unwrap();
        assert_eq!(case["model_id"], model as i32);
        let size = |key: &str| u32::try_from(case[key].as_u64().unwrap()).unwrap();
        let params: Vec<f64> = list(case, "params").iter().map(|v| v.as_f64().unwrap()).collect();
        let camera =
            Camera::from_colmap("camera", model, size("width"), size("height"), &params, Pose::IDENTITY);
        (camera.unwrap(), case.clone())
    };
    list(&golden("cameras_pycolmap.json"), "cases").iter().map(read).collect()
}

#[test]
fn points_project_as_in_colmap_to_1e_minus_9_pixels() {
    for (camera, case) in cameras() {
        for (p, pixel) in list(&case, "points").iter().zip(list(&case, "pixels")) {
            let found = camera.project(point(p)).unwrap();
            let difference = largest_difference(&found, &numbers::<2>(pixel));
            assert!(difference <= 1e-9, "{} {}: {difference}", case["model"], case["params"]);
        }
    }
}

#[test]
fn pixels_have_the_rays_of_colmap() {
    for (camera, case) in cameras() {
        for (pixel, ray) in list(&case, "unproject_pixels").iter().zip(list(&case, "unproject_rays")) {
            let pixel = numbers::<2>(pixel);
            let found = camera.ray(pixel).unwrap();
            // COLMAP's inverse is accurate to 1e-6 pixels; ours to 1e-9.
            let difference = largest_difference(&[found.x, found.y], &numbers::<2>(ray));
            assert!(difference <= 1e-6, "{} {pixel:?}: {difference}", case["model"]);
            assert!(largest_difference(&camera.project(found).unwrap(), &pixel) <= 1e-9);
        }
    }
}

#[test]
fn colmap_and_opengl_poses_convert_as_in_pycolmap() {
    for case in list(&golden("poses_pycolmap.json"), "poses") {
        let pose = pose_from_colmap("pose", numbers(&case["qvec_wxyz"]), numbers(&case["tvec"])).unwrap();
        let expected: [f64; 12] = rows(&case["world_from_cam"]);
        // Translations reach 1e2, so that 1e-12 is 50 steps of f64.
        assert!(largest_difference(&pose.to_row_major(), &expected) <= 1e-12);
        let inverse: [f64; 12] = rows(&case["cam_from_world"]);
        assert!(largest_difference(&pose.inverse().to_row_major(), &inverse) <= 1e-12);
        let center = pose.translation.to_array();
        assert!(largest_difference(&center, &numbers::<3>(&case["projection_center"])) <= 1e-12);

        let opengl: [f64; 12] = rows(&case["opengl_camera_to_world"]);
        assert!(largest_difference(&opengl_from_pose(&pose), &opengl) <= 1e-12);
        let back = pose_from_opengl("pose", &opengl).unwrap();
        assert!(largest_difference(&back.to_row_major(), &expected) <= 1e-12);
    }
}

#[test]
fn the_best_similarity_equals_that_of_pycolmap() {
    for case in list(&golden("umeyama_pycolmap.json"), "cases") {
        let points = |key: &str| list(case, key).iter().map(point).collect::<Vec<_>>();
        let found = Similarity::umeyama(&points("src"), &points("dst")).unwrap();
        let scale = case["scale"].as_f64().unwrap();
        let rotation: Vec<[f64; 3]> = list(case, "rotation").iter().map(numbers).collect();
        let rotation = DMat3::from_cols_array_2d(&[rotation[0], rotation[1], rotation[2]]).transpose();
        let name = &case["name"];
        assert!((found.scale / scale - 1.0).abs() <= 1e-12, "{name}: {} {scale}", found.scale);
        let difference = largest_difference(&found.rotation.to_cols_array(), &rotation.to_cols_array());
        assert!(difference <= 1e-12, "{name}: {difference}");
        let translation = numbers::<3>(&case["translation"]);
        assert!(largest_difference(&found.translation.to_array(), &translation) <= 1e-10, "{name}");
    }
}

#[test]
fn the_sh_basis_equals_that_of_scipy() {
    let file = golden("sh_scipy.json");
    for (direction, values) in list(&file, "directions").iter().zip(list(&file, "values")) {
        let found = sh::basis(numbers(direction), 3);
        let difference = largest_difference(&found, &numbers::<16>(values));
        assert!(difference <= 1e-12, "{direction}: {difference}");
    }
}

/// Pixels of the pinhole `ideal` (which has the lens's focal lengths and principal point) on a grid, all seen by the
/// lens well inside its picture.
fn dots(lens: &Camera, ideal: &Camera) -> Vec<[f64; 2]> {
    let mut dots = Vec::new();
    for row in 0..4 {
        for column in 0..6 {
            let in_lens = [
                f64::from(lens.width) * (f64::from(column) + 0.5 + 0.013 * f64::from(row)) / 6.0,
                f64::from(lens.height) * (f64::from(row) + 0.5 + 0.017 * f64::from(column)) / 4.0,
            ];
            if let Some(ray) = lens.ray(in_lens) {
                dots.push(ideal.project(ray).unwrap());
            }
        }
    }
    dots
}

/// Centroid of weights in a square of `2 * reach + 1` pixels around `at`, or `None` if that leaves the picture.
fn centroid(camera: &Camera, at: [f64; 2], reach: i64, weight: impl Fn(usize) -> f64) -> Option<[f64; 2]> {
    let (u0, v0) = (at[0].floor() as i64, at[1].floor() as i64);
    let mut sum = [0.0; 3];
    for v in v0 - reach..=v0 + reach {
        for u in u0 - reach..=u0 + reach {
            if !(0..i64::from(camera.width)).contains(&u) || !(0..i64::from(camera.height)).contains(&v) {
                return None;
            }
            let w = weight(v as usize * camera.width as usize + u as usize);
            sum = [sum[0] + w * (u as f64 + 0.5), sum[1] + w * (v as f64 + 0.5), sum[2] + w];
        }
    }
    Some([sum[0] / sum[2], sum[1] / sum[2]])
}

/// Radius of the dots: large enough that the steps of a hard edge average out to a few hundredths of a pixel.
const RADIUS: f64 = 20.0;

/// The picture, through a lens, of round discs of RADIUS pixels on the pinhole `ideal`.
fn dot_view(lens: &Camera, ideal: &Camera, dots: &[[f64; 2]]) -> View {
    let (mut pixels, mut labels, mut depth) = (Vec::new(), Vec::new(), Vec::new());
    for v in 0..lens.height {
        for u in 0..lens.width {
            let ray = lens.ray([f64::from(u) + 0.5, f64::from(v) + 0.5]);
            let nearest = ray.map_or(f64::INFINITY, |ray| {
                let p = ideal.project(ray).unwrap();
                dots.iter().map(|d| (p[0] - d[0]).hypot(p[1] - d[1])).fold(f64::INFINITY, f64::min)
            });
            // A soft edge, so that the picture's centroid is good to a hundredth of a pixel.
            let brightness = (255.0 * (0.5 + 0.5 * (RADIUS - 3.0 - nearest)).clamp(0.0, 1.0)).round();
            pixels.push([brightness as u8; 3]);
            labels.push(if nearest < RADIUS { Label::Vehicle } else { Label::Background });
            depth.push(if nearest < RADIUS { 3.0 } else { 0.0 });
        }
    }
    let (width, height) = (lens.width, lens.height);
    View {
        name: "dots".into(),
        camera: *lens,
        image: RgbImage::new(width, height, pixels).unwrap(),
        mask: Some(Mask::new(width, height, labels).unwrap()),
        depth: Some(DepthMap::new(width, height, depth).unwrap()),
    }
}

#[test]
fn undistorted_dots_lie_where_the_pinhole_projects_them_to_a_tenth_of_a_pixel() {
    let lenses = [
        ("barrel", Distortion::Brown { k: [-0.25, 0.07, 0.0, 0.0, 0.0, 0.0], p: [0.003, -0.002] }),
        ("pincushion", Distortion::Brown { k: [0.1, 0.02, 0.0, 0.0, 0.0, 0.0], p: [-0.001, 0.002] }),
        ("rational", Distortion::Brown { k: [0.3, -0.05, 0.01, 0.4, 0.01, 0.002], p: [0.0, 0.001] }),
        ("fisheye", Distortion::Fisheye { k: [0.06, -0.02, 0.006, -0.001] }),
    ];
    for (name, distortion) in lenses {
        let intrinsics = Intrinsics { fx: 300.0, fy: 305.0, cx: 248.25, cy: 190.5 };
        let lens =
            Camera { width: 500, height: 380, intrinsics, distortion, vehicle_from_camera: Pose::IDENTITY };
        let ideal = Camera { distortion: Distortion::None, ..lens };
        let dots = dots(&lens, &ideal);
        assert_eq!(dots.len(), 24, "{name}");
        let view = undistorted(&dot_view(&lens, &ideal, &dots)).unwrap();
        view.validate(name).unwrap();
        assert!(view.camera.distortion.is_none());
        assert_eq!((view.camera.intrinsics.fx, view.camera.intrinsics.fy), (300.0, 305.0));
        let (mask, depth) = (view.mask.as_ref().unwrap(), view.depth.as_ref().unwrap());
        let shift = [view.camera.intrinsics.cx - intrinsics.cx, view.camera.intrinsics.cy - intrinsics.cy];
        let (mut seen, mut mean) = (0, [[0.0; 2]; 3]);
        for dot in &dots {
            let at = [dot[0] + shift[0], dot[1] + shift[1]];
            let weights: [&dyn Fn(usize) -> f64; 3] = [
                &|i| f64::from(view.image.pixels()[i][0]),
                &|i| f64::from(u8::from(mask.labels()[i] == Label::Vehicle)),
                &|i| f64::from(depth.depth()[i]),
            ];
            for (k, weight) in weights.into_iter().enumerate() {
                let Some(found) = centroid(&view.camera, at, 24, weight) else { continue };
                let shift = [found[0] - at[0], found[1] - at[1]];
                // Pictures and silhouettes are sampled between the pixels; a small silhouette is then rounded to
                // whole ones. A depth dot's rim is a depth edge, which keeps to whole pixels: where the map is
                // nearly a translation, all of them shift alike.
                let allowed = [0.1, 0.3, 0.5][k];
                assert!(shift.iter().all(|s| s.abs() <= allowed), "{name} {k} at {at:?}: {shift:?}");
                mean[k] = [mean[k][0] + shift[0], mean[k][1] + shift[1]];
                seen += 1;
            }
        }
        for (what, sum) in ["image", "mask", "depth"].into_iter().zip(mean) {
            let shift = sum.map(|s| 3.0 * s / f64::from(seen));
            assert!(shift.iter().all(|s| s.abs() <= 0.1), "{name} {what}: mean shift {shift:?}");
        }
        // Some dots of a wide lens lie outside the pinhole's picture.
        assert!(seen >= 3 * 12, "{name}: {seen}");
    }
}

#[test]
fn pixels_outside_the_lens_picture_are_unknown_and_have_no_depth() {
    let lens = Camera {
        width: 200,
        height: 150,
        intrinsics: Intrinsics { fx: 150.0, fy: 150.0, cx: 100.0, cy: 75.0 },
        distortion: Distortion::Brown { k: [-0.2, 0.03, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] },
        vehicle_from_camera: Pose::IDENTITY,
    };
    let n = 200 * 150;
    let view = View {
        name: "full".into(),
        camera: lens,
        image: RgbImage::new(200, 150, vec![[200; 3]; n]).unwrap(),
        mask: Some(Mask::new(200, 150, vec![Label::Vehicle; n]).unwrap()),
        depth: Some(DepthMap::new(200, 150, vec![2.0; n]).unwrap()),
    };
    let view = undistorted(&view).unwrap();
    let (mask, depth) = (view.mask.unwrap(), view.depth.unwrap());
    let unknown = mask.labels().iter().filter(|l| **l == Label::Unknown).count();
    assert!(unknown > 0 && unknown < mask.labels().len() / 2, "{unknown}");
    for (i, label) in mask.labels().iter().enumerate() {
        assert_eq!(*label == Label::Unknown, depth.depth()[i] == 0.0);
        assert_eq!(*label == Label::Unknown, view.image.pixels()[i] == [0; 3]);
    }
}

#[test]
fn the_pinhole_of_a_crop_from_a_lens_s_corner_covers_the_whole_crop() {
    let wide = Distortion::Brown { k: [-0.25, 0.04, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
    for distortion in [wide, Distortion::Fisheye { k: [0.0; 4] }] {
        let intrinsics = Intrinsics { fx: 900.0, fy: 900.0, cx: 640.0, cy: 360.0 };
        let whole =
            Camera { width: 1280, height: 720, intrinsics, distortion, vehicle_from_camera: Pose::IDENTITY };
        for (x, y) in [(0, 0), (1080, 0), (0, 570), (1080, 570), (540, 285)] {
            let part = whole.cropped(x, y, 200, 150).unwrap();
            let pinhole = pinhole_for(&part).unwrap();
            for (u, v) in [(0.5, 0.5), (199.5, 0.5), (0.5, 149.5), (199.5, 149.5), (100.0, 75.0)] {
                let [u, v] = pinhole.project(part.ray([u, v]).unwrap()).unwrap();
                let (w, h) = (f64::from(pinhole.width), f64::from(pinhole.height));
                assert!(
                    (0.0..=w).contains(&u) && (0.0..=h).contains(&v),
                    "({x}, {y}): ({u}, {v}) of {w}x{h}"
                );
            }
        }
    }
}
