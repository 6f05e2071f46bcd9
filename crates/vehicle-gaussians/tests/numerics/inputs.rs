//! Calls with extreme input other than scenes: each gives an error that names the argument, or a finite result.

use crate::cases::{forward, grey};
use glam::{DMat3, DVec3};
use std::ops::ControlFlow;
use vg::geometry::Similarity;
use vg::pipeline::{Calibrate, Keep, LeftOut, Options, PriorChoice, Reconstruction, reconstruct};
use vg::relight::Relight;
use vg::render::{CpuRenderer, RenderOptions, Renderer};
use vg::scene::mask::Label;
use vg::scene::{DepthMap, Mask};
use vg::symmetry::SymmetryMode;
use vg::{Camera, Gaussians, Pose, Result, Scene};
use vg_testing::scenes::{looking_at_origin, random};
use vg_testing::vehicle::{camera, right_side, view};

/// The promise of a call.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Contract {
    /// An error that begins with the argument's name.
    Refused(&'static str),
    /// A finite result.
    Finite,
}
use Contract::{Finite, Refused};

/// A call, and its promise.
pub struct Input {
    pub condition: &'static str,
    pub call: &'static str,
    pub contract: Contract,
    /// Returns the result in words.
    run: fn() -> Result<String>,
}

impl Input {
    /// Text of the error, or of the result.
    pub fn outcome(&self) -> Result<String, String> {
        (self.run)().map_err(|e| e.to_string())
    }
}

pub(crate) fn all() -> Vec<Input> {
    let mut out = numbers();
    out.extend(poses());
    out.extend(frames());
    out.extend(pixels());
    out.extend(views());
    out
}

fn numbers() -> Vec<Input> {
    let from_arrays = "Gaussians::from_arrays";
    vec![
        Input {
            condition: "a quaternion of norm 0",
            call: from_arrays,
            contract: Refused("rotations[0]"),
            run: || single([1.0; 3], [0.0; 4], [0.1; 3], 0.5).map(in_words),
        },
        Input {
            condition: "a quaternion of norm 1e-45, f32's smallest",
            call: from_arrays,
            contract: Finite,
            run: || single([1.0; 3], [f32::from_bits(1), 0.0, 0.0, 0.0], [0.1; 3], 0.5).map(in_words),
        },
        Input {
            condition: "a standard deviation of 0",
            call: from_arrays,
            contract: Refused("scales[0]"),
            run: || single([1.0; 3], [1.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.1], 0.5).map(in_words),
        },
        Input {
            condition: "an opacity of 1 + 2^-23",
            call: from_arrays,
            contract: Refused("opacities[0]"),
            run: || single([1.0; 3], [1.0, 0.0, 0.0, 0.0], [0.1; 3], 1.0f32.next_up()).map(in_words),
        },
        Input {
            condition: "a mean that is NaN",
            call: from_arrays,
            contract: Refused("means[0]"),
            run: || single([f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.1; 3], 0.5).map(in_words),
        },
        Input {
            condition: "focal length 0",
            call: "Renderer::render",
            contract: Refused("camera.focal length"),
            run: || {
                drawn(&Camera {
                    intrinsics: vg::geometry::Intrinsics { fx: 0.0, ..forward(8, 8, 8.0).intrinsics },
                    ..forward(8, 8, 8.0)
                })
            },
        },
        Input {
            condition: "a picture of 8193x8",
            call: "Renderer::render",
            contract: Refused("camera.size"),
            run: || drawn(&Camera { width: 8193, ..forward(8, 8, 8.0) }),
        },
        Input {
            condition: "a camera 1e13 m away",
            call: "Renderer::render",
            contract: Refused("camera.vehicle_from_camera"),
            run: || {
                let mut camera = forward(8, 8, 8.0);
                camera.vehicle_from_camera.translation.x = 1e13;
                drawn(&camera)
            },
        },
    ]
}

