//! Models of other programs, in the layouts that these write, with known answers.

use glam::{DMat3, DQuat, DVec3};
use std::io::Write;
use std::path::Path;
use vg::geometry::Similarity;
use vg::imports::{Up, merge_views, place_object};
use vg::io::ply;
use vg::pipeline::{Options, PriorChoice};
use vg::scene::Cloud;
use vg::{Gaussians, Result, Scene, View};
use vg_testing::{Random, sample};

/// Writes a PLY as both programs do: normals of zero, one colour, logit opacity, logarithmic scales.
fn write(path: &Path, g: &Gaussians) {
    const FIELDS: [&str; 17] = [
        "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
        "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
    ];
    let mut out = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", g.len()).into_bytes();
    for field in FIELDS {
        writeln!(out, "property float {field}").unwrap();
    }
    out.extend(b"end_header\n");
    for i in 0..g.len() {
        let opacity = g.opacities()[i].clamp(1e-6, 1.0 - 1e-6);
        let color = &g.sh()[i * g.sh_stride()..];
        let scales = g.scales()[i].map(f32::ln);
        let row = g.means()[i].into_iter().chain([0.0; 3]).chain(color[..3].iter().copied());
        let row = row.chain([(opacity / (1.0 - opacity)).ln()]).chain(scales).chain(g.rotations()[i]);
        row.for_each(|value| out.extend(value.to_le_bytes()));
    }
    std::fs::write(path, out).unwrap();
}

fn read(path: &Path) -> Gaussians {
    ply::read(path).unwrap().0
}

fn model() -> Result<(Scene, Gaussians)> {
    let scene = sample::open(&sample::INPUTS, true)?;
    let given = Options { prior: PriorChoice::Given, sh_degree: 0, ..Options::default() };
    let made = sample::run(&scene, &given)?.gaussians;
    Ok((scene, made))
}

fn turn(degrees: [f64; 3]) -> DMat3 {
    let [x, y, z] = degrees.map(f64::to_radians);
    DMat3::from_quat(DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x))
}

/// Output of Depth Anything 3 for a view: a Gaussian for each pixel of a coarse grid with depth, and a wall 30 m away
/// for the others. Also returns the number of those on the vehicle.
fn gaussians_from_view(view: &View) -> (Gaussians, usize) {
    let (mut g, mut on_vehicle) = (Gaussians::with_capacity(0, 0), 0);
    let depth = view.depth.as_ref().unwrap();
    for v in (0..view.camera.height).step_by(3) {
        for u in (0..view.camera.width).step_by(3) {
            let inside = view.mask.as_ref().unwrap().is_vehicle(u, v);
            let known = depth.get(u, v);
            if inside != known.is_some() {
                continue;
            }
            on_vehicle += usize::from(inside);
            let mean = view.lift(u, v, known.unwrap_or(30.0)).to_array();
            g.push(&vg::gaussians::buffer::Gaussian {
                mean,
                rotation: [1.0, 0.0, 0.0, 0.0],
                scale: [0.01; 3],
                opacity: 0.9,
                sh0: [0.1, 0.2, 0.3],
            });
        }
    }
    (g, on_vehicle)
}

#[test]
fn a_ply_for_each_view_is_cut_by_the_masks_and_moved_by_the_cameras() {
    let scene = sample::open(&sample::INPUTS, true).unwrap();
    let folder = tempfile::tempdir().unwrap();
    // The frame of the network's first camera, in another unit.
    let to_vehicle = Similarity {
        scale: 3.7,
        rotation: turn([100.0, -4.0, 31.0]),
        translation: DVec3::new(4.0, -6.0, 1.0),
    };
    let from_vehicle = to_vehicle.inverse();
    let (mut parts, mut expected) = (Vec::new(), 0);
    for view in &scene.views {
        let (g, on_vehicle) = gaussians_from_view(view);
        let path = folder.path().join(&view.name).with_extension("ply");
        write(&path, &g.transformed(&from_vehicle).unwrap());
        parts.push(read(&path));
        expected += on_vehicle;
    }
    let centers: Vec<(String, DVec3)> = scene
        .views
        .iter()
        .map(|v| (v.name.clone(), from_vehicle.transform_point(v.camera.center())))
        .collect();
    let merged = merge_views(&parts, &scene.views, Some(&centers)).unwrap();
    assert!(expected > 5000 && merged.len() == expected, "{} of {expected}", merged.len());
    // The vehicle's Gaussians lie at its depth.
    let exact = merge_views(
        &scene.views.iter().map(|v| gaussians_from_view(v).0).collect::<Vec<_>>(),
        &scene.views,
        None,
    )
    .unwrap();
    assert_eq!(exact.len(), expected);
    for (a, b) in merged.means().iter().zip(exact.means()) {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-4), "{a:?} {b:?}");
    }
    assert!(merged.scales().iter().all(|s| (s[0] - 0.01).abs() < 1e-5));

    // One PLY of all views: a centre must be on the vehicle in every view that shows it, so some go at silhouettes.
    let all = parts[1..].iter().fold(parts[0].clone(), |all, part| all.merged(part));
    let one = merge_views(&[all], &scene.views, Some(&centers)).unwrap();
    assert!(one.len() <= expected && one.len() * 10 > expected * 9, "{} of {expected}", one.len());
}

