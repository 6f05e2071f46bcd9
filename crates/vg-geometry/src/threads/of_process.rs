//! Values that depend on threads, and so on the process that owns the threads.

use crate::error::{Error, Result};
use std::mem;
use std::process;

/// A value bound to the process that made it. A fork has none of its threads and holds its locks in whatever state they
/// had, so it would wait forever: it must neither use the value nor drop it.
#[derive(Debug)]
pub struct OfProcess<T> {
    /// `None` only during drop.
    value: Option<T>,
    process: u32,
}

impl<T> OfProcess<T> {
    /// Keeps `value` for this process.
    pub fn new(value: T) -> Self {
        Self { value: Some(value), process: process::id() }
    }

    /// Whether this is the process that made it.
    pub(crate) fn is_ours(&self) -> bool {
        self.process == process::id()
    }

    /// The value.
    ///
    /// # Errors
    /// [`Error::Argument`] about `argument` in a fork of the process that made it.
    pub fn get(&self, argument: &str) -> Result<&T> {
        match &self.value {
            Some(value) if self.is_ours() => Ok(value),
            _ => {
                let found = format!(
                    "made in process {}, but this process, {}, is a fork of it",
                    self.process,
                    process::id()
                );
                Err(Error::argument(argument, found, "one made after the fork"))
            }
        }
    }
}

impl<T> Drop for OfProcess<T> {
    fn drop(&mut self) {
        if !self.is_ours() {
            mem::forget(self.value.take());
        }
    }
}

/// A value as a fork sees it.
#[cfg(test)]
pub(crate) fn as_in_a_fork<T>(mut made: OfProcess<T>) -> OfProcess<T> {
    // No test is the first process of its system.
    OfProcess { value: made.value.take(), process: 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::rc::Rc;

    #[test]
    fn a_fork_gets_an_error_and_does_not_drop_the_value() {
        let value = Rc::new(7);
        let ours = OfProcess::new(Rc::clone(&value));
        assert_eq!(**ours.get("context").unwrap(), 7);
        let theirs = as_in_a_fork(ours);
        let error = theirs.get("context").unwrap_err().to_string();
        let here = process::id();
        assert_eq!(
            error,
            format!(
                "context: made in process 1, but this process, {here}, is a fork of it; \
                 allowed: one made after the fork"
            )
        );
        drop(theirs);
        assert_eq!(Rc::strong_count(&value), 2, "it was not dropped");
    }
}
