//! Scenes on disk.

use super::camera::vg_camera;
use super::context::{CallContext, in_context, vg_context};
use super::guard::{clear, free, guarded, guarded_value};
use super::image::{vg_format, vg_image};
use super::options::{Log, vg_log_fn, vg_log_level, vg_progress_fn};
use super::read::{self, Versioned};
use super::status::{c_string, vg_error, vg_status};
use super::view::vg_view;
use super::watched::{ProgressCallback, watched};
use std::ffi::{CString, c_char, c_void};
use vg::geometry::Similarity;
use vg::io::{self, SceneFormat, SceneOptions};
use vg::scene::view::MAX_VIEWS;
use vg::scene::{Scene, View};
use vg::{Error, Result};

/// Views read from files, with their pixels. Owned by the caller, who frees it with `vg_scene_free`; it never
/// changes, and any number of threads may read it.
pub struct vg_scene {
    _private: [u8; 0],
}

/// Type that a `vg_scene` points to.
struct SceneObject {
    scene: Scene,
    names: Vec<CString>,
}

/// What of a scene is wanted, and what its files do not say.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_scene_options {
    /// `sizeof(vg_scene_options)`.
    pub struct_size: usize,
    /// Threads that decode. NULL: the process's own, one per core, see `vg_default_context_free`.
    pub context: *mut vg_context,
    /// 16 numbers, a row-major 4x4 similarity from the world of the poses to the vehicle's frame in metres. A COLMAP
    /// model needs it. NULL for a `transforms.json`: its world is the vehicle's frame.
    pub vehicle_from_world: *const f64,
    /// The views wanted, in this order, each by path, file name, or file name without extension, UTF-8.
    /// NULL: all views.
    pub names: *const *const c_char,
    /// How many names; 0 with NULL.
    pub name_count: usize,
    /// Metres per number in the depth files; 0: as the scene says, else millimetres for integers, metres for floats.
    pub depth_scale: f64,
    /// 1: read depth files where there are any; 0: do not. Default 1.
    pub load_depth: i32,
    /// Reserved: 0.
    pub flags: u32,
    /// Told what is legal but looks like a mistake. NULL: nobody.
    pub log: vg_log_fn,
    /// Handed to `log`.
    pub log_user: *mut c_void,
    /// Called in the course of the call, see `vg_progress_fn`. NULL: none.
    pub progress: vg_progress_fn,
    /// Handed to `progress`.
    pub progress_user: *mut c_void,
}

unsafe impl Versioned for vg_scene_options {
    const NAME: &'static str = "vg_scene_options";
    const FIRST_SIZE: usize = 72;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            context: std::ptr::null_mut(),
            vehicle_from_world: std::ptr::null(),
            names: std::ptr::null(),
            name_count: 0,
            depth_scale: 0.0,
            load_depth: 1,
            flags: 0,
            log: None,
            log_user: std::ptr::null_mut(),
            progress: None,
            progress_user: std::ptr::null_mut(),
        }
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_scene_options_init(options: *mut vg_scene_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Reads a COLMAP folder: a model (binary or text) in `sparse/0`, in `sparse` or in the folder itself, of several
/// numbered ones that with the most images; photographs in `images`, masks in `masks` or `mask` (`<stem>.png`,
/// `<name>.png`, `<stem>_mask.png` or `<stem>.mask.png`; PNG, JPEG or NumPy), depth in `depth` (PNG, NumPy, PFM or
/// EXR). Two colours of which one is black are a mask whatever the other is.
///
/// - path: the folder; not NULL.
/// - options: not NULL, because a COLMAP model needs `vehicle_from_world`.
/// - out: receives the scene; the caller frees it. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_colmap_open(
    path: *const c_char,
    options: *const vg_scene_options,
    out: *mut *mut vg_scene,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe { open(path, options, SceneFormat::Colmap, out, out_error) }
}

/// Reads a nerfstudio or an instant-ngp scene: a `transforms.json`, or a folder with one. Masks and depth that the file
/// does not list are looked for as in a COLMAP folder.
///
/// - path: the file or folder; not NULL.
/// - options: NULL for the default values.
/// - out: receives the scene; the caller frees it. NULL on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_transforms_open(
    path: *const c_char,
    options: *const vg_scene_options,
    out: *mut *mut vg_scene,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe { open(path, options, SceneFormat::Transforms, out, out_error) }
}