fn poses() -> Vec<Input> {
    fn pose(change: fn(DMat3) -> DMat3) -> Result<String> {
        let rotation = DMat3::IDENTITY;
        let found = Pose::new("views[0].pose", change(rotation), DVec3::ZERO)?.rotation;
        let defect = largest(found.transpose() * found - DMat3::IDENTITY);
        assert!(defect < 1e-15, "{defect}");
        Ok(format!(
            "the nearest rotation: orthonormal to 1e-15, {:.0e} from the true one",
            largest(found - rotation)
        ))
    }
    let call = "Pose::new";
    vec![
        Input {
            condition: "a rotation with noise of 1e-3",
            call,
            contract: Finite,
            run: || {
                pose(|mut r| {
                    r.x_axis.y += 1e-3;
                    r
                })
            },
        },
        Input {
            condition: "a reflection",
            call,
            contract: Refused("views[0].pose"),
            run: || pose(|r| r * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0))),
        },
        Input {
            condition: "a scale of 1.1",
            call,
            contract: Refused("views[0].pose"),
            run: || pose(|r| r * 1.1),
        },
        Input {
            condition: "a matrix of zeros",
            call,
            contract: Refused("views[0].pose"),
            run: || pose(|_| DMat3::ZERO),
        },
        Input {
            condition: "a NaN entry",
            call,
            contract: Refused("views[0].pose"),
            run: || {
                pose(|mut r| {
                    r.y_axis.z = f64::NAN;
                    r
                })
            },
        },
    ]
}

fn frames() -> Vec<Input> {
    fn moved(similarity: Similarity) -> Result<String> {
        random(31, 50, 2, [0.01, 0.1]).transformed(&similarity).map(in_words)
    }
    let call = "Gaussians::transformed";
    vec![
        Input {
            condition: "a camera in ECEF, 6.4e6 m from its origin",
            call: "Pose::inverse, Pose::after, Renderer::render",
            contract: Finite,
            run: placed_in_the_world,
        },
        Input {
            condition: "Gaussians into UTM: an f32 step of 0.5 m",
            call,
            contract: Refused("to_from_vehicle"),
            run: || {
                moved(Similarity {
                    translation: DVec3::new(500_000.0, 5_400_000.0, 300.0),
                    ..Similarity::IDENTITY
                })
            },
        },
        Input {
            condition: "a translation of 16 km: an f32 step of 0.98 mm",
            call,
            contract: Finite,
            run: || moved(Similarity { translation: DVec3::new(16_000.0, 0.0, 0.0), ..Similarity::IDENTITY }),
        },
        Input {
            condition: "a translation of 16,384 m: an f32 step of 1.95 mm",
            call,
            contract: Refused("to_from_vehicle"),
            run: || moved(Similarity { translation: DVec3::new(16_386.5, 0.0, 0.0), ..Similarity::IDENTITY }),
        },
        Input {
            condition: "a scale factor of 1e-6",
            call,
            contract: Finite,
            run: || moved(Similarity { scale: 1e-6, ..Similarity::IDENTITY }),
        },
        Input {
            condition: "a scale factor of 1e6",
            call,
            contract: Refused("to_from_vehicle"),
            run: || moved(Similarity { scale: 1e6, ..Similarity::IDENTITY }),
        },
        Input {
            condition: "a scale factor of -1",
            call,
            contract: Refused("to_from_vehicle.scale"),
            run: || moved(Similarity { scale: -1.0, ..Similarity::IDENTITY }),
        },
        Input {
            condition: "a scene scaled by 1e-6",
            call: "reconstruct, prior given",
            contract: Finite,
            run: || scaled_scene(1e-6),
        },
        Input {
            condition: "a scene scaled by 1e6",
            call: "reconstruct, prior given",
            contract: Refused("head"),
            run: || scaled_scene(1e6),
        },
    ]
}

