//! Stages of the caller's own.

use super::options::{Options, PriorChoice};
use crate::head::GaussianHead;
use crate::prior::DepthPrior;
use std::fmt;
use vg_geometry::{Error, Result};

/// Stages of the caller's own in place of this library's, for [`reconstruct_with`](super::reconstruct_with).
///
/// [`Options`] holds plain values that a report can repeat; the code of a stage is passed separately.
#[derive(Clone, Copy, Default)]
pub struct Parts<'a> {
    /// A depth source in place of [`Options::prior`], which must be `Auto`. Its depth is treated like depth that a
    /// network predicted: every used view needs a mask, and pixels that lie on no surface are removed unless
    /// [`Keep::floaters`](super::Keep::floaters) is set. A time budget is refused: the time of the prior is not known.
    pub prior: Option<&'a dyn DepthPrior>,
    /// A Gaussian head in place of [`Options::head_model`], which must be `None`. It chooses its own SH degree.
    pub head: Option<&'a dyn GaussianHead>,
}

impl fmt::Debug for Parts<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { prior, head } = self;
        f.debug_struct("Parts")
            .field("prior", &prior.map(DepthPrior::name))
            .field("head", &head.map(GaussianHead::name))
            .finish()
    }
}

impl Parts<'_> {
    /// An error where `options` choose what the caller hands in.
    pub(super) fn validate(&self, options: &Options) -> Result<()> {
        let refuse = |field: &str, found: String, allowed: &str| {
            Err(Error::argument(format!("options.{field}"), found, allowed))
        };
        if let Some(prior) = self.prior {
            let with = format!("with the caller's own prior {}", prior.name());
            if options.prior != PriorChoice::Auto {
                return refuse("prior", format!("{}, {with}", options.prior.name()), "auto");
            }
            if let Some(budget_s) = options.budget_s {
                return refuse(
                    "budget_s",
                    format!("{budget_s} s, {with}"),
                    "none: the time of that prior is not known",
                );
            }
        }
        if let (Some(head), Some(model)) = (self.head, &options.head_model) {
            let found = format!("{}, with the caller's own head {}", model.path().display(), head.name());
            return refuse("head_model", found, "none");
        }
        Ok(())
    }
}
