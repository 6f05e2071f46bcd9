//! Gradients of pictures: against gsplat's autograd, against an f64 reference, and on what breaks backward passes.

mod common;

use common::golden::{camera, gaussians, golden};
use common::npz::Npz;
use common::stiff::{Stiff, stiff};
use common::Random;
use vg::gaussians::sh;
use vg::render::{Background, CpuRenderer, DepthMode, Differentiable, Gradients, PictureGradient, Reference, RenderOptions};
use vg::render::reference::{Cuts, Parameters, ReferencePicture};
use vg::render::ReferenceGradients;
use vg::{Camera, Gaussians};

/// |a - b| / |b| as vectors.
fn relative_l2(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let error = norm(&mut found.iter().zip(expected).map(|(a, b)| a - b));
    let size = norm(&mut expected.iter().copied());
    if size == 0.0 { error } else { error / size }
}

fn f64s(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| v.into()).collect()
}

/// Every tensor of gsplat's gradients of `sum(plane * weights)`, and its relative error here.
fn against_golden(npz: &Npz, plane: &str, g: &Gradients) -> Vec<(String, f64)> {
    let stored = |name: &str| &npz.array(&format!("grad_{plane}_{name}")).values;
    // gsplat's are of the quaternions before they are normalised.
    let norms = npz.f32("quats_wxyz").as_chunks::<4>().0.iter().map(|q| {
        q.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>().sqrt()
    }).collect::<Vec<f64>>();
    let rotations: Vec<f64> =
        g.rotations.iter().zip(&norms).flat_map(|(q, n)| q.map(|v| f64::from(v) / n)).collect();
    let mut out = vec![
        ("means".to_owned(), relative_l2(&f64s(g.means.as_flattened()), stored("means"))),
        ("quats".to_owned(), relative_l2(&rotations, stored("quats"))),
        ("scales".to_owned(), relative_l2(&f64s(g.scales.as_flattened()), stored("scales"))),
        ("opacities".to_owned(), relative_l2(&f64s(&g.opacities), stored("opacities"))),
        ("viewmat".to_owned(), relative_l2(g.pose.view_matrix.as_flattened(), stored("viewmat"))),
        ("background".to_owned(), relative_l2(&g.background, stored("background"))),
    ];
    match npz.scalar("sh_degree") as i32 {
        -1 => {
            // Plain colours are 0.5 + Y0 sh.
            let colors: Vec<f64> = g.sh.iter().map(|&v| f64::from(v) / f64::from(sh::Y0)).collect();
            out.push(("colors".to_owned(), relative_l2(&colors, stored("colors"))));
        }
        _ => out.push(("sh".to_owned(), relative_l2(&f64s(&g.sh), stored("sh")))),
    }
    out
}

fn golden_options(npz: &Npz) -> RenderOptions {
    RenderOptions {
        background: Background::Color(npz.f32("background").try_into().unwrap()),
        depth_mode: DepthMode::Accumulated,
        antialiased: npz.get("antialiased").is_some_and(|a| a.values[0] != 0.0),
        ..RenderOptions::default()
    }
}

fn golden_weights(npz: &Npz, camera: &Camera, plane: &str) -> PictureGradient {
    let weights = npz.f32(&format!("weights_{plane}"));
    let mut gradient =
        PictureGradient { width: camera.width, height: camera.height, ..PictureGradient::default() };
    match plane {
        "color" => gradient.color = weights.as_chunks::<3>().0.to_vec(),
        "alpha" => gradient.alpha = weights,
        _ => gradient.depth = weights,
    }
    gradient
}

