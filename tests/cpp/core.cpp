// vg.hpp without other libraries: results, ownership, callbacks, errors. Prints nothing on success.
//
//     core SCRATCH_FOLDER
#include <array>
#include <cmath>
#include <csignal>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>
#if __cplusplus >= 202002L
#include <span>
#endif

#include "vg_test.hpp"

// In another file of the same program.
std::size_t size_seen_by_the_other_file(const vg::Gaussians &gaussians);

namespace {

template <class T>
constexpr bool only_moves =
    std::is_nothrow_move_constructible_v<T> && std::is_nothrow_move_assignable_v<T> &&
    std::is_nothrow_default_constructible_v<T> && !std::is_copy_constructible_v<T> &&
    !std::is_copy_assignable_v<T>;
static_assert(only_moves<vg::Context> && only_moves<vg::Model> && only_moves<vg::Scene> &&
              only_moves<vg::Gaussians> && only_moves<vg::Report>);
static_assert(!std::is_convertible_v<vg::Result<int>, bool>, "a Result converts to a condition, not to a number");
static_assert(!std::is_convertible_v<vg_gaussians *, vg::Gaussians>, "taking ownership of a handle is explicit");

/// Whether `place = value` compiles.
template <class Place, class Value> constexpr bool takes = std::is_assignable_v<Place &, Value>;
using Prior = decltype(vg::Options::prior);
static_assert(takes<Prior, vg::Prior> && takes<Prior, vg_prior>);
static_assert(!takes<Prior, vg_symmetry> && !takes<Prior, vg::Symmetry> && !takes<Prior, int>,
              "the name of another enumeration is not a prior");
static_assert(!takes<decltype(vg::Options::symmetry), vg_prior> && !takes<decltype(vg::Options::keep), vg_prior> &&
              !takes<decltype(vg::Options::calibrate), vg_relight> && !takes<decltype(vg::Options::relight), int> &&
              !takes<decltype(vg::Options::refine_backend), vg_alpha> &&
              !takes<decltype(vg::ModelOptions::provider), vg_prepack> &&
              !takes<decltype(vg::ModelOptions::prepack), vg_provider> &&
              !takes<decltype(vg::RefineOptions::backend), int> &&
              !takes<decltype(vg::RenderOptions::backend), vg_format> &&
              !takes<decltype(vg::RenderOptions::background), vg_alpha> &&
              !takes<decltype(vg::RenderOptions::alpha), vg_background> &&
              !takes<decltype(vg::RenderOptions::depth_mode), vg_alpha> &&
              !takes<decltype(vg::RendererOptions::backend), vg_prior> &&
              !takes<decltype(vg::ImageTarget::color_format), vg_prior> &&
              !takes<decltype(vg::AlignOptions::heading), int>);

struct Photographs {
    std::vector<std::uint8_t> rgb = ball_rgb();
    std::vector<std::uint8_t> mask = ball_mask();
    std::vector<float> metres = ball_depth();

