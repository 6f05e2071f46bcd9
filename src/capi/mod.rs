//! The C interface. `include/vg.h` is generated from this folder; its public doc comments are written for users of C.
//!
//! Every function has four steps: it sets its out parameters to NULL, reads its arguments into the library's own types
//! (`read`), calls the library, and writes the result. All steps run behind one panic guard (`guard`). This folder
//! contains no algorithms.
//!
//! Rules that keep old programs running: functions and enumerators are added, never changed or removed; a struct
//! that may grow begins with its size and grows at its end; enumerations are passed as `int32_t`. `tests/abi` checks
//! these rules against golden files.

// The only place where the library dereferences the caller's pointers; `docs/ABI.md` describes how it is tested.
#![allow(unsafe_code)]
#![allow(non_camel_case_types)]
// The safety requirements are the same for all functions and are in the first chapter of the header.
#![allow(clippy::missing_safety_doc)]

mod guard;
mod overlap;
mod read;

mod version;

mod status;

mod context;

mod image;

mod camera;

mod view;

mod model;

mod options;

mod report;

mod gaussians;

mod select;

mod placed;

mod watched;

mod reconstruct;

mod refine;

mod render;

mod renderer;

mod gradient;

mod segment;

mod metrics;

mod scene;

mod align;

#[cfg(test)]
mod tests;

pub use align::*;
pub use camera::*;
pub use context::*;
pub use gaussians::*;
pub use gradient::*;
pub use image::*;
pub use metrics::*;
pub use model::*;
pub use options::*;
pub use placed::*;
pub use reconstruct::*;
pub use refine::*;
pub use render::*;
pub use renderer::*;
pub use report::*;
pub use scene::*;
pub use segment::*;
pub use select::*;
pub use status::*;
pub use version::*;
pub use view::*;
