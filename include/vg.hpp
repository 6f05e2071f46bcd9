/*
 * vg.hpp - the functions of vg.h for C++17: handles that free themselves, results instead of out parameters,
 * cv::Mat and Eigen where they are there. License: MIT or Apache-2.0.
 *
 *     std::vector<vg_view> views;
 *     views.push_back(vg::view(photograph, mask, camera).take());      // cv::Mat, cv::Mat, vg_camera
 *     auto made = vg::reconstruct(views);
 *     if (!made) {
 *         std::fprintf(stderr, "%s\n", made.error().message.c_str());
 *         return 1;
 *     }
 *     cv::Mat picture;
 *     vg::render_into(picture, made->gaussians, other_camera).take();
 *
 * The chapter CONVENTIONS of vg.h holds for all of this: frames, poses, pixels, images, threads. What this
 * file adds:
 *
 * Results.   Functions that can fail return a Result, which holds either the value or an Error and may not be
 *            ignored. take() and value() of a Result that holds an Error end the program with its message.
 *            Nothing here throws or needs exceptions or run-time type information; std::vector and
 *            std::string may throw std::bad_alloc where exceptions are on.
 *
 * Ownership. Context, Model, Scene, Gaussians and Report own one handle and are moved, not copied. One that was
 *            moved away is empty: no views, no Gaussians, and an error where it is used. A vg_view, a
 *            vg_image and a Span own nothing: they point into a Scene, a cv::Mat or Gaussians, which must
 *            outlive them.
 *
 * Options.   Options, ModelOptions, SegmentOptions, RenderOptions, SceneOptions are the structs of vg.h with
 *            their default values set. Their fields are explained there.
 *
 * Callbacks. on_progress and on_log take any callable. They come on the calling thread, one at a time. An
 *            exception that leaves one ends the program (std::terminate), because it cannot pass through the
 *            library.
 *
 * OpenCV     is used where <opencv2/core.hpp> is found, Eigen where <Eigen/Core> is. VG_NO_OPENCV and
 *            VG_NO_EIGEN, defined before this file, keep them out. They only add functions.
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
#include <memory>
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

namespace vg {

// ---- Results

/// Why a call failed.
struct Error {
    vg_status status = VG_STATUS_INTERNAL;
    /// One line of UTF-8: the argument, what was found, what is allowed.
    std::string message;
};

namespace detail {

/// A value was asked of a failed call, or an error of one that succeeded: a bug of the caller's.
[[noreturn]] inline void misused(const char *what, const char *message) noexcept {
    std::fprintf(stderr, "vg::Result: %s %s\n", what, message);
    std::abort();
}

} // namespace detail

/// A value, or why there is none. Asking for the one that is not there ends the program.
template <class T> class [[nodiscard]] Result {
  public:
    Result(T value) : held_(std::in_place_index<0>, std::move(value)) {}
    Result(Error error) : held_(std::in_place_index<1>, std::move(error)) {}

    bool ok() const noexcept { return held_.index() == 0; }
    explicit operator bool() const noexcept { return ok(); }

    T &value() & noexcept { return *checked(this); }
    const T &value() const & noexcept { return *checked(this); }
    T &&value() && noexcept { return std::move(*checked(this)); }
    T &operator*() & noexcept { return value(); }
    const T &operator*() const & noexcept { return value(); }
    T *operator->() noexcept { return checked(this); }
    const T *operator->() const noexcept { return checked(this); }

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
    template <class Self> static auto checked(Self *self) noexcept -> decltype(std::get_if<0>(&self->held_)) {
        auto *value = std::get_if<0>(&self->held_);
        if (value == nullptr) {
            detail::misused("no value:", std::get_if<1>(&self->held_)->message.c_str());
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

    /// Nothing, so that what takes any Result also takes this one.
    void take() const noexcept {
        if (!ok_) {
            detail::misused("no value:", error_.message.c_str());
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

/// The C error as ours; frees it.
inline Error caught(vg_status status, vg_error *error) {
    Error ours{status, vg_error_message(error)};
    vg_error_free(error);
    return ours;
}

/// Calls a function that has nothing to give but its status.
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

// ---- Small things

/// Version of the library that is running, "0.1.0".
inline const char *version() noexcept {
    return vg_version();
}

/// Elements that somebody else owns. Converts to std::span where there is one.
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

/// The pose of a camera that stands in the vehicle's origin and looks along its z axis.
constexpr Pose identity_pose{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

/// What a progress callback wants.
enum class Flow {
    Continue,
    /// Ends the call with VG_STATUS_CANCELLED.
    Cancel,
};

/// Told the stage, and how much of it is done, 0 to 1.
using ProgressCallback = std::function<Flow(const char *stage, double fraction)>;

/// Told one line.
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

/// A callback as the pointer that comes back to the functions above, which do not change it.
template <class Callback> void *user_pointer(const Callback &callback) noexcept {
    return const_cast<Callback *>(&callback);
}

} // namespace detail

// ---- Context

/// Worker threads and scratch memory, for calls that follow each other: `options.context = context.get()`. It
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
    /// Ends the threads and frees the memory that calls without a context have made for each other.
    static void free_default() noexcept { vg_default_context_free(); }

    vg_context *get() const noexcept { return handle_.get(); }
    /// The handle, now the caller's to free.
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

/// Which of OpenCV's calibrations.
enum class Lens {
    /// cv::calibrateCamera
    Standard,
    /// cv::fisheye::calibrate
    Fisheye,
};

/// OpenCV's calibration: the 3x3 camera matrix, row-major, and 0, 4, 5, 8, 12 or 14 numbers of distortion, see
/// vg_camera_from_opencv.
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

/// The same camera elsewhere.
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

/// Column and row of a point in the vehicle's frame; an error where it is not in front of the camera.
inline Result<std::array<double, 2>> project(const vg_camera &camera,
                                             const std::array<double, 3> &point_vehicle) {
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

/// A pose from where a tracked vehicle and the camera are in a common frame.
inline Result<Pose> pose_from_box(const Pose &vehicle_in_ego, const Pose &camera_in_ego) {
    return detail::filled(Pose{}, [&](Pose *out, vg_error **error) {
        return vg_pose_from_box(vehicle_in_ego.data(), camera_in_ego.data(), out->data(), error);
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

/// What of a scene's files is wanted.
struct SceneOptions : vg_scene_options {
    /// The views wanted, in this order, by path, file name or stem; none: all. Used instead of `names`.
    std::vector<std::string> view_names;
    /// Told what is legal but looks like a mistake. Used instead of `log`.
    LogCallback on_log;

    SceneOptions() noexcept : vg_scene_options{} { vg_scene_options_init(this, sizeof(vg_scene_options)); }
};

/// Views read from files, with their pixels.
class Scene {
  public:
    using Handle = vg_scene;

    Scene() noexcept = default;
    explicit Scene(vg_scene *owned) noexcept : handle_(owned) {}

    /// A nerfstudio scene: a `transforms.json`, or a folder with one.
    static Result<Scene> open_transforms(const std::string &path, const SceneOptions &options = {}) {
        return open(vg_transforms_open, path, options);
    }

    /// A COLMAP folder. `options.vehicle_from_world` is needed.
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
    /// The handle, now the caller's to free.
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

/// Arrays to make Gaussians from.
struct GaussianArrays : vg_gaussian_arrays {
    GaussianArrays() noexcept : vg_gaussian_arrays{} {
        vg_gaussian_arrays_init(this, sizeof(vg_gaussian_arrays));
    }
};

/// A set of Gaussians, which never changes. Any number of threads may read or render one at a time.
class Gaussians {
  public:
    using Handle = vg_gaussians;

    Gaussians() noexcept = default;
    explicit Gaussians(vg_gaussians *owned) noexcept : handle_(owned) {}

    /// From a PLY file in the layout of 3D Gaussian Splatting.
    static Result<Gaussians> load_ply(const std::string &path) {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_load_ply(path.c_str(), out, error);
        });
    }

    /// From the caller's arrays, which are copied and checked.
    static Result<Gaussians> from_arrays(const vg_gaussian_arrays &arrays) {
        return detail::made<Gaussians>([&](vg_gaussians **out, vg_error **error) {
            return vg_gaussians_from_arrays(&arrays, out, error);
        });
    }

    /// As a PLY file in the layout of 3D Gaussian Splatting.
    Result<void> save_ply(const std::string &path) const {
        return detail::done(
            [&](vg_error **error) { return vg_gaussians_save_ply(handle_.get(), path.c_str(), error); });
    }

    /// The same in another frame: rotation, positive scale, translation in metres.
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

    /// These, then those of `second`, in one.
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
    /// The handle, now the caller's to free.
    vg_gaussians *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_gaussians, detail::Free> handle_;
};

// ---- Networks

/// How a model is opened.
struct ModelOptions : vg_model_options {
    /// ONNX Runtime, the library or its folder; empty: see `runtime`. Used instead of `runtime`.
    std::string runtime_path;

    ModelOptions() noexcept : vg_model_options{} { vg_model_options_init(this, sizeof(vg_model_options)); }
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
    /// The handle, now the caller's to free.
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

/// The mask of a photograph that has none, by a segmentation network: one byte per pixel, rows without gaps, 255
/// where the vehicle is that stands at the origin of the camera's vehicle frame.
inline Result<std::vector<std::uint8_t>> segment(const Model &model, const vg_image &photograph,
                                                 const vg_camera &camera, const SegmentOptions &options = {}) {
    // A picture of no sensible size is the library's to refuse, before memory is asked for.
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

/// Settings of a reconstruction.
struct Options : vg_options {
    /// Used instead of `progress`.
    ProgressCallback on_progress;
    /// Used instead of `log`.
    LogCallback on_log;

    Options() noexcept : vg_options{} { vg_options_init(this, sizeof(vg_options)); }

    /// Measured points, metres, vehicle frame: lent, and copied by the call. A temporary is refused.
    void lend_cloud(const std::vector<std::array<float, 3>> &measured) noexcept {
        static_assert(sizeof(std::array<float, 3>) == 3 * sizeof(float), "points lie without gaps");
        cloud = measured.empty() ? nullptr : measured.front().data();
        cloud_count = measured.size();
    }
    void lend_cloud(const std::vector<std::array<float, 3>> &&) = delete;

    /// Depth from a network: lent, and needed until the call returns. A temporary is refused.
    void lend_prior(const Model &model) noexcept {
        prior = VG_PRIOR_ONNX;
        prior_model = model.get();
    }
    void lend_prior(const Model &&) = delete;

    /// Gaussians from a network: lent, and needed until the call returns. A temporary is refused.
    void lend_head(const Model &model) noexcept { head_model = model.get(); }
    void lend_head(const Model &&) = delete;
};

/// What a reconstruction did.
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

    /// Positions of the metric point cloud, metres; none unless `options.points` was 1. `[count][3]`
    Span<const float> point_positions() const noexcept {
        return {vg_report_point_positions(handle_.get()), 3 * vg_report_point_count(handle_.get())};
    }
    /// Colours of the metric point cloud, sRGB. `[count][3]`
    Span<const std::uint8_t> point_colors() const noexcept {
        return {vg_report_point_colors(handle_.get()), 3 * vg_report_point_count(handle_.get())};
    }

    const vg_report *get() const noexcept { return handle_.get(); }
    /// The handle, now the caller's to free.
    vg_report *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_report, detail::Free> handle_;
};

/// A vehicle, and how it was made.
struct Reconstruction {
    Gaussians gaussians;
    Report report;
};

/// Makes a complete vehicle of photographs of one side. The same views and options give the same bytes.
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

// ---- Pictures

/// Settings of a picture.
struct RenderOptions : vg_render_options {
    RenderOptions() noexcept : vg_render_options{} {
        vg_render_options_init(this, sizeof(vg_render_options));
    }
};

/// Where a picture goes: the caller's memory.
struct ImageTarget : vg_image_target {
    ImageTarget() noexcept : vg_image_target{} { vg_image_target_init(this, sizeof(vg_image_target)); }
};

/// Colour and depth, rows without gaps, the top row first.
struct Picture {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    vg_format format = VG_FORMAT_RGBA8;
    /// `[height][width][channels]`
    std::vector<std::uint8_t> color;
    /// Planar depth, metres; 0 where nothing is. `[height][width]`
    std::vector<float> depth;
};

/// Settings of a renderer.
struct RendererOptions : vg_renderer_options {
    RendererOptions() noexcept : vg_renderer_options{} {
        vg_renderer_options_init(this, sizeof(vg_renderer_options));
    }
};

/// Gaussians made ready to be drawn many times, by the CPU or a graphics processor. It keeps the Gaussians.
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

    /// Who draws.
    vg_backend backend() const noexcept { return static_cast<vg_backend>(vg_renderer_backend(handle_.get())); }
    /// Who draws, and why, in one line.
    const char *choice() const noexcept { return vg_renderer_choice(handle_.get()); }

    /// `count` pictures, one per camera, into memory of the caller's.
    Result<void> render_into(const vg_image_target *targets, const vg_camera *cameras, std::size_t count,
                             const RenderOptions &options = {}) const {
        return detail::done([&](vg_error **error) {
            return vg_renderer_render(handle_.get(), cameras, count, &options, targets, error);
        });
    }
    /// One picture.
    Result<void> render_into(const vg_image_target &target, const vg_camera &camera,
                             const RenderOptions &options = {}) const {
        return render_into(&target, &camera, 1, options);
    }

    vg_renderer *get() const noexcept { return handle_.get(); }
    /// The handle, now the caller's to free.
    vg_renderer *release() noexcept { return handle_.release(); }

  private:
    std::unique_ptr<vg_renderer, detail::Free> handle_;
};

/// Draws Gaussians as a camera sees them into memory of the caller's.
inline Result<void> render_into(const vg_image_target &target, const Gaussians &gaussians,
                                const vg_camera &camera, const RenderOptions &options = {}) {
    return detail::done(
        [&](vg_error **error) { return vg_render(gaussians.get(), &camera, &options, &target, error); });
}

/// Draws Gaussians as a camera sees them. `format`: RGBA8 or BGRA8; RGB8 or BGR8 where the background is
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
    // A camera of no sensible size is the library's to refuse, before memory is asked for.
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

/// Gradients of a loss with respect to what a picture is made of, laid out as the arrays of `Gaussians`.
struct Gradients {
    /// Of centres, per metre. `[size][3]`
    std::vector<float> positions;
    /// Of standard deviations, per metre. `[size][3]`
    std::vector<float> scales;
    /// Of unit quaternions w, x, y, z, perpendicular to them. `[size][4]`
    std::vector<float> rotations;
    /// Of peak opacities. `[size]`
    std::vector<float> opacities;
    /// Of coefficients of spherical harmonics. `[size][(sh_degree + 1)^2][3]`
    std::vector<float> sh;
    /// Of the background colour; zero for a transparent one.
    std::array<double, 3> background{};
    /// Of turning the camera about its axes, per radian, then of moving it along them, per metre.
    std::array<double, 6> pose{};
    /// Of the entries of camera_from_vehicle, row-major.
    std::array<double, 16> view_matrix{};
};

/// Whether a loss wants the call to go on. Called on the calling thread; must not throw.
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

/// Goes back from the gradient of a loss with respect to a picture to those of the Gaussians, the background and the
/// camera. The picture is drawn again on the way.
inline Result<Gradients> render_backward(const Gaussians &gaussians, const vg_camera &camera,
                                         const vg_image_gradient &gradient, const RenderOptions &options = {}) {
    Gradients out;
    const Result<void> gone = detail::render_backward_into(out, gaussians, camera, gradient, nullptr, options);
    if (!gone) {
        return gone.error();
    }
    return out;
}

/// Draws a picture into memory of the caller's, has `loss` look at it there and fill the planes of `gradient`, and
/// goes back: a step of a training loop that draws once. An empty `loss`: the planes are there already. `out` keeps
/// its memory; after an error it holds nothing in particular.
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

/// Settings of a measure.
struct MetricsOptions : vg_metrics_options {
    MetricsOptions() noexcept : vg_metrics_options{} {
        vg_metrics_options_init(this, sizeof(vg_metrics_options));
    }

    /// A network that measures LPIPS: lent, and needed until the call returns. A temporary is refused.
    void lend_lpips(const Model &model) noexcept { lpips = model.get(); }
    void lend_lpips(const Model &&) = delete;
};

/// The difference of two pictures of one size; NAN where a measure does not exist.
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

/// The error of a model, drawn on white, in one photograph; NAN where a measure does not exist.
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
    explicit AlignOptions(vg_heading front = VG_HEADING_AUTO) noexcept : vg_align_options{} {
        vg_align_options_init(this, sizeof(vg_align_options));
        heading = front;
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

/// The similarity that takes points of the world, the cameras' centres for one, to where they were measured in the
/// vehicle's frame, metres; those that contradict the others are left out, which `kept` tells, one element a point.
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

/// A type of matrix, and what we call its pixels.
struct MatFormat {
    int type;
    vg_format format;
};

/// `mat` in the format that goes with its type. cv::imread leaves an empty one where it cannot read the file.
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

/// A cv::Mat whose pixels are lent, not copied: a named one, which must outlive the view. A temporary is
/// refused, because its pixels would be gone: give a region of a picture (`frame(box)`) a name first.
class LentMat {
  public:
    LentMat(const cv::Mat &mat) noexcept : mat_(&mat) {}
    LentMat(const cv::Mat &&) = delete;
    const cv::Mat &get() const noexcept { return *mat_; }

  private:
    const cv::Mat *mat_;
};

/// A photograph: CV_8UC3 is BGR, CV_8UC4 is BGRA, CV_8UC1 is gray, as OpenCV has them. Regions of larger
/// pictures too. Pixels are not copied.
inline Result<vg_image> image(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {
        {CV_8UC3, VG_FORMAT_BGR8}, {CV_8UC4, VG_FORMAT_BGRA8}, {CV_8UC1, VG_FORMAT_GRAY8}};
    return detail::lent("image", mat.get(), formats, "CV_8UC3 (BGR), CV_8UC4 (BGRA), CV_8UC1 (gray)");
}

/// A photograph whose channels were put into another order: RGB8 or RGBA8.
inline Result<vg_image> image_rgb(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {{CV_8UC3, VG_FORMAT_RGB8}, {CV_8UC4, VG_FORMAT_RGBA8}};
    return detail::lent("image", mat.get(), formats, "CV_8UC3 (RGB), CV_8UC4 (RGBA)");
}

/// The mask of a photograph that has none, CV_8UC1, by a segmentation network.
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

/// A mask: 128 and above is vehicle.
inline Result<vg_image> mask(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {{CV_8UC1, VG_FORMAT_GRAY8}};
    return detail::lent("mask", mat.get(), formats, "CV_8UC1, 128 and above is vehicle");
}

/// Planar depth in metres.
inline Result<vg_image> depth(LentMat mat) {
    static constexpr detail::MatFormat formats[] = {{CV_32FC1, VG_FORMAT_DEPTH32F}};
    return detail::lent("depth", mat.get(), formats,
                        "CV_32FC1 in metres (of millimetres: mat.convertTo(metres, CV_32F, 0.001))");
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

/// The same with depth in metres.
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

/// OpenCV's calibration as cv::calibrateCamera leaves it: the 3x3 camera matrix, and a row or column of
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

namespace detail {

/// Draws into matrices of the camera's size, or makes them where they are empty. `depth`: NULL: none.
inline Result<void> render_mats(cv::Mat &color, cv::Mat *depth, const Gaussians &gaussians,
                                const vg_camera &camera, const RenderOptions &options) {
    const bool opaque = options.background != VG_BACKGROUND_TRANSPARENT;
    const int columns = static_cast<int>(camera.width), rows = static_cast<int>(camera.height);
    const std::string size = std::to_string(camera.width) + "x" + std::to_string(camera.height);
    if (camera.width > 8192 || camera.height > 8192 || columns == 0 || rows == 0) {
        return Error{VG_STATUS_ARGUMENT, "camera: " + size + ", allowed: 1x1 to 8192x8192"};
    }
    const auto fits = [&](const cv::Mat &mat) {
        return mat.dims == 2 && mat.cols == columns && mat.rows == rows;
    };
    if (!color.empty() &&
        (!fits(color) || !(color.type() == CV_8UC4 || (opaque && color.type() == CV_8UC3)))) {
        return refused("color", color,
                       size + " of " + (opaque ? "CV_8UC3 or CV_8UC4" : "CV_8UC4") + ", or empty");
    }
    if (depth != nullptr && !depth->empty() && (!fits(*depth) || depth->type() != CV_32FC1)) {
        return refused("depth", *depth, size + " of CV_32FC1, or empty");
    }
    // The caller's stay as they are until the picture is there.
    cv::Mat picture = color.empty() ? cv::Mat(rows, columns, opaque ? CV_8UC3 : CV_8UC4) : color;
    cv::Mat metres;
    if (depth != nullptr) {
        metres = depth->empty() ? cv::Mat(rows, columns, CV_32FC1) : *depth;
    }
    ImageTarget target;
    target.width = camera.width;
    target.height = camera.height;
    target.color = picture.data;
    target.color_row_stride = picture.step;
    target.color_format = picture.type() == CV_8UC3 ? VG_FORMAT_BGR8 : VG_FORMAT_BGRA8;
    if (depth != nullptr) {
        target.depth = metres.data;
        target.depth_row_stride = metres.step;
    }
    const Result<void> drawn = vg::render_into(target, gaussians, camera, options);
    if (drawn) {
        color = picture;
        if (depth != nullptr) {
            *depth = metres;
        }
    }
    return drawn;
}

} // namespace detail

/// Draws into a matrix, which may be a region of a larger one: CV_8UC3 (BGR) or CV_8UC4 (BGRA) of the
/// camera's size. An empty one becomes CV_8UC3, or CV_8UC4 where the background is transparent.
inline Result<void> render_into(cv::Mat &color, const Gaussians &gaussians, const vg_camera &camera,
                                const RenderOptions &options = {}) {
    return detail::render_mats(color, nullptr, gaussians, camera, options);
}

/// The same with planar depth in metres: CV_32FC1 of the camera's size, or empty.
inline Result<void> render_into(cv::Mat &color, cv::Mat &depth, const Gaussians &gaussians,
                                const vg_camera &camera, const RenderOptions &options = {}) {
    return detail::render_mats(color, &depth, gaussians, camera, options);
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

/// Where a camera stands.
inline Eigen::Isometry3d isometry(const vg_camera &camera) {
    Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 4; column++) {
            isometry(row, column) = camera.vehicle_from_camera[4 * row + column];
        }
    }
    return isometry;
}

/// An array as a matrix of one row per element, not copied: `vg::rows<3>(car.positions())`.
template <int Columns, class T>
Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, Columns, Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>>
rows(const Span<const T> &array) {
    return {array.data(), static_cast<Eigen::Index>(array.size() / Columns), Columns};
}

#endif // VG_HAS_EIGEN

} // namespace vg

#endif // VG_HPP
