//! From the arbitrary world of a structure-from-motion model to the vehicle's frame.

use super::camera;
use super::context::{in_context, vg_context};
use super::guard::guarded;
use super::image;
use super::options::vg_progress_fn;
use super::overlap::{self, Written};
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use super::view::vg_view;
use super::watched::{ProgressCallback, watched};
use glam::DVec3;
use std::ffi::{c_char, c_void};
use vg::align::{self, Heading};
use vg::geometry::Similarity;
use vg::scene::View;
use vg::scene::cloud::{Cloud, MAX_CLOUD_POINTS};
use vg::scene::view::MAX_VIEWS;
use vg::{Error, Result};

/// How front and back are told apart.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_heading {
    /// By shape; where the other way round fits as well, it is an error that names the view to look at.
    Auto = 0,
    /// The first view by name, of those not taken from abeam, was taken from ahead of the vehicle's middle.
    Forward = 1,
    /// It was taken from behind the middle.
    Backward = 2,
}

/// Settings of `vg_align_scan`, `vg_align_box` and `vg_align_folder`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_align_options {
    /// `sizeof(vg_align_options)`.
    pub struct_size: usize,
    /// Threads to use. NULL: the process's own, one per core, see `vg_default_context_free`.
    pub context: *mut vg_context,
    /// A `vg_heading`. Default `VG_HEADING_AUTO`.
    pub heading: i32,
    /// Reserved: 0.
    pub flags: u32,
    /// Called in the course of the call, see `vg_progress_fn`. NULL: none.
    pub progress: vg_progress_fn,
    /// Handed to `progress`.
    pub progress_user: *mut c_void,
}

unsafe impl Versioned for vg_align_options {
    const NAME: &'static str = "vg_align_options";
    const FIRST_SIZE: usize = 24;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            context: std::ptr::null_mut(),
            heading: Heading::default().number(),
            flags: 0,
            progress: None,
            progress_user: std::ptr::null_mut(),
        }
    }
}

/// A similarity that was found, and how well it fits; NAN where a measure does not exist.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_alignment {
    /// `sizeof(vg_alignment)`.
    pub struct_size: usize,
    /// From the world to the vehicle's frame, metres: row-major 4x4, as `vg_scene_options` and `vg_pose_from_colmap`
    /// take it.
    pub vehicle_from_world: [f64; 16],
    /// Metres per unit of the world.
    pub scale: f64,
    /// Typical distance of what should coincide, metres: of outlines from a scan's, of sides from a box's, of points
    /// from where they were measured.
    pub residual_m: f64,
    /// 0 to 1; at 0 another answer fits as well.
    pub confidence: f64,
    /// Mean distance between the outlines of scan and masks, pixels; NAN without a scan.
    pub residual_px: f64,
    /// The same with front and back exchanged.
    pub other_px: f64,
    /// Views, or points, that the similarity was found from.
    pub used_count: usize,
}

unsafe impl Versioned for vg_alignment {
    const NAME: &'static str = "vg_alignment";
    const FIRST_SIZE: usize = 184;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            vehicle_from_world: [f64::NAN; 16],
            scale: f64::NAN,
            residual_m: f64::NAN,
            confidence: f64::NAN,
            residual_px: f64::NAN,
            other_px: f64::NAN,
            used_count: 0,
        }
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_align_options_init(options: *mut vg_align_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Sets `*alignment` to NAN throughout, and its count to 0. `size`: `sizeof *alignment`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_alignment_init(alignment: *mut vg_alignment, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("alignment", alignment, size)) }
}