#[test]
fn an_object_of_any_size_and_heading_is_fitted_to_the_scan() {
    let (scene, made) = model().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("object.ply");
    // A scan: points of the surface with 5 mm of noise, and strays.
    let mut random = Random::new(3);
    let mut points: Vec<[f32; 3]> = Vec::new();
    for mean in made.means().iter().step_by(7) {
        points.push(mean.map(|v| v + (0.005 * random.normal()) as f32));
    }
    for _ in 0..points.len() / 100 {
        points.push([3.0, 1.3, 1.0].map(|half| random.uniform(-half, half) as f32));
    }
    let scan = Cloud::new(points).unwrap();
    for (up, heading) in [(Up::MinusY, 0.0), (Up::MinusY, 180.0), (Up::Z, 90.0), (Up::MinusY, 243.0)] {
        // Into the unit cube, turned; TRELLIS then writes (x, -z, y).
        let cube = Similarity {
            scale: 1.0 / 4.7,
            rotation: turn([0.0, 0.0, heading]),
            translation: DVec3::new(0.01, 0.0, -0.02),
        };
        let file = match up {
            Up::Z => DMat3::IDENTITY,
            Up::MinusY => DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y),
        };
        let object_from_vehicle =
            Similarity { rotation: file * cube.rotation, translation: file * cube.translation, ..cube };
        write(&path, &made.transformed(&object_from_vehicle).unwrap());
        let object = read(&path);
        let longest = object.bounds().map(|(low, high)| (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max));
        assert!(longest.unwrap() <= 1.2);
        let placed = place_object(&object, up, &scan, &scene.views).unwrap();
        let found = placed.vehicle_from_object;
        let truth = object_from_vehicle.inverse();
        let trace = (found.rotation * truth.rotation.transpose()).to_cols_array();
        let degrees = (0.5 * (trace[0] + trace[4] + trace[8] - 1.0)).clamp(-1.0, 1.0).acos().to_degrees();
        let middle = object_from_vehicle.transform_point(DVec3::ZERO);
        let off = found.transform_point(middle).length();
        assert!((found.scale / truth.scale - 1.0).abs() < 0.005, "{up:?} {heading}: {found:?} {truth:?}");
        assert!(degrees < 0.5 && off < 0.02, "{up:?} {heading}: {degrees} degrees, {off} m");
        assert!(placed.residual_m < 0.03, "{}", placed.residual_m);
    }
}

#[test]
fn invalid_imports_are_errors_that_name_the_cause() {
    let (scene, made) = model().unwrap();
    let message = |result: Result<Gaussians>| result.unwrap_err().to_string();
    let two = [made.clone(), made.clone()];
    assert!(message(merge_views(&two, &scene.views, None)).contains("parts"));
    assert!(message(merge_views(&two, &[], None)).contains("parts"));
    let centers = vec![("000.png".to_owned(), DVec3::ZERO)];
    assert!(message(merge_views(&two[..1], &scene.views, Some(&centers))).contains("\"001.png\""));
    let on_a_line: Vec<_> = (0..4).map(|i| (format!("00{i}.png"), DVec3::X * f64::from(i))).collect();
    assert!(merge_views(&two[..1], &scene.views, Some(&on_a_line)).is_err());
    let far =
        made.transformed(&Similarity { translation: DVec3::Z * 100.0, ..Similarity::IDENTITY }).unwrap();
    assert!(message(merge_views(&[far], &scene.views, None)).contains("no Gaussian lies on the vehicle"));
    let mut bare = scene.views.clone();
    bare[2].mask = None;
    assert!(message(merge_views(&two[..1], &bare, None)).contains("no mask"));

    let few = Cloud::new(vec![[0.0; 3]; 5]).unwrap();
    let error = place_object(&made, Up::Z, &few, &scene.views).unwrap_err().to_string();
    assert!(error.contains("scan: 5 points") || error.contains("scan"), "{error}");
    let line: Vec<[f32; 3]> = (0..500).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
    // A rotation about a line is undetermined: an error or a finite result, never a panic.
    if let Ok(placed) = place_object(&made, Up::Z, &Cloud::new(line).unwrap(), &scene.views) {
        assert!(placed.gaussians.means().iter().flatten().all(|v| v.is_finite()));
    }
}
