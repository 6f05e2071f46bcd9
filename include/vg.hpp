/*
 * vg.hpp - the functions of vg.h for C++17: handles that free themselves, results instead of out parameters,
 * cv::Mat and Eigen where they are there. License: MIT or Apache-2.0.
 *
 *     #include <vg.hpp>
 *     #include <cstdio>
 *
 *     int failed(const vg::Error &error) {
 *         std::fprintf(stderr, "%s: %s\n", vg::status_name(error.status), error.message.c_str());
 *         return 1;
 *     }
 *
 *     int main(int, char **argv) {
 *         const auto scene = vg::Scene::open_transforms(argv[1]); // or photographs in memory: vg::view
 *         if (!scene) {
 *             return failed(scene.error());
 *         }
 *         const auto views = scene->views();
 *         if (!views) {
 *             return failed(views.error());
 *         }
 *         const auto made = vg::reconstruct(*views);
 *         if (!made) {
 *             return failed(made.error());
 *         }
 *         const auto saved = made->gaussians.save_ply("car.ply");
 *         return saved ? 0 : failed(saved.error());
 *     }
 *
 * With exceptions:
 *
 *     #define VG_HPP_EXCEPTIONS
 *     #include <vg.hpp>
 *     #include <cstdio>
 *
 *     int main(int, char **argv) {
 *         try {
 *             const vg::Scene scene = vg::Scene::open_transforms(argv[1]).take();
 *             const vg::Reconstruction made = vg::reconstruct(scene.views().take()).take();
 *             made.gaussians.save_ply("car.ply").take();
 *         } catch (const vg::Exception &error) {
 *             std::fprintf(stderr, "%s: %s\n", vg::status_name(error.status()), error.what());
 *             return 1;
 *         }
 *     }
 *
 * The chapter CONVENTIONS of vg.h applies here too: frames, poses, pixels, images, threads. This file adds:
 *
 * Results.   Functions that can fail return a Result, which holds either the value or an Error and must not be
 *            ignored. Check it before the value is used, or give a default by value_or. take(), value(), * and ->
 *            of a Result that holds an Error print its message and end the program; if VG_HPP_EXCEPTIONS is
 *            defined before this file, they throw a vg::Exception. Files of one program may differ in that.
 *            Nothing else here throws or needs exceptions or run-time type information; std::vector and
 *            std::string may throw std::bad_alloc where exceptions are on.
 *
 * Ownership. Context, Model, Scene, Gaussians and Report own one handle and are moved, not copied. A moved-from
 *            object is empty: it has no views or Gaussians, and using it is an error. A vg_view, a vg_image and a
 *            Span own nothing: they point into a Scene, a cv::Mat or Gaussians, which must outlive them.
 *
 * Options.   Options, ModelOptions, SegmentOptions, RenderOptions, RefineOptions, SceneOptions are the structs of
 *            vg.h with their default values set. Their fields are explained there. A field of an enumeration takes
 *            its enum class, `options.prior = vg::Prior::Hull`, or the enumerator of vg.h, VG_PRIOR_HULL; an
 *            enumerator of another enumeration does not compile.
 *
 * Callbacks. on_progress and on_log take any callable. They are called on the calling thread, one at a time. An
 *            exception that leaves one ends the program (std::terminate), because it cannot pass through the
 *            library.
 *
 * OpenCV     is used where <opencv2/core.hpp> is found, Eigen where <Eigen/Core> is. VG_NO_OPENCV and
 *            VG_NO_EIGEN, defined before this file, disable them. They only add functions.
 */
#ifndef VG_HPP
#define VG_HPP

#include "vg.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#if !defined(VG_NO_OPENCV) && __has_include(<opencv2/core.hpp>)
#define VG_HAS_OPENCV 1
#include <opencv2/core.hpp>
#endif
#if !defined(VG_NO_EIGEN) && __has_include(<Eigen/Core>) && __has_include(<Eigen/Geometry>)
#define VG_HAS_EIGEN 1
#include <Eigen/Core>
#include <Eigen/Geometry>
#endif

#if defined(VG_HPP_EXCEPTIONS) && !defined(__cpp_exceptions) && !defined(_CPPUNWIND)
#error "VG_HPP_EXCEPTIONS: this compiler was told to do without exceptions"
#endif

