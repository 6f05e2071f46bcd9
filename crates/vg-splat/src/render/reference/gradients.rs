//! Gradients of the reference picture: blending by textbook suffix sums, the projection by dual numbers.

use super::blend::{Cuts, falloff};
use super::dual::{Dual, Number};
use super::project::{Variables, project};
use super::{Parameters, Projected};
use crate::gaussians::sh;
use crate::render::gradient::narrow;
use crate::render::{Background, DepthMode, Gradients, PictureGradient, PoseGradient, RenderOptions};
use glam::{DMat3, DVec3};
use vg_geometry::{Camera, Pose};

/// [`Gradients`] in f64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceGradients {
    /// `[n][3]`
    pub means: Vec<[f64; 3]>,
    /// `[n][4]`
    pub rotations: Vec<[f64; 4]>,
    /// `[n][3]`
    pub scales: Vec<[f64; 3]>,
    /// `[n]`
    pub opacities: Vec<f64>,
    /// `[n][(degree + 1)^2][3]`
    pub sh: Vec<f64>,
    /// Zero for a transparent background.
    pub background: [f64; 3],
    /// Gradient of the entries of `camera_from_vehicle`, all free; the last row is zero.
    pub view_matrix: [[f64; 4]; 4],
}

impl ReferenceGradients {
    /// Converts the gradient of the matrix to a [`PoseGradient`].
    pub fn pose(&self, camera: &Camera) -> PoseGradient {
        let m = &self.view_matrix;
        let pose: Pose = camera.vehicle_from_camera;
        let row = |r: usize| DVec3::new(m[r][0], m[r][1], m[r][2]);
        let d_rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        let d_translation = DVec3::new(m[0][3], m[1][3], m[2][3]);
        let r = pose.rotation.transpose();
        let t = -(r * pose.translation);
        // The camera's motion (w, v) makes R -> R - [w] R, t -> t - [w] t - v.
        let turn = d_rotation * pose.rotation
            + DMat3::from_cols(d_translation * t.x, d_translation * t.y, d_translation * t.z);
        let at = |row: usize, column: usize| turn.col(column)[row];
        PoseGradient {
            rotation: DVec3::new(at(1, 2) - at(2, 1), at(2, 0) - at(0, 2), at(0, 1) - at(1, 0)),
            translation: -d_translation,
            view_matrix: *m,
        }
    }

    pub(super) fn narrowed(&self, camera: &Camera) -> Gradients {
        Gradients {
            means: self.means.iter().map(|v| v.map(narrow)).collect(),
            rotations: self.rotations.iter().map(|v| v.map(narrow)).collect(),
            scales: self.scales.iter().map(|v| v.map(narrow)).collect(),
            opacities: self.opacities.iter().map(|&v| narrow(v)).collect(),
            sh: self.sh.iter().map(|&v| narrow(v)).collect(),
            background: self.background,
            pose: self.pose(camera),
        }
    }
}

/// dL/d of one Gaussian on the image plane.
#[derive(Clone, Copy, Default)]
struct Upstream {
    depth: f64,
    center: [f64; 2],
    conic: [f64; 3],
    opacity: f64,
    color: [f64; 3],
}

/// Number of variables: mean, rotation, scale, opacity, `[R | t]`.
const VARIABLES: usize = 3 + 4 + 3 + 1 + 12;

pub(super) fn backward(
    parameters: &Parameters,
    options: &RenderOptions,
    gradient: &PictureGradient,
) -> ReferenceGradients {
    let splats = parameters.project(options);
    let cuts = Cuts::new(parameters, options);
    let mut upstream = vec![Upstream::default(); parameters.means.len()];
    let mut background = [0.0; 3];
    for i in 0..cuts.layers.len() {
        let behind = blend(parameters, options, &splats, &cuts, i, gradient, &mut upstream);
        for c in 0..3 {
            background[c] += behind[c];
        }
    }
    let mut out = ReferenceGradients {
        sh: vec![0.0; parameters.sh.len()],
        background: if options.background == Background::Transparent { [0.0; 3] } else { background },
        ..ReferenceGradients::default()
    };
    let mut view = [[0.0; 4]; 3];
    for (i, g) in upstream.iter().enumerate() {
        let by = through_projection(parameters, options, i, g, &mut out.sh);
        out.means.push([by[0], by[1], by[2]]);
        out.rotations.push([by[3], by[4], by[5], by[6]]);
        out.scales.push([by[7], by[8], by[9]]);
        out.opacities.push(by[10]);
        for k in 0..12 {
            view[k / 4][k % 4] += by[11 + k];
        }
    }
    // p = R m + t_0 with t = t_0 + R origin.
    for row in 0..3 {
        for column in 0..3 {
            out.view_matrix[row][column] = view[row][column] + view[row][3] * parameters.origin[column];
        }
        out.view_matrix[row][3] = view[row][3];
    }
    out
}

