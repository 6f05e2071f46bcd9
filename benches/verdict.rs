//! Verdicts on good and bad input: each scene is reconstructed unchanged, with the faults of ordinary captures, and
//! with mistakes that make the result worthless.
//!
//! `cargo bench --bench verdict` uses the bundled sample. `-- FOLDER ...` uses scenes, or folders of scenes, each with
//! a `split.json`; all keys of each are used. `--only NAME,NAME` selects scenes, `--case TEXT` the rows with TEXT in
//! their name, `--depth no|yes|both` runs without the scene's depth, with it, or both (default). Prints a Markdown table: the
//! numbers of good, doubtful and bad verdicts and of errors (refused); the most frequent reasons; PSNR on the unseen
//! side. `--figures FILE` writes all evidence, one JSON object per line. Exit code 1 if a good scene gets the verdict
//! bad, or a bad one good.

use glam::{DMat3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use vg::geometry::{Distortion, Pose};
use vg::io::{SceneOptions, open_scene};
use vg::pipeline::{Options, Verdict};
use vg::scene::mask::Label;
use vg::scene::{DepthMap, Mask};
use vg::{Error, Result, Scene, View};
use vg_testing::Random;
use vg_testing::sample::{errors, run};

fn main() -> Result<ExitCode> {
    let arguments = Arguments::read()?;
    let vehicles = arguments.vehicles()?;
    let mut wrong = 0;
    for &depth in &arguments.depth {
        println!("\n{} scenes, {}:\n", vehicles.len(), if depth { "with depth" } else { "without depth" });
        println!("| input | expected | good | doubtful | bad | refused | reasons | unseen side, dB |");
        println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
        for case in CASES.iter().filter(|case| case.name.contains(&arguments.case)) {
            if depth || !case.fault.is_of_depth() {
                wrong += row(&vehicles, case, depth, &arguments)?;
            }
        }
    }
    println!("\nunexpected verdicts: {wrong}");
    Ok(if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A row of the table.
struct Case {
    name: &'static str,
    fault: Fault,
    expected: Expected,
}

/// The expected verdict.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Expected {
    /// Not bad.
    Good,
    /// Not good; or an error.
    Bad,
    /// Any verdict: the input does not determine it.
    Open,
}

/// A change of the input.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    /// Each camera independently: rotated by 0.3 degrees and moved by 3 cm about each axis (one sigma).
    Jitter,
    /// The plane of symmetry is yawed by 2 degrees and shifted by 5 cm.
    PlaneTurned,
    /// Pixels.
    Eroded(u32),
    /// Pixels.
    Dilated(u32),
    /// One mask, from its middle to the right.
    HalfOccluded,
    /// Vehicle and background are exchanged: in one mask, in all.
    OneMaskInverted,
    AllMasksInverted,
    /// Each view has the next view's masks; photographs; masks, photographs and depth.
    MasksOff,
    PhotographsOff,
    FramesOff,
    /// The second view has the third's photograph.
    OnePhotographOff,
    /// The second camera is turned around the vehicle's axis by an angle in degrees.
    OnePoseTurned(f64),
    /// The second and the third view.
    TwoFramesSwapped,
    /// x and y of the world of the poses; y and z, with a sign so that it is a rotation.
    AxesXy,
    AxesYz,
    /// Scale of the positions.
    PosesScaled(f64),
    /// Metres along y.
    PlaneOff(f64),
    /// Metres along x and y, as projected coordinates are.
    Utm,
    /// The focal lengths, as if the photographs were of another size.
    Focal(f64),
    /// k1 of all lenses; of one.
    Lens(f64),
    OneLens(f64),
    /// Scale of the depth.
    DepthScaled(f32),
    /// Scale of the second view's depth.
    OneDepthScaled(f32),
    /// Each view has the next view's depth.
    DepthOff,
}

const CASES: &[Case] = &[
    Case { name: "as given", fault: Fault::None, expected: Expected::Good },
    Case {
        name: "each camera off by 0.3 degrees and 3 cm (sigma)",
        fault: Fault::Jitter,
        expected: Expected::Good,
    },
    Case {
        name: "plane yawed by 2 degrees, shifted by 5 cm",
        fault: Fault::PlaneTurned,
        expected: Expected::Good,
    },
    Case { name: "masks eroded by 2 px", fault: Fault::Eroded(2), expected: Expected::Good },
    Case { name: "masks dilated by 2 px", fault: Fault::Dilated(2), expected: Expected::Good },
    Case { name: "half of one mask missing", fault: Fault::HalfOccluded, expected: Expected::Open },
    Case { name: "one mask inverted", fault: Fault::OneMaskInverted, expected: Expected::Bad },
    Case { name: "all masks inverted", fault: Fault::AllMasksInverted, expected: Expected::Bad },
    Case { name: "masks off by one frame", fault: Fault::MasksOff, expected: Expected::Bad },
    Case { name: "photographs off by one frame", fault: Fault::PhotographsOff, expected: Expected::Bad },
    Case {
        name: "photographs, masks and depth off by one frame",
        fault: Fault::FramesOff,
        expected: Expected::Bad,
    },
    Case { name: "one photograph of another frame", fault: Fault::OnePhotographOff, expected: Expected::Bad },
    Case {
        name: "one pose off by 10 degrees around the vehicle",
        fault: Fault::OnePoseTurned(10.0),
        expected: Expected::Bad,
    },
    Case { name: "two frames swapped", fault: Fault::TwoFramesSwapped, expected: Expected::Bad },
    Case { name: "axes x and y swapped", fault: Fault::AxesXy, expected: Expected::Bad },
    Case { name: "axes y and z swapped", fault: Fault::AxesYz, expected: Expected::Bad },
    Case {
        name: "poses x 0.022 (a vehicle of 10 cm)",
        fault: Fault::PosesScaled(0.022),
        expected: Expected::Bad,
    },
    Case {
        name: "poses x 0.18 (a vehicle of 0.8 m)",
        fault: Fault::PosesScaled(0.18),
        expected: Expected::Bad,
    },
    Case {
        name: "poses x 0.3048 (feet taken for metres, inverted)",
        fault: Fault::PosesScaled(0.3048),
        expected: Expected::Bad,
    },
    Case {
        name: "poses x 3.281 (feet taken for metres)",
        fault: Fault::PosesScaled(3.281),
        expected: Expected::Bad,
    },
    Case {
        name: "poses x 1000 (mm taken for metres)",
        fault: Fault::PosesScaled(1000.0),
        expected: Expected::Bad,
    },
    Case { name: "plane off by 0.3 m", fault: Fault::PlaneOff(0.3), expected: Expected::Bad },
    Case { name: "plane off by 0.6 m", fault: Fault::PlaneOff(0.6), expected: Expected::Bad },
    Case { name: "plane off by 1 m", fault: Fault::PlaneOff(1.0), expected: Expected::Bad },
    Case { name: "UTM coordinates", fault: Fault::Utm, expected: Expected::Bad },
    Case { name: "focal lengths halved", fault: Fault::Focal(0.5), expected: Expected::Bad },
    Case { name: "focal lengths doubled", fault: Fault::Focal(2.0), expected: Expected::Bad },
    Case { name: "all lenses folded (k1 = -44.8)", fault: Fault::Lens(-44.8), expected: Expected::Bad },
    Case { name: "one lens folded (k1 = -44.8)", fault: Fault::OneLens(-44.8), expected: Expected::Bad },
    Case { name: "depth in millimetres", fault: Fault::DepthScaled(1000.0), expected: Expected::Bad },
    Case { name: "depth in feet", fault: Fault::DepthScaled(3.281), expected: Expected::Bad },
    Case { name: "depth x 0.3048", fault: Fault::DepthScaled(0.3048), expected: Expected::Bad },
    Case { name: "depth x 1.2", fault: Fault::DepthScaled(1.2), expected: Expected::Bad },
    Case {
        name: "depth of one view in millimetres",
        fault: Fault::OneDepthScaled(1000.0),
        expected: Expected::Bad,
    },
    Case { name: "depth off by one frame", fault: Fault::DepthOff, expected: Expected::Bad },
];

impl Fault {
    fn is_of_depth(self) -> bool {
        matches!(self, Self::DepthScaled(_) | Self::OneDepthScaled(_) | Self::DepthOff)
    }

    /// Changes the input. Test views move with the frame if it is only another frame of the same vehicle.
    fn apply(self, seed: u64, input: &mut Scene, test: &mut Scene) -> Result<()> {
        let mut random = Random::new(seed);
        let views = &mut input.views;
        let n = views.len();
        let turned = |rotation: DMat3| Pose { rotation, translation: DVec3::ZERO };
        let shifted = |x: f64, y: f64| Pose { rotation: DMat3::IDENTITY, translation: DVec3::new(x, y, 0.0) };
        match self {
            Self::None => {}
            Self::Jitter => views.iter_mut().for_each(|view| jitter(&mut random, view)),
            Self::PlaneTurned => {
                let mut side = || if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
                let rotation = DMat3::from_rotation_z(side() * 2f64.to_radians());
                move_frame(
                    [input, test],
                    Pose { rotation, translation: DVec3::new(0.0, side() * 0.05, 0.0) },
                );
            }
            Self::Eroded(px) => masks(views, |mask| grown(mask, px, Label::Background))?,
            Self::Dilated(px) => masks(views, |mask| grown(mask, px, Label::Vehicle))?,
            Self::HalfOccluded => masks(&mut views[..1], half)?,
            Self::OneMaskInverted => masks(&mut views[1..2], inverted)?,
            Self::AllMasksInverted => masks(views, inverted)?,
            Self::MasksOff => off_by_one(views, |view, next| view.mask = next.mask.clone()),
            Self::PhotographsOff => off_by_one(views, |view, next| view.image = next.image.clone()),
            Self::DepthOff => off_by_one(views, |view, next| view.depth = next.depth.clone()),
            Self::FramesOff => off_by_one(views, |view, next| view.camera = next.camera),
            Self::OnePhotographOff => views[1].image = views[2 % n].image.clone(),
            Self::OnePoseTurned(degrees) => {
                let pose = &mut views[1].camera.vehicle_from_camera;
                *pose = turned(DMat3::from_rotation_z(degrees.to_radians())).after(pose);
            }
            Self::OneDepthScaled(s) => {
                views[1].depth = views[1].depth.as_ref().map(|depth| scaled(depth, s)).transpose()?;
            }
            Self::TwoFramesSwapped => {
                let camera = views[1].camera;
                views[1].camera = views[2 % n].camera;
                views[2 % n].camera = camera;
            }
            Self::AxesXy => move_frame([input, test], turned(DMat3::from_rotation_z(90f64.to_radians()))),
            Self::AxesYz => move_frame([input, test], turned(DMat3::from_rotation_x(90f64.to_radians()))),
            Self::PosesScaled(s) => {
                views.iter_mut().for_each(|view| view.camera.vehicle_from_camera.translation *= s);
            }
            Self::PlaneOff(metres) => move_frame([input, test], shifted(0.0, metres)),
            Self::Utm => move_frame([input, test], shifted(4.5e5, 5.4e6)),
            Self::Focal(s) => views.iter_mut().for_each(|view| {
                view.camera.intrinsics.fx *= s;
                view.camera.intrinsics.fy *= s;
            }),
            Self::Lens(k1) => views.iter_mut().for_each(|view| view.camera.distortion = radial(k1)),
            Self::OneLens(k1) => views[1].camera.distortion = radial(k1),
            Self::DepthScaled(s) => {
                for view in views {
                    view.depth = view.depth.as_ref().map(|depth| scaled(depth, s)).transpose()?;
                }
            }
        }
        Ok(())
    }
}

fn jitter(random: &mut Random, view: &mut View) {
    let mut sigma = |s: f64| DVec3::new(random.normal(), random.normal(), random.normal()) * s;
    let turn = DQuat::from_scaled_axis(sigma(0.3f64.to_radians()));
    let pose = &mut view.camera.vehicle_from_camera;
    pose.translation += sigma(0.03);
    pose.rotation *= DMat3::from_quat(turn);
}

fn move_frame(scenes: [&mut Scene; 2], moved: Pose) {
    for view in scenes.into_iter().flat_map(|s| &mut s.views) {
        view.camera.vehicle_from_camera = moved.after(&view.camera.vehicle_from_camera);
    }
}

fn off_by_one(views: &mut [View], change: impl Fn(&mut View, &View)) {
    let before = views.to_vec();
    let n = views.len();
    views.iter_mut().enumerate().for_each(|(i, view)| change(view, &before[(i + 1) % n]));
}

fn radial(k1: f64) -> Distortion {
    Distortion::Brown { k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] }
}