namespace vg {

// Functions that end the program in one file and throw in another must have different types.
#ifdef VG_HPP_EXCEPTIONS
inline namespace throwing {
#endif

// ---- Results

/// Why a call failed.
struct Error {
    vg_status status = VG_STATUS_INTERNAL;
    /// One line of UTF-8: the argument, what was found, what is allowed.
    std::string message;
};

/// The name of a status, "VG_STATUS_ARGUMENT"; "" for one that the library does not know.
inline const char *status_name(vg_status status) noexcept {
    return vg_status_name(static_cast<std::int32_t>(status));
}

#ifdef VG_HPP_EXCEPTIONS

/// Exception that take() of a failed call throws.
class Exception : public std::runtime_error {
  public:
    explicit Exception(const Error &error) : std::runtime_error(error.message), status_(error.status) {}

    vg_status status() const noexcept { return status_; }

  private:
    vg_status status_;
};

#endif // VG_HPP_EXCEPTIONS

namespace detail {

/// Ends the program after a wrong use of a Result.
[[noreturn]] inline void misused(const char *what, const char *message) noexcept {
    std::fprintf(stderr, "vg::Result: %s %s\n", what, message);
    std::abort();
}

#ifdef VG_HPP_EXCEPTIONS

inline constexpr bool aborts = false;

[[noreturn]] inline void no_value(const Error &error) {
    throw Exception(error);
}

#else

inline constexpr bool aborts = true;

[[noreturn]] inline void no_value(const Error &error) noexcept {
    misused("no value:", error.message.c_str());
}

#endif // VG_HPP_EXCEPTIONS

} // namespace detail

/// A value or an error. Access to the value of a failed call ends the program, or throws if VG_HPP_EXCEPTIONS is
/// defined; access to the error of a successful call ends the program.
template <class T> class [[nodiscard]] Result {
  public:
    Result(T value) : held_(std::in_place_index<0>, std::move(value)) {}
    Result(Error error) : held_(std::in_place_index<1>, std::move(error)) {}

    bool ok() const noexcept { return held_.index() == 0; }
    explicit operator bool() const noexcept { return ok(); }

    T &value() & noexcept(detail::aborts) { return *checked(this); }
    const T &value() const & noexcept(detail::aborts) { return *checked(this); }
    T &&value() && noexcept(detail::aborts) { return std::move(*checked(this)); }
    T &operator*() & noexcept(detail::aborts) { return value(); }
    const T &operator*() const & noexcept(detail::aborts) { return value(); }
    T *operator->() noexcept(detail::aborts) { return checked(this); }
    const T *operator->() const noexcept(detail::aborts) { return checked(this); }

    /// The value, or the argument if the call failed.
    T value_or(T otherwise) const & { return ok() ? value() : std::move(otherwise); }
    T value_or(T otherwise) && { return ok() ? std::move(*checked(this)) : std::move(otherwise); }

    /// The value, moved out: `vg::Context context = vg::Context::make().take();`
    T take() { return std::move(*checked(this)); }

    const Error &error() const noexcept {
        const Error *error = std::get_if<1>(&held_);
        if (error == nullptr) {
            detail::misused("no error:", "the call succeeded");
        }
        return *error;
    }

  private:
    template <class Self>
    static auto checked(Self *self) noexcept(detail::aborts) -> decltype(std::get_if<0>(&self->held_)) {
        auto *value = std::get_if<0>(&self->held_);
        if (value == nullptr) {
            detail::no_value(*std::get_if<1>(&self->held_));
        }
        return value;
    }

    std::variant<T, Error> held_;
};

/// The result of a call that only succeeds or fails.
template <> class [[nodiscard]] Result<void> {
  public:
    Result() noexcept = default;
    Result(Error error) : error_(std::move(error)), ok_(false) {}

    bool ok() const noexcept { return ok_; }
    explicit operator bool() const noexcept { return ok_; }

    /// Does nothing; exists so that generic code can handle any Result.
    void take() const noexcept(detail::aborts) {
        if (!ok_) {
            detail::no_value(error_);
        }
    }

    const Error &error() const noexcept {
        if (ok_) {
            detail::misused("no error:", "the call succeeded");
        }
        return error_;
    }

  private:
    Error error_{};
    bool ok_ = true;
};

namespace detail {

/// The numbers of an array of points or pixels, one after the other; NULL where there are none.
template <class T, std::size_t N> const T *numbers(const std::vector<std::array<T, N>> &elements) noexcept {
    static_assert(sizeof(std::array<T, N>) == N * sizeof(T), "elements lie without gaps");
    return elements.empty() ? nullptr : elements.front().data();
}
template <class T, std::size_t N> T *numbers(std::vector<std::array<T, N>> &elements) noexcept {
    return const_cast<T *>(numbers(std::as_const(elements)));
}

/// Converts the C error to an Error and frees it.
inline Error caught(vg_status status, vg_error *error) {
    Error ours{status, vg_error_message(error)};
    vg_error_free(error);
    return ours;
}

/// Calls a function that only returns a status.
template <class Call> Result<void> done(Call call) {
    vg_error *error = nullptr;
    const vg_status status = call(&error);
    if (status != VG_STATUS_OK) {
        return caught(status, error);
    }
    return {};
}

/// Calls a function that fills `value`.
template <class T, class Call> Result<T> filled(T value, Call call) {
    vg_error *error = nullptr;
    const vg_status status = call(&value, &error);
    if (status != VG_STATUS_OK) {
        return caught(status, error);
    }
    return value;
}

/// Calls a function that makes a handle.
template <class Owner, class Call> Result<Owner> made(Call call) {
    typename Owner::Handle *handle = nullptr;
    vg_error *error = nullptr;
    const vg_status status = call(&handle, &error);
    if (status != VG_STATUS_OK) {
        return caught(status, error);
    }
    return Owner(handle);
}

struct Free {
    void operator()(vg_context *handle) const noexcept { vg_context_free(handle); }
    void operator()(vg_model *handle) const noexcept { vg_model_free(handle); }
    void operator()(vg_gaussians *handle) const noexcept { vg_gaussians_free(handle); }
    void operator()(vg_report *handle) const noexcept { vg_report_free(handle); }
    void operator()(vg_scene *handle) const noexcept { vg_scene_free(handle); }
    void operator()(vg_renderer *handle) const noexcept { vg_renderer_free(handle); }
};

} // namespace detail

// ---- Small types

/// Version of the library that is running, "0.1.0".
inline const char *version() noexcept {
    return vg_version();
}

/// A view of elements that it does not own. Converts to std::span where there is one.
template <class T> class Span {
  public:
    constexpr Span() noexcept = default;
    constexpr Span(T *data, std::size_t size) noexcept : data_(data), size_(size) {}

    constexpr T *data() const noexcept { return data_; }
    constexpr std::size_t size() const noexcept { return size_; }
    constexpr bool empty() const noexcept { return size_ == 0; }
    constexpr T *begin() const noexcept { return data_; }
    constexpr T *end() const noexcept { return data_ + size_; }
    constexpr T &operator[](std::size_t index) const noexcept { return data_[index]; }

  private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};

/// Camera to vehicle: the first three rows [R | t] of a 4x4 matrix, ROW-MAJOR, metres.
using Pose = std::array<double, 12>;

/// A 4x4 similarity, ROW-MAJOR, as `vehicle_from_world`.
using Similarity = std::array<double, 16>;

/// The pose of a camera at the vehicle's origin that looks along the vehicle's z axis.
constexpr Pose identity_pose{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

/// Return value of a progress callback.
enum class Flow {
    Continue,
    /// Ends the call with VG_STATUS_CANCELLED.
    Cancel,
};

/// Receives the stage and the fraction of it that is done, 0 to 1.
using ProgressCallback = std::function<Flow(const char *stage, double fraction)>;

/// Receives one line.
using LogCallback = std::function<void(vg_log_level level, const char *message)>;

namespace detail {

inline std::int32_t progress(const char *stage, double fraction, void *user) noexcept {
    const auto &callback = *static_cast<const ProgressCallback *>(user);
    return callback(stage, fraction) == Flow::Continue ? 0 : 1;
}

inline void log(std::int32_t level, const char *message, void *user) noexcept {
    const auto &callback = *static_cast<const LogCallback *>(user);
    callback(static_cast<vg_log_level>(level), message);
}

/// The callback as the user pointer that the functions above receive; they do not change it.
template <class Callback> void *user_pointer(const Callback &callback) noexcept {
    return const_cast<Callback *>(&callback);
}

} // namespace detail

// ---- Choices

/// Where metric depth comes from: vg_prior.
enum class Prior : std::int32_t {
    Auto = VG_PRIOR_AUTO,
    Given = VG_PRIOR_GIVEN,
    Hull = VG_PRIOR_HULL,
    Onnx = VG_PRIOR_ONNX,
    Shape = VG_PRIOR_SHAPE,
};

/// How the side that was not photographed is completed: vg_symmetry.
enum class Symmetry : std::int32_t {
    Auto = VG_SYMMETRY_AUTO,
    Always = VG_SYMMETRY_ALWAYS,
    Never = VG_SYMMETRY_NEVER,
    Flip = VG_SYMMETRY_FLIP,
};

/// Whether cameras and the plane of symmetry are corrected first: vg_calibrate.
enum class Calibrate : std::int32_t {
    Auto = VG_CALIBRATE_AUTO,
    Off = VG_CALIBRATE_OFF,
};

/// Whether mirror images are relit for their own side: vg_relight.
enum class Relight : std::int32_t {
    Auto = VG_RELIGHT_AUTO,
    Never = VG_RELIGHT_NEVER,
};

/// Omissions that must not be made, as a set: `vg::Keep::Overlap | vg::Keep::Floaters`. vg_keep.
enum class Keep : std::uint32_t {
    Nothing = 0,
    DuplicateViews = VG_KEEP_DUPLICATE_VIEWS,
    Overlap = VG_KEEP_OVERLAP,
    SilhouetteEdge = VG_KEEP_SILHOUETTE_EDGE,
    Floaters = VG_KEEP_FLOATERS,
    ShBands = VG_KEEP_SH_BANDS,
};

constexpr Keep operator|(Keep a, Keep b) noexcept {
    return static_cast<Keep>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}

/// Device that runs a network: vg_provider.
enum class Provider : std::int32_t {
    Cpu = VG_PROVIDER_CPU,
    Cuda = VG_PROVIDER_CUDA,
};

/// Whether a network's weights are repacked: vg_prepack.
enum class Prepack : std::int32_t {
    Auto = VG_PREPACK_AUTO,
    Always = VG_PREPACK_ALWAYS,
    Never = VG_PREPACK_NEVER,
};

/// Renderer: vg_backend.
enum class Backend : std::int32_t {
    Auto = VG_BACKEND_AUTO,
    Cpu = VG_BACKEND_CPU,
    Gpu = VG_BACKEND_GPU,
};

/// Background: vg_background.
enum class Background : std::int32_t {
    Color = VG_BACKGROUND_COLOR,
    Transparent = VG_BACKGROUND_TRANSPARENT,
};

/// Straight or premultiplied alpha: vg_alpha.
enum class Alpha : std::int32_t {
    Straight = VG_ALPHA_STRAIGHT,
    Premultiplied = VG_ALPHA_PREMULTIPLIED,
};

/// Definition of a pixel's depth: vg_depth_mode.
enum class DepthMode : std::int32_t {
    Expected = VG_DEPTH_MODE_EXPECTED,
    Accumulated = VG_DEPTH_MODE_ACCUMULATED,
};

/// Layout of pixels in memory: vg_format.
enum class Format : std::int32_t {
    Rgb8 = VG_FORMAT_RGB8,
    Bgr8 = VG_FORMAT_BGR8,
    Rgba8 = VG_FORMAT_RGBA8,
    Bgra8 = VG_FORMAT_BGRA8,
    Gray8 = VG_FORMAT_GRAY8,
    Rgba32f = VG_FORMAT_RGBA32F,
    Depth32f = VG_FORMAT_DEPTH32F,
};

/// Which end of a vehicle is its front: vg_heading.
enum class Heading : std::int32_t {
    Auto = VG_HEADING_AUTO,
    Forward = VG_HEADING_FORWARD,
    Backward = VG_HEADING_BACKWARD,
};

namespace detail {

/// A field of a C struct that holds an enumerator of one enumeration as a number. Accepts the enumerators of vg.hpp and
/// of vg.h and no others. It hides the number of the same name in the base struct.
template <class Choice, class Name, class Number = std::int32_t> class Field {
  public:
    explicit Field(Number &number) noexcept : number_(&number) {}
    Field(const Field &) = delete;

    Field &operator=(Choice choice) noexcept {
        *number_ = static_cast<Number>(choice);
        return *this;
    }
    Field &operator=(Name name) noexcept { return *this = static_cast<Choice>(name); }
    Field &operator=(const Field &other) noexcept { return *this = static_cast<Choice>(other); }

    operator Choice() const noexcept { return static_cast<Choice>(*number_); }
    friend bool operator==(const Field &field, Name name) noexcept {
        return static_cast<Choice>(field) == static_cast<Choice>(name);
    }
    friend bool operator!=(const Field &field, Name name) noexcept { return !(field == name); }

  private:
    Number *number_;
};

} // namespace detail

// ---- Context

/// Worker threads and scratch memory that several calls share: `options.context = context.get()`. It
/// must outlive the calls that use it; any number of threads may use it at a time.
class Context {
  public:
    using Handle = vg_context;

    Context() noexcept = default;
    explicit Context(vg_context *owned) noexcept : handle_(owned) {}

    /// `threads`: 1 to 1024; 0: one per core.
    static Result<Context> make(std::uint32_t threads = 0) {
        vg_context_options options;
        vg_context_options_init(&options, sizeof options);
        options.threads = threads;
        return detail::made<Context>(
            [&](vg_context **out, vg_error **error) { return vg_context_new(&options, out, error); });
    }

    std::uint32_t threads() const noexcept { return vg_context_threads(handle_.get()); }
    /// Ends the threads and frees the memory that calls without a context share.
    static void free_default() noexcept { vg_default_context_free(); }

    vg_context *get() const noexcept { return handle_.get(); }
    /// Releases the handle, which the caller must then free.
    vg_context *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_context, detail::Free> handle_;
};

// ---- Cameras and poses

/// A camera without lens distortion, pixels. The centre of the top-left pixel is (0.5, 0.5).
inline Result<vg_camera> pinhole(double fx, double fy, double cx, double cy, std::uint32_t width,
                                 std::uint32_t height, const Pose &vehicle_from_camera = identity_pose) {
    const double params[4] = {fx, fy, cx, cy};
    return detail::filled(vg_camera{}, [&](vg_camera *out, vg_error **error) {
        return vg_camera_from_colmap_model(VG_CAMERA_MODEL_PINHOLE, params, 4, width, height,
                                           vehicle_from_camera.data(), out, error);
    });
}

/// One of COLMAP's cameras: its model's number and its parameters in COLMAP's order.
inline Result<vg_camera> camera_from_colmap(std::int32_t model, const std::vector<double> &params,
                                            std::uint32_t width, std::uint32_t height,
                                            const Pose &vehicle_from_camera = identity_pose) {
    return detail::filled(vg_camera{}, [&](vg_camera *out, vg_error **error) {
        return vg_camera_from_colmap_model(model, params.data(), params.size(), width, height,
                                           vehicle_from_camera.data(), out, error);
    });
}

/// OpenCV's lens models.
enum class Lens {
    /// cv::calibrateCamera
    Standard,
    /// cv::fisheye::calibrate
    Fisheye,
};

/// A camera from OpenCV's calibration: the 3x3 camera matrix, row-major, and 0, 4, 5, 8, 12 or 14 numbers of
/// distortion, see vg_camera_from_opencv.
inline Result<vg_camera> camera_from_opencv(const std::array<double, 9> &k,
                                            const std::vector<double> &distortion, Lens lens,
                                            std::uint32_t width, std::uint32_t height,
                                            const Pose &vehicle_from_camera = identity_pose) {
    return detail::filled(vg_camera{}, [&](vg_camera *out, vg_error **error) {
        return vg_camera_from_opencv(k.data(), distortion.data(), distortion.size(),
                                     lens == Lens::Fisheye ? 1 : 0, width, height, vehicle_from_camera.data(),
                                     out, error);
    });
}

/// The camera with another pose.
inline vg_camera placed(vg_camera camera, const Pose &vehicle_from_camera) noexcept {
    for (std::size_t i = 0; i < vehicle_from_camera.size(); i++) {
        camera.vehicle_from_camera[i] = vehicle_from_camera[i];
    }
    return camera;
}

/// The camera of the picture resized.
inline Result<vg_camera> scaled(const vg_camera &camera, std::uint32_t width, std::uint32_t height) {
    return detail::filled(vg_camera{}, [&](vg_camera *out, vg_error **error) {
        return vg_camera_scale(&camera, width, height, out, error);
    });
}

/// The camera of a part of the picture.
inline Result<vg_camera> cropped(const vg_camera &camera, std::uint32_t x, std::uint32_t y,
                                 std::uint32_t width, std::uint32_t height) {
    return detail::filled(vg_camera{}, [&](vg_camera *out, vg_error **error) {
        return vg_camera_crop(&camera, x, y, width, height, out, error);
    });
}

/// A point, metres, vehicle frame.
using Point = std::array<double, 3>;

/// Column and row.
using Pixel = std::array<double, 2>;

/// Column and row of a point in the vehicle's frame; an error if the camera does not see it.
inline Result<std::array<double, 2>> project(const vg_camera &camera, const Point &point_vehicle) {
    return detail::filled(std::array<double, 2>{}, [&](std::array<double, 2> *out, vg_error **error) {
        return vg_camera_project(&camera, point_vehicle.data(), out->data(), error);
    });
}

/// A pose from COLMAP's QW QX QY QZ and TX TY TZ, world to camera. `vehicle_from_world` NULL: the world is
/// the vehicle's frame.
inline Result<Pose> pose_from_colmap(const std::array<double, 4> &qvec, const std::array<double, 3> &tvec,
                                     const Similarity *vehicle_from_world = nullptr) {
    return detail::filled(Pose{}, [&](Pose *out, vg_error **error) {
        const double *similarity = vehicle_from_world == nullptr ? nullptr : vehicle_from_world->data();
        return vg_pose_from_colmap(qvec.data(), tvec.data(), similarity, out->data(), error);
    });
}

/// A pose from camera to world with OpenGL's camera axes (x right, y up, z backward), as nerfstudio and
/// Blender have.
inline Result<Pose> pose_from_opengl(const Pose &camera_to_world,
                                     const Similarity *vehicle_from_world = nullptr) {
    return detail::filled(Pose{}, [&](Pose *out, vg_error **error) {
        const double *similarity = vehicle_from_world == nullptr ? nullptr : vehicle_from_world->data();
        return vg_pose_from_opengl(camera_to_world.data(), similarity, out->data(), error);
    });
}

/// A pose from OpenCV's rvec, whose direction is an axis and whose length an angle in radians, and tvec, world to
/// camera, as cv::solvePnP leaves them.
inline Result<Pose> pose_from_opencv(const std::array<double, 3> &rvec, const std::array<double, 3> &tvec,
                                     const Similarity *vehicle_from_world = nullptr) {
    return detail::filled(Pose{}, [&](Pose *out, vg_error **error) {
        const double *similarity = vehicle_from_world == nullptr ? nullptr : vehicle_from_world->data();
        return vg_pose_from_opencv(rvec.data(), tvec.data(), similarity, out->data(), error);
    });
}

/// A pose from where a tracked vehicle and the camera are in a common frame.
inline Result<Pose> pose_from_box(const Pose &vehicle_in_ego, const Pose &camera_in_ego) {
    return detail::filled(Pose{}, [&](Pose *out, vg_error **error) {
        return vg_pose_from_box(vehicle_in_ego.data(), camera_in_ego.data(), out->data(), error);
    });
}

/// Pixels of points, and their planar depths.
struct Projected {
    /// NAN where the camera does not see the point.
    std::vector<Pixel> pixels;
    /// Metres; NAN where there is no pixel.
    std::vector<double> depths;
};

/// Pixels and depths of points, through the camera's lens.
inline Result<Projected> project(const vg_camera &camera, const std::vector<Point> &points) {
    Projected projected{std::vector<Pixel>(points.size()), std::vector<double>(points.size())};
    const Result<void> done = detail::done([&](vg_error **error) {
        return vg_camera_project_points(&camera, detail::numbers(points), points.size(),
                                        detail::numbers(projected.pixels), projected.depths.data(), error);
    });
    if (!done) {
        return done.error();
    }
    return projected;
}

/// The point at a planar depth, metres, behind a pixel; an error if the lens defines no ray for it.
inline Result<Point> unproject(const vg_camera &camera, const Pixel &pixel, double depth_m) {
    return detail::filled(Point{}, [&](Point *out, vg_error **error) {
        return vg_camera_unproject(&camera, pixel.data(), depth_m, out->data(), error);
    });
}

/// The points behind pixels, one depth each; NAN where the depth means no measurement or the lens defines no ray.
inline Result<std::vector<Point>> unproject(const vg_camera &camera, const std::vector<Pixel> &pixels,
                                            const std::vector<double> &depths) {
    if (pixels.size() != depths.size()) {
        return Error{VG_STATUS_ARGUMENT, "depths: " + std::to_string(depths.size()) +
                                             ", allowed: as many as pixels, " + std::to_string(pixels.size())};
    }
    std::vector<Point> points(pixels.size());
    const Result<void> done = detail::done([&](vg_error **error) {
        return vg_camera_unproject_points(&camera, detail::numbers(pixels), depths.data(), pixels.size(),
                                          detail::numbers(points), error);
    });
    if (!done) {
        return done.error();
    }
    return points;
}

/// Default upward direction of a picture: the vehicle's z axis.
constexpr Point z_up{0, 0, 1};

/// A pose by where the camera stands, a point on its optical axis, and the direction that is up in the picture.
inline Result<Pose> pose_look_at(const Point &eye, const Point &target, const Point &up = z_up) {
    return detail::filled(Pose{}, [&](Pose *out, vg_error **error) {
        return vg_pose_look_at(eye.data(), target.data(), up.data(), out->data(), error);
    });
}

/// A pinhole camera at `eye` that looks at `target`; `fov_y_degrees` from the top to the bottom of the picture.
inline Result<vg_camera> look_at(const Point &eye, const Point &target, double fov_y_degrees, std::uint32_t width,
                                 std::uint32_t height, const Point &up = z_up) {
    return detail::filled(vg_camera{}, [&](vg_camera *out, vg_error **error) {
        return vg_camera_look_at(eye.data(), target.data(), up.data(), fov_y_degrees, width, height, out, error);
    });
}

// ---- Views

/// A picture in the caller's memory. `row_stride`: bytes from one row to the next; 0: rows without gaps.
inline vg_image image(const void *data, std::uint32_t width, std::uint32_t height, vg_format format,
                      std::size_t row_stride = 0) noexcept {
    vg_image image{};
    image.data = data;
    image.row_stride = row_stride;
    image.width = width;
    image.height = height;
    image.format = format;
    return image;
}

/// A photograph with its camera. `vg_image{}`: no mask, no depth. `name`: NULL, or a name for messages and
/// the report, which must outlive the view.
inline vg_view view(const vg_image &image, const vg_image &mask, const vg_camera &camera,
                    const vg_image &depth = vg_image{}, const char *name = nullptr) noexcept {
    vg_view view;
    vg_view_init(&view, sizeof view);
    view.name = name;
    view.camera = camera;
    view.image = image;
    view.mask = mask;
    view.depth = depth;
    return view;
}

/// Options for reading a scene.
struct SceneOptions : vg_scene_options {
    /// Views to read, in this order, by path, file name or stem; empty: all. Used instead of `names`.
    std::vector<std::string> view_names;
    /// Receives warnings about legal input that looks like a mistake. Used instead of `log`.
    LogCallback on_log;

    SceneOptions() noexcept : vg_scene_options{} { vg_scene_options_init(this, sizeof(vg_scene_options)); }
};

/// Views read from files, with their pixels.
class Scene {
  public:
    using Handle = vg_scene;

    Scene() noexcept = default;
    explicit Scene(vg_scene *owned) noexcept : handle_(owned) {}

    /// Reads a nerfstudio scene: a `transforms.json`, or a folder that holds one.
    static Result<Scene> open_transforms(const std::string &path, const SceneOptions &options = {}) {
        return open(vg_transforms_open, path, options);
    }

    /// Reads a COLMAP folder. `options.vehicle_from_world` is required.
    static Result<Scene> open_colmap(const std::string &path, const SceneOptions &options) {
        return open(vg_colmap_open, path, options);
    }

    std::size_t size() const noexcept { return vg_scene_view_count(handle_.get()); }

    /// One view, which points into the scene.
    Result<vg_view> view(std::size_t index) const {
        vg_view view;
        vg_view_init(&view, sizeof view);
        return detail::filled(view, [&](vg_view *out, vg_error **error) {
            return vg_scene_get_view(handle_.get(), index, out, error);
        });
    }

    /// All views, which point into the scene.
    Result<std::vector<vg_view>> views() const {
        std::vector<vg_view> views;
        for (std::size_t index = 0; index < size(); index++) {
            Result<vg_view> found = view(index);
            if (!found) {
                return found.error();
            }
            views.push_back(*found);
        }
        return views;
    }

    const vg_scene *get() const noexcept { return handle_.get(); }
    /// Releases the handle, which the caller must then free.
    vg_scene *release() noexcept { return handle_.release(); }

  private:
    template <class Open>
    static Result<Scene> open(Open open, const std::string &path, const SceneOptions &options) {
        vg_scene_options c_options = options;
        std::vector<const char *> names;
        for (const std::string &name : options.view_names) {
            names.push_back(name.c_str());
        }
        if (!names.empty()) {
            c_options.names = names.data();
            c_options.name_count = names.size();
        }
        if (options.on_log) {
            c_options.log = detail::log;
            c_options.log_user = detail::user_pointer(options.on_log);
        }
        return detail::made<Scene>(
            [&](vg_scene **out, vg_error **error) { return open(path.c_str(), &c_options, out, error); });
    }

    std::unique_ptr<vg_scene, detail::Free> handle_;
};

// ---- Gaussians

/// Arrays from which Gaussians are made.
struct GaussianArrays : vg_gaussian_arrays {
    GaussianArrays() noexcept : vg_gaussian_arrays{} {
        vg_gaussian_arrays_init(this, sizeof(vg_gaussian_arrays));
    }
};

/// An immutable set of Gaussians. Any number of threads may read or render one at the same time.
class Gaussians {
  public:
    using Handle = vg_gaussians;

    Gaussians() noexcept = default;
    explicit Gaussians(vg_gaussians *owned) noexcept : handle_(owned) {}

    /// Reads a PLY file in the layout of 3D Gaussian Splatting.
    static Result<Gaussians> load_ply(const std::string &path) {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_load_ply(path.c_str(), out, error);
        });
    }

    /// Makes Gaussians from the caller's arrays, which are copied and checked.
    static Result<Gaussians> from_arrays(const vg_gaussian_arrays &arrays) {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_from_arrays(&arrays, out, error);
        });
    }

    /// Writes a PLY file in the layout of 3D Gaussian Splatting.
    Result<void> save_ply(const std::string &path) const {
        return detail::done(
            [&](vg_error **error) { return vg_gaussians_save_ply(handle_.get(), path.c_str(), error); });
    }

    /// Reads the bytes of a PLY file.
    static Result<Gaussians> from_ply(const void *data, std::size_t bytes) {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_load_ply_memory(data, bytes, out, error);
        });
    }
    static Result<Gaussians> from_ply(const std::vector<std::uint8_t> &bytes) {
        return from_ply(bytes.data(), bytes.size());
    }

    /// Returns the bytes of a PLY file.
    Result<std::vector<std::uint8_t>> to_ply() const {
        std::vector<std::uint8_t> bytes(vg_gaussians_ply_size(handle_.get()));
        const Result<void> done = detail::done([&](vg_error **error) {
            return vg_gaussians_save_ply_memory(handle_.get(), bytes.data(), bytes.size(), error);
        });
        if (!done) {
            return done.error();
        }
        return bytes;
    }

    /// The Gaussians at these indices, in this order; an index may be repeated.
    Result<Gaussians> selected(const std::vector<std::size_t> &indices) const {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_select(handle_.get(), indices.data(), indices.size(), out, error);
        });
    }

    /// The Gaussians whose byte is not 0, in order.
    Result<Gaussians> masked(const std::vector<std::uint8_t> &keep) const {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_mask(handle_.get(), keep.data(), keep.size(), out, error);
        });
    }

    /// The Gaussians whose centre lies in the box from `low` to `high`, including its faces, in order.
    Result<Gaussians> cropped(const std::array<double, 3> &low, const std::array<double, 3> &high) const {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_crop(handle_.get(), low.data(), high.data(), out, error);
        });
    }

    /// The Gaussians with a peak opacity of `least` or more, in order.
    Result<Gaussians> with_opacity_of(float least) const {
        std::vector<std::uint8_t> keep;
        keep.reserve(size());
        for (const float opacity : opacities()) {
            keep.push_back(opacity >= least);
        }
        return masked(keep);
    }

    /// Covariances, square metres: xx, xy, xz, yy, yz, zz of each.
    Result<std::vector<std::array<float, 6>>> covariances() const {
        std::vector<std::array<float, 6>> covariances(size());
        const Result<void> done = detail::done([&](vg_error **error) {
            return vg_gaussians_covariances(handle_.get(), detail::numbers(covariances), size(), error);
        });
        if (!done) {
            return done.error();
        }
        return covariances;
    }

    /// The Gaussians in another frame: rotation, positive scale, translation in metres.
    Result<Gaussians> transformed(const Similarity &to_from_vehicle) const {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_transform(handle_.get(), to_from_vehicle.data(), out, error);
        });
    }

    /// The mirror image across y = 0.
    Result<Gaussians> mirrored() const {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_mirror(handle_.get(), out, error);
        });
    }

    /// These Gaussians followed by those of `second`.
    Result<Gaussians> merged(const Gaussians &second) const {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_merge(handle_.get(), second.get(), out, error);
        });
    }

    std::size_t size() const noexcept { return vg_gaussians_count(handle_.get()); }
    bool empty() const noexcept { return size() == 0; }

    /// Degree of the spherical harmonics, 0 to 3.
    std::int32_t sh_degree() const noexcept { return vg_gaussians_sh_degree(handle_.get()); }

    /// Centres, metres. `[size][3]`
    Span<const float> positions() const noexcept {
        return {vg_gaussians_positions(handle_.get()), 3 * size()};
    }
    /// Standard deviations along the Gaussian's own axes, metres. `[size][3]`
    Span<const float> scales() const noexcept { return {vg_gaussians_scales(handle_.get()), 3 * size()}; }
    /// Unit quaternions w, x, y, z: the Gaussian's axes to the vehicle's. `[size][4]`
    Span<const float> rotations() const noexcept {
        return {vg_gaussians_rotations(handle_.get()), 4 * size()};
    }
    /// Peak opacities, 0 to 1. `[size]`
    Span<const float> opacities() const noexcept { return {vg_gaussians_opacities(handle_.get()), size()}; }
    /// Coefficients of spherical harmonics. `[size][(sh_degree + 1)^2][3]`
    Span<const float> sh() const noexcept {
        const std::size_t side = static_cast<std::size_t>(sh_degree()) + 1;
        return {vg_gaussians_sh(handle_.get()), 3 * side * side * size()};
    }

    const vg_gaussians *get() const noexcept { return handle_.get(); }
    /// Releases the handle, which the caller must then free.
    vg_gaussians *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_gaussians, detail::Free> handle_;
};