/// Finds the vehicle's frame with points scanned on the vehicle: their outline must run along the edges of all masks.
///
/// - views, view_count: an array, as for `vg_reconstruct`, whose cameras have poses in the world, whatever its units.
///   Masks are looked at, at least 3 of them; a photograph only where there is no mask, for its alpha: its `data` may
///   be NULL, and a view with neither is left out.
/// - sparse: double `[sparse_count][3]` without gaps, points of the world that may show anything; NULL with 0.
/// - scan: float32 `[scan_count][3]` without gaps, metres, vehicle frame; not NULL.
/// - scan_count: 1 to 10 million.
/// - options: NULL for the default values.
/// - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_align_scan(
    views: *const vg_view,
    view_count: usize,
    sparse: *const f64,
    sparse_count: usize,
    scan: *const f32,
    scan_count: usize,
    options: *const vg_align_options,
    out: *mut vg_alignment,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let views = masked(views, view_count)?;
            let sparse = points("sparse", sparse, "sparse_count", sparse_count, 0)?;
            if !(1..=MAX_CLOUD_POINTS).contains(&scan_count) {
                let allowed = format!("1 to {MAX_CLOUD_POINTS}");
                return Err(Error::argument("scan_count", scan_count.to_string(), allowed));
            }
            let (scan, _) = read::numbers::<f32>("scan", scan, 3 * scan_count)?.as_chunks::<3>();
            let scan = Cloud::new(scan.to_vec()).map_err(|e| read::renamed(e, &[("cloud", "scan")]))?;
            read::not_null("out", out, "where to put the alignment")?;
            let options = read::optional("options", options)?;
            let heading = options.heading()?;
            let found = in_context(options.context, |context| {
                watched(context, "align", options.progress(), |watch| {
                    align::to_scan_watched(&views, &sparse, &scan, heading, watch)
                })
            });
            read::fill("out", out, &found.map_err(as_in_c)?.into())
        })
    }
}

/// Finds the vehicle's frame by its size and the ground. Front and back are the same to a box: `options.heading` must
/// tell. The origin is the box's middle.
///
/// - views, view_count: as for `vg_align_scan`, from all around.
/// - sparse: double `[sparse_count][3]` without gaps, points of the world, of which some show level ground; not NULL.
/// - size: 3 numbers, length, width and height, metres.
/// - options: not NULL, for the heading.
/// - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_align_box(
    views: *const vg_view,
    view_count: usize,
    sparse: *const f64,
    sparse_count: usize,
    size: *const f64,
    options: *const vg_align_options,
    out: *mut vg_alignment,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let views = masked(views, view_count)?;
            let sparse = points("sparse", sparse, "sparse_count", sparse_count, 0)?;
            let size = read::fixed::<3>("size", size)?;
            read::not_null("out", out, "where to put the alignment")?;
            let options = read::required("options", options)?;
            let heading = options.heading()?;
            let found = in_context(options.context, |context| {
                watched(context, "align", options.progress(), |watch| {
                    align::to_box_watched(&views, &sparse, size, heading, watch)
                })
            });
            read::fill("out", out, &found.map_err(as_in_c)?.into())
        })
    }
}

/// Finds the similarity that takes points of the world, the cameras' centres for one, to where they were measured (GPS,
/// ego poses), for more than half of them; those that contradict the others are left out, if there are 6 and more.
///
/// - world, vehicle: double `[count][3]` without gaps, the same points in the world, and in the vehicle's frame in
///   metres; not on one line. Not NULL.
/// - count: at least 3.
/// - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
/// - out_kept: `count` bytes, 1 where a point was used, 0 where it was left out; NULL: not wanted.
/// - out_residuals: `count` numbers, how far each point ends from its place, metres; NULL: not wanted.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_align_points(
    world: *const f64,
    vehicle: *const f64,
    count: usize,
    out: *mut vg_alignment,
    out_kept: *mut u8,
    out_residuals: *mut f64,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let from = points("world", world, "count", count, 3)?;
            let to = points("vehicle", vehicle, "count", count, 3)?;
            read::not_null("out", out, "where to put the alignment")?;
            overlap::refuse(&[
                Written::array("out_kept", out_kept, count),
                Written::array("out_residuals", out_residuals, count),
            ])?;
            let fit = Similarity::umeyama_robust(&from, &to)
                .map_err(|e| read::renamed(e, &[("points", "world, vehicle")]))?;
            let found = vg_alignment {
                residual_m: fit.residual(),
                confidence: fit.confidence(),
                used_count: fit.kept.iter().filter(|kept| **kept).count(),
                ..vg_alignment::of(&fit.similarity)
            };
            read::fill("out", out, &found)?;
            for i in 0..count {
                if !out_kept.is_null() {
                    out_kept.add(i).write(u8::from(fit.kept[i]));
                }
                if !out_residuals.is_null() {
                    out_residuals.add(i).write_unaligned(fit.residuals[i]);
                }
            }
            Ok(())
        })
    }
}

