//! Gradients of a loss with respect to what a picture is made of.

use super::camera::{self, vg_camera};
use super::context::in_context;
use super::gaussians::{self, vg_gaussians};
use super::guard::guarded;
use super::image::extent;
use super::overlap::{self, Written};
use super::read::{self, Versioned};
use super::render::{Target, device, vg_alpha, vg_image_target, vg_render_options};
use super::status::{vg_error, vg_status};
use super::watched::watched;
use std::ffi::c_void;
use vg::progress::Watch;
use vg::render::{Background, Differentiable, Gradients, PictureGradient, Rendered};
use vg::{Error, Gaussians, Result};

/// Called once on the calling thread when the picture is in `target`; fills the planes that the `vg_image_gradient`
/// points to. Returns 0 to go on; anything else ends the call with `VG_STATUS_CANCELLED`. May call the library, with
/// the same context too; may not throw or jump out.
pub type vg_loss_fn = Option<unsafe extern "C" fn(user: *mut c_void) -> i32>;

/// Gradient of a loss with respect to a picture, which the library reads during the call and does not keep. Finite
/// numbers of any sign; a plane that is NULL is one the loss does not look at.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_image_gradient {
    /// `sizeof(vg_image_gradient)`.
    pub struct_size: usize,
    /// Columns; must equal the camera's.
    pub width: u32,
    /// Rows; must equal the camera's.
    pub height: u32,
    /// dL / dcolour, float32 R, G, B: of the numbers an RGBA32F target holds, with a transparent background those of
    /// `VG_ALPHA_PREMULTIPLIED`. The first pixel of the top row. Any alignment. `[height][width][3]`
    pub color: *const c_void,
    /// Bytes from one row to the next; 0: rows without gaps.
    pub color_row_stride: usize,
    /// dL / dalpha, float32: of `vg_image_target.alpha`, which no background changes. `[height][width]`
    pub alpha: *const c_void,
    /// Bytes from one row to the next; 0: rows without gaps.
    pub alpha_row_stride: usize,
    /// dL / ddepth, float32, per metre: of `vg_image_target.depth` in the `vg_depth_mode` of the options.
    /// `[height][width]`
    pub depth: *const c_void,
    /// Bytes from one row to the next; 0: rows without gaps.
    pub depth_row_stride: usize,
    /// Computes the planes out of the picture, between drawing it and going back, so that a step of a training loop
    /// draws once. NULL: the planes are there already. Default NULL.
    pub loss: vg_loss_fn,
    /// Handed to `loss`.
    pub loss_user: *mut c_void,
    /// Reserved: 0.
    pub flags: u64,
}

unsafe impl Versioned for vg_image_gradient {
    const NAME: &'static str = "vg_image_gradient";
    const FIRST_SIZE: usize = 88;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            width: 0,
            height: 0,
            color: std::ptr::null(),
            color_row_stride: 0,
            alpha: std::ptr::null(),
            alpha_row_stride: 0,
            depth: std::ptr::null(),
            depth_row_stride: 0,
            loss: None,
            loss_user: std::ptr::null_mut(),
            flags: 0,
        }
    }
}

/// Where `vg_render_backward` puts gradients: arrays of the caller's, laid out as those of `vg_gaussian_arrays`, at
/// any address, NULL where not wanted, no byte in two of them or in the target. They are written whole, not added to.
/// All numbers are finite: what a float32 cannot hold is its largest number of that sign.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(test, safer_ffi::derive_ReprC)]
pub struct vg_gradients {
    /// `sizeof(vg_gradients)`.
    pub struct_size: usize,
    /// How many Gaussians the arrays have room for: as many as there are. Not looked at where none of the five is
    /// wanted.
    pub count: usize,
    /// Of centres, per metre. `[count][3]`
    pub positions: *mut f32,
    /// Of standard deviations, per metre. `[count][3]`
    pub scales: *mut f32,
    /// Of the stored unit quaternions w, x, y, z as four free numbers that are normalised before use, so that it is
    /// perpendicular to the quaternion. Whoever handed in a quaternion of another norm divides by that norm.
    /// `[count][4]`
    pub rotations: *mut f32,
    /// Of peak opacities. `[count]`
    pub opacities: *mut f32,
    /// Of coefficients of spherical harmonics; zero in bands above `vg_render_options.sh_degree`.
    /// `[count][(sh_degree + 1)^2][3]`
    pub sh: *mut f32,
    /// Of the background colour R, G, B; zero for a transparent one. `[3]`
    pub background: *mut f64,
    /// Of the camera's place: turning it about its axes x, y, z, per radian, then moving it along them, per metre;
    /// vehicle_from_camera becomes vehicle_from_camera times the small motion. `[6]`
    pub pose: *mut f64,
    /// Of the entries of camera_from_vehicle, the inverse of the camera's pose as a 4x4 matrix, row-major, all entries
    /// free; colour is seen from the centre -R^T t. The last row is zero. `[16]`
    pub view_matrix: *mut f64,
    /// Degree of the spherical harmonics `sh` has room for: the Gaussians'. Not looked at where `sh` is NULL.
    pub sh_degree: i32,
    /// Reserved: 0.
    pub flags: u32,
}