/// Cameras on a circle around Gaussians, from the vehicle's front towards its left, each with all of their centres
/// in its picture.
inline Result<std::vector<vg_camera>> turntable(const Gaussians &gaussians, std::size_t count, std::uint32_t width,
                                                std::uint32_t height, double elevation_degrees = 12,
                                                double fov_y_degrees = 35) {
    // A count of no sensible size is refused by the library before memory is allocated.
    std::vector<vg_camera> cameras(count <= 100000 ? count : 0);
    vg_camera none{};
    const Result<void> done = detail::done([&](vg_error **error) {
        return vg_cameras_turntable(gaussians.get(), count, elevation_degrees, fov_y_degrees, width, height,
                                    cameras.empty() ? &none : cameras.data(), error);
    });
    if (!done) {
        return done.error();
    }
    return cameras;
}

// ---- Networks

namespace detail {

/// vg_model_options with typed enumerations.
struct ModelFields : vg_model_options {
    Field<Provider, vg_provider> provider{vg_model_options::provider};
    Field<Prepack, vg_prepack> prepack{vg_model_options::prepack};

    ModelFields() noexcept : vg_model_options{} { vg_model_options_init(this, sizeof(vg_model_options)); }
    ModelFields(const ModelFields &other) noexcept : vg_model_options(other) {}
    ModelFields &operator=(const ModelFields &other) noexcept {
        vg_model_options::operator=(other);
        return *this;
    }
};

} // namespace detail

