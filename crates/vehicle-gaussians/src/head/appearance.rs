//! Colour of a surfel from all views that see it, as spherical harmonics.
//!
//! Geometry is never exact and paint is glossy, so the same place looks different from different sides. A mean
//! over views blurs, and one view alone is wrong from other directions. Spherical harmonics can represent both: from
//! near view j's direction the surfel shows view j's colour. The coefficients are the posterior mean of a
//! Gaussian process on the sphere: colour = mean + sum over bands l >= 1 with equal prior power per band, and
//! noise inversely proportional to each view's weight. With n views this is one n x n solve per surfel.

use glam::Vec3;
use vg_splat::gaussians::sh;

/// Maximum of views that take part in one surfel's colour: about the number of coefficients of three bands.
pub const MAX_SAMPLES: usize = 16;

/// Noise variance of a view of weight 1 over the prior variance of the view-dependent part.
const NOISE: f64 = 0.3;

/// A surfel's colour in one view.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// Unit direction from the camera to the surfel, vehicle frame.
    pub direction: Vec3,
    /// RGB in [0, 1].
    pub color: Vec3,
    /// Trust, 0 to 1.
    pub weight: f32,
}

/// SH coefficients `[16][3]` up to `degree` that show the samples' colours in their directions.
pub fn fit(samples: &[Sample], degree: u8) -> [f32; 48] {
    // The buffers are cleared for every surfel; few surfels have many samples.
    match samples.len() {
        0..=4 => fit_up_to::<4>(samples, degree),
        5..=8 => fit_up_to::<8>(samples, degree),
        _ => fit_up_to::<MAX_SAMPLES>(&samples[..samples.len().min(MAX_SAMPLES)], degree),
    }
}

fn fit_up_to<const N: usize>(samples: &[Sample], degree: u8) -> [f32; 48] {
    let mut out = [0.0f32; 48];
    let total: f32 = samples.iter().map(|s| s.weight).sum();
    if total <= 0.0 {
        return out;
    }
    let mean = samples.iter().map(|s| s.color * s.weight).sum::<Vec3>() / total;
    out[..3].copy_from_slice(&sh::from_rgb(mean.to_array()));
    if degree == 0 || samples.len() < 2 {
        return out;
    }
    let n = samples.len();
    let prior = band_variances(degree);
    let mut basis = [[0.0f64; 16]; N];
    for (b, s) in basis.iter_mut().zip(samples) {
        *b = sh::basis(s.direction.as_dvec3().to_array(), degree);
    }
    let coefficients = sh::coefficients(degree);
    let mut k = [[0.0f64; N]; N];
    for i in 0..n {
        for j in 0..=i {
            let covariance: f64 = (1..coefficients).map(|c| prior[c] * basis[i][c] * basis[j][c]).sum();
            k[i][j] = covariance;
            k[j][i] = covariance;
        }
        k[i][i] += NOISE / f64::from(samples[i].weight).max(1e-3);
    }
    let mut residual = [[0.0f64; 3]; N];
    for (r, s) in residual.iter_mut().zip(samples) {
        *r = (s.color - mean).as_dvec3().to_array();
    }
    solve_in_place(&mut k, &mut residual, n);
    for c in 1..coefficients {
        for channel in 0..3 {
            let sum: f64 = (0..n).map(|i| residual[i][channel] * basis[i][c]).sum();
            out[3 * c + channel] = (prior[c] * sum) as f32;
        }
    }
    out
}

/// Prior variance per coefficient: the same power in each band, total variance 1 in any direction.
fn band_variances(degree: u8) -> [f64; 16] {
    let mut variances = [0.0; 16];
    for l in 1..=usize::from(degree) {
        // sum over m of Y_lm^2 = (2 l + 1) / 4 pi
        let power = (2 * l + 1) as f64 / (4.0 * std::f64::consts::PI);
        variances[l * l..(l + 1) * (l + 1)].fill(1.0 / (f64::from(degree) * power));
    }
    variances
}

/// Solves K x = b for symmetric positive definite K (Cholesky), overwriting b with x.
fn solve_in_place<const N: usize>(k: &mut [[f64; N]; N], b: &mut [[f64; 3]; N], n: usize) {
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = k[i][j] - (0..j).map(|m| k[i][m] * k[j][m]).sum::<f64>();
            k[i][j] = if i == j { sum.max(1e-12).sqrt() } else { sum / k[j][j] };
        }
    }
    for channel in 0..3 {
        for i in 0..n {
            let sum: f64 = (0..i).map(|m| k[i][m] * b[m][channel]).sum();
            b[i][channel] = (b[i][channel] - sum) / k[i][i];
        }
        for i in (0..n).rev() {
            let sum: f64 = (i + 1..n).map(|m| k[m][i] * b[m][channel]).sum();
            b[i][channel] = (b[i][channel] - sum) / k[i][i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(x: f32, y: f32, color: f32) -> Sample {
        Sample { direction: Vec3::new(x, y, 0.1).normalize(), color: Vec3::splat(color), weight: 1.0 }
    }

    fn shown(sh: &[f32; 48], direction: Vec3) -> f64 {
        sh::color(sh, direction.as_dvec3().to_array(), 3)[0]
    }

    #[test]
    fn one_view_or_degree_zero_give_the_mean_colour_from_everywhere() {
        let one = fit(&[sample(1.0, 0.0, 0.3)], 3);
        let mean = fit(&[sample(1.0, 0.0, 0.2), sample(0.0, 1.0, 0.6)], 0);
        for direction in [Vec3::X, Vec3::Y, Vec3::NEG_Z] {
            assert!((shown(&one, direction) - 0.3).abs() < 1e-6);
            assert!((shown(&mean, direction) - 0.4).abs() < 1e-6);
        }
    }

    #[test]
    fn each_views_colour_is_shown_near_its_direction() {
        let samples = [sample(1.0, 0.0, 0.2), sample(0.0, 1.0, 0.6), sample(-1.0, 0.2, 0.9)];
        let sh = fit(&samples, 3);
        for s in &samples {
            let color = f64::from(s.color.x);
            let seen = shown(&sh, s.direction);
            assert!((seen - color).abs() < 0.1, "{seen} for {color}");
        }
    }

    #[test]
    fn equal_directions_with_unequal_colours_and_twenty_views_stay_finite() {
        let twice = [sample(1.0, 0.0, 0.0), sample(1.0, 0.0, 1.0)];
        assert!((shown(&fit(&twice, 3), Vec3::X) - 0.5).abs() < 0.05);
        let many: Vec<Sample> = (0..20).map(|i| sample(1.0, 0.01 * i as f32, (i % 2) as f32)).collect();
        assert!(fit(&many, 3).iter().all(|v| v.is_finite() && v.abs() < 100.0));
    }
}
