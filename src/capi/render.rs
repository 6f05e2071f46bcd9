//! Rendering of Gaussians.

use super::camera::{self, vg_camera};
use super::context::{in_context, vg_context};
use super::gaussians::{self, vg_gaussians};
use super::guard::guarded;
use super::image::{extent, vg_format};
use super::options::{sh_degree, vg_progress_fn};
use super::overlap::{self, Written};
use super::read::{self, Versioned};
use super::status::{vg_error, vg_status};
use super::watched::{ProgressCallback, watched};
use std::ffi::c_void;
use vg::render::backend::{Trainer, is_built, not_built, trainer};
use vg::render::{Backend, Background, RenderOptions, Rendered};
use vg::{Error, Result};

/// What draws.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_backend {
    /// What is best of what this build and this machine have; for a single picture the CPU.
    Auto = 0,
    /// The context's threads.
    Cpu = 1,
    /// A graphics processor, or a driver that stands in for one. `VG_STATUS_NOT_BUILT` in a build without it,
    /// `VG_STATUS_MISSING` on a machine without a driver.
    Gpu = 2,
}

/// What shows where the vehicle does not.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_background {
    /// A colour; the picture is opaque, its alpha 1.
    Color = 0,
    /// Nothing; the picture's alpha is how much of the pixel the vehicle covers.
    Transparent = 1,
}

/// What the colours of a picture with a transparent background are multiplied by.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_alpha {
    /// By nothing, as PNG files want it; 0 where alpha is 0.
    Straight = 0,
    /// By alpha, as compositing wants it.
    Premultiplied = 1,
}

/// What a depth pixel means.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vg_depth_mode {
    /// Expected planar depth along the optical axis in metres; 0 where alpha is 0.
    Expected = 0,
    /// The same times alpha: the plain sum over the Gaussians.
    Accumulated = 1,
}

/// Settings of `vg_render`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_render_options {
    /// `sizeof(vg_render_options)`.
    pub struct_size: usize,
    /// Threads and memory to use. NULL: the process's own, one thread per core, see `vg_default_context_free`.
    pub context: *mut vg_context,
    /// A `vg_backend`. Default `VG_BACKEND_AUTO`. Where pictures follow each other a `vg_renderer` is faster: a graphics
    /// processor is sent the Gaussians once, and here with each call.
    pub backend: i32,
    /// A `vg_background`. Default `VG_BACKGROUND_COLOR`.
    pub background: i32,
    /// The colour, R G B, sRGB-encoded, each 0 to 1. Default white.
    pub background_color: [f32; 3],
    /// A `vg_alpha`; matters where the background is transparent. Default `VG_ALPHA_STRAIGHT`.
    pub alpha: i32,
    /// A `vg_depth_mode`. Default `VG_DEPTH_MODE_EXPECTED`.
    pub depth_mode: i32,
    /// Bands of colour above this degree are left out, 0 to 3. Default 3: all there are.
    pub sh_degree: i32,
    /// 1: compensate opacity for the blur; for pictures much smaller than the photographs. Default 0.
    pub antialiased: i32,
    /// Variance added to each projected Gaussian, pixels^2, 1e-4 to 100. Default 0.3.
    pub blur: f32,
    /// Gaussians whose centre is nearer along the optical axis are not drawn, metres, 1e-6 to 1e10. Default 0.01.
    pub near_plane: f32,
    /// Gaussians whose centre is farther are not drawn, metres, `near_plane` to 1e10. Default 1e10.
    pub far_plane: f32,
    /// Largest alpha of one Gaussian in one pixel, 0.01 to 0.9999. Default 0.99.
    pub max_alpha: f32,
    /// Reserved: 0.
    pub flags: u32,
    /// Called in the course of the call, see `vg_progress_fn`. NULL: none.
    pub progress: vg_progress_fn,
    /// Handed to `progress`.
    pub progress_user: *mut c_void,
}

unsafe impl Versioned for vg_render_options {
    const NAME: &'static str = "vg_render_options";
    const FIRST_SIZE: usize = 72;

    fn initial() -> Self {
        let rust = RenderOptions::default();
        Self {
            struct_size: size_of::<Self>(),
            context: std::ptr::null_mut(),
            backend: Backend::default().number(),
            background: vg_background::Color as i32,
            background_color: [1.0; 3],
            alpha: vg_alpha::Straight as i32,
            depth_mode: rust.depth_mode.number(),
            sh_degree: i32::from(rust.sh_degree),
            antialiased: i32::from(rust.antialiased),
            blur: rust.blur,
            near_plane: rust.near,
            far_plane: rust.far,
            max_alpha: rust.max_alpha,
            flags: 0,
            progress: None,
            progress_user: std::ptr::null_mut(),
        }
    }
}