fn pixels() -> Vec<Input> {
    vec![
        Input {
            condition: "depth pixels NaN, inf, -inf, -1, 0, 1e9, 2.5",
            call: "DepthMap::new",
            contract: Finite,
            run: || {
                let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e9, 2.5];
                let map = DepthMap::new(7, 1, odd.to_vec())?;
                Ok(format!("only the last is a measurement: {:?}", map.depth()))
            },
        },
        Input {
            condition: "the left half of each depth map NaN",
            call: "reconstruct, prior given",
            contract: Finite,
            run: || {
                let mut scene = right_side(48, 36);
                for view in &mut scene.views {
                    let depth = view.depth.as_ref().unwrap().depth().iter().enumerate();
                    let holes = depth.map(|(i, d)| if i % 48 >= 24 { *d } else { f32::NAN }).collect();
                    view.depth = Some(DepthMap::new(48, 36, holes)?);
                }
                summed_up(&run(&scene, &options())?)
            },
        },
        Input {
            condition: "every other column of each depth map NaN: no pixel has neighbours",
            call: "reconstruct, prior given",
            contract: Refused("head"),
            run: || {
                let mut scene = right_side(48, 36);
                for view in &mut scene.views {
                    let depth = view.depth.as_ref().unwrap().depth().iter().enumerate();
                    let holes = depth.map(|(i, d)| if i % 2 == 0 { *d } else { f32::NAN }).collect();
                    view.depth = Some(DepthMap::new(48, 36, holes)?);
                }
                summed_up(&run(&scene, &options())?)
            },
        },
        Input {
            condition: "no depth pixel measured",
            call: "reconstruct, prior given",
            contract: Refused("head"),
            run: || {
                let mut scene = right_side(48, 36);
                for view in &mut scene.views {
                    view.depth = Some(DepthMap::new(48, 36, vec![f32::NAN; 48 * 36])?);
                }
                summed_up(&run(&scene, &options())?)
            },
        },
        Input {
            condition: "all masks empty",
            call: "reconstruct",
            contract: Refused("views"),
            run: || masked(|_| Label::Background),
        },
        Input {
            condition: "all masks full",
            call: "reconstruct",
            contract: Finite,
            run: || masked(|_| Label::Vehicle),
        },
        Input {
            condition: "masks of one pixel",
            call: "reconstruct",
            contract: Finite,
            run: || masked(|i| if i == 18 * 48 + 24 { Label::Vehicle } else { Label::Background }),
        },
    ]
}

fn views() -> Vec<Input> {
    fn from_azimuths(azimuths: &[f64], keep: Keep) -> Result<String> {
        let views = azimuths.iter().map(|a| view(&format!("{a}"), camera(*a, 6.5, 48, 36))).collect();
        summed_up(&run(&Scene { views, ..Scene::default() }, &Options { keep, ..options() })?)
    }
    let call = "reconstruct";
    vec![
        Input {
            condition: "no views",
            call,
            contract: Refused("views"),
            run: || from_azimuths(&[], Keep::default()),
        },
        Input {
            condition: "one view",
            call,
            contract: Finite,
            run: || from_azimuths(&[-75.0], Keep::default()),
        },
        Input {
            condition: "64 views",
            call,
            contract: Finite,
            run: || {
                from_azimuths(
                    &(0..64).map(|i| -170.0 + 2.5 * f64::from(i)).collect::<Vec<_>>(),
                    Keep::default(),
                )
            },
        },
        Input {
            condition: "the same view twice",
            call,
            contract: Finite,
            run: || from_azimuths(&[-75.0, -75.0], Keep::default()),
        },
        Input {
            condition: "the same view twice, both kept",
            call,
            contract: Finite,
            run: || from_azimuths(&[-75.0, -75.0], Keep { duplicate_views: true, ..Keep::default() }),
        },
    ]
}

fn largest(m: DMat3) -> f64 {
    m.to_cols_array().iter().fold(0.0, |worst, v| v.abs().max(worst))
}

fn single(mean: [f32; 3], rotation: [f32; 4], scale: [f32; 3], opacity: f32) -> Result<Gaussians> {
    Gaussians::from_arrays(0, vec![mean], vec![rotation], vec![scale], vec![opacity], vec![0.0; 3])
}

fn assert_finite(g: &Gaussians) {
    let arrays = [
        g.means().as_flattened(),
        g.rotations().as_flattened(),
        g.scales().as_flattened(),
        g.opacities(),
        g.sh(),
    ];
    assert!(arrays.iter().all(|a| a.iter().all(|v| v.is_finite())));
}

#[allow(clippy::needless_pass_by_value)] // passed to `Result::map`
fn in_words(g: Gaussians) -> String {
    assert_finite(&g);
    match g.len() {
        1 => format!("stored, rotation {:?}", g.rotations()[0]),
        n => format!(
            "{n} Gaussians, means up to {:.1e} m",
            g.means().as_flattened().iter().fold(0.0f32, |m, v| v.abs().max(m))
        ),
    }
}