fn scaled(depth: &DepthMap, s: f32) -> Result<DepthMap> {
    DepthMap::new(depth.width(), depth.height(), depth.depth().iter().map(|z| s * z).collect())
}

fn masks(views: &mut [View], change: impl Fn(&Mask) -> Result<Mask>) -> Result<()> {
    for view in views {
        view.mask = view.mask.as_ref().map(&change).transpose()?;
    }
    Ok(())
}

fn inverted(mask: &Mask) -> Result<Mask> {
    let other = |l: &Label| if *l == Label::Vehicle { Label::Background } else { Label::Vehicle };
    Mask::new(mask.width(), mask.height(), mask.labels().iter().map(other).collect())
}

/// Sets all pixels within `radius` pixels of a pixel with `label` to that label.
fn grown(mask: &Mask, radius: u32, label: Label) -> Result<Mask> {
    let (w, h, r) = (mask.width() as i32, mask.height() as i32, radius as i32);
    let at = |x: i32, y: i32| mask.labels()[(y.clamp(0, h - 1) * w + x.clamp(0, w - 1)) as usize];
    let disc: Vec<(i32, i32)> = (-r..=r)
        .flat_map(|y| (-r..=r).map(move |x| (x, y)))
        .filter(|(x, y)| x * x + y * y <= r * r)
        .collect();
    let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
    let labels = pixels
        .map(|(x, y)| if disc.iter().any(|(dx, dy)| at(x + dx, y + dy) == label) { label } else { at(x, y) });
    Mask::new(mask.width(), mask.height(), labels.collect())
}