/// Where `vg_render` puts the picture: colour, depth, alpha, or several of them, which share no byte; rows of one may
/// lie in the gaps of another.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_image_target {
    /// `sizeof(vg_image_target)`.
    pub struct_size: usize,
    /// Columns; must equal the camera's.
    pub width: u32,
    /// Rows; must equal the camera's.
    pub height: u32,
    /// The first pixel of the top row. Any alignment. NULL: no colour.
    pub color: *mut c_void,
    /// Bytes from one row to the next; 0: rows without gaps. What lies between rows is not touched.
    pub color_row_stride: usize,
    /// The first depth pixel of the top row, float32, see `vg_depth_mode`. Any alignment. NULL: no depth.
    pub depth: *mut c_void,
    /// Bytes from one row to the next; 0: rows without gaps.
    pub depth_row_stride: usize,
    /// RGBA8, BGRA8 or RGBA32F; with an opaque background RGB8 and BGR8 too.
    pub color_format: i32,
    /// Reserved: 0.
    pub flags: u32,
    /// The first alpha of the top row, float32: how much of the pixel the vehicle covers, 0 to 1, whatever the
    /// background. Any alignment. NULL: no alpha.
    pub alpha: *mut c_void,
    /// Bytes from one row to the next; 0: rows without gaps.
    pub alpha_row_stride: usize,
}

unsafe impl Versioned for vg_image_target {
    const NAME: &'static str = "vg_image_target";
    const FIRST_SIZE: usize = 56;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            width: 0,
            height: 0,
            color: std::ptr::null_mut(),
            color_row_stride: 0,
            depth: std::ptr::null_mut(),
            depth_row_stride: 0,
            color_format: vg_format::Rgba8 as i32,
            flags: 0,
            alpha: std::ptr::null_mut(),
            alpha_row_stride: 0,
        }
    }
}

/// Sets `*options` to the default values. `size`: `sizeof *options`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_render_options_init(options: *mut vg_render_options, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("options", options, size)) }
}

/// Sets `*target` to an RGBA8 target without memory. `size`: `sizeof *target`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_image_target_init(target: *mut vg_image_target, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("target", target, size)) }
}

/// Draws Gaussians as a camera sees them, through its lens.
///
/// - gaussians: not NULL. Any number of threads may render them at a time.
/// - camera: not NULL.
/// - options: NULL for the default values.
/// - target: not NULL; the memory it points to is written on success only.
/// - out_error: NULL, or receives the error.
///
/// The same arguments give the same bytes with any number of threads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_render(
    gaussians: *const vg_gaussians,
    camera: *const vg_camera,
    options: *const vg_render_options,
    target: *const vg_image_target,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let gaussians = gaussians::required("gaussians", gaussians)?;
            let camera = camera::camera("camera", &read::required("camera", camera)?)?;
            let options = read::optional("options", options)?;
            let (settings, alpha) = options.read()?;
            let target = read::required("target", target)?;
            let target = Target::read("target", &target, &settings, alpha, camera.width, camera.height)?;
            in_context(options.context, |context| {
                context.pictures.lend(|picture| {
                    match device(&options)? {
                        Some(device) => *picture = device.render(gaussians, &camera, &settings)?,
                        None => watched(context, "render", options.progress(), |watch| {
                            let renderer = context.renderer.watched(watch);
                            renderer.render_into(gaussians, &camera, &settings, picture).map(drop)
                        })?,
                    }
                    target.write(picture);
                    Ok(())
                })
            })
        })
    }
}

/// The GPU renderer, if the options choose it.
pub(super) fn device(options: &vg_render_options) -> Result<Option<Trainer>> {
    match options.backend == Backend::Gpu.number() {
        true => Ok(Some(trainer(Backend::Gpu)?.0)),
        false => Ok(None),
    }
}

/// The chosen renderer; an error if this build lacks it.
pub(super) fn backend(argument: &str, number: i32) -> Result<Backend> {
    match read::choice(argument, number)? {
        Backend::Gpu if !is_built() => Err(not_built(argument)),
        backend => Ok(backend),
    }
}

impl vg_render_options {
    /// The callback for progress.
    pub(super) fn progress(&self) -> ProgressCallback {
        ProgressCallback { function: self.progress, user: self.progress_user }
    }

