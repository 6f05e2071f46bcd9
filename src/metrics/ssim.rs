//! Structural similarity (Wang et al. 2004) with an 11x11 Gaussian window of sigma 1.5, as scikit-image computes
//! it with `gaussian_weights=True, use_sample_covariance=False, data_range=1`: the mean over channels and over
//! pixels whose window lies inside the picture.

use rayon::prelude::*;

const RADIUS: usize = 5;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// SSIM of two RGB pictures in [0, 1] (values outside are clamped), `width` columns wide, or `None` where the
/// picture is smaller than the window.
pub fn ssim(a: &[[f32; 3]], b: &[[f32; 3]], width: u32, height: u32) -> Option<f64> {
    let (w, h) = (width as usize, height as usize);
    assert!(a.len() == w * h && b.len() == w * h, "pictures of different sizes");
    if w <= 2 * RADIUS || h <= 2 * RADIUS {
        return None;
    }
    let channels: Vec<f64> = (0..3)
        .into_par_iter()
        .map(|c| {
            let plane = |image: &[[f32; 3]]| -> Vec<f64> {
                image.iter().map(|p| f64::from(p[c].clamp(0.0, 1.0))).collect()
            };
            ssim_of_plane(&plane(a), &plane(b), w, h)
        })
        .collect();
    Some(channels.iter().sum::<f64>() / 3.0)
}

fn ssim_of_plane(a: &[f64], b: &[f64], w: usize, h: usize) -> f64 {
    let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).collect::<Vec<f64>>();
    let blur = |x: &[f64]| blurred(x, w, h);
    let (mean_a, mean_b) = (blur(a), blur(b));
    let (aa, bb, ab) = (blur(&product(a, a)), blur(&product(b, b)), blur(&product(a, b)));
    let mut sum = 0.0;
    for i in 0..mean_a.len() {
        let (ma, mb) = (mean_a[i], mean_b[i]);
        let (var_a, var_b, covariance) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
        sum += ((2.0 * ma * mb + C1) * (2.0 * covariance + C2))
            / ((ma * ma + mb * mb + C1) * (var_a + var_b + C2));
    }
    sum / mean_a.len() as f64
}

/// Gaussian-weighted means of all windows inside the picture. `[(h - 10) * (w - 10)]`
fn blurred(x: &[f64], w: usize, h: usize) -> Vec<f64> {
    let mut kernel: [f64; 2 * RADIUS + 1] =
        std::array::from_fn(|i| (-0.5 * ((i as f64 - RADIUS as f64) / SIGMA).powi(2)).exp());
    let total: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= total);

    let inner = w - 2 * RADIUS;
    let mut rows = vec![0.0; inner * h];
    for (out, row) in rows.chunks_exact_mut(inner).zip(x.chunks_exact(w)) {
        for (k, weight) in kernel.iter().enumerate() {
            for (o, v) in out.iter_mut().zip(&row[k..]) {
                *o += weight * v;
            }
        }
    }
    let mut out = vec![0.0; inner * (h - 2 * RADIUS)];
    for (v, out) in out.chunks_exact_mut(inner).enumerate() {
        for (k, weight) in kernel.iter().enumerate() {
            for (o, r) in out.iter_mut().zip(&rows[(v + k) * inner..]) {
                *o += weight * r;
            }
        }
    }
    out
}
