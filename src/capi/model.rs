//! Networks in ONNX files, opened once and lent to calls.

use super::guard::{clear, free, guarded};
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use std::ffi::c_char;
use vg::Result;
use vg::onnx::{Model, ModelOptions};

/// An open ONNX model; `vg_options.prior_model` and `vg_options.head_model` lend it to calls. Any number of threads
/// may use one model at a time, each with a context of its own or all with one; runs of the same model take turns. It
/// holds its weights and the threads of its options until it is freed. Free it with `vg_model_free`, after the last
/// call that uses it has returned; Gaussians and reports do not need it any more.
#[cfg_attr(test, safer_ffi::derive_ReprC, repr(opaque))]
pub struct vg_model {
    _private: [u8; 0],
}

/// Where a model runs.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_provider {
    /// The processor.
    Cpu = 0,
    /// The first CUDA device, where ONNX Runtime was built for it.
    Cuda = 1,
}

/// Whether a model's weights are rearranged for speed when it is opened, which can take as much memory again.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_prepack {
    /// Where its files take less than 1 GiB.
    Auto = 0,
    /// Whatever their size.
    Always = 1,
    /// They stay as they are.
    Never = 2,
}

/// How a model is opened.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_model_options {
    /// `sizeof(vg_model_options)`.
    pub struct_size: usize,
    /// Path of ONNX Runtime, the library or its folder. NULL: what the environment variable `VG_ONNXRUNTIME` names,
    /// else the one inside an installed Python package `onnxruntime`. A process has one: the first that was loaded,
    /// which stays until the process ends. Default NULL.
    pub runtime: *const c_char,
    /// A `vg_provider`. Default `VG_PROVIDER_CPU`.
    pub provider: i32,
    /// 1: the processor steps in where the provider cannot be had; 0: that is `VG_STATUS_MISSING`. Default 0.
    pub fall_back: i32,
    /// Threads of the runtime's own, held as long as the model is open, 1 to 1024; 0: one per core. Default 0.
    pub threads: u32,
    /// A `vg_prepack`. Default `VG_PREPACK_AUTO`.
    pub prepack: i32,
    /// 1: the runtime keeps the memory of a run for the next one; 0: it gives it back. Default 0.
    pub arena: i32,
    /// Reserved: 0.
    pub flags: u32,
}

unsafe impl Versioned for vg_model_options {
    const NAME: &'static str = "vg_model_options";
    const FIRST_SIZE: usize = 40;

    fn initial() -> Self {
        let rust = ModelOptions::default();
        Self {
            struct_size: size_of::<Self>(),
            runtime: std::ptr::null(),
            provider: rust.provider.number(),
            fall_back: i32::from(rust.fall_back),
            threads: rust.threads as u32,
            prepack: vg_prepack::Auto as i32,
            arena: i32::from(rust.arena),
            flags: 0,
        }
    }
}

impl vg_model_options {
    pub(super) unsafe fn read(&self) -> Result<ModelOptions> {
        let prepacks = [
            (vg_prepack::Auto as i32, "auto", None),
            (vg_prepack::Always as i32, "always", Some(true)),
            (vg_prepack::Never as i32, "never", Some(false)),
        ];
        read::zero("options.flags", self.flags == 0)?;
        let runtime = match self.runtime.is_null() {
            true => None,
            false => Some(unsafe { read::path("options.runtime", self.runtime)? }.to_owned()),
        };
        Ok(ModelOptions {
            runtime,
            provider: read::choice("options.provider", self.provider)?,
            fall_back: read::flag("options.fall_back", self.fall_back)?,
            threads: self.threads as usize,
            prepack: read::one_of("options.prepack", self.prepack, &prepacks)?,
            arena: read::flag("options.arena", self.arena)?,
        })
    }
}

/// The model in a field of options; `None` for NULL. The clone shares the open model, which therefore outlives
/// everything that the call leaves behind on other threads.
pub(super) unsafe fn lent(model: *const vg_model) -> Option<Model> {
    unsafe { model.cast::<Model>().as_ref() }.cloned()
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_model_options_init(options: *mut vg_model_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Opens the model in an ONNX file; weights in files beside it are found by their names. What it takes and gives is
/// checked by the call that it is lent to.
///
/// - path: the file; not NULL.
/// - options: NULL for the default values.
/// - out: receives the model; the caller frees it. NULL on failure.
/// - out_error: NULL, or receives the error.
///
/// `VG_STATUS_NOT_BUILT` in a build without networks, `VG_STATUS_MISSING` without ONNX Runtime or the provider,
/// `VG_STATUS_FORMAT` where the runtime refuses the file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_model_open(
    path: *const c_char,
    options: *const vg_model_options,
    out: *mut *mut vg_model,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        clear(out);
        guarded(out_error, || {
            read::not_null("out", out, "where to put the model")?;
            let path = read::path("path", path)?;
            let options = read::optional("options", options)?.read()?;
            let names = [("model", "path"), ("runtime", "options.runtime"), ("threads", "options.threads")];
            let model = Model::open(path, &options).map_err(|e| read::renamed(e, &names))?;
            out.write(Box::into_raw(Box::new(model)).cast());
            Ok(())
        })
    }
}

/// Closes a model and frees its memory and threads. No call may be using it. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_model_free(model: *mut vg_model) {
    unsafe { free(model.cast::<Model>()) }
}