fn half(mask: &Mask) -> Result<Mask> {
    let [u0, _, u1, _] = mask.bounds().unwrap_or_default();
    let column = |i: usize| i as u32 % mask.width();
    let labels = mask.labels().iter().enumerate();
    let labels = labels.map(|(i, l)| if column(i) > (u0 + u1) / 2 { Label::Background } else { *l });
    Mask::new(mask.width(), mask.height(), labels.collect())
}

/// One key of a scene's split.
struct Vehicle {
    name: String,
    folder: PathBuf,
    input: Vec<String>,
    test: Vec<String>,
}

impl Vehicle {
    /// Opens a scene with all keys of its split.
    fn open(folder: &Path) -> Result<Vec<Self>> {
        let path = folder.join("split.json");
        let broken = |e: String| Error::argument(path.display().to_string(), e, "a split.json");
        let bytes = std::fs::read(&path).map_err(|e| broken(e.to_string()))?;
        let splits: BTreeMap<String, BTreeMap<String, Vec<String>>> =
            serde_json::from_slice(&bytes).map_err(|e| broken(e.to_string()))?;
        let scene = folder.file_name().unwrap_or_default().to_string_lossy();
        let one = |(key, mut split): (String, BTreeMap<String, Vec<String>>)| {
            let mut names = |name: &str| split.remove(name).ok_or_else(|| broken(format!("no {name}")));
            Ok(Self {
                name: format!("{scene}/{key}"),
                folder: folder.into(),
                input: names("input")?,
                test: names("test")?,
            })
        };
        splits.into_iter().map(one).collect()
    }

