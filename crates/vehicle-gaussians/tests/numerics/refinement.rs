//! Stiff refinements: each result is finite, and the report contains when and why it stopped.

use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::time::Instant;
use vg::pipeline::{Calibrate, Keep, Options, PriorChoice, reconstruct};
use vg::refine::{self, Amount, Rates, RefineOptions, Refinement, Stop};
use vg::relight::Relight;
use vg::scene::mask::Label;
use vg::scene::{DepthMap, Mask, RgbImage};
use vg::symmetry::SymmetryMode;
use vg::{Gaussians, Scene};
use vg_testing::Random;
use vg_testing::scenes::random;
use vg_testing::vehicle::{camera, right_side, view};

/// Number of planned steps.
const STEPS: u32 = 40;

/// A refinement with unreasonable input.
pub struct Stiff {
    pub condition: &'static str,
    scene: Scene,
    rates: Rates,
    keep: Keep,
    /// The model to refine; `None`: the reconstruction of the scene.
    model: Option<Gaussians>,
    /// The expected reason for the end.
    pub stop: Stop,
}

/// The result of a refinement.
pub struct Outcome {
    pub gaussians: Gaussians,
    pub refinement: Refinement,
    pub ms: f64,
}

fn times(factor: f32) -> Rates {
    let RefineOptions { rates, .. } = RefineOptions::default();
    Rates {
        means: factor * rates.means,
        rotations: factor * rates.rotations,
        scales: factor * rates.scales,
        opacities: factor * rates.opacities,
        colors: factor * rates.colors,
        view_dependence: factor * rates.view_dependence,
        exposure: factor * rates.exposure,
    }
}

/// A photograph from the middle of the vehicle, all of it vehicle, at 1 m.
fn from_inside(mut scene: Scene) -> Scene {
    let mut inside = camera(-90.0, 6.5, 48, 36);
    inside.vehicle_from_camera.translation *= 0.01;
    let mut view = view("inside", inside);
    let pixels = 48 * 36;
    view.image = RgbImage::new(48, 36, vec![[120, 60, 200]; pixels]).unwrap();
    view.mask = Some(Mask::new(48, 36, vec![Label::Vehicle; pixels]).unwrap());
    view.depth = Some(DepthMap::new(48, 36, vec![1.0; pixels]).unwrap());
    scene.views.push(view);
    scene
}

pub(crate) fn all() -> Vec<Stiff> {
    let scene = || right_side(48, 36);
    let stiff = |condition: &'static str, rates: Rates| Stiff {
        condition,
        scene: scene(),
        rates,
        keep: Keep::default(),
        model: None,
        stop: Stop::Done,
    };
    let given =
        |condition, model| Stiff { model: Some(model), ..stiff(condition, RefineOptions::default().rates) };
    let unseen = |condition, model| Stiff { stop: Stop::Unseen, ..given(condition, model) };
    let usual = RefineOptions::default().rates;
    let mut twice = scene();
    twice.views.extend(scene().views);
    vec![
        stiff("all rates 100 times the default", times(100.0)),
        Stiff { stop: Stop::Diverged, ..stiff("all rates 400 times the default", times(400.0)) },
        Stiff {
            stop: Stop::Diverged,
            ..stiff("scales driven to their bounds, 1e-7 m and 3 m: rate 10", Rates { scales: 10.0, ..usual })
        },
        Stiff {
            stop: Stop::Diverged,
            ..stiff("opacities driven to 6e-6 and 1 - 6e-6: rate 10", Rates { opacities: 10.0, ..usual })
        },
        Stiff {
            scene: twice,
            keep: Keep { duplicate_views: true, overlap: true, ..Keep::default() },
            ..stiff("coplanar duplicates: every view twice", usual)
        },
        Stiff { scene: from_inside(scene()), ..stiff("a camera inside the vehicle", usual) },
        given("a model with scales of 1e-8 to 3 m, independent per axis", with_all_scales()),
        given("a model of 1e5 layers of opacity 0.005 behind one another", stacks(100_000, 0.005)),
        unseen("a model of 1e5 layers below 1/255", stacks(100_000, 0.003)),
        given("a model of 200 Gaussians, each stored ten times", ten_times(&random(5, 200, 2, [0.02, 0.3]))),
        unseen("a model 1e4 m away", far(&random(6, 200, 0, [0.02, 0.3]))),
    ]
}

