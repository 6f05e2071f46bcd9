//! Lens distortion on normalised image coordinates (x/z, y/z), in COLMAP's parametrisation.

/// Largest angle of a ray, 89 degrees: at 90 it does not meet a pinhole's image plane.
const MAX_THETA: f64 = 1.553;

/// The lens model is folded where the determinant of d distorted / d undistorted is not above this.
const MIN_DETERMINANT: f64 = 1e-9;

/// Distortion of a lens against a pinhole. Names and formulas are COLMAP's (`models.h`).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Distortion {
    /// A pinhole.
    #[default]
    None,
    /// Radial factor 1 + k1 r^2 + k2 r^4, tangential p1, p2, and the rational part of FULL_OPENCV:
    /// (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6). Unused ones are zero.
    Brown {
        /// k1 to k6.
        k: [f64; 6],
        /// p1, p2.
        p: [f64; 2],
    },
    /// theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), equidistant.
    Fisheye {
        /// k1 to k4.
        k: [f64; 4],
    },
}

impl Distortion {
    /// Whether this is a pinhole.
    pub fn is_none(&self) -> bool {
        match self {
            Self::None => true,
            Self::Brown { k, p } => k.iter().chain(p).all(|&v| v == 0.0),
            Self::Fisheye { .. } => false,
        }
    }

    /// Maps undistorted normalised coordinates to distorted ones.
    pub fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match *self {
            Self::None => [x, y],
            Self::Brown { k, p } => {
                let r2 = x * x + y * y;
                let factor = radial_numerator(&k, r2) / radial_denominator(&k, r2);
                [
                    x * factor + 2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x),
                    y * factor + 2.0 * p[1] * x * y + p[0] * (r2 + 2.0 * y * y),
                ]
            }
            Self::Fisheye { k } => {
                let r = x.hypot(y);
                // theta_d / r tends to 1 at the centre.
                let factor = if r > 1e-12 { fisheye_angle(&k, r.atan()) / r } else { 1.0 };
                [x * factor, y * factor]
            }
        }
    }

    /// Maps distorted normalised coordinates to undistorted ones; `None` where no ray in front of the camera maps there
    /// or the polynomial folds back before it (so that a wide corner is a hole rather than a ghost).
    pub fn undistort(&self, distorted: [f64; 2]) -> Option<[f64; 2]> {
        match *self {
            Self::None => Some(distorted),
            Self::Brown { .. } => self.undistort_newton(distorted),
            Self::Fisheye { k } => {
                let theta_distorted = distorted[0].hypot(distorted[1]);
                if theta_distorted < 1e-12 {
                    return Some(distorted);
                }
                let theta = solve_fisheye(&k, theta_distorted)?;
                let scale = theta.tan() / theta_distorted;
                Some([distorted[0] * scale, distorted[1] * scale])
            }
        }
    }

    /// Newton's method in two dimensions from the distorted point, in steps along the ray from the centre so that it
    /// stays on the branch of the image centre.
    fn undistort_newton(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        const CONTINUATION_STEPS: usize = 8;
        let mut guess = [0.0, 0.0];
        for step in 1..=CONTINUATION_STEPS {
            let t = step as f64 / CONTINUATION_STEPS as f64;
            guess = self.newton([target[0] * t, target[1] * t], guess)?;
        }
        Some(guess)
    }

    /// Newton's method with backtracking: where the image is nearly folded a full step overshoots, and may land
    /// beyond the fold. A step is taken only if it brings the value nearer to `target` and stays unfolded.
    fn newton(&self, target: [f64; 2], start: [f64; 2]) -> Option<[f64; 2]> {
        const MAX_ITERATIONS: usize = 60;
        const MAX_HALVINGS: usize = 30;
        let error_at = |p: [f64; 2]| {
            let value = self.distort(p);
            [target[0] - value[0], target[1] - value[1]]
        };
        let mut p = start;
        let mut error = error_at(p);
        let mut jacobian = self.jacobian(p);
        'newton: for _ in 0..MAX_ITERATIONS {
            let det = determinant(&jacobian);
            // The image is folded where the determinant is not positive.
            if det.is_nan() || det <= MIN_DETERMINANT {
                return None;
            }
            let step = [
                (jacobian[1][1] * error[0] - jacobian[0][1] * error[1]) / det,
                (jacobian[0][0] * error[1] - jacobian[1][0] * error[0]) / det,
            ];
            if step[0].hypot(step[1]) < 1e-13 * (1.0 + p[0].hypot(p[1])) {
                return Some([p[0] + step[0], p[1] + step[1]]);
            }
            let mut length = 1.0;
            for _ in 0..MAX_HALVINGS {
                let next = [p[0] + length * step[0], p[1] + length * step[1]];
                let next_error = error_at(next);
                if next_error[0].hypot(next_error[1]) < error[0].hypot(error[1]) {
                    let next_jacobian = self.jacobian(next);
                    if determinant(&next_jacobian) > 0.0 {
                        (p, error, jacobian) = (next, next_error, next_jacobian);
                        continue 'newton;
                    }
                }
                length *= 0.5;
            }
            break; // no step improves: the limit of rounding, or a fold
        }
        (error[0].hypot(error[1]) < 1e-9).then_some(p)
    }

    /// Whether the model preserves orientation here: a ray slightly farther out maps slightly farther out.
    pub(super) fn is_unfolded_at(&self, p: [f64; 2]) -> bool {
        match *self {
            Self::None => true,
            Self::Brown { .. } => determinant(&self.jacobian(p)) > MIN_DETERMINANT,
            Self::Fisheye { k } => {
                let theta = p[0].hypot(p[1]).atan();
                let h = 1e-6;
                theta <= MAX_THETA && fisheye_angle(&k, theta + h) > fisheye_angle(&k, (theta - h).max(0.0))
            }
        }
    }

    /// d distorted / d undistorted, rows (x, y), by central differences: the models are smooth, and this runs only on
    /// load.
    fn jacobian(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        let h = 1e-6 * (1.0 + x.abs().max(y.abs()));
        let (xp, xm) = (self.distort([x + h, y]), self.distort([x - h, y]));
        let (yp, ym) = (self.distort([x, y + h]), self.distort([x, y - h]));
        let d = 0.5 / h;
        [[(xp[0] - xm[0]) * d, (yp[0] - ym[0]) * d], [(xp[1] - xm[1]) * d, (yp[1] - ym[1]) * d]]
    }
}

