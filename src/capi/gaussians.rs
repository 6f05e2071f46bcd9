//! Gaussians: borrowed arrays, files, and what can be made of them.

use super::guard::{clear, guarded, guarded_value};
use super::options::sh_degree;
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use std::ffi::c_char;
use std::sync::Arc;
use vg::gaussians::{Gaussians, sh};
use vg::geometry::Similarity;
use vg::io::splats;
use vg::progress::Threads;
use vg::{Error, Result};

/// A set of Gaussians. Owned by the caller, who frees it with `vg_gaussians_free`. It never changes: `transform`,
/// `mirror`, `merge`, `select`, `mask` and `crop` return new ones, and any number of threads may read or render one at a time.
pub struct vg_gaussians {
    _private: [u8; 0],
}

/// Largest number of Gaussians in one handle.
const MAX_COUNT: usize = i32::MAX as usize;

/// Names of the arrays in the library and in C.
const ARRAYS: [(&str, &str); 5] = [
    ("means", "arrays.positions"),
    ("scales", "arrays.scales"),
    ("rotations", "arrays.rotations"),
    ("opacities", "arrays.opacities"),
    ("sh", "arrays.sh"),
];

/// Makes a handle, which is one count of an `Arc`: a renderer may outlive it.
pub(super) fn into_raw(gaussians: Gaussians) -> *mut vg_gaussians {
    Arc::into_raw(Arc::new(gaussians)).cast_mut().cast()
}

/// Shares the Gaussians of a handle, which then live as long as the last reference.
pub(super) unsafe fn shared(argument: &str, gaussians: *const vg_gaussians) -> Result<Arc<Gaussians>> {
    unsafe {
        required(argument, gaussians)?;
        let handle = gaussians.cast::<Gaussians>();
        Arc::increment_strong_count(handle);
        Ok(Arc::from_raw(handle))
    }
}

pub(super) unsafe fn required<'a>(argument: &str, gaussians: *const vg_gaussians) -> Result<&'a Gaussians> {
    unsafe { read::handle(argument, gaussians.cast::<Gaussians>(), "Gaussians") }
}

unsafe fn get<'a>(gaussians: *const vg_gaussians) -> Option<&'a Gaussians> {
    unsafe { gaussians.cast::<Gaussians>().as_ref() }
}

/// Arrays to make Gaussians from; read during the call and not kept.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_gaussian_arrays {
    /// `sizeof(vg_gaussian_arrays)`.
    pub struct_size: usize,
    /// How many Gaussians, at most 2147483647. The pointers may be NULL where it is 0.
    pub count: usize,
    /// Centres, metres. `[count][3]`
    pub positions: *const f32,
    /// Standard deviations along the Gaussian's own axes, metres, above 0. `[count][3]`
    pub scales: *const f32,
    /// Quaternions w, x, y, z of any norm but zero; stored normalised. `[count][4]`
    pub rotations: *const f32,
    /// Peak opacities, 0 to 1. `[count]`
    pub opacities: *const f32,
    /// Coefficients of spherical harmonics. `[count][(sh_degree + 1)^2][3]`
    pub sh: *const f32,
    /// 0 to 3.
    pub sh_degree: i32,
    /// Reserved: 0.
    pub flags: u32,
}

unsafe impl Versioned for vg_gaussian_arrays {
    const NAME: &'static str = "vg_gaussian_arrays";
    const FIRST_SIZE: usize = 64;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            count: 0,
            positions: std::ptr::null(),
            scales: std::ptr::null(),
            rotations: std::ptr::null(),
            opacities: std::ptr::null(),
            sh: std::ptr::null(),
            sh_degree: 0,
            flags: 0,
        }
    }
}

/// Sets `*arrays` to no Gaussians of degree 0. `size`: `sizeof *arrays`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussian_arrays_init(arrays: *mut vg_gaussian_arrays, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("arrays", arrays, size)) }
}

/// How many Gaussians. NULL: 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_count(gaussians: *const vg_gaussians) -> usize {
    guarded_value(0, || unsafe { get(gaussians) }.map_or(0, Gaussians::len))
}

/// Degree of the spherical harmonics, 0 to 3. NULL: 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_sh_degree(gaussians: *const vg_gaussians) -> i32 {
    guarded_value(0, || unsafe { get(gaussians) }.map_or(0, |g| i32::from(g.sh_degree())))
}

/// A borrowed array; NULL where there is nothing in it.
unsafe fn borrowed<T>(gaussians: *const vg_gaussians, array: impl FnOnce(&Gaussians) -> &[T]) -> *const f32 {
    guarded_value(std::ptr::null(), || {
        unsafe { get(gaussians) }.map_or(std::ptr::null(), |g| read::address(array(g)))
    })
}

/// Centres, float32 `[count][3]`, metres. Lives as long as the Gaussians. NULL where there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_positions(gaussians: *const vg_gaussians) -> *const f32 {
    unsafe { borrowed(gaussians, Gaussians::means) }
}

/// Standard deviations along the Gaussian's own axes, float32 `[count][3]`, metres. Lives as long as the Gaussians.
/// NULL where there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_scales(gaussians: *const vg_gaussians) -> *const f32 {
    unsafe { borrowed(gaussians, Gaussians::scales) }
}

/// Unit quaternions w, x, y, z that turn the Gaussian's axes to the vehicle's, float32 `[count][4]`. Lives as long
/// as the Gaussians. NULL where there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_rotations(gaussians: *const vg_gaussians) -> *const f32 {
    unsafe { borrowed(gaussians, Gaussians::rotations) }
}

