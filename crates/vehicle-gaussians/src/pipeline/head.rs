//! The stage `head`: one Gaussian for every kept pixel (paper sec. "Gaussian Attribute Estimation").

use super::frame::InFrame;
use super::plan;
use super::run::Run;
use crate::head::{GaussianHead, NetworkHead, SurfelHead};
use vg_geometry::{Error, Result};
use vg_splat::Gaussians;

/// Turns the kept pixels into Gaussians.
pub(super) fn head(run: &mut Run) -> Result<()> {
    let (views, geometry, kept) = (run.views.modelled(), &run.surface.geometry, &*run.kept);
    let built_in;
    let head: &dyn GaussianHead = match run.parts.head {
        Some(own) => own,
        None => {
            let degree = plan::sh_degree(views, geometry, &run.plan.options, &mut run.left_out);
            built_in = built_in_head(run, degree)?;
            built_in.as_ref()
        }
    };
    let gaussians = head.predict(views, geometry, kept, run.context)?;
    let failed = |reason| Err(Error::Reconstruction { stage: "head", reason });
    if run.parts.head.is_some() {
        let pixels = kept.iter().flatten().filter(|kept| **kept).count();
        if let Err(error) = check_answer(&gaussians) {
            return failed(format!(
                "the head {} returned a Gaussian that cannot be stored: {error}",
                head.name()
            ));
        }
        if gaussians.is_empty() && pixels > 0 {
            return failed(format!("the head {} returned no Gaussian for {pixels} pixels", head.name()));
        }
    }
    if gaussians.is_empty() {
        return failed(plan::nothing_kept(&run.left_out));
    }
    run.head.set(head.name());
    run.gaussians.set(InFrame::new(gaussians));
    Ok(())
}

fn built_in_head(run: &Run, sh_degree: u8) -> Result<Box<dyn GaussianHead>> {
    let options = &run.plan.options;
    Ok(match &options.head_model {
        Some(model) => {
            let head = NetworkHead::new(model.clone(), sh_degree)?;
            Box::new(if options.ignore_offset { head.without_offset() } else { head })
        }
        None => Box::new(SurfelHead::new(sh_degree)),
    })
}

/// An error for a Gaussian that breaks an invariant: `Gaussians::push` does not check them.
fn check_answer(gaussians: &Gaussians) -> Result<()> {
    Gaussians::from_arrays(
        gaussians.sh_degree(),
        gaussians.means().to_vec(),
        gaussians.rotations().to_vec(),
        gaussians.scales().to_vec(),
        gaussians.opacities().to_vec(),
        gaussians.sh().to_vec(),
    )
    .map(drop)
}
