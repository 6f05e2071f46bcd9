//! Views: a photograph, its mask, its depth, its camera.

use super::camera::{self, vg_camera};
use super::guard::guarded;
use super::image::{self, vg_image};
use super::read::{self, Versioned};
use super::status::vg_status;
use std::ffi::c_char;
use vg::scene::view::MAX_VIEWS;
use vg::scene::{Scene, View};
use vg::{Error, Result};

/// One photograph of the vehicle.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_view {
    /// `sizeof(vg_view)`; the same in all elements of an array.
    pub struct_size: usize,
    /// UTF-8 name for messages and the report; NULL: none. Read during the call only, like all pointers here.
    pub name: *const c_char,
    /// Lens and pose.
    pub camera: vg_camera,
    /// The photograph, RGB8, BGR8, RGBA8, BGRA8 or GRAY8, of the camera's size. RGB8 without gaps between rows is
    /// read in place; anything else is copied once.
    pub image: vg_image,
    /// GRAY8, of the camera's size: 128 and above is vehicle; where no value is above 1, 1 is. A largest value between
    /// is an error. `data` NULL: the photograph's alpha is the mask; where it has none, or one that is 255 throughout,
    /// the outline of `depth` is, if that measures the vehicle alone (0 at the picture's border); else a
    /// reconstruction is refused.
    pub mask: vg_image,
    /// DEPTH32F, of the camera's size. `data` NULL: not measured.
    pub depth: vg_image,
}

unsafe impl Versioned for vg_view {
    const NAME: &'static str = "vg_view";
    const FIRST_SIZE: usize = 392;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            name: std::ptr::null(),
            camera: vg_camera::initial(),
            image: vg_image::NONE,
            mask: vg_image::NONE,
            depth: vg_image::NONE,
        }
    }
}

/// Sets `*view` to a view without picture. `size`: `sizeof *view`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_view_init(view: *mut vg_view, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("view", view, size)) }
}

/// Reads the caller's views; the scene borrows their pixels and must not outlive the call.
pub(super) unsafe fn scene(views: *const vg_view, count: usize) -> Result<Scene> {
    if !(1..=MAX_VIEWS).contains(&count) {
        return Err(Error::argument("view_count", count.to_string(), format!("1 to {MAX_VIEWS}")));
    }
    let views = unsafe { read::array("views", views, count)? };
    let view = |(i, view): (usize, &vg_view)| unsafe { read_view(&format!("views[{i}]"), view) };
    Ok(Scene { views: views.iter().enumerate().map(view).collect::<Result<_>>()?, ..Scene::default() })
}

/// Reads one view.
pub(super) unsafe fn read_view(argument: &str, view: &vg_view) -> Result<View> {
    let part = |name: &str| format!("{argument}.{name}");
    unsafe {
        let name = read::text(&part("name"), view.name)?.to_owned();
        let camera = camera::camera(&part("camera"), &view.camera)?;
        let (image, alpha) = image::photograph(&part("image"), &view.image)?;
        let mask = image::mask(&part("mask"), &view.mask)?.or(alpha);
        let depth = image::depth(&part("depth"), &view.depth)?;
        Ok(View { name, camera, image, mask, depth })
    }
}
