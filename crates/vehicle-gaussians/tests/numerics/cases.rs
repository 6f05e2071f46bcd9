//! Stiff scenes for a renderer (method section 8), each with the bounds of its picture and gradients.

use glam::{DMat3, DVec3, Mat3, Vec3};
use vg::geometry::camera::Intrinsics;
use vg::head::attributes::{Activated, CHANNELS, Offset, ScaleActivation, activate};
use vg::render::{Background, RenderOptions};
use vg::{Camera, Gaussians, Pose};
use vg_testing::scenes::{looking_at_origin, random};

/// A scene, and the bounds of the error of its picture and gradients against the f64 reference.
pub struct Case {
    pub condition: &'static str,
    /// The behaviour, for the document.
    pub contract: &'static str,
    pub gaussians: Gaussians,
    pub camera: Camera,
    pub options: RenderOptions,
    /// Whether anything is drawn.
    pub drawn: bool,
    /// Bound of colour (relative to the largest, at least 1) and alpha.
    pub picture: f64,
    /// Bound of depth, relative to itself.
    pub depth: f64,
    /// Bound of each gradient, relative to the largest in its tensor.
    pub gradient: f64,
    /// Whether the loss depends on depth.
    pub depth_in_loss: bool,
    /// Step of the central differences: well below the scale on which the picture changes.
    pub step: f64,
}

/// The smallest tensor that central differences resolve to [`DIFFERENCES`], times their step: a loss of about a hundred
/// is rounded by 2e-14.
pub const RESOLUTION: f64 = 2e-9;
/// Error of f32 sums of tens of layers.
pub const PICTURE: f64 = 5e-6;
/// Error of a mean of depths whose weights sum to the divisor: again f32 sums of tens of layers.
pub const DEPTH: f64 = 3e-6;
/// Error of f32 sums over hundreds of pixels; the largest is that of expected depth: its f32 step (5e-7 m at 5 m) over
/// an alpha of 1/255.
pub const GRADIENT: f64 = 1e-4;
/// Error of central differences of fourth order in f64, over sums that cancel.
pub const DIFFERENCES: f64 = 1e-5;

const UNIT: [f32; 4] = [1.0, 0.0, 0.0, 0.0];
const TURNED: [f32; 4] = [0.8, 0.2, -0.4, 0.4];

fn options() -> RenderOptions {
    RenderOptions { background: Background::Color([0.1, 0.2, 0.3]), ..RenderOptions::default() }
}

fn case(condition: &'static str, contract: &'static str, gaussians: Gaussians, camera: Camera) -> Case {
    Case {
        condition,
        contract,
        gaussians,
        camera,
        options: options(),
        drawn: true,
        picture: PICTURE,
        depth: DEPTH,
        gradient: GRADIENT,
        depth_in_loss: true,
        step: 1e-6,
    }
}

/// A camera at the origin that looks along +x of the vehicle, z up.
pub(crate) fn forward(width: u32, height: u32, focal: f64) -> Camera {
    let rotation = DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_Z, DVec3::X);
    let (cx, cy) = (0.5 * f64::from(width), 0.5 * f64::from(height));
    let intrinsics = Intrinsics { fx: focal, fy: focal, cx, cy };
    Camera::pinhole(width, height, intrinsics, Pose { rotation, translation: DVec3::ZERO }).unwrap()
}

/// Mean, rotation, scale, opacity.
type Shape = ([f32; 3], [f32; 4], [f32; 3], f32);

/// Grey Gaussians of degree 0.
pub(crate) fn grey(each: &[Shape]) -> Gaussians {
    let sh = each.iter().enumerate().flat_map(|(i, _)| [0.3, 0.1 * (i % 5) as f32, -0.3]).collect();
    Gaussians::from_arrays(
        0,
        each.iter().map(|g| g.0).collect(),
        each.iter().map(|g| g.1).collect(),
        each.iter().map(|g| g.2).collect(),
        each.iter().map(|g| g.3).collect(),
        sh,
    )
    .unwrap()
}

/// Copies Gaussians with their arrays changed.
fn rebuilt(
    g: &Gaussians,
    change: impl Fn(&mut Vec<[f32; 3]>, &mut Vec<[f32; 4]>, &mut Vec<f32>),
) -> Gaussians {
    let (mut means, mut rotations, mut sh) = (g.means().to_vec(), g.rotations().to_vec(), g.sh().to_vec());
    change(&mut means, &mut rotations, &mut sh);
    let (scales, opacities) = (g.scales().to_vec(), g.opacities().to_vec());
    Gaussians::from_arrays(g.sh_degree(), means, rotations, scales, opacities, sh).unwrap()
}

/// Gaussians from a head's raw channels, a row of pixels 0.3 m apart.
fn activated(raws: &[[f32; CHANNELS]]) -> Gaussians {
    let all: Vec<Activated> = raws
        .iter()
        .enumerate()
        .map(|(i, raw)| {
            let point = Vec3::new(5.0, 0.3 * i as f32 - 0.3, 0.0);
            let (activation, offset) = (ScaleActivation::Softplus, Offset::Applied);
            activate(raw, point, &Mat3::IDENTITY, [0.25, 0.5, 0.75], activation, offset)
        })
        .collect();
    Gaussians::from_arrays(
        2,
        all.iter().map(|a| a.mean).collect(),
        all.iter().map(|a| a.rotation).collect(),
        all.iter().map(|a| a.scale).collect(),
        all.iter().map(|a| a.opacity).collect(),
        all.iter().flat_map(|a| a.sh).collect(),
    )
    .unwrap()
}