    pub(super) fn read(&self) -> Result<(RenderOptions, vg_alpha)> {
        backend("options.backend", self.backend)?;
        let backgrounds = [
            (vg_background::Color as i32, "color", Background::Color(self.background_color)),
            (vg_background::Transparent as i32, "transparent", Background::Transparent),
        ];
        let alphas = [
            (vg_alpha::Straight as i32, "straight", vg_alpha::Straight),
            (vg_alpha::Premultiplied as i32, "premultiplied", vg_alpha::Premultiplied),
        ];
        read::zero("options.flags", self.flags == 0)?;
        let settings = RenderOptions {
            background: read::one_of("options.background", self.background, &backgrounds)?,
            blur: self.blur,
            antialiased: read::flag("options.antialiased", self.antialiased)?,
            near: self.near_plane,
            far: self.far_plane,
            max_alpha: self.max_alpha,
            sh_degree: sh_degree("options.sh_degree", self.sh_degree)?,
            depth_mode: read::choice("options.depth_mode", self.depth_mode)?,
        };
        let names = [
            ("options.background", "options.background_color"),
            ("options.near", "options.near_plane"),
            ("options.far", "options.far_plane"),
        ];
        settings.validate().map_err(|e| read::renamed(e, &names))?;
        Ok((settings, read::one_of("options.alpha", self.alpha, &alphas)?))
    }
}

/// The caller's memory for a picture, checked.
pub(super) struct Target {
    width: u32,
    height: u32,
    color: Option<(*mut u8, usize, Pixel)>,
    depth: Option<(*mut u8, usize)>,
    alpha: Option<(*mut u8, usize)>,
}

// The caller vouches for the memory until the call ends, and one thread at a time writes there.
unsafe impl Send for Target {}
unsafe impl Sync for Target {}

/// Layout of a pixel.
#[derive(Clone, Copy)]
struct Pixel {
    layout: Layout,
    /// Whether alpha is 1 instead of the picture's own alpha.
    opaque: bool,
    alpha: vg_alpha,
}

#[derive(Clone, Copy, PartialEq)]
enum Layout {
    Rgb8,
    Bgr8,
    Rgba8,
    Bgra8,
    Rgba32f,
}

impl Layout {
    fn bytes(self) -> usize {
        match self {
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 => 4,
            Self::Rgba32f => 16,
        }
    }
}

impl Target {
    /// Reads and checks a target; `argument` names it in errors.
    pub(super) fn read(
        argument: &str,
        target: &vg_image_target,
        settings: &RenderOptions,
        alpha: vg_alpha,
        width: u32,
        height: u32,
    ) -> Result<Self> {
        let named = |field: &str| format!("{argument}.{field}");
        read::zero(&named("flags"), target.flags == 0)?;
        if (target.width, target.height) != (width, height) {
            let found = format!("{}x{}", target.width, target.height);
            let allowed = format!("the camera's size, {width}x{height}");
            return Err(Error::argument(named("size"), found, allowed));
        }
        if target.color.is_null() && target.depth.is_null() && target.alpha.is_null() {
            let found = "neither color nor depth nor alpha";
            return Err(Error::argument(argument, found, "at least one of them"));
        }
        let opaque = settings.background != Background::Transparent;
        let color = match target.color.is_null() {
            true => None,
            false => {
                let layout = layout(&named("color_format"), target.color_format, opaque)?;
                let (_, stride) = extent(
                    &named("color"),
                    "_row_stride",
                    width,
                    height,
                    target.color_row_stride,
                    layout.bytes(),
                )?;
                Some((target.color.cast(), stride, Pixel { layout, opaque, alpha }))
            }
        };
        let plane = |plane: &str, first: *mut c_void, row_stride: usize| match first.is_null() {
            true => Ok(None),
            false => {
                let bytes = size_of::<f32>();
                let (_, stride) = extent(plane, "_row_stride", width, height, row_stride, bytes)?;
                Ok(Some((first.cast(), stride)))
            }
        };
        let depth = plane(&named("depth"), target.depth, target.depth_row_stride)?;
        let alpha = plane(&named("alpha"), target.alpha, target.alpha_row_stride)?;
        let target = Self { width, height, color, depth, alpha };
        overlap::refuse(&target.written(argument))?;
        Ok(target)
    }

    /// The memory that is written.
    pub(super) fn written(&self, argument: &str) -> Vec<Written> {
        let plane = |name: &str, first: *mut u8, stride: usize, bytes: usize| Written {
            argument: format!("{argument}.{name}"),
            first: first.addr(),
            row: self.width as usize * bytes,
            stride,
            rows: self.height as usize,
        };
        let color =
            self.color.map(|(first, stride, pixel)| plane("color", first, stride, pixel.layout.bytes()));
        let floats = |name, (first, stride)| plane(name, first, stride, size_of::<f32>());
        let depth = self.depth.map(|depth| floats("depth", depth));
        let alpha = self.alpha.map(|alpha| floats("alpha", alpha));
        [color, depth, alpha].into_iter().flatten().collect()
    }