    fn scene(&self, names: &[String], load_depth: bool) -> Result<Scene> {
        let views = Some(names.to_vec());
        let options = SceneOptions { views, load_depth, ..SceneOptions::default() };
        open_scene(&self.folder, &options).map(|s| s.scene)
    }
}

/// Prints the row. Returns the number of unexpected verdicts.
fn row(vehicles: &[Vehicle], case: &Case, depth: bool, arguments: &Arguments) -> Result<usize> {
    let mut verdicts = [0; 4];
    let (mut refused, mut wrong, mut unseen) = (0, 0, Vec::new());
    let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
    for (k, vehicle) in vehicles.iter().enumerate() {
        let (mut input, mut test) =
            (vehicle.scene(&vehicle.input, depth)?, vehicle.scene(&vehicle.test, false)?);
        if depth && input.views.iter().any(|view| view.depth.is_none()) {
            continue;
        }
        case.fault.apply(1 + k as u64, &mut input, &mut test)?;
        let made = match run(&input, &Options::default()) {
            Ok(made) => made,
            Err(error) => {
                refused += 1;
                wrong += usize::from(case.expected == Expected::Good);
                arguments.note(vehicle, case, depth, &serde_json::json!({ "error": error.to_string() }))?;
                continue;
            }
        };
        let report = &made.report;
        verdicts[report.verdict as usize] += 1;
        wrong += usize::from(match case.expected {
            Expected::Good => report.verdict == Verdict::Bad,
            Expected::Bad => report.verdict == Verdict::Good,
            Expected::Open => false,
        });
        let mut codes: Vec<String> = report.verdict_reasons.iter().map(|r| format!("{:?}", r.code)).collect();
        codes.sort();
        codes.dedup();
        codes.into_iter().for_each(|code| *reasons.entry(code).or_default() += 1);
        let db = errors(&made, &test)?.psnr_db;
        unseen.push(db);
        let figures = serde_json::json!({ "unseen_db": db, "report": report });
        arguments.note(vehicle, case, depth, &figures)?;
    }
    let mut frequent: Vec<(String, usize)> = reasons.into_iter().collect();
    frequent.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let frequent: Vec<String> = frequent.iter().take(3).map(|(code, n)| format!("{code} {n}")).collect();
    // The check is never switched off here.
    let [good, _, doubtful, bad] = verdicts;
    let (name, expected) = (case.name, case.expected);
    let db = match unseen.len() {
        0 => "-".into(),
        n => format!("{:.1}", unseen.iter().sum::<f64>() / n as f64),
    };
    let frequent = frequent.join(", ");
    println!("| {name} | {expected:?} | {good} | {doubtful} | {bad} | {refused} | {frequent} | {db} |");
    Ok(wrong)
}

