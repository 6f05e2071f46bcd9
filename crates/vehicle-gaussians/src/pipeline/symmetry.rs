//! The stage `symmetry`: the unseen side (paper sec. "Symmetry-Aware Gaussian Cloning").

use super::frame::InFrame;
use super::plan;
use super::run::Run;
use crate::symmetry::relight::Relighting;
use crate::symmetry::{Completed, Completion, MirrorClone};
use vg_geometry::Result;

/// Record of the completion.
pub(super) struct Symmetry {
    pub(super) completion: Completion,
    /// The last Gaussians are these mirror images.
    pub(super) clones: Vec<MirrorClone>,
    pub(super) relighting: Option<Relighting>,
}

/// Clones Gaussians across y = 0, by the rule that the caller chose.
pub(super) fn symmetry(run: &mut Run) -> Result<()> {
    let observed = run.gaussians.take().into_inner();
    let (options, views, geometry) = (&run.plan.options, run.views.modelled(), &run.surface.geometry);
    let Completed { gaussians, completion, clones, relighting } =
        run.context.parallel(|| Completed::new(observed, options.symmetry, options.relight, views, geometry));
    let why = "the mirrored place was observed by a view";
    plan::note(&mut run.left_out, "clones", why, completion.not_needed);
    run.gaussians.set(InFrame::new(gaussians));
    run.symmetry.set(Symmetry { completion, clones, relighting });
    Ok(())
}
