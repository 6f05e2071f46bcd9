//! Least squares by Gauss-Newton steps, damped as by Levenberg (1944) and Marquardt (1963): a step that does not lower the
//! cost is tried again, shorter and more downhill.

/// Damping of the first step, as a part of the diagonal of the normal equations.
const FIRST_DAMPING: f64 = 1e-3;

/// What a step that lowers the cost multiplies the damping by.
const RELAX: f64 = 0.2;

/// When to try again and when to stop.
#[derive(Clone, Copy, Debug)]
pub struct Descent {
    /// Steps at most.
    pub steps: usize,
    /// Dampings that are tried for one step, at most.
    pub trials: usize,
    /// What a step that does not lower the cost multiplies the damping by.
    pub stiffen: f64,
    /// The damping is never less.
    pub least_damping: f64,
    /// A step that gains less than this part of the cost is the last.
    pub enough: f64,
}

impl Descent {
    /// From `start` downhill. `linearize` makes the normal equations at a state, once for each step; `moved` solves
    /// them with a damping and returns the state after the step, or `None` where there is none.
    pub fn run<State, Equations>(
        &self,
        start: State,
        cost: impl Fn(&State) -> f64,
        linearize: impl Fn(&State) -> Equations,
        moved: impl Fn(&State, &Equations, f64) -> Option<State>,
    ) -> State {
        let mut at = start;
        let mut damping = FIRST_DAMPING;
        for _ in 0..self.steps {
            let equations = linearize(&at);
            let mut gained = None;
            for _ in 0..self.trials {
                let Some(next) = moved(&at, &equations, damping) else { break };
                // A cost that is no number is not lower.
                if cost(&next) < cost(&at) {
                    gained = Some(cost(&at) - cost(&next));
                    at = next;
                    damping = (damping * RELAX).max(self.least_damping);
                    break;
                }
                damping *= self.stiffen;
            }
            match gained {
                Some(gain) if gain >= self.enough * cost(&at) => {}
                _ => break,
            }
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESCENT: Descent =
        Descent { steps: 100, trials: 6, stiffen: 10.0, least_damping: 1e-7, enough: 1e-12 };

    /// Rosenbrock's valley as residuals 10 (y - x^2) and 1 - x.
    fn residuals([x, y]: [f64; 2]) -> [f64; 2] {
        [10.0 * (y - x * x), 1.0 - x]
    }

    fn cost(at: &[f64; 2]) -> f64 {
        residuals(*at).iter().map(|r| r * r).sum()
    }

    /// The damped normal equations, solved by Cramer's rule.
    fn moved([x, y]: &[f64; 2], _: &(), damping: f64) -> Option<[f64; 2]> {
        let [r, s] = residuals([*x, *y]);
        let slopes = [-20.0 * x, 10.0];
        let (a, b, c) = (slopes[0] * slopes[0] + 1.0, slopes[0] * slopes[1], slopes[1] * slopes[1]);
        let (a, c) = (a * (1.0 + damping), c * (1.0 + damping));
        let right = [-(slopes[0] * r - s), -slopes[1] * r];
        let determinant = a * c - b * b;
        let step = [(right[0] * c - b * right[1]) / determinant, (a * right[1] - b * right[0]) / determinant];
        Some([x + step[0], y + step[1]])
    }

    #[test]
    fn a_bent_valley_is_walked_to_its_end() {
        let [x, y] = DESCENT.run([-1.2, 1.0], cost, |_| (), moved);
        assert!((x - 1.0).abs() < 1e-6 && (y - 1.0).abs() < 1e-6, "{x}, {y}");
    }

    #[test]
    fn where_no_step_lowers_the_cost_the_start_is_returned() {
        let uphill = |at: &f64, _: &(), _| Some(at + 1.0);
        assert_eq!(DESCENT.run(1.0, |at| at * at, |_| (), uphill), 1.0);
        assert_eq!(DESCENT.run(1.0, |_| f64::NAN, |_| (), uphill), 1.0);
        assert_eq!(DESCENT.run(1.0, |at| *at, |_| (), |_, _: &(), _| None), 1.0);
    }
}
