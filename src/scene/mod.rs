//! What a reconstruction starts from: views, each an image, a mask, a camera, and depth where it was measured.

pub mod cloud;
pub mod depth;
pub(crate) mod fit;
pub(crate) mod framing;
pub mod image;
pub mod mask;
pub(crate) mod mirror;
pub(crate) mod resize;
pub mod segment;
pub mod undistort;
pub mod vehicle_box;
pub mod view;
pub mod visibility;

pub use cloud::Cloud;
pub use depth::DepthMap;
pub use image::{PixelFormat, RgbImage};
pub use mask::Mask;
pub use segment::Segmenter;
pub use vehicle_box::{Place, VehicleBox};
pub use view::{Scene, View};
