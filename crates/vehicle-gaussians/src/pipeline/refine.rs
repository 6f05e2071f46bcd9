//! The stage `refine`: the Gaussians optimised against the photographs, where the caller wants that.

use super::frame::InFrame;
use super::run::Run;
use crate::refine;
use vg_geometry::Result;

/// Moves the originals until their pictures are the photographs; clones follow their originals.
pub(super) fn refine(run: &mut Run) -> Result<()> {
    let Some(how) = &run.plan.options.refine else {
        run.refinement.set(None);
        return Ok(());
    };
    let gaussians = run.gaussians.take().into_inner();
    let (clones, views) = (&run.symmetry.clones, run.views.modelled());
    let (gaussians, done) = refine::refine(gaussians, clones, views, how, run.context)?;
    run.gaussians.set(InFrame::new(gaussians));
    run.refinement.set(Some(done));
    Ok(())
}