unsafe impl Versioned for vg_gradients {
    const NAME: &'static str = "vg_gradients";
    const FIRST_SIZE: usize = 88;

    fn initial() -> Self {
        Self {
            struct_size: size_of::<Self>(),
            count: 0,
            positions: std::ptr::null_mut(),
            scales: std::ptr::null_mut(),
            rotations: std::ptr::null_mut(),
            opacities: std::ptr::null_mut(),
            sh: std::ptr::null_mut(),
            background: std::ptr::null_mut(),
            pose: std::ptr::null_mut(),
            view_matrix: std::ptr::null_mut(),
            sh_degree: 0,
            flags: 0,
        }
    }
}

/// Sets `*gradient` to one without planes. `size`: `sizeof *gradient`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_image_gradient_init(gradient: *mut vg_image_gradient, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("gradient", gradient, size)) }
}

/// Sets `*gradients` to one without arrays. `size`: `sizeof *gradients`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_gradients_init(gradients: *mut vg_gradients, size: usize) -> vg_status {
    unsafe { guarded(std::ptr::null_mut(), || read::initialize("gradients", gradients, size)) }
}

/// Goes back from the gradient of a loss with respect to a picture to its gradients with respect to what `vg_render`
/// draws that picture of. The picture is drawn again on the way: nothing of an earlier call is needed.
///
/// Constants are: the order of depth, which pixels a Gaussian reaches, what is too faint or too far behind to be
/// drawn, and the near and far planes. Where a value is clamped its gradient is zero: alpha at `max_alpha`, colour at
/// 0, the compensation of `antialiased` at its floor.
///
/// - gaussians: not NULL. Any number of threads may use them at a time.
/// - camera: not NULL.
/// - options: those of the picture; NULL for the default values. With a target `progress` is not called; `loss` can end
///   the call. With a transparent background and a gradient of
///   colour, `alpha` must be `VG_ALPHA_PREMULTIPLIED`.
/// - target: NULL, or receives the picture; `gradient->loss` needs one. The memory it points to is written on success,
///   and before `loss` is called.
/// - gradient: not NULL; at least one plane.
/// - out: not NULL; at least one array. The memory it points to is written on success only.
/// - out_error: NULL, or receives the error, which names plane, row and column of a number that is not finite.
///
/// The same arguments give the same bytes with any number of threads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vg_render_backward(
    gaussians: *const vg_gaussians,
    camera: *const vg_camera,
    options: *const vg_render_options,
    target: *const vg_image_target,
    gradient: *const vg_image_gradient,
    out: *const vg_gradients,
    out_error: *mut *mut vg_error,
) -> vg_status {
    unsafe {
        guarded(out_error, || {
            let gaussians = gaussians::required("gaussians", gaussians)?;
            let camera = camera::camera("camera", &read::required("camera", camera)?)?;
            let options = read::optional("options", options)?;
            let (settings, alpha) = options.read()?;
            let device = device(&options)?;
            let target = match target.is_null() {
                true => None,
                false => {
                    let (target, width, height) =
                        (read::required("target", target)?, camera.width, camera.height);
                    Some(Target::read("target", &target, &settings, alpha, width, height)?)
                }
            };
            let planes = Planes::read(gradient, target.is_some(), camera.width, camera.height)?;
            if planes.color.is_some()
                && settings.background == Background::Transparent
                && alpha == vg_alpha::Straight
            {
                let allowed =
                    "1 (premultiplied): the gradient of colour on a transparent background is of that";
                return Err(Error::argument("options.alpha", "0 (straight)", allowed));
            }
            let out = Arrays::read(out, gaussians)?;
            let picture = target.as_ref().map_or(Vec::new(), |target| target.written("target"));
            overlap::refuse(&[picture, out.written(gaussians)].concat())?;
            let mut picture_gradient =
                PictureGradient { width: camera.width, height: camera.height, ..Default::default() };
            if planes.loss.is_none() {
                planes.copy(&mut picture_gradient)?;
            }
            in_context(options.context, |context| {
                let Some(target) = target else {
                    let back = |watch: &Watch| match &device {
                        Some(device) => device.backward(gaussians, &camera, &settings, &picture_gradient),
                        None => context.renderer.watched(watch).backward(
                            gaussians,
                            &camera,
                            &settings,
                            &picture_gradient,
                        ),
                    };
                    out.write(&watched(context, "render", options.progress(), back)?);
                    return Ok(());
                };
                let renderer = device.as_deref().unwrap_or(&context.renderer);
                context.pictures.lend(|picture| {
                    let mut gradients = Gradients::default();
                    let lent = CallerMemory(&target, &planes);
                    let draw = |ask: &dyn Fn(()) -> i32| {
                        let CallerMemory(target, planes) = lent.get();
                        let targets = (&mut *picture, &mut picture_gradient, &mut gradients);
                        let mut loss = |picture: &Rendered, picture_gradient: &mut PictureGradient| {
                            if planes.loss.is_some() {
                                target.write(picture);
                                if ask(()) != 0 {
                                    return Err(Error::Cancelled { stage: "loss" });
                                }
                            }
                            // Copied again, because the renderer clears an earlier copy.
                            planes.copy(picture_gradient)
                        };
                        renderer.forward_backward(gaussians, &camera, &settings, targets, &mut loss)
                    };
                    let on_this_thread = |()| planes.loss.map_or(0, |loss| loss(planes.loss_user));
                    context.threads.run_asking(draw, on_this_thread)?;
                    if planes.loss.is_none() {
                        target.write(picture);
                    }
                    out.write(&gradients);
                    Ok(())
                })
            })
        })
    }
}

