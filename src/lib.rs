//! The C library, `libvg.so` and `libvg.a`: the C face of the Rust library `vg` (`crates/vehicle-gaussians`).

pub mod capi;