    vg_view view() const {
        return vg::view(vg::image(rgb.data(), side, side, VG_FORMAT_RGB8),
                        vg::image(mask.data(), side, side, VG_FORMAT_GRAY8), camera_at_right(),
                        vg::image(metres.data(), side, side, VG_FORMAT_DEPTH32F), "ball");
    }
};

void results_hold_a_value_or_an_error() {
    vg::Result<std::string> text(std::string("text"));
    CHECK(text.ok() && text && *text == "text" && text->size() == 4 && text.value() == "text");
    const std::string taken = text.take();
    CHECK(taken == "text");

    const vg::Result<std::string> none(vg::Error{VG_STATUS_IO, "gone"});
    CHECK(!none.ok() && !none && none.error().status == VG_STATUS_IO && none.error().message == "gone");

    const vg::Result<void> done;
    CHECK(done.ok() && done);
    done.take();
    CHECK(failed(vg::Result<void>(vg::Error{VG_STATUS_FORMAT, "odd"}), VG_STATUS_FORMAT, "odd"));
}

void a_value_may_be_replaced_where_there_is_none() {
    const vg::Error gone{VG_STATUS_IO, "gone"};
    const vg::Result<int> seven(7), no_number(gone);
    CHECK(seven.value_or(1) == 7 && no_number.value_or(1) == 1);
    vg::Result<vg::Context> none(gone);
    const vg::Context instead = std::move(none).value_or(vg::Context::make(1).take());
    CHECK(instead.threads() == 1);
    CHECK(std::string(vg::status_name(no_number.error().status)) == "VG_STATUS_IO");
    CHECK(std::string(vg::status_name(static_cast<vg_status>(1000))).empty());
}

void choices_are_the_numbers_of_the_c_structs() {
    vg::Options options;
    CHECK(options.prior == vg::Prior::Auto && options.prior == VG_PRIOR_AUTO && options.keep == vg::Keep::Nothing);
    options.prior = vg::Prior::Hull;
    options.symmetry = VG_SYMMETRY_NEVER;
    options.keep = vg::Keep::Overlap | vg::Keep::ShBands;
    const vg_options &in_c = options;
    CHECK(in_c.prior == VG_PRIOR_HULL && in_c.symmetry == VG_SYMMETRY_NEVER);
    CHECK(in_c.keep == (VG_KEEP_OVERLAP | VG_KEEP_SH_BANDS));

    // A copy has its own fields.
    options.on_log = [](vg_log_level, const char *) {};
    vg::Options copy = options;
    CHECK(copy.prior == vg::Prior::Hull && copy.prior != VG_PRIOR_AUTO && copy.on_log);
    copy.prior = vg::Prior::Shape;
    CHECK(options.prior == vg::Prior::Hull && static_cast<vg_options &>(copy).prior == VG_PRIOR_SHAPE);
    options = copy;
    CHECK(in_c.prior == VG_PRIOR_SHAPE);
    options.prior = vg::Options().prior;
    CHECK(in_c.prior == VG_PRIOR_AUTO && copy.prior == vg::Prior::Shape);
    const vg::Options moved = std::move(copy);
    CHECK(moved.prior == vg::Prior::Shape && moved.on_log);

    vg::RenderOptions picture;
    picture.depth_mode = vg::DepthMode::Accumulated;
    const vg::RenderOptions same_picture = picture;
    CHECK(static_cast<const vg_render_options &>(same_picture).depth_mode == VG_DEPTH_MODE_ACCUMULATED);
}

/// Checks how a program ends that takes a missing value.
void taking_what_is_not_there_ends_the_program() {
    const pid_t child = fork();
    if (child == 0) {
        CHECK(std::freopen("/dev/null", "w", stderr) != nullptr);
        vg::Result<vg::Gaussians> none(vg::Error{VG_STATUS_IO, "gone"});
        const vg::Gaussians taken = none.take();
        std::exit(0);
    }
    int status = 0;
    CHECK(child > 0 && waitpid(child, &status, 0) == child);
    CHECK(WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT);
}

void handles_move_and_leave_nothing_behind() {
    vg::Context first = vg::Context::make(2).take();
    CHECK(first.threads() == 2 && first.get() != nullptr);
    vg::Context second = std::move(first);
    CHECK(second.threads() == 2 && first.get() == nullptr && first.threads() == 0);
    first = std::move(second);
    CHECK(first.threads() == 2 && second.get() == nullptr);
    const vg::Context owned(first.release());
    CHECK(owned.threads() == 2 && first.get() == nullptr);
    CHECK(failed(vg::Context::make(100000), VG_STATUS_ARGUMENT, "threads"));
}

void what_is_empty_is_harmless() {
    const vg::Gaussians none;
    CHECK(none.empty() && none.sh_degree() == 0 && none.positions().empty() && none.sh().empty());
    CHECK(none.positions().begin() == none.positions().end());
    CHECK(failed(none.mirrored(), VG_STATUS_ARGUMENT, "gaussians"));
    CHECK(failed(none.save_ply("nowhere.ply"), VG_STATUS_ARGUMENT, "gaussians"));
    CHECK(failed(vg::render(none, camera_at_right()), VG_STATUS_ARGUMENT, "gaussians"));
    const vg::Report report;
    CHECK(report.figures().gaussian_count == 0 && std::strlen(report.json()) == 0 &&
          report.point_colors().empty());
    const vg::Scene scene;
    CHECK(scene.size() == 0 && scene.views()->empty());
    CHECK(failed(scene.view(0), VG_STATUS_ARGUMENT, "scene"));
    CHECK(failed(vg::reconstruct({}), VG_STATUS_ARGUMENT, "view"));
}

void cameras_are_made_moved_scaled_and_cropped() {
    const vg_camera camera = vg::pinhole(100, 110, 31.5, 24, 63, 48).take();
    CHECK(camera.struct_size == sizeof(vg_camera) && camera.params[1] == 110);
    const auto pixel = vg::project(camera, {0.5, -0.25, 2}).take();
    CHECK(pixel[0] == 100 * 0.25 + 31.5 && pixel[1] == 110 * -0.125 + 24);
    CHECK(failed(vg::project(camera, {0, 0, -1}), VG_STATUS_ARGUMENT, "point"));
    CHECK(vg::placed(camera, pose_at_right()).vehicle_from_camera[7] == -4);
    CHECK(vg::scaled(camera, 126, 96)->params[0] == 200);
    CHECK(vg::cropped(camera, 10, 8, 20, 16)->params[2] == 21.5);
    CHECK(failed(vg::cropped(camera, 60, 0, 20, 16), VG_STATUS_ARGUMENT, "allowed"));
    CHECK(failed(vg::pinhole(100, 110, 31.5, 24, 0, 48), VG_STATUS_ARGUMENT, "0x48"));
    CHECK(failed(vg::camera_from_colmap(9, {1, 2, 3}, 63, 48), VG_STATUS_ARGUMENT, "model"));

    const std::array<double, 9> k{100, 0, 31, 0, 110, 23.5, 0, 0, 1};
    const vg_camera opencv = vg::camera_from_opencv(k, {}, vg::Lens::Standard, 63, 48).take();
    CHECK(std::memcmp(opencv.params, camera.params, sizeof camera.params) == 0);
    CHECK(vg::camera_from_opencv(k, {0.1, 0.01, 0, 0}, vg::Lens::Fisheye, 63, 48)->model ==
          VG_CAMERA_MODEL_OPENCV_FISHEYE);

    const vg::Similarity doubled{2, 0, 0, 1, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
    CHECK(vg::pose_from_colmap({1, 0, 0, 0}, {1, 2, 3}).value()[11] == -3);
    CHECK(vg::pose_from_colmap({1, 0, 0, 0}, {1, 2, 3}, &doubled).value()[3] == -1);
    CHECK(vg::pose_from_opengl(vg::identity_pose).value()[5] == -1);
    CHECK(vg::pose_from_box(vg::identity_pose, pose_at_right()).value() == pose_at_right());
    CHECK(failed(vg::pose_from_colmap({0, 0, 0, 0}, {1, 2, 3}), VG_STATUS_ARGUMENT, "qvec"));
}

bool near(double a, double b) {
    return std::abs(a - b) < 1e-9;
}

void cameras_look_at_points_and_points_go_to_pixels_and_back() {
    const vg_camera camera = vg::look_at({0, -5, 1}, {0, 0, 1}, 90, 64, 48).take();
    CHECK(near(camera.params[0], 24) && near(camera.vehicle_from_camera[7], -5));
    const vg::Pose pose = vg::pose_look_at({0, -5, 1}, {0, 0, 1}).take();
    const vg::Pose by_opencv = vg::pose_from_opencv({1.5707963267948966, 0, 0}, {0, 1, 5}).take();
    for (std::size_t i = 0; i < 12; i++) {
        CHECK(near(pose[i], camera.vehicle_from_camera[i]) && near(pose[i], by_opencv[i]));
    }
    const std::vector<vg::Point> points{{0.5, 0, 1}, {0, -9, 1}, {0, 0, 2}};
    const vg::Projected seen = vg::project(camera, points).take();
    CHECK(near(seen.pixels[0][0], 34.4) && near(seen.depths[2], 5) && std::isnan(seen.pixels[1][0]));
    const std::vector<vg::Point> back = vg::unproject(camera, seen.pixels, seen.depths).take();
    CHECK(near(back[0][0], 0.5) && std::isnan(back[1][2]) && near(back[2][2], 2));
    CHECK(near(vg::unproject(camera, seen.pixels[2], 5).value()[2], 2));
    CHECK(vg::project(camera, std::vector<vg::Point>{})->pixels.empty());
    CHECK(failed(vg::unproject(camera, seen.pixels, {}), VG_STATUS_ARGUMENT, "depths: 0"));
    CHECK(failed(vg::unproject(camera, vg::Pixel{1, 1}, 0), VG_STATUS_ARGUMENT, "depth_m"));
    CHECK(failed(vg::look_at({0, 0, 1}, {0, 0, 0}, 90, 64, 48), VG_STATUS_ARGUMENT, "up: "));
    CHECK(vg::look_at({0, 0, 1}, {0, 0, 0}, 90, 64, 48, {1, 0, 0}).ok());
}

vg::Reconstruction ball() {
    const Photographs photographs;
    std::vector<std::string> stages;
    std::vector<std::string> lines;
    vg::Options options;
    options.points = 1;
    options.on_progress = [&](const char *stage, double fraction) {
        CHECK(fraction >= 0 && fraction <= 1);
        stages.emplace_back(stage);
        return vg::Flow::Continue;
    };
    options.on_log = [&](vg_log_level level, const char *line) {
        CHECK(level >= VG_LOG_LEVEL_WARNING && level <= VG_LOG_LEVEL_DEBUG);
        lines.emplace_back(line);
    };
    vg::Reconstruction made = vg::reconstruct({photographs.view()}, options).take();
    CHECK(!stages.empty() && !lines.empty());
    CHECK(made.report.figures().gaussian_count == made.gaussians.size());
    CHECK(made.report.figures().prior == VG_PRIOR_GIVEN);
    CHECK(std::strstr(made.report.json(), "ball") != nullptr);
    CHECK(made.report.point_positions().size() == made.report.point_colors().size());
    CHECK(!made.report.point_positions().empty());
    return made;
}

void a_cloud_is_lent() {
    const Photographs photographs;
    std::vector<std::array<float, 3>> cloud(5, {0.0F, 0.0F, 0.5F});
    vg::Options options;
    CHECK(options.cloud == nullptr && options.photo == 1 && options.budget_s == 0);
    CHECK(options.resolution == 1 && options.max_views == 0 && options.max_gaussians == 12000000);
    options.lend_cloud(cloud);
    CHECK(options.cloud == cloud[0].data() && options.cloud_count == 5);
    // Given depth is complete: the report counts the unused points.
    const vg::Reconstruction made = vg::reconstruct({photographs.view()}, options).take();
    CHECK(std::strstr(made.report.json(), "\"count\": 5") != nullptr);
    CHECK(made.report.figures().cloud_used == 0);
    cloud[3][1] = std::numeric_limits<float>::quiet_NaN();
    CHECK(failed(vg::reconstruct({photographs.view()}, options), VG_STATUS_ARGUMENT, "options.cloud[3]"));
    cloud.clear();
    options.lend_cloud(cloud);
    CHECK(options.cloud == nullptr && options.cloud_count == 0);
}

/// Determines whether the library has networks.
void models_are_opened_and_lent() {
    vg::ModelOptions settings;
    CHECK(settings.runtime == nullptr && settings.provider == VG_PROVIDER_CPU && settings.threads == 0);
    settings.runtime_path = "/nowhere/libonnxruntime.so";
    const vg::Result<vg::Model> none = vg::Model::open("/nowhere/m.onnx", settings);
    CHECK(!none);
    const bool built = none.error().status == VG_STATUS_IO;
    CHECK(built || none.error().status == VG_STATUS_NOT_BUILT);
    CHECK(failed(vg::Model::open("/nowhere/m.onnx"), none.error().status, built ? "m.onnx" : "feature onnx"));
    settings.threads = 1025;
    CHECK(failed(vg::Model::open("/nowhere/m.onnx", settings), VG_STATUS_ARGUMENT, "options.threads: 1025"));

    const Photographs photographs;
    const vg::Model empty;
    vg::Options options;
    options.lend_head(empty);
    CHECK(options.head_model == nullptr && options.prior == VG_PRIOR_AUTO);
    options.lend_prior(empty);
    CHECK(options.prior_model == nullptr && options.prior == VG_PRIOR_ONNX);
    CHECK(failed(vg::reconstruct({photographs.view()}, options),
                 built ? VG_STATUS_ARGUMENT : VG_STATUS_NOT_BUILT, "options.prior"));

    const vg_view view = photographs.view();
    CHECK(failed(vg::segment(empty, view.image, view.camera),
                 built ? VG_STATUS_ARGUMENT : VG_STATUS_NOT_BUILT, "model"));
    CHECK(failed(vg::segment(empty, vg_image{}, view.camera), VG_STATUS_ARGUMENT, "image.data"));
    vg_image odd = view.image;
    odd.width = 4000000000;
    CHECK(failed(vg::segment(empty, odd, view.camera), VG_STATUS_ARGUMENT, "image: 4000000000"));
}

void callbacks_stop_a_reconstruction() {
    const Photographs photographs;
    int calls = 0;
    vg::Options options;
    options.on_progress = [&calls](const char *, double) {
        calls++;
        return calls == 2 ? vg::Flow::Cancel : vg::Flow::Continue;
    };
    CHECK(failed(vg::reconstruct({photographs.view()}, options), VG_STATUS_CANCELLED, ""));
    CHECK(calls == 2);
}

void errors_name_the_argument() {
    const Photographs photographs;
    vg_view view = photographs.view();
    view.mask.width = 7;
    CHECK(failed(vg::reconstruct({view}), VG_STATUS_ARGUMENT, "views[0] (ball).mask"));
    vg::Options options;
    options.sh_degree = 7;
    CHECK(failed(vg::reconstruct({photographs.view()}, options), VG_STATUS_ARGUMENT, "sh_degree"));
    CHECK(failed(vg::Gaussians::load_ply("/nowhere.ply"), VG_STATUS_IO, "/nowhere.ply"));
    CHECK(failed(vg::Scene::open_transforms("/nowhere"), VG_STATUS_IO, "/nowhere"));
    vg::SceneOptions scene_options;
    scene_options.view_names = {"000"};
    CHECK(failed(vg::Scene::open_colmap("/nowhere", scene_options), VG_STATUS_IO, "/nowhere"));
}

void gaussians_are_saved_derived_and_made_of_arrays(const vg::Gaussians &car, const std::string &scratch) {
    CHECK(car.positions().size() == 3 * car.size() && car.rotations().size() == 4 * car.size());
    CHECK(car.scales()[0] > 0 && car.opacities().size() == car.size());
    CHECK(size_seen_by_the_other_file(car) == car.size());
#if __cplusplus >= 202002L
    const std::span<const float> positions = car.positions();
    CHECK(positions.data() == car.positions().data() && positions.size() == 3 * car.size());
#endif
    const vg::Gaussians twice = car.mirrored().take().mirrored().take();
    CHECK(same(car, twice));
    CHECK(car.merged(twice)->size() == 2 * car.size());
    const vg::Similarity raised{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 10, 0, 0, 0, 1};
    CHECK(car.transformed(raised)->positions()[2] > 8);

    CHECK(car.save_ply(scratch + "/ball.ply").ok());
    CHECK(vg::Gaussians::load_ply(scratch + "/ball.ply")->size() == car.size());

    vg::GaussianArrays arrays;
    arrays.count = car.size();
    arrays.sh_degree = car.sh_degree();
    arrays.positions = car.positions().data();
    arrays.scales = car.scales().data();
    arrays.rotations = car.rotations().data();
    arrays.opacities = car.opacities().data();
    arrays.sh = car.sh().data();
    CHECK(vg::Gaussians::from_arrays(arrays)->size() == car.size());
    arrays.sh = nullptr;
    CHECK(failed(vg::Gaussians::from_arrays(arrays), VG_STATUS_ARGUMENT, "sh"));
}

void gaussians_are_selected_cropped_and_written_to_memory(const vg::Gaussians &car) {
    const vg::Gaussians two = car.selected({1, 0}).take();
    CHECK(two.size() == 2 && !(two.positions()[0] < car.positions()[3]) && !(two.positions()[0] > car.positions()[3]));
    CHECK(failed(car.selected({car.size()}), VG_STATUS_ARGUMENT, "indices[0]"));
    const double far = std::numeric_limits<double>::infinity();
    const vg::Gaussians front = car.cropped({0, -far, -far}, {far, far, far}).take();
    std::vector<std::uint8_t> keep;
    for (std::size_t i = 0; i < car.size(); i++) {
        keep.push_back(car.positions()[3 * i] >= 0);
    }
    CHECK(front.size() < car.size() && same(front, car.masked(keep).take()));
    CHECK(failed(car.masked({1}), VG_STATUS_ARGUMENT, "keep_count: 1"));
    CHECK(same(car, car.with_opacity_of(0).take()) && car.with_opacity_of(2)->empty());

    const auto covariances = car.covariances().take();
    const vg::Span<const float> scales = car.scales();
    const double trace = covariances[0][0] + covariances[0][3] + covariances[0][5];
    CHECK(near(trace, scales[0] * scales[0] + scales[1] * scales[1] + scales[2] * scales[2]));

    const std::vector<std::uint8_t> file = car.to_ply().take();
    const vg::Gaussians read = vg::Gaussians::from_ply(file).take();
    CHECK(read.size() == car.size() && read.to_ply()->size() == file.size());
    CHECK(std::memcmp(read.positions().data(), car.positions().data(), 3 * car.size() * sizeof(float)) == 0);
    CHECK(failed(vg::Gaussians::from_ply(file.data(), 100), VG_STATUS_FORMAT, "PLY in memory"));
    CHECK(failed(vg::Gaussians().to_ply(), VG_STATUS_ARGUMENT, "gaussians"));

    const std::vector<vg_camera> around = vg::turntable(car, 4, 64, 48).take();
    CHECK(around.size() == 4 && around[0].vehicle_from_camera[3] > 1 && around[1].vehicle_from_camera[7] > 1);
    CHECK(failed(vg::turntable(car, 0, 64, 48), VG_STATUS_ARGUMENT, "count: 0"));
    CHECK(failed(vg::turntable(car, 1000000000, 64, 48), VG_STATUS_ARGUMENT, "count: 1000000000"));
    CHECK(failed(vg::turntable(vg::Gaussians(), 3, 64, 48), VG_STATUS_ARGUMENT, "gaussians"));
}

void gaussians_are_refined(const vg::Gaussians &car) {
    const Photographs photographs;
    vg::RefineOptions options;
    CHECK(options.iterations == 300 && options.backend == vg::Backend::Auto);
    options.iterations = 4;
    int calls = 0;
    options.on_progress = [&calls](const char *, double) {
        calls++;
        return vg::Flow::Continue;
    };
    const vg::Refined refined = vg::refine(car, {photographs.view()}, options).take();
    CHECK(refined.gaussians.size() == car.size() && refined.refinement.made == 4 && calls > 0);
    CHECK(refined.refinement.psnr_after_db >= refined.refinement.psnr_before_db);
    options.on_progress = [](const char *, double) { return vg::Flow::Cancel; };
    CHECK(failed(vg::refine(car, {photographs.view()}, options), VG_STATUS_CANCELLED, ""));
    CHECK(failed(vg::refine(vg::Gaussians(), {photographs.view()}), VG_STATUS_ARGUMENT, "gaussians"));
}

void pictures_own_their_pixels(const vg::Gaussians &car) {
    const vg_camera camera = camera_at_right();
    const vg::Picture rgb = vg::render(car, camera, {}, VG_FORMAT_RGB8).take();
    CHECK(rgb.width == side && rgb.height == side && rgb.color.size() == side * side * 3);
    const std::size_t centre = side / 2 * side + side / 2;
    CHECK(rgb.color[3 * centre] > 150 && rgb.color[3 * centre + 2] < 120 && rgb.color[0] == 255);
    CHECK(rgb.depth[centre] > 2 && rgb.depth[centre] < 4 && !(rgb.depth[0] > 0));

    vg::RenderOptions options;
    options.background = VG_BACKGROUND_TRANSPARENT;
    const vg::Picture bgra = vg::render(car, camera, options, VG_FORMAT_BGRA8).take();
    CHECK(bgra.color[4 * centre] < 120 && bgra.color[4 * centre + 2] > 150);
    CHECK(bgra.color[4 * centre + 3] > 200 && bgra.color[3] == 0);
    CHECK(failed(vg::render(car, camera, options, VG_FORMAT_RGB8), VG_STATUS_ARGUMENT, "color_format"));
    CHECK(failed(vg::render(car, camera, {}, VG_FORMAT_GRAY8), VG_STATUS_ARGUMENT, "format"));
    vg_camera odd = camera;
    odd.width = 4000000000;
    odd.height = 4000000000;
    CHECK(failed(vg::render(car, odd), VG_STATUS_ARGUMENT, "4000000000"));

    const vg::Context context = vg::Context::make(1).take();
    vg::RenderOptions with_context;
    with_context.context = context.get();
    std::vector<float> metres(side * side);
    vg::ImageTarget target;
    target.width = side;
    target.height = side;
    target.depth = metres.data();
    CHECK(vg::render_into(target, car, camera, with_context).ok());
    vg::RendererOptions on_cpu;
    on_cpu.backend = VG_BACKEND_CPU;
    const vg::Renderer ready = vg::Renderer::make(car, on_cpu).take();
    CHECK(ready.backend() == VG_BACKEND_CPU && std::string(ready.choice()).find("asked for") != std::string::npos);
    // Outputs of one call must not overlap.
    std::vector<float> others(metres.size());
    vg::ImageTarget other = target;
    other.depth = others.data();
    const vg_image_target both[] = {target, other};
    const vg_camera from_both[] = {camera, camera};
    CHECK(ready.render_into(both, from_both, 2, with_context).ok() && ready.render_into(target, camera).ok());
    CHECK(failed(ready.render_into(nullptr, nullptr, 0), VG_STATUS_ARGUMENT, "count"));
    CHECK(failed(vg::Renderer::make(vg::Gaussians()), VG_STATUS_ARGUMENT, "gaussians"));
    CHECK(metres == rgb.depth);
}

void gradients_own_their_numbers_and_a_loss_sees_the_picture(const vg::Gaussians &car) {
    const vg_camera camera = camera_at_right();
    constexpr std::size_t pixels = std::size_t{side} * side;
    std::vector<float> picture(pixels * 4), of_color(pixels * 3, 1.0F);
    vg::ImageTarget target;
    target.width = side;
    target.height = side;
    target.color = picture.data();
    target.color_format = VG_FORMAT_RGBA32F;
    vg::ImageGradient gradient;
    gradient.width = side;
    gradient.height = side;
    gradient.color = of_color.data();
    const vg::Gradients whole = vg::render_backward(car, camera, gradient).take();
    CHECK(whole.positions.size() == car.positions().size() && whole.sh.size() == car.sh().size());
    CHECK(whole.rotations.size() == 4 * car.size() && whole.opacities.size() == car.size());
    // Outside the car, a brighter background gives an equally brighter picture.
    CHECK(whole.background[0] > 1 && whole.background[0] < pixels && whole.view_matrix[12] == 0);

    int calls = 0;
    vg::Gradients again;
    const vg::LossCallback loss = [&] {
        calls += 1;
        CHECK(picture[3] == 1);
        return vg::Flow::Continue;
    };
    CHECK(vg::render_with_gradients(again, target, car, camera, gradient, loss).ok());
    CHECK(calls == 1 && again.positions == whole.positions && again.pose == whole.pose && again.sh == whole.sh);
    const auto stop = [] { return vg::Flow::Cancel; };
    CHECK(failed(vg::render_with_gradients(again, target, car, camera, gradient, stop), VG_STATUS_CANCELLED, "loss"));
    CHECK(vg::render_with_gradients(again, target, car, camera, gradient, {}).ok());
    gradient.color = nullptr;
    CHECK(failed(vg::render_backward(car, camera, gradient), VG_STATUS_ARGUMENT, "gradient"));
    CHECK(failed(vg::render_backward(vg::Gaussians(), camera, gradient), VG_STATUS_ARGUMENT, "gaussians"));
}

} // namespace

void worlds_are_aligned() {
    vg::WorldPoints vehicle;
    vg::WorldPoints world;
    for (int i = 0; i < 7; i++) {
        vehicle.push_back({1.0 * (i % 2), 1.0 * (i / 2 % 2), 0.5 * (i / 4)});
        world.push_back({4 * vehicle.back()[0] - 1, 4 * vehicle.back()[1], 4 * vehicle.back()[2]});
    }
    world[3][2] += 2;
    std::vector<std::uint8_t> kept;
    const vg_alignment found = vg::align_points(world, vehicle, &kept).take();
    CHECK(std::abs(found.scale - 0.25) < 1e-12 && std::abs(found.vehicle_from_world[3] - 0.25) < 1e-12);
    CHECK(found.used_count == 6 && kept.size() == 7 && kept[3] == 0 && kept[0] == 1);
    CHECK(vg::align_points(world, vehicle).ok());
    CHECK(failed(vg::align_points(world, {}), VG_STATUS_ARGUMENT, "vehicle: 0"));
    CHECK(failed(vg::align_points({}, {}), VG_STATUS_ARGUMENT, "count: 0"));

    const Photographs photographs;
    const std::vector<vg_view> views(3, photographs.view());
    const std::vector<std::array<float, 3>> scan(3);
    const vg::AlignOptions forward(VG_HEADING_FORWARD);
    CHECK(forward.heading == VG_HEADING_FORWARD && vg::AlignOptions().heading == VG_HEADING_AUTO);
    CHECK(failed(vg::align_scan(views, {}, scan), VG_STATUS_ARGUMENT, "scan: 3 points"));
    CHECK(failed(vg::align_scan({}, {}, scan), VG_STATUS_ARGUMENT, "view_count: 0"));
    CHECK(failed(vg::align_box(views, {}, {4.5, 1.8, 1.5}, forward), VG_STATUS_ARGUMENT, "sparse: 0 points"));
    CHECK(failed(vg::align_folder("nowhere", "scan.ply"), VG_STATUS_IO, "scan.ply"));
}

void models_are_measured(const vg::Gaussians &ball) {
    const Photographs photographs;
    const vg_view view = photographs.view();
    const vg_view_errors seen = vg::view_errors(ball, view).take();
    CHECK(seen.psnr_db > 15 && seen.ssim > 0.5 && seen.silhouette_iou > 0.9 && seen.depth_mae_m < 0.1);
    CHECK(std::isnan(seen.lpips));
    CHECK(vg::picture_errors(view.image, view.image)->ssim == 1);

    std::vector<std::array<float, 3>> points(ball.size());
    const vg::Span<const float> centres = ball.positions();
    for (std::size_t i = 0; i < points.size(); i++) {
        points[i] = {centres[3 * i], centres[3 * i + 1], centres[3 * i + 2]};
    }
    vg::MetricsOptions options;
    CHECK(options.f_score_m == 0.05);
    CHECK(vg::surface_errors(ball, points, options)->accuracy_m < 0.1);
    CHECK(failed(vg::surface_errors(ball, {}), VG_STATUS_ARGUMENT, "point_count: 0"));
    options.f_score_m = 0;
    CHECK(failed(vg::surface_errors(ball, points, options), VG_STATUS_ARGUMENT, "options.f_score_m"));
    const vg::Model empty;
    options.lend_lpips(empty);
    CHECK(options.lpips == nullptr);
    vg_image smaller = view.image;
    smaller.height -= 1;
    CHECK(failed(vg::picture_errors(view.image, smaller), VG_STATUS_ARGUMENT, "b: "));
}

int main(int argc, char **argv) {
    CHECK(argc == 2);
    CHECK(std::string(vg::version()).find('.') != std::string::npos);
    results_hold_a_value_or_an_error();
    a_value_may_be_replaced_where_there_is_none();
    choices_are_the_numbers_of_the_c_structs();
    taking_what_is_not_there_ends_the_program();
    handles_move_and_leave_nothing_behind();
    what_is_empty_is_harmless();
    cameras_are_made_moved_scaled_and_cropped();
    cameras_look_at_points_and_points_go_to_pixels_and_back();
    callbacks_stop_a_reconstruction();
    a_cloud_is_lent();
    models_are_opened_and_lent();
    errors_name_the_argument();
    const vg::Reconstruction made = ball();
    gaussians_are_saved_derived_and_made_of_arrays(made.gaussians, argv[1]);
    gaussians_are_selected_cropped_and_written_to_memory(made.gaussians);
    gaussians_are_refined(made.gaussians);
    pictures_own_their_pixels(made.gaussians);
    gradients_own_their_numbers_and_a_loss_sees_the_picture(made.gaussians);
    models_are_measured(made.gaussians);
    worlds_are_aligned();
    return 0;
}