/// Gaussians in the vehicle's box, from smaller than any camera resolves to as large as a head makes.
fn with_all_scales() -> Gaussians {
    let g = random(4, 2000, 1, [0.1, 0.1]);
    let mut r = Random::new(41);
    let scales =
        (0..g.len()).map(|_| [0; 3].map(|_| 10f64.powf(r.uniform(-8.0, 3f64.log10())) as f32)).collect();
    let (means, rotations) = (g.means().to_vec(), g.rotations().to_vec());
    Gaussians::from_arrays(1, means, rotations, scales, g.opacities().to_vec(), g.sh().to_vec()).unwrap()
}

/// Nearly transparent walls through the vehicle, one behind the other.
fn stacks(n: usize, opacity: f32) -> Gaussians {
    let means = (0..n).map(|i| [0.0, -0.9 + 1.8 * i as f32 / n as f32, 0.7]).collect();
    let rotations = vec![[1.0, 0.0, 0.0, 0.0]; n];
    let scales = vec![[2.0, 1e-4, 0.6]; n];
    Gaussians::from_arrays(0, means, rotations, scales, vec![opacity; n], vec![0.1; 3 * n]).unwrap()
}

fn ten_times(g: &Gaussians) -> Gaussians {
    let mut out = g.clone();
    (1..10).for_each(|_| out.append(g));
    out
}

fn far(g: &Gaussians) -> Gaussians {
    let means = g.means().iter().map(|[x, y, z]| [x + 1e4, *y, *z]).collect();
    let (rotations, scales) = (g.rotations().to_vec(), g.scales().to_vec());
    Gaussians::from_arrays(0, means, rotations, scales, g.opacities().to_vec(), g.sh().to_vec()).unwrap()
}

/// Results of every case, run once.
pub fn outcomes() -> &'static [Outcome] {
    static OUTCOMES: OnceLock<Vec<Outcome>> = OnceLock::new();
    OUTCOMES.get_or_init(|| all().iter().map(Stiff::run).collect())
}

impl Stiff {
    fn run(&self) -> Outcome {
        let refine = RefineOptions {
            amount: Amount::Iterations(STEPS),
            rates: self.rates,
            ..RefineOptions::default()
        };
        let begin = Instant::now();
        let mut go_on = |_| ControlFlow::Continue(());
        if let Some(model) = &self.model {
            let (gaussians, refinement) = refine::model(model, &self.scene, &refine, 2, &mut go_on).unwrap();
            return Outcome { gaussians, refinement, ms: begin.elapsed().as_secs_f64() * 1e3 };
        }
        let options = Options {
            prior: PriorChoice::Given,
            symmetry: SymmetryMode::Always,
            relight: Relight::Never,
            calibrate: Calibrate::Off,
            refine: Some(refine),
            keep: self.keep,
            threads: 2,
            ..Options::default()
        };
        let made = reconstruct(&self.scene, &options, &mut go_on).unwrap();
        let ms = begin.elapsed().as_secs_f64() * 1e3;
        Outcome { gaussians: made.gaussians, refinement: made.report.refinement.unwrap(), ms }
    }
}

#[test]
fn stiff_refinements_stay_finite_and_report_why_they_stopped() {
    for (stiff, Outcome { gaussians: g, refinement: done, .. }) in all().iter().zip(outcomes()) {
        println!("{:60} {done:?}", stiff.condition);
        let arrays = [
            g.means().as_flattened(),
            g.rotations().as_flattened(),
            g.scales().as_flattened(),
            g.opacities(),
            g.sh(),
        ];
        assert!(arrays.iter().all(|a| a.iter().all(|v| v.is_finite())), "{}", stiff.condition);
        assert!(
            done.loss.iter().chain(&done.psnr_db).all(|v| v.is_finite()),
            "{}: {done:?}",
            stiff.condition
        );
        assert_eq!(done.stop, stiff.stop, "{}", stiff.condition);
        // Divergence is detected at a check, of which there are 20 or one per round.
        let early = matches!(done.stop, Stop::Diverged | Stop::Unseen);
        assert!(if early { done.made < STEPS } else { done.made == STEPS }, "{done:?}");
        // A result that did not improve is returned as it was.
        assert!(done.psnr_db[1] >= done.psnr_db[0], "{}: {done:?}", stiff.condition);
    }
}
