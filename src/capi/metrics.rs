//! How far a model is from photographs and from a scan.

use super::context::{CallContext, in_context, vg_context};
use super::gaussians::{self, vg_gaussians};
use super::guard::guarded;
use super::image::{self, vg_image};
use super::model::{self, vg_model};
use super::options::vg_progress_fn;
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use super::view::{self, vg_view};
use super::watched::{ProgressCallback, watched};
use std::ffi::c_void;
use vg::metrics::{self, F_SCORE_M, Lpips, SurfaceErrors, SurfaceOptions, ViewErrors};
use vg::render::{RenderOptions, Renderer};
use vg::scene::cloud::MAX_CLOUD_POINTS;
use vg::{Error, Result};

/// Settings of `vg_metrics_pictures`, `vg_metrics_view` and `vg_metrics_surface`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_metrics_options {
    /// `sizeof(vg_metrics_options)`.
    pub struct_size: usize,
    /// Threads and memory to use. NULL: the process's own, one thread per core, see `vg_default_context_free`.
    pub context: *mut vg_context,
    /// A network that measures LPIPS, needed until the call returns. NULL: LPIPS is not measured.
    pub lpips: *const vg_model,
    /// The distance below which a point of a surface counts as met, metres, 0.001 to 1000. Default 0.05.
    pub f_score_m: f64,
    /// Reserved: 0.
    pub flags: u64,
    /// Called in the course of `vg_metrics_view` and `vg_metrics_surface`, see `vg_progress_fn`. NULL: none.
    pub progress: vg_progress_fn,
    /// Handed to `progress`.
    pub progress_user: *mut c_void,
}

unsafe impl Versioned for vg_metrics_options {
    const NAME: &'static str = "vg_metrics_options";
    const FIRST_SIZE: usize = 40;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            context: std::ptr::null_mut(),
            lpips: std::ptr::null(),
            f_score_m: F_SCORE_M,
            flags: 0,
            progress: None,
            progress_user: std::ptr::null_mut(),
        }
    }
}

/// The difference of two pictures; NAN where a measure does not exist.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_picture_errors {
    /// `sizeof(vg_picture_errors)`.
    pub struct_size: usize,
    /// Peak signal-to-noise ratio, dB; infinite for equal pictures.
    pub psnr_db: f64,
    /// Structural similarity, at most 1; NAN for a picture smaller than 11x11.
    pub ssim: f64,
    /// LPIPS; NAN without `options.lpips`, and for a picture smaller than 64x64.
    pub lpips: f64,
}

unsafe impl Versioned for vg_picture_errors {
    const NAME: &'static str = "vg_picture_errors";
    const FIRST_SIZE: usize = 32;

    fn initial() -> Self {
        Self { struct_size: size_of::<Self>(), psnr_db: f64::NAN, ssim: f64::NAN, lpips: f64::NAN }
    }
}

/// The error of a model in one photograph; NAN where a measure does not exist.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_view_errors {
    /// `sizeof(vg_view_errors)`.
    pub struct_size: usize,
    /// Peak signal-to-noise ratio over the full frame, dB; infinite for equal pictures.
    pub psnr_db: f64,
    /// The same inside the bounding box of the mask; NAN where the mask is empty.
    pub psnr_box_db: f64,
    /// Structural similarity over the full frame, at most 1; NAN for a picture smaller than 11x11.
    pub ssim: f64,
    /// LPIPS over the full frame; NAN without `options.lpips`, and for a picture smaller than 64x64.
    pub lpips: f64,
    /// Intersection over union of the mask and the pixels that the model covers by half or more, 0 to 1.
    pub silhouette_iou: f64,
    /// Mean absolute difference of depth where the view has depth and the model covers the pixel by half or more,
    /// metres; NAN where that is nowhere.
    pub depth_mae_m: f64,
    /// 90th percentile of that difference, metres.
    pub depth_p90_m: f64,
}

unsafe impl Versioned for vg_view_errors {
    const NAME: &'static str = "vg_view_errors";
    const FIRST_SIZE: usize = 64;

    fn initial() -> Self {
        const NONE: f64 = f64::NAN;
        Self {
            struct_size: size_of::<Self>(),
            psnr_db: NONE,
            psnr_box_db: NONE,
            ssim: NONE,
            lpips: NONE,
            silhouette_iou: NONE,
            depth_mae_m: NONE,
            depth_p90_m: NONE,
        }
    }
}

