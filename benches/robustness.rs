//! Cost of inexact input, and the gain of the calibration: errors on the unseen side if the input views' cameras, the
//! plane of symmetry or masks are wrong by known amounts, and with fewer and more views.
//!
//! `cargo bench --bench robustness` uses the bundled sample. `-- FOLDER` uses the vehicles in a folder, each a scene
//! with a `split.json` of one or more keys; `--only NAME,NAME` selects vehicles, `--prior NAME,NAME` other priors than
//! the hull, `--case TEXT` the rows with TEXT in their name. Prints a Markdown table per prior: PSNR in dB / silhouette
//! IoU / mean absolute depth error in m.

use glam::{DMat3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vg::geometry::Pose;
use vg::io::{SceneOptions, open_scene};
use vg::metrics::ViewErrors;
use vg::pipeline::{Calibrate, Options, PriorChoice};
use vg::scene::Mask;
use vg::scene::mask::Label;
use vg::symmetry::SymmetryMode;
use vg::{Error, Result, Scene};
use vg_testing::Random;
use vg_testing::sample::{errors, run};

fn main() -> Result<()> {
    let arguments = Arguments::read()?;
    let vehicles: Vec<Vehicle> =
        arguments.folders()?.iter().map(|f| Vehicle::open(f)).collect::<Result<_>>()?;
    for &prior in &arguments.priors {
        println!("\nprior {prior:?}, {} vehicles: PSNR dB / IoU / depth MAE m\n", vehicles.len());
        println!("| input | calibrate off | calibrate auto | corrected | ms |");
        println!("| --- | --- | --- | --- | --- |");
        for &case in CASES.iter().filter(|case| case.text().contains(&arguments.case)) {
            row(&vehicles, prior, case)?;
        }
    }
    Ok(())
}

/// A change of the input.
#[derive(Clone, Copy, Debug)]
enum Case {
    AsGiven,
    /// Each camera independently: rotated by 0.3 degrees and moved by 3 cm about each axis (one sigma).
    Jittered,
    /// All cameras, those of the test views too: yawed by 2 degrees and shifted by 5 cm.
    PlaneMoved,
    Both,
    /// Pixels.
    Eroded(u32),
    Dilated(u32),
    /// One mask, from its middle to the right.
    HalfOccluded,
    /// Half a mask and a moved plane.
    HalfOccludedPlaneMoved,
    /// A number of views.
    Views(usize),
    /// A number of views, with the plane moved.
    ViewsPlaneMoved(usize),
}

const CASES: &[Case] = &[
    Case::AsGiven,
    Case::Jittered,
    Case::PlaneMoved,
    Case::Both,
    Case::Eroded(3),
    Case::Dilated(3),
    Case::HalfOccluded,
    Case::HalfOccludedPlaneMoved,
    Case::Views(1),
    Case::Views(2),
    Case::Views(3),
    Case::Views(8),
    Case::ViewsPlaneMoved(1),
    Case::ViewsPlaneMoved(2),
    Case::ViewsPlaneMoved(3),
    Case::ViewsPlaneMoved(8),
];

impl Case {
    fn text(self) -> String {
        let views = |n: usize| format!("{n} view{}", if n == 1 { "" } else { "s" });
        match self {
            Self::AsGiven => "as given, 4 views".into(),
            Self::Jittered => "each camera off by 0.3 degrees and 3 cm (sigma)".into(),
            Self::PlaneMoved => "plane yawed by 2 degrees, shifted by 5 cm".into(),
            Self::Both => "both".into(),
            Self::Eroded(px) => format!("masks eroded by {px} px"),
            Self::Dilated(px) => format!("masks dilated by {px} px"),
            Self::HalfOccluded => "half of one mask missing".into(),
            Self::HalfOccludedPlaneMoved => "half of one mask missing, plane moved".into(),
            Self::Views(n) => views(n),
            Self::ViewsPlaneMoved(n) => format!("{}, plane moved", views(n)),
        }
    }

    /// Number of input views; the splits have 4.
    fn views(self) -> usize {
        match self {
            Self::Views(n) | Self::ViewsPlaneMoved(n) => n,
            _ => 4,
        }
    }

    fn apply(self, seed: u64, input: &mut Scene, test: &mut Scene) -> Result<()> {
        let mut random = Random::new(seed);
        if matches!(self, Self::Jittered | Self::Both) {
            jitter(&mut random, input);
        }
        if matches!(
            self,
            Self::PlaneMoved | Self::Both | Self::HalfOccludedPlaneMoved | Self::ViewsPlaneMoved(_)
        ) {
            move_plane(&mut random, [input, test]);
        }
        match self {
            Self::Eroded(px) => masks(input, |mask| grown(mask, px, Label::Background))?,
            Self::Dilated(px) => masks(input, |mask| grown(mask, px, Label::Vehicle))?,
            Self::HalfOccluded | Self::HalfOccludedPlaneMoved => {
                let mut first = Some(());
                masks(input, |mask| first.take().map_or_else(|| Ok(mask.clone()), |()| half(mask)))?;
            }
            _ => {}
        }
        Ok(())
    }
}

fn jitter(random: &mut Random, scene: &mut Scene) {
    for view in &mut scene.views {
        let mut sigma = |s: f64| DVec3::new(random.normal(), random.normal(), random.normal()) * s;
        let turn = DQuat::from_scaled_axis(sigma(0.3f64.to_radians()));
        let pose = &mut view.camera.vehicle_from_camera;
        pose.translation += sigma(0.03);
        pose.rotation *= DMat3::from_quat(turn);
    }
}

/// Moves the plane to either side, chosen by the seed.
fn move_plane(random: &mut Random, scenes: [&mut Scene; 2]) {
    let mut side = || if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
    let rotation = DMat3::from_rotation_z(side() * 2f64.to_radians());
    let moved = Pose { rotation, translation: DVec3::new(0.0, side() * 0.05, 0.0) };
    for view in scenes.into_iter().flat_map(|s| &mut s.views) {
        view.camera.vehicle_from_camera = moved.after(&view.camera.vehicle_from_camera);
    }
}

fn masks(scene: &mut Scene, mut change: impl FnMut(&Mask) -> Result<Mask>) -> Result<()> {
    for view in &mut scene.views {
        view.mask = view.mask.as_ref().map(&mut change).transpose()?;
    }
    Ok(())
}

/// Pixels with `label` no further than `radius` pixels away take it.
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
    let middle = (u0 + u1) / 2;
    let column = |i: usize| i as u32 % mask.width();
    let labels = mask.labels().iter().enumerate();
    let labels = labels.map(|(i, l)| if column(i) > middle { Label::Background } else { *l });
    Mask::new(mask.width(), mask.height(), labels.collect())
}