/// The caller's memory for use on a worker thread while the calling thread waits.
#[derive(Clone, Copy)]
struct CallerMemory<'a>(&'a Target, &'a Planes);

// SAFETY: pointers into memory that the caller promised for the length of the call, and that nobody else uses: the
// calling thread waits, or runs the caller's own `loss` while the worker waits for it.
unsafe impl Send for CallerMemory<'_> {}
unsafe impl Sync for CallerMemory<'_> {}

impl<'a> CallerMemory<'a> {
    /// A method, so that a closure captures the whole struct instead of its fields.
    fn get(self) -> Self {
        self
    }
}

/// A plane of a picture in the caller's memory: its first byte, and the bytes from row to row.
type Plane = Option<(*const u8, usize)>;

/// The caller's gradient of a picture; all is checked except its numbers.
struct Planes {
    color: Plane,
    alpha: Plane,
    depth: Plane,
    loss: vg_loss_fn,
    loss_user: *mut c_void,
}

impl Planes {
    unsafe fn read(
        gradient: *const vg_image_gradient,
        has_target: bool,
        width: u32,
        height: u32,
    ) -> Result<Self> {
        let gradient = unsafe { read::required("gradient", gradient)? };
        read::zero("gradient.flags", gradient.flags == 0)?;
        if (gradient.width, gradient.height) != (width, height) {
            let found = format!("{}x{}", gradient.width, gradient.height);
            let allowed = format!("the camera's size, {width}x{height}");
            return Err(Error::argument("gradient.size", found, allowed));
        }
        let plane = |name: &str, first: *const c_void, row_stride: usize, channels: usize| -> Result<Plane> {
            if first.is_null() {
                return Ok(None);
            }
            let pixel = channels * size_of::<f32>();
            let argument = format!("gradient.{name}");
            let (_, stride) = extent(&argument, "_row_stride", width, height, row_stride, pixel)?;
            Ok(Some((first.cast(), stride)))
        };
        let planes = Self {
            color: plane("color", gradient.color, gradient.color_row_stride, 3)?,
            alpha: plane("alpha", gradient.alpha, gradient.alpha_row_stride, 1)?,
            depth: plane("depth", gradient.depth, gradient.depth_row_stride, 1)?,
            loss: gradient.loss,
            loss_user: gradient.loss_user,
        };
        if planes.color.is_none() && planes.alpha.is_none() && planes.depth.is_none() {
            let found = "neither color nor alpha nor depth";
            return Err(Error::argument("gradient", found, "at least one of them"));
        }
        if planes.loss.is_some() && !has_target {
            let allowed = "a vg_image_target, because gradient.loss reads the picture";
            return Err(Error::argument("target", "NULL", allowed));
        }
        Ok(planes)
    }