/// All scenes, in the order of the document.
pub(crate) fn all() -> Vec<Case> {
    let mut out = shapes();
    out.extend(attributes());
    out.extend(cameras());
    out.extend(places());
    out.extend(crowds());
    out
}

fn shapes() -> Vec<Case> {
    let camera = forward(48, 36, 40.0);
    let needles = grey(&[
        ([5.0, 0.2, 0.1], TURNED, [1e-10, 3.0, 1e-10], 0.8),
        ([4.0, -0.3, 0.3], [0.5, 0.5, 0.1, 0.3], [3.0, 1e-10, 3.0], 0.6),
        ([6.0, 0.1, -0.4], UNIT, [1e-10, 1e-10, 3.0], 0.9),
    ]);
    let side = looking_at_origin(48, 36, DVec3::new(0.4, -1.0, 0.3), 7.0);
    vec![
        case("1e-10 m and 3 m in one Gaussian", "drawn as a needle or a disc", needles.clone(), camera),
        Case {
            options: RenderOptions { antialiased: true, ..options() },
            ..case(
                "1e-10 m and 3 m in one Gaussian, antialiased",
                "drawn, its opacity compensated",
                needles,
                camera,
            )
        },
        case("1e-8 m to 3 m in one scene", "drawn", random(21, 120, 1, [1e-8, 3.0]), side),
        case(
            "1e9 m, the largest",
            "covers the picture evenly",
            grey(&[([5.0, 0.0, 0.0], UNIT, [1e9; 3], 0.5)]),
            camera,
        ),
    ]
}

fn attributes() -> Vec<Case> {
    let camera = forward(48, 36, 40.0);
    let side = looking_at_origin(48, 36, DVec3::new(0.4, -1.0, 0.3), 7.0);
    let scene = random(22, 60, 1, [0.02, 0.3]);
    let times = |k: f32| rebuilt(&scene, |_, q, _| q.iter_mut().for_each(|q| *q = q.map(|v| v * k)));
    let mut raws = [[0.0f32; CHANNELS]; 3];
    for (raw, o) in raws.iter_mut().zip([1e4, -1e4, -8.0]) {
        raw[0] = o;
        // softplus(-3) = 0.05 m
        raw[8..11].fill(-3.0);
    }
    let bright = rebuilt(&random(23, 60, 3, [0.02, 0.3]), |_, _, sh| sh.iter_mut().for_each(|v| *v *= 1e6));
    vec![
        case("quaternions of norm 1e-30", "normalised", times(1e-30), side),
        case("quaternions of norm 1e30", "normalised", times(1e30), side),
        case(
            "raw opacity of 1e4 and -1e4",
            "opacity 1, clamped at 0.99, and 0, not drawn",
            activated(&raws),
            camera,
        ),
        Case { step: 1e-4, ..case("SH coefficients of 1e6", "colours of 1e6, none below 0", bright, side) },
    ]
}

fn cameras() -> Vec<Case> {
    let scene = random(24, 80, 2, [0.01, 0.2]);
    let towards = DVec3::new(0.4, -1.0, 0.3);
    let focal = |focal: f64| {
        let camera = looking_at_origin(48, 36, towards, 7.0);
        Camera { intrinsics: Intrinsics { fx: focal, fy: focal, ..camera.intrinsics }, ..camera }
    };
    // Through a telescope, pixels are micrometres: the tip of one disc fills the picture.
    let close = grey(&[
        ([5.0, 0.0, 0.0], TURNED, [0.02, 0.03, 1e-3], 0.8),
        ([6.0, 1e-5, 0.0], TURNED, [1e-5; 3], 0.7),
    ]);
    let telescope = |focal: f64| forward(48, 36, focal);
    let sized = |width: u32, height: u32| looking_at_origin(width, height, towards, 7.0);
    // 1 m is a whole number of f32 steps at 2^20 m, so moving the scene there rounds nothing.
    let offset = DVec3::new(1_048_576.0, -1_048_576.0, 0.0);
    let moved = rebuilt(&scene, |means, _, _| {
        for m in means {
            *m = [m[0] + offset.x as f32, m[1] + offset.y as f32, m[2]];
        }
    });
    let mut far = sized(48, 36);
    far.vehicle_from_camera.translation += offset;
    let distant = looking_at_origin(48, 36, towards, 1e6);
    let distant = Camera { intrinsics: Intrinsics { fx: 7e6, fy: 7e6, ..distant.intrinsics }, ..distant };
    vec![
        case("focal length 1 px", "drawn: the vehicle is less than a pixel", scene.clone(), focal(1.0)),
        Case {
            step: 1e-7,
            ..case("focal length 1e6 px", "drawn: a pixel is 5 micrometres", close.clone(), telescope(1e6))
        },
        Case {
            step: 1e-7,
            ..case(
                "focal length 1e9 px, the largest",
                "drawn: a pixel is 5 nanometres",
                close,
                telescope(1e9),
            )
        },
        case("picture of 1x1", "drawn", scene.clone(), sized(1, 1)),
        Case { step: 1e-8, ..case("picture of 8192x4", "drawn", scene.clone(), sized(8192, 4)) },
        case("picture of 4x8192", "drawn", scene.clone(), sized(4, 8192)),
        Case {
            // The view matrix turns the scene about an origin 1.5e6 m away, where this is eight steps of f64.
            step: 2f64.powi(-30),
            ..case(
                "vehicle and camera 1.5e6 m away",
                "drawn: the difference to the camera is taken in f64",
                moved,
                far,
            )
        },
        Case {
            depth_in_loss: false,
            ..case("seen from 1e6 m through a telescope, no loss on depth", "drawn", scene.clone(), distant)
        },
        Case {
            // Depths of 1e6 m have an f32 step of 6 cm, of which the vehicle is 70 deep.
            gradient: 1.0,
            step: 1e-4,
            ..case(
                "seen from 1e6 m through a telescope, with a loss on depth",
                "drawn; gradients of expected depth are as coarse as depth's f32 step, 6 cm",
                scene,
                distant,
            )
        },
    ]
}