/// A folder's scene and its first split.
struct Vehicle {
    folder: PathBuf,
    input: Vec<String>,
    test: Vec<String>,
}

impl Vehicle {
    fn open(folder: &Path) -> Result<Self> {
        let path = folder.join("split.json");
        let broken = |e: String| Error::argument(path.display().to_string(), e, "a split.json");
        let bytes = std::fs::read(&path).map_err(|e| broken(e.to_string()))?;
        let mut splits: BTreeMap<String, BTreeMap<String, Vec<String>>> =
            serde_json::from_slice(&bytes).map_err(|e| broken(e.to_string()))?;
        // As in all tables, the right side is the input if both directions exist.
        let key = if splits.contains_key("right_to_left") {
            "right_to_left".into()
        } else {
            splits.keys().next().cloned().unwrap_or_default()
        };
        let mut split = splits.remove(&key).unwrap_or_default();
        let mut of = |name: &str| split.remove(name).ok_or_else(|| broken(format!("no {name}")));
        Ok(Self { folder: folder.into(), input: of("input")?, test: of("test")? })
    }

    fn scene(&self, names: &[String], load_depth: bool) -> Result<Scene> {
        let views = Some(names.to_vec());
        let options = SceneOptions { views, load_depth, ..SceneOptions::default() };
        open_scene(&self.folder, &options).map(|s| s.scene)
    }

    /// Names of `count` input views: those of the split nearest to the middle of the list, and beyond them other views
    /// of the same side that are no test views.
    fn inputs(&self, count: usize) -> Result<Vec<String>> {
        let n = self.input.len();
        if count <= n {
            let first = (n - count) / 2;
            return Ok(self.input[first..first + count].to_vec());
        }
        let options = SceneOptions { load_depth: false, ..SceneOptions::default() };
        let all = open_scene(&self.folder, &options)?.scene;
        let side = |names: &[String]| -> f64 {
            let of = all.views.iter().filter(|v| names.iter().any(|n| same(n, &v.name)));
            of.map(|v| v.camera.center().y).sum()
        };
        let side = side(&self.input).signum();
        let others = all.views.iter().filter(|v| {
            v.camera.center().y * side > 0.0 && !self.input.iter().chain(&self.test).any(|n| same(n, &v.name))
        });
        Ok(self.input.iter().cloned().chain(others.map(|v| v.name.clone())).take(count).collect())
    }
}

