//! The main job: scene in, vehicle out, with a plan of what the scene needs and a report of what was done.

mod baseline;
pub mod budget;
pub mod cap;
mod check;
mod cost;
mod guard;
pub mod machine;
mod measured;
pub mod options;
mod outline;
mod pixels;
mod plan;
pub mod report;
pub mod run;
mod size;
mod spread;
pub mod verdict;

pub use budget::{BudgetPlan, Chosen};
pub use cap::{DEFAULT_MAX_GAUSSIANS, GAUSSIANS};
pub use machine::Machine;
pub use options::{Calibrate, Keep, KeepItem, Options, PriorChoice};
pub use report::{CheckedView, InputError, LeftOut, Report, Stage};
pub use run::{PointCloud, Reconstruction, reconstruct, reconstruct_on};
pub use size::VehicleSize;
pub use verdict::{Evidence, Reason, ReasonCode, Severity, Verdict, ViewEvidence};
