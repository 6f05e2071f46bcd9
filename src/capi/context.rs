//! What outlives a call: worker threads and the renderer's memory.

use super::guard::{clear, free, guarded, guarded_value};
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use crate::error::Result;
use crate::progress::Threads;
use crate::render::{CpuRenderer, Rendered, Rgba8};
use std::sync::{Mutex, PoisonError};

/// Worker threads and scratch memory, made once and named in the options of calls, so that a call neither starts
/// threads nor allocates what the last one had. Any number of threads may use one context at a time. Free it with
/// `vg_context_free`, after the last call that uses it has returned; results do not depend on it.
#[cfg_attr(test, safer_ffi::derive_ReprC, repr(opaque))]
pub struct vg_context {
    _private: [u8; 0],
}

/// Settings of a context.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_context_options {
    /// `sizeof(vg_context_options)`.
    pub struct_size: usize,
    /// Worker threads, 1 to 1024; 0: one per core. The calling thread waits while they work.
    pub threads: u32,
    /// Reserved: 0.
    pub flags: u32,
}

unsafe impl Versioned for vg_context_options {
    const NAME: &'static str = "vg_context_options";
    const FIRST_SIZE: usize = 16;

    fn initial() -> Self {
        Self { struct_size: size_of::<Self>(), threads: 0, flags: 0 }
    }
}

/// What a `vg_context` points to.
pub(super) struct Workshop {
    pub(super) threads: Threads,
    pub(super) renderer: CpuRenderer,
    pub(super) pictures: Spare<Rendered>,
    pub(super) bytes: Spare<Rgba8>,
}

/// Memory that is kept from call to call, as often as there were calls at a time.
#[derive(Default)]
pub(super) struct Spare<T>(Mutex<Vec<T>>);

impl Workshop {
    pub(super) fn new(threads: usize) -> Result<Self> {
        let threads = Threads::new(threads)?;
        Ok(Self {
            threads,
            renderer: CpuRenderer::new(),
            pictures: Spare::default(),
            bytes: Spare::default(),
        })
    }
}

impl<T: Default> Spare<T> {
    /// Runs `work` with memory that is kept for the next time.
    pub(super) fn lend<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        // A panic elsewhere cannot leave a list of spare memory in a state that matters.
        let mut memory = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        let result = work(&mut memory);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(memory);
        result
    }
}

/// Runs `work` in the caller's context, or in one made for this call where it is NULL.
pub(super) unsafe fn in_context<T>(
    context: *const vg_context,
    work: impl FnOnce(&Workshop) -> Result<T>,
) -> Result<T> {
    match unsafe { context.cast::<Workshop>().as_ref() } {
        Some(workshop) => work(workshop),
        None => work(&Workshop::new(0)?),
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_context_options_init(options: *mut vg_context_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Makes a context.
///
/// - options: NULL for the default values.
/// - out: receives the context; the caller frees it.
/// - out_error: NULL, or receives the error; NULL on success.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_context_new(
    options: *const vg_context_options,
    out: *mut *mut vg_context,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        clear(out);
        guarded(out_error, || {
            read::not_null("out", out, "where to put the context")?;
            let options = read::optional("options", options)?;
            read::zero("options.flags", options.flags == 0)?;
            let workshop = Workshop::new(options.threads as usize)
                .map_err(|e| read::renamed(e, &[("threads", "options.threads")]))?;
            out.write(Box::into_raw(Box::new(workshop)).cast());
            Ok(())
        })
    }
}

/// How many worker threads a context has. NULL: 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_context_threads(context: *const vg_context) -> u32 {
    guarded_value(0, || {
        unsafe { context.cast::<Workshop>().as_ref() }.map_or(0, |w| w.threads.count() as u32)
    })
}

/// Ends the context's threads and frees its memory. No call may be using it. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_context_free(context: *mut vg_context) {
    unsafe { free(context.cast::<Workshop>()) }
}
