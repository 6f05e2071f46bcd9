//! The light of the unseen side, estimated from the seen one: vehicles are symmetric, their illumination is not.
//!
//! A clone shows the paint of the other side in the light of this one. With E(n) the light that falls on a surface of
//! normal n, a clone whose normal changed from n to M n must be E(M n) / E(n) times as bright. Only E is needed, not
//! the paint: most of a vehicle is one paint, and its front, rear, top and seen flank are in the same light as the
//! unseen flank. Daylight has few parameters:
//!
//! E(n) = 1 + u n_z + s max(0, n . l): an even sky and ground, brighter above by u, and a sun of strength s from
//! direction l.
//!
//! The observation is the brightness of the paint in thirteen directions of the normal: the 90th percentile of the
//! Gaussians that face each, because trim, tyres, glass and gaps are darker than paint. All suns of a grid are tried.
//! The likelihood of each is how well one paint explains the brightnesses, with a heavy tail, because a grille is not
//! paint. A grey vehicle also shows the colour of the light: sunlight is yellower than skylight. The correction is the
//! mean over all suns, weighted by their posterior. Where several suns explain the observation, some bright and some
//! dark on the other side, they cancel and the clones keep their colours.
//!
//! Measured in docs/COLOR.md.

use glam::{Quat, Vec3};
use rayon::prelude::*;
use serde::Serialize;
use std::ops::Range;
use vg_geometry::{MIRROR_Y, choices};
use vg_splat::gaussians::{Gaussians, sh};

choices! {
    /// Whether mirror images are shown in the light of their own side.
    #[derive(Default)]
    pub enum Relight as "relight" {
        /// As far as the light can be told from what was seen.
        #[default]
        Auto = 0 "auto",
        /// They keep the light of the side that was seen.
        Never = 1 "never",
    }
}

/// The estimated light, and how many clones it changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Relighting {
    /// Estimated ratio of the light on a surface facing left (+y) to that on one facing right (-y): posterior mean of
    /// the logarithm, bounded; linear light.
    pub left_over_right: f32,
    /// Mean direction towards the sun, vehicle frame; shorter than 1 where it is uncertain.
    pub sun: [f32; 3],
    /// Clones that were corrected.
    pub clones: usize,
}

/// Exponent from stored colours to linear light, approximately. A gain in linear light is then a gain in the stored
/// colour too, which spherical harmonics can represent.
const DISPLAY_GAMMA: f32 = 2.2;

/// Largest correction, natural logarithm of linear light: a factor of 2.2, the ratio of the sunlit to the shaded flank
/// of the vehicles it was measured on.
const MOST_LOG_GAIN: f32 = 0.8;

/// Part of the posterior mean that is applied: the posterior on the grid does not contain the error of the model.
const STRENGTH: f32 = 0.85;

/// Gaussians that are sampled, at most.
const MOST_SAMPLES: usize = 1 << 15;

/// Added to linear light before the logarithm, so that black has one.
const DARK: f32 = 0.01;

/// The light of a scene, as gains that correct clones.
#[derive(Clone, Debug)]
pub struct Light {
    gains: Vec<Vec3>, // [SIDE][SIDE], octahedral map of the clone's normal
    left_over_right: f32,
    sun: Vec3,
}

impl Light {
    /// Estimates the light from observed Gaussians; `None` where they face too few directions.
    pub fn estimate(seen: &Gaussians) -> Option<Self> {
        let facets = facets(seen);
        if facets.len() < 3 {
            return None;
        }
        let posterior = posterior(&facets);
        // All entries of a row have the same sign of y; the mirrored row has the inverse gains.
        let middle = SIDE / 2 * SIDE;
        let left: Vec<Vec3> =
            (middle..SIDE * SIDE).into_par_iter().map(|i| gain(&posterior, direction(i))).collect();
        let right = (1..=SIDE / 2).rev().flat_map(|row| &left[row * SIDE..(row + 1) * SIDE]);
        let gains = right.map(|gain| gain.recip()).chain(left.iter().copied()).collect();
        let sun = posterior.iter().map(|(p, day)| day.sun * *p).sum();
        Some(Self { gains, left_over_right: log_ratio(&posterior, Vec3::Y).0.exp(), sun })
    }