/// Options for opening a model.
struct ModelOptions : detail::ModelFields {
    /// ONNX Runtime, the library or its folder; empty: see `runtime`. Used instead of `runtime`.
    std::string runtime_path;
};

/// An open ONNX model, for `Options::lend_prior` and `Options::lend_head`. It must outlive the calls that use it;
/// any number of threads may use it at a time.
class Model {
  public:
    using Handle = vg_model;

    Model() noexcept = default;
    explicit Model(vg_model *owned) noexcept : handle_(owned) {}

    /// The model in an ONNX file.
    static Result<Model> open(const std::string &path, const ModelOptions &options = {}) {
        vg_model_options c_options = options;
        if (!options.runtime_path.empty()) {
            c_options.runtime = options.runtime_path.c_str();
        }
        return detail::made<Model>([&](vg_model **out, vg_error **error) {
            return vg_model_open(path.c_str(), &c_options, out, error);
        });
    }

    const vg_model *get() const noexcept { return handle_.get(); }
    /// Releases the handle, which the caller must then free.
    vg_model *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_model, detail::Free> handle_;
};

/// Settings of a mask.
struct SegmentOptions : vg_segment_options {
    SegmentOptions() noexcept : vg_segment_options{} {
        vg_segment_options_init(this, sizeof(vg_segment_options));
    }
};

/// Computes the mask of a photograph by a segmentation network: one byte per pixel, rows without gaps, 255
/// for the vehicle at the origin of the camera's vehicle frame.
inline Result<std::vector<std::uint8_t>> segment(const Model &model, const vg_image &photograph,
                                                 const vg_camera &camera, const SegmentOptions &options = {}) {
    // A picture of no sensible size is refused by the library before memory is allocated.
    const bool sensible = photograph.width <= 8192 && photograph.height <= 8192;
    std::vector<std::uint8_t> mask(sensible ? std::size_t{photograph.width} * photograph.height : 0);
    const Result<void> made = detail::done([&](vg_error **error) {
        return vg_segment(model.get(), &photograph, &camera, &options, mask.data(), 0, error);
    });
    if (!made) {
        return made.error();
    }
    return mask;
}

// ---- Reconstruction

namespace detail {

/// vg_options with typed enumerations.
struct OptionFields : vg_options {
    Field<Prior, vg_prior> prior{vg_options::prior};
    Field<Symmetry, vg_symmetry> symmetry{vg_options::symmetry};
    Field<Keep, vg_keep, std::uint32_t> keep{vg_options::keep};
    Field<Calibrate, vg_calibrate> calibrate{vg_options::calibrate};
    Field<Relight, vg_relight> relight{vg_options::relight};
    Field<Backend, vg_backend> refine_backend{vg_options::refine_backend};

    OptionFields() noexcept : vg_options{} { vg_options_init(this, sizeof(vg_options)); }
    OptionFields(const OptionFields &other) noexcept : vg_options(other) {}
    OptionFields &operator=(const OptionFields &other) noexcept {
        vg_options::operator=(other);
        return *this;
    }
};

} // namespace detail

