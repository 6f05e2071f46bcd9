//! What results are compared with beside photographs, masks and depth.

use super::split;
use crate::args::JudgeArgs;
use crate::cloud;
use crate::job::Result;
use std::path::{Path, PathBuf};
use vg::metrics::Lpips;
use vg::onnx::ModelOptions;
use vg::scene::Cloud;

/// As the command line has it; scans are looked for beside each scene.
pub(crate) struct Judge {
    scan: Option<PathBuf>,
    lpips: Option<Lpips>,
}

/// For one vehicle.
#[derive(Default)]
pub(crate) struct OfVehicle<'a> {
    /// Points all round the vehicle, its frame, metres.
    pub(crate) scan: Option<Cloud>,
    pub(crate) lpips: Option<&'a Lpips>,
}

impl Judge {
    pub(crate) fn open(args: &JudgeArgs, models: &ModelOptions) -> Result<Self> {
        let open = |path: &PathBuf| Lpips::open(path, models);
        Ok(Self { scan: args.scan.clone(), lpips: args.lpips.as_ref().map(open).transpose()? })
    }

    /// The network that LPIPS is by, where it is measured.
    pub(crate) fn lpips_net(&self) -> Option<&str> {
        self.lpips.as_ref().map(Lpips::net)
    }

    pub(crate) fn of(&self, scene: &Path) -> Result<OfVehicle<'_>> {
        let scan = self.scan.as_ref().map(|file| cloud::read(&split::find(file, scene))).transpose()?;
        Ok(OfVehicle { scan, lpips: self.lpips.as_ref() })
    }
}
