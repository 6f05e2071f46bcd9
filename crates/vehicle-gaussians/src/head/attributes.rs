//! The paper's activations: from the 38 raw channels of one pixel to one Gaussian (method section 3).
//!
//! a = [o, dp, q, s, h]: opacity alpha = sigmoid(o + 3); centre mu = p_v + R_vc dp (paper eq. 7); rotation
//! q / |q| in the vehicle frame; scale clip(activation(s), 1e-10, 3) metres (paper eq. 6); colour h
//! with h_0 += RGB2SH(I) (paper eq. 8).

use glam::{Mat3, Vec3};
use vg_splat::gaussians::{buffer::normalize_quaternion, sh};

/// Channels per pixel: o 1, dp 3, q 4, s 3, h 27.
pub const CHANNELS: usize = 38;

/// SH degree of the attributes.
pub const SH_DEGREE: u8 = 2;

/// sigma_min and sigma_max, metres.
pub const SCALE_BOUNDS: [f32; 2] = [1e-10, 3.0];

/// Function that makes a raw scale positive (the paper's ablation; it uses softplus).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ScaleActivation {
    /// ln(1 + e^s)
    #[default]
    Softplus,
    /// 1 / (1 + e^-s)
    Sigmoid,
    /// max(0, s)
    Relu,
}

/// Whether the head may move the centres (the paper's ablation).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Offset {
    /// mu = p_v + R_vc dp.
    #[default]
    Applied,
    /// mu = p_v.
    Ignored,
}

/// One activated Gaussian, vehicle frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activated {
    /// Centre, metres.
    pub mean: [f32; 3],
    /// Unit quaternion (w, x, y, z).
    pub rotation: [f32; 4],
    /// Standard deviations, metres.
    pub scale: [f32; 3],
    /// In [0, 1].
    pub opacity: f32,
    /// Degree 2, `[9][3]`.
    pub sh: [f32; 27],
}

/// Activates the raw channels of one pixel with lifted point `point_vehicle` (metres) and colour `rgb` in
/// [0, 1]. Any finite input gives a finite Gaussian; a zero quaternion means no rotation.
pub fn activate(
    raw: &[f32; CHANNELS],
    point_vehicle: Vec3,
    vehicle_from_camera: &Mat3,
    rgb: [f32; 3],
    activation: ScaleActivation,
    offset: Offset,
) -> Activated {
    let o = raw[0];
    let dp = Vec3::new(raw[1], raw[2], raw[3]);
    let q = [raw[4], raw[5], raw[6], raw[7]];
    let mean = match offset {
        Offset::Applied => point_vehicle + *vehicle_from_camera * dp,
        Offset::Ignored => point_vehicle,
    };
    let mut sh = [0.0; 27];
    sh.copy_from_slice(&raw[11..]);
    for (coefficient, base) in sh.iter_mut().zip(sh::from_rgb(rgb)) {
        *coefficient += base;
    }
    Activated {
        mean: mean.to_array(),
        rotation: normalize_quaternion(q).unwrap_or([1.0, 0.0, 0.0, 0.0]),
        scale: std::array::from_fn(|k| scale(raw[8 + k], activation)),
        opacity: sigmoid(o + 3.0),
        sh,
    }
}

/// clip(activation(s), 1e-10, 3), metres.
pub fn scale(raw: f32, activation: ScaleActivation) -> f32 {
    let positive = match activation {
        // ln(1 + e^s) = max(s, 0) + ln(1 + e^-|s|) never overflows and keeps small values accurate.
        ScaleActivation::Softplus => raw.max(0.0) + (-raw.abs()).exp().ln_1p(),
        ScaleActivation::Sigmoid => sigmoid(raw),
        ScaleActivation::Relu => raw.max(0.0),
    };
    positive.clamp(SCALE_BOUNDS[0], SCALE_BOUNDS[1])
}

fn sigmoid(x: f32) -> f32 {
    // e^-x may be infinite: 1 / inf = 0 is the correct limit.
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn activated(raw: &[f32; CHANNELS], offset: Offset) -> Activated {
        let r = Mat3::from_rotation_z(0.5);
        activate(raw, Vec3::new(1.0, 2.0, 3.0), &r, [0.25, 0.5, 1.0], ScaleActivation::Softplus, offset)
    }

    #[test]
    fn zero_attributes_show_the_pixels_colour_at_the_lifted_point() {
        let g = activated(&[0.0; CHANNELS], Offset::Applied);
        assert_eq!(g.mean, [1.0, 2.0, 3.0]);
        assert_eq!(g.rotation, [1.0, 0.0, 0.0, 0.0]);
        assert!((g.opacity - 0.952_574_1).abs() < 1e-6); // sigmoid(3)
        assert!((g.scale[0] - std::f32::consts::LN_2).abs() < 1e-6); // softplus(0)
        let rgb = sh::to_rgb([g.sh[0], g.sh[1], g.sh[2]]);
        for (found, expected) in rgb.iter().zip([0.25, 0.5, 1.0]) {
            assert!((found - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn the_offset_turns_with_the_camera_and_can_be_switched_off() {
        let mut raw = [0.0; CHANNELS];
        raw[1] = 0.1;
        let g = activated(&raw, Offset::Applied);
        let expected = Vec3::new(1.0 + 0.1 * 0.5f32.cos(), 2.0 + 0.1 * 0.5f32.sin(), 3.0);
        assert!((Vec3::from_array(g.mean) - expected).length() < 1e-6);
        assert_eq!(activated(&raw, Offset::Ignored).mean, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn raw_values_of_ten_thousand_stay_finite_and_in_bounds() {
        for value in [-1e4f32, -100.0, 0.0, 100.0, 1e4, 1e30, -1e30] {
            let g = activated(&[value; CHANNELS], Offset::Applied);
            assert!(g.mean.iter().chain(&g.rotation).chain(&g.sh).all(|v| v.is_finite()));
            assert!((0.0..=1.0).contains(&g.opacity));
            for activation in [ScaleActivation::Softplus, ScaleActivation::Sigmoid, ScaleActivation::Relu] {
                assert!((SCALE_BOUNDS[0]..=SCALE_BOUNDS[1]).contains(&scale(value, activation)));
            }
        }
        let zero_rotation = {
            let mut raw = [1.0; CHANNELS];
            raw[4..8].fill(0.0);
            raw
        };
        assert_eq!(activated(&zero_rotation, Offset::Applied).rotation, [1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn softplus_keeps_its_relative_accuracy_for_very_negative_input() {
        for s in [-5.0f32, -15.0, -20.0] {
            let expected = f64::from(s).exp().ln_1p();
            assert!((f64::from(scale(s, ScaleActivation::Softplus)) / expected - 1.0).abs() < 1e-6);
        }
    }
}
