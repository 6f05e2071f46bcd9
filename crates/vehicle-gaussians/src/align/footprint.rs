//! A vehicle's outline from above: its smallest enclosing rectangle gives an approximate heading, and its symmetry the
//! exact one.

use glam::DVec2;
use std::f64::consts::{FRAC_PI_2, TAU};

/// The number of rotations tried for the rectangle. Mirrors and rounded ends turn the smallest one by some degrees.
const TURNS: usize = 90;

/// Largest angle between the rectangle's sides and the axis of symmetry, radians.
const WITHIN: f64 = 0.14;

/// The number of axes tried in that range; a parabola interpolates between them.
const AXES: usize = 57;

/// Directions in which an axis' two sides are compared.
const DIRECTIONS: usize = 180;

/// The corners of the convex hull of points of a plane.
pub(super) struct Footprint(Vec<DVec2>);

impl Footprint {
    /// The hull by Andrew's monotone chain; `points` must not be empty.
    pub(super) fn new(mut points: Vec<DVec2>) -> Self {
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        let half = |points: &mut dyn Iterator<Item = DVec2>| {
            let mut chain: Vec<DVec2> = Vec::new();
            for p in points {
                while let [.., a, b] = chain[..]
                    && (b - a).perp_dot(p - b) <= 0.0
                {
                    chain.pop();
                }
                chain.push(p);
            }
            chain
        };
        let mut corners = half(&mut points.iter().copied());
        corners.extend(half(&mut points.iter().rev().copied()));
        Self(corners)
    }

    /// Middle and sides, along axes turned by `turn`, of the enclosing rectangle.
    pub(super) fn rectangle(&self, turn: f64) -> (DVec2, DVec2) {
        let reach = |quarters: f64| self.reach(turn + quarters * FRAC_PI_2);
        let high = DVec2::new(reach(0.0), reach(1.0));
        let low = -DVec2::new(reach(2.0), reach(3.0));
        (0.5 * (low + high), high - low)
    }

    /// Rotation of the smallest rectangle, below a quarter turn.
    pub(super) fn smallest_turn(&self) -> f64 {
        let area = |turn: f64| self.rectangle(turn).1.element_product();
        let turns = (0..TURNS).map(|k| k as f64 / TURNS as f64 * FRAC_PI_2);
        turns.min_by(|a, b| area(*a).total_cmp(&area(*b))).unwrap_or(0.0)
    }

    /// Direction, near `turn`, of the line about which the footprint is most nearly its own mirror image.
    pub(super) fn axis(&self, turn: f64) -> f64 {
        let step = 2.0 * WITHIN / (AXES - 1) as f64;
        let tried: Vec<f64> = (0..AXES).map(|k| turn - WITHIN + k as f64 * step).collect();
        let unlike: Vec<f64> = tried.iter().map(|axis| self.asymmetry(*axis)).collect();
        let best = (0..AXES).min_by(|a, b| unlike[*a].total_cmp(&unlike[*b])).unwrap_or(AXES / 2);
        let (Some(after), Some(before)) = (unlike.get(best + 1), best.checked_sub(1).map(|k| unlike[k]))
        else {
            return tried[best];
        };
        let bend = before - 2.0 * unlike[best] + after;
        tried[best] + if bend > 0.0 { 0.5 * step * (before - after) / bend } else { 0.0 }
    }

    /// Sum of squared differences of the support function on both sides of the best line in direction `axis`. A line
    /// that lies off the origin by k changes the difference by 2 k sin(angle to the axis).
    fn asymmetry(&self, axis: f64) -> f64 {
        let angles = (0..DIRECTIONS).map(|k| (k as f64 + 0.5) / DIRECTIONS as f64 * 0.5 * TAU);
        let differences: Vec<(f64, f64)> =
            angles.map(|a| (self.reach(axis + a) - self.reach(axis - a), 2.0 * a.sin())).collect();
        let k = differences.iter().map(|(d, s)| d * s).sum::<f64>()
            / differences.iter().map(|(_, s)| s * s).sum::<f64>();
        differences.iter().map(|(d, s)| (d - k * s).powi(2)).sum()
    }

    /// Support function: the largest coordinate along a direction.
    fn reach(&self, angle: f64) -> f64 {
        let direction = DVec2::from_angle(angle);
        self.0.iter().map(|p| p.dot(direction)).fold(f64::NEG_INFINITY, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_arrow_is_found_with_its_axis_sides_and_middle() {
        let turn = 0.3f64;
        let middle = DVec2::new(5.0, -2.0);
        // A box with a nose and one more pair of corners, which turn the smallest rectangle.
        let shape = [
            (-2.0, 0.9),
            (-2.0, -0.9),
            (1.0, 0.9),
            (1.0, -0.9),
            (2.0, 0.3),
            (2.0, -0.3),
            (0.5, 1.1),
            (0.5, -1.1),
        ];
        let points = shape.iter().map(|&(x, y)| middle + DVec2::from_angle(turn).rotate(DVec2::new(x, y)));
        let footprint = Footprint::new(points.collect());
        let axis = footprint.axis(footprint.smallest_turn());
        assert!((axis - turn).abs() < 1e-3, "{axis}");
        let (center, sides) = footprint.rectangle(axis);
        assert!((sides - DVec2::new(4.0, 2.2)).length() < 0.01, "{sides}");
        assert!((DVec2::from_angle(turn).rotate(center) - middle).length() < 0.01);
    }
}