/// Differentiates one pixel: adds to the Gaussians' gradients and returns the background's.
fn blend(
    parameters: &Parameters,
    options: &RenderOptions,
    splats: &[Option<Projected<f64>>],
    cuts: &Cuts,
    pixel: usize,
    gradient: &PictureGradient,
    upstream: &mut [Upstream],
) -> [f64; 3] {
    let d_color = gradient.color.get(pixel).map_or([0.0; 3], |c| c.map(f64::from));
    let mut d_alpha = gradient.alpha.get(pixel).map_or(0.0, |&a| a.into());
    let mut d_depth = gradient.depth.get(pixel).map_or(0.0, |&d| d.into());
    let layers = &cuts.layers[pixel];
    let alphas: Vec<f64> = layers
        .iter()
        .map(|l| match (&splats[l.gaussian], l.clamped) {
            (Some(s), false) => s.opacity * falloff(s, pixel, parameters.width).1,
            _ => f64::from(options.max_alpha),
        })
        .collect();
    let mut before = Vec::with_capacity(layers.len());
    let (mut transmittance, mut depth) = (1.0, 0.0);
    for (l, a) in layers.iter().zip(&alphas) {
        before.push(transmittance);
        depth += transmittance * a * splats[l.gaussian].map_or(0.0, |s| s.depth);
        transmittance *= 1.0 - a;
    }
    if options.depth_mode == DepthMode::Expected {
        let covered = 1.0 - transmittance;
        d_depth = if covered > 0.0 { d_depth / covered } else { 0.0 };
        d_alpha -= if covered > 0.0 { d_depth * depth / covered } else { 0.0 };
    }
    let dot = |c: [f64; 3]| d_color[0] * c[0] + d_color[1] * c[1] + d_color[2] * c[2];
    let shown = if options.background == Background::Transparent { [0.0; 3] } else { parameters.background };
    // Sum of T alpha phi behind the current layer, with the background's.
    let mut behind = transmittance * (dot(shown) - d_alpha);
    for (k, l) in layers.iter().enumerate().rev() {
        let Some(s) = &splats[l.gaussian] else { continue };
        let (alpha, t) = (alphas[k], before[k]);
        let phi = dot(s.color) + d_depth * s.depth;
        let g = &mut upstream[l.gaussian];
        for c in 0..3 {
            g.color[c] += t * alpha * d_color[c];
        }
        g.depth += t * alpha * d_depth;
        let by_alpha = t * phi - behind / (1.0 - alpha);
        behind += t * alpha * phi;
        if l.clamped {
            continue;
        }
        let ([dx, dy], e) = falloff(s, pixel, parameters.width);
        g.opacity += by_alpha * e;
        let by_sigma = -by_alpha * alpha;
        g.conic[0] += by_sigma * 0.5 * dx * dx;
        g.conic[1] += by_sigma * dx * dy;
        g.conic[2] += by_sigma * 0.5 * dy * dy;
        g.center[0] -= by_sigma * (s.conic[0] * dx + s.conic[1] * dy);
        g.center[1] -= by_sigma * (s.conic[1] * dx + s.conic[2] * dy);
    }
    d_color.map(|g| g * transmittance)
}

/// Differentiates the projection of Gaussian `i`; adds to the gradient of its coefficients in `sh`.
fn through_projection(
    parameters: &Parameters,
    options: &RenderOptions,
    i: usize,
    g: &Upstream,
    sh: &mut [f64],
) -> [f64; VARIABLES] {
    let variable = |value: f64, k: usize| Dual::<VARIABLES>::variable(value, k);
    let v = Variables {
        mean: [0, 1, 2].map(|k| variable(parameters.means[i][k], k)),
        rotation: [0, 1, 2, 3].map(|k| variable(parameters.rotations[i][k], 3 + k)),
        scale: [0, 1, 2].map(|k| variable(parameters.scales[i][k], 7 + k)),
        opacity: variable(parameters.opacities[i], 10),
        view: [0, 1, 2].map(|r| [0, 1, 2, 3].map(|k| variable(parameters.view[r][k], 11 + 4 * r + k))),
    };
    let Some(s) = project(parameters, i, &v, options) else { return [0.0; VARIABLES] };
    let stride = 3 * sh::coefficients(parameters.sh_degree);
    for k in 0..stride / 3 {
        for c in 0..3 {
            sh[i * stride + 3 * k + c] = if s.shown[c] { g.color[c] * s.basis[k] } else { 0.0 };
        }
    }
    let terms = [
        (g.depth, s.depth),
        (g.center[0], s.center[0]),
        (g.center[1], s.center[1]),
        (g.conic[0], s.conic[0]),
        (g.conic[1], s.conic[1]),
        (g.conic[2], s.conic[2]),
        (g.opacity, s.opacity),
        (g.color[0], s.color[0]),
        (g.color[1], s.color[1]),
        (g.color[2], s.color[2]),
    ];
    let zero = Dual::<VARIABLES>::constant(0.0);
    terms.into_iter().fold(zero, |sum, (g, output)| sum + Dual::constant(g) * output).by
}
