//! References, besides photographs, masks and depth, that results are compared with.

use super::split;
use crate::args::JudgeArgs;
use crate::cloud;
use crate::job::Result;
use std::path::{Path, PathBuf};
use vg::metrics::Lpips;
use vg::onnx::ModelOptions;
use vg::scene::Cloud;

/// References as given on the command line; a scan is also looked up in each scene's folder.
pub(crate) struct Judge {
    scan: Option<PathBuf>,
    lpips: Option<Lpips>,
}

/// References for one vehicle.
#[derive(Default)]
pub(crate) struct References<'a> {
    /// Points all around the vehicle, in its frame, metres.
    pub(crate) scan: Option<Cloud>,
    pub(crate) lpips: Option<&'a Lpips>,
}

impl Judge {
    pub(crate) fn open(args: &JudgeArgs, models: &ModelOptions) -> Result<Self> {
        let open = |path: &PathBuf| Lpips::open(path, models);
        Ok(Self { scan: args.scan.clone(), lpips: args.lpips.as_ref().map(open).transpose()? })
    }

    /// Name of the LPIPS network, where LPIPS is measured.
    pub(crate) fn lpips_net(&self) -> Option<&str> {
        self.lpips.as_ref().map(Lpips::net)
    }

    pub(crate) fn references(&self, scene: &Path) -> Result<References<'_>> {
        let scan = self.scan.as_ref().map(|file| cloud::read(&split::find(file, scene))).transpose()?;
        Ok(References { scan, lpips: self.lpips.as_ref() })
    }
}