    /// Factor on the stored colour of a clone whose normal is `normal` (unit, vehicle frame).
    pub fn gain(&self, normal: Vec3) -> Vec3 {
        let [u, v] = octahedral(normal).map(|x| x.clamp(0.0, (SIDE - 1) as f32));
        let (column, row) = ((u as usize).min(SIDE - 2), (v as usize).min(SIDE - 2));
        let (du, dv) = (u - column as f32, v - row as f32);
        let at = |r: usize, c: usize| self.gains[r * SIDE + c];
        let upper = at(row, column).lerp(at(row, column + 1), du);
        let lower = at(row + 1, column).lerp(at(row + 1, column + 1), du);
        upper.lerp(lower, dv)
    }

    /// Shows `clones` in the light of their own side. Also returns the factor on the colour of each.
    pub fn apply(&self, gaussians: &mut Gaussians, clones: Range<usize>) -> (Relighting, Vec<[f32; 3]>) {
        let stride = gaussians.sh_stride();
        let (rotations, colors) = gaussians.rotations_and_colors_mut();
        let colors = &mut colors[clones.start * stride..clones.end * stride];
        let relit = colors.par_chunks_exact_mut(stride).zip(&rotations[clones.clone()]);
        let gains = relit.map(|(sh, rotation)| scale_color(sh, self.gain(normal(*rotation)).to_array()));
        let gains = gains.collect();
        let done = Relighting {
            left_over_right: self.left_over_right,
            sun: self.sun.to_array(),
            clones: clones.len(),
        };
        (done, gains)
    }
}

/// Multiplies a colour by `gain`, or by less where its mean over directions would exceed 1. Returns the factor.
fn scale_color(sh: &mut [f32], gain: [f32; 3]) -> [f32; 3] {
    let mean = sh::to_rgb([sh[0], sh[1], sh[2]]);
    let taken = std::array::from_fn(|channel| match mean[channel] {
        c if c > 0.0 => gain[channel].min((1.0 / c).max(1.0)),
        _ => 1.0,
    });
    for (channel, gain) in taken.into_iter().enumerate() {
        for k in (channel..sh.len()).step_by(3) {
            sh[k] *= gain;
        }
        sh[channel] += (gain - 1.0) * 0.5 / sh::Y0;
    }
    taken
}

/// Outward normal of a surfel.
fn normal([w, x, y, z]: [f32; 4]) -> Vec3 {
    Quat::from_xyzw(x, y, z, w) * Vec3::Z
}

// The observation.

/// The observed paint where it faces one direction.
#[derive(Clone, Copy, Debug)]
struct Facet {
    normal: Vec3,
    /// Logarithm of linear light.
    brightness: f32,
    /// ln(blue / red) of the samples of about that brightness.
    blue_over_red: f32,
    /// Distance of its colour from grey.
    saturation: f32,
    /// 0 to 1, by the number of Gaussians.
    weight: f32,
}