/// Peak opacities, float32 `[count]`, 0 to 1. Lives as long as the Gaussians. NULL where there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_opacities(gaussians: *const vg_gaussians) -> *const f32 {
    unsafe { borrowed(gaussians, Gaussians::opacities) }
}

/// Coefficients of spherical harmonics, float32 `[count][(sh_degree + 1)^2][3]`, R G B innermost. Lives as long as
/// the Gaussians. NULL where there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_sh(gaussians: *const vg_gaussians) -> *const f32 {
    unsafe { borrowed(gaussians, Gaussians::sh) }
}

/// Reads Gaussians from a PLY file in the layout of 3D Gaussian Splatting. Other formats (SPZ, SOG, .splat, packed PLY,
/// glTF) and other kinds of Gaussians are errors that name them and the way out.
///
/// - path: not NULL. A file or a pipe; a pipe that nothing writes to is an error after ten seconds.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_load_ply(
    path: *const c_char,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let (gaussians, _notes) = splats::read(read::path("path", path)?)?;
            Ok(gaussians)
        })
    }
}

/// Writes Gaussians as a PLY file in the layout of 3D Gaussian Splatting. A file that is there is replaced once the
/// new one is complete and on the disk, and keeps its permissions; on failure it is as it was.
///
/// - gaussians, path: not NULL. A name that ends like that of another format, car.spz, is refused.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_save_ply(
    gaussians: *const vg_gaussians,
    path: *const c_char,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            splats::write(read::path("path", path)?, gaussians)
        })
    }
}

/// Gaussians from the caller's arrays, which are copied and checked.
///
/// - arrays: not NULL.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error, which names array and index.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_from_arrays(
    arrays: *const vg_gaussian_arrays,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let a = read::required("arrays", arrays)?;
            read::zero("arrays.flags", a.flags == 0)?;
            let degree = sh_degree("arrays.sh_degree", a.sh_degree)?;
            if a.count > MAX_COUNT {
                return Err(Error::argument(
                    "arrays.count",
                    a.count.to_string(),
                    format!("0 to {MAX_COUNT}"),
                ));
            }
            let sh = a.count * sh::coefficients(degree) * 3;
            let means = read::numbers::<[f32; 3]>("arrays.positions", a.positions.cast(), a.count)?;
            let scales = read::numbers::<[f32; 3]>("arrays.scales", a.scales.cast(), a.count)?;
            let rotations = read::numbers::<[f32; 4]>("arrays.rotations", a.rotations.cast(), a.count)?;
            let opacities = read::numbers("arrays.opacities", a.opacities, a.count)?;
            let sh = read::numbers("arrays.sh", a.sh, sh)?;
            Gaussians::from_arrays(
                degree,
                means.to_vec(),
                rotations.to_vec(),
                scales.to_vec(),
                opacities.to_vec(),
                sh.to_vec(),
            )
            .map_err(|e| read::renamed(e, &ARRAYS))
        })
    }
}

/// Gaussians moved to another frame: p becomes S p, rotations, scales and colours follow. Keep world placements of
/// UTM size in a pose of your own: a float32 resolves a millimetre up to 16 km from the origin, and what lies beyond
/// is refused.
///
/// - gaussians: not NULL; they stay as they are.
/// - to_from_vehicle: 16 numbers, a row-major 4x4 similarity: rotation, positive scale, translation in metres.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_transform(
    gaussians: *const vg_gaussians,
    to_from_vehicle: *const f64,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            let matrix = read::fixed("to_from_vehicle", to_from_vehicle)?;
            let similarity = Similarity::from_row_major("to_from_vehicle", &matrix)?;
            Threads::new(1)?.run(|| gaussians.transformed(&similarity))
        })
    }
}

/// The mirror image across the vehicle's plane of symmetry, y = 0. Mirrored twice, the bytes are the same.
///
/// - gaussians: not NULL; they stay as they are.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_mirror(
    gaussians: *const vg_gaussians,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let gaussians = required("gaussians", gaussians)?;
            Ok(Threads::new(1)?.run(|| gaussians.mirrored()))
        })
    }
}

/// All of `first`, then all of `second`, in one. The degree is the higher of the two; missing bands are zero.
///
/// - first, second: not NULL; may be the same; they stay as they are.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_merge(
    first: *const vg_gaussians,
    second: *const vg_gaussians,
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        make(out, out_error, || {
            let (first, second) = (required("first", first)?, required("second", second)?);
            let count = first.len() + second.len();
            if count > MAX_COUNT {
                let allowed = format!("{MAX_COUNT} in all");
                return Err(Error::argument("first, second", format!("{count} Gaussians"), allowed));
            }
            Ok(first.merged(second))
        })
    }
}

/// Frees Gaussians. Pointers into them end. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gaussians_free(gaussians: *mut vg_gaussians) {
    guarded_value((), || {
        if !gaussians.is_null() {
            drop(unsafe { Arc::from_raw(gaussians.cast::<Gaussians>()) });
        }
    });
}

pub(super) unsafe fn make(
    out: *mut *mut vg_gaussians,
    out_error: *mut *mut vg_error,
    body: impl FnOnce() -> Result<Gaussians>,
) -> vg_status {
    unsafe {
        clear(out);
        guarded(out_error, || {
            read::not_null("out", out, "where to put the Gaussians")?;
            out.write(into_raw(body()?));
            Ok(())
        })
    }
}