struct Arguments {
    folders: Vec<PathBuf>,
    only: Vec<String>,
    case: String,
    depth: Vec<bool>,
    figures: Option<PathBuf>,
}

impl Arguments {
    fn read() -> Result<Self> {
        let mut read = Self {
            folders: Vec::new(),
            only: Vec::new(),
            case: String::new(),
            depth: vec![false, true],
            figures: None,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().unwrap_or_default();
            match argument.as_str() {
                // Passed by cargo itself.
                "--bench" => {}
                "--only" => read.only = value().split(',').map(Into::into).collect(),
                "--case" => read.case = value(),
                "--figures" => read.figures = Some(value().into()),
                "--depth" => match value().as_str() {
                    "no" => read.depth = vec![false],
                    "yes" => read.depth = vec![true],
                    _ => {}
                },
                _ => read.folders.push(argument.into()),
            }
        }
        Ok(read)
    }

    fn vehicles(&self) -> Result<Vec<Vehicle>> {
        let sample = vg_testing::root().join("tests/data/sedan");
        let folders = if self.folders.is_empty() { vec![sample] } else { self.folders.clone() };
        let mut found = Vec::new();
        for folder in folders {
            if folder.join("split.json").is_file() {
                found.push(folder);
                continue;
            }
            let listed = std::fs::read_dir(&folder)
                .map_err(|e| Error::argument(folder.display().to_string(), e.to_string(), "a folder"))?;
            let mut scenes: Vec<PathBuf> =
                listed.flatten().map(|e| e.path()).filter(|p| p.join("split.json").is_file()).collect();
            scenes.sort();
            found.extend(scenes);
        }
        let name = |p: &Path| p.file_name().unwrap_or_default().to_string_lossy().into_owned();
        found.retain(|p| self.only.is_empty() || self.only.contains(&name(p)));
        let vehicles: Vec<Vec<Vehicle>> =
            found.iter().map(|folder| Vehicle::open(folder)).collect::<Result<_>>()?;
        Ok(vehicles.into_iter().flatten().collect())
    }

    /// Appends a line to the file of figures.
    fn note(&self, vehicle: &Vehicle, case: &Case, depth: bool, found: &serde_json::Value) -> Result<()> {
        let Some(path) = &self.figures else { return Ok(()) };
        let line =
            serde_json::json!({ "vehicle": vehicle.name, "case": case.name, "depth": depth, "found": found });
        let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
        file.and_then(|mut file| writeln!(file, "{line}")).map_err(|e| Error::io(path, e))
    }
}