/// Normals of the faces and edges of a cube, without those that face the ground.
const FACING: [[f32; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [0.0, -1.0, 1.0],
];

fn facets(seen: &Gaussians) -> Vec<Facet> {
    /// Smallest cosine between a normal and the direction that it belongs to.
    const NEAR: f32 = 0.8;
    /// Samples that a direction needs.
    const FEWEST: usize = 16;
    /// Share of all Gaussians that makes half the weight.
    const HALF: f32 = 0.02;
    /// Quantile of the brightnesses of one direction that is taken for the paint.
    const PAINT_QUANTILE: f32 = 0.9;
    /// Samples whose brightness differs from the paint's by less determine its colour, natural logarithm.
    const AS_BRIGHT: f32 = 0.3;

    let directions = FACING.map(|d| Vec3::from_array(d).normalize());
    let mut samples: [Vec<[f32; 3]>; 13] = Default::default(); // brightness, ln(b/r), ln(g/r)
    let every = seen.len().div_ceil(MOST_SAMPLES).max(1);
    let stride = seen.sh_stride();
    let mut total = 0.0f32;
    for i in (0..seen.len()).step_by(every) {
        total += 1.0;
        let normal = normal(seen.rotations()[i]);
        let cosines = directions.map(|d| d.dot(normal));
        let Some(nearest) = (0..13).max_by(|a, b| cosines[*a].total_cmp(&cosines[*b])) else { continue };
        if cosines[nearest] > NEAR {
            let sh = &seen.sh()[i * stride..];
            let linear =
                sh::to_rgb([sh[0], sh[1], sh[2]]).map(|c| c.clamp(0.0, 1.0).powf(DISPLAY_GAMMA) + DARK);
            let brightness = (0.3 * linear[0] + 0.5 * linear[1] + 0.2 * linear[2]).ln();
            let red = linear[0].ln();
            samples[nearest].push([brightness, linear[2].ln() - red, linear[1].ln() - red]);
        }
    }
    let facet = |normal: Vec3, of: &mut Vec<[f32; 3]>| {
        let count = of.len();
        let brightness = quantile(of.iter().map(|s| s[0]), PAINT_QUANTILE)?;
        of.retain(|s| (s[0] - brightness).abs() < AS_BRIGHT);
        let blue = quantile(of.iter().map(|s| s[1]), 0.5)?;
        let green = quantile(of.iter().map(|s| s[2]), 0.5)?;
        let share = count as f32 / total;
        Some(Facet {
            normal,
            brightness,
            blue_over_red: blue,
            saturation: blue.abs() + (2.0 * green - blue).abs(),
            weight: share / (share + HALF),
        })
    };
    let enough = directions.into_iter().zip(&mut samples).filter(|(_, of)| of.len() >= FEWEST);
    enough.filter_map(|(normal, of)| facet(normal, of)).collect()
}

fn quantile(values: impl Iterator<Item = f32>, fraction: f32) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    let rank = (values.len().checked_sub(1)? as f32 * fraction) as usize;
    Some(*values.select_nth_unstable_by(rank, f32::total_cmp).1)
}

// The light that explains it.

/// One light: E(n) = 1 + sky n_z + strength max(0, n . sun).
#[derive(Clone, Copy, Debug)]
struct Day {
    sun: Vec3,
    strength: f32,
    sky: f32,
}

impl Day {
    /// E(n), and the sun's share of it.
    fn light(&self, normal: Vec3) -> (f32, f32) {
        let sun = self.strength * normal.dot(self.sun).max(0.0);
        let all = 1.0 + self.sky * normal.z + sun;
        (all, sun / all)
    }
}

/// ln(blue / red) of skylight minus that of sunlight, approximately.
const SKY_BLUE: f32 = 0.45;

/// All lights with their prior weights: suns evenly distributed over the sky, from none to a hard one.
fn days() -> Vec<(f32, Day)> {
    const ELEVATIONS: [f32; 7] = [15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0];
    const AZIMUTHS: u16 = 24;
    const STRENGTHS: [(f32, f32); 5] = [(0.3, 0.0), (0.5, 0.7), (1.0, 1.5), (1.0, 3.0), (0.7, 5.0)];
    const SKIES: [f32; 2] = [0.0, 0.3];
    let mut days =
        Vec::with_capacity(ELEVATIONS.len() * usize::from(AZIMUTHS) * STRENGTHS.len() * SKIES.len());
    for elevation in ELEVATIONS.map(f32::to_radians) {
        for k in 0..AZIMUTHS {
            let azimuth = f32::from(k) * std::f32::consts::TAU / f32::from(AZIMUTHS);
            let (level, up) = (elevation.cos(), elevation.sin());
            let sun = Vec3::new(level * azimuth.cos(), level * azimuth.sin(), up);
            for (prior, strength) in STRENGTHS {
                days.extend(SKIES.map(|sky| (prior * level, Day { sun, strength, sky })));
            }
        }
    }
    days
}

/// The lights of noticeable probability, normalised to a sum of 1.
fn posterior(facets: &[Facet]) -> Vec<(f32, Day)> {
    /// Lights below this share of the best one are left out.
    const LEAST: f32 = 1e-3;
    let days = days();
    let logs: Vec<f32> =
        days.par_iter().map(|(prior, day)| prior.ln() + log_likelihood(facets, day)).collect();
    let best = logs.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut kept: Vec<(f32, Day)> = logs
        .iter()
        .zip(&days)
        .map(|(log, (_, day))| ((log - best).exp(), *day))
        .filter(|(p, _)| *p > LEAST)
        .collect();
    let sum: f32 = kept.iter().map(|(p, _)| p).sum();
    kept.iter_mut().for_each(|(p, _)| *p /= sum);
    kept
}

