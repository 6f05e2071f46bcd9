//! The main job: scene in, vehicle out, with a plan of what the scene needs and a report of what was done.

mod baseline;
pub mod budget;
pub mod cap;
mod check;
mod cost;
pub mod machine;
pub mod options;
mod pixels;
mod plan;
pub mod report;
pub mod run;
mod spread;

pub use budget::{BudgetPlan, Chosen};
pub use cap::{DEFAULT_MAX_GAUSSIANS, GAUSSIANS};
pub use machine::Machine;
pub use options::{Calibrate, Keep, Options, PriorChoice};
pub use report::{InputError, LeftOut, Report, Stage};
pub use run::{PointCloud, Reconstruction, reconstruct, reconstruct_on};
