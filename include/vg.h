/*
 * vg.h - vehicle Gaussians: a few posed, masked photographs of one side of a vehicle in, a complete metric 3D
 * Gaussian model out, drawn from any camera.
 *
 * This file is generated from src/capi by cbindgen; a test compares the two. License: MIT or Apache-2.0.
 *
 *     vg_gaussians *car = NULL;
 *     vg_error *error = NULL;
 *     if (vg_reconstruct(views, 4, NULL, &car, NULL, &error) != VG_STATUS_OK) {
 *         fprintf(stderr, "%s\n", vg_error_message(error));
 *         vg_error_free(error);
 *     } else {
 *         vg_gaussians_save_ply(car, "car.ply", NULL);
 *     }
 *     vg_gaussians_free(car);
 *
 * CONVENTIONS
 *
 * Frames.    The vehicle frame has x forward, y left, z up, right-handed; its plane of symmetry is y = 0. The camera
 *            frame has x right, y down, z forward (COLMAP, OpenCV, ROS optical frames). Metres throughout.
 *
 * Poses.     Camera to vehicle: p_vehicle = R p_camera + t, as the first three rows [R | t] of a 4x4 matrix, double,
 *            ROW-MAJOR. (Eigen's default is column-major; cv::Mat is row-major.) Quaternions are w, x, y, z.
 *            COLMAP stores world to camera and nerfstudio stores OpenGL axes: vg_pose_from_colmap and
 *            vg_pose_from_opengl convert; OpenCV's rvec and tvec: vg_pose_from_opencv. A tracked, moving vehicle:
 *            vg_pose_from_box. A camera that is placed by hand: vg_pose_look_at.
 *
 * Pixels.    Column u counts right, row v counts down, row 0 is the top row. The centre of the top-left pixel is
 *            (0.5, 0.5), as in COLMAP. OpenCV puts it at (0, 0): vg_camera_from_opencv converts.
 *
 * Images.    8-bit channels are sRGB-encoded and stay so; nothing is linearised. Any row stride, any alignment. The
 *            library reads them during the call and neither changes nor keeps them.
 *
 * Masks.     One byte a pixel: 128 and above is vehicle, or 1 of 0 and 1. See vg_view for what no mask means.
 *
 * Depth.     float32, planar, along the optical axis, metres. 0, negative, NaN and infinite mean no measurement.
 *
 * Gaussians. float32, structure of arrays, aligned to 4 bytes: centres, standard deviations, and unit quaternions
 *            (w, x, y, z) that turn the Gaussian's axes to the vehicle's; covariance = R diag(scale^2) R^T. Opacity
 *            is linear, 0 to 1. The colour in unit direction d, from the camera to the Gaussian, is
 *            max(0, 0.5 + sum_k sh_k Y_k(d)), with the basis, order and signs of 3D Gaussian Splatting, sRGB-encoded.
 *
 * Renders.   sRGB-encoded like the photographs. Transparent pictures have straight alpha or, if asked for,
 *            premultiplied; opaque ones have alpha 1. 8-bit values are rounded and clamped; RGBA32F is not clamped
 *            above 1.
 *
 * Gradients. Of one scalar, a loss, with respect to the number as the library holds it: float32 for pictures and
 *            Gaussians, laid out as they are, double for camera and background. vg_render_backward.
 *
 * Ownership. Whoever receives a handle through an out parameter frees it with the matching _free function, which
 *            accepts NULL. Pointers that a function returns are borrowed: they live as long as the handle they were
 *            asked of. transform, mirror, merge, select, mask and crop return new handles. No struct owns what it
 *            points to.
 *
 * NULL.      Allowed where a comment says what it means; everywhere else it is an error, never a crash.
 *
 * Threads.   Handles never change after they are made. Any number of threads may use one handle at a time, a
 *            vg_context too; only its _free must come last. Worker threads belong to a context and end with it; a
 *            context of one thread has none and works on the calling thread, which needs 1 MiB of stack. Calls that
 *            name no context share one of the process, with a thread per core, which the first of them makes and
 *            vg_default_context_free ends. Where the system starts no thread, that is VG_STATUS_THREADS. Worker
 *            threads block signals, so that handlers run on the host's threads. The library has no other state, and
 *            does not touch signal handlers, errno, the locale, standard output or standard error. Callbacks come on
 *            the calling thread.
 *
 * Forks.     In the child, a context or vg_model of the parent is VG_STATUS_ARGUMENT, and freeing it does nothing;
 *            Gaussians, scenes, reports, and calls that name no context, work as they did. A vg_renderer that draws
 *            on a graphics processor must not be used there.
 *
 * Unloading. dlclose is allowed once no call is running, but the code stays in memory: threads that called the
 *            library run destructors of it when they end. The library is linked with -z nodelete, and so must be a
 *            shared object that is linked with libvg.a, unless it is never unloaded.
 *
 * Networks.  vg_model_open loads ONNX Runtime, a shared library, when the first model is opened and not before; it
 *            stays loaded until the process ends. A vg_model is a handle like the others; its threads are the
 *            runtime's own.
 *
 * Errors.    Functions that can fail return a vg_status and, through out_error, an object with a message: which
 *            argument, what was found, what is allowed. On failure, out handles are NULL, and everything the caller
 *            owns is as it was, but for a picture that a vg_loss_fn was shown. out_error may be NULL. A bug in the library is a status too; it neither aborts nor
 *            throws. Running out of memory aborts, as it does in most programs.
 *
 * Same bytes. The same input and the same options give the same bytes, with any number of threads, on the same
 *            processor family; other processors differ in the last bits. Times and memory in the report differ. What
 *            a budget leaves out depends on how fast the machine is; the report's settings, without the budget,
 *            give the same bytes again. With a vg_model this holds on one machine, with one ONNX Runtime
 *            and the same model options.
 *
 * Versions.  Functions, enumerators and fields are added and never change. A struct that may grow begins with
 *            struct_size: call its _init function with sizeof, then set what you need. An older program's shorter
 *            struct is read as far as it goes, and the rest has its default; a newer program's longer struct is
 *            accepted where what lies beyond is zero. Arrays of structs step by the first element's struct_size.
 *            Enumerations travel as int32_t, and fields called flags or reserved must be zero. Incompatible changes
 *            change VG_ABI_VERSION and the library's file name, libvg.so.0.
 */


#ifndef VG_H
#define VG_H

#include <stddef.h>
#include <stdint.h>
#if defined(_WIN32) && defined(VG_SHARED)
#define VG_API __declspec(dllimport)
#else
#define VG_API
#endif


/**
 * Major part of the version of this header.
 */
#define VG_VERSION_MAJOR 0

/**
 * Minor part of the version of this header.
 */
#define VG_VERSION_MINOR 1

/**
 * Patch part of the version of this header.
 */
#define VG_VERSION_PATCH 0

/**
 * Number of the binary interface: the number in `libvg.so.0`. Programs built against any header with this number
 * run with any library of this number that is as new or newer.
 */
#define VG_ABI_VERSION 0

/**
 * What a function returns. Numbers are never reused; later versions may add some, so treat an unknown one as a
 * failure.
 */
enum vg_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Done.
     */
    VG_STATUS_OK = 0,
    /**
     * An argument is outside what the function accepts.
     */
    VG_STATUS_ARGUMENT = 1,
    /**
     * A file's content is not what its format promises.
     */
    VG_STATUS_FORMAT = 2,
    /**
     * The operating system refused a file operation.
     */
    VG_STATUS_IO = 3,
    /**
     * The input is well formed, but no vehicle can be made of it.
     */
    VG_STATUS_RECONSTRUCTION = 4,
    /**
     * The progress callback asked to stop.
     */
    VG_STATUS_CANCELLED = 5,
    /**
     * This build of the library was made without what was asked for.
     */
    VG_STATUS_NOT_BUILT = 6,
    /**
     * A bug in the library. The call had no effect; other handles are as they were.
     */
    VG_STATUS_INTERNAL = 7,
    /**
     * What was asked for needs something that this machine does not have: ONNX Runtime, a device.
     */
    VG_STATUS_MISSING = 8,
    /**
     * The operating system did not start the threads that were asked for.
     */
    VG_STATUS_THREADS = 9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_status vg_status;
#else
typedef int32_t vg_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a pixel holds. 8-bit channels are sRGB-encoded, as cameras and picture files have them.
 */
enum vg_format
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * uint8 R, G, B.
     */
    VG_FORMAT_RGB8 = 1,
    /**
     * uint8 B, G, R (OpenCV).
     */
    VG_FORMAT_BGR8 = 2,
    /**
     * uint8 R, G, B, A; alpha is straight.
     */
    VG_FORMAT_RGBA8 = 3,
    /**
     * uint8 B, G, R, A; alpha is straight.
     */
    VG_FORMAT_BGRA8 = 4,
    /**
     * uint8 luminance; the format of masks.
     */
    VG_FORMAT_GRAY8 = 5,
    /**
     * float32 R, G, B, A; sRGB-encoded, 0 to 1.
     */
    VG_FORMAT_RGBA32F = 6,
    /**
     * float32 planar depth along the optical axis, metres; 0, negative, NaN and infinite mean no measurement.
     */
    VG_FORMAT_DEPTH32F = 7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_format vg_format;
#else
typedef int32_t vg_format;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * COLMAP's camera models and their numbers. Undistort pictures of other models first, with
 * `colmap image_undistorter`.
 */
enum vg_camera_model
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * f, cx, cy
     */
    VG_CAMERA_MODEL_SIMPLE_PINHOLE = 0,
    /**
     * fx, fy, cx, cy
     */
    VG_CAMERA_MODEL_PINHOLE = 1,
    /**
     * f, cx, cy, k
     */
    VG_CAMERA_MODEL_SIMPLE_RADIAL = 2,
    /**
     * f, cx, cy, k1, k2
     */
    VG_CAMERA_MODEL_RADIAL = 3,
    /**
     * fx, fy, cx, cy, k1, k2, p1, p2
     */
    VG_CAMERA_MODEL_OPENCV = 4,
    /**
     * fx, fy, cx, cy, k1, k2, k3, k4
     */
    VG_CAMERA_MODEL_OPENCV_FISHEYE = 5,
    /**
     * fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
     */
    VG_CAMERA_MODEL_FULL_OPENCV = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_camera_model vg_camera_model;
#else
typedef int32_t vg_camera_model;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Where a model runs.
 */
enum vg_provider
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The processor.
     */
    VG_PROVIDER_CPU = 0,
    /**
     * The first CUDA device, where ONNX Runtime was built for it.
     */
    VG_PROVIDER_CUDA = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_provider vg_provider;
#else
typedef int32_t vg_provider;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Whether a model's weights are rearranged for speed when it is opened, which can take as much memory again.
 */
enum vg_prepack
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Where its files take less than 1 GiB.
     */
    VG_PREPACK_AUTO = 0,
    /**
     * Whatever their size.
     */
    VG_PREPACK_ALWAYS = 1,
    /**
     * They stay as they are.
     */
    VG_PREPACK_NEVER = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_prepack vg_prepack;
#else
typedef int32_t vg_prepack;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Where metric depth comes from.
 */
