//! Gradients as lists of numbers, and central differences of the f64 reference with its cuts held.

use super::Random;
use vg::render::reference::{Cuts, Parameters, ReferencePicture};
use vg::render::{Gradients, PictureGradient, Reference, ReferenceGradients, RenderOptions};
use vg::{Camera, Gaussians};

pub fn f64s(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| v.into()).collect()
}

/// The largest magnitude.
pub fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| v.abs().max(m))
}

/// Name, found and expected values of every tensor.
pub fn tensors(
    g: &Gradients,
    e: &ReferenceGradients,
    camera: &Camera,
) -> Vec<(&'static str, Vec<f64>, Vec<f64>)> {
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

/// The loss with the gradient `gradient`, of the difference of two pictures.
pub fn loss_between(a: &ReferencePicture, b: &ReferencePicture, gradient: &PictureGradient) -> f64 {
    let color = a.color.as_flattened().iter().zip(b.color.as_flattened()).zip(gradient.color.as_flattened());
    let alpha = a.alpha.iter().zip(&b.alpha).zip(&gradient.alpha);
    let depth = a.depth.iter().zip(&b.depth).zip(&gradient.depth);
    color.chain(alpha).chain(depth).map(|((a, b), g)| (a - b) * f64::from(*g)).sum()
}

/// One number of a scene, for finite differences.
#[derive(Clone, Copy, Debug)]
pub enum Variable {
    Mean(usize, usize),
    Rotation(usize, usize),
    Scale(usize, usize),
    Opacity(usize),
    Sh(usize),
    Background(usize),
    View(usize, usize),
}

pub fn moved(p: &Parameters, v: Variable, step: f64) -> Parameters {
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

pub fn gradient_entry(g: &ReferenceGradients, v: Variable) -> f64 {
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

/// The largest gradient of a tensor, by its name in [`sampled`].
pub fn largest_of(g: &ReferenceGradients, tensor: &str) -> f64 {
    match tensor {
        "means" => largest(g.means.as_flattened()),
        "rotations" => largest(g.rotations.as_flattened()),
        "scales" => largest(g.scales.as_flattened()),
        "opacities" => largest(&g.opacities),
        "sh" => largest(&g.sh),
        "background" => largest(&g.background),
        _ => largest(g.view_matrix.as_flattened()),
    }
}

/// Two variables of each tensor, of randomly chosen Gaussians.
pub fn sampled(r: &mut Random, gaussians: &Gaussians) -> Vec<(&'static str, Variable)> {
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
pub fn difference(
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

pub fn all_finite(g: &Gradients) -> bool {
    let narrow =
        [g.means.as_flattened(), g.rotations.as_flattened(), g.scales.as_flattened(), &g.opacities, &g.sh];
    let pose = [g.pose.rotation.to_array(), g.pose.translation.to_array(), g.background];
    let mut wide = pose.as_flattened().iter().chain(g.pose.view_matrix.as_flattened());
    narrow.iter().all(|v| v.iter().all(|v| v.is_finite())) && wide.all(|v| v.is_finite())
}

/// A picture gradient of random numbers on every plane.
pub fn noise(seed: u64, camera: &Camera) -> PictureGradient {
    let mut r = Random::new(seed);
    let pixels = (camera.width * camera.height) as usize;
    let mut plane = |n: usize| (0..n).map(|_| r.normal() as f32).collect::<Vec<f32>>();
    PictureGradient {
        width: camera.width,
        height: camera.height,
        color: plane(3 * pixels).as_chunks::<3>().0.to_vec(),
        alpha: plane(pixels),
        depth: plane(pixels),
    }
}
