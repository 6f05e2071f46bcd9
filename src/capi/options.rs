//! Settings of a reconstruction, and callbacks.

use super::context::vg_context;
use super::guard::guarded;
use super::model::{self, vg_model};
use super::read::{self, Versioned};
use super::render::backend;
use super::status::{c_string, one_line, vg_status};
use std::ffi::{CString, c_char, c_void};
use vg::geometry::Choice;
use vg::pipeline::{Keep, KeepItem, Options};
use vg::refine::{Amount, RefineOptions};
use vg::render::Backend;
use vg::scene::cloud::MAX_CLOUD_POINTS;
use vg::scene::{Cloud, Place, VehicleBox};
use vg::{Error, Result};

/// Where metric depth comes from.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_prior {
    /// `VG_PRIOR_GIVEN` if every used view has depth, else `VG_PRIOR_SHAPE`. Where some views have depth, it counts as
    /// measured points, to which the shape bends, and `log` is told.
    Auto = 0,
    /// The depth in the views.
    Given = 1,
    /// The hull of the silhouettes and their mirrored twins; needs masks and nothing else.
    Hull = 2,
    /// The network of `vg_options.prior_model`. `VG_STATUS_NOT_BUILT` in a build without networks.
    Onnx = 3,
    /// The hull, corrected by what vehicles look like; needs masks and nothing else.
    Shape = 4,
}

/// Whether cameras and the plane of symmetry are corrected before anything else.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_calibrate {
    /// Where the silhouettes do not agree, and agree better with the correction.
    Auto = 0,
    /// The cameras are taken as they are.
    Off = 1,
}

/// How the side that was not photographed is completed across the plane y = 0.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_symmetry {
    /// What no view observed is mirrored; what the other side shows at 1.03 times the resolution gives way.
    Auto = 0,
    /// The side with more Gaussians replaces the other, whatever was observed there.
    Always = 1,
    /// Nothing is mirrored.
    Never = 2,
    /// The photographs are mirrored instead of the model, and taken for further views: slower, and rarely better.
    Flip = 3,
}

/// Whether mirror images are shown in the light of their own side.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_relight {
    /// As far as the light can be told from what was seen.
    Auto = 0,
    /// They keep the light of the side that was seen.
    Never = 1,
}

/// What may not be left out although the scene does not need it; bits of `vg_options.keep`.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_keep {
    /// Views whose camera another view already has.
    DuplicateViews = 1,
    /// Pixels that another view shows at a higher resolution.
    Overlap = 2,
    /// Pixels on the silhouette's edge.
    SilhouetteEdge = 4,
    /// Floating pixels at depth edges.
    Floaters = 8,
    /// Bands of colour that the spread of viewing directions cannot support.
    ShBands = 16,
}

/// How important a log line is.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_log_level {
    /// Legal, but looks like a mistake.
    Warning = 1,
    /// What was done or left out.
    Info = 2,
    /// Times of stages.
    Debug = 3,
}

/// Called on the calling thread: the stage's name, how much of it is done, 0 to 1, and the caller's pointer. Returns 0
/// to go on; anything else ends the call with `VG_STATUS_CANCELLED`. May call the library; may not throw or jump out.
///
/// A reconstruction calls it at every stage boundary, inside long stages, and at the end. Calls of one stage call it at
/// the start, about every 50 ms, and with 1 at the end; they stop within some tenths of a second.
pub type vg_progress_fn =
    Option<unsafe extern "C" fn(stage: *const c_char, fraction: f64, user: *mut c_void) -> i32>;

/// Called on the calling thread with a `vg_log_level` and one line of UTF-8 that lives until it returns. May call
/// the library; may not throw or jump out.
pub type vg_log_fn = Option<unsafe extern "C" fn(level: i32, message: *const c_char, user: *mut c_void)>;