enum vg_prior
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * `VG_PRIOR_GIVEN` if every used view has depth, else `VG_PRIOR_SHAPE`. Where some views have depth, it counts as
     * measured points, to which the shape bends, and `log` is told.
     */
    VG_PRIOR_AUTO = 0,
    /**
     * The depth in the views.
     */
    VG_PRIOR_GIVEN = 1,
    /**
     * The hull of the silhouettes and their mirrored twins; needs masks and nothing else.
     */
    VG_PRIOR_HULL = 2,
    /**
     * The network of `vg_options.prior_model`. `VG_STATUS_NOT_BUILT` in a build without networks.
     */
    VG_PRIOR_ONNX = 3,
    /**
     * The hull, corrected by what vehicles look like; needs masks and nothing else.
     */
    VG_PRIOR_SHAPE = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_prior vg_prior;
#else
typedef int32_t vg_prior;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Whether cameras and the plane of symmetry are corrected before anything else.
 */
enum vg_calibrate
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Where the silhouettes do not agree, and agree better with the correction.
     */
    VG_CALIBRATE_AUTO = 0,
    /**
     * The cameras are taken as they are.
     */
    VG_CALIBRATE_OFF = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_calibrate vg_calibrate;
#else
typedef int32_t vg_calibrate;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How the side that was not photographed is completed across the plane y = 0.
 */
enum vg_symmetry
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * What no view observed is mirrored; what the other side shows at 1.03 times the resolution gives way.
     */
    VG_SYMMETRY_AUTO = 0,
    /**
     * The side with more Gaussians replaces the other, whatever was observed there.
     */
    VG_SYMMETRY_ALWAYS = 1,
    /**
     * Nothing is mirrored.
     */
    VG_SYMMETRY_NEVER = 2,
    /**
     * The photographs are mirrored instead of the model, and taken for further views: slower, and rarely better.
     */
    VG_SYMMETRY_FLIP = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_symmetry vg_symmetry;
#else
typedef int32_t vg_symmetry;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Whether mirror images are shown in the light of their own side.
 */
enum vg_relight
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * As far as the light can be told from what was seen.
     */
    VG_RELIGHT_AUTO = 0,
    /**
     * They keep the light of the side that was seen.
     */
    VG_RELIGHT_NEVER = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_relight vg_relight;
#else
typedef int32_t vg_relight;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How front and back are told apart.
 */
enum vg_heading
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * By shape; where the other way round fits as well, it is an error that names the view to look at.
     */
    VG_HEADING_AUTO = 0,
    /**
     * The first view by name, of those not taken from abeam, was taken from ahead of the vehicle's middle.
     */
    VG_HEADING_FORWARD = 1,
    /**
     * It was taken from behind the middle.
     */
    VG_HEADING_BACKWARD = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_heading vg_heading;
#else
typedef int32_t vg_heading;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What may not be left out although the scene does not need it; bits of `vg_options.keep`.
 */
enum vg_keep
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Views whose camera another view already has.
     */
    VG_KEEP_DUPLICATE_VIEWS = 1,
    /**
     * Pixels that another view shows at a higher resolution.
     */
    VG_KEEP_OVERLAP = 2,
    /**
     * Pixels on the silhouette's edge.
     */
    VG_KEEP_SILHOUETTE_EDGE = 4,
    /**
     * Floating pixels at depth edges.
     */
    VG_KEEP_FLOATERS = 8,
    /**
     * Bands of colour that the spread of viewing directions cannot support.
     */
    VG_KEEP_SH_BANDS = 16,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_keep vg_keep;
#else
typedef int32_t vg_keep;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How important a log line is.
 */
enum vg_log_level
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Legal, but looks like a mistake.
     */
    VG_LOG_LEVEL_WARNING = 1,
    /**
     * What was done or left out.
     */
    VG_LOG_LEVEL_INFO = 2,
    /**
     * Times of stages.
     */
    VG_LOG_LEVEL_DEBUG = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_log_level vg_log_level;
#else
typedef int32_t vg_log_level;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What became of the correction of the cameras.
 */
enum vg_calibration
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * None was looked for: it was switched off, or these views cannot be calibrated.
     */
    VG_CALIBRATION_NONE = 0,
    /**
     * The silhouettes agree already.
     */
    VG_CALIBRATION_NOT_NEEDED = 1,
    /**
     * The cameras were moved.
     */
    VG_CALIBRATION_ACCEPTED = 2,
    /**
     * A correction was estimated and thrown away.
     */
    VG_CALIBRATION_REFUSED = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_calibration vg_calibration;
#else
typedef int32_t vg_calibration;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Why a refinement ended.
 */
enum vg_refine_stop
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * All steps are done.
     */
    VG_REFINE_STOP_DONE = 0,
    /**
     * The view that took no part got no better any more.
     */
    VG_REFINE_STOP_HELD_OUT = 1,
    /**
     * The error grew far beyond where it began; the best of the states before is returned.
     */
    VG_REFINE_STOP_DIVERGED = 2,
    /**
     * No view sees anything of the model: it is as it was.
     */
    VG_REFINE_STOP_UNSEEN = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_refine_stop vg_refine_stop;
#else
typedef int32_t vg_refine_stop;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Whether a reconstruction is to be believed.
 */
enum vg_verdict
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing looks wrong.
     */
    VG_VERDICT_GOOD = 0,
    /**
     * Nothing looks wrong, but `vg_options.check` was 0: views were not compared with one another.
     */
    VG_VERDICT_UNCHECKED = 1,
    /**
     * Something looks wrong; the model may still be of use.
     */
    VG_VERDICT_DOUBTFUL = 2,
    /**
     * The input contradicts itself, or describes no road vehicle.
     */
    VG_VERDICT_BAD = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_verdict vg_verdict;
#else
typedef int32_t vg_verdict;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What draws.
 */
enum vg_backend
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * What is best of what this build and this machine have; for a single picture the CPU.
     */
    VG_BACKEND_AUTO = 0,
    /**
     * The context's threads.
     */
    VG_BACKEND_CPU = 1,
    /**
     * A graphics processor, or a driver that stands in for one. `VG_STATUS_NOT_BUILT` in a build without it,
     * `VG_STATUS_MISSING` on a machine without a driver.
     */
    VG_BACKEND_GPU = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_backend vg_backend;
#else
typedef int32_t vg_backend;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What shows where the vehicle does not.
 */
enum vg_background
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A colour; the picture is opaque, its alpha 1.
     */
    VG_BACKGROUND_COLOR = 0,
    /**
     * Nothing; the picture's alpha is how much of the pixel the vehicle covers.
     */
    VG_BACKGROUND_TRANSPARENT = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_background vg_background;
#else
typedef int32_t vg_background;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What the colours of a picture with a transparent background are multiplied by.
 */
enum vg_alpha
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * By nothing, as PNG files want it; 0 where alpha is 0.
     */
    VG_ALPHA_STRAIGHT = 0,
    /**
     * By alpha, as compositing wants it.
     */
    VG_ALPHA_PREMULTIPLIED = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_alpha vg_alpha;
#else
typedef int32_t vg_alpha;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a depth pixel means.
 */
enum vg_depth_mode
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Expected planar depth along the optical axis in metres; 0 where alpha is 0.
     */
    VG_DEPTH_MODE_EXPECTED = 0,
    /**
     * The same times alpha: the plain sum over the Gaussians.
     */
    VG_DEPTH_MODE_ACCUMULATED = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum vg_depth_mode vg_depth_mode;
#else
typedef int32_t vg_depth_mode;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Worker threads and scratch memory, made once and named in the options of calls, so that a call neither starts
 * threads nor allocates what the last one had. Any number of threads may use one context at a time. Free it with
 * `vg_context_free`, after the last call that uses it has returned; results do not depend on it.
 *
 * In a fork, a context of the parent is `VG_STATUS_ARGUMENT`, and freeing it does nothing.
 */
typedef struct vg_context vg_context;

/**
 * Why a call failed. Owned by the caller, who frees it with `vg_error_free`; it never changes, and any thread may
 * read it.
 */
typedef struct vg_error vg_error;

/**
 * A set of Gaussians. Owned by the caller, who frees it with `vg_gaussians_free`. It never changes: `transform`,
 * `mirror`, `merge`, `select`, `mask` and `crop` return new ones, and any number of threads may read or render one at a time.
 */
typedef struct vg_gaussians vg_gaussians;

/**
 * An open ONNX model; `vg_options.prior_model` and `vg_options.head_model` lend it to calls. Any number of threads
 * may use one model at a time, each with a context of its own or all with one; runs of the same model take turns. It
 * holds its weights and the threads of its options until it is freed. Free it with `vg_model_free`, after the last
 * call that uses it has returned; Gaussians and reports do not need it any more.
 */
typedef struct vg_model vg_model;

/**
 * Gaussians made ready to be drawn many times: where a graphics processor draws, they are in its memory, and its
 * kernels are compiled. Any number of threads may use one at a time. Free it with `vg_renderer_free`.
 */
typedef struct vg_renderer vg_renderer;

/**
 * What a reconstruction did, how long it took, what it left out, and the error it can know. Owned by the caller,
 * who frees it with `vg_report_free`; it never changes.
 */
typedef struct vg_report vg_report;

/**
 * Views read from files, with their pixels. Owned by the caller, who frees it with `vg_scene_free`; it never
 * changes, and any number of threads may read it.
 */
typedef struct vg_scene vg_scene;

/**
 * Settings of a context.
 */
typedef struct vg_context_options {
    /**
     * `sizeof(vg_context_options)`.
     */
    size_t struct_size;
    /**
     * Threads that work, 1 to 1024; 0: one per core that the process may use, by its affinity and the quotas of its
     * control groups. 1 is the calling thread, and none is started; of more, all are started, and the calling thread
     * waits while they work. Default 0.
     */
    uint32_t threads;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
} vg_context_options;

/**
 * A camera: its size, its lens, and where it stands. It lies inside `vg_view`, so its size never changes.
 */
typedef struct vg_camera {
    /**
     * `sizeof(vg_camera)`.
     */
    size_t struct_size;
    /**
     * Columns, 1 to 8192.
     */
    uint32_t width;
    /**
     * Rows, 1 to 8192.
     */
    uint32_t height;
    /**
     * A `vg_camera_model`.
     */
    int32_t model;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
    /**
     * The model's parameters in COLMAP's order, pixels; the rest must be 0. The centre of the top-left pixel is
     * (0.5, 0.5).
     */
    double params[16];
    /**
     * Camera to vehicle, the first three rows of a 4x4 matrix, row-major: r00 r01 r02 tx, r10 r11 r12 ty,
     * r20 r21 r22 tz; metres. A rotation up to 1e-2, which is removed; mirrors and scales are refused.
     */
    double vehicle_from_camera[12];
    /**
     * Reserved: 0.
     */
    uint64_t reserved[4];
} vg_camera;

/**
 * A picture that the library reads during the call and does not keep. All zero: no picture.
 */
typedef struct vg_image {
    /**
     * The first pixel of the top row. Any alignment. NULL: no picture; the other fields are not looked at.
     */
    const void *data;
    /**
     * Bytes from one row to the next (`cv::Mat::step`, ROS `Image.step`); 0: rows without gaps.
     */
    size_t row_stride;
    /**
     * Columns; must equal the camera's.
     */
    uint32_t width;
    /**
     * Rows; must equal the camera's.
     */
    uint32_t height;
    /**
     * A `vg_format`.
     */
    int32_t format;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
} vg_image;

/**
 * One photograph of the vehicle.
 */
