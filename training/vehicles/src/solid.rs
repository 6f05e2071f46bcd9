//! Solids as scalar functions, positive inside and about as large as the distance to the surface in metres.

use glam::{Vec2, Vec3};

/// Minimum of two values with a fillet of width `k`: the rounded edge of an intersection.
pub fn smooth_min(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - 0.25 * h * h * k
}

/// Maximum of two values with a fillet: the filled crease of a union.
pub fn smooth_max(a: f32, b: f32, k: f32) -> f32 {
    -smooth_min(-a, -b, k)
}

/// A box with rounded edges.
pub fn rounded_box(p: Vec3, center: Vec3, half: Vec3, radius: f32) -> f32 {
    let q = (p - center).abs() - (half - radius);
    radius - q.max(Vec3::ZERO).length() - q.max_element().min(0.0)
}

/// An ellipsoid; exact at the surface only.
pub fn ellipsoid(p: Vec3, center: Vec3, half: Vec3) -> f32 {
    let q = (p - center) / half;
    let length = q.length();
    // Gradient of |q| along p, to convert to metres.
    let gradient = (q / half).length() / length.max(1e-3);
    (1.0 - length) / gradient.max(1.0 / half.max_element())
}

/// The half-plane below or behind the line from `a` to `b` (to the right of the direction from a to b) in the
/// (x, z) plane.
pub fn right_of(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let way = (b - a).normalize();
    (p - a).dot(Vec2::new(way.y, -way.x))
}

/// Piecewise cubic curve through points with rising x, without overshoot (monotone cubic interpolation, Fritsch
/// and Carlson 1980), level beyond its ends.
#[derive(Clone, Debug)]
pub struct Curve {
    points: Vec<Vec2>,
    slopes: Vec<f32>,
}

impl Curve {
    pub fn through(points: Vec<Vec2>) -> Self {
        let n = points.len();
        let secant: Vec<f32> =
            points.windows(2).map(|w| (w[1].y - w[0].y) / (w[1].x - w[0].x).max(1e-4)).collect();
        let slopes = (0..n)
            .map(|i| match (i.checked_sub(1).map(|j| secant[j]), secant.get(i)) {
                (Some(a), Some(&b)) if a * b > 0.0 => 2.0 * a * b / (a + b),
                (Some(_), Some(_)) => 0.0,
                (Some(a), None) => a,
                (None, Some(&b)) => b,
                (None, None) => 0.0,
            })
            .collect();
        Self { points, slopes }
    }

    pub fn at(&self, x: f32) -> f32 {
        let p = &self.points;
        let n = p.len();
        if x <= p[0].x {
            return p[0].y;
        }
        if x >= p[n - 1].x {
            return p[n - 1].y;
        }
        let i = p.windows(2).position(|w| x < w[1].x).unwrap_or(n - 2);
        let h = p[i + 1].x - p[i].x;
        let t = (x - p[i].x) / h;
        let (t2, t3) = (t * t, t * t * t);
        (2.0 * t3 - 3.0 * t2 + 1.0) * p[i].y
            + (t3 - 2.0 * t2 + t) * h * self.slopes[i]
            + (3.0 * t2 - 2.0 * t3) * p[i + 1].y
            + (t3 - t2) * h * self.slopes[i + 1]
    }
}