/// Log-likelihood of `day`: Student's t with three degrees of freedom on the residuals of one paint in this light.
fn log_likelihood(facets: &[Facet], day: &Day) -> f32 {
    /// Spread of brightness from causes other than light, natural logarithm.
    const BRIGHTNESS: f32 = 0.25;
    /// Spread of ln(blue / red) of grey paint, and its growth with saturation.
    const TINT: f32 = 0.1;
    const TINT_OF_SATURATION: f32 = 0.3;
    /// More saturated paint does not show the colour of the light.
    const MOST_SATURATION: f32 = 1.2;
    const TURNS: usize = 4;

    let heavy = |residual: f32, spread: f32| (residual / spread).powi(2) / 3.0;
    let mut rest = [[0.0f32; 2]; FACING.len()]; // brightness and tint without the light's
    for (r, f) in rest.iter_mut().zip(facets) {
        let (light, sun) = day.light(f.normal);
        *r = [f.brightness - light.ln(), f.blue_over_red + SKY_BLUE * sun];
    }
    let seen = || facets.iter().zip(&rest);

    // The paint: a robust mean.
    let mean = |paint: Option<f32>| {
        let (sum, weight) = seen().fold((0.0, 0.0), |(sum, total), (f, r)| {
            let w = f.weight / (1.0 + paint.map_or(0.0, |p| heavy(r[0] - p, BRIGHTNESS)));
            (sum + w * r[0], total + w)
        });
        sum / weight
    };
    let paint = (0..TURNS).fold(None, |paint, _| Some(mean(paint))).unwrap_or_default();
    let brightness: f32 = seen().map(|(f, r)| f.weight * 2.0 * heavy(r[0] - paint, BRIGHTNESS).ln_1p()).sum();

    let spread = |f: &Facet| TINT + TINT_OF_SATURATION * f.saturation;
    let grey = || seen().filter(|(f, _)| f.saturation < MOST_SATURATION);
    let (sum, weight) = grey().fold((0.0, 0.0f32), |(sum, total), (f, r)| {
        let w = f.weight / spread(f).powi(2);
        (sum + w * r[1], total + w)
    });
    let paint = sum / weight.max(1e-9);
    let tint: f32 = grey().map(|(f, r)| f.weight * 2.0 * heavy(r[1] - paint, spread(f)).ln_1p()).sum();
    -(brightness + tint)
}

/// Posterior mean of ln E(n) / E(M n), bounded, and of the difference of the sun's shares.
fn log_ratio(posterior: &[(f32, Day)], normal: Vec3) -> (f32, f32) {
    let (mut log, mut share) = (0.0, 0.0);
    for (p, day) in posterior {
        let (here, there) = (day.light(normal), day.light(normal * MIRROR_Y));
        log += p * (here.0 / there.0).ln();
        share += p * (here.1 - there.1);
    }
    (MOST_LOG_GAIN * (STRENGTH * log / MOST_LOG_GAIN).tanh(), STRENGTH * share)
}

/// Factor on the stored colour.
fn gain(posterior: &[(f32, Day)], normal: Vec3) -> Vec3 {
    let (log, share) = log_ratio(posterior, normal);
    let tint = 0.5 * SKY_BLUE * share;
    Vec3::new(log + tint, log, log - tint).map(|l| (l / DISPLAY_GAMMA).exp())
}

// The table of gains: directions mapped to a square, the upper half within the inner diamond.

/// Entries along one side.
const SIDE: usize = 17;

/// Coordinates of a direction in the table.
fn octahedral(direction: Vec3) -> [f32; 2] {
    let d = direction / (direction.x.abs() + direction.y.abs() + direction.z.abs()).max(f32::MIN_POSITIVE);
    let [x, y] = match d.z {
        z if z >= 0.0 => [d.x, d.y],
        _ => [(1.0 - d.y.abs()).copysign(d.x), (1.0 - d.x.abs()).copysign(d.y)],
    };
    [x, y].map(|c| 0.5 * (c + 1.0) * (SIDE - 1) as f32)
}