    /// Copies the numbers; the first one that is not finite is an error.
    unsafe fn copy(&self, to: &mut PictureGradient) -> Result<()> {
        let width = to.width as usize;
        unsafe {
            if let Some(plane) = self.color {
                copy("color", plane, width, to.color_mut())?;
            }
            if let Some(plane) = self.alpha {
                copy("alpha", plane, width, to.alpha_mut())?;
            }
            if let Some(plane) = self.depth {
                copy("depth", plane, width, to.depth_mut())?;
            }
        }
        Ok(())
    }
}

/// Copies row by row, because the gaps between rows must not be read and the address may be unaligned.
unsafe fn copy<T: bytemuck::Pod>(
    name: &str,
    (first, stride): (*const u8, usize),
    width: usize,
    to: &mut [T],
) -> Result<()> {
    for (v, row) in to.chunks_exact_mut(width).enumerate() {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(row);
        unsafe { std::ptr::copy_nonoverlapping(first.add(v * stride), bytes.as_mut_ptr(), bytes.len()) };
        let values: &[f32] = bytemuck::cast_slice(row);
        if let Some(i) = values.iter().position(|value| !value.is_finite()) {
            let u = i / (size_of::<T>() / size_of::<f32>());
            let found = values[i].to_string();
            return Err(Error::argument(format!("gradient.{name}[{v}][{u}]"), found, "finite numbers"));
        }
    }
    Ok(())
}

/// The caller's arrays, checked.
struct Arrays(vg_gradients);

impl Arrays {
    unsafe fn read(out: *const vg_gradients, gaussians: &Gaussians) -> Result<Self> {
        let out = unsafe { read::required("out", out)? };
        read::zero("out.flags", out.flags == 0)?;
        let gaussian_arrays = [out.positions, out.scales, out.rotations, out.opacities, out.sh];
        let other_arrays = [out.background, out.pose, out.view_matrix];
        let wants_gaussians = gaussian_arrays.iter().any(|array| !array.is_null());
        if !wants_gaussians && other_arrays.iter().all(|array| array.is_null()) {
            return Err(Error::argument("out", "no array", "at least one of them"));
        }
        if wants_gaussians && out.count != gaussians.len() {
            let allowed = format!("{}, as many as there are Gaussians", gaussians.len());
            return Err(Error::argument("out.count", out.count.to_string(), allowed));
        }
        if !out.sh.is_null() && out.sh_degree != i32::from(gaussians.sh_degree()) {
            let allowed = format!("{}, the Gaussians'", gaussians.sh_degree());
            return Err(Error::argument("out.sh_degree", out.sh_degree.to_string(), allowed));
        }
        Ok(Self(out))
    }

    fn written(&self, gaussians: &Gaussians) -> Vec<Written> {
        let (out, n) = (&self.0, gaussians.len());
        vec![
            Written::array("out.positions", out.positions, 3 * n),
            Written::array("out.scales", out.scales, 3 * n),
            Written::array("out.rotations", out.rotations, 4 * n),
            Written::array("out.opacities", out.opacities, n),
            Written::array("out.sh", out.sh, gaussians.sh().len()),
            Written::array("out.background", out.background, 3),
            Written::array("out.pose", out.pose, 6),
            Written::array("out.view_matrix", out.view_matrix, 16),
        ]
    }

    unsafe fn write(&self, from: &Gradients) {
        let pose = [from.pose.rotation, from.pose.translation].map(|v| v.to_array());
        unsafe {
            write(self.0.positions, from.means.as_flattened());
            write(self.0.scales, from.scales.as_flattened());
            write(self.0.rotations, from.rotations.as_flattened());
            write(self.0.opacities, &from.opacities);
            write(self.0.sh, &from.sh);
            write(self.0.background, &from.background);
            write(self.0.pose, pose.as_flattened());
            write(self.0.view_matrix, from.pose.view_matrix.as_flattened());
        }
    }
}

/// Writes to any address, aligned or not; does nothing if it is NULL.
unsafe fn write<T: Copy>(to: *mut T, values: &[T]) {
    if !to.is_null() {
        unsafe {
            std::ptr::copy_nonoverlapping(values.as_ptr().cast::<u8>(), to.cast(), size_of_val(values));
        };
    }
}