/// `vg_align_scan` with the files of a scene, which need not be read first: the cameras, the masks (or the pictures'
/// alpha) and the sparse points of a COLMAP folder, of one of 3DRealCar, or of a `transforms.json`.
///
/// - path: the folder; not NULL.
/// - scan_path: a PLY file of points, metres, vehicle frame. NULL: the scan in a folder of 3DRealCar.
/// - options: NULL for the default values.
/// - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_align_folder(
    path: *const c_char,
    scan_path: *const c_char,
    options: *const vg_align_options,
    out: *mut vg_alignment,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let path = read::path("path", path)?;
            let scan = match scan_path.is_null() {
                true => None,
                false => Some(read::path("scan_path", scan_path)?),
            };
            read::not_null("out", out, "where to put the alignment")?;
            let options = read::optional("options", options)?;
            let heading = options.heading()?;
            let found = in_context(options.context, |context| {
                watched(context, "align", options.progress(), |watch| {
                    align::folder_to_scan_watched(path, scan, heading, watch)
                })
            });
            let (_, found) = found.map_err(|e| read::renamed(as_in_c(e), &[("scan", "scan_path")]))?;
            read::fill("out", out, &found.into())
        })
    }
}

impl vg_align_options {
    /// The callback for progress.
    fn progress(&self) -> ProgressCallback {
        ProgressCallback { function: self.progress, user: self.progress_user }
    }

    pub(super) fn heading(&self) -> Result<Heading> {
        read::zero("options.flags", self.flags == 0)?;
        read::choice("options.heading", self.heading)
    }
}

impl vg_alignment {
    fn of(vehicle_from_world: &Similarity) -> Self {
        Self {
            vehicle_from_world: vehicle_from_world.to_row_major(),
            scale: vehicle_from_world.scale,
            ..Self::initial()
        }
    }
}

impl From<align::ScanAlignment> for vg_alignment {
    fn from(found: align::ScanAlignment) -> Self {
        Self {
            residual_m: found.residual_m,
            confidence: found.confidence,
            residual_px: found.residual_px,
            other_px: found.other_px,
            used_count: found.views,
            ..Self::of(&found.vehicle_from_world)
        }
    }
}

impl From<align::BoxAlignment> for vg_alignment {
    fn from(found: align::BoxAlignment) -> Self {
        Self {
            residual_m: found.residual_m,
            confidence: found.confidence,
            used_count: found.views,
            ..Self::of(&found.vehicle_from_world)
        }
    }
}

fn as_in_c(error: Error) -> Error {
    read::renamed(error, &[("heading", "options.heading")])
}

/// Reads cameras and masks; pictures are black.
unsafe fn masked(views: *const vg_view, count: usize) -> Result<Vec<View>> {
    if !(1..=MAX_VIEWS).contains(&count) {
        return Err(Error::argument("view_count", count.to_string(), format!("1 to {MAX_VIEWS}")));
    }
    let views = unsafe { read::array("views", views, count)? };
    let view = |(i, view): (usize, &vg_view)| unsafe {
        let part = |name: &str| format!("views[{i}].{name}");
        let name = read::text(&part("name"), view.name)?.to_owned();
        let camera = camera::camera(&part("camera"), &view.camera)?;
        let mask = match image::mask(&part("mask"), &view.mask)? {
            None if !view.image.data.is_null() => image::photograph(&part("image"), &view.image)?.1,
            mask => mask,
        };
        let view = View::without_picture(name, camera, mask)?;
        view.validate(&format!("views[{i}]"))?;
        Ok(view)
    };
    views.iter().enumerate().map(view).collect()
}

/// Reads `count` points, `[count][3]`, at least `fewest`.
unsafe fn points(
    argument: &str,
    pointer: *const f64,
    count_argument: &str,
    count: usize,
    fewest: usize,
) -> Result<Vec<DVec3>> {
    if !(fewest..=MAX_CLOUD_POINTS).contains(&count) {
        let allowed = format!("{fewest} to {MAX_CLOUD_POINTS}");
        return Err(Error::argument(count_argument, count.to_string(), allowed));
    }
    let (points, _) = unsafe { read::numbers::<f64>(argument, pointer, 3 * count)? }.as_chunks::<3>();
    let points: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(*p)).collect();
    match points.iter().position(|p| !p.is_finite()) {
        Some(i) => Err(Error::argument(format!("{argument}[{i}]"), points[i].to_string(), "finite")),
        None => Ok(points),
    }
}