/// Settings of `vg_reconstruct`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_options {
    /// `sizeof(vg_options)`.
    pub struct_size: usize,
    /// Threads and memory to use. NULL: the process's own, one thread per core, see `vg_default_context_free`.
    pub context: *mut vg_context,
    /// A `vg_prior`. Default `VG_PRIOR_AUTO`.
    pub prior: i32,
    /// A `vg_symmetry`. Default `VG_SYMMETRY_AUTO`.
    pub symmetry: i32,
    /// Highest degree of the colour's spherical harmonics, 0 to 3. Default 2.
    pub sh_degree: i32,
    /// Bits of `vg_keep`. Default 0.
    pub keep: u32,
    /// 1: draw the model into its input views and report the error there; 0: do not. Default 1.
    pub check: i32,
    /// 1: the report also holds the metric coloured point cloud; 0: it does not. Default 0.
    pub points: i32,
    /// Length, width, height of the vehicle in metres, each 0.1 to 30, to a few centimetres; all 0: not known. The
    /// silhouettes tell where a box of this size stands, and no part of the vehicle is placed outside of it. Default 0, 0,
    /// 0.
    pub vehicle_size: [f64; 3],
    /// NULL: none.
    pub progress: vg_progress_fn,
    /// Handed to `progress`.
    pub progress_user: *mut c_void,
    /// NULL: none.
    pub log: vg_log_fn,
    /// Handed to `log`.
    pub log_user: *mut c_void,
    /// A `vg_calibrate`. Default `VG_CALIBRATE_AUTO`.
    pub calibrate: i32,
    /// A `vg_relight`. Default `VG_RELIGHT_AUTO`.
    pub relight: i32,
    /// 1: `VG_PRIOR_SHAPE` moves its surface to where the photographs agree; 0: it does not. Default 1.
    pub photo: i32,
    /// Reserved: 0.
    pub flags: u32,
    /// Seconds the call may take, above 0, where that matters: what is left out is then chosen to fit. 0: as long as
    /// it takes. Default 0.
    pub budget_s: f64,
    /// Points measured on the vehicle, by LiDAR for one: float32 `[cloud_count][3]` without gaps, metres, vehicle
    /// frame, in any order, all finite; some may be wrong or show something else. `VG_PRIOR_SHAPE` and
    /// `VG_PRIOR_HULL` bend their surface to them; `VG_PRIOR_GIVEN` leaves them out. Copied during the call. Default
    /// NULL: none.
    pub cloud: *const f32,
    /// How many points, at most 10000000; 0: none. Default 0.
    pub cloud_count: usize,
    /// Views are first resampled to this share of their width and height, above 0, at most 1. A `budget_s` may choose
    /// less. Default 1.
    pub resolution: f64,
    /// At most this many views are used, those that spread best around the vehicle; 0: all. A `budget_s` may choose
    /// fewer. Default 0.
    pub max_views: usize,
    /// The network that tells depth, for `VG_PRIOR_ONNX` and no other prior. Default NULL: none.
    pub prior_model: *const vg_model,
    /// The network that makes Gaussians of pixels. Default NULL: none; each pixel becomes a disc on the surface.
    pub head_model: *const vg_model,
    /// Seconds, about, for optimising the model against the photographs, above 0: a number of steps is found that fits,
    /// and `vg_report_figures.refine_iterations` tells it. In addition to `budget_s`. 0: none. Default 0.
    pub refine_seconds: f64,
    /// The same as a number of steps, at most 1000000, which the same input answers with the same bytes; not with
    /// `refine_seconds`. 0: none. Default 0.
    pub refine_iterations: u32,
    /// 1: one of three or more views takes no part in the optimisation and tells when to stop; 0: all do. Default 0.
    pub refine_hold_out: i32,
    /// A `vg_backend`: who draws and goes back in the optimisation. Default `VG_BACKEND_AUTO`: what is known to pay, at
    /// present the CPU. `VG_BACKEND_GPU` answers the same input on the same device with the same bytes.
    pub refine_backend: i32,
    /// Must be 0.
    pub refine_flags: u32,
    /// Centre of a box of `vehicle_size` in the frame of the cameras, metres, looked at where `has_vehicle_place` is 1. It
    /// is believed to a few decimetres, as a tracked box is. Default 0, 0, 0.
    pub vehicle_center: [f64; 3],
    /// Turn of that box about z, from the frame's x axis to the vehicle's, radians, at most 2 pi either way. The box's
    /// middle plane, not y = 0, is then the plane of symmetry; the result is in the frame of the cameras all the same.
    /// Default 0.
    pub vehicle_yaw: f64,
    /// 1: the box stands at `vehicle_center`, turned by `vehicle_yaw`; 0: its place is not known. 1 needs a
    /// `vehicle_size`. Default 0.
    pub has_vehicle_place: i32,
    /// Must be 0.
    pub vehicle_flags: u32,
    /// NULL, or where the part of the whole call that is done is written before each call of `progress`: 0 to 1, in
    /// expected time; it never falls, and is 1 in the last call.
    pub progress_overall: *mut f64,
    /// Most Gaussians that the model may have by what the masks of the used views say of its size: twice their vehicle
    /// pixels, or six times those of the largest mask, whichever is less. Where that is more, the views are resampled to
    /// fewer pixels before the work, and the log and the report say so. 0: any number. Default 12000000, whose PLY file
    /// would have 2 GB.
    pub max_gaussians: usize,
}