unsafe fn open(
    path: *const c_char,
    options: *const vg_scene_options,
    format: SceneFormat,
    out: *mut *mut vg_scene,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        clear(out);
        guarded(out_error, || {
            read::not_null("out", out, "where to put the scene")?;
            let path = read::path("path", path)?;
            let options = match format {
                SceneFormat::Colmap => read::required("options", options)?,
                SceneFormat::Transforms => read::optional("options", options)?,
            };
            let wanted = SceneOptions { format: Some(format), ..options.read()? };
            let callback = ProgressCallback { function: options.progress, user: options.progress_user };
            let open = |context: &CallContext| {
                watched(context, "read", callback, |watch| io::open_scene_watched(path, &wanted, watch))
            };
            let files = in_context(options.context, open)
                .map_err(|e| read::renamed(e, &[("depth_scale", "options.depth_scale")]))?;
            let log = Log { callback: options.log, user: options.log_user };
            for note in files.notes {
                log.line(vg_log_level::Warning, || note);
            }
            let names = files.scene.views.iter().map(|v| c_string(v.name.clone())).collect();
            let object = SceneObject { scene: files.scene, names };
            out.write(Box::into_raw(Box::new(object)).cast());
            Ok(())
        })
    }
}

impl vg_scene_options {
    pub(super) unsafe fn read(&self) -> Result<SceneOptions> {
        read::zero("options.flags", self.flags == 0)?;
        let vehicle_from_world = match self.vehicle_from_world.is_null() {
            true => None,
            false => {
                let argument = "options.vehicle_from_world";
                let matrix = unsafe { read::fixed(argument, self.vehicle_from_world)? };
                Some(Similarity::from_row_major(argument, &matrix)?)
            }
        };
        Ok(SceneOptions {
            views: unsafe { self.read_names()? },
            vehicle_from_world,
            depth_scale: (self.depth_scale != 0.0).then_some(self.depth_scale),
            load_depth: read::flag("options.load_depth", self.load_depth)?,
            format: None,
        })
    }

    unsafe fn read_names(&self) -> Result<Option<Vec<String>>> {
        let argument = "options.names";
        if self.names.is_null() && self.name_count == 0 {
            return Ok(None);
        }
        if !(1..=MAX_VIEWS).contains(&self.name_count) {
            let found = self.name_count.to_string();
            return Err(Error::argument("options.name_count", found, format!("1 to {MAX_VIEWS}")));
        }
        let pointers = unsafe { read::numbers(argument, self.names, self.name_count)? };
        let name = |(i, &pointer): (usize, &*const c_char)| {
            let argument = format!("{argument}[{i}]");
            read::not_null(&argument, pointer, "a view's name")?;
            unsafe { read::text(&argument, pointer) }.map(str::to_owned)
        };
        pointers.iter().enumerate().map(name).collect::<Result<_>>().map(Some)
    }
}

unsafe fn object<'a>(scene: *const vg_scene) -> Option<&'a SceneObject> {
    unsafe { scene.cast::<SceneObject>().as_ref() }
}

/// How many views a scene has. NULL: 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_scene_view_count(scene: *const vg_scene) -> usize {
    guarded_value(0, || unsafe { object(scene) }.map_or(0, |s| s.scene.views.len()))
}

/// A view of a scene, for `vg_reconstruct` and `vg_render`. Its pointers live as long as the scene.
///
/// - scene: not NULL.
/// - index: below `vg_scene_view_count`.
/// - out: a view that `vg_view_init` was called for; unchanged on failure.
/// - out_error: NULL, or receives the error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_scene_get_view(
    scene: *const vg_scene,
    index: usize,
    out: *mut vg_view,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let object = read::handle("scene", scene.cast::<SceneObject>(), "a scene")?;
            let (Some(view), Some(name)) = (object.scene.views.get(index), object.names.get(index)) else {
                let allowed = format!("below {}", object.scene.views.len());
                return Err(Error::argument("index", index.to_string(), allowed));
            };
            read::fill("out", out, &lent(view, name))
        })
    }
}

/// A view for C, which points into the library's view.
fn lent(view: &View, name: &CString) -> vg_view {
    let (width, height) = (view.image.width(), view.image.height());
    let image = |data: *const c_void, format: vg_format| vg_image {
        data,
        row_stride: 0,
        width,
        height,
        format: format as i32,
        flags: 0,
    };
    vg_view {
        name: name.as_ptr(),
        camera: vg_camera::of(&view.camera),
        image: image(view.image.pixels().as_ptr().cast(), vg_format::Rgb8),
        // A label is one byte: 255 is vehicle, and the others lie below 128.
        mask: view
            .mask
            .as_ref()
            .map_or(vg_image::NONE, |m| image(m.labels().as_ptr().cast(), vg_format::Gray8)),
        depth: view
            .depth
            .as_ref()
            .map_or(vg_image::NONE, |d| image(d.depth().as_ptr().cast(), vg_format::Depth32f)),
        ..vg_view::initial()
    }
}

/// Frees a scene. Pointers into it end. NULL: nothing happens.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_scene_free(scene: *mut vg_scene) {
    unsafe { free(scene.cast::<SceneObject>()) }
}
