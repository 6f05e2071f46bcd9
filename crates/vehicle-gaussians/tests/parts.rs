//! Depth priors and Gaussian heads of the caller's own.

use std::ops::ControlFlow;
use vg::gaussians::{buffer::Gaussian, sh};
use vg::head::GaussianHead;
use vg::pipeline::{Options, Parts, PriorChoice, ReasonCode, Reconstruction, reconstruct, reconstruct_with};
use vg::prior::{BoxSource, DepthPrior, Ends, Estimate, Geometry, WorkingBox};
use vg::progress::{Context, Threads};
use vg::scene::{DepthMap, View};
use vg::{Error, Gaussians, Result, Scene};
use vg_testing::vehicle::{right_side, without_depth};

/// A prior whose answer is a function of the views.
struct Prior<F>(F);

impl<F: Fn(&[View]) -> Result<Geometry>> DepthPrior for Prior<F> {
    fn name(&self) -> &'static str {
        "own"
    }

    fn estimate(&self, views: &[View], context: &Context) -> Result<Estimate> {
        context.report("prior", 0.5)?;
        (self.0)(views).map(Estimate::from)
    }
}

/// A head that makes a ball of every pixel, and changes the last one.
struct Balls(fn(&mut Gaussian));

impl GaussianHead for Balls {
    fn name(&self) -> &'static str {
        "balls"
    }

    fn predict(
        &self,
        views: &[View],
        geometry: &Geometry,
        kept: &[Vec<bool>],
        _context: &Context,
    ) -> Result<Gaussians> {
        let mut balls = Vec::new();
        for (view, (depth, kept)) in views.iter().zip(geometry.depths.iter().zip(kept)) {
            for pixel in (0..kept.len()).filter(|pixel| kept[*pixel]) {
                let (u, v) = (pixel as u32 % depth.width(), pixel as u32 / depth.width());
                let mean = view.lift(u, v, depth.get(u, v).unwrap()).to_array();
                let rotation = [1.0, 0.0, 0.0, 0.0];
                let sh0 = sh::from_rgb(view.image.get(u, v).map(|c| f32::from(c) / 255.0));
                balls.push(Gaussian { mean, rotation, scale: [0.02; 3], opacity: 0.9, sh0 });
            }
        }
        balls.last_mut().into_iter().for_each(self.0);
        let of = |get: fn(&Gaussian) -> [f32; 3]| balls.iter().map(get).collect::<Vec<_>>();
        let rotations = balls.iter().map(|ball| ball.rotation).collect();
        let opacities = balls.iter().map(|ball| ball.opacity).collect();
        let colors = of(|ball| ball.sh0).into_flattened();
        Gaussians::from_arrays(0, of(|ball| ball.mean), rotations, of(|ball| ball.scale), opacities, colors)
    }
}

/// A head without an answer.
struct Nothing;

impl GaussianHead for Nothing {
    fn name(&self) -> &'static str {
        "nothing"
    }

    fn predict(&self, _: &[View], _: &Geometry, _: &[Vec<bool>], _: &Context) -> Result<Gaussians> {
        Ok(Gaussians::default())
    }
}

/// A head whose only Gaussian has no place, which `Gaussians::push` does not refuse in a release build.
#[cfg(not(debug_assertions))]
struct Astray;

#[cfg(not(debug_assertions))]
impl GaussianHead for Astray {
    fn name(&self) -> &'static str {
        "astray"
    }

    fn predict(&self, _: &[View], _: &Geometry, _: &[Vec<bool>], _: &Context) -> Result<Gaussians> {
        let mut all = Gaussians::with_capacity(0, 1);
        let rotation = [1.0, 0.0, 0.0, 0.0];
        all.push(&Gaussian { mean: [f32::NAN; 3], rotation, scale: [0.1; 3], opacity: 0.5, sh0: [0.0; 3] });
        Ok(all)
    }
}

fn scene() -> Scene {
    right_side(96, 72)
}