/// The error of a model's surface against a scan.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_surface_errors {
    /// `sizeof(vg_surface_errors)`.
    pub struct_size: usize,
    /// Mean distance from the model's surface to the scan, metres; distances above 0.5 m count as 0.5 m.
    pub accuracy_m: f64,
    /// Mean distance from the scan to the model's surface, metres, likewise.
    pub completeness_m: f64,
    /// Mean of the two.
    pub chamfer_m: f64,
    /// Share of the model's surface that is nearer to the scan than `options.f_score_m`.
    pub precision: f64,
    /// Share of the scan that is nearer to the model's surface than `options.f_score_m`.
    pub recall: f64,
    /// Harmonic mean of the two.
    pub f_score: f64,
    /// How much longer (x) the model is than the scan, percent; negative: shorter.
    pub length_error_percent: f64,
    /// The same of the width (y).
    pub width_error_percent: f64,
    /// The same of the height (z).
    pub height_error_percent: f64,
}

unsafe impl Versioned for vg_surface_errors {
    const NAME: &'static str = "vg_surface_errors";
    const FIRST_SIZE: usize = 80;

    fn initial() -> Self {
        const NONE: f64 = f64::NAN;
        Self {
            struct_size: size_of::<Self>(),
            accuracy_m: NONE,
            completeness_m: NONE,
            chamfer_m: NONE,
            precision: NONE,
            recall: NONE,
            f_score: NONE,
            length_error_percent: NONE,
            width_error_percent: NONE,
            height_error_percent: NONE,
        }
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_metrics_options_init(options: *mut vg_metrics_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Sets `*errors` to NAN throughout. `size`: `sizeof *errors`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_picture_errors_init(errors: *mut vg_picture_errors, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("errors", errors, size)) }
}

/// Sets `*errors` to NAN throughout. `size`: `sizeof *errors`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_view_errors_init(errors: *mut vg_view_errors, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("errors", errors, size)) }
}

/// Sets `*errors` to NAN throughout. `size`: `sizeof *errors`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_surface_errors_init(errors: *mut vg_surface_errors, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("errors", errors, size)) }
}

/// Compares two pictures.
///
/// - a, b: RGB8, BGR8, RGBA8, BGRA8, GRAY8 or RGBA32F, of one size; what their alpha leaves open is white. Floats are
///   0 to 1, and what is more than 1 beyond is an error. Not NULL.
/// - options: NULL for the default values.
/// - out: a struct that `vg_picture_errors_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_metrics_pictures(
    a: *const vg_image,
    b: *const vg_image,
    options: *const vg_metrics_options,
    out: *mut vg_picture_errors,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("a", a, "a picture")?;
            read::not_null("b", b, "a picture")?;
            read::not_null("out", out, "where to put the errors")?;
            // Structs may be at any address, as in all functions.
            let (lent, other) = (a.read_unaligned(), b.read_unaligned());
            let options = read::optional("options", options)?;
            let (lpips, _) = options.read()?;
            let (a, b) = (image::on_white("a", &lent)?, image::on_white("b", &other)?);
            let (width, height) = (lent.width, lent.height);
            if (other.width, other.height) != (width, height) {
                let found = format!("{}x{}", other.width, other.height);
                return Err(Error::argument("b", found, format!("the size of a, {width}x{height}")));
            }
            let errors = in_context(options.context, |context| {
                context.threads.run(|| {
                    Ok(vg_picture_errors {
                        struct_size: size_of::<vg_picture_errors>(),
                        psnr_db: metrics::psnr(&a, &b),
                        ssim: or_nan(metrics::ssim(&a, &b, width, height)),
                        lpips: or_nan(match &lpips {
                            Some(lpips) => lpips.distance_of(&a, &b, width, height)?,
                            None => None,
                        }),
                    })
                })
            })?;
            read::fill("out", out, &errors)
        })
    }
}