/// Settings of a reconstruction.
struct Options : detail::OptionFields {
    /// Used instead of `progress`.
    ProgressCallback on_progress;
    /// Used instead of `log`.
    LogCallback on_log;

    /// Measured points, metres, vehicle frame: borrowed, and copied by the call. A temporary does not compile.
    void lend_cloud(const std::vector<std::array<float, 3>> &measured) noexcept {
        static_assert(sizeof(std::array<float, 3>) == 3 * sizeof(float), "points lie without gaps");
        cloud = measured.empty() ? nullptr : measured.front().data();
        cloud_count = measured.size();
    }
    void lend_cloud(const std::vector<std::array<float, 3>> &&) = delete;

    /// Depth from a network: borrowed until the call returns. A temporary does not compile.
    void lend_prior(const Model &model) noexcept {
        prior = Prior::Onnx;
        prior_model = model.get();
    }
    void lend_prior(const Model &&) = delete;

    /// Gaussians from a network: borrowed until the call returns. A temporary does not compile.
    void lend_head(const Model &model) noexcept { head_model = model.get(); }
    void lend_head(const Model &&) = delete;
};

/// Report of a reconstruction.
class Report {
  public:
    using Handle = vg_report;

    Report() noexcept = default;
    explicit Report(vg_report *owned) noexcept : handle_(owned) {}

    /// The main figures; zeros where the report is empty.
    vg_report_figures figures() const noexcept {
        vg_report_figures figures;
        vg_report_figures_init(&figures, sizeof figures);
        vg_report_get_figures(handle_.get(), &figures, nullptr);
        return figures;
    }

    /// The whole report. Lives as long as the report.
    const char *json() const noexcept { return vg_report_json(handle_.get()); }

    /// A reason why `figures().verdict` is not `VG_VERDICT_GOOD`, one line; `index` below `figures().reason_count`.
    /// Lives as long as the report.
    const char *reason(std::size_t index) const noexcept { return vg_report_reason(handle_.get(), index); }

    /// Positions of the metric point cloud, metres; none unless `options.points` was 1. `[count][3]`
    Span<const float> point_positions() const noexcept {
        return {vg_report_point_positions(handle_.get()), 3 * vg_report_point_count(handle_.get())};
    }
    /// Colours of the metric point cloud, sRGB. `[count][3]`
    Span<const std::uint8_t> point_colors() const noexcept {
        return {vg_report_point_colors(handle_.get()), 3 * vg_report_point_count(handle_.get())};
    }

    const vg_report *get() const noexcept { return handle_.get(); }
    /// Releases the handle, which the caller must then free.
    vg_report *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_report, detail::Free> handle_;
};

/// A model of a vehicle and the report of its reconstruction.
struct Reconstruction {
    Gaussians gaussians;
    Report report;
};

/// Makes a complete model of a vehicle from photographs of one side. Equal views and options give equal bytes.
inline Result<Reconstruction> reconstruct(const vg_view *views, std::size_t view_count,
                                          const Options &options = {}) {
    vg_options c_options = options;
    if (options.on_progress) {
        c_options.progress = detail::progress;
        c_options.progress_user = detail::user_pointer(options.on_progress);
    }
    if (options.on_log) {
        c_options.log = detail::log;
        c_options.log_user = detail::user_pointer(options.on_log);
    }
    vg_report *report = nullptr;
    Result<Gaussians> gaussians = detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
        return vg_reconstruct(views, view_count, &c_options, out, &report, error);
    });
    if (!gaussians) {
        return gaussians.error();
    }
    return Reconstruction{gaussians.take(), Report(report)};
}

inline Result<Reconstruction> reconstruct(const std::vector<vg_view> &views, const Options &options = {}) {
    return reconstruct(views.data(), views.size(), options);
}

namespace detail {

/// vg_refine_options with a typed enumeration.
struct RefineFields : vg_refine_options {
    Field<Backend, vg_backend> backend{vg_refine_options::backend};

    RefineFields() noexcept : vg_refine_options{} { vg_refine_options_init(this, sizeof(vg_refine_options)); }
    RefineFields(const RefineFields &other) noexcept : vg_refine_options(other) {}
    RefineFields &operator=(const RefineFields &other) noexcept {
        vg_refine_options::operator=(other);
        return *this;
    }
};

} // namespace detail

/// Settings of a refinement.
struct RefineOptions : detail::RefineFields {
    /// Used instead of `progress`.
    ProgressCallback on_progress;
};

/// Refined Gaussians and the report of the refinement.
struct Refined {
    Gaussians gaussians;
    vg_refinement refinement;
};

/// Optimises the Gaussians of any model so that their pictures match the photographs. Equal input and number of steps
/// give equal bytes.
inline Result<Refined> refine(const Gaussians &gaussians, const std::vector<vg_view> &views,
                              const RefineOptions &options = {}) {
    vg_refine_options c_options = options;
    if (options.on_progress) {
        c_options.progress = detail::progress;
        c_options.progress_user = detail::user_pointer(options.on_progress);
    }
    vg_refinement refinement;
    vg_refinement_init(&refinement, sizeof refinement);
    Result<Gaussians> refined = detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
        return vg_refine(gaussians.get(), views.data(), views.size(), &c_options, out, &refinement, error);
    });
    if (!refined) {
        return refined.error();
    }
    return Refined{refined.take(), refinement};
}

// ---- Pictures

/// Settings of a picture.
struct RenderOptions : vg_render_options {
    detail::Field<Backend, vg_backend> backend{vg_render_options::backend};
    detail::Field<Background, vg_background> background{vg_render_options::background};
    detail::Field<Alpha, vg_alpha> alpha{vg_render_options::alpha};
    detail::Field<DepthMode, vg_depth_mode> depth_mode{vg_render_options::depth_mode};

    RenderOptions() noexcept : vg_render_options{} {
        vg_render_options_init(this, sizeof(vg_render_options));
    }
    RenderOptions(const RenderOptions &other) noexcept : vg_render_options(other) {}
    RenderOptions &operator=(const RenderOptions &other) noexcept {
        vg_render_options::operator=(other);
        return *this;
    }
};

/// Destination of a picture: the caller's memory.
struct ImageTarget : vg_image_target {
    detail::Field<Format, vg_format> color_format{vg_image_target::color_format};

    ImageTarget() noexcept : vg_image_target{} { vg_image_target_init(this, sizeof(vg_image_target)); }
    ImageTarget(const ImageTarget &other) noexcept : vg_image_target(other) {}
    ImageTarget &operator=(const ImageTarget &other) noexcept {
        vg_image_target::operator=(other);
        return *this;
    }
};

/// Colour and depth, rows without gaps, the top row first.
struct Picture {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    vg_format format = VG_FORMAT_RGBA8;
    /// `[height][width][channels]`
    std::vector<std::uint8_t> color;
    /// Planar depth, metres; 0 where there is no Gaussian. `[height][width]`
    std::vector<float> depth;
};

/// Settings of a renderer.
struct RendererOptions : vg_renderer_options {
    detail::Field<Backend, vg_backend> backend{vg_renderer_options::backend};

    RendererOptions() noexcept : vg_renderer_options{} {
        vg_renderer_options_init(this, sizeof(vg_renderer_options));
    }
    RendererOptions(const RendererOptions &other) noexcept : vg_renderer_options(other) {}
    RendererOptions &operator=(const RendererOptions &other) noexcept {
        vg_renderer_options::operator=(other);
        return *this;
    }
};

/// Gaussians prepared for rendering many times, on the CPU or a GPU. It keeps the Gaussians.
class Renderer {
  public:
    using Handle = vg_renderer;

    Renderer() noexcept = default;
    explicit Renderer(vg_renderer *owned) noexcept : handle_(owned) {}

    static Result<Renderer> make(const Gaussians &gaussians, const RendererOptions &options = {}) {
        return detail::made<Renderer>([&](vg_renderer **out, vg_error **error) {
            return vg_renderer_new(gaussians.get(), &options, out, error);
        });
    }

    /// The renderer that was chosen.
    vg_backend backend() const noexcept { return static_cast<vg_backend>(vg_renderer_backend(handle_.get())); }
    /// The renderer that was chosen, and why, in one line.
    const char *choice() const noexcept { return vg_renderer_choice(handle_.get()); }

    /// Renders `count` pictures, one per camera, into the caller's memory.
    Result<void> render_into(const vg_image_target *targets, const vg_camera *cameras, std::size_t count,
                             const RenderOptions &options = {}) const {
        return detail::done([&](vg_error **error) {
            return vg_renderer_render(handle_.get(), cameras, count, &options, targets, error);
        });
    }
    /// Renders one picture.
    Result<void> render_into(const vg_image_target &target, const vg_camera &camera,
                             const RenderOptions &options = {}) const {
        return render_into(&target, &camera, 1, options);
    }

    vg_renderer *get() const noexcept { return handle_.get(); }
    /// Releases the handle, which the caller must then free.
    vg_renderer *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_renderer, detail::Free> handle_;
};

/// Renders Gaussians from a camera into the caller's memory.
inline Result<void> render_into(const vg_image_target &target, const Gaussians &gaussians,
                                const vg_camera &camera, const RenderOptions &options = {}) {
    return detail::done(
        [&](vg_error **error) { return vg_render(gaussians.get(), &camera, &options, &target, error); });
}

/// Renders Gaussians from a camera. `format`: RGBA8 or BGRA8; RGB8 or BGR8 where the background is
/// opaque.
inline Result<Picture> render(const Gaussians &gaussians, const vg_camera &camera,
                              const RenderOptions &options = {}, vg_format format = VG_FORMAT_RGBA8) {
    std::size_t channels = 0;
    switch (format) {
    case VG_FORMAT_RGB8:
    case VG_FORMAT_BGR8:
        channels = 3;
        break;
    case VG_FORMAT_RGBA8:
    case VG_FORMAT_BGRA8:
        channels = 4;
        break;
    default:
        return Error{VG_STATUS_ARGUMENT, "format: " + std::to_string(static_cast<std::int32_t>(format)) +
                                             ", allowed: RGB8, BGR8, RGBA8, BGRA8"};
    }
    // A camera of no sensible size is refused by the library before memory is allocated.
    const bool sensible = camera.width <= 8192 && camera.height <= 8192;
    const std::size_t pixels = sensible ? std::size_t{camera.width} * camera.height : 1;
    Picture picture;
    picture.width = camera.width;
    picture.height = camera.height;
    picture.format = format;
    picture.color.resize(pixels * channels);
    picture.depth.resize(pixels);
    ImageTarget target;
    target.width = camera.width;
    target.height = camera.height;
    target.color = picture.color.data();
    target.color_format = format;
    target.depth = picture.depth.data();
    const Result<void> drawn = render_into(target, gaussians, camera, options);
    if (!drawn) {
        return drawn.error();
    }
    return picture;
}