unsafe impl Versioned for vg_options {
    const NAME: &'static str = "vg_options";
    const FIRST_SIZE: usize = 96;

    fn initial() -> Self {
        let rust = Options::default();
        Self {
            struct_size: size_of::<Self>(),
            context: std::ptr::null_mut(),
            prior: rust.prior.number(),
            symmetry: rust.symmetry.number(),
            sh_degree: i32::from(rust.sh_degree),
            keep: keep_bits(rust.keep),
            check: i32::from(rust.check),
            points: i32::from(rust.points),
            vehicle_size: [0.0; 3],
            progress: None,
            progress_user: std::ptr::null_mut(),
            log: None,
            log_user: std::ptr::null_mut(),
            calibrate: rust.calibrate.number(),
            relight: rust.relight.number(),
            photo: i32::from(rust.photo),
            flags: 0,
            budget_s: rust.budget_s.unwrap_or(0.0),
            cloud: std::ptr::null(),
            cloud_count: 0,
            resolution: rust.resolution,
            max_views: rust.max_views.unwrap_or(0),
            prior_model: std::ptr::null(),
            head_model: std::ptr::null(),
            refine_seconds: 0.0,
            refine_iterations: 0,
            refine_hold_out: 0,
            refine_backend: Backend::default().number(),
            refine_flags: 0,
            vehicle_center: [0.0; 3],
            vehicle_yaw: 0.0,
            has_vehicle_place: 0,
            vehicle_flags: 0,
            progress_overall: std::ptr::null_mut(),
            max_gaussians: rust.max_gaussians.unwrap_or(0),
        }
    }
}

impl vg_options {
    pub(super) unsafe fn to_options(self) -> Result<Options> {
        read::zero("options.flags", self.flags == 0)?;
        read::zero("options.vehicle_flags", self.vehicle_flags == 0)?;
        let unknown_size = self.vehicle_size == [0.0; 3];
        let vehicle_place = self.vehicle_place()?;
        Ok(Options {
            prior: read::choice("options.prior", self.prior)?,
            prior_model: unsafe { model::lent(self.prior_model) },
            head_model: unsafe { model::lent(self.head_model) },
            symmetry: read::choice("options.symmetry", self.symmetry)?,
            vehicle_size: (!unknown_size).then_some(self.vehicle_size),
            vehicle_place,
            sh_degree: read::whole("options.sh_degree", self.sh_degree, "0 to 3")?,
            keep: keep(self.keep)?,
            calibrate: read::choice("options.calibrate", self.calibrate)?,
            relight: read::choice("options.relight", self.relight)?,
            check: read::flag("options.check", self.check)?,
            refine: self.refinement()?,
            photo: read::flag("options.photo", self.photo)?,
            budget_s: (self.budget_s != 0.0).then_some(self.budget_s),
            resolution: self.resolution,
            max_views: (self.max_views != 0).then_some(self.max_views),
            max_gaussians: (self.max_gaussians != 0).then_some(self.max_gaussians),
            points: read::flag("options.points", self.points)?,
            ..Options::default()
        })
    }

