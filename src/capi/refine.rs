//! Refinement of existing Gaussians.

use super::context::{in_context, vg_context};
use super::gaussians::{self, vg_gaussians};
use super::guard::{clear, guarded};
use super::options::vg_progress_fn;
use super::read::{self, Versioned};
use super::render::backend;
use super::status::{vg_error, vg_status};
use super::view::{self, vg_view};
use super::watched::ProgressCallback;
use std::ffi::c_void;
use vg::Result;
use vg::refine::{self, Amount, Densify, RefineOptions, Refinement, Stop};
use vg::render::Backend;

/// Settings of `vg_refine`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_refine_options {
    /// `sizeof(vg_refine_options)`.
    pub struct_size: usize,
    /// Threads and memory to use. NULL: made for this call, one thread per core.
    pub context: *mut vg_context,
    /// Seconds the call may take, about, up to 86400: a number of steps is found that fits. 0: as many steps as
    /// `iterations` says. Default 0.
    pub seconds: f64,
    /// Steps, at most 1000000, which the same input answers with the same bytes; not looked at where `seconds` is
    /// above 0. Default 300.
    pub iterations: u32,
    /// 1: one of three or more views takes no part and tells when to stop; 0: all do. Default 0.
    pub hold_out: i32,
    /// 1: Gaussians divide and go on the way, so that the result has another number of them; 0: they keep their number
    /// and order. Default 0.
    pub densify: i32,
    /// A `vg_backend`: who draws and goes back. Default `VG_BACKEND_AUTO`: what is known to pay, at present the CPU.
    pub backend: i32,
    /// NULL: none.
    pub progress: vg_progress_fn,
    /// Handed to `progress`.
    pub progress_user: *mut c_void,
    /// Reserved: 0.
    pub flags: u64,
}

unsafe impl Versioned for vg_refine_options {
    const NAME: &'static str = "vg_refine_options";
    const FIRST_SIZE: usize = 64;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            context: std::ptr::null_mut(),
            seconds: 0.0,
            iterations: 300,
            hold_out: 0,
            densify: 0,
            backend: Backend::default().number(),
            progress: None,
            progress_user: std::ptr::null_mut(),
            flags: 0,
        }
    }
}

impl vg_refine_options {
    fn to_options(self) -> Result<RefineOptions> {
        read::zero("options.flags", self.flags == 0)?;
        let options = RefineOptions {
            amount: match self.seconds {
                0.0 => Amount::Iterations(self.iterations),
                seconds => Amount::Seconds(seconds),
            },
            hold_out: read::flag("options.hold_out", self.hold_out)?,
            densify: read::flag("options.densify", self.densify)?.then(Densify::for_refinement),
            backend: backend("options.backend", self.backend)?,
            ..RefineOptions::default()
        };
        let names = ["iterations", "seconds", "backend"]
            .map(|n| (format!("options.refine.{n}"), format!("options.{n}")));
        let names: Vec<(&str, &str)> = names.iter().map(|(from, to)| (from.as_str(), to.as_str())).collect();
        options.validate().map_err(|e| read::renamed(e, &names))?;
        Ok(options)
    }
}

/// Why a refinement ended.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_refine_stop {
    /// All steps are done.
    Done = 0,
    /// The view that took no part got no better any more.
    HeldOut = 1,
    /// The error grew far beyond where it began; the best of the states before is returned.
    Diverged = 2,
    /// No view sees anything of the model: it is as it was.
    Unseen = 3,
}

/// What a refinement did; NAN where a measure does not exist.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_refinement {
    /// `sizeof(vg_refinement)`.
    pub struct_size: usize,
    /// Steps that were planned: `vg_refine_options.iterations` of this number does the same again.
    pub iterations: u32,
    /// Steps that were made.
    pub made: u32,
    /// Steps that the result has seen; 0 if nothing was better than the beginning.
    pub kept: u32,
    /// A `vg_refine_stop`.
    pub stop: i32,
    /// Mean PSNR of the views that took part, each in its exposure, before, dB.
    pub psnr_before_db: f64,
    /// The same after.
    pub psnr_after_db: f64,
    /// PSNR of the view that was held out before, dB; NAN without one.
    pub held_out_before_db: f64,
    /// The same after.
    pub held_out_after_db: f64,
}

unsafe impl Versioned for vg_refinement {
    const NAME: &'static str = "vg_refinement";
    const FIRST_SIZE: usize = 56;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            iterations: 0,
            made: 0,
            kept: 0,
            stop: Stop::Done.number(),
            psnr_before_db: f64::NAN,
            psnr_after_db: f64::NAN,
            held_out_before_db: f64::NAN,
            held_out_after_db: f64::NAN,
        }
    }
}

impl From<&Refinement> for vg_refinement {
    fn from(done: &Refinement) -> Self {
        let held_out = done.held_out.as_ref().map_or([f64::NAN; 2], |view| view.psnr_db);
        Self {
            iterations: done.iterations,
            made: done.made,
            kept: done.kept,
            stop: done.stop.number(),
            psnr_before_db: done.psnr_db[0],
            psnr_after_db: done.psnr_db[1],
            held_out_before_db: held_out[0],
            held_out_after_db: held_out[1],
            ..Self::initial()
        }
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_refine_options_init(options: *mut vg_refine_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Sets `*refinement` to no steps and NAN. `size`: `sizeof *refinement`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_refinement_init(refinement: *mut vg_refinement, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("refinement", refinement, size)) }
}

/// Moves the Gaussians of any model until their pictures are the photographs. Nothing is known of which mirrors which:
/// each goes its own way. `vg_reconstruct` with `refine_iterations` keeps both sides mirror images.
///
/// - gaussians: at least one, in the views' vehicle frame; they stay as they are.
/// - views, view_count: 1 to 4096 views, as for `vg_reconstruct`.
/// - options: NULL for the default values.
/// - out: receives the Gaussians; the caller frees them. NULL on failure.
/// - out_refinement: NULL, or a struct that `vg_refinement_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_refine(
    gaussians: *const vg_gaussians,
    views: *const vg_view,
    view_count: usize,
    options: *const vg_refine_options,
    out: *mut *mut vg_gaussians,
    out_refinement: *mut vg_refinement,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        clear(out);
        guarded(out_error, || {
            read::not_null("out", out, "where to put the Gaussians")?;
            let gaussians = gaussians::required("gaussians", gaussians)?;
            let options = read::optional("options", options)?;
            let settings = options.to_options()?;
            let scene = view::scene(views, view_count)?;
            if !out_refinement.is_null() {
                read::fillable("out_refinement", out_refinement)?;
            }
            let callback = ProgressCallback { function: options.progress, user: options.progress_user };
            let mut progress = |at| callback.report(at);
            let (refined, done) = in_context(options.context, |context| {
                refine::model_on(&context.threads, gaussians, &scene, &settings, &mut progress)
            })?;
            if !out_refinement.is_null() {
                read::fill("out_refinement", out_refinement, &(&done).into())?;
            }
            out.write(gaussians::into_raw(refined));
            Ok(())
        })
    }
}