fn check_golden(name: &str, renderer: &impl Differentiable, tolerance: f64) {
    let Some(folder) = golden() else { return };
    let mut failures = Vec::new();
    for file in ["grad_colors_300", "grad_sh_300", "grad_antialiased_200"] {
        let npz = Npz::open(&folder.join(format!("{file}.npz")));
        let (camera, gaussians, options) = (camera(&npz), gaussians(&npz), golden_options(&npz));
        for plane in ["color", "alpha", "depth"] {
            let weights = golden_weights(&npz, &camera, plane);
            let g = renderer.backward(&gaussians, &camera, &options, &weights).unwrap();
            let errors = against_golden(&npz, plane, &g);
            print!("{name} {file:22} {plane:6}");
            for (tensor, error) in &errors {
                print!(" {tensor} {error:.1e}");
                if error.is_nan() || *error > tolerance {
                    failures.push(format!("{name} {file} {plane} {tensor}: {error:e}"));
                }
            }
            println!();
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn the_gradients_agree_with_gsplats_autograd_to_1e_4_of_each_tensor() {
    check_golden("avx2", &CpuRenderer::new(), 1e-4);
    check_golden("portable", &CpuRenderer::portable(), 1e-4);
}

#[test]
fn the_reference_agrees_with_gsplats_autograd_to_1e_5() {
    check_golden("f64", &Reference, 1e-5);
}

/// Random scenes tried.
const SCENES: u64 = 200;

/// The largest magnitude.
fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| v.abs().max(m))
}

/// Name, found and expected of every tensor.
fn tensors(g: &Gradients, e: &ReferenceGradients, camera: &Camera) -> Vec<(&'static str, Vec<f64>, Vec<f64>)> {
    let pose = e.pose(camera);
    let six = |p: &vg::render::PoseGradient| [p.rotation.to_array(), p.translation.to_array()].concat();
    vec![
        ("means", f64s(g.means.as_flattened()), e.means.as_flattened().to_vec()),
        ("rotations", f64s(g.rotations.as_flattened()), e.rotations.as_flattened().to_vec()),
        ("scales", f64s(g.scales.as_flattened()), e.scales.as_flattened().to_vec()),
        ("opacities", f64s(&g.opacities), e.opacities.clone()),
        ("sh", f64s(&g.sh), e.sh.clone()),
        ("background", g.background.to_vec(), e.background.to_vec()),
        ("view_matrix", g.pose.view_matrix.as_flattened().to_vec(), e.view_matrix.as_flattened().to_vec()),
        ("pose", six(&g.pose), six(&pose)),
    ]
}

#[test]
fn gradients_of_200_stiff_scenes_agree_with_the_reference_to_1e_3_of_each_tensors_largest() {
    let mut worst: Vec<(f64, String)> = Vec::new();
    for (level, renderer) in [("vector", CpuRenderer::new()), ("portable", CpuRenderer::portable())] {
        for seed in 0..SCENES {
            let Stiff { gaussians, camera, options, gradient } = stiff(seed);
            let found = renderer.backward(&gaussians, &camera, &options, &gradient).unwrap();
            let exact = Reference.backward_f64(&gaussians, &camera, &options, &gradient).unwrap();
            for (name, found, exact) in tensors(&found, &exact, &camera) {
                let error: Vec<f64> = found.iter().zip(&exact).map(|(a, b)| a - b).collect();
                let (error, scale) = (largest(&error), largest(&exact));
                let relative = if scale == 0.0 { error } else { error / scale };
                worst.push((relative, format!("{level} scene {seed} {name}: {error:e} of {scale:e}")));
                assert!(found.iter().all(|v| v.is_finite()), "{level} scene {seed} {name}");
            }
        }
    }
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (relative, what) in &worst[..12] {
        println!("{relative:.1e} {what}");
    }
    println!("median {:.1e}", worst[worst.len() / 2].0);
    assert!(worst[0].0 <= 1e-3, "{:?}", worst[0]);
}

/// The loss whose gradient is `gradient`, of the difference of two pictures.
fn loss_between(a: &ReferencePicture, b: &ReferencePicture, gradient: &PictureGradient) -> f64 {
    let color = a.color.as_flattened().iter().zip(b.color.as_flattened()).zip(gradient.color.as_flattened());
    let alpha = a.alpha.iter().zip(&b.alpha).zip(&gradient.alpha);
    let depth = a.depth.iter().zip(&b.depth).zip(&gradient.depth);
    color.chain(alpha).chain(depth).map(|((a, b), g)| (a - b) * f64::from(*g)).sum()
}

/// One number of a scene that finite differences move.
#[derive(Clone, Copy, Debug)]
enum Variable {
    Mean(usize, usize),
    Rotation(usize, usize),
    Scale(usize, usize),
    Opacity(usize),
    Sh(usize),
    Background(usize),
    View(usize, usize),
}

fn moved(p: &Parameters, v: Variable, step: f64) -> Parameters {
    let mut p = p.clone();
    match v {
        Variable::Mean(i, k) => p.means[i][k] += step,
        Variable::Rotation(i, k) => p.rotations[i][k] += step,
        Variable::Scale(i, k) => p.scales[i][k] += step,
        Variable::Opacity(i) => p.opacities[i] += step,
        Variable::Sh(i) => p.sh[i] += step,
        Variable::Background(c) => p.background[c] += step,
        Variable::View(row, column) => p.move_view(row, column, step),
    }
    p
}

fn of_variable(g: &ReferenceGradients, v: Variable) -> f64 {
    match v {
        Variable::Mean(i, k) => g.means[i][k],
        Variable::Rotation(i, k) => g.rotations[i][k],
        Variable::Scale(i, k) => g.scales[i][k],
        Variable::Opacity(i) => g.opacities[i],
        Variable::Sh(i) => g.sh[i],
        Variable::Background(c) => g.background[c],
        Variable::View(row, column) => g.view_matrix[row][column],
    }
}

/// Two variables of each tensor, of Gaussians drawn by lot.
fn sampled(r: &mut Random, gaussians: &Gaussians) -> Vec<(&'static str, Variable)> {
    let mut pick = |n: usize| r.uniform(0.0, n as f64) as usize;
    let n = gaussians.len();
    let mut out = Vec::new();
    for _ in 0..2 {
        out.push(("means", Variable::Mean(pick(n), pick(3))));
        out.push(("rotations", Variable::Rotation(pick(n), pick(4))));
        out.push(("scales", Variable::Scale(pick(n), pick(3))));
        out.push(("opacities", Variable::Opacity(pick(n))));
        out.push(("sh", Variable::Sh(pick(gaussians.sh().len()))));
        out.push(("background", Variable::Background(pick(3))));
        out.push(("view_matrix", Variable::View(pick(3), pick(4))));
    }
    out
}

/// Central differences of second order in the step, extrapolated to fourth.
fn difference(
    p: &Parameters,
    v: Variable,
    options: &RenderOptions,
    cuts: &Cuts,
    gradient: &PictureGradient,
    step: f64,
) -> f64 {
    let slope = |h: f64| {
        let a = Reference.render_with_cuts(&moved(p, v, h), options, cuts);
        let b = Reference.render_with_cuts(&moved(p, v, -h), options, cuts);
        loss_between(&a, &b, gradient) / (2.0 * h)
    };
    (4.0 * slope(step) - slope(2.0 * step)) / 3.0
}

#[test]
fn the_references_gradients_are_its_central_differences_with_cuts_held() {
    let mut worst = Vec::new();
    let mut compared = 0;
    for seed in 0..SCENES {
        let Stiff { gaussians, camera, options, gradient } = stiff(seed);
        let g = Reference.backward_f64(&gaussians, &camera, &options, &gradient).unwrap();
        let p = Parameters::new(&gaussians, &camera, &options).unwrap();
        let cuts = Reference.cuts(&p, &options);
        let mut r = Random::new(seed);
        for (tensor, v) in sampled(&mut r, &gaussians) {
            let scale = match tensor {
                "means" => largest(g.means.as_flattened()),
                "rotations" => largest(g.rotations.as_flattened()),
                "scales" => largest(g.scales.as_flattened()),
                "opacities" => largest(&g.opacities),
                "sh" => largest(&g.sh),
                "background" => largest(&g.background),
                _ => largest(g.view_matrix.as_flattened()),
            };
            let found = difference(&p, v, &options, &cuts, &gradient, 1e-6);
            let expected = of_variable(&g, v);
            compared += usize::from(expected != 0.0);
            let relative = if scale == 0.0 { found.abs() } else { (found - expected).abs() / scale };
            worst.push((relative, format!("scene {seed} {v:?}: {found:e}, gradient {expected:e}, of {scale:e}")));
        }
    }
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (relative, what) in &worst[..8] {
        println!("{relative:.1e} {what}");
    }
    println!("{compared} of {} gradients are not zero", worst.len());
    assert!(compared > 1000 && worst[0].0 <= 1e-5, "{:?}", worst[0]);
}
