//! Gaussians prepared for rendering many times, on the CPU or a GPU.

use super::camera::{self, vg_camera};
use super::context::{in_context, vg_context};
use super::gaussians::{self, vg_gaussians};
use super::guard::{clear, free, guarded, guarded_value};
use super::overlap;
use super::read::{self, Versioned};
use super::render::{Target, backend, vg_image_target, vg_render_options};
use super::status::{c_string, vg_error, vg_status};
use super::watched::watched;
use std::ffi::{CString, c_char};
use std::sync::{Mutex, PoisonError};
use vg::Error;
use vg::render::{AssetRenderer, Backend, Rgba8};

/// Gaussians made ready to be drawn many times: where a graphics processor draws, they are in its memory, and its
/// kernels are compiled. Any number of threads may use one at a time. Free it with `vg_renderer_free`.
#[cfg_attr(test, safer_ffi::derive_ReprC, repr(opaque))]
pub struct vg_renderer {
    _private: [u8; 0],
}

/// Settings of a renderer.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_renderer_options {
    /// `sizeof(vg_renderer_options)`.
    pub struct_size: usize,
    /// Threads to make ready with. NULL: the process's own, one per core, see `vg_default_context_free`.
    pub context: *mut vg_context,
    /// A `vg_backend`. Default `VG_BACKEND_AUTO`: a graphics processor where this build and this machine have one and
    /// there are 20,000 Gaussians or more, else the CPU; should the device fail later, the CPU goes on.
    pub backend: i32,
    /// Reserved: 0.
    pub flags: u32,
}

unsafe impl Versioned for vg_renderer_options {
    const NAME: &'static str = "vg_renderer_options";
    const FIRST_SIZE: usize = 24;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            context: std::ptr::null_mut(),
            backend: Backend::default().number(),
            flags: 0,
        }
    }
}

/// Type that a `vg_renderer` points to.
struct RendererObject {
    ready: AssetRenderer,
    /// Texts that callers have borrowed, at most two.
    texts: Mutex<Vec<CString>>,
}

/// Largest number of pictures of one call.
const MAX_PICTURES: usize = 4096;

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_renderer_options_init(
    options: *mut vg_renderer_options,
    size: usize,
) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Makes Gaussians ready to be drawn many times.
///
/// - gaussians: not NULL. They are shared, not copied, and may be freed before the renderer.
/// - options: NULL for the default values.
/// - out: receives the renderer; the caller frees it. NULL on failure.
/// - out_error: NULL, or receives the error.
///
/// With `VG_BACKEND_GPU`: `VG_STATUS_NOT_BUILT` in a build without it, `VG_STATUS_MISSING` without a driver, and
/// `VG_STATUS_ARGUMENT` for more Gaussians than the device can take.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_renderer_new(
    gaussians: *const vg_gaussians,
    options: *const vg_renderer_options,
    out: *mut *mut vg_renderer,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        clear(out);
        guarded(out_error, || {
            let shared = gaussians::shared("gaussians", gaussians)?;
            let options = read::optional("options", options)?;
            read::zero("options.flags", options.flags == 0)?;
            let backend = backend("options.backend", options.backend)?;
            read::not_null("out", out, "where to put the renderer")?;
            let ready = in_context(options.context, |context| {
                context.threads.run(|| AssetRenderer::new(shared, backend))
            })?;
            let object = RendererObject { ready, texts: Mutex::default() };
            out.write(Box::into_raw(Box::new(object)).cast());
            Ok(())
        })
    }
}

