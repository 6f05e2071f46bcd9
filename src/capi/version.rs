//! Version of the library.

use std::ffi::c_char;

/// Major part of the version of this header.
pub const VG_VERSION_MAJOR: u32 = 0;

/// Minor part of the version of this header.
pub const VG_VERSION_MINOR: u32 = 1;

/// Patch part of the version of this header.
pub const VG_VERSION_PATCH: u32 = 0;

/// Number of the binary interface: the number in `libvg.so.0`. Programs built against any header with this number
/// run with any library of this number that is as new or newer.
pub const VG_ABI_VERSION: u32 = 0;

/// Version of the library that is running, "0.1.0". Static; never NULL.
#[unsafe(no_mangle)]
pub extern "C" fn vg_version() -> *const c_char {
    const { concat!(env!("CARGO_PKG_VERSION"), "\0") }.as_ptr().cast()
}

/// `VG_ABI_VERSION` of the library that is running; compare it with the header's when loading by hand.
#[unsafe(no_mangle)]
pub extern "C" fn vg_abi_version() -> u32 {
    VG_ABI_VERSION
}