typedef struct vg_view {
    /**
     * `sizeof(vg_view)`; the same in all elements of an array.
     */
    size_t struct_size;
    /**
     * UTF-8 name for messages and the report; NULL: none. Read during the call only, like all pointers here.
     */
    const char *name;
    /**
     * Lens and pose.
     */
    struct vg_camera camera;
    /**
     * The photograph, RGB8, BGR8, RGBA8, BGRA8 or GRAY8, of the camera's size. RGB8 without gaps between rows is
     * read in place; anything else is copied once.
     */
    struct vg_image image;
    /**
     * GRAY8, of the camera's size: 128 and above is vehicle; where no value is above 1, 1 is. A largest value between
     * is an error. `data` NULL: the photograph's alpha is the mask; where it has none, or one that is 255 throughout,
     * the outline of `depth` is, if that measures the vehicle alone (0 at the picture's border); else a
     * reconstruction is refused.
     */
    struct vg_image mask;
    /**
     * DEPTH32F, of the camera's size. `data` NULL: not measured.
     */
    struct vg_image depth;
} vg_view;

/**
 * How a model is opened.
 */
typedef struct vg_model_options {
    /**
     * `sizeof(vg_model_options)`.
     */
    size_t struct_size;
    /**
     * Path of ONNX Runtime, the library or its folder. NULL: what the environment variable `VG_ONNXRUNTIME` names,
     * else the one inside an installed Python package `onnxruntime`. A process has one: the first that was loaded,
     * which stays until the process ends. Default NULL.
     */
    const char *runtime;
    /**
     * A `vg_provider`. Default `VG_PROVIDER_CPU`.
     */
    int32_t provider;
    /**
     * 1: the processor steps in where the provider cannot be had; 0: that is `VG_STATUS_MISSING`. Default 0.
     */
    int32_t fall_back;
    /**
     * Threads of the runtime's own, held as long as the model is open, 1 to 1024; 0: one per core. Default 0.
     */
    uint32_t threads;
    /**
     * A `vg_prepack`. Default `VG_PREPACK_AUTO`.
     */
    int32_t prepack;
    /**
     * 1: the runtime keeps the memory of a run for the next one; 0: it gives it back. Default 0.
     */
    int32_t arena;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
} vg_model_options;

/**
 * Called on the calling thread: the stage's name, how much of it is done, 0 to 1, and the caller's pointer. Returns 0
 * to go on; anything else ends the call with `VG_STATUS_CANCELLED`. May call the library; may not throw or jump out.
 *
 * A reconstruction calls it at every stage boundary, inside long stages, and at the end. Calls of one stage call it at
 * the start, about every 50 ms, and with 1 at the end; they stop within some tenths of a second.
 */
typedef int32_t (*vg_progress_fn)(const char *stage,
                                  double fraction,
                                  void *user);

/**
 * Called on the calling thread with a `vg_log_level` and one line of UTF-8 that lives until it returns. May call
 * the library; may not throw or jump out.
 */
typedef void (*vg_log_fn)(int32_t level,
                          const char *message,
                          void *user);

/**
 * Settings of `vg_reconstruct`.
 */
typedef struct vg_options {
    /**
     * `sizeof(vg_options)`.
     */
    size_t struct_size;
    /**
     * Threads and memory to use. NULL: the process's own, one thread per core, see `vg_default_context_free`.
     */
    struct vg_context *context;
    /**
     * A `vg_prior`. Default `VG_PRIOR_AUTO`.
     */
    int32_t prior;
    /**
     * A `vg_symmetry`. Default `VG_SYMMETRY_AUTO`.
     */
    int32_t symmetry;
    /**
     * Highest degree of the colour's spherical harmonics, 0 to 3. Default 2.
     */
    int32_t sh_degree;
    /**
     * Bits of `vg_keep`. Default 0.
     */
    uint32_t keep;
    /**
     * 1: draw the model into its input views and report the error there; 0: do not. Default 1.
     */
    int32_t check;
    /**
     * 1: the report also holds the metric coloured point cloud; 0: it does not. Default 0.
     */
    int32_t points;
    /**
     * Length, width, height of the vehicle in metres, each 0.1 to 30, to a few centimetres; all 0: not known. The
     * silhouettes tell where a box of this size stands, and no part of the vehicle is placed outside of it. Default 0, 0,
     * 0.
     */
    double vehicle_size[3];
    /**
     * NULL: none.
     */
    vg_progress_fn progress;
    /**
     * Handed to `progress`.
     */
    void *progress_user;
    /**
     * NULL: none.
     */
    vg_log_fn log;
    /**
     * Handed to `log`.
     */
    void *log_user;
    /**
     * A `vg_calibrate`. Default `VG_CALIBRATE_AUTO`.
     */
    int32_t calibrate;
    /**
     * A `vg_relight`. Default `VG_RELIGHT_AUTO`.
     */
    int32_t relight;
    /**
     * 1: `VG_PRIOR_SHAPE` moves its surface to where the photographs agree; 0: it does not. Default 1.
     */
    int32_t photo;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
    /**
     * Seconds the call may take, above 0, where that matters: what is left out is then chosen to fit. 0: as long as
     * it takes. Default 0.
     */
    double budget_s;
    /**
     * Points measured on the vehicle, by LiDAR for one: float32 `[cloud_count][3]` without gaps, metres, vehicle
     * frame, in any order, all finite; some may be wrong or show something else. `VG_PRIOR_SHAPE` and
     * `VG_PRIOR_HULL` bend their surface to them; `VG_PRIOR_GIVEN` leaves them out. Copied during the call. Default
     * NULL: none.
     */
    const float *cloud;
    /**
     * How many points, at most 10000000; 0: none. Default 0.
     */
    size_t cloud_count;
    /**
     * Views are first resampled to this share of their width and height, above 0, at most 1. A `budget_s` may choose
     * less. Default 1.
     */
    double resolution;
    /**
     * At most this many views are used, those that spread best around the vehicle; 0: all. A `budget_s` may choose
     * fewer. Default 0.
     */
    size_t max_views;
    /**
     * The network that tells depth, for `VG_PRIOR_ONNX` and no other prior. Default NULL: none.
     */
    const struct vg_model *prior_model;
    /**
     * The network that makes Gaussians of pixels. Default NULL: none; each pixel becomes a disc on the surface.
     */
    const struct vg_model *head_model;
    /**
     * Seconds, about, for optimising the model against the photographs, above 0: a number of steps is found that fits,
     * and `vg_report_figures.refine_iterations` tells it. In addition to `budget_s`. 0: none. Default 0.
     */
    double refine_seconds;
    /**
     * The same as a number of steps, at most 1000000, which the same input answers with the same bytes; not with
     * `refine_seconds`. 0: none. Default 0.
     */
    uint32_t refine_iterations;
    /**
     * 1: one of three or more views takes no part in the optimisation and tells when to stop; 0: all do. Default 0.
     */
    int32_t refine_hold_out;
    /**
     * A `vg_backend`: who draws and goes back in the optimisation. Default `VG_BACKEND_AUTO`: what is known to pay, at
     * present the CPU. `VG_BACKEND_GPU` answers the same input on the same device with the same bytes.
     */
    int32_t refine_backend;
    /**
     * Must be 0.
     */
    uint32_t refine_flags;
    /**
     * Centre of a box of `vehicle_size` in the frame of the cameras, metres, looked at where `has_vehicle_place` is 1. It
     * is believed to a few decimetres, as a tracked box is. Default 0, 0, 0.
     */
    double vehicle_center[3];
    /**
     * Turn of that box about z, from the frame's x axis to the vehicle's, radians, at most 2 pi either way. The box's
     * middle plane, not y = 0, is then the plane of symmetry; the result is in the frame of the cameras all the same.
     * Default 0.
     */
    double vehicle_yaw;
    /**
     * 1: the box stands at `vehicle_center`, turned by `vehicle_yaw`; 0: its place is not known. 1 needs a
     * `vehicle_size`. Default 0.
     */
    int32_t has_vehicle_place;
    /**
     * Must be 0.
     */
    uint32_t vehicle_flags;
    /**
     * NULL, or where the part of the whole call that is done is written before each call of `progress`: 0 to 1, in
     * expected time; it never falls, and is 1 in the last call.
     */
    double *progress_overall;
    /**
     * Most Gaussians that the model may have by what the masks of the used views say of its size: twice their vehicle
     * pixels, or six times those of the largest mask, whichever is less. Where that is more, the views are resampled to
     * fewer pixels before the work, and the log and the report say so. 0: any number. Default 12000000, whose PLY file
     * would have 2 GB.
     */
    size_t max_gaussians;
} vg_options;

/**
 * The main figures of a report.
 */
typedef struct vg_report_figures {
    /**
     * `sizeof(vg_report_figures)`.
     */
    size_t struct_size;
    /**
     * Gaussians in the result.
     */
    uint64_t gaussian_count;
    /**
     * How many of them are mirror images.
     */
    uint64_t mirrored_count;
    /**
     * Views used; the JSON tells which, and why others were not.
     */
    uint32_t views_used;
    /**
     * Worker threads.
     */
    uint32_t threads;
    /**
     * The `vg_prior` that was used.
     */
    int32_t prior;
    /**
     * Degree of the result's spherical harmonics.
     */
    int32_t sh_degree;
    /**
     * Wall time of the call, milliseconds.
     */
    double total_ms;
    /**
     * Highest resident memory of the process so far, bytes; 0 where the system does not tell.
     */
    uint64_t peak_rss_bytes;
    /**
     * 1 if the `input_` fields hold the error on the input views, 0 if the check was switched off.
     */
    int32_t has_input_error;
    /**
     * 1 if the prior looked for the vehicle in a box whose size follows below.
     */
    int32_t has_box;
    /**
     * Mean PSNR over the used views, drawn by the cameras that were used, on white, full frame, dB.
     */
    double input_psnr_db;
    /**
     * Mean intersection over union of the model's silhouette and the masks.
     */
    double input_silhouette_iou;
    /**
     * Length, width, height of the box that the prior looked for the vehicle in, metres: larger than the vehicle, whose own
     * size is `vehicle_size`.
     */
    double box_size[3];
    /**
     * Lowest corner of the Gaussians' centres, metres.
     */
    double extent_low[3];
    /**
     * Highest corner of the Gaussians' centres, metres.
     */
    double extent_high[3];
    /**
     * Mirror images that were shown in the light of their own side.
     */
    uint64_t relit_count;
    /**
     * Points of the cloud that the prior's surface was moved to.
     */
    uint64_t cloud_used;
    /**
     * Places that the photographs agree on, to which the prior's surface was moved.
     */
    uint64_t photo_found;
    /**
     * A `vg_calibration`.
     */
    int32_t calibration;
    /**
     * 1 if `uncovered_before` and `uncovered_after` hold what the prior's surface left open of the masks.
     */
    int32_t has_uncovered;
    /**
     * Rotation about z that brings the plane of symmetry that was found onto y = 0, degrees; of a refused
     * correction, what was refused.
     */
    double calibration_yaw_degrees;
    /**
     * Shift along y that does, metres.
     */
    double calibration_lateral_m;
    /**
     * Part of the vehicle's pixels that the prior's surface did not cover, 0 to 1.
     */
    double uncovered_before;
    /**
     * The same after the surface was raised to meet them.
     */
    double uncovered_after;
    /**
     * Steps that the optimisation planned, also for `refine_seconds`; 0 where none was asked for.
     */
    uint32_t refine_iterations;
    /**
     * Steps that the result has seen; 0 if nothing was better than the beginning.
     */
    uint32_t refine_kept;
    /**
     * Length, width, height of the vehicle, metres; outer mirrors are often missing from the width. 0, 0, 0 where
     * `has_vehicle_size` is 0.
     */
    double vehicle_size[3];
    /**
     * Their expected errors, metres.
     */
    double vehicle_size_uncertainty[3];
    /**
     * 1 if `vehicle_size` holds the vehicle's size.
     */
    int32_t has_vehicle_size;
    /**
     * 1 if `vg_options.budget_s` was kept, or there was none; 0 if the call took longer.
     */
    int32_t budget_kept;
    /**
     * The least part of a view's mask that is drawn, 0 to 1, by the cameras that were used.
     */
    double input_mask_covered;
    /**
     * `input_psnr_db` as drawn by the caller's own cameras: it differs where the calibration moved them.
     */
    double input_given_psnr_db;
    /**
     * `input_silhouette_iou` as drawn by the caller's own cameras.
     */
    double input_given_silhouette_iou;
    /**
     * `input_mask_covered` as drawn by the caller's own cameras.
     */
    double input_given_mask_covered;
    /**
     * A `vg_verdict`; `vg_report_reason` tells why it is not good.
     */
    int32_t verdict;
    /**
     * How many reasons there are.
     */
    uint32_t reason_count;
} vg_report_figures;

