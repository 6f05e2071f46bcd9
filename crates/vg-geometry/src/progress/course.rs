//! The stages of a run with the time that each is expected to take: what part of the whole is done.

/// The stages to come, in their order.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Name and expected time, in any unit.
    stages: Vec<(&'static str, f64)>,
    /// The stage that was told last.
    stage: &'static str,
    /// The largest overall fraction that was told.
    told: f64,
}

impl Course {
    /// Of stages with the time that each is expected to take.
    pub fn new(stages: Vec<(&'static str, f64)>) -> Self {
        Self { stages, ..Self::default() }
    }

    /// The overall fraction where `fraction` of `stage` is done. A stage that is not of the course changes nothing.
    pub(crate) fn overall(&mut self, stage: &'static str, fraction: f64) -> f64 {
        self.stage = stage;
        if let Some(at) = self.stages.iter().position(|(name, _)| *name == stage) {
            let time = |stages: &[(&str, f64)]| stages.iter().map(|(_, time)| time).sum::<f64>();
            let done = time(&self.stages[..at]) + fraction.clamp(0.0, 1.0) * self.stages[at].1;
            let overall = done / time(&self.stages);
            // A stage may tell a smaller fraction than before, and all stages together may take no time.
            if overall > self.told {
                self.told = overall.min(1.0);
            }
        }
        self.told
    }

    /// The stage that was told last; the last of all where none was.
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
        let told = [("a", 0.0), ("a", 0.5), ("b", 0.0), ("b", 0.5), ("b", 0.1), ("other", 1.0), ("c", 1.0)];
        let overall = told.map(|(stage, fraction)| course.overall(stage, fraction));
        assert_eq!(overall, [0.0, 0.125, 0.25, 0.625, 0.625, 0.625, 1.0]);
        assert_eq!((course.stage(), Course::default().stage()), ("c", ""));
        assert_eq!(Course::default().overall("a", 1.0), 0.0);
        assert_eq!(Course::new(vec![("a", 0.0)]).overall("a", 1.0), 0.0);
    }
}
