//! The C face. `include/vg.h` is generated from this folder, doc comments included, and is written for readers of C.
//!
//! Every function does the same four things: sets its out parameters to NULL, reads what it was given into the
//! library's own types (`read`), calls the library, and hands the result out. All of it happens behind one panic
//! guard (`guard`). Algorithms live elsewhere.
//!
//! Rules that keep old programs running: functions and enumerators are added, never changed or removed; a struct
//! that may grow begins with its size and grows at its end; enumerations travel as `int32_t`. `tests/abi` holds all
//! of it to golden files.

// The one place where the library dereferences what a caller promised; `docs/ABI.md` says how it is tested.
#![allow(unsafe_code)]
#![allow(non_camel_case_types)]
// What callers must keep to is the same for all functions and stands in the header's first chapter.
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
