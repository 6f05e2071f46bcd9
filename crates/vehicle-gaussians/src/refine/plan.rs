//! How many steps a run has: so many, or as many as fit into a time, which its first steps tell.

use super::options::Amount;
use std::time::{Duration, Instant};

/// Rounds over the views that tell how long a step takes. What depends on the number of steps waits for them.
const TIMED_ROUNDS: u32 = 2;

/// The steps of one run.
#[derive(Debug)]
pub(super) struct Plan {
    amount: Amount,
    planned: Option<u32>,
    timed: u32,
    start: Instant,
    setup: Duration,
}

impl Plan {
    /// Of a run that began at `start` and is about to make its first step; `round` steps see every view once.
    pub(super) fn new(amount: Amount, round: u32, start: Instant) -> Self {
        let planned = match amount {
            Amount::Iterations(n) => Some(n),
            Amount::Seconds(_) => None,
        };
        Self { amount, planned, timed: TIMED_ROUNDS * round, start, setup: start.elapsed() }
    }

    /// Whether there is another step after `made`.
    pub(super) fn goes_on(&self, made: u32) -> bool {
        self.planned.is_none_or(|n| made < n)
    }

    /// Looks at the clock once the timed steps are made.
    pub(super) fn note(&mut self, made: u32) {
        if let (None, Amount::Seconds(seconds)) = (self.planned, self.amount)
            && made == self.timed
        {
            let step = (self.start.elapsed() - self.setup).as_secs_f64() / f64::from(made);
            self.planned = Some(fitting(seconds, self.setup.as_secs_f64(), step).max(made));
        }
    }

    /// How many steps, once that is known.
    pub(super) fn planned(&self) -> Option<u32> {
        self.planned
    }

    /// The same for what may depend on it after `made` steps: whether it was known from the beginning or not, the same
    /// number of steps then gives the same bytes.
    pub(super) fn planned_at(&self, made: u32) -> Option<u32> {
        self.planned.filter(|_| made > self.timed)
    }

    /// How far the steps are, 0 to 1: not away from 0 while they are timed.
    pub(super) fn part(&self, made: u32) -> f32 {
        self.planned_at(made).map_or(0.0, |planned| {
            (made - self.timed) as f32 / planned.saturating_sub(self.timed).max(1) as f32
        })
    }
}

/// Steps of `step` seconds that fit into `seconds`, of which setting up took `setup`, and a last look takes about as
/// much.
fn fitting(seconds: f64, setup: f64, step: f64) -> u32 {
    ((seconds - 2.0 * setup) / step) as u32
}