    /// Reads the pose of the vehicle's box; errors use the names of the fields in C.
    fn vehicle_place(&self) -> Result<Option<Place>> {
        let placed = read::flag("options.has_vehicle_place", self.has_vehicle_place)?;
        let place = placed.then_some(Place { center: self.vehicle_center, yaw: self.vehicle_yaw });
        if place.is_some() {
            let names = [
                ("options.vehicle_place.center", "options.vehicle_center"),
                ("options.vehicle_place.yaw", "options.vehicle_yaw"),
            ];
            let known = VehicleBox { size: self.vehicle_size, place };
            known.validate("options").map_err(|e| read::renamed(e, &names))?;
        }
        Ok(place)
    }

    fn refinement(&self) -> Result<Option<RefineOptions>> {
        let hold_out = read::flag("options.refine_hold_out", self.refine_hold_out)?;
        let backend = backend("options.refine_backend", self.refine_backend)?;
        read::zero("options.refine_flags", self.refine_flags == 0)?;
        let amount = match (self.refine_iterations, self.refine_seconds) {
            (0, 0.0) => return Ok(None),
            (steps, 0.0) => Amount::Iterations(steps),
            (0, seconds) => Amount::Seconds(seconds),
            (steps, seconds) => {
                let found = format!("{seconds}, with refine_iterations {steps}");
                return Err(Error::argument("options.refine_seconds", found, "only one of the two"));
            }
        };
        let options = RefineOptions { amount, hold_out, backend, ..RefineOptions::default() };
        let names = [
            ("options.refine.iterations", "options.refine_iterations"),
            ("options.refine.seconds", "options.refine_seconds"),
        ];
        options.validate().map_err(|e| read::renamed(e, &names))?;
        Ok(Some(options))
    }

    /// Copies the measured points.
    pub(super) unsafe fn to_cloud(self) -> Result<Option<Cloud>> {
        if self.cloud_count > MAX_CLOUD_POINTS {
            let allowed = format!("0 to {MAX_CLOUD_POINTS}");
            return Err(Error::argument("options.cloud_count", self.cloud_count.to_string(), allowed));
        }
        let numbers = unsafe { read::numbers("options.cloud", self.cloud, 3 * self.cloud_count)? };
        let (points, _) = numbers.as_chunks::<3>();
        if points.is_empty() {
            return Ok(None);
        }
        Cloud::new(points.to_vec()).map(Some).map_err(|e| read::renamed(e, &[("cloud", "options.cloud")]))
    }
}

pub(super) fn sh_degree(argument: &str, degree: i32) -> Result<u8> {
    match u8::try_from(degree) {
        Ok(degree @ 0..=3) => Ok(degree),
        _ => Err(Error::argument(argument, degree.to_string(), "0 to 3")),
    }
}

fn keep_bits(keep: Keep) -> u32 {
    keep.items().fold(0, |bits, item| bits | item.number() as u32)
}

fn keep(bits: u32) -> Result<Keep> {
    let every = KeepItem::ALL.iter().fold(0, |bits, item| bits | item.number() as u32);
    if bits & !every != 0 {
        let allowed = format!("bits of vg_keep, 0 to {every}");
        return Err(Error::argument("options.keep", format!("{bits:#x}"), allowed));
    }
    Ok(Keep::from_items(KeepItem::ALL.iter().copied().filter(|item| bits & item.number() as u32 != 0)))
}

/// The caller's log callback, if any.
#[derive(Clone, Copy)]
pub(super) struct Log {
    pub(super) callback: vg_log_fn,
    pub(super) user: *mut c_void,
}

impl Log {
    pub(super) unsafe fn line(self, level: vg_log_level, line: impl FnOnce() -> String) {
        if let Some(callback) = self.callback {
            let text: CString = c_string(one_line(&line()));
            unsafe { callback(level as i32, text.as_ptr(), self.user) };
        }
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_options_init(options: *mut vg_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}
