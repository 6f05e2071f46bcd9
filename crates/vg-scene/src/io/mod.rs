//! Files in and out: scenes (`transforms.json`, COLMAP), pictures, masks, depth maps, Gaussians as PLY.
//!
//! Every reader checks the sizes in a file before it allocates memory for them, and names file and field in its errors.
//! Parsers work on bytes without the file system, so that they can be fuzzed. Writers replace a file only once
//! the new one is complete.

mod beside;
pub mod colmap;
pub mod depth;
mod exr;
mod files;
pub mod image;
mod json;
mod listing;
mod load;
mod mask;
mod masked;
mod npy;
mod pfm;
pub mod ply;
mod realcar;
pub mod scene;
mod select;
pub mod splats;
mod stream;
pub mod transforms;
pub mod vehicle_frame;
mod writes;

pub use files::{check_folder, folds_case, resolved, write_atomically};
pub use masked::{MaskedViews, colmap_format, read_masked};
pub use realcar::find_scan;
pub use scene::{
    NamedCamera, SceneFiles, SceneFormat, SceneIndex, SceneOptions, SceneView, list_scene, open_scene,
    open_scene_watched,
};
pub use vehicle_frame::{
    FitQuality, alignment_text, read_known_centers, read_matrix, read_vehicle_from_world,
    vehicle_from_known_centers, write_alignment, write_vehicle_from_world,
};
pub use writes::{Writes, writes};
