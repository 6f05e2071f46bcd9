//! The stages of a run with their expected times, from which the overall fraction is computed.

/// The stages to come, in their order.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Name and expected time, in any unit.
    stages: Vec<(&'static str, f64)>,
    /// The stage of the last report.
    stage: &'static str,
    /// The largest overall fraction reported so far.
    largest: f64,
}

impl Course {
    /// A course of stages, each with its expected time.
    pub fn new(stages: Vec<(&'static str, f64)>) -> Self {
        Self { stages, ..Self::default() }
    }

    /// The overall fraction once `fraction` of `stage` is done. A stage outside the course changes nothing.
    pub(crate) fn overall(&mut self, stage: &'static str, fraction: f64) -> f64 {
        self.stage = stage;
        if let Some(at) = self.stages.iter().position(|(name, _)| *name == stage) {
            let time = |stages: &[(&str, f64)]| stages.iter().map(|(_, time)| time).sum::<f64>();
            let done = time(&self.stages[..at]) + fraction.clamp(0.0, 1.0) * self.stages[at].1;
            let overall = done / time(&self.stages);
            // A stage may report a smaller fraction than before, and the total expected time may be zero.
            if overall > self.largest {
                self.largest = overall.min(1.0);
            }
        }
        self.largest
    }

    /// The stage of the last report; before any report, the last stage of the course.
    pub(crate) fn stage(&self) -> &'static str {
        let last = self.stages.last().map_or("", |(name, _)| name);
        if self.stage.is_empty() { last } else { self.stage }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_overall_fraction_grows_with_the_expected_time_and_never_falls() {
        let mut course = Course::new(vec![("a", 1.0), ("b", 3.0), ("c", 0.0)]);
        assert_eq!(course.stage(), "c");
        let reports =
            [("a", 0.0), ("a", 0.5), ("b", 0.0), ("b", 0.5), ("b", 0.1), ("other", 1.0), ("c", 1.0)];
        let overall = reports.map(|(stage, fraction)| course.overall(stage, fraction));
        assert_eq!(overall, [0.0, 0.125, 0.25, 0.625, 0.625, 0.625, 1.0]);
        assert_eq!((course.stage(), Course::default().stage()), ("c", ""));
        assert_eq!(Course::default().overall("a", 1.0), 0.0);
        assert_eq!(Course::new(vec![("a", 0.0)]).overall("a", 1.0), 0.0);
    }
}