// ---- Gradients

/// Gradient of a loss with respect to a picture: planes of the caller's memory.
struct ImageGradient : vg_image_gradient {
    ImageGradient() noexcept : vg_image_gradient{} {
        vg_image_gradient_init(this, sizeof(vg_image_gradient));
    }
};

/// Gradients of a loss with respect to Gaussians, background and camera, laid out as the arrays of `Gaussians`.
struct Gradients {
    /// Gradient of centres, per metre. `[size][3]`
    std::vector<float> positions;
    /// Gradient of standard deviations, per metre. `[size][3]`
    std::vector<float> scales;
    /// Gradient of unit quaternions w, x, y, z, perpendicular to them. `[size][4]`
    std::vector<float> rotations;
    /// Gradient of peak opacities. `[size]`
    std::vector<float> opacities;
    /// Gradient of coefficients of spherical harmonics. `[size][(sh_degree + 1)^2][3]`
    std::vector<float> sh;
    /// Gradient of the background colour; zero for a transparent one.
    std::array<double, 3> background{};
    /// Gradient of rotating the camera about its axes, per radian, then of moving it along them, per metre.
    std::array<double, 6> pose{};
    /// Gradient of the entries of camera_from_vehicle, row-major.
    std::array<double, 16> view_matrix{};
};

/// Computes a loss and returns whether to continue. Called on the calling thread; must not throw.
using LossCallback = std::function<Flow()>;

namespace detail {

inline std::int32_t loss(void *user) noexcept {
    return (*static_cast<const LossCallback *>(user))() == Flow::Continue ? 0 : 1;
}

inline Result<void> render_backward_into(Gradients &out, const Gaussians &gaussians, const vg_camera &camera,
                                         const vg_image_gradient &gradient, const vg_image_target *target,
                                         const RenderOptions &options) {
    const std::size_t size = gaussians.size();
    out.positions.resize(gaussians.positions().size());
    out.scales.resize(gaussians.scales().size());
    out.rotations.resize(gaussians.rotations().size());
    out.opacities.resize(size);
    out.sh.resize(gaussians.sh().size());
    vg_gradients arrays{};
    vg_gradients_init(&arrays, sizeof arrays);
    arrays.count = size;
    arrays.sh_degree = gaussians.sh_degree();
    arrays.positions = out.positions.data();
    arrays.scales = out.scales.data();
    arrays.rotations = out.rotations.data();
    arrays.opacities = out.opacities.data();
    arrays.sh = out.sh.data();
    arrays.background = out.background.data();
    arrays.pose = out.pose.data();
    arrays.view_matrix = out.view_matrix.data();
    return done([&](vg_error **error) {
        return vg_render_backward(gaussians.get(), &camera, &options, target, &gradient, &arrays, error);
    });
}

} // namespace detail

/// Propagates the gradient of a loss with respect to a picture back to the Gaussians, the background and the camera.
/// The picture is rendered again for that.
inline Result<Gradients> render_backward(const Gaussians &gaussians, const vg_camera &camera,
                                         const vg_image_gradient &gradient, const RenderOptions &options = {}) {
    Gradients out;
    const Result<void> gone = detail::render_backward_into(out, gaussians, camera, gradient, nullptr, options);
    if (!gone) {
        return gone.error();
    }
    return out;
}

/// Renders a picture into the caller's memory, calls `loss`, which reads it there and fills the planes of `gradient`,
/// and propagates back: a step of a training loop with one render. An empty `loss`: the planes are filled already.
/// `out` keeps its memory; after an error its contents are unspecified.
inline Result<void> render_with_gradients(Gradients &out, const vg_image_target &target, const Gaussians &gaussians,
                                          const vg_camera &camera, const vg_image_gradient &gradient,
                                          const LossCallback &loss, const RenderOptions &options = {}) {
    vg_image_gradient planes = gradient;
    if (loss) {
        planes.loss = detail::loss;
        planes.loss_user = detail::user_pointer(loss);
    }
    return detail::render_backward_into(out, gaussians, camera, planes, &target, options);
}

// ---- Metrics

/// Settings of a measurement.
struct MetricsOptions : vg_metrics_options {
    MetricsOptions() noexcept : vg_metrics_options{} {
        vg_metrics_options_init(this, sizeof(vg_metrics_options));
    }

    /// A network that measures LPIPS: borrowed until the call returns. A temporary does not compile.
    void lend_lpips(const Model &model) noexcept { lpips = model.get(); }
    void lend_lpips(const Model &&) = delete;
};

/// The difference of two pictures of one size; NAN where a measure is not defined.
inline Result<vg_picture_errors> picture_errors(const vg_image &a, const vg_image &b,
                                                const MetricsOptions &options = {}) {
    vg_picture_errors errors;
    vg_picture_errors_init(&errors, sizeof errors);
    const Result<void> measured = detail::done(
        [&](vg_error **error) { return vg_metrics_pictures(&a, &b, &options, &errors, error); });
    if (!measured) {
        return measured.error();
    }
    return errors;
}

/// The error of a model, drawn on white, in one photograph; NAN where a measure is not defined.
inline Result<vg_view_errors> view_errors(const Gaussians &gaussians, const vg_view &view,
                                          const MetricsOptions &options = {}) {
    vg_view_errors errors;
    vg_view_errors_init(&errors, sizeof errors);
    const Result<void> measured = detail::done([&](vg_error **error) {
        return vg_metrics_view(gaussians.get(), &view, &options, &errors, error);
    });
    if (!measured) {
        return measured.error();
    }
    return errors;
}

/// The error of a model's surface against points measured on the vehicle, metres, vehicle frame.
inline Result<vg_surface_errors> surface_errors(const Gaussians &gaussians,
                                                const std::vector<std::array<float, 3>> &points,
                                                const MetricsOptions &options = {}) {
    vg_surface_errors errors;
    vg_surface_errors_init(&errors, sizeof errors);
    const float *first = points.empty() ? nullptr : points.front().data();
    const Result<void> measured = detail::done([&](vg_error **error) {
        return vg_metrics_surface(gaussians.get(), first, points.size(), &options, &errors, error);
    });
    if (!measured) {
        return measured.error();
    }
    return errors;
}

// ---- Alignment

/// Points of a structure-from-motion model's world, in its units.
using WorldPoints = std::vector<std::array<double, 3>>;

/// Settings of an alignment.
struct AlignOptions : vg_align_options {
    detail::Field<Heading, vg_heading> heading{vg_align_options::heading};

    explicit AlignOptions(Heading front = Heading::Auto) noexcept : vg_align_options{} {
        vg_align_options_init(this, sizeof(vg_align_options));
        heading = front;
    }
    explicit AlignOptions(vg_heading front) noexcept : AlignOptions(static_cast<Heading>(front)) {}
    AlignOptions(const AlignOptions &other) noexcept : vg_align_options(other) {}
    AlignOptions &operator=(const AlignOptions &other) noexcept {
        vg_align_options::operator=(other);
        return *this;
    }
};

namespace detail {

template <class Call> inline Result<vg_alignment> aligned(const Call &call) {
    vg_alignment found;
    vg_alignment_init(&found, sizeof found);
    const Result<void> gone = done([&](vg_error **error) { return call(&found, error); });
    if (!gone) {
        return gone.error();
    }
    return found;
}

inline const double *first_of(const WorldPoints &points) noexcept {
    return points.empty() ? nullptr : points.front().data();
}

} // namespace detail

/// The vehicle's frame by points scanned on the vehicle, metres, in that frame: their outline must run along the edges
/// of all masks. The views' poses are in the world; their photographs may be missing.
inline Result<vg_alignment> align_scan(const std::vector<vg_view> &views, const WorldPoints &sparse,
                                       const std::vector<std::array<float, 3>> &scan,
                                       const AlignOptions &options = AlignOptions()) {
    const float *first = scan.empty() ? nullptr : scan.front().data();
    return detail::aligned([&](vg_alignment *out, vg_error **error) {
        return vg_align_scan(views.data(), views.size(), detail::first_of(sparse), sparse.size(), first,
                             scan.size(), &options, out, error);
    });
}

/// The vehicle's frame by its length, width and height, metres, and the ground among the sparse points.
inline Result<vg_alignment> align_box(const std::vector<vg_view> &views, const WorldPoints &sparse,
                                      const std::array<double, 3> &size, const AlignOptions &options) {
    return detail::aligned([&](vg_alignment *out, vg_error **error) {
        return vg_align_box(views.data(), views.size(), detail::first_of(sparse), sparse.size(), size.data(),
                            &options, out, error);
    });
}

/// The similarity that maps points of the world, for example camera centres, to their measured positions in the
/// vehicle's frame, metres. Outliers are left out; `kept` has an element for each point.
inline Result<vg_alignment> align_points(const WorldPoints &world, const WorldPoints &vehicle,
                                         std::vector<std::uint8_t> *kept = nullptr) {
    if (world.size() != vehicle.size()) {
        return Error{VG_STATUS_ARGUMENT, "vehicle: " + std::to_string(vehicle.size()) + ", allowed: as many as world, " +
                                             std::to_string(world.size())};
    }
    std::vector<std::uint8_t> used(world.size());
    const auto found = detail::aligned([&](vg_alignment *out, vg_error **error) {
        return vg_align_points(detail::first_of(world), detail::first_of(vehicle), world.size(), out,
                               used.data(), nullptr, error);
    });
    if (found && kept != nullptr) {
        *kept = std::move(used);
    }
    return found;
}