/**
 * Arrays to make Gaussians from; read during the call and not kept.
 */
typedef struct vg_gaussian_arrays {
    /**
     * `sizeof(vg_gaussian_arrays)`.
     */
    size_t struct_size;
    /**
     * How many Gaussians, at most 2147483647. The pointers may be NULL where it is 0.
     */
    size_t count;
    /**
     * Centres, metres. `[count][3]`
     */
    const float *positions;
    /**
     * Standard deviations along the Gaussian's own axes, metres, above 0. `[count][3]`
     */
    const float *scales;
    /**
     * Quaternions w, x, y, z of any norm but zero; stored normalised. `[count][4]`
     */
    const float *rotations;
    /**
     * Peak opacities, 0 to 1. `[count]`
     */
    const float *opacities;
    /**
     * Coefficients of spherical harmonics. `[count][(sh_degree + 1)^2][3]`
     */
    const float *sh;
    /**
     * 0 to 3.
     */
    int32_t sh_degree;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
} vg_gaussian_arrays;

/**
 * Settings of `vg_refine`.
 */
typedef struct vg_refine_options {
    /**
     * `sizeof(vg_refine_options)`.
     */
    size_t struct_size;
    /**
     * Threads and memory to use. NULL: made for this call, one thread per core.
     */
    struct vg_context *context;
    /**
     * Seconds the call may take, about, up to 86400: a number of steps is found that fits. 0: as many steps as
     * `iterations` says. Default 0.
     */
    double seconds;
    /**
     * Steps, at most 1000000, which the same input answers with the same bytes; not looked at where `seconds` is
     * above 0. Default 300.
     */
    uint32_t iterations;
    /**
     * 1: one of three or more views takes no part and tells when to stop; 0: all do. Default 0.
     */
    int32_t hold_out;
    /**
     * 1: Gaussians divide and go on the way, so that the result has another number of them; 0: they keep their number
     * and order. Default 0.
     */
    int32_t densify;
    /**
     * A `vg_backend`: who draws and goes back. Default `VG_BACKEND_AUTO`: what is known to pay, at present the CPU.
     */
    int32_t backend;
    /**
     * NULL: none.
     */
    vg_progress_fn progress;
    /**
     * Handed to `progress`.
     */
    void *progress_user;
    /**
     * Reserved: 0.
     */
    uint64_t flags;
} vg_refine_options;

/**
 * What a refinement did; NAN where a measure does not exist.
 */
typedef struct vg_refinement {
    /**
     * `sizeof(vg_refinement)`.
     */
    size_t struct_size;
    /**
     * Steps that were planned: `vg_refine_options.iterations` of this number does the same again.
     */
    uint32_t iterations;
    /**
     * Steps that were made.
     */
    uint32_t made;
    /**
     * Steps that the result has seen; 0 if nothing was better than the beginning.
     */
    uint32_t kept;
    /**
     * A `vg_refine_stop`.
     */
    int32_t stop;
    /**
     * Mean PSNR of the views that took part, each in its exposure, before, dB.
     */
    double psnr_before_db;
    /**
     * The same after.
     */
    double psnr_after_db;
    /**
     * PSNR of the view that was held out before, dB; NAN without one.
     */
    double held_out_before_db;
    /**
     * The same after.
     */
    double held_out_after_db;
} vg_refinement;

/**
 * Settings of `vg_render`.
 */
typedef struct vg_render_options {
    /**
     * `sizeof(vg_render_options)`.
     */
    size_t struct_size;
    /**
     * Threads and memory to use. NULL: the process's own, one thread per core, see `vg_default_context_free`.
     */
    struct vg_context *context;
    /**
     * A `vg_backend`. Default `VG_BACKEND_AUTO`. Where pictures follow each other a `vg_renderer` is faster: a graphics
     * processor is sent the Gaussians once, and here with each call.
     */
    int32_t backend;
    /**
     * A `vg_background`. Default `VG_BACKGROUND_COLOR`.
     */
    int32_t background;
    /**
     * The colour, R G B, sRGB-encoded, each 0 to 1. Default white.
     */
    float background_color[3];
    /**
     * A `vg_alpha`; matters where the background is transparent. Default `VG_ALPHA_STRAIGHT`.
     */
    int32_t alpha;
    /**
     * A `vg_depth_mode`. Default `VG_DEPTH_MODE_EXPECTED`.
     */
    int32_t depth_mode;
    /**
     * Bands of colour above this degree are left out, 0 to 3. Default 3: all there are.
     */
    int32_t sh_degree;
    /**
     * 1: compensate opacity for the blur; for pictures much smaller than the photographs. Default 0.
     */
    int32_t antialiased;
    /**
     * Variance added to each projected Gaussian, pixels^2, 1e-4 to 100. Default 0.3.
     */
    float blur;
    /**
     * Gaussians whose centre is nearer along the optical axis are not drawn, metres, 1e-6 to 1e10. Default 0.01.
     */
    float near_plane;
    /**
     * Gaussians whose centre is farther are not drawn, metres, `near_plane` to 1e10. Default 1e10.
     */
    float far_plane;
    /**
     * Largest alpha of one Gaussian in one pixel, 0.01 to 0.9999. Default 0.99.
     */
    float max_alpha;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
    /**
     * Called in the course of the call, see `vg_progress_fn`. NULL: none.
     */
    vg_progress_fn progress;
    /**
     * Handed to `progress`.
     */
    void *progress_user;
} vg_render_options;

/**
 * Where `vg_render` puts the picture: colour, depth, alpha, or several of them, which share no byte; rows of one may
 * lie in the gaps of another.
 */
typedef struct vg_image_target {
    /**
     * `sizeof(vg_image_target)`.
     */
    size_t struct_size;
    /**
     * Columns; must equal the camera's.
     */
    uint32_t width;
    /**
     * Rows; must equal the camera's.
     */
    uint32_t height;
    /**
     * The first pixel of the top row. Any alignment. NULL: no colour.
     */
    void *color;
    /**
     * Bytes from one row to the next; 0: rows without gaps. What lies between rows is not touched.
     */
    size_t color_row_stride;
    /**
     * The first depth pixel of the top row, float32, see `vg_depth_mode`. Any alignment. NULL: no depth.
     */
    void *depth;
    /**
     * Bytes from one row to the next; 0: rows without gaps.
     */
    size_t depth_row_stride;
    /**
     * RGBA8, BGRA8 or RGBA32F; with an opaque background RGB8 and BGR8 too.
     */
    int32_t color_format;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
    /**
     * The first alpha of the top row, float32: how much of the pixel the vehicle covers, 0 to 1, whatever the
     * background. Any alignment. NULL: no alpha.
     */
    void *alpha;
    /**
     * Bytes from one row to the next; 0: rows without gaps.
     */
    size_t alpha_row_stride;
} vg_image_target;

/**
 * Settings of a renderer.
 */
typedef struct vg_renderer_options {
    /**
     * `sizeof(vg_renderer_options)`.
     */
    size_t struct_size;
    /**
     * Threads to make ready with. NULL: the process's own, one per core, see `vg_default_context_free`.
     */
    struct vg_context *context;
    /**
     * A `vg_backend`. Default `VG_BACKEND_AUTO`: a graphics processor where this build and this machine have one and
     * there are 20,000 Gaussians or more, else the CPU; should the device fail later, the CPU goes on.
     */
    int32_t backend;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
} vg_renderer_options;

/**
 * Called once on the calling thread when the picture is in `target`; fills the planes that the `vg_image_gradient`
 * points to. Returns 0 to go on; anything else ends the call with `VG_STATUS_CANCELLED`. May call the library, with
 * the same context too; may not throw or jump out.
 */
typedef int32_t (*vg_loss_fn)(void *user);

/**
 * Gradient of a loss with respect to a picture, which the library reads during the call and does not keep. Finite
 * numbers of any sign; a plane that is NULL is one the loss does not look at.
 */
typedef struct vg_image_gradient {
    /**
     * `sizeof(vg_image_gradient)`.
     */
    size_t struct_size;
    /**
     * Columns; must equal the camera's.
     */
    uint32_t width;
    /**
     * Rows; must equal the camera's.
     */
    uint32_t height;
    /**
     * dL / dcolour, float32 R, G, B: of the numbers an RGBA32F target holds, with a transparent background those of
     * `VG_ALPHA_PREMULTIPLIED`. The first pixel of the top row. Any alignment. `[height][width][3]`
     */
    const void *color;
    /**
     * Bytes from one row to the next; 0: rows without gaps.
     */
    size_t color_row_stride;
    /**
     * dL / dalpha, float32: of `vg_image_target.alpha`, which no background changes. `[height][width]`
     */
    const void *alpha;
    /**
     * Bytes from one row to the next; 0: rows without gaps.
     */
    size_t alpha_row_stride;
    /**
     * dL / ddepth, float32, per metre: of `vg_image_target.depth` in the `vg_depth_mode` of the options.
     * `[height][width]`
     */
    const void *depth;
    /**
     * Bytes from one row to the next; 0: rows without gaps.
     */
    size_t depth_row_stride;
    /**
     * Computes the planes out of the picture, between drawing it and going back, so that a step of a training loop
     * draws once. NULL: the planes are there already. Default NULL.
     */
    vg_loss_fn loss;
    /**
     * Handed to `loss`.
     */
    void *loss_user;
    /**
     * Reserved: 0.
     */
    uint64_t flags;
} vg_image_gradient;

/**
 * Where `vg_render_backward` puts gradients: arrays of the caller's, laid out as those of `vg_gaussian_arrays`, at
 * any address, NULL where not wanted, no byte in two of them or in the target. They are written whole, not added to.
 * All numbers are finite: what a float32 cannot hold is its largest number of that sign.
 */
