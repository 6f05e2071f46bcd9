//! The number of steps of a run: given, or as many as fit into a duration, found by timing the first steps.

use super::options::Amount;
use std::time::{Duration, Instant};

/// Rounds over the views that are timed. Schedules that depend on the number of steps start after them.
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
    /// The plan of a run that began at `start` and is about to make its first step; `round` steps see every view once.
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

    /// Reads the clock once the timed steps are made.
    pub(super) fn note(&mut self, made: u32) {
        if let (None, Amount::Seconds(seconds)) = (self.planned, self.amount)
            && made == self.timed
        {
            let step = (self.start.elapsed() - self.setup).as_secs_f64() / f64::from(made);
            self.planned = Some(fitting(seconds, self.setup.as_secs_f64(), step).max(made));
        }
    }

    /// The number of steps, once it is known.
    pub(super) fn planned(&self) -> Option<u32> {
        self.planned
    }

    /// The number of steps, for schedules after `made` steps; `None` while steps are timed, even if the number was
    /// given, so that the same number of steps always gives the same bytes.
    pub(super) fn planned_at(&self, made: u32) -> Option<u32> {
        self.planned.filter(|_| made > self.timed)
    }

    /// Progress of the steps, 0 to 1; 0 while they are timed.
    pub(super) fn part(&self, made: u32) -> f32 {
        self.planned_at(made).map_or(0.0, |planned| {
            (made - self.timed) as f32 / planned.saturating_sub(self.timed).max(1) as f32
        })
    }
}

/// The number of steps of `step` seconds that fit into `seconds`, minus `setup` seconds for the setup and about as much
/// for the final evaluation.
fn fitting(seconds: f64, setup: f64, step: f64) -> u32 {
    ((seconds - 2.0 * setup) / step) as u32
}