fn options() -> Options {
    Options { threads: 2, ..Options::default() }
}

fn run(parts: &Parts, scene: &Scene, options: &Options) -> Result<Reconstruction> {
    let threads = Threads::new(2).unwrap();
    reconstruct_with(parts, &threads, scene, options, &mut |_| ControlFlow::Continue(()))
}

fn with_prior(prior: &dyn DepthPrior) -> Parts<'_> {
    Parts { prior: Some(prior), ..Parts::default() }
}

/// Depth maps of one value.
fn flat(views: &[View], metres: f32) -> Result<Vec<DepthMap>> {
    let map = |view: &View| {
        let (width, height) = (view.camera.width, view.camera.height);
        DepthMap::new(width, height, vec![metres; (width * height) as usize])
    };
    views.iter().map(map).collect()
}

#[test]
fn a_prior_that_returns_the_given_depth_makes_the_same_model_and_is_named() {
    let scene = scene();
    let depths: Vec<DepthMap> = scene.views.iter().map(|view| view.depth.clone().unwrap()).collect();
    let prior = Prior(|_: &[View]| Ok(Geometry::new(depths.clone(), None)));
    let own = run(&with_prior(&prior), &without_depth(scene.clone()), &options()).unwrap();
    let given = reconstruct(&scene, &options(), &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(own.gaussians == given.gaussians);
    assert_eq!((own.report.prior, given.report.prior), ("own", "given"));
    assert_eq!((own.report.head, own.report.settings), (given.report.head, given.report.settings));
}

#[test]
fn a_head_of_the_callers_makes_the_gaussians_and_is_named() {
    let head = Balls(|_| ());
    let parts = Parts { head: Some(&head), ..Parts::default() };
    let made = run(&parts, &scene(), &options()).unwrap();
    assert_eq!((made.report.prior, made.report.head, made.report.sh_degree), ("given", "balls", 0));
    assert!(made.gaussians.scales().iter().all(|scale| *scale == [0.02; 3]));
    assert!(made.report.symmetry.cloned > 0);
    assert!(!made.report.left_out.iter().any(|left| left.what == "SH bands"));
}

#[test]
fn a_wall_is_a_model_that_the_verdict_doubts() {
    let prior = Prior(|views: &[View]| Ok(Geometry::new(flat(views, 3.0)?, None)));
    let mut scene = without_depth(scene());
    scene.vehicle_box = Some(vg::scene::VehicleBox { size: [4.0, 1.8, 1.4], place: None });
    let report = run(&with_prior(&prior), &scene, &options()).unwrap().report;
    assert!(report.verdict_reasons.iter().any(|reason| reason.code == ReasonCode::DepthUnit), "{report:?}");
    let unused = report.left_out.iter().find(|left| left.what == "vehicle size").unwrap();
    assert_eq!(unused.why, "the prior own does not use them");
}

#[test]
fn bad_answers_are_errors_that_name_the_prior() {
    type Answer = fn(&[View]) -> Result<Geometry>;
    let bad: [(Answer, &str); 9] = [
        (|views| Ok(Geometry::new(flat(&views[1..], 3.0)?, None)), "returned 3 depth maps for 4 views"),
        (
            |_| Ok(Geometry::new(vec![DepthMap::new(2, 1, vec![1.0; 2])?; 4], None)),
            "returned a depth map of 2x1 for",
        ),
        (
            |views| {
                let all = flat(views, 3.0)?;
                let doubtful = |map: DepthMap| map.with_confidence(vec![f32::NAN; 96 * 72]);
                Ok(Geometry::new(all.into_iter().map(doubtful).collect::<Result<_>>()?, None))
            },
            "returned a confidence of NaN for",
        ),
        (
            |views| Ok(Geometry { normals: vec![vec![]], ..Geometry::new(flat(views, 3.0)?, None) }),
            "returned 1 normal maps for 4 views",
        ),
        (
            |views| Ok(Geometry { normals: vec![vec![]; 4], ..Geometry::new(flat(views, 3.0)?, None) }),
            "returned 0 normals for",
        ),
        (
            |views| {
                let normals = vec![vec![glam::Vec3::NAN; 96 * 72]; 4];
                Ok(Geometry { normals, ..Geometry::new(flat(views, 3.0)?, None) })
            },
            "returned the normal [NaN, NaN, NaN] for",
        ),
        (
            |views| {
                let (low, high, source) = ([f64::NAN; 3], [1.0; 3], BoxSource::Estimated);
                Ok(Geometry::new(
                    flat(views, 3.0)?,
                    Some(WorkingBox { low, high, source, contradicted_m: 0.0 }),
                ))
            },
            "returned a working box from [NaN",
        ),
        (
            |views| {
                let ends = Some(Ends { low: [1.0; 3], high: [0.0; 3], error_m: [[0.0; 2]; 3] });
                Ok(Geometry { ends, ..Geometry::new(flat(views, 3.0)?, None) })
            },
            "returned a surface from [1.0",
        ),
        (|views| Ok(Geometry::new(flat(views, f32::NAN)?, None)), ""),
    ];
    for (answer, expected) in bad {
        let prior = Prior(answer);
        let error = run(&with_prior(&prior), &without_depth(scene()), &options()).unwrap_err();
        // Depth that is not a number is no depth: then no pixel is left.
        let (stage, start) = match expected {
            "" => ("head", "no pixel is left".into()),
            _ => ("prior", format!("the prior own {expected}")),
        };
        assert!(
            matches!(&error, Error::Reconstruction { stage: at, reason } if *at == stage && reason.starts_with(&start)),
            "{error}\n{expected}"
        );
    }
}

#[test]
fn bad_answers_are_errors_that_name_the_head() {
    let refusal = |head: &dyn GaussianHead| {
        let parts = Parts { head: Some(head), ..Parts::default() };
        run(&parts, &scene(), &options()).unwrap_err().to_string()
    };
    let error = refusal(&Nothing);
    assert!(error.starts_with("head: the head nothing returned no Gaussian for "), "{error}");
    let error = refusal(&Balls(|ball| ball.mean[1] = f32::INFINITY));
    assert!(error.contains("means["), "{error}");
    #[cfg(not(debug_assertions))]
    assert!(
        refusal(&Astray)
            .starts_with("head: the head astray returned a Gaussian that cannot be stored: means[0]")
    );
}

#[test]
fn what_the_caller_hands_in_is_not_chosen_by_options_as_well() {
    let prior = Prior(|views: &[View]| Ok(Geometry::new(flat(views, 3.0)?, None)));
    for (options, expected) in [
        (
            Options { prior: PriorChoice::Hull, ..options() },
            "options.prior: hull, with the caller's own prior own; allowed: auto",
        ),
        (
            Options { budget_s: Some(2.0), ..options() },
            "options.budget_s: 2 s, with the caller's own prior own; allowed: none: the time of that prior is not known",
        ),
    ] {
        assert_eq!(run(&with_prior(&prior), &scene(), &options).unwrap_err().to_string(), expected);
    }
    let mut bare = without_depth(scene());
    bare.views[1].mask = None;
    let error = run(&with_prior(&prior), &bare, &options()).unwrap_err().to_string();
    assert!(error.contains(".mask: none, so that all of the photograph would be vehicle"), "{error}");
}

#[test]
fn a_prior_of_the_callers_can_be_cancelled() {
    let prior = Prior(|views: &[View]| Ok(Geometry::new(flat(views, 3.0)?, None)));
    let threads = Threads::new(1).unwrap();
    let mut progress = |at: vg::progress::Progress| match at.stage == "prior" && at.fraction > 0.0 {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let stopped = reconstruct_with(&with_prior(&prior), &threads, &scene(), &options(), &mut progress);
    assert!(matches!(stopped, Err(Error::Cancelled { stage: "prior" })));
}
