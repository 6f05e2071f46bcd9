//! Masks from a segmentation network.

use super::camera::{self, vg_camera};
use super::context::{in_context, vg_context};
use super::guard::guarded;
use super::image::{self, extent, vg_image};
use super::model::{self, vg_model};
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use vg::scene::mask::Label;
use vg::scene::{Mask, Segmenter};
use vg::{Error, onnx};

/// Settings of `vg_segment`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_segment_options {
    /// `sizeof(vg_segment_options)`.
    pub struct_size: usize,
    /// Threads to use. NULL: the process's own, one per core, see `vg_default_context_free`.
    pub context: *mut vg_context,
    /// Reserved: 0.
    pub flags: u64,
}

unsafe impl Versioned for vg_segment_options {
    const NAME: &'static str = "vg_segment_options";
    const FIRST_SIZE: usize = 24;

    fn initial() -> Self {
        Self { struct_size: size_of::<Self>(), context: std::ptr::null_mut(), flags: 0 }
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_segment_options_init(options: *mut vg_segment_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Makes the mask of a photograph that has none. The network tells which pixels show a vehicle, the camera which of
/// them is the one that stands at the origin of its vehicle frame: cars beside it and behind it are not in the mask.
/// All 0 where the network sees none there.
///
/// - model: a segmentation network; not NULL.
/// - image: RGB8, BGR8, RGBA8, BGRA8 or GRAY8; alpha is not looked at. Not NULL.
/// - camera: of the image; not NULL.
/// - options: NULL for the default values.
/// - out_mask: one byte per pixel of the image, the top row first: 255 is the vehicle, 0 everything else and what a
///   network that cuts off the sides was not shown. Ready to be the GRAY8 mask of a `vg_view`. Not NULL; written on
///   success only.
/// - row_stride: bytes from one row of `out_mask` to the next; 0: rows without gaps. What lies between rows is not
///   touched.
/// - out_error: NULL, or receives the error.
///
/// `VG_STATUS_NOT_BUILT` in a build without networks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_segment(
    model: *const vg_model,
    image: *const vg_image,
    camera: *const vg_camera,
    options: *const vg_segment_options,
    out_mask: *mut u8,
    row_stride: usize,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            read::not_null("image", image, "a picture")?;
            // Structs may be at any address, as in all functions.
            let lent = image.read_unaligned();
            let camera = camera::camera("camera", &read::required("camera", camera)?)?;
            let options = read::optional("options", options)?;
            read::zero("options.flags", options.flags == 0)?;
            let (picture, _) = image::photograph("image", &lent)?;
            read::not_null("out_mask", out_mask, "where to put the mask")?;
            let (_, stride) = extent("", "row_stride", lent.width, lent.height, row_stride, 1)?;
            let model = model::lent(model).ok_or_else(|| match onnx::is_built() {
                true => Error::argument("model", "NULL", "an open model"),
                false => onnx::not_built("model"),
            })?;
            let segmenter = Segmenter::new(model)?;
            let made = in_context(options.context, |context| {
                context.threads.run(|| segmenter.mask(&picture, &camera))
            })?;
            write(&made, out_mask, stride);
            Ok(())
        })
    }
}

/// Writes a mask's rows, `stride` bytes apart.
unsafe fn write(mask: &Mask, to: *mut u8, stride: usize) {
    for (v, row) in mask.labels().chunks_exact(mask.width() as usize).enumerate() {
        for (u, label) in row.iter().enumerate() {
            let byte = if *label == Label::Vehicle { u8::MAX } else { 0 };
            unsafe { to.add(v * stride + u).write(byte) };
        }
    }
}
