//! The pipeline: a scene in, a vehicle out, with a plan of what the scene needs and a report of what was done.
//!
//! [`run`] holds the list of stages, which is the paper's method; each stage is in a file of its name.

mod baseline;
pub mod budget;
mod calibrate;
pub mod cap;
mod check;
mod cost;
mod frame;
mod guard;
mod head;
pub mod machine;
mod measured;
mod method;
pub mod options;
mod outline;
mod parts;
mod pixels;
mod plan;
mod prior;
mod refine;
pub mod report;
pub mod run;
mod size;
mod spread;
mod stage;
mod symmetry;
mod undistort;
pub mod verdict;

pub use baseline::BaselineRun;
pub use budget::{BudgetPlan, Chosen};
pub use cap::{DEFAULT_MAX_GAUSSIANS, GAUSSIANS};
pub use machine::Machine;
pub use method::Method;
pub use options::{Calibrate, Keep, KeepItem, Options, PriorChoice};
pub use parts::Parts;
pub use report::{CheckedView, InputError, LeftOut, Report, Stage};
pub use run::{PointCloud, Reconstruction, reconstruct, reconstruct_on, reconstruct_with};
pub use size::VehicleSize;
pub use verdict::{Evidence, Reason, ReasonCode, Severity, Verdict, ViewEvidence};
