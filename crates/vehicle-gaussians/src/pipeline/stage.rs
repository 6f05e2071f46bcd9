//! A run as a list of stages, and the driver that walks it.

use super::report::Clock;
use std::ops::Deref;
use vg_geometry::Result;
use vg_geometry::progress::Context;

/// One stage of a run.
pub(super) struct Stage<W> {
    /// Name in progress, reports and errors.
    name: &'static str,
    work: W,
    /// Whether the driver reports the beginning. A stage that can be switched off reports its own progress.
    is_announced: bool,
}

impl<W> Stage<W> {
    /// A stage that every run has.
    pub(super) const fn new(name: &'static str, work: W) -> Self {
        Self { name, work, is_announced: true }
    }

    /// A stage that an option switches off, which reports its own progress where it has work.
    pub(super) const fn optional(name: &'static str, work: W) -> Self {
        Self { name, work, is_announced: false }
    }
}

/// Runs the stages in order: reports the beginning of each and measures its time.
pub(super) fn walk<R, W: Fn(&mut R) -> Result<()>>(
    run: &mut R,
    stages: &[Stage<W>],
    context: &Context,
    clock: impl Fn(&mut R) -> &mut Clock,
) -> Result<()> {
    for Stage { name, work, is_announced } in stages {
        if *is_announced {
            context.report(name, 0.0)?;
        }
        work(run)?;
        clock(run).lap(name);
    }
    Ok(())
}

/// The product of a stage, which later stages read. Reading it before the stage has run is a bug in the list of stages
/// and panics with the stage's name.
#[derive(Debug)]
pub(super) struct Made<T> {
    stage: &'static str,
    value: Option<T>,
}

impl<T> Made<T> {
    /// The product of `stage`, which has not run.
    pub(super) const fn by(stage: &'static str) -> Self {
        Self { stage, value: None }
    }

    /// Stores the product.
    pub(super) fn set(&mut self, value: T) {
        self.value = Some(value);
    }

    /// Moves the product out.
    pub(super) fn take(&mut self) -> T {
        self.value.take().unwrap_or_else(|| panic!("read before the stage {} has run", self.stage))
    }
}

impl<T> Deref for Made<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.value.as_ref().unwrap_or_else(|| panic!("read before the stage {} has run", self.stage))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::ControlFlow;
    use vg_geometry::Error;
    use vg_geometry::progress::Threads;

    struct Run {
        clock: Clock,
        done: Vec<&'static str>,
    }

    type Work = fn(&mut Run) -> Result<()>;

    const STAGES: [Stage<Work>; 3] = [
        Stage::new("one", |run| {
            run.done.push("one");
            Ok(())
        }),
        Stage::optional("two", |_| Ok(())),
        Stage::new("three", |run| {
            run.done.push("three");
            Ok(())
        }),
    ];

    fn walked(cancel_at: &str) -> (Result<()>, Run, Vec<&'static str>) {
        let mut run = Run { clock: Clock::start(), done: Vec::new() };
        let mut reported = Vec::new();
        let threads = Threads::new(1).unwrap();
        let mut callback = |progress: vg_geometry::progress::Progress| {
            reported.push(progress.stage);
            if progress.stage == cancel_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let result = walk(&mut run, &STAGES, &Context::new(&threads, &mut callback), |run| &mut run.clock);
        (result, run, reported)
    }

    #[test]
    fn stages_run_in_order_and_all_are_measured() {
        let (result, run, reported) = walked("none");
        assert!(result.is_ok());
        assert_eq!((run.done, reported), (vec!["one", "three"], vec!["one", "three"]));
        let measured: Vec<_> = run.clock.finish().0.iter().map(|stage| stage.name).collect();
        assert_eq!(measured, ["one", "two", "three"]);
    }

    #[test]
    fn a_stage_that_the_caller_cancels_does_not_run() {
        let (result, run, _) = walked("three");
        assert!(matches!(result, Err(Error::Cancelled { stage: "three" })));
        assert_eq!(run.done, ["one"]);
    }

    #[test]
    #[should_panic(expected = "read before the stage prior has run")]
    fn a_product_that_is_read_too_early_names_its_stage() {
        let _ = **Made::<Box<u8>>::by("prior");
    }
}