/// `align_scan` with the files of a scene: a COLMAP folder, one of 3DRealCar, or a `transforms.json`. `scan`: a PLY file;
/// empty: the scan in a folder of 3DRealCar.
inline Result<vg_alignment> align_folder(const std::string &path, const std::string &scan = {},
                                         const AlignOptions &options = AlignOptions()) {
    const char *file = scan.empty() ? nullptr : scan.c_str();
    return detail::aligned([&](vg_alignment *out, vg_error **error) {
        return vg_align_folder(path.c_str(), file, &options, out, error);
    });
}

// ---- OpenCV

#ifdef VG_HAS_OPENCV

namespace detail {

/// "CV_8UC3"
inline std::string type_name(int type) {
    static constexpr const char *depths[8] = {"8U", "8S", "16U", "16S", "32S", "32F", "64F", "16F"};
    return std::string("CV_") + depths[CV_MAT_DEPTH(type)] + "C" + std::to_string(CV_MAT_CN(type));
}

/// An error about a matrix: its size and type, and what is allowed.
inline Error refused(const char *argument, const cv::Mat &mat, const std::string &allowed) {
    const std::string size = mat.dims == 2 ? std::to_string(mat.cols) + "x" + std::to_string(mat.rows)
                                           : std::to_string(mat.dims) + " dimensions";
    return Error{VG_STATUS_ARGUMENT, std::string(argument) + ": " + size + " of " + type_name(mat.type()) +
                                         ", allowed: " + allowed};
}

/// Three numbers of a row, a column or one element, as OpenCV stores rotations and translations.
inline Result<std::array<double, 3>> triple(const char *argument, const cv::Mat &mat) {
    if (mat.dims != 2 || mat.total() * static_cast<std::size_t>(mat.channels()) != 3) {
        return refused(argument, mat, "3 numbers in a row or column of CV_64FC1 or CV_32FC1");
    }
    cv::Mat numbers;
    mat.reshape(1, 3).convertTo(numbers, CV_64F);
    return std::array<double, 3>{numbers.at<double>(0), numbers.at<double>(1), numbers.at<double>(2)};
}

/// A matrix type and the name of its pixel format.
struct MatFormat {
    int type;
    vg_format format;
};

/// `mat` in the format of its type. cv::imread returns an empty one if it cannot read the file.
template <std::size_t N>
Result<vg_image> lent(const char *argument, const cv::Mat &mat, const MatFormat (&formats)[N],
                      const char *allowed) {
    if (mat.empty()) {
        return Error{VG_STATUS_ARGUMENT, std::string(argument) + ": an empty cv::Mat, allowed: " + allowed};
    }
    for (const MatFormat &known : formats) {
        if (mat.dims == 2 && mat.type() == known.type) {
            return image(mat.data, static_cast<std::uint32_t>(mat.cols), static_cast<std::uint32_t>(mat.rows),
                         known.format, mat.step);
        }
    }
    return refused(argument, mat, allowed);
}

} // namespace detail

/// A cv::Mat whose pixels are borrowed, not copied: a named one, which must outlive the view. A temporary does not
/// compile, because its pixels would be freed: give a region of a picture (`frame(box)`) a name first.
class LentMat {
  public:
    LentMat(const cv::Mat &mat) noexcept : mat_(&mat) {}
    LentMat(const cv::Mat &&) = delete;
    const cv::Mat &get() const noexcept { return *mat_; }

  private:
    const cv::Mat *mat_;
};

/// A photograph: CV_8UC3 is BGR, CV_8UC4 is BGRA, CV_8UC1 is gray, as in OpenCV; also regions of larger pictures.
/// Pixels are not copied.
inline Result<vg_image> image(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {
        {CV_8UC3, VG_FORMAT_BGR8}, {CV_8UC4, VG_FORMAT_BGRA8}, {CV_8UC1, VG_FORMAT_GRAY8}};
    return detail::lent("image", mat.get(), formats, "CV_8UC3 (BGR), CV_8UC4 (BGRA), CV_8UC1 (gray)");
}

/// A photograph whose channels are in the other order: RGB8 or RGBA8.
inline Result<vg_image> image_rgb(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {{CV_8UC3, VG_FORMAT_RGB8}, {CV_8UC4, VG_FORMAT_RGBA8}};
    return detail::lent("image", mat.get(), formats, "CV_8UC3 (RGB), CV_8UC4 (RGBA)");
}

/// Computes the mask of a photograph, CV_8UC1, by a segmentation network.
inline Result<cv::Mat> segment(const Model &model, LentMat photograph, const vg_camera &camera,
                               const SegmentOptions &options = {}) {
    const Result<vg_image> pixels = image(photograph);
    if (!pixels) {
        return pixels.error();
    }
    cv::Mat mask(photograph.get().rows, photograph.get().cols, CV_8UC1);
    const Result<void> made = detail::done([&](vg_error **error) {
        return vg_segment(model.get(), &*pixels, &camera, &options, mask.data, mask.step, error);
    });
    if (!made) {
        return made.error();
    }
    return mask;
}

/// A mask: 128 and above is vehicle, or 1 of 0 and 1 (a comparison's result is 0 and 255).
inline Result<vg_image> mask(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {{CV_8UC1, VG_FORMAT_GRAY8}};
    return detail::lent("mask", mat.get(), formats,
                        "CV_8UC1, 128 and above is vehicle, or 1 of 0 and 1 (of 0 to 1: mat.convertTo(mask, CV_8U, 255))");
}

/// Planar depth in metres.
inline Result<vg_image> depth(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {{CV_32FC1, VG_FORMAT_DEPTH32F}};
    return detail::lent("depth", mat.get(), formats, "CV_32FC1 in metres (of other units: vg::metres)");
}

/// Converts depth of sensors and PNG files, CV_16UC1 in millimetres, to CV_32FC1 in metres; also floats in other units.
/// 0 stays 0, no measurement. A view does not copy: give the matrix a name that outlives it.
///
///     const cv::Mat measured = vg::metres(millimetres).take();
///     const auto view = vg::view(photograph, mask, measured, camera);
inline Result<cv::Mat> metres(const cv::Mat &depth, double metres_per_unit = 0.001) {
    if (!(metres_per_unit > 0 && metres_per_unit <= 1e6)) {
        return Error{VG_STATUS_ARGUMENT, "metres_per_unit: " + std::to_string(metres_per_unit) +
                                             ", allowed: above 0, to 1e6"};
    }
    const int type = depth.type();
    if (depth.empty() || depth.dims != 2 || (type != CV_16UC1 && type != CV_32FC1 && type != CV_64FC1)) {
        return detail::refused("depth", depth, "CV_16UC1, CV_32FC1 or CV_64FC1");
    }
    cv::Mat converted;
    depth.convertTo(converted, CV_32F, metres_per_unit);
    return converted;
}

/// A photograph with its camera; its alpha is the mask. The matrix must outlive the view.
inline Result<vg_view> view(LentMat photograph, const vg_camera &camera) {
    const Result<vg_image> pixels = image(photograph);
    if (!pixels) {
        return pixels.error();
    }
    return view(*pixels, vg_image{}, camera);
}

/// A photograph with its mask and its camera. The matrices must outlive the view.
inline Result<vg_view> view(LentMat photograph, LentMat vehicle_mask, const vg_camera &camera) {
    const Result<vg_image> pixels = image(photograph);
    const Result<vg_image> labels = mask(vehicle_mask);
    if (!pixels || !labels) {
        return pixels ? labels.error() : pixels.error();
    }
    return view(*pixels, *labels, camera);
}

/// A photograph with its mask, depth in metres, and its camera.
inline Result<vg_view> view(LentMat photograph, LentMat vehicle_mask, LentMat metres,
                            const vg_camera &camera) {
    Result<vg_view> made = view(photograph, vehicle_mask, camera);
    const Result<vg_image> measured = depth(metres);
    if (!measured) {
        return measured.error();
    }
    if (made) {
        made->depth = *measured;
    }
    return made;
}

/// A camera from the results of cv::calibrateCamera: the 3x3 camera matrix, and a row or column of
/// distortion.
inline Result<vg_camera> camera_from_opencv(const cv::Mat &k, const cv::Mat &distortion, Lens lens,
                                            cv::Size size, const Pose &vehicle_from_camera = identity_pose) {
    if (k.dims != 2 || k.rows != 3 || k.cols != 3 || k.channels() != 1) {
        return detail::refused("k", k, "3x3 of CV_64FC1 or CV_32FC1");
    }
    if (!distortion.empty() && (distortion.dims != 2 || (distortion.rows != 1 && distortion.cols != 1) ||
                                distortion.channels() != 1)) {
        return detail::refused("distortion", distortion, "one row or column of CV_64FC1 or CV_32FC1");
    }
    if (size.width < 0 || size.height < 0) {
        return Error{VG_STATUS_ARGUMENT, "size: " + std::to_string(size.width) + "x" +
                                             std::to_string(size.height) + ", allowed: 1x1 to 8192x8192"};
    }
    cv::Mat matrix, row;
    k.convertTo(matrix, CV_64F);
    distortion.convertTo(row, CV_64F);
    std::array<double, 9> numbers{};
    for (int i = 0; i < 9; i++) {
        numbers[static_cast<std::size_t>(i)] = matrix.at<double>(i / 3, i % 3);
    }
    std::vector<double> coefficients;
    for (int i = 0; i < row.rows * row.cols; i++) {
        coefficients.push_back(row.rows == 1 ? row.at<double>(0, i) : row.at<double>(i, 0));
    }
    return camera_from_opencv(numbers, coefficients, lens, static_cast<std::uint32_t>(size.width),
                              static_cast<std::uint32_t>(size.height), vehicle_from_camera);
}

/// OpenCV's pose, world to camera, as cv::solvePnP leaves it: rvec and tvec of 3 numbers each.
inline Result<Pose> pose_from_opencv(const cv::Mat &rvec, const cv::Mat &tvec,
                                     const Similarity *vehicle_from_world = nullptr) {
    const Result<Point> turned = detail::triple("rvec", rvec), moved = detail::triple("tvec", tvec);
    if (!turned || !moved) {
        return turned ? moved.error() : turned.error();
    }
    return pose_from_opencv(*turned, *moved, vehicle_from_world);
}

