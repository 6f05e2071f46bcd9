//! Structural similarity (Wang et al. 2004) with an 11x11 Gaussian window of sigma 1.5, as scikit-image computes
//! it with `gaussian_weights=True, use_sample_covariance=False, data_range=1`: the mean over channels and over
//! pixels whose window lies inside the picture.

use rayon::prelude::*;

const RADIUS: usize = 5;
/// Pixels across the window.
pub(crate) const WINDOW: usize = 2 * RADIUS + 1;
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
    let maps = SsimMaps::new(a.to_vec(), b.to_vec(), w, h);
    let count = maps.mean_a.len() as f64;
    maps.ssim().sum::<f64>() / count
}

/// Moments of two planes in every window inside the picture, `[(h - 10) * (w - 10)]` each, and SSIM from them.
pub(crate) struct SsimMaps {
    a: Vec<f64>,
    b: Vec<f64>,
    width: usize,
    height: usize,
    mean_a: Vec<f64>,
    mean_b: Vec<f64>,
    /// Means of a a, b b and a b.
    aa: Vec<f64>,
    bb: Vec<f64>,
    ab: Vec<f64>,
}

/// SSIM of one window, and the means it is made of: luminance * structure / (energy * variance).
struct Window {
    luminance: f64,
    structure: f64,
    energy: f64,
    variance: f64,
}

impl SsimMaps {
    /// Planes of `w * h` values, at least as large as the window.
    pub(crate) fn new(a: Vec<f64>, b: Vec<f64>, w: usize, h: usize) -> Self {
        let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).collect::<Vec<f64>>();
        let blur = |x: &[f64]| blurred(x, w, h);
        Self {
            mean_a: blur(&a),
            mean_b: blur(&b),
            aa: blur(&product(&a, &a)),
            bb: blur(&product(&b, &b)),
            ab: blur(&product(&a, &b)),
            a,
            b,
            width: w,
            height: h,
        }
    }

    fn window(&self, i: usize) -> Window {
        let (ma, mb) = (self.mean_a[i], self.mean_b[i]);
        let (var_a, var_b) = (self.aa[i] - ma * ma, self.bb[i] - mb * mb);
        Window {
            luminance: 2.0 * ma * mb + C1,
            structure: 2.0 * (self.ab[i] - ma * mb) + C2,
            energy: ma * ma + mb * mb + C1,
            variance: var_a + var_b + C2,
        }
    }

    /// SSIM of every window.
    pub(crate) fn ssim(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.mean_a.len()).map(|i| {
            let w = self.window(i);
            (w.luminance * w.structure) / (w.energy * w.variance)
        })
    }

    /// Gradient with respect to the first plane of the sum of SSIM times `weights`. `[h * w]`
    pub(crate) fn adjoint(&self, weights: &[f64]) -> Vec<f64> {
        let n = self.mean_a.len();
        let (mut of_mean, mut of_aa, mut of_ab) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for i in 0..n {
            let (ma, mb) = (self.mean_a[i], self.mean_b[i]);
            let w = self.window(i);
            let below = w.energy * w.variance;
            let ssim = (w.luminance * w.structure) / below;
            // The structure and the variance hold -ma mb and -ma^2 too.
            of_mean[i] = weights[i]
                * (2.0 * mb * (w.structure - w.luminance) / below
                    + 2.0 * ma * ssim * (1.0 / w.variance - 1.0 / w.energy));
            of_aa[i] = -weights[i] * ssim / w.variance;
            of_ab[i] = weights[i] * 2.0 * w.luminance / below;
        }
        let spread = |x: &[f64]| spread(x, self.width, self.height);
        let (of_mean, of_aa, of_ab) = (spread(&of_mean), spread(&of_aa), spread(&of_ab));
        (0..self.a.len()).map(|i| of_mean[i] + 2.0 * self.a[i] * of_aa[i] + self.b[i] * of_ab[i]).collect()
    }
}

/// The window's weights in one direction, summing to 1.
fn kernel() -> [f64; WINDOW] {
    let mut kernel: [f64; WINDOW] =
        std::array::from_fn(|i| (-0.5 * ((i as f64 - RADIUS as f64) / SIGMA).powi(2)).exp());
    let total: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= total);
    kernel
}

/// Gaussian-weighted means of all windows inside the picture. `[(h - 10) * (w - 10)]`
fn blurred(x: &[f64], w: usize, h: usize) -> Vec<f64> {
    let kernel = kernel();
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

/// The transpose of [`blurred`]: every window's value, spread over its pixels. `[h * w]`
fn spread(x: &[f64], w: usize, h: usize) -> Vec<f64> {
    let kernel = kernel();
    let inner = w - 2 * RADIUS;
    let mut rows = vec![0.0; inner * h];
    for (v, row) in x.chunks_exact(inner).enumerate() {
        for (k, weight) in kernel.iter().enumerate() {
            for (o, x) in rows[(v + k) * inner..].iter_mut().zip(row) {
                *o += weight * x;
            }
        }
    }
    let mut out = vec![0.0; w * h];
    for (out, row) in out.chunks_exact_mut(w).zip(rows.chunks_exact(inner)) {
        for (k, weight) in kernel.iter().enumerate() {
            for (o, r) in out[k..].iter_mut().zip(row) {
                *o += weight * r;
            }
        }
    }
    out
}