typedef struct vg_gradients {
    /**
     * `sizeof(vg_gradients)`.
     */
    size_t struct_size;
    /**
     * How many Gaussians the arrays have room for: as many as there are. Not looked at where none of the five is
     * wanted.
     */
    size_t count;
    /**
     * Of centres, per metre. `[count][3]`
     */
    float *positions;
    /**
     * Of standard deviations, per metre. `[count][3]`
     */
    float *scales;
    /**
     * Of the stored unit quaternions w, x, y, z as four free numbers that are normalised before use, so that it is
     * perpendicular to the quaternion. Whoever handed in a quaternion of another norm divides by that norm.
     * `[count][4]`
     */
    float *rotations;
    /**
     * Of peak opacities. `[count]`
     */
    float *opacities;
    /**
     * Of coefficients of spherical harmonics; zero in bands above `vg_render_options.sh_degree`.
     * `[count][(sh_degree + 1)^2][3]`
     */
    float *sh;
    /**
     * Of the background colour R, G, B; zero for a transparent one. `[3]`
     */
    double *background;
    /**
     * Of the camera's place: turning it about its axes x, y, z, per radian, then moving it along them, per metre;
     * vehicle_from_camera becomes vehicle_from_camera times the small motion. `[6]`
     */
    double *pose;
    /**
     * Of the entries of camera_from_vehicle, the inverse of the camera's pose as a 4x4 matrix, row-major, all entries
     * free; colour is seen from the centre -R^T t. The last row is zero. `[16]`
     */
    double *view_matrix;
    /**
     * Degree of the spherical harmonics `sh` has room for: the Gaussians'. Not looked at where `sh` is NULL.
     */
    int32_t sh_degree;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
} vg_gradients;

/**
 * Settings of `vg_segment`.
 */
typedef struct vg_segment_options {
    /**
     * `sizeof(vg_segment_options)`.
     */
    size_t struct_size;
    /**
     * Threads to use. NULL: the process's own, one per core, see `vg_default_context_free`.
     */
    struct vg_context *context;
    /**
     * Reserved: 0.
     */
    uint64_t flags;
} vg_segment_options;

/**
 * Settings of `vg_metrics_pictures`, `vg_metrics_view` and `vg_metrics_surface`.
 */
typedef struct vg_metrics_options {
    /**
     * `sizeof(vg_metrics_options)`.
     */
    size_t struct_size;
    /**
     * Threads and memory to use. NULL: the process's own, one thread per core, see `vg_default_context_free`.
     */
    struct vg_context *context;
    /**
     * A network that measures LPIPS, needed until the call returns. NULL: LPIPS is not measured.
     */
    const struct vg_model *lpips;
    /**
     * The distance below which a point of a surface counts as met, metres, 0.001 to 1000. Default 0.05.
     */
    double f_score_m;
    /**
     * Reserved: 0.
     */
    uint64_t flags;
    /**
     * Called in the course of `vg_metrics_view` and `vg_metrics_surface`, see `vg_progress_fn`. NULL: none.
     */
    vg_progress_fn progress;
    /**
     * Handed to `progress`.
     */
    void *progress_user;
} vg_metrics_options;

/**
 * The difference of two pictures; NAN where a measure does not exist.
 */
typedef struct vg_picture_errors {
    /**
     * `sizeof(vg_picture_errors)`.
     */
    size_t struct_size;
    /**
     * Peak signal-to-noise ratio, dB; infinite for equal pictures.
     */
    double psnr_db;
    /**
     * Structural similarity, at most 1; NAN for a picture smaller than 11x11.
     */
    double ssim;
    /**
     * LPIPS; NAN without `options.lpips`, and for a picture smaller than 64x64.
     */
    double lpips;
} vg_picture_errors;

/**
 * The error of a model in one photograph; NAN where a measure does not exist.
 */
typedef struct vg_view_errors {
    /**
     * `sizeof(vg_view_errors)`.
     */
    size_t struct_size;
    /**
     * Peak signal-to-noise ratio over the full frame, dB; infinite for equal pictures.
     */
    double psnr_db;
    /**
     * The same inside the bounding box of the mask; NAN where the mask is empty.
     */
    double psnr_box_db;
    /**
     * Structural similarity over the full frame, at most 1; NAN for a picture smaller than 11x11.
     */
    double ssim;
    /**
     * LPIPS over the full frame; NAN without `options.lpips`, and for a picture smaller than 64x64.
     */
    double lpips;
    /**
     * Intersection over union of the mask and the pixels that the model covers by half or more, 0 to 1.
     */
    double silhouette_iou;
    /**
     * Mean absolute difference of depth where the view has depth and the model covers the pixel by half or more,
     * metres; NAN where that is nowhere.
     */
    double depth_mae_m;
    /**
     * 90th percentile of that difference, metres.
     */
    double depth_p90_m;
} vg_view_errors;

/**
 * The error of a model's surface against a scan.
 */
typedef struct vg_surface_errors {
    /**
     * `sizeof(vg_surface_errors)`.
     */
    size_t struct_size;
    /**
     * Mean distance from the model's surface to the scan, metres; distances above 0.5 m count as 0.5 m.
     */
    double accuracy_m;
    /**
     * Mean distance from the scan to the model's surface, metres, likewise.
     */
    double completeness_m;
    /**
     * Mean of the two.
     */
    double chamfer_m;
    /**
     * Share of the model's surface that is nearer to the scan than `options.f_score_m`.
     */
    double precision;
    /**
     * Share of the scan that is nearer to the model's surface than `options.f_score_m`.
     */
    double recall;
    /**
     * Harmonic mean of the two.
     */
    double f_score;
    /**
     * How much longer (x) the model is than the scan, percent; negative: shorter.
     */
    double length_error_percent;
    /**
     * The same of the width (y).
     */
    double width_error_percent;
    /**
     * The same of the height (z).
     */
    double height_error_percent;
} vg_surface_errors;

/**
 * Settings of `vg_align_scan`, `vg_align_box` and `vg_align_folder`.
 */
typedef struct vg_align_options {
    /**
     * `sizeof(vg_align_options)`.
     */
    size_t struct_size;
    /**
     * Threads to use. NULL: the process's own, one per core, see `vg_default_context_free`.
     */
    struct vg_context *context;
    /**
     * A `vg_heading`. Default `VG_HEADING_AUTO`.
     */
    int32_t heading;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
    /**
     * Called in the course of the call, see `vg_progress_fn`. NULL: none.
     */
    vg_progress_fn progress;
    /**
     * Handed to `progress`.
     */
    void *progress_user;
} vg_align_options;

/**
 * A similarity that was found, and how well it fits; NAN where a measure does not exist.
 */
typedef struct vg_alignment {
    /**
     * `sizeof(vg_alignment)`.
     */
    size_t struct_size;
    /**
     * From the world to the vehicle's frame, metres: row-major 4x4, as `vg_scene_options` and `vg_pose_from_colmap`
     * take it.
     */
    double vehicle_from_world[16];
    /**
     * Metres per unit of the world.
     */
    double scale;
    /**
     * Typical distance of what should coincide, metres: of outlines from a scan's, of sides from a box's, of points
     * from where they were measured.
     */
    double residual_m;
    /**
     * 0 to 1; at 0 another answer fits as well.
     */
    double confidence;
    /**
     * Mean distance between the outlines of scan and masks, pixels; NAN without a scan.
     */
    double residual_px;
    /**
     * The same with front and back exchanged.
     */
    double other_px;
    /**
     * Views, or points, that the similarity was found from.
     */
    size_t used_count;
} vg_alignment;

/**
 * What of a scene is wanted, and what its files do not say.
 */
typedef struct vg_scene_options {
    /**
     * `sizeof(vg_scene_options)`.
     */
    size_t struct_size;
    /**
     * Threads that decode. NULL: the process's own, one per core, see `vg_default_context_free`.
     */
    struct vg_context *context;
    /**
     * 16 numbers, a row-major 4x4 similarity from the world of the poses to the vehicle's frame in metres. A COLMAP
     * model needs it. NULL for a `transforms.json`: its world is the vehicle's frame.
     */
    const double *vehicle_from_world;
    /**
     * The views wanted, in this order, each by path, file name, or file name without extension, UTF-8.
     * NULL: all views.
     */
    const char *const *names;
    /**
     * How many names; 0 with NULL.
     */
    size_t name_count;
    /**
     * Metres per number in the depth files; 0: as the scene says, else millimetres for integers, metres for floats.
     */
    double depth_scale;
    /**
     * 1: read depth files where there are any; 0: do not. Default 1.
     */
    int32_t load_depth;
    /**
     * Reserved: 0.
     */
    uint32_t flags;
    /**
     * Told what is legal but looks like a mistake. NULL: nobody.
     */
    vg_log_fn log;
    /**
     * Handed to `log`.
     */
    void *log_user;
    /**
     * Called in the course of the call, see `vg_progress_fn`. NULL: none.
     */
    vg_progress_fn progress;
    /**
     * Handed to `progress`.
     */
    void *progress_user;
} vg_scene_options;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Version of the library that is running, "0.1.0". Static; never NULL.
 */
VG_API
const char *vg_version(void);

/**
 * `VG_ABI_VERSION` of the library that is running; compare it with the header's when loading by hand.
 */
VG_API
uint32_t vg_abi_version(void);

/**
 * The name of a `vg_status`: `VG_STATUS_ARGUMENT` for 1. A number that this library does not know: an empty string. Never
 * NULL; lives for ever.
 */
VG_API
const char *vg_status_name(int32_t status);

/**
 * The status of the call that made this error. NULL: `VG_STATUS_OK`.
 */
VG_API
vg_status vg_error_code(const struct vg_error *error);

/**
 * What went wrong in one line of UTF-8: the argument, what was found, what is allowed. Lives as long as the error.
 * NULL: an empty string. Never NULL.
 */
VG_API
const char *vg_error_message(const struct vg_error *error);

/**
 * Frees an error. NULL: nothing happens.
 */