namespace detail {

/// Matrices that receive a picture; `depth` and `alpha` NULL: not requested.
struct Mats {
    cv::Mat *color;
    cv::Mat *depth;
    cv::Mat *alpha;
};

/// The matrix to draw into: `mat` itself, or if it is empty, a new one of the camera's size and this type.
inline Result<cv::Mat> drawn_into(const char *argument, const cv::Mat &mat, const vg_camera &camera,
                                  std::initializer_list<int> types, const char *allowed) {
    const int columns = static_cast<int>(camera.width), rows = static_cast<int>(camera.height);
    if (mat.empty()) {
        return cv::Mat(rows, columns, *types.begin());
    }
    for (const int type : types) {
        if (mat.type() == type && mat.dims == 2 && mat.cols == columns && mat.rows == rows) {
            return mat;
        }
    }
    return refused(argument, mat,
                   std::to_string(columns) + "x" + std::to_string(rows) + " of " + allowed + ", or empty");
}

/// Exchanges R and B of a CV_32FC4: the library uses RGBA, OpenCV BGRA.
inline void exchange_red_and_blue(cv::Mat &mat) {
    for (int row = 0; row < mat.rows; row++) {
        float *pixel = mat.ptr<float>(row);
        for (int column = 0; column < mat.cols; column++, pixel += 4) {
            std::swap(pixel[0], pixel[2]);
        }
    }
}

/// Renders into matrices of the cameras' sizes, and creates those that are empty. `draw` takes targets and cameras.
template <class Draw>
Result<void> render_mats(const Mats *mats, const vg_camera *cameras, std::size_t count,
                         const RenderOptions &options, const Draw &draw) {
    const bool opaque = options.background == Background::Color;
    std::vector<std::array<cv::Mat, 3>> pictures;
    std::vector<ImageTarget> targets(count);
    for (std::size_t i = 0; i < count; i++) {
        const vg_camera &camera = cameras[i];
        if (camera.width > 8192 || camera.height > 8192 || camera.width == 0 || camera.height == 0) {
            return Error{VG_STATUS_ARGUMENT, "camera: " + std::to_string(camera.width) + "x" +
                                                 std::to_string(camera.height) +
                                                 ", allowed: 1x1 to 8192x8192"};
        }
        Result<cv::Mat> color =
            opaque ? drawn_into("color", *mats[i].color, camera, {CV_8UC3, CV_8UC4, CV_32FC4},
                                "CV_8UC3, CV_8UC4 or CV_32FC4")
                   : drawn_into("color", *mats[i].color, camera, {CV_8UC4, CV_32FC4}, "CV_8UC4 or CV_32FC4");
        if (!color) {
            return color.error();
        }
        pictures.push_back({color.take(), cv::Mat(), cv::Mat()});
        auto &[picture, metres, opacity] = pictures.back();
        ImageTarget &target = targets[i];
        target.width = camera.width;
        target.height = camera.height;
        target.color = picture.data;
        target.color_row_stride = picture.step;
        target.color_format = picture.type() == CV_8UC3   ? Format::Bgr8
                              : picture.type() == CV_8UC4 ? Format::Bgra8
                                                          : Format::Rgba32f;
        if (mats[i].depth != nullptr) {
            Result<cv::Mat> plane = drawn_into("depth", *mats[i].depth, camera, {CV_32FC1}, "CV_32FC1");
            if (!plane) {
                return plane.error();
            }
            metres = plane.take();
            target.depth = metres.data;
            target.depth_row_stride = metres.step;
        }
        if (mats[i].alpha != nullptr) {
            Result<cv::Mat> plane = drawn_into("alpha", *mats[i].alpha, camera, {CV_32FC1}, "CV_32FC1");
            if (!plane) {
                return plane.error();
            }
            opacity = plane.take();
            target.alpha = opacity.data;
            target.alpha_row_stride = opacity.step;
        }
    }
    // An array of vg.h's structs, without the members that vg.hpp adds.
    const std::vector<vg_image_target> c_targets(targets.begin(), targets.end());
    const Result<void> drawn = draw(c_targets.data(), cameras, count);
    if (!drawn) {
        return drawn;
    }
    // The caller's matrices are assigned only after all pictures were drawn.
    for (std::size_t i = 0; i < count; i++) {
        auto &[picture, metres, opacity] = pictures[i];
        if (picture.type() == CV_32FC4) {
            exchange_red_and_blue(picture);
        }
        *mats[i].color = picture;
        if (mats[i].depth != nullptr) {
            *mats[i].depth = metres;
        }
        if (mats[i].alpha != nullptr) {
            *mats[i].alpha = opacity;
        }
    }
    return drawn;
}

inline Result<void> render_mats(const Mats &mats, const Gaussians &gaussians, const vg_camera &camera,
                                const RenderOptions &options) {
    return render_mats(&mats, &camera, 1, options,
                       [&](const vg_image_target *target, const vg_camera *seen, std::size_t) {
                           return vg::render_into(*target, gaussians, *seen, options);
                       });
}

inline Result<void> render_mats(const Mats &mats, const Renderer &renderer, const vg_camera &camera,
                                const RenderOptions &options) {
    return render_mats(&mats, &camera, 1, options,
                       [&](const vg_image_target *targets, const vg_camera *seen, std::size_t count) {
                           return renderer.render_into(targets, seen, count, options);
                       });
}

} // namespace detail

/// Renders Gaussians, or the Gaussians of a Renderer, into a matrix, which may be a region of a larger one: CV_8UC3
/// (BGR), CV_8UC4 (BGRA) or CV_32FC4 (BGRA, 0 to 1, not clamped above 1) of the camera's size. An empty matrix
/// becomes CV_8UC3, or CV_8UC4 where the background is transparent.
template <class Model>
Result<void> render_into(cv::Mat &color, const Model &model, const vg_camera &camera,
                         const RenderOptions &options = {}) {
    return detail::render_mats({&color, nullptr, nullptr}, model, camera, options);
}

/// Renders colour and planar depth in metres: CV_32FC1 of the camera's size, or empty.
template <class Model>
Result<void> render_into(cv::Mat &color, cv::Mat &depth, const Model &model, const vg_camera &camera,
                         const RenderOptions &options = {}) {
    return detail::render_mats({&color, &depth, nullptr}, model, camera, options);
}

/// Renders colour, depth and alpha, 0 to 1: CV_32FC1 of the camera's size, or empty.
template <class Model>
Result<void> render_into(cv::Mat &color, cv::Mat &depth, cv::Mat &alpha, const Model &model,
                         const vg_camera &camera, const RenderOptions &options = {}) {
    return detail::render_mats({&color, &depth, &alpha}, model, camera, options);
}

/// Renders one picture per camera in one call; a GPU renders the next one while one is read back. `colors` becomes as
/// long as `cameras`.
inline Result<void> render_into(std::vector<cv::Mat> &colors, const Renderer &renderer,
                                const std::vector<vg_camera> &cameras, const RenderOptions &options = {}) {
    std::vector<cv::Mat> drawn(colors);
    drawn.resize(cameras.size());
    std::vector<detail::Mats> mats;
    for (cv::Mat &color : drawn) {
        mats.push_back({&color, nullptr, nullptr});
    }
    const Result<void> done = detail::render_mats(
        mats.data(), cameras.data(), cameras.size(), options,
        [&](const vg_image_target *targets, const vg_camera *seen, std::size_t count) {
            return renderer.render_into(targets, seen, count, options);
        });
    if (done) {
        colors = std::move(drawn);
    }
    return done;
}

#endif // VG_HAS_OPENCV

// ---- Eigen

#ifdef VG_HAS_EIGEN

/// A pose from the top rows of a 3x4 or 4x4 matrix of any storage order.
template <class Derived> Pose pose(const Eigen::MatrixBase<Derived> &vehicle_from_camera) {
    static_assert(Derived::ColsAtCompileTime == 4 &&
                      (Derived::RowsAtCompileTime == 3 || Derived::RowsAtCompileTime == 4),
                  "a pose is 3x4 or 4x4");
    Pose pose{};
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 4; column++) {
            pose[static_cast<std::size_t>(4 * row + column)] =
                static_cast<double>(vehicle_from_camera(row, column));
        }
    }
    return pose;
}

/// A pose from Eigen::Isometry3d, Affine3d and their like.
template <class Scalar, int Mode, int Storage>
Pose pose(const Eigen::Transform<Scalar, 3, Mode, Storage> &vehicle_from_camera) {
    return pose(vehicle_from_camera.matrix());
}

/// A pose from a rotation and the camera's position.
template <class Scalar>
Pose pose(const Eigen::Matrix<Scalar, 3, 3> &rotation, const Eigen::Matrix<Scalar, 3, 1> &position) {
    Eigen::Matrix<Scalar, 3, 4> both;
    both << rotation, position;
    return pose(both);
}

/// A pose from a unit quaternion and the camera's position.
template <class Scalar>
Pose pose(const Eigen::Quaternion<Scalar> &rotation, const Eigen::Matrix<Scalar, 3, 1> &position) {
    return pose(Eigen::Matrix<Scalar, 3, 3>(rotation.toRotationMatrix()), position);
}

/// A similarity from a 4x4 matrix of any storage order.
template <class Derived> Similarity similarity(const Eigen::MatrixBase<Derived> &to_from) {
    static_assert(Derived::ColsAtCompileTime == 4 && Derived::RowsAtCompileTime == 4, "a similarity is 4x4");
    Similarity similarity{};
    for (int row = 0; row < 4; row++) {
        for (int column = 0; column < 4; column++) {
            similarity[static_cast<std::size_t>(4 * row + column)] =
                static_cast<double>(to_from(row, column));
        }
    }
    return similarity;
}

/// The position of a camera.
inline Eigen::Isometry3d isometry(const vg_camera &camera) {
    Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 4; column++) {
            isometry(row, column) = camera.vehicle_from_camera[4 * row + column];
        }
    }
    return isometry;
}

/// Maps an array as a matrix of one row per element, without copying: `vg::rows<3>(car.positions())`.
template <int Columns, class T>
Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, Columns, Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>>
rows(const Span<const T> &array) {
    return {array.data(), static_cast<Eigen::Index>(array.size() / Columns), Columns};
}

#endif // VG_HAS_EIGEN

#ifdef VG_HPP_EXCEPTIONS
} // namespace throwing
#endif

} // namespace vg

#endif // VG_HPP