/// Draws a model on white as a view's camera sees it, and compares the picture with the view's photograph, which its
/// mask puts on white: the full frame, so that what spills over the silhouette costs.
///
/// - gaussians: not NULL.
/// - view: of depth and mask what it has; not NULL.
/// - options: NULL for the default values.
/// - out: a struct that `vg_view_errors_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_metrics_view(
    gaussians: *const vg_gaussians,
    view: *const vg_view,
    options: *const vg_metrics_options,
    out: *mut vg_view_errors,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let gaussians = gaussians::required("gaussians", gaussians)?;
            let view = view::read_view("view", &read::required("view", view)?)?;
            view.validate("view")?;
            read::not_null("out", out, "where to put the errors")?;
            let options = read::optional("options", options)?;
            let (lpips, _) = options.read()?;
            let errors = in_context(options.context, |context: &CallContext| {
                watched(context, "measure", options.progress(), |watch| {
                    let renderer = context.renderer.watched(watch);
                    let drawn = renderer.render(gaussians, &view.camera, &RenderOptions::default())?;
                    let errors = ViewErrors::of(&drawn, &view);
                    let lpips = lpips.map_or(Ok(None), |lpips| lpips.of(&drawn, &view))?;
                    Ok(vg_view_errors { lpips: or_nan(lpips), ..vg_view_errors::from(&errors) })
                })
            })?;
            read::fill("out", out, &errors)
        })
    }
}

/// Compares a model's surface, which is what is seen of it from outside and above, with points measured on the
/// vehicle. Points that stand alone are left out; how densely either side is sampled counts nothing.
///
/// - gaussians: not NULL.
/// - points: float32 `[point_count][3]` without gaps, metres, vehicle frame; not NULL.
/// - point_count: 1 to 10 million.
/// - options: NULL for the default values.
/// - out: a struct that `vg_surface_errors_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_metrics_surface(
    gaussians: *const vg_gaussians,
    points: *const f32,
    point_count: usize,
    options: *const vg_metrics_options,
    out: *mut vg_surface_errors,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let gaussians = gaussians::required("gaussians", gaussians)?;
            if !(1..=MAX_CLOUD_POINTS).contains(&point_count) {
                let allowed = format!("1 to {MAX_CLOUD_POINTS}");
                return Err(Error::argument("point_count", point_count.to_string(), allowed));
            }
            let numbers: &[f32] = read::numbers("points", points, 3 * point_count)?;
            read::not_null("out", out, "where to put the errors")?;
            let options = read::optional("options", options)?;
            let (_, how) = options.read()?;
            let (points, _) = numbers.as_chunks::<3>();
            let errors = in_context(options.context, |context| {
                watched(context, "measure", options.progress(), |watch| {
                    SurfaceErrors::watched(gaussians, points, &how, watch)
                })
            })
            .map_err(|e| read::renamed(e, &[("scan", "points")]))?;
            read::fill("out", out, &vg_surface_errors::from(&errors))
        })
    }
}

impl From<&ViewErrors> for vg_view_errors {
    fn from(errors: &ViewErrors) -> Self {
        Self {
            psnr_db: errors.psnr_db,
            psnr_box_db: or_nan(errors.psnr_box_db),
            ssim: or_nan(errors.ssim),
            silhouette_iou: errors.silhouette_iou,
            depth_mae_m: or_nan(errors.depth_mae_m),
            depth_p90_m: or_nan(errors.depth_p90_m),
            ..Self::initial()
        }
    }
}

impl From<&SurfaceErrors> for vg_surface_errors {
    fn from(errors: &SurfaceErrors) -> Self {
        Self {
            accuracy_m: errors.accuracy_m,
            completeness_m: errors.completeness_m,
            chamfer_m: errors.chamfer_m,
            precision: errors.precision,
            recall: errors.recall,
            f_score: errors.f_score,
            length_error_percent: errors.length_error_percent,
            width_error_percent: errors.width_error_percent,
            height_error_percent: errors.height_error_percent,
            ..Self::initial()
        }
    }
}

impl vg_metrics_options {
    /// The callback for progress.
    fn progress(&self) -> ProgressCallback {
        ProgressCallback { function: self.progress, user: self.progress_user }
    }

    /// Reads the network and the options for comparing surfaces.
    unsafe fn read(&self) -> Result<(Option<Lpips>, SurfaceOptions)> {
        read::zero("options.flags", self.flags == 0)?;
        let how = SurfaceOptions { f_score_m: self.f_score_m, ..SurfaceOptions::default() };
        how.validate()?;
        let lpips = unsafe { model::lent(self.lpips) };
        Ok((lpips.map(Lpips::new).transpose()?, how))
    }
}

fn or_nan(measure: Option<f64>) -> f64 {
    measure.unwrap_or(f64::NAN)
}
