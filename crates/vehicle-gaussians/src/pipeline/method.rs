//! The methods that make a model of a scene: this library's, and the baseline that it is compared with.

use super::baseline::{self, BaselineRun};
use super::options::{Options, PriorChoice};
use super::run::{Reconstruction, reconstruct_on};
use crate::refine::baseline::BaselineOptions;
use serde::{Serialize, Serializer};
use vg_geometry::Result;
use vg_geometry::progress::{ProgressCallback, Threads};
use vg_scene::Scene;

/// A method with its settings.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// This library's method.
    Vehicle(Options),
    /// 3D Gaussian splatting of the input views alone.
    Baseline(BaselineRun),
}

impl From<Options> for Method {
    fn from(options: Options) -> Self {
        Self::Vehicle(options)
    }
}

impl From<BaselineRun> for Method {
    fn from(run: BaselineRun) -> Self {
        Self::Baseline(run)
    }
}

impl Method {
    /// Makes a model of `scene` on as many threads as the settings say. See [`reconstruct`](super::reconstruct) for
    /// `progress`.
    ///
    /// # Errors
    /// [`Error::Argument`](vg_geometry::Error::Argument) for bad settings or a bad scene, else what a stage fails with.
    pub fn reconstruct<'a>(
        &self,
        scene: &Scene,
        progress: &'a mut ProgressCallback<'a>,
    ) -> Result<Reconstruction> {
        self.reconstruct_on(&Threads::new(self.threads())?, scene, progress)
    }

    /// Makes a model of `scene` on existing threads; the number of threads in the settings is ignored.
    ///
    /// # Errors
    /// Those of [`Method::reconstruct`].
    pub fn reconstruct_on<'a>(
        &self,
        threads: &'a Threads,
        scene: &Scene,
        progress: &'a mut ProgressCallback<'a>,
    ) -> Result<Reconstruction> {
        match self {
            Self::Vehicle(options) => reconstruct_on(threads, scene, options, progress),
            Self::Baseline(run) => baseline::reconstruct_on(threads, scene, run, progress),
        }
    }

    /// The settings of this library's method; `None` for a baseline.
    pub fn vehicle(&self) -> Option<&Options> {
        match self {
            Self::Vehicle(options) => Some(options),
            Self::Baseline(_) => None,
        }
    }

    /// Worker threads; 0 means one per core.
    pub fn threads(&self) -> usize {
        match self {
            Self::Vehicle(options) => options.threads,
            Self::Baseline(run) => run.threads,
        }
    }

    /// Drops the open networks of the settings, so that a report that is kept does not keep their memory.
    pub fn release_models(&mut self) {
        if let Self::Vehicle(options) = self {
            (options.prior_model, options.head_model) = (None, None);
        }
    }

    /// Whether the depth of the scene's views is used.
    pub fn uses_given_depth(&self) -> bool {
        let prior = self.vehicle().map(|options| options.prior);
        matches!(prior, Some(PriorChoice::Auto | PriorChoice::Given))
    }
}

/// Written as the fields of [`Options`], with the settings of a baseline or null as `baseline`.
impl Serialize for Method {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Written<'a> {
            #[serde(flatten)]
            options: &'a Options,
            baseline: Option<&'a BaselineOptions>,
        }
        match self {
            Self::Vehicle(options) => Written { options, baseline: None }.serialize(serializer),
            Self::Baseline(run) => {
                Written { options: &run.as_options(), baseline: Some(&run.baseline) }.serialize(serializer)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_hold_the_options_of_a_method_and_then_its_baseline() {
        let written = |value: &Method| serde_json::to_string(value).unwrap();
        let options = serde_json::to_string(&Options::default()).unwrap();
        let fields = options.strip_suffix('}').unwrap();
        let vehicle = Method::Vehicle(Options::default());
        assert_eq!(written(&vehicle), format!("{fields},\"baseline\":null}}"));
        let baseline = serde_json::to_string(&BaselineOptions::default()).unwrap();
        let run = Method::Baseline(BaselineRun::default());
        assert_eq!(written(&run), format!("{fields},\"baseline\":{baseline}}}"));
        assert!(vehicle.uses_given_depth() && !run.uses_given_depth());
    }
}