fn drawn(camera: &Camera) -> Result<String> {
    let g = grey(&[([5.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.1; 3], 0.5)]);
    CpuRenderer::new().render(&g, camera, &RenderOptions::default()).map(|_| "drawn".to_owned())
}

/// World placement is a pose in f64: the camera is recovered to the rounding of 6.4e6 m in f64.
fn placed_in_the_world() -> Result<String> {
    let gaussians = random(32, 500, 1, [0.01, 0.1]);
    let camera = looking_at_origin(96, 72, DVec3::new(0.4, -1.0, 0.3), 7.0);
    let up = DMat3::from_euler(glam::EulerRot::ZYX, 0.4, 1.1, -0.7);
    let world_from_vehicle = Pose::new("world_from_vehicle", up, DVec3::new(4.19e6, 0.87e6, 4.72e6))?;
    let world_from_camera = world_from_vehicle.after(&camera.vehicle_from_camera);
    let back =
        Camera { vehicle_from_camera: world_from_vehicle.inverse().after(&world_from_camera), ..camera };
    let moved = (back.center() - camera.center()).length();
    let options = RenderOptions::default();
    let [expected, found] = [&camera, &back].map(|c| CpuRenderer::new().render(&gaussians, c, &options));
    let [color, ..] = vg_testing::compare(&found?, &expected?);
    // A step of f64 at 4e6 m is 9e-10 m; a nanometre is 1e-8 px.
    assert!(moved < 1e-8 && color.max < 1e-5, "{moved} {color:?}");
    Ok("the camera comes back within 1e-8 m, the picture's colours within 1e-5".into())
}

fn options() -> Options {
    Options {
        prior: PriorChoice::Given,
        symmetry: SymmetryMode::Always,
        relight: Relight::Never,
        calibrate: Calibrate::Off,
        threads: 2,
        ..Options::default()
    }
}

fn run(scene: &Scene, options: &Options) -> Result<Reconstruction> {
    reconstruct(scene, options, &mut |_| ControlFlow::Continue(()))
}

fn summed_up(made: &Reconstruction) -> Result<String> {
    assert_finite(&made.gaussians);
    let report = &made.report;
    // Counts of pixels on edges depend on rounding; counts of pixels without a measurement do not.
    let counted = |l: &&LeftOut| l.what == "views" || l.why == "no depth measured";
    let left: Vec<String> = report
        .left_out
        .iter()
        .filter(counted)
        .map(|l| format!("{} {}: {}", l.count, l.what, l.why))
        .collect();
    let left = if left.is_empty() { String::new() } else { format!("; left out {}", left.join(", ")) };
    Ok(format!("finite Gaussians, views used: {}{left}", report.views_used.len()))
}

fn masked(label: fn(usize) -> Label) -> Result<String> {
    let mut scene = right_side(48, 36);
    for view in &mut scene.views {
        view.mask = Some(Mask::new(48, 36, (0..48 * 36).map(label).collect())?);
    }
    summed_up(&run(&scene, &options())?)
}

fn scaled_scene(factor: f32) -> Result<String> {
    let mut scene = right_side(48, 36);
    for view in &mut scene.views {
        view.camera.vehicle_from_camera.translation *= f64::from(factor);
        let depth = view.depth.as_ref().unwrap().depth().iter().map(|d| d * factor).collect();
        view.depth = Some(DepthMap::new(48, 36, depth)?);
    }
    summed_up(&run(&scene, &options())?)
}

#[test]
fn every_input_gives_an_error_that_names_it_or_a_finite_result() {
    let mut failures = Vec::new();
    for input in all() {
        let outcome = input.outcome();
        println!("{:45} {outcome:?}", input.condition);
        let kept = match (&outcome, input.contract) {
            (Err(words), Refused(argument)) => words.starts_with(argument),
            (Ok(_), Finite) => true,
            _ => false,
        };
        if !kept {
            failures.push(format!("{}: {outcome:?}, not {:?}", input.condition, input.contract));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