/// Draws Gaussians as cameras see them, through their lenses, one picture after the other into the targets.
///
/// - renderer: not NULL.
/// - cameras: `count` of them, not NULL.
/// - count: 1 to 4096.
/// - options: NULL for the default values. `backend` is not looked at: the renderer has one.
/// - targets: `count` of them, not NULL, no byte of memory in two. The memory they point to is written when its picture
///   is done; the arguments of all pictures are checked before the first is drawn.
/// - out_error: NULL, or receives the error.
///
/// The same arguments give the same bytes with any number of threads on one machine; those of a graphics processor
/// differ from those of the CPU in the last bits. Colours are sRGB-encoded as everywhere: the numbers that
/// reconstruction read, blended as they are.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_renderer_render(
    renderer: *const vg_renderer,
    cameras: *const vg_camera,
    count: usize,
    options: *const vg_render_options,
    targets: *const vg_image_target,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let object = read::handle("renderer", renderer.cast::<RendererObject>(), "a renderer")?;
            if !(1..=MAX_PICTURES).contains(&count) {
                return Err(Error::argument("count", count.to_string(), format!("1 to {MAX_PICTURES}")));
            }
            let options = read::optional("options", options)?;
            let (settings, alpha) = options.read()?;
            let cameras = read::array("cameras", cameras, count)?;
            let targets = read::array("targets", targets, count)?;
            let (mut seen, mut places) = (Vec::with_capacity(count), Vec::with_capacity(count));
            for (i, (camera, target)) in cameras.iter().zip(&targets).enumerate() {
                let camera = camera::camera(&format!("cameras[{i}]"), camera)?;
                let (width, height) = (camera.width, camera.height);
                let name = format!("targets[{i}]");
                places.push(Target::read(&name, target, &settings, alpha, width, height)?);
                seen.push(camera);
            }
            let written =
                places.iter().enumerate().flat_map(|(i, place)| place.written(&format!("targets[{i}]")));
            overlap::refuse(&written.collect::<Vec<_>>())?;
            let ready = &object.ready;
            // The CPU's planes are converted to bytes while they are copied to the target.
            let as_bytes = ready.choice().backend == Backend::Gpu && places.iter().all(Target::takes_bytes);
            in_context(options.context, |context| {
                watched(context, "render", options.progress(), |watch| match as_bytes {
                    true => context.bytes.lend(|bytes| {
                        ready.render_each_watched(&seen, &settings, bytes, watch, |i, rgba: &Rgba8| {
                            places[i].write_bytes(&rgba.pixels, seen[i].width);
                            Ok(())
                        })
                    }),
                    false => context.pictures.lend(|picture| {
                        ready.render_each_watched(&seen, &settings, picture, watch, |i, planes| {
                            places[i].write(planes);
                            Ok(())
                        })
                    }),
                })
            })
        })
    }
}

/// Who draws: `VG_BACKEND_CPU` or `VG_BACKEND_GPU`. NULL: `VG_BACKEND_AUTO`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_renderer_backend(renderer: *const vg_renderer) -> i32 {
    guarded_value(Backend::Auto.number(), || {
        unsafe { renderer.cast::<RendererObject>().as_ref() }.map_or(Backend::Auto.number(), |r| {
            match r.ready.choice().backend {
                Backend::Auto => Backend::Cpu.number(),
                chosen => chosen.number(),
            }
        })
    })
}

/// Who draws, and why, in one line of UTF-8: "cpu (avx2+fma): graphics processor: no Vulkan driver; ...". Lives as long as
/// the renderer. NULL: an empty string. Never NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_renderer_choice(renderer: *const vg_renderer) -> *const c_char {
    guarded_value(c"".as_ptr(), || {
        let Some(object) = (unsafe { renderer.cast::<RendererObject>().as_ref() }) else {
            return c"".as_ptr();
        };
        let text = c_string(object.ready.choice().to_string());
        let mut texts = object.texts.lock().unwrap_or_else(PoisonError::into_inner);
        let known = texts.iter().position(|t| *t == text).unwrap_or_else(|| {
            texts.push(text);
            texts.len() - 1
        });
        // The bytes of a CString do not move when the list grows.
        texts[known].as_ptr()
    })
}

/// Frees a renderer. Texts of it end. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_renderer_free(renderer: *mut vg_renderer) {
    unsafe { free(renderer.cast::<RendererObject>()) }
}