/// Whether two names of views are equal. Names are file names, with or without their folder.
fn same(a: &str, b: &str) -> bool {
    Path::new(a).file_stem() == Path::new(b).file_stem()
}

fn row(vehicles: &[Vehicle], prior: PriorChoice, case: Case) -> Result<()> {
    let mut found = [Vec::new(), Vec::new()];
    let (mut accepted, mut failed, mut ms) = (0, 0, 0.0);
    let mut counted = 0;
    for (k, vehicle) in vehicles.iter().enumerate() {
        let names = vehicle.inputs(case.views())?;
        if names.len() < case.views() {
            continue;
        }
        counted += 1;
        let mut input = vehicle.scene(&names, prior == PriorChoice::Given)?;
        let mut test = vehicle.scene(&vehicle.test, true)?;
        case.apply(1 + k as u64, &mut input, &mut test)?;
        for (errors_of, calibrate) in found.iter_mut().zip([Calibrate::Off, Calibrate::Auto]) {
            let symmetry = SymmetryMode::Always;
            let options = Options { prior, calibrate, symmetry, check: false, ..Options::default() };
            match run(&input, &options) {
                Ok(made) => {
                    errors_of.push(errors(&made, &test)?);
                    let report = &made.report;
                    let moved =
                        |c: &vg::calibrate::Calibration| c.verdict == vg::calibrate::Verdict::Accepted;
                    accepted += usize::from(report.calibration.as_ref().is_some_and(moved));
                    ms += report.stages.iter().filter(|s| s.name == "calibrate").map(|s| s.ms).sum::<f64>();
                }
                Err(Error::Reconstruction { .. }) => failed += 1,
                Err(other) => return Err(other),
            }
        }
    }
    let [off, auto] = found.map(|errors| cell(&errors));
    let failed = if failed > 0 { format!(", {failed} runs failed") } else { String::new() };
    let text = case.text();
    println!(
        "| {text} | {off} | {auto} | {accepted} of {counted}{failed} | {:.0} |",
        ms / f64::from(counted.max(1))
    );
    Ok(())
}

fn cell(errors: &[ViewErrors]) -> String {
    ViewErrors::mean(errors).map_or_else(
        || "-".into(),
        |mean| {
            let depth = mean.depth_mae_m.map_or_else(|| "-".into(), |d| format!("{d:.3}"));
            format!("{:.2} / {:.3} / {depth}", mean.psnr_db, mean.silhouette_iou)
        },
    )
}

struct Arguments {
    folder: Option<PathBuf>,
    only: Vec<String>,
    case: String,
    priors: Vec<PriorChoice>,
}

impl Arguments {
    fn read() -> Result<Self> {
        let mut read =
            Self { folder: None, only: Vec::new(), case: String::new(), priors: vec![PriorChoice::Hull] };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut list = || -> Vec<String> {
                arguments.next().unwrap_or_default().split(',').map(Into::into).collect()
            };
            match argument.as_str() {
                // Passed by cargo itself.
                "--bench" => {}
                "--only" => read.only = list(),
                "--case" => read.case = list().join(","),
                "--prior" => read.priors = list().iter().map(|name| prior(name)).collect::<Result<_>>()?,
                _ => read.folder = Some(argument.into()),
            }
        }
        Ok(read)
    }

    fn folders(&self) -> Result<Vec<PathBuf>> {
        let Some(folder) = &self.folder else {
            return Ok(vec![vg_testing::root().join("tests/data/sedan")]);
        };
        let listed = std::fs::read_dir(folder)
            .map_err(|e| Error::argument(folder.display().to_string(), e.to_string(), "a folder"))?;
        let mut found: Vec<PathBuf> =
            listed.flatten().map(|e| e.path()).filter(|p| p.join("split.json").is_file()).collect();
        let name = |p: &Path| p.file_name().unwrap_or_default().to_string_lossy().into_owned();
        found.retain(|p| self.only.is_empty() || self.only.contains(&name(p)));
        found.sort();
        Ok(found)
    }
}

/// The prior with this name in reports.
fn prior(name: &str) -> Result<PriorChoice> {
    serde_json::from_value(serde_json::Value::String(name.into()))
        .map_err(|_| Error::argument("--prior", name.to_owned(), "the name of a prior"))
}