/// Direction of entry `i`.
fn direction(i: usize) -> Vec3 {
    let [x, y] = [i % SIDE, i / SIDE].map(|k| 2.0 * k as f32 / (SIDE - 1) as f32 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let d = match z {
        z if z >= 0.0 => Vec3::new(x, y, z),
        _ => Vec3::new((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y), z),
    };
    d.normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::TAU;
    use vg_splat::gaussians::buffer::Gaussian;

    /// Paint of linear brightness `albedo` on an ellipsoid in light `day`, as the cameras of one side see it:
    /// the normals of the half y < 0.3.
    fn painted(albedo: [f32; 3], day: &Day) -> Gaussians {
        let mut out = Gaussians::with_capacity(1, 4000);
        for k in 0..4000u16 {
            let z = 1.0 - 1.6 * (f32::from(k) + 0.5) / 4000.0;
            let (azimuth, level) = (f32::from(k) * 0.618_034 * TAU, (1.0 - z * z).sqrt());
            let normal = Vec3::new(level * azimuth.cos(), level * azimuth.sin(), z);
            if normal.y > 0.3 {
                continue;
            }
            let color = shown(albedo, day, normal);
            let q = Quat::from_rotation_arc(Vec3::Z, normal);
            let surfel = Gaussian {
                mean: (normal * Vec3::new(2.0, 0.9, 0.7)).to_array(),
                rotation: [q.w, q.x, q.y, q.z],
                scale: [0.01, 0.01, 0.002],
                opacity: 0.9,
                sh0: sh::from_rgb(color),
            };
            let mut all = [0.02; 12];
            all[..3].copy_from_slice(&surfel.sh0);
            out.push_with_sh(&surfel, &all);
        }
        out
    }

    fn shown(albedo: [f32; 3], day: &Day, normal: Vec3) -> [f32; 3] {
        let (light, share) = day.light(normal);
        std::array::from_fn(|c| {
            let light = light * (1.0 - share + share * SUNLIGHT[c]);
            (albedo[c] * light).clamp(0.0, 1.0).powf(1.0 / DISPLAY_GAMMA)
        })
    }

    /// Sunlight over skylight.
    const SUNLIGHT: [f32; 3] = [1.12, 1.0, 0.72];
    const GREY: [f32; 3] = [0.12; 3];

    fn sun(azimuth_degrees: f32, elevation_degrees: f32, strength: f32) -> Day {
        let (a, e) = (azimuth_degrees.to_radians(), elevation_degrees.to_radians());
        Day { sun: Vec3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin()), strength, sky: 0.2 }
    }

    /// Error in the stored colour of clones that face the other side: mirrored only, and corrected.
    fn error(albedo: [f32; 3], day: &Day) -> (f32, f32) {
        let seen = painted(albedo, day);
        let light = Light::estimate(&seen).unwrap();
        let (mut before, mut after, mut n) = (0.0, 0.0, 0.0);
        for i in 0..seen.len() {
            let here = normal(seen.rotations()[i]);
            let there = here * MIRROR_Y;
            if there.y > 0.5 {
                let mirrored = shown(albedo, day, here)[1];
                let truth = shown(albedo, day, there)[1];
                before += (mirrored - truth).powi(2);
                after += (mirrored * light.gain(there).y - truth).powi(2);
                n += 1.0;
            }
        }
        ((before / n).sqrt(), (after / n).sqrt())
    }

    #[test]
    fn the_shade_of_a_sun_on_either_side_is_recovered_from_the_seen_side() {
        for albedo in [GREY, [0.02; 3], [0.2, 0.03, 0.02], [0.02, 0.05, 0.2]] {
            for (azimuth, strength) in [(-60.0, 3.0), (-120.0, 1.5), (60.0, 3.0), (120.0, 3.0), (90.0, 1.5)] {
                let (before, after) = error(albedo, &sun(azimuth, 40.0, strength));
                assert!(before > 0.05 && after < 0.72 * before, "{albedo:?}, {azimuth}: {before} to {after}");
            }
        }
    }

    #[test]
    fn light_that_is_even_around_the_vehicle_corrects_nothing() {
        for sky in [0.0, 0.3] {
            let day = Day { sun: Vec3::Z, strength: 0.0, sky };
            let light = Light::estimate(&painted(GREY, &day)).unwrap();
            for i in 0..SIDE * SIDE {
                let gain = light.gain(direction(i));
                assert!((gain - Vec3::ONE).abs().max_element() < 0.06, "{}: {gain}", direction(i));
            }
        }
    }

    #[test]
    fn paint_of_any_brightness_and_colour_determines_the_sunny_side() {
        for albedo in [[0.02; 3], [0.2; 3], [0.2, 0.03, 0.02], [0.02, 0.05, 0.2]] {
            let left = Light::estimate(&painted(albedo, &sun(75.0, 40.0, 2.0))).unwrap();
            let right = Light::estimate(&painted(albedo, &sun(-75.0, 40.0, 2.0))).unwrap();
            assert!(left.left_over_right > 1.2 && right.left_over_right < 0.8, "{albedo:?}");
        }
    }

    #[test]
    fn the_gain_of_a_mirrored_normal_is_the_inverse_and_on_the_plane_there_is_none() {
        let light = Light::estimate(&painted(GREY, &sun(-60.0, 40.0, 3.0))).unwrap();
        for i in 0..SIDE * SIDE {
            let d = direction(i);
            let both = light.gain(d) * light.gain(d * MIRROR_Y);
            assert!((both - Vec3::ONE).abs().max_element() < 1e-4, "{d}: {both}");
            let most = (1.4 * MOST_LOG_GAIN / DISPLAY_GAMMA).exp();
            assert!(light.gain(d).max_element() < most, "{d}");
        }
        for flat in [Vec3::X, Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, -0.8)] {
            assert!((light.gain(flat) - Vec3::ONE).abs().max_element() < 1e-5, "{flat}");
        }
    }

    #[test]
    fn clones_alone_change_and_only_in_colour() {
        let seen = painted(GREY, &sun(-60.0, 40.0, 3.0));
        let light = Light::estimate(&seen).unwrap();
        let mut all = seen.clone();
        all.append_mirrored();
        let mirrored = all.clone();
        let n = seen.len();
        let (done, gains) = light.apply(&mut all, n..2 * n);
        assert_eq!((done.clones, gains.len()), (n, n));
        assert!(done.left_over_right < 0.7 && done.sun[1] < -0.2, "{done:?}");
        assert_eq!((all.means(), all.scales()), (mirrored.means(), mirrored.scales()));
        assert_eq!((all.rotations(), all.opacities()), (mirrored.rotations(), mirrored.opacities()));
        assert_eq!(all.sh()[..12 * n], mirrored.sh()[..12 * n]);
        assert!(all.sh()[12 * n..] != mirrored.sh()[12 * n..]);
        assert!(all.sh().iter().all(|v| v.is_finite()));
    }

    #[test]
    fn black_white_and_few_gaussians_stay_finite() {
        let day = sun(60.0, 40.0, 3.0);
        for albedo in [[0.0; 3], [1e3; 3]] {
            let mut all = painted(albedo, &day);
            let light = Light::estimate(&all).unwrap();
            let n = all.len();
            light.apply(&mut all, 0..n);
            assert!(all.sh().iter().all(|v| v.is_finite()));
        }
        assert!(Light::estimate(&Gaussians::default()).is_none());
        let light = Light::estimate(&painted(GREY, &day)).unwrap();
        assert!(light.gain(Vec3::ZERO).is_finite() && light.gain(Vec3::splat(1e30)).is_finite());
    }

    #[test]
    fn the_table_holds_every_direction() {
        for i in 0..SIDE * SIDE {
            let [u, v] = octahedral(direction(i));
            // The rim holds the downward directions twice, with equal gains.
            let back = (v.round() as usize).min(SIDE - 1) * SIDE + (u.round() as usize).min(SIDE - 1);
            assert!(direction(back).dot(direction(i)) > 0.999, "{i} {back}");
        }
    }
}