fn places() -> Vec<Case> {
    let camera = forward(48, 36, 40.0);
    let near = options().near;
    let one = |x: f32, scale: [f32; 3]| grey(&[([x, 0.1 * x, -0.05 * x], TURNED, scale, 0.8)]);
    let not_drawn = |condition: &'static str, g: Gaussians| Case {
        drawn: false,
        ..case(condition, "not drawn", g, camera)
    };
    vec![
        case(
            "around the camera's centre, in front of it",
            "drawn, flat, as splatting does",
            one(0.1, [1.0, 0.5, 0.2]),
            camera,
        ),
        not_drawn("around the camera's centre, behind it", one(-0.1, [1.0, 0.5, 0.2])),
        not_drawn("on the near plane", one(near, [0.01, 0.005, 0.002])),
        Case {
            step: 1e-10,
            ..case("one f32 beyond the near plane", "drawn", one(near.next_up(), [1e-3, 5e-4, 2e-4]), camera)
        },
        not_drawn("behind the camera", one(-5.0, [0.2, 0.1, 0.05])),
        case(
            "outside the picture, reaching into it",
            "drawn, its projection clamped to 15 % beyond",
            grey(&[([2.0, 2.0, 0.1], TURNED, [0.5, 0.4, 0.2], 0.8)]),
            camera,
        ),
    ]
}

fn crowds() -> Vec<Case> {
    let camera = forward(12, 9, 40.0);
    let n = 1_000_000;
    let mut ray = Gaussians::with_capacity(0, n);
    ray.append(&grey(&vec![([3.0, 0.0, 0.0], UNIT, [0.05; 3], 0.9); n]));
    let stack = |opacity: f32| {
        let at = |i: usize| ([3.0 + 1e-5 * i as f32, 0.0, 0.0], TURNED, [0.3, 0.2, 0.1], opacity);
        grey(&(0..100_000).map(at).collect::<Vec<_>>())
    };
    let thrice = |g: &Gaussians| {
        let mut out = g.clone();
        out.append(g);
        out.append(g);
        out
    };
    let side = looking_at_origin(48, 36, DVec3::new(0.4, -1.0, 0.3), 7.0);
    let disc = |_| ([4.0, 0.1, 0.1], TURNED, [0.5, 0.4, 1e-6], 0.4);
    let veil = ([8.0, 0.1, 0.1], TURNED, [0.5, 0.4, 0.1], 0.005);
    vec![
        Case {
            // The f32 step at 8 m is 1e-6 m, 2e-4 of an alpha of 0.005.
            gradient: 1e-3,
            step: 1e-4,
            ..case("a veil of opacity 0.005 at 8 m, alone", "drawn", grey(&[veil]), forward(48, 36, 40.0))
        },
        case(
            "1e6 on one ray, at equal depths",
            "drawn in the order of storage until a pixel is finished",
            ray,
            camera,
        ),
        Case {
            // T is a product of up to 1800 rounded factors: 1800 * 6e-8, and as many colours are added.
            picture: 1e-4,
            depth: 1e-5,
            gradient: 1e-3,
            ..case(
                "1e5 of opacity 0.005 behind one another",
                "drawn until a pixel is finished",
                stack(0.005),
                camera,
            )
        },
        Case {
            drawn: false,
            ..case("1e5 of opacity 0.0039, below 1/255", "not drawn", stack(0.0039), camera)
        },
        case(
            "coplanar: one disc ten times",
            "drawn ten times",
            grey(&(0..10).map(disc).collect::<Vec<_>>()),
            forward(48, 36, 40.0),
        ),
        case(
            "a scene three times in one place",
            "drawn in the order of storage",
            thrice(&random(25, 60, 1, [0.02, 0.3])),
            side,
        ),
    ]
}
