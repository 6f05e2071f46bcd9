//! Gradients of pictures: against gsplat's autograd, against an f64 reference, and on what breaks backward passes.

mod common;

use common::golden::{camera, gaussians, golden};
use common::npz::Npz;
use vg::gaussians::sh;
use vg::render::{Background, CpuRenderer, DepthMode, Differentiable, Gradients, PictureGradient, Reference, RenderOptions};
use vg::Camera;

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
