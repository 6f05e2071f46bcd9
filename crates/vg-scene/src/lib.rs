//! Input of a reconstruction: views, each with an image, a mask, a camera, and depth if it was measured.

#![warn(unreachable_pub)]

pub mod cloud;
pub mod depth;
pub mod fit;
pub mod framing;
pub mod image;
pub mod io;
pub mod mask;
pub mod mirror;
pub mod onnx;
pub mod resize;
pub mod undistort;
pub mod vehicle_box;
pub mod view;
pub mod visibility;

pub use cloud::Cloud;
pub use depth::DepthMap;
pub use image::{PixelFormat, RgbImage};
pub use mask::Mask;
pub use vehicle_box::{Place, VehicleBox};
pub use view::{Scene, View};