fn determinant(m: &[[f64; 2]; 2]) -> f64 {
    m[0][0] * m[1][1] - m[0][1] * m[1][0]
}

fn radial_numerator(k: &[f64; 6], r2: f64) -> f64 {
    1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]))
}

fn radial_denominator(k: &[f64; 6], r2: f64) -> f64 {
    1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]))
}

fn fisheye_angle(k: &[f64; 4], theta: f64) -> f64 {
    let t2 = theta * theta;
    theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
}

/// The theta in (0, pi/2) with `fisheye_angle(theta) = target` on the first monotone interval, or `None`.
fn solve_fisheye(k: &[f64; 4], target: f64) -> Option<f64> {
    const SCAN: usize = 256;
    let mut below = 0.0;
    for i in 1..=SCAN {
        let theta = MAX_THETA * i as f64 / SCAN as f64;
        let value = fisheye_angle(k, theta);
        if value >= target {
            let (mut lo, mut hi) = (MAX_THETA * (i - 1) as f64 / SCAN as f64, theta);
            for _ in 0..60 {
                let middle = 0.5 * (lo + hi);
                if fisheye_angle(k, middle) < target { lo = middle } else { hi = middle }
            }
            return Some(0.5 * (lo + hi));
        }
        if value <= below {
            return None; // folded back before reaching the target
        }
        below = value;
    }
    None
}
