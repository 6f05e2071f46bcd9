//! Selections of Gaussians, covariances, and PLY files in memory.

use super::gaussians::{make, required, vg_gaussians};
use super::guard::{guarded, guarded_value};
use super::read;
use super::status::{vg_error, vg_status};
use std::ffi::c_void;
use vg::io::ply;
use vg::{Error, Gaussians, Result};

/// The Gaussians at these indices, in this order; an index may come again.
///
/// - gaussians: not NULL; they stay as they are.
/// - indices, index_count: each below `vg_gaussians_count`. NULL with 0.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error, which names the index.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_select(
    gaussians: *const vg_gaussians,
    indices: *const usize,
    index_count: usize,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            gaussians.selected(read::numbers("indices", indices, index_count)?)
        })
    }
}

/// The Gaussians whose byte is not 0, in order: by opacity, by size, by whatever the caller computed of the arrays.
///
/// - gaussians: not NULL; they stay as they are.
/// - keep, keep_count: one byte per Gaussian, `vg_gaussians_count` of them. NULL with 0.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_mask(
    gaussians: *const vg_gaussians,
    keep: *const u8,
    keep_count: usize,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            as_many("keep_count", keep_count, gaussians)?;
            let keep = read::numbers::<u8>("keep", keep, keep_count)?;
            gaussians.masked(&keep.iter().map(|&byte| byte != 0).collect::<Vec<_>>())
        })
    }
}

/// The Gaussians whose centre lies in a box, its faces included, in order.
///
/// - gaussians: not NULL; they stay as they are.
/// - low, high: 3 numbers each, metres, in the Gaussians' frame; `low` not above `high`. Infinite sides are open.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_crop(
    gaussians: *const vg_gaussians,
    low: *const f64,
    high: *const f64,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            let [low, high] = [read::fixed::<3>("low", low)?, read::fixed::<3>("high", high)?];
            gaussians.cropped(low.map(|v| v as f32), high.map(|v| v as f32))
        })
    }
}

/// Covariance matrices R diag(scale^2) R^T, square metres: xx, xy, xz, yy, yz, zz of each, as 3D Gaussian Splatting orders
/// them.
///
/// - gaussians: not NULL.
/// - out: float32 `[count][6]`; unchanged on failure. NULL with 0.
/// - count: `vg_gaussians_count`.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_covariances(
    gaussians: *const vg_gaussians,
    out: *mut f32,
    count: usize,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            as_many("count", count, gaussians)?;
            read::writable("out", out, count)?;
            for (i, covariance) in gaussians.covariances().into_iter().enumerate() {
                out.cast::<[f32; 6]>().add(i).write_unaligned(covariance);
            }
            Ok(())
        })
    }
}

/// Checks that the caller's array has an element for each Gaussian.
fn as_many(argument: &str, count: usize, gaussians: &Gaussians) -> Result<()> {
    match count == gaussians.len() {
        true => Ok(()),
        false => {
            let allowed = format!("{}, one per Gaussian", gaussians.len());
            Err(Error::argument(argument, count.to_string(), allowed))
        }
    }
}

/// `vg_gaussians_load_ply` of a file that is in memory.
///
/// - data, size: the bytes of the file; not kept. NULL with 0.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_load_ply_memory(
    data: *const c_void,
    size: usize,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let (gaussians, _notes) = ply::from_bytes(read::numbers("data", data.cast::<u8>(), size)?)?;
            Ok(gaussians)
        })
    }
}

/// How many bytes `vg_gaussians_save_ply_memory` writes. NULL: 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_ply_size(gaussians: *const vg_gaussians) -> usize {
    guarded_value(0, || unsafe { gaussians.cast::<Gaussians>().as_ref() }.map_or(0, ply::size_of))
}

/// `vg_gaussians_save_ply` into memory of the caller's.
///
/// - gaussians: not NULL.
/// - buffer: receives the bytes of the file, `vg_gaussians_ply_size` of them; unchanged on failure.
/// - size: how many bytes there is room for.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_save_ply_memory(
    gaussians: *const vg_gaussians,
    buffer: *mut c_void,
    size: usize,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            read::not_null("buffer", buffer, "where to put the file")?;
            let needed = ply::size_of(gaussians);
            if size < needed {
                let allowed = format!("at least {needed}, as vg_gaussians_ply_size returns");
                return Err(Error::argument("size", format!("{size} bytes"), allowed));
            }
            let bytes = ply::to_bytes(gaussians);
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), buffer.cast(), bytes.len());
            Ok(())
        })
    }
}