VG_API
void vg_error_free(struct vg_error *error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_context_options_init(struct vg_context_options *options,
                                  size_t size);

/**
 * Makes a context.
 *
 * - options: NULL for the default values.
 * - out: receives the context; the caller frees it.
 * - out_error: NULL, or receives the error; NULL on success.
 */
VG_API
vg_status vg_context_new(const struct vg_context_options *options,
                         struct vg_context **out,
                         struct vg_error **out_error);

/**
 * How many threads work in a context. NULL, and in a fork of the process that made it: 0.
 */
VG_API
uint32_t vg_context_threads(const struct vg_context *context);

/**
 * Ends the context's threads and frees its memory. No call may be using it. NULL: nothing happens.
 */
VG_API
void vg_context_free(struct vg_context *context);

/**
 * Ends the threads and frees the memory that calls which name no context have made for each other. One that is running
 * is not disturbed, and the last of them ends the threads; the next such call makes them anew. Nothing happens where
 * there was no such call.
 */
VG_API
void vg_default_context_free(void);

/**
 * Sets `*camera` to a pinhole without size at the origin. `size`: `sizeof *camera`.
 */
VG_API
vg_status vg_camera_init(struct vg_camera *camera,
                         size_t size);

/**
 * A camera from one of COLMAP's models.
 *
 * - model: a `vg_camera_model`; COLMAP's numbers.
 * - params, param_count: as many as the model has, in COLMAP's order.
 * - vehicle_from_camera: 12 numbers as in `vg_camera`; NULL: the identity.
 * - out: receives the whole camera, `struct_size` included; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_from_colmap_model(int32_t model,
                                      const double *params,
                                      size_t param_count,
                                      uint32_t width,
                                      uint32_t height,
                                      const double *vehicle_from_camera,
                                      struct vg_camera *out,
                                      struct vg_error **out_error);

/**
 * A camera from OpenCV's calibration, whose pixel centres are half a pixel from ours: cx and cy grow by 0.5.
 *
 * - k: the 3x3 camera matrix, row-major, without skew.
 * - distortion, distortion_count: 0, 4, 5 or 8 numbers k1 k2 p1 p2 k3 k4 k5 k6, or 12 or 14 with zeros
 *   behind the 8th; with `fisheye`, 0 or 4.
 * - fisheye: 0: `cv::calibrateCamera`'s model; 1: `cv::fisheye`'s.
 * - vehicle_from_camera: 12 numbers as in `vg_camera`; NULL: the identity.
 * - out: receives the whole camera, `struct_size` included; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_from_opencv(const double *k,
                                const double *distortion,
                                size_t distortion_count,
                                int32_t fisheye,
                                uint32_t width,
                                uint32_t height,
                                const double *vehicle_from_camera,
                                struct vg_camera *out,
                                struct vg_error **out_error);

/**
 * The camera of the picture resized to `width` x `height`.
 *
 * - camera: is not changed.
 * - out: receives the camera; may be `camera` itself; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_scale(const struct vg_camera *camera,
                          uint32_t width,
                          uint32_t height,
                          struct vg_camera *out,
                          struct vg_error **out_error);

/**
 * The camera of the part of the picture that begins at column `x`, row `y`, and is `width` x `height`.
 *
 * - camera: is not changed. The part must lie inside its picture.
 * - out: receives the camera; may be `camera` itself; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_crop(const struct vg_camera *camera,
                         uint32_t x,
                         uint32_t y,
                         uint32_t width,
                         uint32_t height,
                         struct vg_camera *out,
                         struct vg_error **out_error);

/**
 * A pose from COLMAP's `images.txt`: QW QX QY QZ and TX TY TZ, world to camera.
 *
 * - qvec: 4 numbers w, x, y, z of any norm but zero.
 * - tvec: 3 numbers.
 * - vehicle_from_world: 16 numbers, a row-major 4x4 similarity that takes COLMAP's world, which lies anywhere and
 *   has any scale, to the vehicle's frame in metres. NULL: the world is the vehicle's frame.
 * - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_pose_from_colmap(const double *qvec,
                              const double *tvec,
                              const double *vehicle_from_world,
                              double *out,
                              struct vg_error **out_error);

/**
 * A pose from an OpenGL, Blender or nerfstudio matrix: camera to world, camera axes x right, y up, z backward.
 *
 * - camera_to_world: 12 numbers, the first three rows, row-major.
 * - vehicle_from_world: 16 numbers, as in `vg_pose_from_colmap`. NULL: the world is the vehicle's frame.
 * - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_pose_from_opengl(const double *camera_to_world,
                              const double *vehicle_from_world,
                              double *out,
                              struct vg_error **out_error);

/**
 * A pose from OpenCV's `cv::solvePnP`, `cv::calibrateCamera` or ArUco: world to camera. With `vg_camera_from_opencv` it
 * makes a whole camera.
 *
 * - rvec: 3 numbers, a rotation vector: its direction is the axis, its length the angle in radians.
 * - tvec: 3 numbers.
 * - vehicle_from_world: 16 numbers, as in `vg_pose_from_colmap`. NULL: the world, where the object's points were
 *   measured, is the vehicle's frame.
 * - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_pose_from_opencv(const double *rvec,
                              const double *tvec,
                              const double *vehicle_from_world,
                              double *out,
                              struct vg_error **out_error);

/**
 * A pose from a tracked box: where the vehicle and the camera are in any common frame (ego, map, UTM) at the
 * moment of the picture. The vehicle may move between pictures. Camera axes x right, y down, z forward; box axes
 * x forward, y left, z up, its origin on the vehicle's plane of symmetry.
 *
 * - vehicle_in_ego: 12 numbers, vehicle to common frame, row-major, metres.
 * - camera_in_ego: 12 numbers, camera to the same frame.
 * - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_pose_from_box(const double *vehicle_in_ego,
                           const double *camera_in_ego,
                           double *out,
                           struct vg_error **out_error);

/**
 * The pixel of a point. For many points, `vg_camera_project_points`.
 *
 * - camera: is not changed.
 * - point_vehicle: 3 numbers, metres, vehicle frame.
 * - out_pixel: receives 2 numbers, column and row; a picture's pixels are 0 to width and 0 to height. Unchanged on
 *   failure, and where the camera has no picture of the point, which is `VG_STATUS_ARGUMENT`: on or behind its plane, and
 *   beyond the angle at which its lens model folds back.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_project(const struct vg_camera *camera,
                            const double *point_vehicle,
                            double *out_pixel,
                            struct vg_error **out_error);

/**
 * Sets `*view` to a view without picture. `size`: `sizeof *view`.
 */
VG_API
vg_status vg_view_init(struct vg_view *view,
                       size_t size);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_model_options_init(struct vg_model_options *options,
                                size_t size);

/**
 * Opens the model in an ONNX file; weights in files beside it are found by their names. What it takes and gives is
 * checked by the call that it is lent to.
 *
 * - path: the file; not NULL.
 * - options: NULL for the default values.
 * - out: receives the model; the caller frees it. NULL on failure.
 * - out_error: NULL, or receives the error.
 *
 * `VG_STATUS_NOT_BUILT` in a build without networks, `VG_STATUS_MISSING` without ONNX Runtime or the provider,
 * `VG_STATUS_FORMAT` where the runtime refuses the file.
 */
VG_API
vg_status vg_model_open(const char *path,
                        const struct vg_model_options *options,
                        struct vg_model **out,
                        struct vg_error **out_error);

/**
 * Closes a model and frees its memory and threads. No call may be using it. NULL: nothing happens.
 */
VG_API
void vg_model_free(struct vg_model *model);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_options_init(struct vg_options *options,
                          size_t size);

/**
 * Sets `*figures` to zeros. `size`: `sizeof *figures`.
 */
VG_API
vg_status vg_report_figures_init(struct vg_report_figures *figures,
                                 size_t size);

/**
 * The main figures.
 *
 * - report: not NULL.
 * - out: a struct that `vg_report_figures_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_report_get_figures(const struct vg_report *report,
                                struct vg_report_figures *out,
                                struct vg_error **out_error);

/**
 * The whole report as JSON. Lives as long as the report. NULL: an empty string. Never NULL.
 */
VG_API
const char *vg_report_json(const struct vg_report *report);

/**
 * Why the verdict is not good, the heaviest reason first: one line of UTF-8 that names the view where one is concerned,
 * what was found, what is expected, the likely cause and the way out. `index`: below `vg_report_figures.reason_count`;
 * beyond it an empty string. Lives as long as the report; the JSON has the parts, as `verdict_reasons`. NULL: an empty
 * string. Never NULL.
 */
VG_API
const char *vg_report_reason(const struct vg_report *report,
                             size_t index);

/**
 * How many points the metric coloured point cloud has; 0 unless `vg_options.points` was 1. NULL: 0.
 */
VG_API
size_t vg_report_point_count(const struct vg_report *report);

/**
 * Positions of the points, float32 `[count][3]`, metres, vehicle frame. Lives as long as the report. NULL where
 * there are none.
 */
VG_API
const float *vg_report_point_positions(const struct vg_report *report);

/**
 * Colours of the points, uint8 `[count][3]`, sRGB. Lives as long as the report. NULL where there are none.
 */
VG_API
const uint8_t *vg_report_point_colors(const struct vg_report *report);

/**
 * Frees a report. NULL: nothing happens.
 */
VG_API
void vg_report_free(struct vg_report *report);

/**
 * Sets `*arrays` to no Gaussians of degree 0. `size`: `sizeof *arrays`.
 */
VG_API
vg_status vg_gaussian_arrays_init(struct vg_gaussian_arrays *arrays,
                                  size_t size);

/**
 * How many Gaussians. NULL: 0.
 */
VG_API
size_t vg_gaussians_count(const struct vg_gaussians *gaussians);

/**
 * Degree of the spherical harmonics, 0 to 3. NULL: 0.
 */
VG_API
int32_t vg_gaussians_sh_degree(const struct vg_gaussians *gaussians);

/**
 * Centres, float32 `[count][3]`, metres. Lives as long as the Gaussians. NULL where there are none.
 */
VG_API
const float *vg_gaussians_positions(const struct vg_gaussians *gaussians);

/**
 * Standard deviations along the Gaussian's own axes, float32 `[count][3]`, metres. Lives as long as the Gaussians.
 * NULL where there are none.
 */
VG_API
const float *vg_gaussians_scales(const struct vg_gaussians *gaussians);

/**
 * Unit quaternions w, x, y, z that turn the Gaussian's axes to the vehicle's, float32 `[count][4]`. Lives as long
 * as the Gaussians. NULL where there are none.
 */
VG_API
const float *vg_gaussians_rotations(const struct vg_gaussians *gaussians);

/**
 * Peak opacities, float32 `[count]`, 0 to 1. Lives as long as the Gaussians. NULL where there are none.
 */
VG_API
const float *vg_gaussians_opacities(const struct vg_gaussians *gaussians);

/**
 * Coefficients of spherical harmonics, float32 `[count][(sh_degree + 1)^2][3]`, R G B innermost. Lives as long as
 * the Gaussians. NULL where there are none.
 */
VG_API
const float *vg_gaussians_sh(const struct vg_gaussians *gaussians);

/**
 * Reads Gaussians from a PLY file in the layout of 3D Gaussian Splatting. Other formats (SPZ, SOG, .splat, packed PLY,
 * glTF) and other kinds of Gaussians are errors that name them and the way out.
 *
 * - path: not NULL. A file or a pipe; a pipe that nothing writes to is an error after ten seconds.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_load_ply(const char *path,
                                struct vg_gaussians **out,
                                struct vg_error **out_error);

/**
 * Writes Gaussians as a PLY file in the layout of 3D Gaussian Splatting. A file that is there is replaced once the
 * new one is complete and on the disk, and keeps its permissions; on failure it is as it was.
 *
 * - gaussians, path: not NULL. A name that ends like that of another format, car.spz, is refused.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_save_ply(const struct vg_gaussians *gaussians,
                                const char *path,
                                struct vg_error **out_error);

/**
 * Gaussians from the caller's arrays, which are copied and checked.
 *
 * - arrays: not NULL.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error, which names array and index.
 */
VG_API
vg_status vg_gaussians_from_arrays(const struct vg_gaussian_arrays *arrays,
                                   struct vg_gaussians **out,
                                   struct vg_error **out_error);

/**
 * Gaussians moved to another frame: p becomes S p, rotations, scales and colours follow. Keep world placements of
 * UTM size in a pose of your own: a float32 resolves a millimetre up to 16 km from the origin, and what lies beyond
 * is refused.
 *
 * - gaussians: not NULL; they stay as they are.
 * - to_from_vehicle: 16 numbers, a row-major 4x4 similarity: rotation, positive scale, translation in metres.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_transform(const struct vg_gaussians *gaussians,
                                 const double *to_from_vehicle,
                                 struct vg_gaussians **out,
                                 struct vg_error **out_error);

/**
 * The mirror image across the vehicle's plane of symmetry, y = 0. Mirrored twice, the bytes are the same.
 *
 * - gaussians: not NULL; they stay as they are.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_mirror(const struct vg_gaussians *gaussians,
                              struct vg_gaussians **out,
                              struct vg_error **out_error);

/**
 * All of `first`, then all of `second`, in one. The degree is the higher of the two; missing bands are zero.
 *
 * - first, second: not NULL; may be the same; they stay as they are.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_merge(const struct vg_gaussians *first,
                             const struct vg_gaussians *second,
                             struct vg_gaussians **out,
                             struct vg_error **out_error);

/**
 * Frees Gaussians. Pointers into them end. NULL: nothing happens.
 */
VG_API
void vg_gaussians_free(struct vg_gaussians *gaussians);

/**
 * The Gaussians at these indices, in this order; an index may come again.
 *
 * - gaussians: not NULL; they stay as they are.
 * - indices, index_count: each below `vg_gaussians_count`. NULL with 0.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error, which names the index.
 */
VG_API
vg_status vg_gaussians_select(const struct vg_gaussians *gaussians,
                              const size_t *indices,
                              size_t index_count,
                              struct vg_gaussians **out,
                              struct vg_error **out_error);

/**
 * The Gaussians whose byte is not 0, in order: by opacity, by size, by whatever the caller computed of the arrays.
 *
 * - gaussians: not NULL; they stay as they are.
 * - keep, keep_count: one byte per Gaussian, `vg_gaussians_count` of them. NULL with 0.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_mask(const struct vg_gaussians *gaussians,
                            const uint8_t *keep,
                            size_t keep_count,
                            struct vg_gaussians **out,
                            struct vg_error **out_error);

/**
 * The Gaussians whose centre lies in a box, its faces included, in order.
 *
 * - gaussians: not NULL; they stay as they are.
 * - low, high: 3 numbers each, metres, in the Gaussians' frame; `low` not above `high`. Infinite sides are open.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_crop(const struct vg_gaussians *gaussians,
                            const double *low,
                            const double *high,
                            struct vg_gaussians **out,
                            struct vg_error **out_error);

/**
 * Covariance matrices R diag(scale^2) R^T, square metres: xx, xy, xz, yy, yz, zz of each, as 3D Gaussian Splatting orders
 * them.
 *
 * - gaussians: not NULL.
 * - out: float32 `[count][6]`; unchanged on failure. NULL with 0.
 * - count: `vg_gaussians_count`.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_covariances(const struct vg_gaussians *gaussians,
                                   float *out,
                                   size_t count,
                                   struct vg_error **out_error);

/**
 * `vg_gaussians_load_ply` of a file that is in memory.
 *
 * - data, size: the bytes of the file; not kept. NULL with 0.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_load_ply_memory(const void *data,
                                       size_t size,
                                       struct vg_gaussians **out,
                                       struct vg_error **out_error);

/**
 * How many bytes `vg_gaussians_save_ply_memory` writes. NULL: 0.
 */
VG_API
size_t vg_gaussians_ply_size(const struct vg_gaussians *gaussians);

/**
 * `vg_gaussians_save_ply` into memory of the caller's.
 *
 * - gaussians: not NULL.
 * - buffer: receives the bytes of the file, `vg_gaussians_ply_size` of them; unchanged on failure.
 * - size: how many bytes there is room for.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_gaussians_save_ply_memory(const struct vg_gaussians *gaussians,
                                       void *buffer,
                                       size_t size,
                                       struct vg_error **out_error);

/**
 * A camera's pose by where it stands and what it looks at.
 *
 * - eye: 3 numbers, where the camera stands, metres, vehicle frame.
 * - target: 3 numbers, a point on its optical axis; not `eye`.
 * - up: 3 numbers, the direction that is up in the picture, of any length; not along the line of sight. NULL: the
 *   vehicle's z axis.
 * - out: receives 12 numbers, camera to vehicle, as in `vg_camera`; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_pose_look_at(const double *eye,
                          const double *target,
                          const double *up,
                          double *out,
                          struct vg_error **out_error);

/**
 * A pinhole camera by where it stands and what it looks at. For another lens, hand the pose of `vg_pose_look_at` to the
 * function that makes its camera.
 *
 * - eye, target, up: as in `vg_pose_look_at`.
 * - fov_y_degrees: angle from the top to the bottom of the picture, above 0 and below 180. Pixels are square.
 * - width, height: 1 to 8192.
 * - out: receives the whole camera, `struct_size` included; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_look_at(const double *eye,
                            const double *target,
                            const double *up,
                            double fov_y_degrees,
                            uint32_t width,
                            uint32_t height,
                            struct vg_camera *out,
                            struct vg_error **out_error);

/**
 * Cameras on a circle around Gaussians, from the vehicle's front towards its left, each with all of their centres in
 * its picture.
 *
 * - gaussians: at least one.
 * - count: how many cameras, 1 to 100000.
 * - elevation_degrees: angle by which they look down, -89 to 89; the program takes 12.
 * - fov_y_degrees: vertical field of view, above 0 and below 180; the program takes 35.
 * - width, height: 1 to 8192.
 * - out: an array that receives `count` whole cameras, `struct_size` included; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_cameras_turntable(const struct vg_gaussians *gaussians,
                               size_t count,
                               double elevation_degrees,
                               double fov_y_degrees,
                               uint32_t width,
                               uint32_t height,
                               struct vg_camera *out,
                               struct vg_error **out_error);

/**
 * The pixels of many points: `vg_camera_project` for an array, where points without a pixel are no error.
 *
 * - camera: is not changed.
 * - points: double `[count][3]` without gaps, metres, vehicle frame. NULL with 0.
 * - out_pixels: double `[count][2]`, column and row; NAN where the camera has no picture of the point: on or behind its
 *   plane, and beyond the angle at which its lens model folds back. Pixels outside 0 to width and 0 to height lie beside
 *   the picture.
 * - out_depths: double `[count]`, planar depth, metres, NAN where there is no pixel. NULL: not wanted.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_project_points(const struct vg_camera *camera,
                                   const double *points,
                                   size_t count,
                                   double *out_pixels,
                                   double *out_depths,
                                   struct vg_error **out_error);

/**
 * The point behind a pixel.
 *
 * - camera: is not changed.
 * - pixel: 2 numbers, column and row; the centre of the top-left pixel is (0.5, 0.5).
 * - depth_m: planar depth, metres along the optical axis, above 0.
 * - out_point: receives 3 numbers, metres, vehicle frame. Unchanged on failure, and where the lens has no ray to the
 *   pixel, which is `VG_STATUS_ARGUMENT`.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_unproject(const struct vg_camera *camera,
                              const double *pixel,
                              double depth_m,
                              double *out_point,
                              struct vg_error **out_error);

/**
 * The points behind many pixels: `vg_camera_unproject` for an array, where pixels without a point are no error.
 *
 * - camera: is not changed.
 * - pixels: double `[count][2]` without gaps, column and row. NULL with 0.
 * - depths: double `[count]`, planar depth, metres; 0, negative, NAN and infinite mean no measurement. NULL with 0.
 * - out_points: double `[count][3]`, metres, vehicle frame; NAN where there is no measurement or no ray.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_camera_unproject_points(const struct vg_camera *camera,
                                     const double *pixels,
                                     const double *depths,
                                     size_t count,
                                     double *out_points,
                                     struct vg_error **out_error);

/**
 * Makes a complete vehicle of photographs of one side.
 *
 * - views, view_count: 1 to 4096 views; nothing they point to is changed, or looked at after the call.
 * - options: NULL for the default values.
 * - out_gaussians: receives the vehicle; the caller frees it. NULL on failure.
 * - out_report: NULL, or receives the report; the caller frees it. NULL on failure.
 * - out_error: NULL, or receives the error.
 *
 * The same views and options give the same bytes with any number of threads.
 */
VG_API
vg_status vg_reconstruct(const struct vg_view *views,
                         size_t view_count,
                         const struct vg_options *options,
                         struct vg_gaussians **out_gaussians,
                         struct vg_report **out_report,
                         struct vg_error **out_error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_refine_options_init(struct vg_refine_options *options,
                                 size_t size);

/**
 * Sets `*refinement` to no steps and NAN. `size`: `sizeof *refinement`.
 */
VG_API
vg_status vg_refinement_init(struct vg_refinement *refinement,
                             size_t size);

/**
 * Moves the Gaussians of any model until their pictures are the photographs. Nothing is known of which mirrors which:
 * each goes its own way. `vg_reconstruct` with `refine_iterations` keeps both sides mirror images.
 *
 * - gaussians: at least one, in the views' vehicle frame; they stay as they are.
 * - views, view_count: 1 to 4096 views, as for `vg_reconstruct`.
 * - options: NULL for the default values.
 * - out: receives the Gaussians; the caller frees them. NULL on failure.
 * - out_refinement: NULL, or a struct that `vg_refinement_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_refine(const struct vg_gaussians *gaussians,
                    const struct vg_view *views,
                    size_t view_count,
                    const struct vg_refine_options *options,
                    struct vg_gaussians **out,
                    struct vg_refinement *out_refinement,
                    struct vg_error **out_error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_render_options_init(struct vg_render_options *options,
                                 size_t size);

/**
 * Sets `*target` to an RGBA8 target without memory. `size`: `sizeof *target`.
 */
VG_API
vg_status vg_image_target_init(struct vg_image_target *target,
                               size_t size);

/**
 * Draws Gaussians as a camera sees them, through its lens.
 *
 * - gaussians: not NULL. Any number of threads may render them at a time.
 * - camera: not NULL.
 * - options: NULL for the default values.
 * - target: not NULL; the memory it points to is written on success only.
 * - out_error: NULL, or receives the error.
 *
 * The same arguments give the same bytes with any number of threads.
 */
VG_API
vg_status vg_render(const struct vg_gaussians *gaussians,
                    const struct vg_camera *camera,
                    const struct vg_render_options *options,
                    const struct vg_image_target *target,
                    struct vg_error **out_error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_renderer_options_init(struct vg_renderer_options *options,
                                   size_t size);

/**
 * Makes Gaussians ready to be drawn many times.
 *
 * - gaussians: not NULL. They are shared, not copied, and may be freed before the renderer.
 * - options: NULL for the default values.
 * - out: receives the renderer; the caller frees it. NULL on failure.
 * - out_error: NULL, or receives the error.
 *
 * With `VG_BACKEND_GPU`: `VG_STATUS_NOT_BUILT` in a build without it, `VG_STATUS_MISSING` without a driver, and
 * `VG_STATUS_ARGUMENT` for more Gaussians than the device can take.
 */
VG_API
vg_status vg_renderer_new(const struct vg_gaussians *gaussians,
                          const struct vg_renderer_options *options,
                          struct vg_renderer **out,
                          struct vg_error **out_error);

/**
 * Draws Gaussians as cameras see them, through their lenses, one picture after the other into the targets.
 *
 * - renderer: not NULL.
 * - cameras: `count` of them, not NULL.
 * - count: 1 to 4096.
 * - options: NULL for the default values. `backend` is not looked at: the renderer has one.
 * - targets: `count` of them, not NULL, no byte of memory in two. The memory they point to is written when its picture
 *   is done; the arguments of all pictures are checked before the first is drawn.
 * - out_error: NULL, or receives the error.
 *
 * The same arguments give the same bytes with any number of threads on one machine; those of a graphics processor
 * differ from those of the CPU in the last bits. Colours are sRGB-encoded as everywhere: the numbers that
 * reconstruction read, blended as they are.
 */
VG_API
vg_status vg_renderer_render(const struct vg_renderer *renderer,
                             const struct vg_camera *cameras,
                             size_t count,
                             const struct vg_render_options *options,
                             const struct vg_image_target *targets,
                             struct vg_error **out_error);

/**
 * Who draws: `VG_BACKEND_CPU` or `VG_BACKEND_GPU`. NULL: `VG_BACKEND_AUTO`.
 */
VG_API
int32_t vg_renderer_backend(const struct vg_renderer *renderer);

/**
 * Who draws, and why, in one line of UTF-8: "cpu (avx2+fma): graphics processor: no Vulkan driver; ...". Lives as long as
 * the renderer. NULL: an empty string. Never NULL.
 */
VG_API
const char *vg_renderer_choice(const struct vg_renderer *renderer);

/**
 * Frees a renderer. Texts of it end. NULL: nothing happens.
 */
VG_API
void vg_renderer_free(struct vg_renderer *renderer);

/**
 * Sets `*gradient` to one without planes. `size`: `sizeof *gradient`.
 */
VG_API
vg_status vg_image_gradient_init(struct vg_image_gradient *gradient,
                                 size_t size);

/**
 * Sets `*gradients` to one without arrays. `size`: `sizeof *gradients`.
 */
VG_API
vg_status vg_gradients_init(struct vg_gradients *gradients,
                            size_t size);

/**
 * Goes back from the gradient of a loss with respect to a picture to its gradients with respect to what `vg_render`
 * draws that picture of. The picture is drawn again on the way: nothing of an earlier call is needed.
 *
 * Constants are: the order of depth, which pixels a Gaussian reaches, what is too faint or too far behind to be
 * drawn, and the near and far planes. Where a value is clamped its gradient is zero: alpha at `max_alpha`, colour at
 * 0, the compensation of `antialiased` at its floor.
 *
 * - gaussians: not NULL. Any number of threads may use them at a time.
 * - camera: not NULL.
 * - options: those of the picture; NULL for the default values. With a target `progress` is not called; `loss` can end
 *   the call. With a transparent background and a gradient of
 *   colour, `alpha` must be `VG_ALPHA_PREMULTIPLIED`.
 * - target: NULL, or receives the picture; `gradient->loss` needs one. The memory it points to is written on success,
 *   and before `loss` is called.
 * - gradient: not NULL; at least one plane.
 * - out: not NULL; at least one array. The memory it points to is written on success only.
 * - out_error: NULL, or receives the error, which names plane, row and column of a number that is not finite.
 *
 * The same arguments give the same bytes with any number of threads.
 */
VG_API
vg_status vg_render_backward(const struct vg_gaussians *gaussians,
                             const struct vg_camera *camera,
                             const struct vg_render_options *options,
                             const struct vg_image_target *target,
                             const struct vg_image_gradient *gradient,
                             const struct vg_gradients *out,
                             struct vg_error **out_error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_segment_options_init(struct vg_segment_options *options,
                                  size_t size);

/**
 * Makes the mask of a photograph that has none. The network tells which pixels show a vehicle, the camera which of
 * them is the one that stands at the origin of its vehicle frame: cars beside it and behind it are not in the mask.
 * All 0 where the network sees none there.
 *
 * - model: a segmentation network; not NULL.
 * - image: RGB8, BGR8, RGBA8, BGRA8 or GRAY8; alpha is not looked at. Not NULL.
 * - camera: of the image; not NULL.
 * - options: NULL for the default values.
 * - out_mask: one byte per pixel of the image, the top row first: 255 is the vehicle, 0 everything else and what a
 *   network that cuts off the sides was not shown. Ready to be the GRAY8 mask of a `vg_view`. Not NULL; written on
 *   success only.
 * - row_stride: bytes from one row of `out_mask` to the next; 0: rows without gaps. What lies between rows is not
 *   touched.
 * - out_error: NULL, or receives the error.
 *
 * `VG_STATUS_NOT_BUILT` in a build without networks.
 */
VG_API
vg_status vg_segment(const struct vg_model *model,
                     const struct vg_image *image,
                     const struct vg_camera *camera,
                     const struct vg_segment_options *options,
                     uint8_t *out_mask,
                     size_t row_stride,
                     struct vg_error **out_error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_metrics_options_init(struct vg_metrics_options *options,
                                  size_t size);

/**
 * Sets `*errors` to NAN throughout. `size`: `sizeof *errors`.
 */
VG_API
vg_status vg_picture_errors_init(struct vg_picture_errors *errors,
                                 size_t size);

/**
 * Sets `*errors` to NAN throughout. `size`: `sizeof *errors`.
 */
VG_API
vg_status vg_view_errors_init(struct vg_view_errors *errors,
                              size_t size);

/**
 * Sets `*errors` to NAN throughout. `size`: `sizeof *errors`.
 */
VG_API
vg_status vg_surface_errors_init(struct vg_surface_errors *errors,
                                 size_t size);

/**
 * Compares two pictures.
 *
 * - a, b: RGB8, BGR8, RGBA8, BGRA8, GRAY8 or RGBA32F, of one size; what their alpha leaves open is white. Floats are
 *   0 to 1, and what is more than 1 beyond is an error. Not NULL.
 * - options: NULL for the default values.
 * - out: a struct that `vg_picture_errors_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_metrics_pictures(const struct vg_image *a,
                              const struct vg_image *b,
                              const struct vg_metrics_options *options,
                              struct vg_picture_errors *out,
                              struct vg_error **out_error);

/**
 * Draws a model on white as a view's camera sees it, and compares the picture with the view's photograph, which its
 * mask puts on white: the full frame, so that what spills over the silhouette costs.
 *
 * - gaussians: not NULL.
 * - view: of depth and mask what it has; not NULL.
 * - options: NULL for the default values.
 * - out: a struct that `vg_view_errors_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_metrics_view(const struct vg_gaussians *gaussians,
                          const struct vg_view *view,
                          const struct vg_metrics_options *options,
                          struct vg_view_errors *out,
                          struct vg_error **out_error);

/**
 * Compares a model's surface, which is what is seen of it from outside and above, with points measured on the
 * vehicle. Points that stand alone are left out; how densely either side is sampled counts nothing.
 *
 * - gaussians: not NULL.
 * - points: float32 `[point_count][3]` without gaps, metres, vehicle frame; not NULL.
 * - point_count: 1 to 10 million.
 * - options: NULL for the default values.
 * - out: a struct that `vg_surface_errors_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_metrics_surface(const struct vg_gaussians *gaussians,
                             const float *points,
                             size_t point_count,
                             const struct vg_metrics_options *options,
                             struct vg_surface_errors *out,
                             struct vg_error **out_error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_align_options_init(struct vg_align_options *options,
                                size_t size);

/**
 * Sets `*alignment` to NAN throughout, and its count to 0. `size`: `sizeof *alignment`.
 */
VG_API
vg_status vg_alignment_init(struct vg_alignment *alignment,
                            size_t size);

/**
 * Finds the vehicle's frame with points scanned on the vehicle: their outline must run along the edges of all masks.
 *
 * - views, view_count: an array, as for `vg_reconstruct`, whose cameras have poses in the world, whatever its units.
 *   Masks are looked at, at least 3 of them; a photograph only where there is no mask, for its alpha: its `data` may
 *   be NULL, and a view with neither is left out.
 * - sparse: double `[sparse_count][3]` without gaps, points of the world that may show anything; NULL with 0.
 * - scan: float32 `[scan_count][3]` without gaps, metres, vehicle frame; not NULL.
 * - scan_count: 1 to 10 million.
 * - options: NULL for the default values.
 * - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_align_scan(const struct vg_view *views,
                        size_t view_count,
                        const double *sparse,
                        size_t sparse_count,
                        const float *scan,
                        size_t scan_count,
                        const struct vg_align_options *options,
                        struct vg_alignment *out,
                        struct vg_error **out_error);

/**
 * Finds the vehicle's frame by its size and the ground. Front and back are the same to a box: `options.heading` must
 * tell. The origin is the box's middle.
 *
 * - views, view_count: as for `vg_align_scan`, from all around.
 * - sparse: double `[sparse_count][3]` without gaps, points of the world, of which some show level ground; not NULL.
 * - size: 3 numbers, length, width and height, metres.
 * - options: not NULL, for the heading.
 * - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_align_box(const struct vg_view *views,
                       size_t view_count,
                       const double *sparse,
                       size_t sparse_count,
                       const double *size,
                       const struct vg_align_options *options,
                       struct vg_alignment *out,
                       struct vg_error **out_error);

/**
 * Finds the similarity that takes points of the world, the cameras' centres for one, to where they were measured (GPS,
 * ego poses), for more than half of them; those that contradict the others are left out, if there are 6 and more.
 *
 * - world, vehicle: double `[count][3]` without gaps, the same points in the world, and in the vehicle's frame in
 *   metres; not on one line. Not NULL.
 * - count: at least 3.
 * - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
 * - out_kept: `count` bytes, 1 where a point was used, 0 where it was left out; NULL: not wanted.
 * - out_residuals: `count` numbers, how far each point ends from its place, metres; NULL: not wanted.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_align_points(const double *world,
                          const double *vehicle,
                          size_t count,
                          struct vg_alignment *out,
                          uint8_t *out_kept,
                          double *out_residuals,
                          struct vg_error **out_error);

/**
 * `vg_align_scan` with the files of a scene, which need not be read first: the cameras, the masks (or the pictures'
 * alpha) and the sparse points of a COLMAP folder, of one of 3DRealCar, or of a `transforms.json`.
 *
 * - path: the folder; not NULL.
 * - scan_path: a PLY file of points, metres, vehicle frame. NULL: the scan in a folder of 3DRealCar.
 * - options: NULL for the default values.
 * - out: a struct that `vg_alignment_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_align_folder(const char *path,
                          const char *scan_path,
                          const struct vg_align_options *options,
                          struct vg_alignment *out,
                          struct vg_error **out_error);

/**
 * Sets `*options` to the default values. `size`: `sizeof *options`.
 */
VG_API
vg_status vg_scene_options_init(struct vg_scene_options *options,
                                size_t size);

/**
 * Reads a COLMAP folder: a model (binary or text) in `sparse/0`, in `sparse` or in the folder itself, of several
 * numbered ones that with the most images; photographs in `images`, masks in `masks` or `mask` (`<stem>.png`,
 * `<name>.png`, `<stem>_mask.png` or `<stem>.mask.png`; PNG, JPEG or NumPy), depth in `depth` (PNG, NumPy, PFM or
 * EXR). Two colours of which one is black are a mask whatever the other is.
 *
 * - path: the folder; not NULL.
 * - options: not NULL, because a COLMAP model needs `vehicle_from_world`.
 * - out: receives the scene; the caller frees it. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_colmap_open(const char *path,
                         const struct vg_scene_options *options,
                         struct vg_scene **out,
                         struct vg_error **out_error);

/**
 * Reads a nerfstudio or an instant-ngp scene: a `transforms.json`, or a folder with one. Masks and depth that the file
 * does not list are looked for as in a COLMAP folder.
 *
 * - path: the file or folder; not NULL.
 * - options: NULL for the default values.
 * - out: receives the scene; the caller frees it. NULL on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_transforms_open(const char *path,
                             const struct vg_scene_options *options,
                             struct vg_scene **out,
                             struct vg_error **out_error);

/**
 * How many views a scene has. NULL: 0.
 */
VG_API
size_t vg_scene_view_count(const struct vg_scene *scene);

/**
 * A view of a scene, for `vg_reconstruct` and `vg_render`. Its pointers live as long as the scene.
 *
 * - scene: not NULL.
 * - index: below `vg_scene_view_count`.
 * - out: a view that `vg_view_init` was called for; unchanged on failure.
 * - out_error: NULL, or receives the error.
 */
VG_API
vg_status vg_scene_get_view(const struct vg_scene *scene,
                            size_t index,
                            struct vg_view *out,
                            struct vg_error **out_error);

/**
 * Frees a scene. Pointers into it end. NULL: nothing happens.
 */
VG_API
void vg_scene_free(struct vg_scene *scene);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VG_H */
