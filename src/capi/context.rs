//! Resources that outlive a call: worker threads and the renderer's memory, in contexts of the caller or the process.

use super::guard::{clear, free, guarded, guarded_value};
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use std::process;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use vg::Result;
use vg::render::{CpuRenderer, Rendered, Rgba8};
use vg::threads::{OfProcess, Threads};

/// Worker threads and scratch memory, made once and named in the options of calls, so that a call neither starts
/// threads nor allocates what the last one had. Any number of threads may use one context at a time. Free it with
/// `vg_context_free`, after the last call that uses it has returned; results do not depend on it.
///
/// In a fork, a context of the parent is `VG_STATUS_ARGUMENT`, and freeing it does nothing.
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
    /// Threads that work, 1 to 1024; 0: one per core that the process may use, by its affinity and the quotas of its
    /// control groups. 1 is the calling thread, and none is started; of more, all are started, and the calling thread
    /// waits while they work. Default 0.
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

/// Type that a `vg_context` points to.
type ContextObject = OfProcess<CallContext>;

/// Resources of a call.
pub(super) struct CallContext {
    pub(super) threads: Threads,
    pub(super) renderer: CpuRenderer,
    pub(super) pictures: Spare<Rendered>,
    pub(super) bytes: Spare<Rgba8>,
}

/// Memory that is kept from call to call, one item for each call that ran at the same time.
#[derive(Default)]
pub(super) struct Spare<T>(Mutex<Vec<T>>);

impl CallContext {
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
    /// Runs `work` with memory that is kept for the next call.
    pub(super) fn lend<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        // A panic elsewhere cannot leave the list of spare memory in an invalid state.
        let mut memory = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        let result = work(&mut memory);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(memory);
        result
    }
}

/// The context of calls whose options name no context.
struct DefaultContext {
    /// Identifier of the process that made it.
    process: u32,
    /// `None` before the first call and after it was freed.
    context: Mutex<Option<Arc<CallContext>>>,
}

impl DefaultContext {
    /// The default context of this process. A fork makes a new one: the parent's lock may have been held at the fork,
    /// and its threads exist only in the parent.
    fn here() -> &'static Self {
        static HERE: AtomicPtr<DefaultContext> = AtomicPtr::new(null_mut());
        let process = process::id();
        loop {
            let found = HERE.load(Ordering::Acquire);
            // SAFETY: a stored context is never freed, and is only reached through shared references.
            match unsafe { found.as_ref() } {
                Some(context) if context.process == process => return context,
                _ => {}
            }
            let new = Box::into_raw(Box::new(Self { process, context: Mutex::default() }));
            if HERE.compare_exchange(found, new, Ordering::AcqRel, Ordering::Acquire).is_err() {
                // SAFETY: another thread stored its context first; this one was never shared.
                drop(unsafe { Box::from_raw(new) });
            }
        }
    }

    /// The resources of calls, which the first call makes.
    fn context(&self) -> Result<Arc<CallContext>> {
        // A panic elsewhere leaves either a complete context or `None`.
        let mut held = self.context.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(context) = &*held {
            return Ok(Arc::clone(context));
        }
        let made = Arc::new(CallContext::new(0)?);
        *held = Some(Arc::clone(&made));
        Ok(made)
    }

    fn free(&self) {
        let held = self.context.lock().unwrap_or_else(PoisonError::into_inner).take();
        // Dropped after the lock is released, because dropping joins the threads unless a call still uses them.
        drop(held);
    }
}

/// Runs `work` in the caller's context, or in the default context if it is NULL.
pub(super) unsafe fn in_context<T>(
    context: *const vg_context,
    work: impl FnOnce(&CallContext) -> Result<T>,
) -> Result<T> {
    match unsafe { context.cast::<ContextObject>().as_ref() } {
        Some(context) => work(context.get("options.context")?),
        None => work(&*DefaultContext::here().context()?),
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
            let context = CallContext::new(options.threads as usize)
                .map_err(|e| read::renamed(e, &[("threads", "options.threads")]))?;
            out.write(Box::into_raw(Box::new(OfProcess::new(context))).cast());
            Ok(())
        })
    }
}

/// How many threads work in a context. NULL, and in a fork of the process that made it: 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_context_threads(context: *const vg_context) -> u32 {
    guarded_value(0, || {
        let context = unsafe { context.cast::<ContextObject>().as_ref() };
        context.and_then(|context| context.get("context").ok()).map_or(0, |w| w.threads.count() as u32)
    })
}

/// Ends the context's threads and frees its memory. No call may be using it. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_context_free(context: *mut vg_context) {
    unsafe { free(context.cast::<ContextObject>()) }
}

/// Ends the threads and frees the memory that calls which name no context have made for each other. One that is running
/// is not disturbed, and the last of them ends the threads; the next such call makes them anew. Nothing happens where
/// there was no such call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_default_context_free() {
    guarded_value((), || DefaultContext::here().free());
}