    /// Whether [`Rgba8`](vg::render::Rgba8) contains all that the target asks for.
    pub(super) fn takes_bytes(&self) -> bool {
        let Self { color: Some((_, _, pixel)), depth: None, alpha: None, .. } = self else { return false };
        pixel.layout != Layout::Rgba32f && (pixel.opaque || pixel.alpha == vg_alpha::Straight)
    }

    /// As [`Target::write`], for a picture of bytes with `width` pixels to a row.
    pub(super) unsafe fn write_bytes(&self, rgba: &[[u8; 4]], width: u32) {
        let Some((first, stride, pixel)) = self.color else { return };
        let size = pixel.layout.bytes();
        for (v, row) in rgba.chunks_exact(width as usize).enumerate() {
            let target = unsafe { std::slice::from_raw_parts_mut(first.add(v * stride), row.len() * size) };
            for (bytes, &[r, g, b, a]) in target.chunks_exact_mut(size).zip(row) {
                match pixel.layout {
                    Layout::Bgr8 | Layout::Bgra8 => bytes.copy_from_slice(&[b, g, r, a][..size]),
                    _ => bytes.copy_from_slice(&[r, g, b, a][..size]),
                }
            }
        }
    }

    /// Copies the picture row by row, because the gaps between rows belong to the caller.
    pub(super) unsafe fn write(&self, picture: &Rendered) {
        let width = picture.width as usize;
        for v in 0..picture.height as usize {
            let row = v * width..(v + 1) * width;
            if let Some((first, stride, pixel)) = self.color {
                let len = width * pixel.layout.bytes();
                let target = unsafe { std::slice::from_raw_parts_mut(first.add(v * stride), len) };
                let source = picture.color[row.clone()].iter().zip(&picture.alpha[row.clone()]);
                for (bytes, (color, alpha)) in target.chunks_exact_mut(pixel.layout.bytes()).zip(source) {
                    pixel.write(bytes, *color, *alpha);
                }
            }
            for (plane, values) in [(self.depth, &picture.depth), (self.alpha, &picture.alpha)] {
                let Some((first, stride)) = plane else { continue };
                let len = width * size_of::<f32>();
                let target = unsafe { std::slice::from_raw_parts_mut(first.add(v * stride), len) };
                target.copy_from_slice(bytemuck::cast_slice(&values[row.clone()]));
            }
        }
    }
}

fn layout(argument: &str, format: i32, opaque: bool) -> Result<Layout> {
    let all = [
        (vg_format::Rgba8 as i32, "RGBA8", Layout::Rgba8),
        (vg_format::Bgra8 as i32, "BGRA8", Layout::Bgra8),
        (vg_format::Rgba32f as i32, "RGBA32F", Layout::Rgba32f),
        (vg_format::Rgb8 as i32, "RGB8", Layout::Rgb8),
        (vg_format::Bgr8 as i32, "BGR8", Layout::Bgr8),
    ];
    // A format without alpha cannot store transparency.
    read::one_of(argument, format, if opaque { &all } else { &all[..3] })
}

impl Pixel {
    #[inline]
    fn write(self, bytes: &mut [u8], premultiplied: [f32; 3], coverage: f32) {
        let alpha = if self.opaque { 1.0 } else { coverage };
        let scale = match self.alpha {
            vg_alpha::Straight if alpha > 0.0 => 1.0 / alpha,
            vg_alpha::Straight => 0.0,
            vg_alpha::Premultiplied => 1.0,
        };
        let [r, g, b] = premultiplied.map(|c| c * scale);
        let rgb8 = || [byte(r), byte(g), byte(b)];
        match self.layout {
            Layout::Rgb8 => bytes.copy_from_slice(&rgb8()),
            Layout::Rgba8 => {
                bytes[..3].copy_from_slice(&rgb8());
                bytes[3] = byte(alpha);
            }
            Layout::Bgr8 => bytes.copy_from_slice(&[byte(b), byte(g), byte(r)]),
            Layout::Bgra8 => bytes.copy_from_slice(&[byte(b), byte(g), byte(r), byte(alpha)]),
            Layout::Rgba32f => bytes.copy_from_slice(bytemuck::bytes_of(&[r, g, b, alpha])),
        }
    }
}

fn byte(value: f32) -> u8 {
    vg::render::output::to_u8(value)
}
